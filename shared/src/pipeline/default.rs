//! The default way to match two views: hulls cut at equal heights, rows, depth from contour contacts.

use super::eye::{add_branch, each_branch, fit_curves};
use super::finding::{Gates, MAX_RESIDUAL, MIN_DISPARITY, UNMATCHED_WARNS};
use super::{EyeMemory, Finding, Memory, Observer, Product, Settings, Side};
use crate::arena::Arena;
use crate::bitmap::Size;
use crate::fixed::{ONE, PX, UNIT, div_round};
use crate::limits::CapacityError;
use crate::point::PixelPoint;
use crate::stage::branch::{Balls, trace_branch};
use crate::stage::contour::{ContourPoint, frontier};
use crate::stage::correspond::match_cuts;
use crate::stage::depth::{Optics, ball_depths};
use crate::stage::hull::{RowExtent, convex_hull};
use crate::stage::medial::medial_balls;
use crate::stage::plane::{ImagePlane, Observation};
use crate::stage::rows::{RowCrossing, Rows, count_crossings, match_rows, row_crossings};

/// The default way from two contours to the depth of every ball and curve.
pub(super) fn match_views(
    memory: &mut Memory<'_>,
    size: Size,
    settings: &Settings,
    gates: &mut Gates,
    observer: &mut impl Observer,
) -> Result<(), Finding> {
    let [left, right] = &mut memory.eyes;
    let offset = gates.outcome.vertical_offset;
    let mut scratch = Arena::new(memory.scratch);
    let mut passing = scratch.fork();
    let mut see = |eye: &mut EyeMemory<'_>, side, offset| {
        let first = passing.take(size.height + 1, "ends of rows")?;
        let crossings =
            passing.take(count_crossings(eye.contour, eye.loops, offset, size.height), "row crossings")?;
        let rows = row_crossings(eye.contour, eye.loops, offset, first, crossings);
        convex_hull(contour_extents(eye.contour, rows, offset), eye.hull)?;
        observer.saw(Some(side), Product::Hull(eye.hull));
        Ok::<_, CapacityError>(rows)
    };
    let left_rows = see(left, Side::Left, 0)?;
    let right_rows = see(right, Side::Right, offset)?;

    let plane = seed((left.hull, right.hull), (left_rows, right_rows), size.width, gates, observer)?;
    let least = left.hull.iter().map(|p| plane.at(*p)).min().unwrap_or(plane.level);
    let disparity = least.saturating_add(settings.optics.disparity_offset);
    if disparity < MIN_DISPARITY {
        gates.meet(Finding::SwappedEyes(disparity))?;
    }
    let statistics = match_rows(
        (left.contour, left.loops),
        right.contour,
        (left_rows, right_rows),
        &plane,
        memory.matches,
        passing,
    )?;
    gates.outcome.rows = statistics;
    observer.saw(None, Product::Rows(memory.matches, statistics));
    let share =
        div_round(i64::from(statistics.unmatched) * i64::from(ONE), i64::from(statistics.crossings)) as i32;
    if share > UNMATCHED_WARNS {
        gates.meet(Finding::Unmatched(share))?;
    }

    lift_balls(memory, settings.optics, observer)?;
    let [left, _] = &mut memory.eyes;
    left.samples.clear();
    left.branches.clear();
    let mut scratch = Arena::new(memory.scratch);
    let balls = Balls::new(memory.balls, memory.depths, &mut scratch)?;
    each_branch(&left.graph, |path, free, nodes, closed| {
        let start = left.samples.len();
        trace_branch(path, free, &balls, left.samples)?;
        add_branch(left.branches, left.samples, start, nodes, closed)
    })?;
    fit_curves(left, Arena::new(memory.scratch), &settings.curves)?;
    observer.saw(None, Product::Curves(left.branches, left.controls));
    Ok(())
}

/// The left view's medial balls and their depths.
pub(super) fn lift_balls(
    memory: &mut Memory<'_>,
    optics: Optics,
    observer: &mut impl Observer,
) -> Result<(), CapacityError> {
    let contour = &*memory.eyes[0].contour;
    medial_balls(contour, Arena::new(memory.scratch), memory.balls)?;
    ball_depths(memory.balls, contour, memory.matches, optics, memory.depths)?;
    observer.saw(None, Product::Balls(memory.balls, memory.depths));
    Ok(())
}

