//! Row matching: which edge in the right view is which in the left, and so the disparity of every
//! contour point.
//!
//! The paper (section 4.1.3) lets boundary points inside matched hulls correspond; in a rectified pair
//! they can only do so along a row.
//!
//! * **In**: both contours and the disparity plane that the hulls gave.
//! * **Out**: for each point of the left contour its disparity, how well it is known, and the right
//!   view's normal at the same place of the object.
//! * **How**: in each row a dynamic programme aligns the crossings of both contours in order, pairing
//!   only edges of the same polarity, at the cost of their distance from the plane (Ohta and Kanade 1985,
//!   here with silhouette edges). What differs from its neighbours along the contour by more than 1.5 px
//!   is dropped, the rest is averaged over a few pixels of arc and interpolated in between.
//! * **Cost**: linear in the contour's length; quadratic in the crossings of one row, at most
//!   [`ROW_CROSSINGS`].
//! * **Not promised**: disparity where the contour runs along the rows; `weight` is then near 0.

use crate::arena::{Arena, List};
use crate::fixed::{PX, UNIT, div_round};
use crate::limits::{CapacityError, ROW_CROSSINGS, push};
use crate::point::{Direction, PixelPoint};
use crate::stage::contour::{ContourLoop, ContourPoint};
use crate::stage::plane::ImagePlane;
use bytemuck::{Pod, Zeroable};
use core::mem::swap;
use core::num::NonZeroUsize;
use heapless::VecView;

/// Where a contour crosses the middle of a row.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct RowCrossing {
    /// Column, 1/256 px.
    pub u: i32,
    /// The contour point before the crossing.
    pub index: u32,
    /// Row.
    pub v: u16,
    /// Which way the contour runs: 1 downwards, the object to its left, -1 upwards.
    pub heading: i16,
}

/// What the right view says about a point of the left contour.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ContourMatch {
    /// u_left - u_right, 1/256 px.
    pub disparity: i32,
    /// n_x^2 of the right normal, in 1/16384: how far the edge stands across the row; 0 on the image's
    /// border and on loops of which nothing was matched.
    pub weight: u16,
    /// Normal of the right contour at the corresponding point.
    pub normal_right: Direction,
}

/// The weight of a match away from the image's border, given its right normal.
pub(crate) const fn weight_across(normal_right: Direction) -> u16 {
    let across = normal_right.u as i32;
    ((across * across) >> 14) as u16
}

/// A match that the rest of its loop is filled from.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Trusted {
    /// Contour point.
    index: u32,
    /// Disparity beyond the plane, 1/256 px.
    excess: i32,
    /// Sine of the turn from the left to the right normal, 1/16384.
    turn: i32,
    /// As in [`ContourMatch`].
    weight: u32,
}

/// How the matching went.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RowStatistics {
    /// Crossings of the left contour with rows, without those on the image's border.
    pub crossings: u32,
    /// Those that found no partner.
    pub unmatched: u32,
}

/// Least cost of leaving a crossing unmatched, 1/256 px; two that lie twice as far apart than the plane
/// says are therefore never paired.
const LEAST_SKIP: i32 = 6 * PX;
/// That cost as a part of the object: how far a limb stands off the plane grows with the picture of it.
const SKIP_SHARE: i32 = 32;
/// Matches with a flatter normal than this say nothing about disparity (|n_x| in 1/16384).
const MIN_NX: i32 = UNIT / 4;
/// A match this far from the running median along the contour is a wrong one, 1/256 px.
const OUTLIER: i32 = PX * 3 / 2;
/// Matches on either side that the running median looks at.
const MEDIAN_REACH: usize = 4;
/// Matches on either side that are averaged.
const AVERAGE_REACH: usize = 3;
/// The normals of corresponding points differ by less than this (sine, 1/16384: 29 degrees).
const MAX_TURN: i32 = UNIT * 48 / 100;

