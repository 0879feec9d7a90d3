//! What a pair takes on one thread, from its pictures to its files:
//! `cargo run --release -p system-tests --example stages`.
//!
//! Prints the stages of the torus of `host demo`, and whole pairs by what their surface comes from: medians of many
//! rounds in a warm workspace, ms.

use host::calibration::StereoCamera;
use host::output;
use host::reconstruct::{Front, Options, Workspace};
use host::report::Run;
use host::report::record::Record;
use host::report::times::{CORE, stages};
use oracle::program::{host, within};
use std::path::Path;
use std::time::Instant;

/// So often each pair is made.
const ROUNDS: usize = 31;

/// Names and median times, in their order; the last one is that of the whole pair.
fn times(folder: &Path, shape: &str, front: Front) -> Vec<(String, f64)> {
    let [pair, out] = ["pair", "out"].map(|name| folder.join(format!("{shape}-{name}")));
    host(&["render", shape, "--out", &within(&pair, "")]).unwrap();
    let options = &Options { front, ..Options::default() };
    let mut workspace = Workspace::default();
    let mut rounds: Vec<(String, Vec<f64>)> = Vec::new();
    for _ in 0..ROUNDS {
        let start = Instant::now();
        let images = ["left.png", "right.png"].map(|name| image::open(pair.join(name)).unwrap().into_luma8());
        let calibration = &StereoCamera::read(pair.join("calib.yaml")).unwrap();
        let mut record = Record::figures_only();
        let made = workspace.reconstruct(images.each_ref(), calibration, options, &mut record).unwrap();
        let run = Run { calibration, options, reconstruction: &made, record: &record, truth: None };
        output::write(&out, &run, false).unwrap();
        let whole = ("whole pair, files and all".to_owned(), start.elapsed());
        let named = stages(&run).into_iter().filter(|stage| stage.name != CORE);
        let named = named.map(|stage| (format!("{} {}", stage.part.name(), stage.name), stage.time));
        for (i, (name, time)) in named.chain([whole]).enumerate() {
            if i == rounds.len() {
                rounds.push((name, Vec::new()));
            }
            rounds[i].1.push(time.as_secs_f64() * 1e3);
        }
        workspace.recycle(made);
    }
    let median = |mut times: Vec<f64>| {
        times.sort_unstable_by(f64::total_cmp);
        times[times.len() / 2]
    };
    rounds.into_iter().map(|(name, times)| (name, median(times))).collect()
}

fn main() {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let torus = times(folder.path(), "torus", Front::Balls);
    println!("\n| torus, 640x480 | ms |\n|---|---|");
    torus.iter().for_each(|(name, ms)| println!("| {name} | {ms:.2} |"));
    let teapot = [Front::Balls, Front::Grey, Front::Auto].map(|front| {
        let (_, ms) = times(folder.path(), "teapot", front).pop().unwrap();
        format!("{ms:.0}")
    });
    println!("\n| ms | balls | grey | auto |\n|---|---|---|---|");
    println!("| teapot, 640x480 | {} |", teapot.join(" | "));
}
