//! A disk that is soon full: a file system of its own, in memory, that is there for one run.

use assert_cmd::Command;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// What became of a run.
pub(crate) struct Ended {
    pub(crate) code: Option<i32>,
    pub(crate) told: String,
    /// The files that are on the disk then, hidden ones too, by their path from its root.
    pub(crate) files: BTreeMap<String, Vec<u8>>,
}

/// Runs the program in a folder, of which `disk` is a disk with room for 64 kB that holds these files. None where
/// nobody may mount one.
pub(crate) fn on_a_small_disk(folder: &Path, files: &[(&str, &[u8])], args: &[&str]) -> Option<Ended> {
    let unshare = || {
        let mut command = std::process::Command::new("unshare");
        command.arg("-rm").current_dir(folder);
        command
    };
    if !unshare().arg("true").output().is_ok_and(|output| output.status.success()) {
        assert_ne!(std::env::var("CI").as_deref(), Ok("true"), "in CI a disk can be mounted");
        eprintln!("SKIPPED: `unshare -rm` is not permitted, so there is no small disk");
        return None;
    }
    for name in ["before", "disk", "after"] {
        let _ = fs::remove_dir_all(folder.join(name));
        fs::create_dir(folder.join(name)).unwrap();
    }
    for (name, bytes) in files {
        let path = folder.join("before").join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
    let script = "mount -t tmpfs -o size=64k none disk && cp -r before/. disk || exit 99
        \"$0\" \"$@\"; code=$?; cp -r disk/. after; exit $code";
    let program = Command::cargo_bin("host").unwrap().get_program().to_owned();
    let output = unshare().args(["sh", "-c", script]).arg(program).args(args).output().unwrap();
    let mut left = BTreeMap::new();
    collect(&folder.join("after"), "", &mut left);
    Some(Ended { code: output.status.code(), told: String::from_utf8(output.stderr).unwrap(), files: left })
}

fn collect(folder: &Path, name: &str, files: &mut BTreeMap<String, Vec<u8>>) {
    for entry in fs::read_dir(folder).unwrap() {
        let entry = entry.unwrap();
        let name = format!("{name}{}", entry.file_name().display());
        if entry.path().is_dir() {
            collect(&entry.path(), &format!("{name}/"), files);
        } else {
            files.insert(name, fs::read(entry.path()).unwrap());
        }
    }
}
