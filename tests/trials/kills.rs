//! Whoever writes is killed at any moment: anywhere in a run, soon after a file under way is seen, and as soon as the
//! first file has its name. Each file is the old or the new one, recordings are read to the last whole pair,
//! and the next run takes away what was left.

use crate::worker::part;
use host::calibration::StereoCamera;
use host::reconstruct::{Options, describe};
use host::source::find::find;
use host::source::serial::link::frames;
use host::source::serial::recording::Recording;
use oracle::generated::object;
use oracle::program::within;
use oracle::raster::Random;
use serde_json::Value;
use shared::wire::{Decoder, MAX_FRAME};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::thread;
use std::time::{Duration, Instant, SystemTime};

const SIZE: [u32; 2] = [160, 120];
/// A hidden name is what is under way.
const UNDER_WAY: &str = ".unfinished-";
/// Longest that is waited for the first file under way.
const PATIENCE: Duration = Duration::from_secs(20);
/// What is older was left by the dead.
const OLD: Duration = Duration::from_secs(60);

/// Files by name, without what changes from run to run.
type Files = BTreeMap<String, Vec<u8>>;

/// Two pairs, each a folder of its own, and their calibration.
struct Bench {
    folder: tempfile::TempDir,
    random: Random,
}

/// How often somebody was killed, how often that left files under way, and how often old and new ones side by side.
#[derive(Default)]
struct Tally {
    kills: u64,
    under_way: u64,
    mixed: u64,
}

impl Bench {
    fn new() -> Self {
        let (folder, mut random) = (tempfile::tempdir().expect("a folder"), Random(2));
        let [width, height] = SIZE;
        let camera = StereoCamera::rectified(width, height, width.into(), 60.0);
        for name in ["old", "new"] {
            let pair = folder.path().join(name);
            fs::create_dir(&pair).expect("a folder");
            camera.write_opencv_yaml(pair.join("calib.yaml")).expect("a calibration");
            for (eye, picture) in ["left.png", "right.png"].iter().zip(object(&mut random, SIZE)) {
                picture.save(pair.join(eye)).expect("a picture");
            }
        }
        Self { folder, random }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn name(&self, name: &str) -> String {
        within(self.folder.path(), name)
    }

    /// Runs a part to its end; how long it takes.
    fn whole(&self, arguments: &[&str]) -> Duration {
        let begun = Instant::now();
        let done = part(arguments).stdout(Stdio::null()).status().expect("it starts");
        assert!(done.success(), "{arguments:?}");
        begun.elapsed()
    }

    /// Runs a part and kills it at such a moment; `time` is what a whole run takes.
    fn killed(&mut self, arguments: &[&str], time: Duration, moment: Moment, folder: &Path) {
        let before = (under_way(folder), places(folder));
        let mut child = part(arguments).stdout(Stdio::null()).spawn().expect("it starts");
        let begun = Instant::now();
        let came = |moment| match moment {
            Moment::Any => true,
            Moment::UnderWay => under_way(folder).iter().any(|name| !before.0.contains(name)),
            Moment::Moving => places(folder) != before.1,
            Moment::Holding(bytes) => held(folder) >= bytes,
        };
        let mut is_alive = || child.try_wait().is_ok_and(|end| end.is_none());
        while !came(moment) && begun.elapsed() < PATIENCE && is_alive() {
            // Shorter than results take to be moved.
            thread::sleep(Duration::from_micros(20));
        }
        let most = match moment {
            Moment::Any | Moment::Holding(_) => time,
            Moment::UnderWay => time / 10,
            Moment::Moving => Duration::ZERO,
        };
        thread::sleep(Duration::from_micros(self.random.below(1 + most.as_micros() as u64)));
        assert!(arguments[0] == "host" || is_alive(), "{arguments:?} never ends");
        child.kill().expect("it is killed, or has ended");
        child.wait().expect("it ends");
    }
}

/// When somebody is killed.
#[derive(Clone, Copy)]
enum Moment {
    /// Anywhere in a run.
    Any,
    /// Soon after a file under way is there.
    UnderWay,
    /// As soon as a file has its name.
    Moving,
    /// Anywhere after a recording holds so many bytes.
    Holding(u64),
}

/// What is under way in a folder.
fn under_way(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
    names.filter(|name| name.starts_with(UNDER_WAY)).collect()
}

/// Where the files of a folder are on their disk.
fn places(folder: &Path) -> Vec<u64> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let files = entries.filter(|entry| !entry.file_name().to_string_lossy().starts_with(UNDER_WAY));
    files.filter_map(|entry| Some(entry.metadata().ok()?.ino())).collect()
}

