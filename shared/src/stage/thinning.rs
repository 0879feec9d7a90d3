//! Thinning: peel the object layer by layer until only its centre lines remain.
//!
//! Paper: section 3.1, thin(A, B) = A - hit-or-miss(A, B); it names no structuring elements. Four rules:
//!
//! | rule | decides | source |
//! |---|---|---|
//! | [`Rule::HitOrMiss`] | the paper's formula with L1, L2 of the Golay alphabet in four turns each | Golay 1969; Serra 1982 |
//! | [`Rule::ZhangSuen`] | two parallel sub-iterations; may erase a component, such as a 2x2 block | Zhang, Suen 1984 |
//! | [`Rule::GuoHall`] | two parallel sub-iterations | Guo, Hall 1989 |
//! | [`Rule::EdtOrdered`] | one pixel after the other, outermost first, between anchors on the ridge of the distance | Pudney 1998, with our anchors |
//!
//! | | |
//! |---|---|
//! | in, out | a [`Bitmap`], changed in place; outside is clear |
//! | scratch | the parallel rules: [`scratch_words`]; EDT-ordered: [`scratch_order`] entries and the distances |
//! | cost | parallel: words x layers; EDT-ordered: pixels, and a few times what is left after the first sweep |
//!
//! All but Zhang-Suen keep the number of components and of holes, so that no component is emptied: an
//! isolated pixel is a legal skeleton. Zhang-Suen and Guo-Hall are as published (OpenCV's `ximgproc` gives
//! the same pixels for an image in a clear frame; without one it never thins the image border).
//!
//! Not promised: lines one pixel wide. [`minimal`] gives those, for any rule.

use crate::arena::Arena;
use crate::bitmap::{Bitmap, Plane, SetBits, Size, WORD_BITS, Word, at, neighbours_in_rows};
use crate::limits::{CapacityError, MAX_SIDE};
use crate::pattern::GOLAY_L;
use crate::stage::distance::DISTANCE_PX;

/// Which pixels are deleted, and in which order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rule {
    /// Hit-or-miss with the Golay L alphabet: the paper's formula.
    HitOrMiss,
    /// Zhang and Suen 1984.
    ZhangSuen,
    /// Guo and Hall 1989.
    GuoHall,
    /// In increasing distance to the background, keeping its ridge.
    #[default]
    EdtOrdered,
}

/// What a thinning did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Cycles through all patterns or sub-iterations, or sweeps over the list, with the last, idle one.
    pub cycles: u32,
    /// Pixels deleted.
    pub deleted: u32,
}

/// Words of scratch that the parallel rules need: two rows.
pub const fn scratch_words(size: Size) -> usize {
    2 * size.row_words()
}

/// Entries of scratch that EDT-ordered thinning needs: one per set pixel, one per value of the distance.
pub const fn scratch_order(set_pixels: usize, largest_distance: u16) -> usize {
    set_pixels + largest_distance as usize + 1
}

/// Thin by a rule; `distance` serves [`Rule::EdtOrdered`] alone. The scratch holds [`scratch_order`] entries
/// for that rule, [`scratch_words`] words for the others.
pub fn thin(
    bitmap: &mut Bitmap<'_>,
    rule: Rule,
    distance: &Plane<'_, u16>,
    scratch: Arena<'_>,
) -> Result<Report, CapacityError> {
    match rule {
        Rule::HitOrMiss => {
            cycle(bitmap, scratch, GOLAY_L.len(), |k, here, around| GOLAY_L[k].fits_word(here, around))
        }
        Rule::ZhangSuen => cycle(bitmap, scratch, 2, |k, here, around| here & zhang_suen(k == 0, around)),
        Rule::GuoHall => cycle(bitmap, scratch, 2, |k, here, around| here & guo_hall(k == 0, around)),
        Rule::EdtOrdered => edt_ordered(bitmap, distance, scratch),
    }
}

