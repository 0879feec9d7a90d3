//! Pairs of a device on an emulated board through `host listen`, while bits of its link flip, bytes vanish, come twice
//! or are noise, the connection ends, and its eyes lose their pictures. What was begun is described, refused, shown or
//! dropped, to the last pair; what was sent is heard or was hit; what is heard gives the model of its pictures or none.

mod proxy;

use crate::memory::Memory;
use crate::worker::Worker;
use oracle::board;
use oracle::generated::object;
use oracle::program::within;
use oracle::raster::Random;
use oracle::scene::{Pair, bent_camera};
use proxy::{Fate, Proxy};
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

const SIZE: [u32; 2] = [320, 240];
/// Pairs that the eyes see, over and over: these are objects, and a pair of nothing and one of noise follow.
const OBJECTS: usize = 6;
/// So many pairs between two looks at memory.
const LOOK: usize = 20;
/// How often the eyes lose their pictures, and for how long.
const BLINK: [Duration; 2] = [Duration::from_secs(9), Duration::from_millis(250)];
/// Coarse, for speed.
const RESOLUTION: &str = "12";

/// What the eyes see.
fn scenes() -> Vec<Pair> {
    let mut random = Random(9);
    let mut scenes: Vec<Pair> = (0..OBJECTS).map(|_| object(&mut random, SIZE)).collect();
    let mut last = [0, 1].map(|_| object(&mut random, SIZE));
    last[0].iter_mut().for_each(|picture| picture.fill(12));
    last[1]
        .iter_mut()
        .for_each(|picture| picture.iter_mut().for_each(|grey| *grey = random.below(256) as u8));
    scenes.extend(last);
    scenes
}

/// The models of the scenes, made without a device.
fn truth(worker: &mut Worker, folder: &Path, scenes: &[Pair]) -> BTreeSet<Vec<u8>> {
    let calib = within(folder, "calib.yaml");
    let mut models = BTreeSet::new();
    for (number, pair) in scenes.iter().enumerate() {
        let [left, right] = ["left", "right"].map(|eye| within(folder, &format!("{eye}{number}.png")));
        let out = within(folder, &format!("model{number}"));
        for (picture, path) in pair.iter().zip([&left, &right]) {
            picture.save(path).expect("a picture is written");
        }
        let replay = ["replay", &left, &right, "--calib", &calib, "--as-device", "--resolution", RESOLUTION];
        if worker.run(&[&replay[..], &["--out", &out]].concat(), |_| ()).is_ok() {
            models.insert(fs::read(Path::new(&out).join("model.ply")).expect("a model"));
        }
    }
    models
}

/// Takes the pictures away from the eyes now and then, until it is told to end.
fn blink(pictures: &Path, bytes: &[u8], stop: &AtomicBool) {
    let mut last = Instant::now();
    while !stop.load(Ordering::Relaxed) {
        thread::sleep(BLINK[1]);
        if last.elapsed() >= BLINK[0] {
            fs::write(pictures, []).expect("pictures vanish");
            thread::sleep(BLINK[1]);
            fs::write(pictures, bytes).expect("pictures are back");
            last = Instant::now();
        }
    }
}

/// What `host listen` told.
#[derive(Default)]
struct Heard {
    numbers: BTreeSet<u64>,
    models: usize,
    refused: usize,
    last: Value,
}

impl Heard {
    fn take(&mut self, line: &str, truth: &BTreeSet<Vec<u8>>) {
        let told: Value = serde_json::from_str(line).expect("JSON");
        let Some(number) = told["pair"].as_u64() else { return self.last = told };
        assert!(self.numbers.insert(number), "pair {number} twice");
        if told["error"].is_null() {
            let folder = Path::new(told["folder"].as_str().expect("a folder"));
            let model = fs::read(folder.join("model.ply")).expect("a model");
            assert!(truth.contains(&model), "pair {number} is no model of the pictures");
            fs::remove_dir_all(folder).expect("it can be removed");
            self.models += 1;
        } else {
            self.refused += 1;
        }
    }
}

