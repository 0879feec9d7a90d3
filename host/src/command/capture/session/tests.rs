//! Whole runs on a simulated camera: what is modelled, recorded and told.

use super::*;
use crate::command::replay;
use crate::render::render;
use crate::shape::Shape;
use crate::source::v4l::dial::Controls;
use crate::source::v4l::format::{Format, FourCc};
use crate::source::v4l::layout::Layout;
use crate::source::v4l::simulated::{Event, Simulated};
use crate::view::Calibrated;
use clap::Parser;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::sync::{Arc, Mutex};

#[derive(Parser)]
struct Line {
    #[command(flatten)]
    args: Args,
}

#[derive(Parser)]
struct ReplayLine {
    #[command(flatten)]
    args: replay::Args,
}

fn calibration() -> StereoCamera {
    StereoCamera::rectified(320, 240, 375.0, 60.0)
}

/// A frame with both eyes side by side, padded by 16 bytes a row, darkened by a factor.
fn both_eyes(share: u32) -> Vec<u8> {
    let views = render(&Shape::Capsule.mesh(4.0), &Calibrated::pair(&calibration()));
    let mut bytes = Vec::new();
    for v in 0..240 {
        for view in &views {
            bytes.extend((0..320).map(|u| (u32::from(view[(u, v)].0[0]) / share) as u8));
        }
        bytes.extend([0xee; 16]);
    }
    bytes
}

fn empty() -> Vec<u8> {
    vec![3; 656 * 240]
}

fn rig(script: Vec<Event>) -> Rig<Simulated> {
    let format = Format { code: FourCc(*b"GREY"), width: 640, height: 240, stride: 656 };
    let mut camera = Simulated::new("/dev/video0", format, script);
    // Slower than a model, so that none is dropped.
    camera.pace = Duration::from_millis(1500);
    let optics = Optics { formats: vec![format], layout: Layout::SideBySide, swap: false };
    let dials = Vec::new();
    Rig { pairs: Pairs::of(camera, None), optics, calibration: Some(calibration()), file: None, dials }
}

/// Runs `capture` on what a camera sends; the folder is made to be the results' and the recording's.
fn capture(folder: &Path, script: Vec<Vec<u8>>, more: &[&str]) -> Result<(), String> {
    let [out, record] = ["models", "recording"].map(|name| folder.join(name).display().to_string());
    let skip = if more.contains(&"--skip") { &[][..] } else { &["--skip", "0"] };
    let fixed = ["capture", "--device", "x", "--no-pictures", "--out", &out, "--record", &record];
    let Line { args } = Line::try_parse_from(fixed.iter().chain(skip).chain(more)).unwrap();
    let mut options = args.method.options().unwrap();
    let scene = args.scene.scene(None, false, &mut options).unwrap();
    let mut rig =
        rig(script.into_iter().enumerate().map(|(n, bytes)| Event::Frame(40 * n as u64, bytes)).collect());
    let session = Session::begin(&args, &options, scene, &mut rig).unwrap();
    session.run(rig, &AtomicBool::new(false)).map_err(|failure| words_of(&*failure))
}

fn names(folder: &Path) -> Vec<String> {
    let entries =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<_> = entries.collect();
    names.sort();
    names
}

/// The bytes of a result, but for its times.
fn result(folder: &Path) -> [Vec<u8>; 3] {
    let mut report: Value = serde_json::from_slice(&fs::read(folder.join("report.json")).unwrap()).unwrap();
    report.as_object_mut().unwrap().remove("times_ms");
    let [model, skeleton] = ["model.ply", "skeleton.ply"].map(|name| fs::read(folder.join(name)).unwrap());
    [model, skeleton, report.to_string().into_bytes()]
}

fn replay_of(folder: &Path, more: &[&str]) -> Result<(), Failure> {
    let [recording, again] = ["recording", "again"].map(|name| folder.join(name).display().to_string());
    let fixed = ["replay", &recording, "--out", &again, "--no-pictures"];
    replay::run(&ReplayLine::try_parse_from(fixed.iter().chain(more)).unwrap().args)
}