/// Delete in parallel what step 0 of `steps` finds, then what step 1 finds, and so on; all over again
/// until a whole cycle finds nothing.
fn cycle(
    bitmap: &mut Bitmap<'_>,
    mut scratch: Arena<'_>,
    steps: usize,
    finds: impl Fn(usize, Word, [Word; 8]) -> Word,
) -> Result<Report, CapacityError> {
    let lines = scratch.take(scratch_words(bitmap.size()), "words of scratch")?;
    let Some(bounds) = bitmap.bounds() else { return Ok(Report::default()) };
    let mut report = Report::default();
    loop {
        let mut deleted = 0;
        for step in 0..steps {
            let rows = i32::from(bounds.min.v)..=i32::from(bounds.max.v);
            deleted += delete(bitmap, lines, rows, |here, around| finds(step, here, around));
        }
        report.cycles += 1;
        report.deleted += deleted;
        if deleted == 0 {
            return Ok(report);
        }
    }
}

/// One parallel deletion: all decisions see the bitmap as it was. `lines` keeps the row above and the
/// present one as they were.
fn delete(
    bitmap: &mut Bitmap<'_>,
    lines: &mut [Word],
    rows: impl Iterator<Item = i32>,
    finds: impl Fn(Word, [Word; 8]) -> Word,
) -> u32 {
    let (mut above, mut here) = lines.split_at_mut(lines.len() / 2);
    above.fill(0);
    let mut deleted = 0;
    for v in rows {
        here.copy_from_slice(bitmap.row(v));
        for i in 0..here.len() {
            if here[i] != 0 {
                let found = finds(here[i], neighbours_in_rows(above, here, bitmap.row(v + 1), i));
                bitmap.row_mut(v)[i] &= !found;
                deleted += found.count_ones();
            }
        }
        (above, here) = (here, above);
    }
    deleted
}

/// Bit by bit: whether at least one, and whether at least two of the words are set.
fn one_and_two(words: impl IntoIterator<Item = Word>) -> (Word, Word) {
    words.into_iter().fold((0, 0), |(one, two), word| (one | word, two | one & word))
}

/// 2 to 6 neighbours, one change from clear to set on the way around, and either the south or the east
/// side (of the first sub-iteration; then north or west) open.
fn zhang_suen(first: bool, around: [Word; 8]) -> Word {
    let [n, _, e, _, s, _, w, _] = around;
    let (_, two_set) = one_and_two(around);
    let (_, two_clear) = one_and_two(around.map(|word| !word));
    let (change, changes) = one_and_two((0..8).map(|k| !around[k] & around[(k + 1) % 8]));
    let closed = if first { n & e & s | e & s & w } else { n & e & w | n & s & w };
    two_set & two_clear & change & !changes & !closed
}

/// One 8-connected neighbour group, 2 or 3 neighbours counted in pairs, and the side open.
fn guo_hall(first: bool, around: [Word; 8]) -> Word {
    let [n, ne, e, se, s, sw, w, nw] = around;
    let (group, groups) = one_and_two([!n & (ne | e), !e & (se | s), !s & (sw | w), !w & (nw | n)]);
    let (pairs, shifted) = ([nw | n, ne | e, se | s, sw | w], [n | ne, e | se, s | sw, w | nw]);
    let two = one_and_two(pairs).1 & one_and_two(shifted).1;
    let [all, all_shifted] = [pairs, shifted].map(|p| p[0] & p[1] & p[2] & p[3]);
    let closed = if first { (s | sw | !nw) & w } else { (n | ne | !se) & e };
    group & !groups & two & !(all & all_shifted) & !closed
}

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

/// Anchors lie further from the background than this, 1/16 px: 1.5 px.
const ANCHOR_DISTANCE: u16 = DISTANCE_PX * 3 / 2;

