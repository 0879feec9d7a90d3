//! Simulated boards in a fleet on this machine: every model arrives and is that of the pictures, orders reach the
//! device, whoever is killed is missed and may come again, and a foreign client takes part.
//!
//! Needs a build with fleets: `./ci.sh fleet`. `OSSATURE_ZENOH_PYTHON` names a Python with Zenoh; without it that part
//! says loudly that it is not run, and fails if `CI=true`.
#![cfg(unix)]

use host::fleet::key::{Board, Leaf};
use host::fleet::ledger::Ledger;
use host::fleet::{Link, Meeting, Message, Pressure};
use host::output::surface;
use host::reconstruct::{Options, Workspace};
use host::shape::Shape;
use host::source::serial::inbox::{self, Inbox};
use host::source::serial::link::frames;
use oracle::program::{host, model, within};
use oracle::scene::{bent_camera, pair};
use oracle::socket::{intact, prepare, serve};
use serde_json::Value;
use shared::wire::{Decoder, MAX_FRAME, ToDevice};
use std::fs;
use std::io::{BufRead, BufReader};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Longest that anything is waited for.
const PATIENCE: Duration = Duration::from_secs(120);
/// The program's arguments, for [`program`].
const ARGUMENTS: &str = "OSSATURE_FLEET_TEST";

/// Not a test but the program, in a process of its own: this one, run again by those below.
#[test]
fn program() {
    let Ok(arguments) = std::env::var(ARGUMENTS) else { return };
    if let Err(words) = host(&arguments.split('\n').collect::<Vec<_>>()) {
        eprintln!("error: {words}");
        std::process::exit(1);
    }
}

/// The program, killed when it is no longer looked at.
struct Program(Child);

