//! One object without specks and pinholes: largest component, small holes, 3x3 closing and opening.
//!
//! Paper: section 3 takes clean blobs for granted; this stage makes them.
//!
//! | | |
//! |---|---|
//! | in, out | a [`Bitmap`], changed in place |
//! | components | of the object 8-connected, of the background 4-connected |
//! | scratch | [`scratch_words`]: a bitmap of the same size and two rows of runs, contents irrelevant; no labels |
//! | bounds | areas below 2^24 + 1 px |
//! | cost | a pass over the words and their runs, and the area of what is taken away or filled; closing and opening four passes over the words each |
//!
//! Components are found by their runs (`components.rs`); only one that goes is looked at again. It is flooded
//! word by word: fresh pixels wait in the bitmap `front`, a visit takes a word of them, completes its runs by
//! a carry and reaches into the eight words around it. Rows are visited in sweeps, down then up, over the box
//! of words in which fresh pixels wait. A word is visited only after it gained a pixel, so there are at most
//! as many visits as pixels; a sweep further costs a look at each word of its box. A speck therefore costs a
//! handful of words, and only shapes that turn back between up and down many times (spirals, combs) need more
//! than a few sweeps.

mod components;

use crate::arena::{Arena, words};
use crate::bitmap::{Bitmap, Size, WORD_BITS, Word, at};
use crate::limits::CapacityError;
use crate::point::Pixel;
use components::{Component, Run, each_component, runs};

/// Holes of fewer pixels than this are filled by default, px^2.
pub const HOLE_AREA: u32 = 60;

/// Words of scratch that [`keep_largest`] and [`fill_holes`] need.
pub const fn scratch_words(size: Size) -> usize {
    words::<Word>(size.words()) + 2 * words::<Run>(runs(size.width))
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

/// What [`fill_holes`] filled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Holes {
    /// Number of holes.
    pub count: u32,
    /// Area of all of them, px.
    pub area: u32,
}

/// Clear everything but the largest 8-connected component; of equals, the first in raster order stays.
///
/// # Errors
/// A [`CapacityError`] when there is too little scratch; nothing is changed then.
pub fn keep_largest(bitmap: &mut Bitmap<'_>, scratch: Arena<'_>) -> Result<Components, CapacityError> {
    let (mut front, rows) = split(bitmap.size(), scratch)?;
    let mut found = Components::default();
    let mut largest: Option<Component> = None;
    let ground = Ground::Object;
    each_component(bitmap, ground, rows, |bitmap, next| {
        found.count += 1;
        let before = largest.replace(next);
        let Some(mut other) = before else { return };
        if other.area > next.area || other.area == next.area && other.is_before(&next) {
            largest = before;
            other = next;
        }
        found.second = found.second.max(other.area);
        Flood { bitmap, front: &mut front, ground }.take(other.first);
    });
    found.largest = largest.map_or(0, |largest| largest.area);
    Ok(found)
}

/// Set the pixels of every 4-connected hole of fewer than `below` pixels; says what they were. What is
/// connected to the border of the image is background, not a hole.
///
/// # Errors
/// A [`CapacityError`] when there is too little scratch; nothing is changed then.
pub fn fill_holes(bitmap: &mut Bitmap<'_>, below: u32, scratch: Arena<'_>) -> Result<Holes, CapacityError> {
    let (mut front, rows) = split(bitmap.size(), scratch)?;
    let mut filled = Holes::default();
    let ground = Ground::Background;
    each_component(bitmap, ground, rows, |bitmap, hole| {
        if !hole.on_border && hole.area < below {
            Flood { bitmap, front: &mut front, ground }.take(hole.first);
            filled = Holes { count: filled.count + 1, area: filled.area + hole.area };
        }
    });
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
            let (here, east) = (at(row, i), at(row, i + 1));
            let spread = here | here << 1 | here >> 1;
            if let Some(word) = row.get_mut(i) {
                *word = (spread | west >> (WORD_BITS - 1) | east << (WORD_BITS - 1)) & valid;
            }
            west = here;
        }
    }
    for i in 0..size.row_words() {
        let mut above = 0;
        for v in 0..size.height as i32 {
            let below = at(bitmap.row(v + 1), i);
            let row = bitmap.row_mut(v);
            let here = at(row, i);
            if let Some(word) = row.get_mut(i) {
                *word |= above | below;
            }
            above = here;
        }
    }
}