/// Anchors have a slope of the distance below 0.70. A slope of 1 makes 8 columns of 16 units each in the
/// Sobel sums, 128: so gx^2 + gy^2 < (128 * 0.70)^2 = 8028.16, that is, at most 8028.
const ANCHOR_SLOPE: i64 = 128 * 128 * 49 / 100;

/// Marks an anchor in the list of pixels, above 12 bits of row and 12 of column.
const ANCHOR: u32 = 1 << 31;
const COLUMN_BITS: u32 = 12;
const _: () = assert!(MAX_SIDE <= 1 << COLUMN_BITS);

/// Delete simple pixels in the order of (distance, row, column), except anchors, in sweeps until one
/// deletes nothing; then, in one sweep of the same order, all simple pixels but end points.
fn edt_ordered(
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
            let entry = list[k];
            if entry & ANCHOR != 0 || !delete_if(bitmap, entry, |code| SIMPLE[usize::from(code)]) {
                list[kept] = entry;
                kept += 1;
            }
        }
        cycles += 1;
        if kept == left {
            break;
        }
        left = kept;
    }
    let thinned = list[..left].iter().filter(|&&entry| delete_if(bitmap, entry, is_removable)).count();
    Ok(Report { cycles: cycles + 1, deleted: (all - left + thinned) as u32 })
}

fn delete_if(bitmap: &mut Bitmap<'_>, entry: u32, decide: impl Fn(u8) -> bool) -> bool {
    let (u, v) = (entry & ((1 << COLUMN_BITS) - 1), (entry & !ANCHOR) >> COLUMN_BITS);
    let deleted = decide(bitmap.neighbours(u as i32, v as i32));
    if deleted {
        bitmap.put(u as usize, v as usize, false);
    }
    deleted
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
    let pixels = || bitmap.pixels().map(|p| (i32::from(p.u), i32::from(p.v)));
    let largest = pixels().map(|(u, v)| distance.get(u, v)).max().unwrap_or(0);
    let set = bitmap.count();
    let order = scratch.take::<u32>(scratch_order(set, largest), "entries of the thinning order")?;
    let (list, next) = order.split_at_mut(set);
    next.fill(0);
    for (u, v) in pixels() {
        next[usize::from(distance.get(u, v))] += 1;
    }
    let mut start = 0;
    for entry in next.iter_mut() {
        start += core::mem::replace(entry, start);
    }
    for (u, v) in pixels() {
        let place = &mut next[usize::from(distance.get(u, v))];
        let mark = if is_anchor(distance, u, v) { ANCHOR } else { 0 };
        list[*place as usize] = mark | (v as u32) << COLUMN_BITS | u as u32;
        *place += 1;
    }
    Ok(list)
}

fn is_anchor(distance: &Plane<'_, u16>, u: i32, v: i32) -> bool {
    if distance.get(u, v) <= ANCHOR_DISTANCE {
        return false;
    }
    let d = |du, dv| i64::from(distance.get(u + du, v + dv));
    let gx = d(1, -1) + 2 * d(1, 0) + d(1, 1) - d(-1, -1) - 2 * d(-1, 0) - d(-1, 1);
    let gy = d(-1, 1) + 2 * d(0, 1) + d(1, 1) - d(-1, -1) - 2 * d(0, -1) - d(1, -1);
    gx * gx + gy * gy <= ANCHOR_SLOPE
}

/// Delete, in one sweep in raster order, the simple pixels with two or more neighbours: what remains of a
/// skeleton is one pixel wide. Returns how many went.
pub fn minimal(bitmap: &mut Bitmap<'_>) -> u32 {
    let size = bitmap.size();
    let mut deleted = 0;
    for v in 0..size.height {
        for i in 0..size.row_words() {
            for b in SetBits(at(bitmap.row(v as i32), i)) {
                let u = i * WORD_BITS + b;
                if is_removable(bitmap.neighbours(u as i32, v as i32)) {
                    bitmap.put(u, v, false);
                    deleted += 1;
                }
            }
        }
    }
    deleted
}
