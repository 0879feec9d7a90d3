//! The same input gives the same bits: twice, on one thread and on several, in any memory, by any kernels, in debug and
//! in release, and on every machine, for which checksums of one small case and of generated pairs are frozen here.
//!
//! `REGENERATE=1 cargo test -p system-tests --test determinism` writes the checksums anew.

use host::reconstruct::{Mode, Options};
use host::shape::Shape;
use oracle::core::{Core, Picture};
use oracle::generated::case;
use oracle::scene::{Pair, drawn_pair, model, pair};
use oracle::sums::{Bench, checksum, mesh_checksum};
use shared::fixed::PX;
use shared::pipeline::Settings;
use shared::stage::correspond::PaperMatching;
use shared::stage::depth::Optics;
use std::fmt::Write as _;
use std::path::Path;

/// Generated pairs.
const GENERATED: u64 = 150;

/// A wrench: a ring, a bar and a fork, in small, at a disparity that grows downwards.
fn wrench() -> Pair {
    drawn_pair(40.0, 0.05, |u, v| {
        let (ring, fork) = ((u - 170.0).hypot(v - 80.0), (u - 170.0).hypot(v - 165.0));
        (10.0..22.0).contains(&ring)
            || ((u - 170.0).abs() < 7.0 && (98.0..150.0).contains(&v))
            || (fork < 20.0 && ((u - 170.0).abs() > 8.0 || v < 162.0))
    })
}

const MODES: [(&str, Mode); 2] = [("default", Mode::Default), ("paper", Mode::Paper { omega: 3 })];

#[test]
fn two_runs_and_any_number_of_threads_agree() {
    for (name, mode) in MODES {
        let options = Options { mode, ..Options::default() };
        let run = |threads: usize, pair: &Pair| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let model = pool.install(|| model(pair, &options).unwrap());
            (mesh_checksum(&model.mesh), model.outcome)
        };
        for pair in [wrench(), pair(Shape::Block, 2)] {
            let first = run(1, &pair);
            for threads in [1, 2, 5] {
                assert!(run(threads, &pair) == first, "{name} on {threads} threads");
            }
        }
    }
}

/// A checksum of every integer that the core leaves in its memory.
fn core_checksum(pair: &Pair, settings: &Settings) -> u64 {
    let pictures: [Picture; 2] = pair
        .each_ref()
        .map(|image| image.as_raw().chunks(image.width() as usize).map(<[u8]>::to_vec).collect());
    let mut text = String::new();
    let outcome = Core::default()
        .run([&pictures[0], &pictures[1]], settings, "", &mut (), |memory, _| {
            for eye in &memory.eyes {
                let _ = write!(text, "{:?}{:?}{:?}", eye.contour, eye.loops, eye.hull);
                let _ = write!(text, "{:?}{:?}{:?}", eye.samples, eye.branches, eye.controls);
                let _ = write!(text, "{:?}{:?}", eye.graph.nodes, eye.graph.edges);
            }
            let _ = write!(text, "{:?}{:?}{:?}", memory.matches, memory.balls, memory.depths);
            let _ = write!(text, "{:?}{:?}", memory.boundary_pairs, memory.skeleton_pairs);
        })
        .unwrap();
    let _ = write!(text, "{:?}{:?}{:?}", outcome.plane, outcome.areas, outcome.frontier_offsets);
    checksum(text.into_bytes())
}

#[test]
fn debug_and_release_and_every_machine_agree() {
    let pair = wrench();
    let optics = Optics { focal: 375 * PX, disparity_offset: 0 };
    let images = checksum(pair.iter().flat_map(|image| image.as_raw().clone()));
    let mut found = format!("images {images:016x}\n");
    let settings = [Settings::new(optics), Settings::paper(optics, PaperMatching::default())];
    for ((name, mode), settings) in MODES.into_iter().zip(settings) {
        let model = model(&pair, &Options { mode, ..Options::default() }).unwrap();
        let _ = writeln!(found, "{name} core {:016x}", core_checksum(&pair, &settings));
        let _ = writeln!(found, "{name} mesh {:016x}", mesh_checksum(&model.mesh));
    }
    assert_frozen("determinism.txt", &found);
}

/// Generated pairs, a few of those that `trials same` goes through.
#[test]
fn generated_pairs_give_the_same_on_every_way_and_every_machine() {
    let mut bench = Bench::default();
    let mut found = String::new();
    for number in 0..GENERATED {
        let _ = writeln!(found, "{number} {}", bench.sums(&case(number)));
    }
    assert!(
        bench.models * 4 > GENERATED && bench.short > 0,
        "{} models, {} short",
        bench.models,
        bench.short
    );
    assert_frozen("generated.txt", &found);
}

/// Holds text against a frozen file, or freezes it.
#[track_caller]
fn assert_frozen(name: &str, found: &str) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("frozen").join(name);
    if std::env::var_os("REGENERATE").is_some() {
        std::fs::write(&file, found).unwrap();
    }
    let frozen = std::fs::read_to_string(file).unwrap_or_default();
    assert_eq!(found, frozen, "changed on purpose? REGENERATE=1 freezes what is found");
}
