//! Recordings of a device as users meet them: made here by the wire format itself, replayed by the binary.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use assert_cmd::Command;
use host::calibration::StereoCamera;
use host::reconstruct::{Options, describe};
use host::render::render;
use host::shape::Shape;
use host::source::serial::recording::{Recording, Writer};
use host::view::Pinhole;
use serde_json::Value;
use shared::wire::{Capacities, Hello, ResetReason, ToHost, calibration_crc};
use tempfile::TempDir;

/// A recording of a device that says hello and describes a sphere twice, the second time damaged.
fn record(folder: &Path) -> PathBuf {
    let views = Pinhole::pair().map(|view| Pinhole {
        size: [320, 240],
        focal: 375.0,
        principal: [159.5, 119.5],
        ..view
    });
    let shape = Shape::Sphere;
    let [left, right] = views.map(|view| render(&shape.mesh(2.0 * shape.cell()), &[view]).remove(0));
    let calibration = StereoCamera::rectified(320, 240, 375.0, 60.0);
    let (model, pair) = describe(left, right, &calibration, &Options::device()).unwrap();
    let hello = ToHost::Hello(Hello {
        firmware: [0, 1, 0],
        board: "paper",
        sensors: [0x2642; 2],
        picture: [320, 240],
        capacities: Capacities { contour: 1536, branches: 64, controls: 256 },
        reset: ResetReason::Power,
        calibration: Some(calibration_crc(&model)),
    });
    let mut frame = [0; 256];
    let length = hello.encode(0, &mut frame).unwrap();
    let mut damaged = pair.clone();
    damaged[pair.len() / 2] ^= 0x40;
    let path = folder.join("tape");
    let mut writer = Writer::begin(&path, &model).unwrap();
    writer.connection().unwrap();
    for bytes in [&pair, &frame[..length], &pair[..100], &pair[100..], &damaged] {
        writer.bytes(bytes).unwrap();
    }
    drop(writer);
    path
}

fn replay(tape: &Path, more: &[&str]) -> Output {
    let mut command = Command::cargo_bin("host").unwrap();
    command.current_dir(tape.parent().unwrap()).arg("replay").arg(tape).args(more).output().unwrap()
}

#[test]
fn a_recording_is_replayed_line_by_line() {
    let folder = TempDir::new().unwrap();
    let tape = record(folder.path());
    let output = replay(&tape, &["--json", "--out", "models"]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    let lines: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let [device, pair, end] = lines.as_slice() else { panic!("{text}") };
    assert_eq!(device["device"]["board"], "paper");
    assert_eq!(pair["folder"], "models/000001");
    assert_eq!(pair["report"]["options"]["skeleton"], "nurbs");
    assert_eq!(pair["report"]["eyes"]["left"]["thinning_cycles"], Value::Null);
    assert!(pair["report"]["eyes"]["left"]["contour_points"].as_u64() > Some(100));
    // The pair before the hello is of another time; the damaged one is counted.
    assert_eq!((&end["pairs"], &end["models"]), (&1.into(), &1.into()));
    assert_eq!((&end["link"]["bad_crc"], &end["link"]["missing"]), (&1.into(), &0.into()));
    let volume = pair["report"]["model"]["volume_mm3"].as_f64().unwrap();
    let truth = Shape::Sphere.mesh(Shape::Sphere.cell()).volume();
    assert!((volume / truth - 1.0).abs() < 0.1, "{volume} of {truth} mm3");
    assert!(folder.path().join("models/000001/model.ply").is_file());

    let text = String::from_utf8(replay(&tape, &["--out", "models"]).stdout).unwrap();
    assert!(text.contains("1 of 1 pair have a model; 1 damaged frame"), "{text}");
}

#[test]
fn a_recording_that_was_cut_off_or_damaged_is_told() {
    let folder = TempDir::new().unwrap();
    let tape = record(folder.path());
    let whole = Recording::read(&tape).unwrap();
    let bytes = fs::read(&tape).unwrap();
    let cut = folder.path().join("cut");
    for length in 0..bytes.len() {
        fs::write(&cut, &bytes[..length]).unwrap();
        match Recording::read(&cut) {
            Ok(part) => {
                assert_eq!(part.calibration, whole.calibration);
                let shorter = part.connections.concat();
                assert!(whole.connections.concat().starts_with(&shorter));
            }
            Err(error) => assert!(length < 400, "{length}: {error}"),
        }
    }
    let mut wrong = bytes;
    wrong[16] = 9;
    fs::write(&cut, wrong).unwrap();
    let output = replay(&cut, &[]);
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(told.contains("is damaged at byte 16"), "{told}");
    for of_pictures in [&["--mode", "paper"][..], &["--swap"], &["--calib", "x"], &["--threshold", "9"]] {
        let output = replay(&tape, of_pictures);
        assert_eq!(output.status.code(), Some(2), "{of_pictures:?}");
    }
}

#[test]
fn results_that_cannot_be_written_are_a_failure_and_no_refusal() {
    let folder = TempDir::new().unwrap();
    let tape = record(folder.path());
    fs::write(folder.path().join("models"), "in the way").unwrap();
    let output = replay(&tape, &["--json", "--out", "models"]);
    assert_eq!(output.status.code(), Some(1));
    let text = String::from_utf8(output.stdout).unwrap();
    let lines: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let [device, failure] = lines.as_slice() else { panic!("{text}") };
    assert_eq!(device["device"]["board"], "paper");
    assert!(failure["error"].as_str().unwrap().contains("models"), "{failure}");
}
