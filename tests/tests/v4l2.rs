//! `host capture` against a real driver: the kernel's `vivid`, in an emulated machine.
//!
//! One boot runs all scenarios of `v4l2/scenarios.sh`; what came of them is asserted here. The driver is shown a
//! rendered pair, and its cameras give those bytes. Oracles: the rendered pictures, bit by bit, and the model
//! that `host replay` makes of them on this machine, byte by byte.
//!
//! It boots a machine, so `cargo test` leaves it out; `./ci.sh v4l2` runs it.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

use image::GrayImage;
use serde_json::Value;

/// As `scenarios.sh` has it.
const RESOLUTION: &str = "8";
/// What `machine.sh` ends with if something that the machine is made of cannot be had.
const MISSING: i32 = 3;
/// What the driver is told to do is done within this time, s.
const PROMPT: f64 = 2.0;

/// The machine after its run.
struct Machine {
    /// What it left.
    out: PathBuf,
    /// The pictures that were shown.
    shown: [GrayImage; 2],
    /// The model of them.
    model: Vec<u8>,
}

/// What became of a scenario.
struct Scenario<'a> {
    name: &'a str,
    folder: PathBuf,
    code: i32,
    said: Value,
    errors: String,
}

/// The machine; nothing if it cannot be had, which is told.
fn machine() -> Option<&'static Machine> {
    static MACHINE: LazyLock<Option<Machine>> = LazyLock::new(boot);
    MACHINE.as_ref()
}

fn boot() -> Option<Machine> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR")).join("v4l2");
    let root = Path::new(env!("CARGO_TARGET_TMPDIR")).join("v4l2");
    let (pair, work, out) = (root.join("pair"), root.join("work"), root.join("out"));
    let _ = fs::remove_dir_all(&root);
    fs::create_dir_all(&work).unwrap();
    // Test binaries lie one folder below the others.
    let host = std::env::current_exe().unwrap().ancestors().nth(2).unwrap().join("host");
    assert!(host.is_file(), "{} is missing: build it first, `cargo build -p host`", host.display());
    let run = |command: &mut Command| {
        let done = command.output().unwrap();
        (done.status.code(), String::from_utf8_lossy(&done.stderr).into_owned())
    };
    // Small, as emulated arithmetic is slow.
    let rendered = run(Command::new(&host).args(["render", "torus", "--focal", "300", "--out"]).arg(&pair));
    assert_eq!(rendered.0, Some(0), "{}", rendered.1);
    let models = root.join("models");
    let replayed = run(Command::new(&host)
        .args(["replay", "--no-pictures", "--resolution", RESOLUTION, "--out"])
        .arg(&models)
        .arg(&pair));
    assert_eq!(replayed.0, Some(0), "{}", replayed.1);
    let shown = ["left.png", "right.png"].map(|name| image::open(pair.join(name)).unwrap().into_luma8());
    assert_ne!(shown[0], shown[1]);
    for (name, bytes) in frames(&shown) {
        fs::write(work.join(name), bytes).unwrap();
    }
    fs::copy(pair.join("calib.yaml"), work.join("calib.yaml")).unwrap();
    fs::copy(here.join("scenarios.sh"), work.join("run")).unwrap();

    let (code, errors) = run(Command::new(here.join("machine.sh")).args([&host, &work, &out]));
    if code == Some(MISSING) {
        assert!(std::env::var("CI").as_deref() != Ok("true"), "in CI the machine must run: {errors}");
        eprintln!("SKIPPED: NOTHING is tested against a real driver: {errors}");
        return None;
    }
    assert_eq!(code, Some(0), "{errors}");
    let model = fs::read(models.join("pair/model.ply")).unwrap();
    Some(Machine { out, shown, model })
}

