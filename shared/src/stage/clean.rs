//! One object without specks and pinholes: largest component, small holes, 3x3 closing and opening.
//!
//! Paper: section 3 takes clean blobs for granted; this stage makes them.
//!
//! | | |
//! |---|---|
//! | in, out | a [`Bitmap`], changed in place |
//! | components | of the object 8-connected, of the background 4-connected |
//! | scratch | [`scratch_words`]: two bitmaps of the same size, contents irrelevant; no labels |
//! | bounds | areas below 2^24 + 1 px |
//! | cost | see below; closing and opening four passes over the words each |
//!
//! A component is flooded word by word: fresh pixels wait in the bitmap `front`, a visit takes a word of
//! them, completes its runs by a carry and reaches into the eight words around it. Rows are visited in
//! sweeps, down then up, over the box of words in which fresh pixels wait. A word is visited only after it
//! gained a pixel, so there are at most as many visits as pixels; a sweep further costs a look at each
//! word of its box. A speck therefore costs a handful of words, and only shapes that turn back between
//! up and down many times (spirals, combs) need more than a few sweeps.

use crate::bitmap::{Bitmap, Size, WORD_BITS, Word, at};
use crate::limits::CapacityError;

/// Holes of fewer pixels than this are filled by default, px^2.
pub const HOLE_AREA: u32 = 60;

/// Words of scratch that [`keep_largest`] and [`fill_holes`] need.
pub const fn scratch_words(size: Size) -> usize {
    2 * size.words()
}

/// What [`keep_largest`] found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Components {
    /// Number of 8-connected components.
    pub count: u32,
    /// Area of the largest, px.
    pub largest: u32,
    /// Area of the second largest, px; 0 if there is none.
    pub second: u32,
}

/// Clear everything but the largest 8-connected component; of equals, the first in raster order stays.
pub fn keep_largest(bitmap: &mut Bitmap<'_>, scratch: &mut [Word]) -> Result<Components, CapacityError> {
    let (mut rest, mut front) = split(bitmap.size(), scratch)?;
    rest.copy_from(bitmap);
    let mut found = Components::default();
    let mut seed_of_largest = None;
    for at in places(bitmap.size()) {
        while let Some(seed) = Seed::first(&rest, at) {
            let area = flood(&mut rest, &mut front, seed, Connectivity::Eight);
            found.count += 1;
            if area > found.largest {
                found.second = found.largest;
                found.largest = area;
                seed_of_largest = Some(seed);
            } else {
                found.second = found.second.max(area);
            }
        }
    }
    if let Some(seed) = seed_of_largest.filter(|_| found.count > 1) {
        rest.copy_from(bitmap);
        flood(&mut rest, &mut front, seed, Connectivity::Eight);
        for (word, others) in bitmap.words_mut().iter_mut().zip(rest.words()) {
            *word ^= others;
        }
    }
    Ok(found)
}

/// Set the pixels of every 4-connected hole of fewer than `below` pixels; returns how many holes that
/// were. What is connected to the border of the image is background, not a hole.
pub fn fill_holes(bitmap: &mut Bitmap<'_>, below: u32, scratch: &mut [Word]) -> Result<u32, CapacityError> {
    let size = bitmap.size();
    let (mut rest, mut front) = split(size, scratch)?;
    bitmap.invert();
    rest.copy_from(bitmap);
    flood_from_border(&mut rest, &mut front);
    let mut filled = 0;
    for at in places(size) {
        while let Some(seed) = Seed::first(&rest, at) {
            if flood(&mut rest, &mut front, seed, Connectivity::Four) < below {
                // The inverted bitmap still holds the hole: the same flood takes it out there.
                flood(bitmap, &mut front, seed, Connectivity::Four);
                filled += 1;
            }
        }
    }
    bitmap.invert();
    Ok(filled)
}