#[test]
fn a_recording_gives_the_same_models_byte_by_byte() {
    let folder = tempfile::tempdir().unwrap();
    let script = vec![both_eyes(1), both_eyes(2), both_eyes(1)];
    capture(folder.path(), script, &["--focal", "375", "--baseline", "60", "--frames", "2"]).unwrap();
    assert_eq!(names(&folder.path().join("models")), ["000001", "000002"]);
    let files = ["calib.yaml", "left_000001.png", "left_000002.png", "right_000001.png", "right_000002.png"];
    assert_eq!(names(&folder.path().join("recording")), files);
    replay_of(folder.path(), &[]).unwrap();
    for name in ["000001", "000002"] {
        let [live, again] = ["models", "again"].map(|way| result(&folder.path().join(way).join(name)));
        assert!(live == again, "{name}");
    }
}

#[test]
fn the_first_pair_can_be_the_background_and_is_again_in_the_recording() {
    let folder = tempfile::tempdir().unwrap();
    let scene = ["--background", "first", "--roi", "10,4,300,230"];
    let more = [&["--focal", "375", "--baseline", "60", "--frames", "2"][..], &scene].concat();
    // The second pair still shows the empty scene, and is refused.
    capture(folder.path(), vec![empty(), empty(), both_eyes(1), empty()], &more).unwrap();
    assert_eq!(names(&folder.path().join("models")), ["000002"]);
    let report = fs::read(folder.path().join("models/000002/report.json")).unwrap();
    let report: Value = serde_json::from_slice(&report).unwrap();
    assert_eq!(report["options"]["background_taken_away"], true);
    assert_eq!(report["options"]["region_px"]["width"], 300);
    let [recording, again] =
        ["recording", "again"].map(|name| folder.path().join(name).display().to_string());
    let line = [&["replay", &recording, "--out", &again, "--no-pictures"][..], &scene].concat();
    // One of its two pairs is refused again.
    assert!(replay::run(&ReplayLine::try_parse_from(line).unwrap().args).is_err());
    let [live, again] = ["models", "again"].map(|way| result(&folder.path().join(way).join("000002")));
    assert!(live == again);
}

#[test]
fn the_best_of_a_burst_is_one_model() {
    let folder = tempfile::tempdir().unwrap();
    let more = ["--focal", "375", "--baseline", "60", "--frames", "3", "--best"];
    // A second, smaller thing in the picture is a warning.
    let mut worse = both_eyes(1);
    for row in worse.chunks_mut(656).take(45).skip(5) {
        row[5..65].fill(255);
        row[325..385].fill(255);
    }
    capture(folder.path(), vec![worse, both_eyes(1), empty(), empty()], &more).unwrap();
    let files = ["boundary.ply", "model.ply", "report.json", "skeleton.ply"];
    assert_eq!(names(&folder.path().join("models")), files);
    assert!(replay_of(folder.path(), &[]).is_err(), "the third pair is empty");
    assert!(result(&folder.path().join("models")) == result(&folder.path().join("again/000002")));
}

/// The exposure of a driver, by the number of its control.
#[derive(Clone, Default)]
struct Knob(Arc<Mutex<BTreeMap<u32, i64>>>);

impl Controls for Knob {
    fn get(&self, id: u32) -> io::Result<i64> {
        Ok(self.0.lock().unwrap().get(&id).copied().unwrap_or_default())
    }

    fn set(&mut self, id: u32, value: i64) -> io::Result<()> {
        self.0.lock().unwrap().insert(id, value);
        Ok(())
    }
}

/// Asks a live page; returns what its answer holds.
fn ask(address: &str, method: &str, below: &str, body: &str) -> Value {
    let (machine, path) = address.strip_prefix("http://").unwrap().split_once('/').unwrap();
    let mut stream = TcpStream::connect(machine).unwrap();
    let length = body.len();
    let head = format!("Host: {machine}\r\nConnection: close\r\nContent-Length: {length}");
    write!(stream, "{method} /{path}{below} HTTP/1.1\r\n{head}\r\n\r\n{body}").unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    serde_json::from_str(answer.split_once("\r\n\r\n").unwrap().1).unwrap()
}

