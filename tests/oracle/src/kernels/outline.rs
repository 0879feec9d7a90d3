//! Kernels on contours: each finds what the core has left in its memory before it.

use super::{Entry, Kernel, Scope, shown, step};
use crate::images::{Image, grey};
use host::memory::Storage;
use shared::arena::Arena;
use shared::bitmap::Bitmap;
use shared::pipeline::{Memory, Outcome, Settings, run};
use shared::stage::contour::contour;
use shared::stage::correspond::match_cuts;
use shared::stage::depth::ball_depths;
use shared::stage::medial::medial_balls;
use shared::stage::nurbs::{FitParams, fit};
use shared::stage::rows::{Rows, count_crossings, match_rows, row_crossings};

pub(super) fn entries() -> Vec<Entry> {
    let entry = |name, setup: fn(&Image) -> Box<dyn Kernel>| Entry::new(name, Scope::Kernel, setup);
    vec![
        entry("contour", edges),
        entry("cuts", cuts),
        entry("rows", rows),
        entry("medial_balls", balls),
        entry("nurbs", curves),
    ]
}

/// The core's memory after a run, and what it says.
fn described(image: &Image) -> (Storage, Outcome) {
    let size = image.size();
    let mut storage = Storage::new(size.width, size.height).unwrap();
    let [left, right] = image.pair.each_ref().map(grey);
    let outcome = run(&mut storage.lend(), left, right, &Settings::new(image.optics), &mut ());
    (storage, outcome.unwrap_or_else(|finding| panic!("{}: {finding:?}", image.name)))
}

/// A kernel on that memory.
fn on(
    image: &Image,
    run: impl Fn(&mut Memory<'_>, &Outcome) + 'static,
    made: impl Fn(&Memory<'_>) -> Vec<u8> + 'static,
) -> Box<dyn Kernel> {
    let (storage, outcome) = described(image);
    let storage = std::cell::RefCell::new(storage);
    step(
        storage,
        move |storage| run(&mut storage.get_mut().lend(), &outcome),
        move |storage| made(&storage.borrow_mut().lend()),
    )
}

fn edges(image: &Image) -> Box<dyn Kernel> {
    let (size, picture) = (image.size(), image.pair[0].clone());
    on(
        image,
        move |memory, _| {
            let [eye, _] = &mut memory.eyes;
            let mask = Bitmap::over(size, eye.mask).unwrap();
            let scratch = Arena::new(memory.scratch);
            contour(Some(grey(&picture)), &mask, scratch, eye.contour, eye.loops).unwrap();
        },
        |memory| shown(&memory.eyes[0].contour),
    )
}

fn cuts(image: &Image) -> Box<dyn Kernel> {
    let ([left, right], _) = {
        let (mut storage, outcome) = described(image);
        (storage.lend().eyes.each_ref().map(|eye| eye.hull.to_vec()), outcome)
    };
    step(None, move |cuts| *cuts = match_cuts(&left, &right), |cuts| shown(cuts))
}

/// From both contours to the partner of each left point.
fn rows(image: &Image) -> Box<dyn Kernel> {
    let height = image.size().height;
    on(
        image,
        move |memory, outcome| {
            let [left, right] = &memory.eyes;
            let mut scratch = Arena::new(memory.scratch);
            let [left_rows, right_rows]: [Rows<'_>; 2] =
                [(left, 0), (right, outcome.vertical_offset)].map(|(eye, offset)| {
                    let count = count_crossings(eye.contour, eye.loops, offset, height);
                    let first = scratch.take(height + 1, "ends of rows").unwrap();
                    let crossings = scratch.take(count, "row crossings").unwrap();
                    row_crossings(eye.contour, eye.loops, offset, first, crossings)
                });
            match_rows(
                (left.contour, left.loops),
                right.contour,
                (left_rows, right_rows),
                &outcome.plane,
                memory.matches,
                scratch,
            )
            .unwrap();
        },
        |memory| shown(&memory.matches),
    )
}

/// From the left contour and its partners to balls and their depths.
fn balls(image: &Image) -> Box<dyn Kernel> {
    let optics = image.optics;
    on(
        image,
        move |memory, _| {
            let contour = &*memory.eyes[0].contour;
            medial_balls(contour, Arena::new(memory.scratch), memory.balls).unwrap();
            ball_depths(memory.balls, contour, memory.matches, optics, memory.depths).unwrap();
        },
        |memory| shown(&memory.depths),
    )
}

/// From the samples of the left eye's branches to their curves.
fn curves(image: &Image) -> Box<dyn Kernel> {
    on(
        image,
        |memory, _| {
            let [eye, _] = &mut memory.eyes;
            let mut scratch = Arena::new(memory.scratch);
            eye.controls.clear();
            for branch in eye.branches.iter() {
                let samples = &eye.samples[branch.samples..branch.samples + branch.sample_count];
                fit(samples, branch.closed, &FitParams::default(), scratch.fork(), eye.controls).unwrap();
            }
        },
        |memory| shown(&memory.eyes[0].controls),
    )
}