/// The contour's extents in every row that it crosses, and its highest and lowest points.
fn contour_extents(points: &[ContourPoint], rows: Rows<'_>, offset: i32) -> impl Iterator<Item = RowExtent> {
    let single = |p: ContourPoint| RowExtent { v: p.at.v - offset, left: p.at.u, right: p.at.u };
    let ends = frontier(points).map(|(top, bottom)| (single(top), single(bottom)));
    let across = (0..rows.len()).filter_map(move |v| {
        let row = rows.row(v);
        Some(RowExtent { v: v as i32 * PX, left: row.first()?.u, right: row.last()?.u })
    });
    // A frontier point exactly on a row is in that row's extent already.
    let between = move |e: &RowExtent| ends.is_some_and(|(top, bottom)| e.v > top.v && e.v < bottom.v);
    ends.map(|e| e.0).into_iter().chain(across.filter(between)).chain(ends.map(|e| e.1))
}

/// The disparity plane from the matched hulls, or from the rows' extents where a hull cannot be cut.
fn seed(
    (left, right): (&[PixelPoint], &[PixelPoint]),
    (left_rows, right_rows): (Rows<'_>, Rows<'_>),
    width: usize,
    gates: &mut Gates,
    observer: &mut impl Observer,
) -> Result<ImagePlane, Finding> {
    let cuts = if left.len() < 4 || right.len() < 4 { None } else { match_cuts(left, right) };
    let plane = if let Some(cuts) = &cuts {
        observer.saw(None, Product::Cuts(cuts));
        // Where the image ends, neither hull says anything of the object.
        let inside = |p: PixelPoint| (0..(width as i32 - 1) * PX).contains(&p.u);
        let whole = |&(a, b): &(PixelPoint, PixelPoint)| inside(a) && inside(b);
        let pairs = cuts.left.into_iter().zip(cuts.right).filter(whole);
        let cut_off = pairs.clone().count() < cuts.left.len();
        let contradicted = !cut_off && cuts.shift != 0;
        if cuts.least != 0 && cuts.shift == 0 {
            gates.meet(Finding::Ambiguous(cuts.least))?;
        }
        let seen = pairs.map(|(a, b)| observation(a, b.u));
        let plane = ImagePlane::fit(seen.clone());
        let off = |o: Observation| plane.map_or(0, |p| i64::from((o.value - p.at(o.at)).abs()));
        let residual = div_round(seen.clone().map(off).sum(), seen.count() as i64) as i32;
        let allowed = (i64::from(mean_side(&cuts.left)) * i64::from(MAX_RESIDUAL)) >> 16;
        if contradicted || i64::from(residual) > allowed.max(i64::from(PX)) {
            gates.meet(Finding::NotAffine(residual))?;
        }
        plane
    } else {
        gates.meet(Finding::FlatHull)?;
        ImagePlane::fit((0..left_rows.len()).flat_map(move |v| {
            let (a, b) = (left_rows.row(v), right_rows.row(v));
            let pair = |a: Option<&RowCrossing>, b: Option<&RowCrossing>| {
                Some(observation(PixelPoint { u: a?.u, v: v as i32 * PX }, b?.u))
            };
            [pair(a.first(), b.first()), pair(a.last(), b.last())].into_iter().flatten()
        }))
    };
    gates.outcome.cuts = cuts;
    let plane = plane.ok_or(Finding::NoMap)?;
    gates.outcome.plane = plane;
    Ok(plane)
}

/// Mean of width and height of the points' box, 1/256 px.
fn mean_side(points: &[PixelPoint]) -> i32 {
    let span = |of: fn(&PixelPoint) -> i32| {
        points.iter().map(of).max().unwrap_or(0) - points.iter().map(of).min().unwrap_or(0)
    };
    (span(|p| p.u) + span(|p| p.v)) / 2
}

/// The disparity that a point would have if it were the right view's at column `u`.
const fn observation(at: PixelPoint, u: i32) -> Observation {
    Observation { at, value: at.u - u, weight: UNIT }
}