#[test]
fn a_live_page_shows_pairs_and_sets_the_camera() {
    let line = ["capture", "--device", "x", "--skip", "0", "--focal", "375", "--baseline", "60", "--view"];
    let Line { args } = Line::try_parse_from(line).unwrap();
    assert_eq!(args.out, None, "what is only looked at leaves no files");
    let mut options = args.method.options().unwrap();
    let scene = args.scene.scene(None, false, &mut options).unwrap();
    let mut rig = rig((0..4).map(|n| Event::Frame(40 * n, both_eyes(1))).collect());
    let knob = Knob::default();
    rig.dials = vec![Dial::find(knob.clone()).unwrap()];
    let session = Session::begin(&args, &options, scene, &mut rig).unwrap();
    let address = session.view.as_ref().unwrap().address().to_owned();
    std::thread::scope(|scope| {
        let run = scope.spawn(|| session.run(rig, &AtomicBool::new(false)).map_err(|f| words_of(&*f)));
        let told = ask(&address, "POST", "settings", r#"{"threshold": "140", "exposure": "40"}"#);
        assert_eq!((&told["version"], &told["exposure"]["unit"]), (&1.into(), &"× 0.1 ms".into()));
        let mut pair = ask(&address, "GET", "pair?after=0", "");
        if pair["number"] == 1 {
            pair = ask(&address, "GET", "pair?after=1", "");
        }
        assert_eq!(pair["content"]["report"]["eyes"]["left"]["threshold_grey"], 140);
        assert_eq!(pair["pictures"][0], serde_json::json!([320, 240]));
        assert!(run.join().unwrap().unwrap_err().contains("unplugged"));
    });
    assert!(knob.0.lock().unwrap().values().any(|value| *value == 40), "the camera was told");
}

#[test]
fn recording_alone_makes_no_model() {
    let folder = tempfile::tempdir().unwrap();
    capture(folder.path(), vec![empty(), empty()], &["--only-record", "--frames", "1"]).unwrap();
    assert_eq!(names(folder.path()), ["recording"]);
    assert_eq!(names(&folder.path().join("recording")).len(), 3);
}

#[test]
fn a_camera_pulled_out_leaves_what_was_made_and_fails() {
    let folder = tempfile::tempdir().unwrap();
    let more = ["--focal", "375", "--baseline", "60"];
    let error = capture(folder.path(), vec![both_eyes(1)], &more).unwrap_err();
    assert!(error.contains("unplugged"), "{error}");
    assert_eq!(names(&folder.path().join("models/000001")).len(), 4);
    assert_eq!(names(&folder.path().join("recording")).len(), 3);
}

#[test]
fn nothing_but_refusals_is_a_failure_with_the_last() {
    let folder = tempfile::tempdir().unwrap();
    let more = ["--focal", "375", "--baseline", "60", "--frames", "2"];
    let error = capture(folder.path(), vec![empty(); 3], &more).unwrap_err();
    assert!(error.contains("none of 2 pairs gave a model") && error.contains("no object"), "{error}");
    assert!(!folder.path().join("models").exists());
}

#[test]
fn a_run_without_a_pair_is_a_failure() {
    let folder = tempfile::tempdir().unwrap();
    // The time is over while pairs are still thrown away.
    let more = ["--focal", "375", "--baseline", "60", "--skip", "9", "--seconds", "0.001"];
    let error = capture(folder.path(), vec![both_eyes(1); 2], &more).unwrap_err();
    assert!(error.contains("no pair came") && error.contains("lower --skip"), "{error}");
    assert!(!folder.path().join("models").exists());
    let folder = tempfile::tempdir().unwrap();
    let more = ["--focal", "375", "--baseline", "60", "--background", "first", "--seconds", "0.001"];
    let error = capture(folder.path(), vec![empty(); 2], &more).unwrap_err();
    assert!(error.contains("no pair came") && error.contains("after the background"), "{error}");
}