/// Closing, then opening, with a 3x3 square: gaps of up to two pixels close, then what is thinner than
/// three pixels goes. Pixels beyond the border take no side, as in OpenCV's `morphologyEx`.
pub fn close_open(bitmap: &mut Bitmap<'_>) {
    dilate(bitmap);
    erode(bitmap);
    erode(bitmap);
    dilate(bitmap);
}

/// Set every pixel that has a set pixel among its eight neighbours.
pub fn dilate(bitmap: &mut Bitmap<'_>) {
    let size = bitmap.size();
    for v in 0..size.height {
        let mut west = 0;
        for i in 0..size.row_words() {
            let valid = bitmap.valid(i);
            let row = bitmap.row_mut(v as i32);
            let word = row[i];
            let spread = word | word << 1 | word >> 1;
            row[i] = (spread | west >> (WORD_BITS - 1) | at(row, i + 1) << (WORD_BITS - 1)) & valid;
            west = word;
        }
    }
    for i in 0..size.row_words() {
        let mut above = 0;
        for v in 0..size.height as i32 {
            let below = at(bitmap.row(v + 1), i);
            let row = bitmap.row_mut(v);
            let word = row[i];
            row[i] |= above | below;
            above = word;
        }
    }
}

/// Clear every pixel that has a clear pixel among its eight neighbours inside the image.
pub fn erode(bitmap: &mut Bitmap<'_>) {
    bitmap.invert();
    dilate(bitmap);
    bitmap.invert();
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Connectivity {
    Four,
    Eight,
}

/// Row and index of a word.
type Place = (i32, usize);

/// A pixel to flood from: a word with one bit set, and its place.
#[derive(Clone, Copy)]
struct Seed {
    place: Place,
    bit: Word,
}

impl Seed {
    fn first(rest: &Bitmap<'_>, place: Place) -> Option<Self> {
        let word = at(rest.row(place.0), place.1);
        (word != 0).then(|| Self { place, bit: word & word.wrapping_neg() })
    }
}

fn places(size: Size) -> impl Iterator<Item = Place> {
    (0..size.height as i32).flat_map(move |v| (0..size.row_words()).map(move |i| (v, i)))
}

fn split(size: Size, scratch: &mut [Word]) -> Result<(Bitmap<'_>, Bitmap<'_>), CapacityError> {
    let limit = scratch.len();
    let halves = scratch.split_at_mut_checked(size.words());
    let (rest, front) = halves.ok_or(CapacityError { what: "words of scratch", limit })?;
    Ok((Bitmap::new(size, rest)?, Bitmap::new(size, front)?))
}

/// The box of words in which fresh pixels wait.
#[derive(Clone, Copy)]
struct Span {
    rows: (i32, i32),
    words: (usize, usize),
}

impl Span {
    const EMPTY: Self = Self { rows: (i32::MAX, i32::MIN), words: (usize::MAX, 0) };

    fn include(&mut self, (v, i): Place) {
        self.rows = (self.rows.0.min(v), self.rows.1.max(v));
        self.words = (self.words.0.min(i), self.words.1.max(i));
    }
}

/// Take the component of `seed` out of `rest`; returns its area. `front` is clear before and after.
fn flood(rest: &mut Bitmap<'_>, front: &mut Bitmap<'_>, seed: Seed, connectivity: Connectivity) -> u32 {
    let mut span = Span::EMPTY;
    let area = reach(rest, front, seed.place, seed.bit, &mut span);
    area + spread(rest, front, span, connectivity)
}

/// Take the background that is connected to the border of the image out of `rest`.
fn flood_from_border(rest: &mut Bitmap<'_>, front: &mut Bitmap<'_>) {
    let size = rest.size();
    let mut span = Span::EMPTY;
    let last = size.width.saturating_sub(1);
    for (v, i) in places(size) {
        let whole = v == 0 || v as usize + 1 == size.height;
        let first_column = Word::from(i == 0);
        let last_column = if i == last / WORD_BITS { 1 << (last % WORD_BITS) } else { 0 };
        let border = if whole { Word::MAX } else { first_column | last_column };
        reach(rest, front, (v, i), border, &mut span);
    }
    spread(rest, front, span, Connectivity::Four);
}

/// Sweep down and up until no fresh pixel waits; returns the number of pixels gained.
fn spread(rest: &mut Bitmap<'_>, front: &mut Bitmap<'_>, start: Span, connectivity: Connectivity) -> u32 {
    let (mut waiting, mut down, mut gained) = (start, true, 0);
    while waiting.rows.0 <= waiting.rows.1 {
        let mut ahead = waiting;
        waiting = Span::EMPTY;
        let mut v = if down { ahead.rows.0 } else { ahead.rows.1 };
        while (ahead.rows.0..=ahead.rows.1).contains(&v) {
            let mut i = ahead.words.0;
            while i <= ahead.words.1 {
                let fresh = at(front.row(v), i);
                if fresh == 0 {
                    i += 1;
                    continue;
                }
                front.row_mut(v)[i] = 0;
                let run = complete_runs(fresh, rest.row(v)[i] | fresh);
                gained += (run & !fresh).count_ones();
                rest.row_mut(v)[i] &= !run;

                let (above, below) = (v - 1, v + 1);
                let (behind, before) = if down { (above, below) } else { (below, above) };
                gained += reach_row(rest, front, (behind, i), run, connectivity, &mut waiting);
                gained += reach_row(rest, front, (before, i), run, connectivity, &mut ahead);
                gained += reach(rest, front, (v, i + 1), run >> (WORD_BITS - 1), &mut ahead);
                if i > 0 {
                    let west = reach(rest, front, (v, i - 1), run << (WORD_BITS - 1), &mut ahead);
                    gained += west;
                    if west > 0 {
                        i -= 1;
                    }
                }
            }
            v += if down { 1 } else { -1 };
        }
        down = !down;
    }
    gained
}

/// Reach from the pixels `run` of a row into the row `v` above or below it.
fn reach_row(
    rest: &mut Bitmap<'_>,
    front: &mut Bitmap<'_>,
    (v, i): Place,
    run: Word,
    connectivity: Connectivity,
    span: &mut Span,
) -> u32 {
    if connectivity == Connectivity::Four {
        return reach(rest, front, (v, i), run, span);
    }
    let west = if i > 0 { reach(rest, front, (v, i - 1), run << (WORD_BITS - 1), span) } else { 0 };
    west + reach(rest, front, (v, i), run | run << 1 | run >> 1, span)
        + reach(rest, front, (v, i + 1), run >> (WORD_BITS - 1), span)
}

/// Move those of `pixels` that `rest` still has to the front; returns how many.
fn reach(rest: &mut Bitmap<'_>, front: &mut Bitmap<'_>, place: Place, pixels: Word, span: &mut Span) -> u32 {
    let Some(left) = rest.row_mut(place.0).get_mut(place.1) else { return 0 };
    let fresh = *left & pixels;
    if fresh != 0 {
        *left ^= fresh;
        front.row_mut(place.0)[place.1] |= fresh;
        span.include(place);
    }
    fresh.count_ones()
}

/// Carry fill: the runs of `mask` that hold a pixel of `seed`, which must lie inside `mask`.
///
/// Adding `seed` to `mask` starts a carry at the lowest seed of each run, which clears that bit and
/// leaves above it the seeds themselves; below it the run stays set. So the bits of the run from its
/// lowest seed on are those that the sum lacks or that are seeds. The mirror image gives the other side.
fn complete_runs(seed: Word, mask: Word) -> Word {
    let upwards = |seed: Word, mask: Word| mask & (!mask.wrapping_add(seed) | seed);
    upwards(seed, mask) | upwards(seed.reverse_bits(), mask.reverse_bits()).reverse_bits()
}
