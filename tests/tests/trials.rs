//! A few of each of the long trials, in the same words: pairs and kills without end, a device with faults, machines.
//!
//! `cargo run --release -p system-tests --bin trials -- --help` tells of the long ones.

use assert_cmd::Command;

/// Runs a trial; what it tells is shown where it fails, and by `--nocapture`.
fn trial(arguments: &[&str]) {
    let done = Command::new(env!("CARGO_BIN_EXE_trials")).args(arguments).output().unwrap();
    let [said, complained] =
        [done.stdout, done.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    assert!(done.status.success(), "{said}\n{complained}");
    println!("{said}\n{complained}");
}

#[cfg(target_os = "linux")]
#[test]
fn pairs_go_through_and_are_counted() {
    trial(&["pairs", "300"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_device_goes_on_whatever_fails() {
    trial(&["device", "12"]);
}

#[test]
fn the_killed_leave_whole_files() {
    trial(&["kills", "8"]);
}

#[test]
fn boards_make_the_same_of_generated_pairs() {
    trial(&["same", "40"]);
}
