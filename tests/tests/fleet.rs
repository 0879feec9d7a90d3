//! Simulated boards in a fleet on this machine: every model arrives and is that of the pictures, orders reach the
//! device, whoever is killed is missed and may come again, and a foreign client takes part.
//!
//! Needs a program with fleets, which `OSSATURE_HOST` names, so `./ci.sh fleet` alone runs it. `OSSATURE_ZENOH_PYTHON`
//! names a Python with Zenoh; without it that part says loudly that it is not run, and fails if `CI=true`.
#![cfg(unix)]

use host::output::surface;
use host::reconstruct::{Options, Workspace};
use host::shape::Shape;
use host::source::serial::inbox::{Inbox, Message};
use host::source::serial::link::frames;
use oracle::program::{host, model, within};
use oracle::scene::{bent_camera, pair};
use oracle::socket::{intact, prepare, serve};
use serde_json::{Value, json};
use shared::wire::{Decoder, MAX_FRAME, ToDevice};
use std::fs;
use std::io::{BufRead, BufReader};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Longest that anything is waited for.
const PATIENCE: Duration = Duration::from_secs(120);

/// A program, killed when it is no longer looked at, and the lines that it prints.
struct Program {
    child: Child,
    lines: Receiver<String>,
}

impl Program {
    fn start(command: &mut Command) -> Self {
        let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
        let mut printed = BufReader::new(child.stdout.take().unwrap()).lines().map(Result::unwrap);
        let (sender, lines) = channel();
        thread::spawn(move || printed.try_for_each(|line| sender.send(line)));
        Self { child, lines }
    }

    /// Ours, with fleets.
    fn host(arguments: &[&str]) -> Self {
        let path = std::env::var_os("OSSATURE_HOST").expect("OSSATURE_HOST names a program with fleets");
        Self::start(Command::new(path).args(arguments))
    }

    /// The next line of JSON within this time.
    fn json(&self, within: Duration) -> Option<Value> {
        Some(serde_json::from_str(&self.lines.recv_timeout(within).ok()?).unwrap())
    }