/// How many crossings [`row_crossings`] will find in so many rows.
pub fn count_crossings(points: &[ContourPoint], loops: &[ContourLoop], offset: i32, rows: usize) -> usize {
    let mut count = 0;
    each_crossing(points, loops, offset, rows, |_, _, _| count += 1);
    count
}

/// All crossings of the loops with the rows `v + offset` (1/256 px), ordered by row and column.
///
/// The lent memory: `first` of one entry more than rows, and [`count_crossings`] crossings; those beyond
/// what is lent are left out.
pub fn row_crossings<'a>(
    points: &[ContourPoint],
    loops: &[ContourLoop],
    offset: i32,
    first: &'a mut [u32],
    crossings: &'a mut [RowCrossing],
) -> Rows<'a> {
    first.fill(0);
    let rows = first.len().saturating_sub(1);
    each_crossing(points, loops, offset, rows, |_, _, v| {
        if let Some(count) = first.get_mut(v as usize + 1) {
            *count += 1;
        }
    });
    let mut before = 0;
    for entry in first.iter_mut() {
        before += *entry;
        *entry = before;
    }
    // Counting sort in place: `first` moves to each row's end while its crossings arrive, and back.
    each_crossing(points, loops, offset, rows, |i, [a, b], v| {
        let Some(slot) = first.get_mut(v as usize) else { return };
        if let Some(place) = crossings.get_mut(*slot as usize) {
            // Within a segment: below 2^21 each, as is its width.
            let (run, rise) = (v * PX + offset - a.v, b.v - a.v);
            let u = a.u + div_round(i64::from(b.u - a.u) * i64::from(run), rise.into()) as i32;
            *place = RowCrossing { u, index: i as u32, v: v as u16, heading: rise.signum() as i16 };
        }
        *slot += 1;
    });
    let mut before = 0;
    first.iter_mut().for_each(|entry| swap(entry, &mut before));
    for (from, to) in first.iter().zip(first.iter().skip(1)) {
        if let Some(row) = crossings.get_mut(*from as usize..*to as usize) {
            sort(row);
        }
    }
    Rows { first, crossings }
}

/// Sort crossings by column: Shell's way, which takes no stack, unlike the library's.
fn sort(row: &mut [RowCrossing]) {
    let mut gap = row.len();
    while gap > 1 {
        gap = if gap == 2 { 1 } else { gap * 5 / 11 };
        for end in gap..row.len() {
            let mut high = end;
            while let Some(low) = high.checked_sub(gap)
                && let Some([before, .., after]) = row.get_mut(low..=high)
                && (before.u, before.index) > (after.u, after.index)
            {
                swap(before, after);
                high = low;
            }
        }
    }
}

/// Walk along the loops and report where they cross a row: the number of the point before, it and the next
/// one, and the row.
fn each_crossing(
    points: &[ContourPoint],
    loops: &[ContourLoop],
    offset: i32,
    rows: usize,
    mut report: impl FnMut(usize, [PixelPoint; 2], i32),
) {
    for l in loops {
        let mut segment = |i: usize, a: PixelPoint, b: PixelPoint| {
            let (low, high) = (a.v.min(b.v) - offset, a.v.max(b.v) - offset);
            // The lower end belongs to the segment, the upper one to the next: each row once.
            let from = low.div_euclid(PX) + i32::from(low.rem_euclid(PX) != 0);
            let to = high.div_euclid(PX) + i32::from(high.rem_euclid(PX) != 0);
            for v in from.max(0)..to.min(rows as i32) {
                report(i, [a, b], v);
            }
        };
        let own = points.get(l.range()).unwrap_or_default();
        for (i, ends) in l.range().zip(own.windows(2)) {
            segment(i, ends[0].at, ends[1].at);
        }
        if let (Some(last), Some(first)) = (own.last(), own.first()) {
            segment(l.start + own.len() - 1, last.at, first.at);
        }
    }
}