/// The pictures as cameras of each kind send them. What is no grey value is filled with something else, which
/// must not show.
fn frames([left, right]: &[GrayImage; 2]) -> Vec<(&'static str, Vec<u8>)> {
    let beside: Vec<u8> =
        left.rows().zip(right.rows()).flat_map(|(l, r)| l.chain(r)).map(|p| p.0[0]).collect();
    let other = |index: usize| (37 * index + 11) as u8;
    let each = |bytes: &dyn Fn(usize, u8) -> [u8; 2]| -> Vec<u8> {
        beside.iter().enumerate().flat_map(|(index, grey)| bytes(index, *grey)).collect()
    };
    let in_turn = left.as_raw().iter().zip(right.as_raw()).flat_map(|(l, r)| [*l, *r]).collect();
    let colours = (0..beside.len() / 2).map(other);
    vec![
        ("left.GREY", left.as_raw().clone()),
        ("right.GREY", right.as_raw().clone()),
        ("interleaved", in_turn),
        ("YUYV", each(&|index, grey| [grey, other(index)])),
        ("UYVY", each(&|index, grey| [other(index), grey])),
        ("NV12", beside.iter().copied().chain(colours).collect()),
        ("Y10", each(&|index, grey| (4 * u16::from(grey) + (index % 4) as u16).to_le_bytes())),
        ("Y16", each(&|index, grey| [other(index), grey])),
        ("GREY", beside),
    ]
}

impl Machine {
    fn scenario<'a>(&self, name: &'a str) -> Scenario<'a> {
        let folder = self.out.join(name);
        let read = |file: &str| fs::read_to_string(folder.join(file)).unwrap();
        let said = serde_json::from_str(&read("out.json")).unwrap_or_default();
        Scenario { name, code: read("code").trim().parse().unwrap(), said, errors: read("err"), folder }
    }

    /// Asserts that every pair that was worked on is what was shown, and every model what `host replay` makes
    /// of it, and that there is nothing else.
    fn assert_intact(&self, scenario: &Scenario) {
        let Scenario { name, folder, .. } = scenario;
        let pairs = scenario.pairs();
        let mut expected = vec!["record/calib.yaml".to_string()];
        for pair in pairs {
            assert_eq!(pair["error"], Value::Null, "{name}");
            let number = pair["name"].as_str().unwrap();
            for (eye, shown) in ["left", "right"].iter().zip(&self.shown) {
                let file = format!("record/{eye}_{number}.png");
                let taken = image::open(folder.join(&file)).unwrap().into_luma8();
                assert!(taken == *shown, "{name}: {file} is not what was shown");
                expected.push(file);
            }
            let file = format!("models/{number}/model.ply");
            assert!(fs::read(folder.join(&file)).unwrap() == self.model, "{name}: {file} is another model");
            for file in ["model.ply", "boundary.ply", "skeleton.ply", "report.json"] {
                expected.push(format!("models/{number}/{file}"));
            }
        }
        expected.sort();
        assert_eq!(scenario.files(), expected, "{name}");
    }
}

impl Scenario<'_> {
    fn pairs(&self) -> &[Value] {
        self.said["pairs"].as_array().map_or(&[], Vec::as_slice)
    }

    fn count(&self, what: &str) -> u64 {
        self.said[what].as_u64().unwrap()
    }

    fn number(&self, file: &str) -> f64 {
        fs::read_to_string(self.folder.join(file)).unwrap().trim().parse().unwrap()
    }

    fn latencies(&self) -> Vec<f64> {
        self.pairs().iter().map(|pair| pair["latency_ms"].as_f64().unwrap() / 1e3).collect()
    }

    /// All that was recorded and made, sorted.
    fn files(&self) -> Vec<String> {
        fn below(folder: &Path, files: &mut Vec<PathBuf>) {
            for entry in fs::read_dir(folder).into_iter().flatten() {
                let path = entry.unwrap().path();
                if path.is_dir() { below(&path, files) } else { files.push(path) }
            }
        }
        let mut files = Vec::new();
        ["record", "models"].iter().for_each(|name| below(&self.folder.join(name), &mut files));
        let name = |file: PathBuf| file.strip_prefix(&self.folder).unwrap().display().to_string();
        let mut names: Vec<String> = files.into_iter().map(name).collect();
        names.sort();
        names
    }
}

