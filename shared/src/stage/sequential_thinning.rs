//! Thinning pixel by pixel: each deletion sees the ones before it, so that components and holes stay whatever
//! the order. [`thin`] goes from the outside in, [`minimal`] leaves lines one pixel wide.
//!
//! Source: Pudney 1998 deletes in the order of the distance to the background; between anchors on the ridge of
//! that distance, which are ours.
//!
//! | | |
//! |---|---|
//! | in, out | a [`Bitmap`], changed in place; outside is clear |
//! | scratch | [`scratch_order`] entries |
//! | cost | a counting sort of the object's pixels, one look at each, and a few at each that the first sweep leaves; [`minimal`]: words, and one look a set pixel |

use crate::arena::Arena;
use crate::bitmap::{Bitmap, Plane, SetBits, WORD_BITS, at};
use crate::limits::{CapacityError, MAX_SIDE};
use crate::stage::distance::{DISTANCE_PX, Runs};
use crate::stage::parallel_thinning::Report;
use core::ops::Range;

/// Whether a pixel with these neighbours is simple: deleting it changes neither the 8-connected
/// components of the object nor the 4-connected ones of the background. That is so when its crossing
/// number (Yokoi 1975; Hilditch 1969) is 1: going around, there is one open edge neighbour after which
/// the object begins.
pub const SIMPLE: [bool; 256] = {
    let mut table = [false; 256];
    let mut code = 0;
    while code < 256 {
        let (mut crossings, mut k) = (0, 0);
        while k < 8 {
            let from_here = (code as u8).rotate_right(k);
            if from_here & 0b001 == 0 && from_here & 0b110 != 0 {
                crossings += 1;
            }
            k += 2;
        }
        table[code] = crossings == 1;
        code += 1;
    }
    table
};

/// Entries of scratch that [`thin`] needs: one per set pixel, one per value of their distance.
pub const fn scratch_order(set_pixels: usize, largest_distance: u16) -> usize {
    set_pixels + largest_distance as usize + 1
}

/// Anchors lie further from the background than this, 1/16 px: 1.5 px.
const ANCHOR_DISTANCE: u16 = DISTANCE_PX * 3 / 2;

/// Anchors have a slope of the distance below 0.70. A slope of 1 makes 8 columns of 16 units each in the
/// Sobel sums, 128: so gx^2 + gy^2 < (128 * 0.70)^2 = 8028.16, that is, at most 8028.
const ANCHOR_SLOPE: u32 = 128 * 128 * 49 / 100;
/// Above the root of that: a slope that is too large whatever the other one is.
const STEEP: u32 = 90;
const _: () = assert!(STEEP * STEEP > ANCHOR_SLOPE);

/// Marks an anchor in the list of pixels, above the pixel's place in the bitmap.
const ANCHOR: u32 = 1 << 31;
const _: () = assert!(MAX_SIDE.next_multiple_of(WORD_BITS) * MAX_SIDE <= ANCHOR as usize);

/// Delete simple pixels in the order of (distance, row, column), except anchors, in sweeps until one
/// deletes nothing; then, in one sweep of the same order, all simple pixels but end points.
///
/// # Errors
/// A [`CapacityError`] when there is less scratch than [`scratch_order`].
pub fn thin(
    bitmap: &mut Bitmap<'_>,
    distance: &Plane<'_, u16>,
    scratch: Arena<'_>,
) -> Result<Report, CapacityError> {
    let list = sort_by_distance(bitmap, distance, scratch)?;
    let all = list.len();
    let (mut left, mut cycles) = (all, 0);
    loop {
        let mut kept = 0;
        for k in 0..left {
            let Some(&entry) = list.get(k) else { break };
            if entry & ANCHOR != 0 || !delete_if(bitmap, entry, |code| SIMPLE[usize::from(code)]) {
                if let Some(place) = list.get_mut(kept) {
                    *place = entry;
                }
                kept += 1;
            }
        }
        cycles += 1;
        if kept == left {
            break;
        }
        left = kept;
    }
    let kept = list.get(..left).unwrap_or_default();
    let thinned = kept.iter().filter(|&&entry| delete_if(bitmap, entry, is_removable)).count();
    Ok(Report { cycles: cycles + 1, deleted: (all - left + thinned) as u32 })
}

fn delete_if(bitmap: &mut Bitmap<'_>, entry: u32, decide: impl Fn(u8) -> bool) -> bool {
    bitmap.clear_if((entry & !ANCHOR) as usize, decide)
}

/// Simple, and not an end point.
fn is_removable(neighbours: u8) -> bool {
    SIMPLE[usize::from(neighbours)] && neighbours.count_ones() >= 2
}

