//! Kernels on pixels: from the picture to the mask, and what a mask says at once.

use super::{Entry, Kernel, Scope, shown, step};
use crate::images::{Image, grey};
use shared::arena::Arena;
use shared::bitmap::{Bitmap, Size, Word};
use shared::limits::MAX_SIDE;
use shared::pack::unpack;
use shared::pipeline::Kernels;
use shared::point::PixelPoint;
use shared::stage::binarise::{self, Threshold, Tone};
use shared::stage::boundary::{Element, boundary};
use shared::stage::clean;
use shared::stage::distance::{Parabola, distance, scratch_parabolas, squared_distances};
use shared::stage::hull::{bitmap_extents, convex_hull};

pub(super) fn entries() -> Vec<Entry> {
    let entry = |name, setup: fn(&Image) -> Box<dyn Kernel>| Entry::new(name, Scope::Kernel, setup);
    vec![
        entry("median", median),
        entry("histogram", histogram),
        entry("pack", pack),
        entry("otsu_binarise", otsu_binarise),
        entry("clean", clean),
        entry("boundary", edge),
        entry("hull", hull),
        entry("distance", plane),
        entry("squared_distance", squares),
    ]
}

/// A bitmap's pixels as bytes.
fn bytes(size: Size, words: &[Word]) -> Vec<u8> {
    let mut bytes = vec![0; size.pixels()];
    unpack(&Bitmap::over(size, &mut words.to_vec()).unwrap(), &mut bytes).unwrap();
    bytes
}

fn median(image: &Image) -> Box<dyn Kernel> {
    let picture = image.pair[0].clone();
    let filtered = vec![0; image.size().pixels()];
    step(
        filtered,
        move |filtered| {
            binarise::median(grey(&picture), filtered, Kernels::PORTABLE.median_row).unwrap();
        },
        Vec::clone,
    )
}

fn histogram(image: &Image) -> Box<dyn Kernel> {
    let picture = image.pair[0].clone();
    step([0; 256], move |counts| *counts = binarise::histogram(grey(&picture)), |counts| shown(counts))
}

fn pack(image: &Image) -> Box<dyn Kernel> {
    let (size, picture) = (image.size(), image.pair[0].clone());
    step(
        vec![0; size.words()],
        move |words| {
            binarise::binarise(grey(&picture), 127, Tone::Bright, words).unwrap();
        },
        move |words| bytes(size, words),
    )
}

/// From the picture to bits by Otsu's level.
fn otsu_binarise(image: &Image) -> Box<dyn Kernel> {
    let (size, picture) = (image.size(), image.pair[0].clone());
    step(
        vec![0; size.words()],
        move |words| {
            let level = Threshold::Otsu.level(&binarise::histogram(grey(&picture)));
            binarise::binarise(grey(&picture), level, Tone::Bright, words).unwrap();
        },
        move |words| bytes(size, words),
    )
}

/// From the bits of the unfiltered picture to those of its largest object without small holes.
fn clean(image: &Image) -> Box<dyn Kernel> {
    let size = image.size();
    let mut dirty = vec![0; size.words()];
    let level = Threshold::Otsu.level(&binarise::histogram(grey(&image.pair[0])));
    binarise::binarise(grey(&image.pair[0]), level, Tone::Bright, &mut dirty).unwrap();
    let scratch = vec![0; clean::scratch_words(size)];
    step(
        (vec![0; size.words()], scratch),
        move |(words, scratch)| {
            words.copy_from_slice(&dirty);
            let mut mask = Bitmap::over(size, words).unwrap();
            clean::keep_largest(&mut mask, Arena::new(scratch)).unwrap();
            clean::fill_holes(&mut mask, clean::HOLE_AREA, Arena::new(scratch)).unwrap();
        },
        move |(words, _)| bytes(size, words),
    )
}

fn edge(image: &Image) -> Box<dyn Kernel> {
    let size = image.size();
    step(
        (image.mask.clone(), vec![0; size.words()]),
        move |(mask, words)| {
            boundary(&Bitmap::over(size, mask).unwrap(), Element::Square, words).unwrap();
        },
        move |(_, words)| bytes(size, words),
    )
}

fn hull(image: &Image) -> Box<dyn Kernel> {
    const VERTICES: usize = 2 * MAX_SIDE;
    let size = image.size();
    let vertices: Box<heapless::Vec<PixelPoint, VERTICES>> = Box::default();
    step(
        (image.mask.clone(), vertices),
        move |(mask, vertices)| {
            convex_hull(bitmap_extents(&Bitmap::over(size, mask).unwrap()), &mut **vertices).unwrap();
        },
        |(_, vertices)| vertices.iter().flat_map(|p| [p.u, p.v]).flat_map(i32::to_le_bytes).collect(),
    )
}

fn plane(image: &Image) -> Box<dyn Kernel> {
    let size = image.size();
    let parabolas = vec![Parabola::NONE; scratch_parabolas(size.width)];
    step(
        (image.mask.clone(), vec![0; size.pixels()], parabolas),
        move |(mask, plane, parabolas)| {
            distance(&Bitmap::over(size, mask).unwrap(), plane, parabolas).unwrap();
        },
        |(_, plane, _)| plane.iter().flat_map(|d: &u16| d.to_le_bytes()).collect(),
    )
}

fn squares(image: &Image) -> Box<dyn Kernel> {
    let size = image.size();
    let parabolas = vec![Parabola::NONE; scratch_parabolas(size.width)];
    let (columns, row) = (vec![0; size.pixels()], vec![0; size.width]);
    step(
        (image.mask.clone(), vec![0; size.pixels()]),
        {
            let mut scratch = (columns, parabolas, row);
            move |(mask, all): &mut (Vec<Word>, Vec<u32>)| {
                let (columns, parabolas, row) = &mut scratch;
                let mask = Bitmap::over(size, mask).unwrap();
                squared_distances(&mask, columns, parabolas, row, |v, row| {
                    all[v * size.width..(v + 1) * size.width].copy_from_slice(row);
                })
                .unwrap();
            }
        },
        |(_, all)| all.iter().flat_map(|d| d.to_le_bytes()).collect(),
    )
}
