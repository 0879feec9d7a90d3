//! The paper's way to match two views: an affine map from the hulls' own vertices, then nearest points.

use super::finding::Gates;
use super::{Finding, Memory, Observer, Product, Side};
use crate::arena::Arena;
use crate::bitmap::{Bitmap, Size, Word};
use crate::point::{Pixel, PixelPoint};
use crate::stage::boundary::{Element, boundary};
use crate::stage::branch::Sample;
use crate::stage::correspond::{PaperMatching, match_vertices};
use crate::stage::hull::{bitmap_extents, convex_hull};
use crate::stage::nearest::pair_nearest;

/// The paper's reduced hulls have at most this many vertices: n^3 triples are looked at.
pub const PAPER_VERTICES: usize = 24;

/// The paper's way: an affine map from the hulls, then the nearest point for boundary and skeleton.
pub(super) fn match_as_paper(
    memory: &mut Memory<'_>,
    size: Size,
    paper: PaperMatching,
    gates: &mut Gates,
    observer: &mut impl Observer,
) -> Result<(), Finding> {
    let [left, right] = &mut memory.eyes;
    for (eye, side) in [(&mut *left, Side::Left), (&mut *right, Side::Right)] {
        let mask = Bitmap::over(size, eye.mask)?;
        convex_hull(bitmap_extents(&mask), eye.hull)?;
        observer.saw(Some(side), Product::Hull(eye.hull));
    }
    let matched = match_vertices(left.hull, right.hull, PAPER_VERTICES, paper).ok_or(Finding::NoMap)?;
    observer.saw(None, Product::Vertices(&matched));
    gates.outcome.vertices = Some(matched);

    let mut scratch = Arena::new(memory.scratch);
    let mut edge = |mask: &mut [Word]| {
        let words = scratch.take(size.words(), "words of scratch")?;
        boundary(&Bitmap::over(size, mask)?, Element::Square, words)
    };
    let boundaries = [edge(left.mask)?, edge(right.mask)?];
    let points = |i: usize| boundaries[i].pixels().map(Pixel::centre);
    pair_nearest(points(0), || points(1), &matched.map, scratch.fork(), memory.boundary_pairs)?;
    pair_nearest(
        centres(left.samples),
        || centres(right.samples),
        &matched.map,
        scratch,
        memory.skeleton_pairs,
    )?;
    observer.saw(None, Product::Pairs(memory.boundary_pairs, memory.skeleton_pairs));
    Ok(())
}

fn centres(samples: &[Sample]) -> impl Iterator<Item = PixelPoint> {
    samples.iter().map(|sample| sample.ball.at())
}