/// Bytes of a recording: a file, or the files of a folder but those under way.
fn held(recording: &Path) -> u64 {
    let length = |path: &Path| fs::metadata(path).map_or(0, |about| about.len());
    if !recording.is_dir() {
        return length(recording);
    }
    let entries = fs::read_dir(recording).into_iter().flatten().flatten();
    let files = entries.filter(|entry| !entry.file_name().to_string_lossy().starts_with(UNDER_WAY));
    files.map(|entry| length(&entry.path())).sum()
}

/// All files below a folder but those under way.
fn files(folder: &Path) -> Files {
    fn below(folder: &Path, root: &Path, files: &mut Files) {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            let (path, name) = (entry.path(), entry.file_name());
            if name.to_string_lossy().starts_with(UNDER_WAY) {
                continue;
            }
            if path.is_dir() {
                below(&path, root, files);
                continue;
            }
            let name = path.strip_prefix(root).expect("it is below").display().to_string();
            files.insert(name, timeless(&path));
        }
    }
    let mut all = Files::new();
    below(folder, folder, &mut all);
    all
}

/// The bytes of a file; of a report, all that is no time.
fn timeless(path: &Path) -> Vec<u8> {
    let bytes = fs::read(path).expect("a file");
    if !path.ends_with("report.json") {
        return bytes;
    }
    let mut report: Value = serde_json::from_slice(&bytes).expect("a whole report");
    report["times_ms"].take();
    report.to_string().into_bytes()
}

/// Makes all under a folder look as if it had been left long ago.
fn age(folder: &Path) {
    for entry in fs::read_dir(folder).expect("a folder").flatten() {
        let long_ago = SystemTime::now() - OLD;
        File::open(entry.path()).and_then(|file| file.set_modified(long_ago)).expect("it can be aged");
    }
}