/// Has so many pairs taken.
pub(crate) fn run(count: usize) {
    let Some(image) = board::build("device", "mps2") else { return };
    let begun = Instant::now();
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    bent_camera(2).write_opencv_yaml(folder.join("calib.yaml")).expect("a calibration");
    let mut worker = Worker::start(&folder.join("errors"));
    let scenes = scenes();
    let truth = truth(&mut worker, folder, &scenes);
    assert!(truth.len() >= OBJECTS / 2, "{} models", truth.len());
    let bytes: Vec<u8> = scenes.iter().flatten().flat_map(|picture| picture.as_raw().clone()).collect();
    let pictures = folder.join("pictures");
    fs::write(&pictures, &bytes).expect("pictures");

    let line = folder.join("board.socket");
    let device = format!("socket,id=line,path={},server=on,wait=on", line.display());
    let serial = ["-chardev", &device, "-serial", "chardev:line"];
    let Some(_board) = board::start(board::MACHINES[1], &image, &[&pictures], &serial) else { return };
    let proxy = Proxy::start(&line, &folder.join("device.socket"));
    let port = within(folder, "device.socket");
    let calib = within(folder, "calib.yaml");
    worker.run(&["device", "calibrate", &calib, "--port", &port], |_| ()).expect("it is calibrated");

    let stop = Arc::new(AtomicBool::new(false));
    let eyes = thread::spawn({
        let stop = Arc::clone(&stop);
        move || blink(&pictures, &bytes, &stop)
    });
    let mut memory = Memory::of(worker.id());
    let (mut heard, frames, out) = (Heard::default(), count.to_string(), within(folder, "out"));
    let listen = ["listen", "--port", &port, "--calib", &calib, "--frames", &frames, "--json", "--out", &out];
    let tape = within(folder, "tape");
    let more = ["--resolution", RESOLUTION, "--record", &tape];
    proxy.fail(true);
    let ended = worker.run(&[&listen[..], &more].concat(), |line| {
        heard.take(line, &truth);
        if heard.numbers.len() % LOOK == 0 {
            memory.look();
        }
    });
    proxy.fail(false);
    ended.expect("it listens to the end");
    stop.store(true, Ordering::Relaxed);
    eyes.join().expect("it ends");
    // A quiet pair, behind which none is begun: its number is how many there were.
    let shown = within(folder, "shown");
    worker.run(&["device", "grab", "grey", "--port", &port, "--out", &shown], |_| ()).expect("it is shown");
    let mut told = String::new();
    worker.run(&["device", "info", "--port", &port, "--json"], |line| told += line).expect("it answers");
    let health = serde_json::from_str(&told).expect("JSON");
    println!("{count} pairs in {:.1} min", begun.elapsed().as_secs_f64() / 60.0);
    balance(&heard, &proxy, &health);
    again(&mut worker, &tape, &heard, folder);
    memory.judge();
}

/// Holds what the device counted, what went over the link and what was heard against each other.
fn balance(heard: &Heard, proxy: &Proxy, health: &Value) {
    let of = |what: &str| health["health"][what].as_u64().unwrap_or_else(|| panic!("no {what} in {health}"));
    let (pairs, refused, dropped) = (of("pairs"), of("refused"), of("dropped"));
    let (begun, fates) = (proxy.newest(), proxy.fates());
    let described = fates.len() as u64 - refused;
    println!("device: {begun} begun: {described} described, {refused} refused, 1 shown, {dropped} dropped");
    assert_eq!(begun, pairs + dropped, "{health}");
    assert_eq!(pairs, fates.len() as u64 + 1, "what was made was sent");
    let last = *heard.numbers.last().expect("some were heard");
    let fate = |fate: Fate| fates.iter().filter(|(number, f)| **number <= last && **f == fate).count();
    let (hit, unheard) = (fate(Fate::Hit), fate(Fate::Unheard));
    let sent = fates.range(..=last).count();
    let lost = sent - heard.numbers.len();
    println!(
        "link: {sent} sent: {} heard, {lost} lost; {hit} hit, {unheard} while nobody listened",
        heard.numbers.len()
    );
    for (number, fate) in fates.range(..=last) {
        assert!(
            *fate != Fate::Whole || heard.numbers.contains(number),
            "pair {number} was sent whole and is lost"
        );
    }
    assert!(heard.numbers.iter().all(|number| fates.contains_key(number)), "pairs that were not sent");
    println!(
        "host: {} pairs: {} models, {} refused; {}",
        heard.numbers.len(),
        heard.models,
        heard.refused,
        heard.last
    );
    assert_eq!(heard.last["pairs"], heard.numbers.len());
    assert_eq!(heard.last["models"], heard.models);
    assert_eq!(heard.models + heard.refused, heard.numbers.len());
}

/// The recording gives the same again.
fn again(worker: &mut Worker, tape: &str, heard: &Heard, folder: &Path) {
    let mut last = Value::Null;
    let replay = ["replay", tape, "--json", "--resolution", RESOLUTION, "--out", &within(folder, "again")];
    let ended = worker.run(&replay, |line| last = serde_json::from_str(line).expect("JSON"));
    ended.expect("it is replayed");
    println!("replayed: {last}");
    // What came while an answer was waited for is in the recording, whether the pair was still wanted or not.
    let [pairs, models] = ["pairs", "models"].map(|what| last[what].as_u64().expect("a number") as usize);
    assert!(pairs >= heard.numbers.len() && models >= heard.models, "{last}");
}
