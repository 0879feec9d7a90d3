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
use shared::camera::PairModel;
use shared::wire::{Answer, Capacities, Decoder, Hello, ResetReason, ToDevice, ToHost, calibration_crc};
use tempfile::TempDir;

#[cfg(target_os = "linux")]
#[path = "cli/disk.rs"]
mod disk;

/// What a device is told once, how it says hello, and a sphere as it describes it.
fn device() -> (PairModel, Vec<u8>, Vec<u8>) {
    let views = Pinhole::pair().map(|view| Pinhole {
        size: [320, 240],
        focal: 375.0,
        principal: [159.5, 119.5],
        ..view
    });
    let shape = Shape::Sphere;
    let [left, right] = views.map(|view| render(&shape.mesh(2.0 * shape.cell()), &[view]).remove(0));
    let (model, pair) = describe(left, right, &calibration(), &Options::device()).unwrap();
    let hello = ToHost::Hello(Hello {
        firmware: [0, 1, 0],
        board: "paper",
        sensors: [0x2642; 2],
        picture: [320, 240],
        capacities: Capacities { contour: 1536, branches: 64, controls: 256 },
        reset: ResetReason::Power,
        calibration: Some(calibration_crc(&model)),
    });
    (model, frame(&hello, 0), pair)
}

fn calibration() -> StereoCamera {
    StereoCamera::rectified(320, 240, 375.0, 60.0)
}

fn frame(message: &ToHost<'_>, number: u16) -> Vec<u8> {
    let mut frame = [0; 256];
    let length = message.encode(number, &mut frame).unwrap();
    frame[..length].to_vec()
}

/// A recording of a device that says hello and describes a sphere twice, the second time damaged.
fn record(folder: &Path) -> PathBuf {
    let (model, hello, pair) = device();
    let mut damaged = pair.clone();
    damaged[pair.len() / 2] ^= 0x40;
    let path = folder.join("tape");
    let mut writer = Writer::begin(&path, &model).unwrap();
    writer.connection().unwrap();
    for bytes in [&pair, &hello, &pair[..100], &pair[100..], &damaged] {
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
    let output = replay(&cut, &[]);
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{told}");
    assert!(told.contains("cut was cut off: its last ") && !told.contains("damaged at"), "{told}");
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
fn a_recording_damaged_in_its_middle_loses_no_more_than_what_is_damaged() {
    let folder = TempDir::new().unwrap();
    let tape = record(folder.path());
    let (whole, bytes) = (Recording::read(&tape).unwrap(), fs::read(&tape).unwrap());
    let came = whole.connections.concat();
    assert_eq!((whole.damaged.len(), whole.cut), (0, 0));
    // The entries, after the sixteen bytes that every recording begins with.
    let length = |at: usize| u32::from_le_bytes(bytes[at + 9..at + 13].try_into().unwrap());
    let next = |at: &usize| Some(at + 13 + length(*at) as usize).filter(|at| *at < bytes.len());
    let entries: Vec<usize> = std::iter::successors(Some(16), next).collect();
    assert!(entries.len() > 6, "{entries:?}");
    for &at in &entries[1..entries.len() - 2] {
        for wrong in [length(at) / 2, length(at) + 1, 4000, 5000, u32::MAX] {
            let mut damaged = bytes.clone();
            damaged[at + 9..at + 13].copy_from_slice(&wrong.to_le_bytes());
            if damaged == bytes {
                continue;
            }
            fs::write(&tape, &damaged).unwrap();
            let read = Recording::read(&tape).unwrap();
            let [lost] = &read.damaged[..] else { panic!("{at}, {wrong}: {:?}", read.damaged) };
            assert!(lost.start >= at && lost.len() < 4096 + 13 && read.cut == 0, "{at}, {wrong}: {lost:?}");
            // What follows is there to the last byte, but for an entry whose head was taken for bytes before it.
            let got = read.connections.concat();
            assert!(got[got.len() - 900..] == came[came.len() - 900..], "{at}, {wrong}");
            let mut left = damaged;
            left.drain(lost.clone());
            assert_eq!(Recording::parse(&tape, &left).unwrap(), Recording { damaged: Vec::new(), ..read });
        }
    }
    // The first pair, of which there is one more before the hello.
    let mut damaged = bytes;
    damaged[entries[2] + 9..entries[2] + 13].copy_from_slice(&u32::MAX.to_le_bytes());
    fs::write(&tape, &damaged).unwrap();
    let output = replay(&tape, &[]);
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{told}");
    assert!(told.contains(&format!("is damaged at byte {}: ", entries[2])), "{told}");
    assert!(String::from_utf8(output.stdout).unwrap().contains("1 of 1 pair have a model"));
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

/// A device that does what it is told and sends the same bytes without end.
#[cfg(target_os = "linux")]
fn serve(folder: &Path) {
    use std::io::{ErrorKind, Read, Write};
    let (_, hello, pair) = device();
    let listener = std::os::unix::net::UnixListener::bind(folder.join("device")).unwrap();
    std::thread::spawn(move || {
        let mut stream = listener.accept().unwrap().0;
        stream.set_read_timeout(Some(std::time::Duration::from_millis(1))).unwrap();
        let (mut buffer, mut bytes) = ([0; 1024], [0; 512]);
        let mut decoder = Decoder::new(&mut buffer);
        loop {
            let mut answers = Vec::new();
            match stream.read(&mut bytes) {
                Ok(0) => return,
                Ok(count) => {
                    for byte in &bytes[..count] {
                        let Some(command) = decoder.push(*byte) else { continue };
                        let answer = Answer { command: command.sequence, result: Ok(()) };
                        answers.extend(match ToDevice::decode(&command) {
                            Ok(ToDevice::Hello) => hello.clone(),
                            _ => frame(&ToHost::Answer(answer), 1),
                        });
                    }
                }
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                Err(_) => return,
            }
            if stream.write_all(&[&answers, &pair[..]].concat()).is_err() {
                return;
            }
        }
    });
}

#[test]
#[cfg(target_os = "linux")]
fn a_recording_for_which_there_is_no_room_is_a_failure_and_can_be_read() {
    let folder = TempDir::new().unwrap();
    calibration().write_opencv_yaml(folder.path().join("calib.yaml")).unwrap();
    serve(folder.path());
    let args = ["listen", "--port", "unix:device", "--calib", "calib.yaml", "--record", "disk/tape"];
    let ended = disk::on_a_small_disk(folder.path(), &[], &[&args[..], &["--out", "models"]].concat());
    let Some(ended) = ended else { return };
    assert_eq!(ended.code, Some(1), "{}", ended.told);
    assert!(ended.told.contains("disk/tape cannot be used: there is no room"), "{}", ended.told);
    let recording = Recording::parse(Path::new("tape"), &ended.files["tape"]).unwrap();
    assert!(recording.damaged.is_empty() && recording.connections.concat().len() > 30_000);
}
