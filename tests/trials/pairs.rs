//! Pairs without end through `host replay`: one process, run after run into the same folder, good pairs and bad ones
//! mixed. What goes in is made, refused or left out; folders hold whole models or are not there; memory stays.

use crate::memory::Memory;
use crate::worker::Worker;
use host::calibration::StereoCamera;
use image::GrayImage;
use oracle::generated::object;
use oracle::program::within;
use oracle::raster::Random;
use oracle::scene::Pair;
use serde_json::Value;
use std::fs::{self, OpenOptions};
use std::path::Path;
use std::time::Instant;

const SIZE: [u32; 2] = [160, 120];
/// Pairs of a run.
const RUN: usize = 100;
/// What a model is.
const FILES: [&str; 4] = ["boundary.ply", "model.ply", "report.json", "skeleton.ply"];

/// What is put in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Object,
    Noise,
    /// The right eye sees nothing.
    Blank,
    /// A file ends early.
    Cut,
    /// A file is empty.
    Empty,
    /// Of another size than the calibration.
    OtherSize,
    /// No right picture.
    Alone,
}

impl Kind {
    fn draw(random: &mut Random) -> Self {
        match random.below(20) {
            0 => Self::Noise,
            1 => Self::Blank,
            2 => Self::Cut,
            3 => Self::Empty,
            4 => Self::OtherSize,
            5 => Self::Alone,
            _ => Self::Object,
        }
    }

    /// Whether there can be a model.
    fn may_be_made(self) -> bool {
        matches!(self, Self::Object | Self::Noise)
    }

    /// Puts a pair's files into a folder.
    fn put(self, folder: &Path, number: usize, random: &mut Random) {
        let size = if self == Self::OtherSize { SIZE.map(|side| side / 2) } else { SIZE };
        let [mut left, mut right]: Pair = object(random, size);
        match self {
            Self::Blank => right.fill(12),
            Self::Noise => {
                left.iter_mut().chain(right.iter_mut()).for_each(|grey| *grey = random.below(256) as u8);
            }
            _ => {}
        }
        for (eye, picture) in [("left", left), ("right", right)] {
            let path = folder.join(format!("{eye}_{number:06}.pgm"));
            if self == Self::Alone && eye == "right" {
                // It may be there of the run before.
                let _ = fs::remove_file(path);
                continue;
            }
            save(&picture, &path);
            if matches!(self, Self::Cut | Self::Empty) && eye == "right" {
                let kept = if self == Self::Cut { random.below(19_000) } else { 0 };
                OpenOptions::new()
                    .write(true)
                    .open(path)
                    .and_then(|file| file.set_len(kept))
                    .expect("it is cut");
            }
        }
    }
}

fn save(picture: &GrayImage, path: &Path) {
    picture.save(path).expect("a picture is written");
}

/// What became of pairs.
#[derive(Debug, Default)]
struct Counts {
    put: usize,
    done: usize,
    refused: usize,
    dropped: usize,
}

/// Has so many pairs made.
pub(crate) fn run(count: usize) {
    let begun = Instant::now();
    let folder = tempfile::tempdir().expect("a folder");
    let (input, out) = (folder.path().join("in"), folder.path().join("out"));
    fs::create_dir(&input).expect("a folder");
    let [width, height] = SIZE;
    let camera = StereoCamera::rectified(width, height, width.into(), 60.0);
    camera.write_opencv_yaml(input.join("calib.yaml")).expect("a calibration");
    let mut worker = Worker::start(&folder.path().join("errors"));
    let mut memory = Memory::of(worker.id());
    let (mut random, mut counts) = (Random(6), Counts::default());
    let mut left = count;
    while left > 0 {
        // As many as before, or the last ones: files of a run before would be put in again.
        let run = left.min(RUN);
        if run < RUN {
            clear(&input);
        }
        let kinds: Vec<Kind> = (0..run).map(|_| Kind::draw(&mut random)).collect();
        for (number, kind) in kinds.iter().enumerate() {
            kind.put(&input, number, &mut random);
        }
        let told = replay(&mut worker, folder.path());
        add(&mut counts, &kinds, &told, &out);
        memory.look();
        left -= run;
    }
    let Counts { put, done, refused, dropped } = counts;
    let minutes = begun.elapsed().as_secs_f64() / 60.0;
    println!("{put} pairs in {minutes:.1} min: {done} done, {refused} refused, {dropped} dropped");
    assert_eq!(put, done + refused + dropped);
    assert!(put == count && done > put / 2 && refused > 0 && dropped > 0);
    memory.judge();
}

/// Removes all pictures.
fn clear(folder: &Path) {
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.extension().is_some_and(|extension| extension == "pgm") {
            fs::remove_file(path).expect("it can be removed");
        }
    }
}

/// What is told of a run over the folder.
fn replay(worker: &mut Worker, folder: &Path) -> Value {
    let (input, out) = (within(folder, "in"), within(folder, "out"));
    let mut told = String::new();
    let ended =
        worker.run(&["replay", &input, "--out", &out, "--no-pictures", "--json"], |line| told += line);
    let refused = ended.expect_err("some are refused");
    assert!(refused.ends_with("pairs were refused"), "{refused}");
    serde_json::from_str(&told).expect("JSON")
}

/// Adds what a run told, and holds it against what was put in and what stands in folders.
fn add(counts: &mut Counts, kinds: &[Kind], told: &Value, out: &Path) {
    let pairs = told["pairs"].as_array().expect("pairs");
    let alone = told["without_partner"].as_array().expect("images").len();
    assert_eq!(pairs.len() + alone, kinds.len(), "pairs are lost");
    assert_eq!(alone, kinds.iter().filter(|kind| **kind == Kind::Alone).count());
    for pair in pairs {
        let name = pair["name"].as_str().expect("a name");
        let kind = kinds[name.parse::<usize>().expect("a number")];
        let mut files: Vec<String> = fs::read_dir(out.join(name))
            .map(|entries| {
                entries.map(|entry| entry.expect("an entry").file_name().into_string().unwrap()).collect()
            })
            .unwrap_or_default();
        files.sort();
        if pair["error"].is_null() {
            assert!(kind.may_be_made(), "{kind:?} {name} has a model");
            assert_eq!(files, FILES, "{kind:?} {name}");
            counts.done += 1;
        } else {
            assert!(
                files.is_empty(),
                "{kind:?} {name} is refused, and there is {files:?}: {}",
                pair["error"]
            );
            counts.refused += 1;
        }
    }
    counts.dropped += alone;
    counts.put += kinds.len();
}
