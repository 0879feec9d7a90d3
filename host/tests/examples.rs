//! The examples, run: what a reader copies works.

use host::calibration::StereoCamera;
use host::mesh::read::read;
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;

/// What an example of a package prints. `cargo test` has built it; where one test alone is run, it may have to be.
fn example(package: &str, name: &str, args: &[&Path]) -> String {
    let host = assert_cmd::cargo::cargo_bin("host");
    let built = host.with_file_name("examples").join(name);
    let mut command = if built.is_file() {
        Command::new(built)
    } else {
        let mut cargo = Command::new(env!("CARGO"));
        cargo.args(["run", "--quiet", "--package", package, "--example", name, "--"]);
        cargo
    };
    let output = command.args(args).output().unwrap();
    assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// A small pair of a torus in a folder.
fn torus() -> TempDir {
    let folder = TempDir::new().unwrap();
    let render = ["render", "torus", "--size", "320x240", "--focal", "375", "--out"];
    let mut program = assert_cmd::Command::cargo_bin("host").unwrap();
    program.args(render).arg(folder.path().join("torus")).assert().success();
    folder
}

#[test]
fn a_pair_becomes_a_mesh() {
    let folder = torus();
    let at = |name: &str| folder.path().join(name);
    let (left, right, calibration) = (at("torus/left.png"), at("torus/right.png"), at("torus/calib.yaml"));
    let said = example("host", "pair_to_mesh", &[&left, &right, &calibration, &at("model.stl")]);
    // Of a torus of radii 40 and 20 mm: 2 pi^2 40 20^2.
    let volume = read(&at("model.stl")).unwrap().volume();
    assert!((volume / 315_827.0 - 1.0).abs() < 0.03, "{volume}");
    assert!(said.ends_with(&format!("{:.1} cm3\n", volume / 1000.0)), "{said}");
}

#[test]
fn many_pairs_share_a_workspace() {
    let folder = torus();
    let pair = folder.path().join("torus");
    std::fs::create_dir(folder.path().join("swapped")).unwrap();
    for (from, to) in [("left.png", "right.png"), ("right.png", "left.png"), ("calib.yaml", "calib.yaml")] {
        std::fs::copy(pair.join(from), folder.path().join("swapped").join(to)).unwrap();
    }
    let said = example("host", "many_pairs", &[folder.path()]);
    assert!(said.starts_with("swapped: ") && said.contains("docs/gates/swapped-eyes.md"), "{said}");
    assert!(said.lines().nth(1).is_some_and(|line| line.starts_with("torus: ")), "{said}");
}

#[test]
fn a_calibration_tells_its_cameras() {
    let folder = torus();
    let (input, output) = (folder.path().join("torus/calib.yaml"), folder.path().join("opencv.yaml"));
    let said = example("host", "calibration", &[&input, &output]);
    assert!(said.starts_with("320x240 px, focal length 375.0 px\n60.00 mm between the eyes\n"), "{said}");
    assert_eq!(StereoCamera::read(&input).unwrap(), StereoCamera::read(&output).unwrap());
}

#[test]
fn the_core_runs_in_a_static() {
    let said = example("shared", "sketch", &[]);
    assert!(said.ends_with("radius 6 px, 431 mm away\n"), "{said}");
    assert_eq!(said.matches("a curve of").count(), 3, "{said}");
}

#[test]
fn the_core_can_be_looked_on() {
    let said = example("shared", "watch", &[]);
    // Three kept, of a pair of 120 rows each.
    assert!(said.contains("both: 3 curves of 29 control points\n"), "{said}");
    assert!(said.ends_with("the median ran on 240 rows\n"), "{said}");
}

/// Eight threads without any luck, good or bad: 1,000 pairs of a second take 125 s.
#[test]
fn the_simulated_queue_takes_what_arithmetic_says() {
    let flags = "--pairs 1000 --threads 8 --pair-ms 1000 --spread 0 --server-us 0 --failure-h 1e9";
    let flags: Vec<&Path> = flags.split(' ').map(Path::new).collect();
    let said = example("host", "queue", &flags);
    let row: Vec<&str> = said.lines().nth(1).unwrap().split_whitespace().collect();
    assert_eq!(row, ["8", "0.035", "8.0", "100.0", "%", "0.0", "%", "0"], "{said}");
}