/// The crossings of one view, row by row.
#[derive(Clone, Copy)]
pub struct Rows<'a> {
    /// Where each row's crossings begin; one entry more than rows.
    pub first: &'a [u32],
    /// All crossings, ordered by row and column.
    pub crossings: &'a [RowCrossing],
}

impl<'a> Rows<'a> {
    /// The crossings of a row that are matched: the first [`ROW_CROSSINGS`].
    fn matched(&self, v: usize) -> &'a [RowCrossing] {
        let row = self.row(v);
        &row[..row.len().min(ROW_CROSSINGS)]
    }

    /// The crossings of a row.
    pub fn row(&self, v: usize) -> &'a [RowCrossing] {
        match (self.first.get(v), self.first.get(v + 1)) {
            (Some(&a), Some(&b)) => self.crossings.get(a as usize..b as usize).unwrap_or(&[]),
            _ => &[],
        }
    }

    /// Number of rows.
    pub const fn len(&self) -> usize {
        self.first.len().saturating_sub(1)
    }

    /// Whether there is no row.
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Match the left contour's points to the right view.
///
/// `matches` gets one entry a left contour point; the scratch holds as many [`Trusted`] as the longest loop.
///
/// # Errors
/// A [`CapacityError`] when `matches` or the scratch is too short.
pub fn match_rows(
    (left_points, left_loops): (&[ContourPoint], &[ContourLoop]),
    right_points: &[ContourPoint],
    (left, right): (Rows<'_>, Rows<'_>),
    plane: &ImagePlane,
    matches: &mut VecView<ContourMatch>,
    mut scratch: Arena<'_>,
) -> Result<RowStatistics, CapacityError> {
    matches.clear();
    for p in left_points {
        let blank = ContourMatch { disparity: plane.at(p.at), weight: 0, normal_right: p.normal };
        push(matches, blank, "contour matches")?;
    }
    let skip = skip_cost(left_points);
    let mut steps = [[Step::SkipRight; ROW_CROSSINGS + 1]; ROW_CROSSINGS + 1];
    let mut statistics = RowStatistics::default();
    let on_border = |points: &[ContourPoint], c: &RowCrossing| {
        points.get(c.index as usize).is_some_and(|point| point.border)
    };
    for v in 0..left.len() {
        let mut known = 0;
        align((left.matched(v), right.matched(v)), plane, skip, &mut steps, |x, y| {
            known += u32::from(!on_border(left_points, x));
            record(x, y, left_points, right_points, matches);
        });
        // Where either image ends, a missing partner says nothing.
        let edges = left.row(v).iter().filter(|c| !on_border(left_points, c)).count() as u32;
        let cut_off = right.row(v).iter().filter(|c| on_border(right_points, c)).count() as u32;
        statistics.crossings += edges;
        statistics.unmatched += (edges - known).saturating_sub(cut_off);
    }
    for l in left_loops {
        let mut trusted = scratch.fork().list("contour matches");
        let points = left_points.get(l.range()).unwrap_or_default();
        let found = matches.get(l.range()).unwrap_or_default();
        for ((i, p), m) in l.range().zip(points).zip(found).filter(|(_, m)| m.weight > 0) {
            let turn = p.normal.cross(m.normal_right).clamp(-MAX_TURN, MAX_TURN);
            // Within 2^16 at the crossing, which is less than 2^11 away along slopes of at most 2^8: below 2^20 + 2^17.
            let excess = m.disparity - plane.at(p.at);
            trusted.push(Trusted { index: i as u32, excess, turn, weight: m.weight.into() })?;
        }
        reject_outliers(&mut trusted);
        fill(left_points, *l, plane, &trusted, matches);
    }
    Ok(statistics)
}

