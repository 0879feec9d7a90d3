//! The program as its users meet it: the binary, its exit codes, what it prints and the files it leaves.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};
use std::sync::LazyLock;

use assert_cmd::Command;
use host::calibration::{Lens, StereoCamera};
use host::mesh::Mesh;
use host::shape::Shape;
use nalgebra::{Rotation3, Vector3};
use serde_json::Value;
use tempfile::TempDir;

#[cfg(target_os = "linux")]
mod disk;
mod pairs;
mod refusals;
mod rendered;

/// A quarter of the usual pixels: quick, and enough to tell right from wrong.
const SMALL: [&str; 4] = ["--size", "320x240", "--focal", "375"];

/// A small pair of a torus: left.png, right.png, calib.yaml, truth.ply.
static TORUS: LazyLock<TempDir> = LazyLock::new(|| {
    let folder = TempDir::new().unwrap();
    let mut args = vec!["render", "torus", "--out", folder.path().to_str().unwrap()];
    args.extend(SMALL);
    good(Path::new("."), &args);
    folder
});

fn torus(name: &str) -> String {
    TORUS.path().join(name).display().to_string()
}

fn run(folder: &Path, args: &[&str]) -> Output {
    Command::cargo_bin("host").unwrap().current_dir(folder).args(args).output().unwrap()
}

/// Standard output of a run that succeeds.
fn good(folder: &Path, args: &[&str]) -> String {
    let output = run(folder, args);
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{args:?}: {told}");
    String::from_utf8(output.stdout).unwrap()
}

/// Standard error of a run that fails with a code.
fn bad(folder: &Path, args: &[&str], code: i32) -> String {
    let output = run(folder, args);
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{args:?}: {told}");
    assert!(told.starts_with("error: "), "{told}");
    told
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

/// The bytes of every file that a run leaves, but for the times in the report.
fn results(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let read = |name: &str| fs::read(folder.join(name)).unwrap();
    let mut report = json(std::str::from_utf8(&read("report.json")).unwrap());
    assert!(report.as_object_mut().unwrap().remove("times_ms").is_some());
    let mut files: Vec<_> =
        ["model.ply", "skeleton.ply", "boundary.ply"].map(|name| (name.to_owned(), read(name))).to_vec();
    files.push(("report.json".into(), report.to_string().into_bytes()));
    files
}

/// What two torus files give.
fn expected() -> Vec<(String, Vec<u8>)> {
    static RESULTS: LazyLock<Vec<(String, Vec<u8>)>> = LazyLock::new(|| {
        let folder = TempDir::new().unwrap();
        good(
            folder.path(),
            &["replay", &torus("left.png"), &torus("right.png"), "--no-pictures", "--jobs", "1"],
        );
        results(&folder.path().join("ossature-out"))
    });
    RESULTS.clone()
}

#[test]
fn help_shows_how() {
    for args in [
        &["--help"][..],
        &["replay", "--help"],
        &["demo", "--help"],
        &["render", "--help"],
        &["evaluate", "--help"],
        &["convert", "--help"],
    ] {
        assert!(good(Path::new("."), args).contains("Examples:"), "{args:?}");
    }
    assert_eq!(good(Path::new("."), &["--version"]), concat!("host ", env!("CARGO_PKG_VERSION"), "\n"));
}

#[test]
fn convert_says_what_a_format_has_no_place_for() {
    let folder = TempDir::new().unwrap();
    let known = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                 property float confidence\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
                 0 0 0 1\n1 0 0 1\n0 1 0 1\n3 0 1 2\n";
    fs::write(folder.path().join("a.ply"), known).unwrap();
    let left_out = |output: &str| {
        let told = json(&good(folder.path(), &["convert", "a.ply", output, "--json"]));
        (told["left_out"].clone(), good(folder.path(), &["convert", "a.ply", output]).contains("left out"))
    };
    for output in ["b.stl", "b.obj"] {
        assert_eq!(left_out(output), ("confidence".into(), true), "{output}");
    }
    for output in ["b.ply", "b.glb"] {
        assert_eq!(left_out(output), (Value::Null, false), "{output}");
    }
}

#[test]
fn every_command_has_a_manual_page() {
    let folder = TempDir::new().unwrap();
    good(folder.path(), &["man", "pages"]);
    let pages = folder.path().join("pages");
    let main = fs::read_to_string(pages.join("host.1")).unwrap();
    for name in ["replay", "capture", "listen", "demo", "convert", "man"] {
        assert!(main.contains(&format!("host\\-{name}(1)")), "{name}");
        assert!(
            fs::read_to_string(pages.join(format!("host-{name}.1"))).unwrap().contains("Examples:"),
            "{name}"
        );
    }
}
