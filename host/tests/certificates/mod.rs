//! Certificates, made by the very lines that the documents give.

use std::fs;
use std::path::Path;
use std::process::Command;

/// Whether there is no openssl, which is said loudly, and in CI a failure.
pub(crate) fn skipped() -> bool {
    let missing = Command::new("openssl").arg("version").output().is_err();
    if missing {
        assert_ne!(std::env::var("CI").as_deref(), Ok("true"), "in CI there must be openssl");
        eprintln!("SKIPPED: there is no openssl, so NO certificate is tried");
    }
    missing
}

/// Makes those of `docs/fleet.md`: an authority, and what it signed for a router and for a board.
pub(crate) fn make(folder: &Path) {
    let document = document("fleet.md");
    let commands = blocks(&document, "sh").find(|block| block.contains("openssl")).unwrap();
    let made = Command::new("sh").args(["-ec", commands]).current_dir(folder).output().unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
}

/// The text of a document.
pub(crate) fn document(name: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs").join(name)).unwrap()
}

/// The blocks of a document that are of this kind.
pub(crate) fn blocks<'a>(document: &'a str, kind: &'a str) -> impl Iterator<Item = &'a str> {
    let fenced = document.split("```").skip(1).step_by(2);
    fenced.filter_map(move |block| block.strip_prefix(kind)?.strip_prefix('\n'))
}