#[test]
#[ignore = "boots a machine: ./ci.sh v4l2"]
fn what_the_cameras_show_is_recorded_and_made_into_the_model_of_replay() {
    let Some(machine) = machine() else { return };
    let ways = [("GREY", 4), ("YUYV", 1), ("UYVY", 1), ("NV12", 1), ("Y10", 1), ("Y16", 1)];
    for (name, pairs) in ways.into_iter().chain([("two", 2), ("interleaved", 1)]) {
        let scenario = machine.scenario(name);
        assert_eq!((scenario.code, scenario.pairs().len()), (0, pairs), "{name}: {}", scenario.errors);
        machine.assert_intact(&scenario);
        let gap = scenario.pairs()[0]["gap_ms"].as_f64();
        assert_eq!(gap.is_some(), name == "two");
        // Half a period of 50 frames a second.
        assert!(gap.is_none_or(|gap| gap.abs() <= 10.0), "{gap:?} ms");
    }
}

#[test]
#[ignore = "boots a machine: ./ci.sh v4l2"]
fn a_busy_consumer_gets_the_newest_pair() {
    let Some(machine) = machine() else { return };
    // Frames come every 40 ms, and a model takes longer. In a queue each pair would wait for all before it;
    // here none waits, and many are dropped.
    let scenario = machine.scenario("GREY");
    let latencies = scenario.latencies();
    let [least, most] = [f64::min, f64::max].map(|pick| latencies.iter().copied().reduce(pick).unwrap());
    assert!(least > 0.04 && most < 1.5 * least, "{latencies:?}");
    let dropped = scenario.count("dropped_pairs");
    // The frames of the time that it took, less those that were fetched, give or take a start and an end.
    let sent = latencies.iter().sum::<f64>() / 0.04;
    assert!((dropped as f64 - (sent - latencies.len() as f64)).abs() < 0.3 * sent, "{dropped} of {sent:.0}");
}

#[test]
#[ignore = "boots a machine: ./ci.sh v4l2"]
fn a_stalled_camera_is_started_anew_and_a_silent_one_given_up() {
    let Some(machine) = machine() else { return };
    let stalled = machine.scenario("stalled");
    assert_eq!(stalled.code, 0, "{}", stalled.errors);
    machine.assert_intact(&stalled);
    // Silent for 3 s, and given 1 s each time.
    assert!((2..=3).contains(&stalled.count("stalls")), "{}", stalled.said);
    assert!(stalled.count("broken_frames") == 1, "{}", stalled.said);
    assert!(stalled.pairs().len() >= 3);

    let silent = machine.scenario("silent");
    assert_eq!((silent.code, silent.pairs().len(), silent.count("stalls")), (1, 0, 5));
    assert!(
        silent.errors.contains("sent no frame for 5 s, though it was started 5 times"),
        "{}",
        silent.errors
    );
}

#[test]
#[ignore = "boots a machine: ./ci.sh v4l2"]
fn a_camera_that_fails_or_goes_ends_the_run_and_leaves_whole_files() {
    let Some(machine) = machine() else { return };
    for (name, words) in [
        // EIO and ENODEV.
        ("failed", "/dev/video0 does not hand over a frame: the connection to it failed"),
        ("disconnected", "/dev/video0 does not hand over a frame: it has been unplugged"),
    ] {
        let scenario = machine.scenario(name);
        assert_eq!(scenario.code, 1, "{name}: {}", scenario.errors);
        assert!(scenario.errors.contains(words), "{name}: {}", scenario.errors);
        assert!(scenario.said["error"].as_str().unwrap().contains(words), "{name}");
        machine.assert_intact(&scenario);
        assert!(!scenario.pairs().is_empty());
        let took = scenario.number("end") - scenario.number("begin");
        assert!(took < PROMPT, "{name}: {took:.2} s");
    }
}