impl Program {
    fn start(arguments: &[&str]) -> Self {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["--exact", "program", "--nocapture"]).env(ARGUMENTS, arguments.join("\n"));
        Self(command.stdout(Stdio::piped()).spawn().unwrap())
    }

    /// Waits until it ends; the lines of JSON that it printed.
    fn finish(mut self) -> Vec<Value> {
        let lines = BufReader::new(self.0.stdout.take().unwrap()).lines().map(Result::unwrap);
        let told = lines.filter_map(|line| {
            serde_json::from_str(line.strip_prefix("test program ... ").unwrap_or(&line)).ok()
        });
        let told: Vec<Value> = told.filter(Value::is_object).collect();
        assert!(self.0.wait().unwrap().success(), "{told:?}");
        told
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Where to meet, which nobody else does.
fn place() -> (String, u16) {
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    (format!("tcp/127.0.0.1:{port}"), port)
}

fn wait_for(port: u16) {
    let end = Instant::now() + PATIENCE;
    while TcpStream::connect(("127.0.0.1", port)).is_err() {
        assert!(Instant::now() < end, "nobody listens");
        thread::sleep(Duration::from_millis(20));
    }
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
    let Ok(inbox::Message::Pair(pair)) = inbox.read(&shape.frame()) else { panic!("no pair") };
    let outcome = pair.result.unwrap();
    let made = Workspace::default().reconstruct_shape(
        (&mut inbox.memory(), outcome),
        &model,
        &Options::device(),
        &mut (),
    );
    surface(&made.unwrap())
}

#[test]
fn every_model_of_four_boards_by_two_publishers_arrives_at_one_subscriber() {
    const PAIRS: usize = 6;
    let folder = TempDir::new().unwrap();
    let shapes = [Shape::Screwdriver, Shape::Teapot, Shape::Mouse, Shape::Sphere];
    let devices = shapes.map(|shape| Device::new(folder.path(), shape));
    let (place, port) = place();
    let out = within(folder.path(), "out");
    let (models, pairs) = ((4 * PAIRS).to_string(), PAIRS.to_string());
    let subscriber = Program::start(&[
        "subscribe",
        "--listen-at",
        &place,
        "--out",
        &out,
        "--models",
        &models,
        "--seconds",
        "100",
        "--json",
    ]);
    wait_for(port);
    let names = shapes.map(|shape| format!("ossature/lab/{}", shape.name()));
    let publishers: Vec<Program> = [0, 2]
        .map(|k| {
            let mut arguments = vec!["listen", "--connect", &place, "--frames", &pairs, "--json"];
            for k in [k, k + 1] {
                let Device { port, calib, .. } = &devices[k];
                arguments.extend(["--port", port, "--calib", calib, "--publish", &names[k]]);
            }
            Program::start(&arguments)
        })
        .into();
    for publisher in publishers {
        let told = publisher.finish();
        assert_eq!(told.iter().filter(|line| line["models"] == PAIRS).count(), 2, "{told:?}");
        assert!(told.iter().all(|line| names.iter().any(|name| line["board"] == *name)), "{told:?}");
    }
    let told = subscriber.finish();
    let end = told.last().unwrap();
    assert_eq!((&end["models"], &end["lost"]), (&(4 * PAIRS).into(), &0.into()), "{end}");
    for (shape, device) in shapes.iter().zip(&devices) {
        let (truth, run) = (device.truth(), only(&Path::new(&out).join("lab").join(shape.name())));
        for pair in 1..=PAIRS {
            let pair = run.join(format!("{pair:06}"));
            assert!(fs::read(pair.join("model.ply")).unwrap() == truth, "{}", pair.display());
            assert!(
                grown(&pair.join("shape.bin"), &run.join("calibration.bin")) == truth,
                "{}",
                pair.display()
            );
        }
        let told: Value = serde_json::from_slice(&fs::read(run.join("000001/pair.json")).unwrap()).unwrap();
        assert!(told["warnings"].is_array() && told["levels_grey"].is_array(), "{told}");
        let status: Value = serde_json::from_slice(&fs::read(run.join("status.json")).unwrap()).unwrap();
        assert_eq!(status["about"]["board"], "bench", "{status}");
    }
}

#[test]
fn a_board_takes_orders_and_who_is_killed_is_missed_and_may_come_again() {
    let folder = TempDir::new().unwrap();
    let device = Device::new(folder.path(), Shape::Teapot);
    let (place, _) = place();
    let router = Link::open(&Meeting { listen: vec![place.clone()], ..Meeting::default() }).unwrap();
    let name = "ossature/lab/left";
    let (board, all) = (Board::one(name).unwrap(), "ossature/*/*".parse::<Board>().unwrap());
    let subscriber = router.subscribe(&all, Pressure::Wait).unwrap();
    let Device { port, calib, .. } = &device;
    let start = || {
        Program::start(&["listen", "--port", port, "--calib", calib, "--publish", name, "--connect", &place])
    };
    let next = |within: Duration| -> Option<Message> { subscriber.next(within).unwrap().map(Result::unwrap) };
    // What was told of the next pair for which this holds.
    let until = |holds: &dyn Fn(&Value) -> bool| {
        let end = Instant::now() + PATIENCE;
        while Instant::now() < end {
            let Some(message) = next(Duration::from_secs(1)).filter(|message| message.leaf == Leaf::Pair)
            else {
                continue;
            };
            let told: Value = serde_json::from_slice(&message.bytes).unwrap();
            if holds(&told) {
                return message;
            }
        }
        panic!("it never came");
    };
    // Everything until nothing comes but the status.
    let drain = || {
        let (mut pairs, mut quiet) = (0, Instant::now());
        while quiet.elapsed() < Duration::from_secs(3) {
            if next(Duration::from_millis(100)).is_some_and(|message| message.leaf == Leaf::Pair) {
                (pairs, quiet) = (pairs + 1, Instant::now());
            }
        }
        pairs
    };
    let first = start();
    let run = until(&|told| told["warnings"].is_array()).envelope.run;
    let order = |what: &str, value: &str| host(&["fleet", "order", name, what, value, "--connect", &place]);
    order("threshold", "123").unwrap();
    until(&|told| told["levels_grey"] == serde_json::json!([123, 123]));
    order("exposure", "150").unwrap();
    until(&|told| told["exposures"][0]["lines"] == 150);
    assert!(order("region", "1,2,30,40").unwrap_err().contains("1 refusal"));
    assert!(
        host(&["fleet", "order", "ossature/lab/right", "pairs", "1", "--connect", &place])
            .unwrap_err()
            .contains("no board")
    );
    order("pairs", "0").unwrap();
    drain();
    assert_eq!(drain(), 0, "it pauses");
    order("pairs", "1").unwrap();
    assert_eq!(drain(), 1, "a single shot is one pair");
    order("pairs", "all").unwrap();
    until(&|_| true);

    let list = || {
        Program::start(&["fleet", "list", "--watch", "--seconds", "1", "--json", "--connect", &place])
            .finish()
    };
    let told = list().remove(0);
    let entry = &told["boards"][0];
    assert_eq!(
        (&entry["board"], &entry["firmware"]),
        (&name.into(), &env!("CARGO_PKG_VERSION").into()),
        "{told}"
    );
    assert!(
        entry["last_seen_s"].as_f64().unwrap() < 5.0 && entry["status"]["rate_hz"].as_f64().unwrap() > 0.1,
        "{told}"
    );
    host(&["fleet", "--connect", &place]).unwrap();

    drop(first);
    let end = Instant::now() + PATIENCE;
    while !router.last(&all, Leaf::Status).unwrap().is_empty() {
        assert!(Instant::now() < end, "who is killed answers");
    }
    assert!(host(&["fleet", "--connect", &place]).unwrap_err().contains("no board answers"));
    while next(Duration::from_millis(500)).is_some() {}
    let _second = start();
    let mut ledger = Ledger::default();
    for _ in 0..9 {
        let message = next(PATIENCE).unwrap();
        let envelope = &message.envelope;
        assert!(message.board == board && envelope.run > run, "a new run: {envelope:?}");
        assert_eq!(ledger.came(&board, message.leaf, &envelope.run, envelope.number), None);
    }
}

#[test]
fn a_foreign_client_hears_every_model() {
    const PAIRS: usize = 4;
    let Some(python) = std::env::var_os("OSSATURE_ZENOH_PYTHON") else {
        assert_ne!(std::env::var("CI").as_deref(), Ok("true"), "in CI the foreign client must run");
        eprintln!("SKIPPED: OSSATURE_ZENOH_PYTHON is not set, so NO foreign client is tried");
        return;
    };
    let folder = TempDir::new().unwrap();
    let device = Device::new(folder.path(), Shape::Teapot);
    let (place, _) = place();
    let router = Link::open(&Meeting { listen: vec![place.clone()], ..Meeting::default() }).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../host/examples/subscribe.py");
    let kept = folder.path().join("kept");
    fs::create_dir(&kept).unwrap();
    let mut client = Command::new(python);
    let mut client = client
        .arg(script)
        .arg(&place)
        .current_dir(&kept)
        .stdout(Stdio::piped())
        .spawn()
        .map(Program)
        .unwrap();
    // The client says nothing when it is ready; it is when it hears something.
    let mut lines = BufReader::new(client.0.stdout.take().unwrap()).lines().map(Result::unwrap);
    let (sender, heard) = std::sync::mpsc::channel();
    thread::spawn(move || lines.try_for_each(|line| sender.send(line)));
    let no = Err("no");
    let limits = host::live::control::Limits {
        threshold: no,
        polarity: no,
        region: no,
        exposure: Err("no".into()),
        pairs: no,
    };
    let control = host::live::control::Control::new(host::live::control::Settings::default(), limits);
    let mut knock =
        router.publish(&Board::one("ossature/lab/knock").unwrap(), Pressure::Wait, control.into()).unwrap();
    let end = Instant::now() + PATIENCE;
    while heard.recv_timeout(Duration::from_millis(100)).is_err() {
        assert!(Instant::now() < end, "the client hears nothing");
        knock.put(Leaf::Health, 0, b"{}".to_vec()).unwrap();
    }
    let pairs = PAIRS.to_string();
    let Device { port, calib, .. } = &device;
    let name = "ossature/lab/left";
    let publisher = Program::start(&[
        "listen",
        "--port",
        port,
        "--calib",
        calib,
        "--publish",
        name,
        "--frames",
        &pairs,
        "--connect",
        &place,
    ]);
    let mut models = Vec::new();
    while models.len() < PAIRS {
        let line = heard.recv_timeout(PATIENCE).expect("a line");
        if let Some(told) = line.strip_prefix("ossature/lab/left/model ") {
            models.push(told.to_owned());
        }
    }
    let _ = publisher.finish();
    let truth = device.truth();
    let expected: Vec<String> = (0..PAIRS).map(|k| format!("{k} {} {}", k + 1, truth.len())).collect();
    assert_eq!(models, expected);
    thread::sleep(Duration::from_millis(500));
    let files: Vec<_> = fs::read_dir(&kept).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert_eq!(files.len(), PAIRS);
    assert!(files.iter().all(|file| fs::read(file).unwrap() == truth));
}