/// Cost of leaving a crossing unmatched, 1/256 px: a part of the mean of the contour's width and height.
fn skip_cost(points: &[ContourPoint]) -> i32 {
    let span = |of: fn(&ContourPoint) -> i32| {
        points.iter().map(of).max().unwrap_or(0) - points.iter().map(of).min().unwrap_or(0)
    };
    // Spans of at most 2^20 each: a cost of at most 2^15.
    ((span(|p| p.at.u) + span(|p| p.at.v)) / (2 * SKIP_SHARE)).max(LEAST_SKIP)
}

/// What the last step of an alignment is.
#[derive(Clone, Copy, PartialEq)]
enum Step {
    Pair,
    SkipLeft,
    SkipRight,
}

/// The last step of the cheapest alignment of so many left with so many right crossings.
type Steps = [[Step; ROW_CROSSINGS + 1]; ROW_CROSSINGS + 1];

/// Align two rows of crossings in order at the least cost, and report the pairs; `skip` is the cost of
/// leaving one out. It takes at most 2^7 of these: sums stay below 2^22, and with a distance from the plane, below
/// 2^30 + 2^23, within an `i32`. What is in `steps` does not matter: clearing it would cost more than a common row.
fn align(
    (a, b): (&[RowCrossing], &[RowCrossing]),
    plane: &ImagePlane,
    skip: i32,
    steps: &mut Steps,
    mut pair: impl FnMut(&RowCrossing, &RowCrossing),
) {
    let mut cost = [0i32; ROW_CROSSINGS + 1];
    for (j, c) in cost.iter_mut().enumerate().take(b.len() + 1) {
        *c = j as i32 * skip;
    }
    for (i, x) in a.iter().enumerate() {
        let expected = x.u - plane.at(PixelPoint { u: x.u, v: i32::from(x.v) * PX });
        let mut diagonal = cost[0];
        cost[0] += skip;
        for (j, y) in b.iter().enumerate() {
            let above = cost[j + 1];
            let (mut best, mut step) = (above + skip, Step::SkipLeft);
            if cost[j] + skip < best {
                (best, step) = (cost[j] + skip, Step::SkipRight);
            }
            // Both could be left out instead, so a pair that is made costs at most 2 skip, 2^16: within that its
            // disparity is the plane's at its place.
            let together = diagonal + (y.u - expected).abs();
            if x.heading == y.heading && together <= best {
                (best, step) = (together, Step::Pair);
            }
            (cost[j + 1], steps[i + 1][j + 1], diagonal) = (best, step, above);
        }
    }
    let (mut i, mut j) = (a.len(), b.len());
    while i > 0 && j > 0 {
        match steps[i][j] {
            Step::Pair => {
                (i, j) = (i - 1, j - 1);
                if let (Some(x), Some(y)) = (a.get(i), b.get(j)) {
                    pair(x, y);
                }
            }
            Step::SkipLeft => i -= 1,
            Step::SkipRight => j -= 1,
        }
    }
}

/// Note a pair of crossings at the nearer point of the left contour.
fn record(
    x: &RowCrossing,
    y: &RowCrossing,
    left: &[ContourPoint],
    right: &[ContourPoint],
    matches: &mut [ContourMatch],
) {
    let (k, l) = (x.index as usize, y.index as usize);
    let (Some(p), Some(q), Some(here)) = (left.get(k), right.get(l), matches.get_mut(k)) else { return };
    let flatter = i32::from(p.normal.u).abs().min(i32::from(q.normal.u).abs());
    let weight = ((flatter * flatter) >> 14) as u16;
    if flatter >= MIN_NX && !p.border && !q.border && weight > here.weight {
        *here = ContourMatch { disparity: x.u - y.u, weight, normal_right: q.normal };
    }
}