/// What is written in place of something older: every file is one of both.
fn replaced(bench: &mut Bench, count: u64, target: &Path, make: &dyn Fn(&Bench, &str) -> Vec<String>) {
    let [old, new] = ["old", "new"].map(|pair| {
        let arguments = make(bench, pair);
        bench.whole(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
        files(target)
    });
    assert!(old.keys().eq(new.keys()) && old != new, "{:?}", old.keys());
    let arguments = ["old", "new"].map(|pair| make(bench, pair));
    let arguments = arguments.each_ref().map(|all| all.iter().map(String::as_str).collect::<Vec<_>>());
    let time = bench.whole(&arguments[0]);
    let mut tally = Tally::default();
    for kill in 0..count {
        let next = &arguments[1 - kill as usize % 2];
        let moment = [Moment::Any, Moment::UnderWay, Moment::Moving][kill as usize / 2 % 3];
        let before = under_way(target);
        bench.killed(next, time, moment, target);
        tally.kills += 1;
        tally.under_way += u64::from(under_way(target).iter().any(|name| !before.contains(name)));
        let found = files(target);
        assert!(found.keys().eq(old.keys()), "{:?} are there", found.keys());
        let each_is_whole = found.iter().all(|(name, bytes)| *bytes == old[name] || *bytes == new[name]);
        assert!(each_is_whole, "a file is neither the old nor the new one");
        tally.mixed += u64::from(found != old && found != new);
    }
    age(target);
    bench.whole(&arguments[1]);
    assert_eq!(under_way(target), [""; 0], "what the dead left is still there");
    assert!(files(target) == new);
    let Tally { kills, under_way, mixed } = tally;
    println!(
        "{}: {kills} killed; {under_way} left files under way, {mixed} old files beside new",
        arguments[0][1]
    );
}

/// `host replay` with all that it can leave.
fn results(bench: &mut Bench, count: u64) {
    let target = bench.path("models");
    replaced(bench, count, &target, &|bench, pair| {
        let [left, right, calib] =
            ["left.png", "right.png", "calib.yaml"].map(|file| bench.name(&format!("{pair}/{file}")));
        let out = bench.name("models");
        let replay = ["host", "replay", &left, &right, "--calib", &calib, "--out", &out, "--resolution", "8"];
        replay.map(String::from).to_vec()
    });
}

/// `host convert`.
fn exports(bench: &mut Bench, count: u64) {
    for pair in ["old", "new"] {
        let [left, right, calib] =
            ["left.png", "right.png", "calib.yaml"].map(|file| bench.name(&format!("{pair}/{file}")));
        let out = bench.name(&format!("{pair}-model"));
        let made = ["host", "replay", &left, &right, "--calib", &calib, "--no-pictures", "--out", &out];
        bench.whole(&made);
    }
    let target = bench.path("exports");
    fs::create_dir(&target).expect("a folder");
    replaced(bench, count, &target, &|bench, pair| {
        let [model, out] = [format!("{pair}-model"), "exports/cup.stl".into()].map(|name| bench.name(&name));
        ["host", "convert", &model, &out].map(String::from).to_vec()
    });
}

/// A recording of `host capture`: pairs are whole, one by one, and at most one picture has no partner.
fn recorded_pairs(bench: &mut Bench, count: u64) {
    let (pair, target) = (bench.name("new"), bench.path("recording"));
    let expected =
        ["left.png", "right.png"].map(|name| fs::read(bench.path("new").join(name)).expect("a picture"));
    let expected = expected.map(|bytes| image::load_from_memory(&bytes).expect("a picture").into_luma8());
    // More than a calibration and one picture take.
    let a_pair = 2 * u64::from(SIZE[0] * SIZE[1]);
    let (mut whole, mut alone) = (0, 0);
    for kill in 0..count {
        let _ = fs::remove_dir_all(&target);
        let folder = target.display().to_string();
        let moment = [Moment::Any, Moment::Holding(a_pair)][kill as usize % 2];
        bench.killed(&["record", &pair, &folder], Duration::from_millis(60), moment, &target);
        let Ok(found) = find(&[folder], None) else { continue };
        for (place, pair) in found.pairs.iter().enumerate() {
            assert_eq!(pair.name, format!("{:06}", place + 1), "none is left out");
            assert!(pair.load().expect("a whole pair").images == expected);
            StereoCamera::read(pair.calibration.as_ref().expect("it comes first"))
                .expect("a whole calibration");
        }
        assert!(found.alone.len() <= 1, "{:?}", found.alone);
        whole += found.pairs.len();
        alone += found.alone.len();
    }
    println!("record: {count} killed, {whole} whole pairs, {alone} pictures without partner");
    assert!(whole as u64 >= count / 2, "whole pairs are not found again");
}

/// A recording of `host listen`: all that was written but for the last entry, and each of its frames is read.
fn recorded_bytes(bench: &mut Bench, count: u64) {
    let calib = bench.path("new/calib.yaml");
    let [left, right] = ["left.png", "right.png"]
        .map(|name| image::open(bench.path("new").join(name)).expect("a picture").into_luma8());
    let camera = StereoCamera::read(&calib).expect("a calibration");
    let (_, frame) = describe(left, right, &camera, &Options::default()).expect("a frame");
    let bytes = bench.path("bytes");
    fs::write(&bytes, &frame).expect("bytes");
    let target = bench.path("tape");
    // More than a calibration and one frame take, whatever becomes of the last entry.
    let a_frame = 1000 + 2 * frame.len() as u64;
    let (mut read, mut empty) = (0, 0);
    for kill in 0..count {
        let _ = fs::remove_file(&target);
        let arguments = [&calib, &bytes, &target].map(|path| path.display().to_string());
        let [calib, bytes, tape] = arguments.each_ref().map(String::as_str);
        let moment = [Moment::Any, Moment::Holding(a_frame)][kill as usize % 2];
        bench.killed(&["tape", calib, bytes, tape], Duration::from_millis(30), moment, &target);
        let Ok(recording) = Recording::read(&target) else {
            // Killed before there was a calibration.
            let length = fs::metadata(&target).map_or(0, |about| about.len());
            assert!(length < 1000, "{length} bytes cannot be read");
            empty += 1;
            continue;
        };
        let got = recording.connections.concat();
        assert!(got.iter().eq(frame.iter().cycle().take(got.len())), "what was recorded is what came");
        let mut buffer = vec![0; MAX_FRAME];
        let mut decoder = Decoder::new(&mut buffer);
        let mut count = 0;
        frames(&mut decoder, &got, |_| count += 1);
        assert_eq!(count, got.len() / frame.len(), "each whole frame is read");
        read += count;
    }
    println!("tape: {count} killed, {read} frames, {empty} without any");
    assert!(read as u64 >= count / 2, "whole frames are not read again");
}

/// Kills each of those who write so often.
pub(crate) fn run(count: u64) {
    let mut bench = Bench::new();
    results(&mut bench, count);
    exports(&mut bench, count);
    recorded_pairs(&mut bench, count);
    recorded_bytes(&mut bench, count);
}