    /// Waits until it ends: whether it succeeded, and what it printed.
    fn finish(mut self) -> (bool, String) {
        let lines: Vec<String> = self.lines.iter().collect();
        (self.child.wait().unwrap().success(), lines.join("\n"))
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Ours, to its end.
fn run(arguments: &[&str]) -> (bool, String) {
    Program::host(arguments).finish()
}

/// Lines of JSON.
fn parsed(text: &str) -> Vec<Value> {
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// A place to meet where nobody else does.
fn place() -> String {
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    format!("tcp/127.0.0.1:{port}")
}

/// Somebody who listens at a place.
fn listening(place: &str, arguments: &[&str]) -> Program {
    let program = Program::host(&[arguments, &["--listen-at", place]].concat());
    let (_, address) = place.split_once('/').unwrap();
    let end = Instant::now() + PATIENCE;
    while TcpStream::connect(address).is_err() {
        assert!(Instant::now() < end, "nobody listens");
        thread::sleep(Duration::from_millis(20));
    }
    program
}

/// A device that sees a shape, calibrated, in a folder of its own.
struct Device {
    folder: PathBuf,
    port: String,
    calib: String,
}

impl Device {
    fn new(folder: &Path, shape: Shape) -> Self {
        let folder = folder.join(shape.name());
        fs::create_dir(&folder).unwrap();
        bent_camera(2).write_opencv_yaml(folder.join("calib.yaml")).unwrap();
        let pictures = pair(shape, 2);
        for (name, picture) in ["left.png", "right.png"].iter().zip(&pictures) {
            picture.save(folder.join(name)).unwrap();
        }
        let port = serve(&folder, &pictures, intact, usize::MAX);
        prepare(&folder, &port);
        Self { port, calib: within(&folder, "calib.yaml"), folder }
    }

    /// The surface that its pictures give without it.
    fn truth(&self) -> Vec<u8> {
        let file = |name| within(&self.folder, name);
        let (left, right, out) = (file("left.png"), file("right.png"), file("direct"));
        host(&["replay", &left, &right, "--calib", &self.calib, "--as-device", "--out", &out]).unwrap();
        let [surface, ..] = model(&self.folder.join("direct"));
        surface
    }
}

/// The one folder in a folder that has folders.
fn only(folder: &Path) -> PathBuf {
    let inner: Vec<_> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert_eq!(inner.len(), 1, "{inner:?}");
    inner[0].clone()
}

/// The surface of a shape in a file, grown with the calibration in another, as any client could.
fn grown(shape: &Path, calibration: &Path) -> Vec<u8> {
    let [shape, calibration] = [shape, calibration].map(|path| {
        let (bytes, mut buffer, mut arrived) = (fs::read(path).unwrap(), vec![0; MAX_FRAME], Vec::new());
        frames(&mut Decoder::new(&mut buffer), &bytes, |frame| arrived.push(frame));
        assert_eq!(arrived.len(), 1);
        arrived.remove(0)
    });
    let Ok(ToDevice::Calibration(model)) = ToDevice::decode(&calibration.frame()) else {
        panic!("no calibration")
    };
    let mut inbox = Inbox::new().unwrap();
    let Ok(Message::Pair(pair)) = inbox.read(&shape.frame()) else { panic!("no pair") };
    let outcome = pair.result.unwrap();
    let made = Workspace::default().reconstruct_shape(
        (&mut inbox.memory(), outcome),
        None,
        &model,
        &Options::device(),
        &mut (),
    );
    surface(&made.unwrap())
}

#[test]
#[ignore = "needs a program with fleets: ./ci.sh fleet"]
fn every_model_of_four_boards_by_two_publishers_arrives_at_one_subscriber() {
    const PAIRS: usize = 6;
    let folder = TempDir::new().unwrap();
    let shapes = [Shape::Screwdriver, Shape::Teapot, Shape::Mouse, Shape::Sphere];
    let devices = shapes.map(|shape| Device::new(folder.path(), shape));
    let (place, out) = (place(), within(folder.path(), "out"));
    let (models, pairs) = ((4 * PAIRS).to_string(), PAIRS.to_string());
    let arguments = ["subscribe", "--out", &out, "--models", &models, "--seconds", "100", "--json"];
    let subscriber = listening(&place, &arguments);
    assert_eq!(subscriber.json(PATIENCE).unwrap()["subscribed"], "ossature/*/*");
    let names = shapes.map(|shape| format!("ossature/lab/{}", shape.name()));
    let publishers = [0, 2].map(|k| {
        let mut arguments = vec!["listen", "--connect", &place, "--frames", &pairs, "--json"];
        for k in [k, k + 1] {
            let Device { port, calib, .. } = &devices[k];
            arguments.extend(["--port", port, "--calib", calib, "--publish", &names[k]]);
        }
        Program::host(&arguments)
    });
    for publisher in publishers {
        let (succeeded, told) = publisher.finish();
        assert!(succeeded, "{told}");
        let told = parsed(&told);
        assert_eq!(told.iter().filter(|line| line["models"] == PAIRS).count(), 2, "{told:?}");
        assert!(told.iter().all(|line| names.iter().any(|name| line["board"] == *name)), "{told:?}");
    }
    let (succeeded, told) = subscriber.finish();
    assert!(succeeded, "{told}");
    let end = parsed(&told).pop().unwrap();
    assert_eq!((&end["models"], &end["lost"]), (&(4 * PAIRS).into(), &0.into()), "{end}");
    for (shape, device) in shapes.iter().zip(&devices) {
        let (truth, run) = (device.truth(), only(&Path::new(&out).join("lab").join(shape.name())));
        for pair in 1..=PAIRS {
            let pair = run.join(format!("{pair:06}"));
            let told: Value = serde_json::from_slice(&fs::read(pair.join("pair.json")).unwrap()).unwrap();
            assert!(told["warnings"].is_array() && told["levels_grey"].is_array(), "{told}");
            assert!(fs::read(pair.join("model.ply")).unwrap() == truth, "{}", pair.display());
            assert!(
                grown(&pair.join("shape.bin"), &run.join("calibration.bin")) == truth,
                "{}",
                pair.display()
            );
        }
        let read = |name| -> Value { serde_json::from_slice(&fs::read(run.join(name)).unwrap()).unwrap() };
        let status = read("status.json");
        assert_eq!(status["about"]["board"], "bench", "{status}");
    }
}

#[test]
#[ignore = "needs a program with fleets: ./ci.sh fleet"]
fn a_board_takes_orders_and_who_is_killed_is_missed_and_may_come_again() {
    let folder = TempDir::new().unwrap();
    let Device { port, calib, .. } = &Device::new(folder.path(), Shape::Teapot);
    let (place, name) = (place(), "ossature/lab/left");
    let _router = listening(&place, &["fleet", "router"]);
    let subscriber = Program::host(&["subscribe", "--connect", &place, "--json"]);
    assert_eq!(subscriber.json(PATIENCE).unwrap()["subscribed"], "ossature/*/*");
    let start = || {
        Program::host(&["listen", "--port", port, "--calib", calib, "--publish", name, "--connect", &place])
    };
    // What was told of the next pair for which this holds; nothing is ever lost.
    let until = |holds: &dyn Fn(&Value) -> bool| {
        let end = Instant::now() + PATIENCE;
        while Instant::now() < end {
            let Some(line) = subscriber.json(Duration::from_secs(1)) else { continue };
            assert_eq!(line["lost"], Value::Null, "{line}");
            if holds(&line["told"]) {
                return line;
            }
        }
        panic!("it never came");
    };
    // Pairs until no more come.
    let drain = || (0..).take_while(|_| subscriber.json(Duration::from_secs(3)).is_some()).count();
    // What the device was told before holds, until somebody orders something else.
    assert!(run(&["device", "threshold", "90", "--port", port]).0);
    let first = start();
    let run_of = |line: &Value| line["run"].as_str().unwrap().to_owned();
    let line = until(&|told| told["warnings"].is_array());
    assert_eq!(line["told"]["levels_grey"], json!([90, 90]), "{line}");
    let before = run_of(&line);
    let order = |name: &str, what: &str, value: &str| {
        let (succeeded, told) = run(&["fleet", "order", name, what, value, "--connect", &place, "--json"]);
        let told =
            told.lines().take_while(|line| *line != "}").map(String::from).collect::<Vec<_>>().join("") + "}";
        (succeeded, serde_json::from_str::<Value>(&told).unwrap())
    };
    let obeyed = |what: &str, value: &str| {
        let (succeeded, told) = order(name, what, value);
        assert!(succeeded && told["obeyed"][0][what]["value"] == value, "{told}");
        assert_eq!(told["obeyed"][0]["board"], name);
    };
    obeyed("threshold", "123");
    let _ = until(&|told| told["levels_grey"] == json!([123, 123]));
    obeyed("exposure", "150");
    let _ = until(&|told| told["exposures"][0]["lines"] == 150);
    let (succeeded, told) = order("ossature/*/left", "region", "1,2,30,40");
    assert!(!succeeded && told["refused"][0].as_str().unwrap().contains("all of its pictures"), "{told}");
    assert!(!order("ossature/lab/right", "pairs", "1").0, "nobody has that name");
    obeyed("pairs", "0");
    drain();
    assert_eq!(drain(), 0, "it pauses");
    obeyed("pairs", "1");
    assert_eq!(drain(), 1, "a single shot is one pair");
    obeyed("pairs", "all");
    let _ = until(&|_| true);

    let list = || run(&["fleet", "list", "--watch", "--seconds", "1", "--json", "--connect", &place]);
    let told = parsed(&list().1).remove(0);
    let entry = &told["boards"][0];
    assert_eq!((&entry["board"], &entry["answers"]), (&name.into(), &true.into()), "{told}");
    assert!(entry["firmware"].as_str().is_some_and(|version| version.split('.').count() == 3), "{told}");
    assert!(entry["last_seen_s"].as_f64().unwrap() < 5.0, "{told}");
    assert!(entry["status"]["rate_hz"].as_f64().unwrap() > 0.1, "{told}");
    let (succeeded, told) = run(&["fleet", "--connect", &place]);
    assert!(succeeded && told.contains(" of bench") && told.contains("last seen"), "{told}");

    drop(first);
    let end = Instant::now() + PATIENCE;
    while run(&["fleet", "--connect", &place]).0 {
        assert!(Instant::now() < end, "who is killed answers");
    }
    let _second = start();
    let end = Instant::now() + PATIENCE;
    let mut after = before.clone();
    while after == before {
        assert!(Instant::now() < end, "it does not come again");
        after = run_of(&until(&|_| true));
    }
}

#[test]
#[ignore = "needs a program with fleets: ./ci.sh fleet"]
fn a_foreign_client_hears_every_model() {
    const PAIRS: usize = 4;
    let Some(python) = std::env::var_os("OSSATURE_ZENOH_PYTHON") else {
        assert_ne!(std::env::var("CI").as_deref(), Ok("true"), "in CI the foreign client must run");
        eprintln!("SKIPPED: OSSATURE_ZENOH_PYTHON is not set, so NO foreign client is tried");
        return;
    };
    let folder = TempDir::new().unwrap();
    let device = Device::new(folder.path(), Shape::Teapot);
    let place = place();
    let _router = listening(&place, &["fleet", "router"]);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../host/examples/subscribe.py");
    let kept = folder.path().join("kept");
    fs::create_dir(&kept).unwrap();
    let client = Program::start(Command::new(python).arg(script).arg(&place).current_dir(&kept));
    let Device { port, calib, .. } = &device;
    let name = "ossature/lab/left";
    let publisher =
        Program::host(&["listen", "--port", port, "--calib", calib, "--publish", name, "--connect", &place]);
    let mut models: Vec<Vec<usize>> = Vec::new();
    while models.len() < PAIRS {
        let line = client.lines.recv_timeout(PATIENCE).expect("a line");
        let model = line.strip_prefix("ossature/lab/left/model ");
        models.extend(model.map(|told| told.split(' ').map(|number| number.parse().unwrap()).collect()));
    }
    drop((client, publisher));
    let (truth, first) = (device.truth(), models[0][0]);
    let expected: Vec<Vec<usize>> = (first..first + PAIRS).map(|k| vec![k, k + 1, truth.len()]).collect();
    assert_eq!(models, expected, "one after the other");
    let mut files: Vec<_> = fs::read_dir(&kept).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    assert!(files.len() >= PAIRS - 1);
    assert!(files[..PAIRS - 1].iter().all(|file| fs::read(file).unwrap() == truth));
}