#[test]
#[ignore = "boots a machine: ./ci.sh v4l2"]
fn a_camera_that_comes_back_as_another_node_goes_on() {
    let Some(machine) = machine() else { return };
    let scenario = machine.scenario("replugged");
    assert_eq!(scenario.code, 0, "{}", scenario.errors);
    for words in ["/dev/video0 has been unplugged; waiting for it", "/dev/video0 is back as /dev/video2"] {
        assert!(scenario.errors.contains(words), "{}", scenario.errors);
    }
    assert_eq!(scenario.count("returns"), 1);
    // Of before and after, and none of what was under way is broken.
    machine.assert_intact(&scenario);
    let (before, all) = (scenario.number("before"), scenario.pairs().len());
    assert!(before >= 1.0 && all as f64 > before + 3.0, "{all} pairs, {before} before");
    let took = scenario.number("told") - scenario.number("begin");
    assert!(took < PROMPT, "{took:.2} s");
}

#[test]
#[ignore = "boots a machine: ./ci.sh v4l2"]
fn what_cannot_be_is_refused_in_a_sentence_and_leaves_no_files() {
    let Some(machine) = machine() else { return };
    let refusals = [
        ("no-such-format", "/dev/video0 does not offer MJPG; it offers YUYV"),
        ("no-such-view", "/dev/video0 has no mode with two views of the calibration's 640x480 px"),
        ("adjusted", "/dev/video0 was asked for GREY 1024x400, but gives GREY 1280x480; ask for that"),
        ("no-capture", "/dev/video1 takes no pictures (it has no video capture capability)"),
        // ENOENT, ENODEV, ENOTTY, EBUSY, and EINVAL of three requests.
        ("no-device", "/dev/video9 cannot be opened: there is no such device"),
        ("gone", "/dev/video0 cannot be opened: it has been unplugged"),
        ("no-video", "/dev/null does not say what it can do: it is no Video4Linux device"),
        ("busy", "/dev/video0 does not take the format: another program uses it"),
        ("reqbufs", "/dev/video0 does not start to send: it refuses the format it was set to"),
        ("qbuf", "/dev/video0 does not start to send: it refuses the format it was set to"),
        ("streamon", "/dev/video0 does not start to send: it refuses the format it was set to"),
    ];
    for (name, words) in refusals {
        let scenario = machine.scenario(name);
        assert_eq!(scenario.code, 1, "{name}: {}", scenario.errors);
        assert!(scenario.errors.contains(words), "{name}: {}", scenario.errors);
        assert_eq!(scenario.files(), [""; 0], "{name}");
    }
}

#[test]
#[ignore = "boots a machine: ./ci.sh v4l2"]
fn another_program_is_given_the_errors_that_the_sentences_are_about() {
    let Some(machine) = machine() else { return };
    for (name, error) in [
        ("busy", "Device or resource busy"),
        ("streamon", "Invalid argument"),
        ("failed", "Input/output error"),
        ("gone", "No such device"),
    ] {
        let said = fs::read(machine.out.join(format!("{name}.witness"))).unwrap();
        let said = String::from_utf8_lossy(&said);
        assert!(said.contains(error), "{name}: {said}");
    }
}

#[test]
#[ignore = "boots a machine: ./ci.sh v4l2"]
fn cameras_are_listed_and_outputs_are_not() {
    let Some(machine) = machine() else { return };
    let listed: Value = serde_json::from_slice(&fs::read(machine.out.join("devices.json")).unwrap()).unwrap();
    let cameras = listed["cameras"].as_array().unwrap();
    let devices: Vec<_> = cameras.iter().map(|camera| (&camera["device"], &camera["driver"])).collect();
    assert_eq!(devices, [(&"/dev/video0".into(), &"vivid".into()), (&"/dev/video2".into(), &"vivid".into())]);
    let formats = cameras[0]["formats"].as_array().unwrap();
    let read = |code: &str| formats.iter().any(|format| format["code"] == code && format["is_read"] == true);
    for code in ["GREY", "YUYV", "UYVY", "NV12", "Y10", "Y16"] {
        assert!(read(code), "{code}");
    }
}
