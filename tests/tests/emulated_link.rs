//! The device's loop on emulated Cortex-M4F and Cortex-M7 boards, and `host listen` at the other end of their serial
//! line: models are those that `host replay --as-device` makes of the same pictures, byte for byte, whether the
//! calibration has anything to rectify or not, over sockets and over a pseudo-terminal.
//!
//! Says loudly when QEMU is not there, and fails then if `CI=true`.
#![cfg(unix)]

use host::shape::Shape;
use oracle::board;
use oracle::program::{host, model, within};
use oracle::scene::{bent_camera, camera, pair};
use std::fs;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::thread;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// What the eyes see, over and over.
const SHAPES: [Shape; 2] = [Shape::Screwdriver, Shape::Animal];
/// Longest that a pair may be waited for.
const SECONDS: &str = "120";

/// The image, if it can be built.
fn image() -> Option<&'static Path> {
    static IMAGE: LazyLock<Option<PathBuf>> = LazyLock::new(|| board::build("device", "mps2"));
    IMAGE.as_deref()
}

/// Two calibrations, and the raw pictures of both shapes: as files of their own, and as one for the boards.
fn scene() -> TempDir {
    let folder = TempDir::new().unwrap();
    let file = |name: &str| folder.path().join(name);
    camera(2).write_opencv_yaml(file("straight.yaml")).unwrap();
    bent_camera(2).write_opencv_yaml(file("bent.yaml")).unwrap();
    let mut luma = Vec::new();
    for shape in SHAPES {
        for (picture, side) in pair(shape, 2).iter().zip(["left", "right"]) {
            picture.save(file(&format!("{}_{side}.png", shape.name()))).unwrap();
            luma.extend_from_slice(picture.as_raw());
        }
    }
    fs::write(file("pictures"), luma).unwrap();
    folder
}

/// Upload a calibration, listen to as many pairs as there are shapes, and hold the models against those that
/// the pictures give without a device. What was taken before the calibration counts as pictures too, so either
/// shape may come first.
fn held_against_pictures(folder: &Path, port: &str, calibration: &str) {
    let file = |name: &str| within(folder, &format!("{calibration}{name}"));
    let (calib, live, frames) = (file(".yaml"), file("_live"), SHAPES.len().to_string());
    host(&["device", "calibrate", &calib, "--port", port]).unwrap();
    let limits = ["--frames", &frames, "--seconds", SECONDS];
    host(&[&["listen", "--port", port, "--calib", &calib, "--out", &live], &limits[..]].concat()).unwrap();

    let direct = |shape: &Shape| {
        let [left, right] =
            ["left", "right"].map(|side| within(folder, &format!("{}_{side}.png", shape.name())));
        let out = file(&format!("_{}", shape.name()));
        host(&["replay", &left, &right, "--calib", &calib, "--as-device", "--out", &out]).unwrap();
        model(Path::new(&out))
    };
    let mut expected = SHAPES.each_ref().map(direct);
    let mut found = [1, 2].map(|pair| model(&Path::new(&live).join(format!("{pair:06}"))));
    expected.sort();
    found.sort();
    assert!(
        expected[0] != expected[1] && found == expected,
        "{calibration}: other models than the pictures'"
    );
}

/// A board behind a socket, where it waits for somebody to come before it starts.
fn behind_a_socket(machine: &str) {
    let Some(image) = image() else { return };
    let folder = scene();
    let folder = folder.path();
    let port = within(folder, "board.socket");
    let device = format!("socket,id=line,path={port},server=on,wait=on");
    let serial = ["-chardev", &device, "-serial", "chardev:line"];
    let Some(_board) = board::start(machine, image, &[&folder.join("pictures")], &serial) else { return };
    let end = Instant::now() + Duration::from_secs(30);
    while UnixStream::connect(&port).is_err() {
        assert!(Instant::now() < end, "QEMU offers no socket");
        thread::sleep(Duration::from_millis(20));
    }
    for calibration in ["bent", "straight"] {
        held_against_pictures(folder, &port, calibration);
    }
}

#[test]
fn a_cortex_m4_is_a_device_behind_a_socket() {
    behind_a_socket(board::MACHINES[0]);
}

#[test]
fn a_cortex_m7_is_a_device_behind_a_socket() {
    behind_a_socket(board::MACHINES[1]);
}

#[test]
fn a_cortex_m4_is_a_device_behind_a_pseudo_terminal() {
    let Some(image) = image() else { return };
    let folder = scene();
    let pictures = folder.path().join("pictures");
    let board = board::start(board::MACHINES[0], image, &[&pictures], &["-serial", "pty"]);
    let Some(mut board) = board else { return };
    held_against_pictures(folder.path(), &board.terminal(), "bent");
}