/// Clear every pixel that has a clear pixel among its eight neighbours inside the image.
pub fn erode(bitmap: &mut Bitmap<'_>) {
    bitmap.invert();
    dilate(bitmap);
    bitmap.invert();
}

/// What components are made of.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Ground {
    /// Set pixels, joined by their edges and corners.
    Object,
    /// Clear pixels, joined by their edges.
    Background,
}

impl Ground {
    /// What turns its pixels in a word into set bits, beyond the width others too.
    const fn mask(self) -> Word {
        match self {
            Self::Object => 0,
            Self::Background => Word::MAX,
        }
    }
}

/// Row and index of a word.
type Place = (i32, usize);

type Rows<'a> = [&'a mut [Run]; 2];

/// The scratch: a clear bitmap, and two rows of runs.
fn split(size: Size, mut scratch: Arena<'_>) -> Result<(Bitmap<'_>, Rows<'_>), CapacityError> {
    let front = Bitmap::new(size, scratch.take(size.words(), "words of scratch")?)?;
    let mut row = || scratch.take(runs(size.width), "runs of a row");
    Ok((front, [row()?, row()?]))
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

/// Takes single components over to the other side: set pixels are cleared, clear ones set.
struct Flood<'f, 'b, 's> {
    bitmap: &'f mut Bitmap<'b>,
    /// Pixels taken over but not yet gone on from; clear before and after.
    front: &'f mut Bitmap<'s>,
    ground: Ground,
}

impl Flood<'_, '_, '_> {
    /// Take over the component of a pixel. One of clear pixels must not lie on the border.
    fn take(&mut self, pixel: Pixel) {
        let (mut ahead, mut down) = (Span::EMPTY, true);
        let (u, v) = (usize::from(pixel.u), i32::from(pixel.v));
        self.reach((v, u / WORD_BITS), 1 << (u % WORD_BITS), &mut ahead);
        // Down and up until no fresh pixel waits.
        while ahead.rows.0 <= ahead.rows.1 {
            let mut behind = Span::EMPTY;
            let mut v = if down { ahead.rows.0 } else { ahead.rows.1 };
            while (ahead.rows.0..=ahead.rows.1).contains(&v) {
                let next = if down { v + 1 } else { v - 1 };
                let mut i = ahead.words.0;
                while i <= ahead.words.1 {
                    let fresh = at(self.front.row(v), i);
                    if fresh == 0 {
                        i += 1;
                        continue;
                    }
                    let run = self.take_runs((v, i), fresh);
                    self.reach_row((2 * v - next, i), run, &mut behind);
                    self.reach_row((next, i), run, &mut ahead);
                    self.reach((v, i + 1), run >> (WORD_BITS - 1), &mut ahead);
                    if i > 0 && self.reach((v, i - 1), run << (WORD_BITS - 1), &mut ahead) {
                        i -= 1;
                    }
                }
                v = next;
            }
            (ahead, down) = (behind, !down);
        }
    }

    /// Take over the runs of the fresh pixels of a word, which need not wait any longer; returns both.
    fn take_runs(&mut self, (v, i): Place, fresh: Word) -> Word {
        let (Some(front), Some(word)) = (self.front.row_mut(v).get_mut(i), self.bitmap.row_mut(v).get_mut(i))
        else {
            return 0;
        };
        *front = 0;
        let run = complete_runs(fresh, *word ^ self.ground.mask() | fresh);
        *word ^= run & !fresh;
        run
    }

    /// Reach from the pixels `run` of a row into the row `v` above or below it.
    fn reach_row(&mut self, (v, i): Place, run: Word, span: &mut Span) {
        if self.ground == Ground::Background {
            self.reach((v, i), run, span);
            return;
        }
        if i > 0 {
            self.reach((v, i - 1), run << (WORD_BITS - 1), span);
        }
        self.reach((v, i), run | run << 1 | run >> 1, span);
        self.reach((v, i + 1), run >> (WORD_BITS - 1), span);
    }

    /// Take over those of `pixels` that are still there; returns whether there are any.
    fn reach(&mut self, place: Place, pixels: Word, span: &mut Span) -> bool {
        let Some(word) = self.bitmap.row_mut(place.0).get_mut(place.1) else { return false };
        let fresh = (*word ^ self.ground.mask()) & pixels;
        if fresh != 0 {
            *word ^= fresh;
            if let Some(front) = self.front.row_mut(place.0).get_mut(place.1) {
                *front |= fresh;
            }
            span.include(place);
        }
        fresh != 0
    }
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