/// Counting sort of the set pixels by distance, raster order among equals; counts behind the list.
fn sort_by_distance<'o>(
    bitmap: &Bitmap<'_>,
    distance: &Plane<'_, u16>,
    mut scratch: Arena<'o>,
) -> Result<&'o mut [u32], CapacityError> {
    let values = |(v, run): (usize, Range<usize>)| within(distance.row(v), run);
    let greatest = |values: &[u16]| values.iter().copied().fold(0, u16::max);
    let largest = object_runs(bitmap).map(values).map(greatest).max().unwrap_or(0);
    let set = bitmap.count();
    let order = scratch.take::<u32>(scratch_order(set, largest), "entries of the thinning order")?;
    debug_assert!(set <= order.len());
    let (list, next) = order.split_at_mut_checked(set).unwrap_or_default();
    next.fill(0);
    for (v, run) in object_runs(bitmap) {
        let (all, values) = (run.len(), values((v, run)));
        let mut count = |value: u16, pixels: usize| {
            if let Some(entry) = next.get_mut(usize::from(value)) {
                *entry += pixels as u32;
            }
        };
        values.iter().for_each(|d| count(*d, 1));
        count(0, all - values.len());
    }
    // Pixels in all: at most 2^24.
    let mut start = 0;
    for entry in next.iter_mut() {
        start += core::mem::replace(entry, start);
    }
    for (v, run) in object_runs(bitmap) {
        let rows = [v.wrapping_sub(1), v, v + 1].map(|v| distance.row(v));
        let mut west = Column::of(rows, run.start.wrapping_sub(1));
        let mut here = Column::of(rows, run.start);
        for u in run {
            let east = Column::of(rows, u + 1);
            let mark = if here.middle > ANCHOR_DISTANCE && is_flat(&west, &here, &east) { ANCHOR } else { 0 };
            if let Some(place) = next.get_mut(usize::from(here.middle))
                && let Some(entry) = list.get_mut(*place as usize)
            {
                *entry = mark | bitmap.place(u, v) as u32;
                *place += 1;
            }
            (west, here) = (here, east);
        }
    }
    Ok(list)
}

/// The runs of set pixels in raster order, each with its row.
fn object_runs<'b>(bitmap: &'b Bitmap<'_>) -> impl Iterator<Item = (usize, Range<usize>)> + 'b {
    let rows = 0..bitmap.size().height;
    rows.flat_map(|v| Runs::of(bitmap.row(v as i32)).map(move |run| (v, run)))
}

/// The part of a run that a row of distances has; what is beyond counts as 0.
fn within(row: &[u16], run: Range<usize>) -> &[u16] {
    row.get(run.start..run.end.min(row.len())).unwrap_or_default()
}

/// The distance in a column of a row; 0 outside.
fn value(row: &[u16], u: usize) -> u16 {
    row.get(u).copied().unwrap_or(0)
}

/// Three distances, one above the other, as Sobel's sums take them.
struct Column {
    middle: u16,
    /// The upper one, twice the middle one and the lower one.
    sum: i32,
    /// The lower one less the upper one.
    drop: i32,
}

impl Column {
    fn of([above, here, below]: [&[u16]; 3], u: usize) -> Self {
        let (upper, middle, lower) = (value(above, u), value(here, u), value(below, u));
        let (n, c, s) = (i32::from(upper), i32::from(middle), i32::from(lower));
        Self { middle, sum: n + 2 * c + s, drop: s - n }
    }
}

/// Whether the distance has hardly a slope in the middle one of three columns.
fn is_flat(west: &Column, here: &Column, east: &Column) -> bool {
    let gx = (east.sum - west.sum).unsigned_abs();
    let gy = (west.drop + 2 * here.drop + east.drop).unsigned_abs();
    gx < STEEP && gy < STEEP && gx * gx + gy * gy <= ANCHOR_SLOPE
}

/// Delete, in one sweep in raster order, the simple pixels with two or more neighbours: what remains of a
/// skeleton is one pixel wide. Returns how many went.
pub fn minimal(bitmap: &mut Bitmap<'_>) -> u32 {
    let size = bitmap.size();
    let mut deleted = 0;
    for v in 0..size.height {
        for i in 0..size.row_words() {
            // No later pixel of the word is deleted before its turn.
            for u in SetBits(at(bitmap.row(v as i32), i)).map(|bit| i * WORD_BITS + bit) {
                deleted += u32::from(bitmap.clear_if(bitmap.place(u, v), is_removable));
            }
        }
    }
    deleted
}