/// Clear the weight of matches that differ from the running median along the loop.
fn reject_outliers(trusted: &mut List<'_, Trusted>) {
    let n = trusted.len();
    if let Some(around) = NonZeroUsize::new(n).filter(|_| n > 2 * MEDIAN_REACH) {
        let excess = |trusted: &[Trusted], k: usize| trusted.get(k % around).map_or(0, |t| t.excess);
        // The window around match 0, sorted; with each step one leaves it and one enters.
        let mut window = core::array::from_fn(|w| excess(trusted, n + w - MEDIAN_REACH));
        window.sort_unstable();
        for k in 0..n {
            // Only the weight changes here, so that every median sees the same neighbours.
            if let Some(here) = trusted.get_mut(k)
                && (here.excess - window[MEDIAN_REACH]).abs() > OUTLIER
            {
                here.weight = 0;
            }
            let (leaves, enters) = (k + n - MEDIAN_REACH, k + 1 + MEDIAN_REACH);
            replace(&mut window, excess(trusted, leaves), excess(trusted, enters));
        }
    }
    trusted.retain(|t| t.weight > 0);
}

/// Take a value out of a sorted window that holds it, and put another in.
fn replace(window: &mut [i32; 2 * MEDIAN_REACH + 1], old: i32, new: i32) {
    let mut place = window.iter().position(|w| *w == old).unwrap_or(0);
    if let Some(entry) = window.get_mut(place) {
        *entry = new;
    }
    while let Some([here, next]) = window.get_mut(place..place + 2)
        && next < here
    {
        swap(here, next);
        place += 1;
    }
    while let Some([before, here]) = window.get_mut(place.wrapping_sub(1)..place + 1)
        && here < before
    {
        swap(before, here);
        place -= 1;
    }
}

/// The average of match `k` and its neighbours within a few pixels of arc: (excess, turn).
fn averaged(l: ContourLoop, trusted: &[Trusted], k: usize) -> (i32, i32) {
    let n = trusted.len();
    let (Some(around), Some(here)) = (NonZeroUsize::new(n), trusted.get(k)) else { return (0, 0) };
    let reach = AVERAGE_REACH.min((n - 1) / 2);
    let (mut excess, mut turn, mut total) = (0i64, 0i64, 0i64);
    for w in 0..=2 * reach {
        let Some(t) = trusted.get((k + n + w - reach) % around) else { continue };
        let ahead = l.ahead(here.index as usize, t.index as usize);
        let apart = ahead.min(l.len - ahead);
        // At most 2^14 x 4, times an excess below 2^21; seven of them.
        let weight = i64::from(t.weight) * (AVERAGE_REACH + 1).saturating_sub(apart) as i64;
        excess += weight * i64::from(t.excess);
        turn += weight * i64::from(t.turn);
        total += weight;
    }
    (div_round(excess, total) as i32, div_round(turn, total) as i32)
}

/// Give every point of the loop the averaged excess and turn, linear between trusted matches.
fn fill(
    left: &[ContourPoint],
    l: ContourLoop,
    plane: &ImagePlane,
    trusted: &[Trusted],
    matches: &mut [ContourMatch],
) {
    let Some(last) = trusted.last() else { return };
    let (mut from, mut behind) = (last.index as usize, averaged(l, trusted, trusted.len() - 1));
    for (k, t) in trusted.iter().enumerate() {
        let ahead = averaged(l, trusted, k);
        // One trusted match alone: once around the loop back to itself.
        let gap = match l.ahead(from, t.index as usize) {
            0 => l.len,
            gap => gap,
        };
        for s in 1..=gap {
            let i = l.step(from, s as isize);
            // A difference below 2^22, by a gap of at most 2^28 points.
            let mix = |a: i32, b: i32| a + div_round(i64::from(b - a) * s as i64, gap as i64) as i32;
            let (Some(here), Some(point)) = (matches.get_mut(i), left.get(i)) else { continue };
            here.disparity = plane.at(point.at) + mix(behind.0, ahead.0);
            here.normal_right = point.normal.turned(mix(behind.1, ahead.1));
            here.weight = if point.border { 0 } else { weight_across(here.normal_right) };
        }
        (from, behind) = (t.index as usize, ahead);
    }
}
