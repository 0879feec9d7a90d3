//! Exact distance of every object pixel to the background.
//!
//! Paper: section 4.2 grows a ball at a skeleton point as far as the nearest boundary point; in the image
//! that radius is this distance. Method: Meijster, Roerdink, Hesselink 2000, the first pass of which
//! gives distances along columns and the second, along rows, the lower envelope of the parabolas
//! (x - a)^2 + g(a)^2 that stand on them.
//!
//! | | |
//! |---|---|
//! | in | a [`Bitmap`] |
//! | out | squared distances row by row, px^2, or a [`Plane`] of distances, 1/16 px, rounded down |
//! | meaning | from the pixel's centre to the nearest centre of a clear pixel; all outside is clear |
//! | ranges | sides up to 4096 put the border within 2048 px: squares up to 2^22, distances up to 2^15 |
//! | scratch | one [`Parabola`] per column and two more; one `u16` per pixel, which may become the plane |
//! | cost | linear in the set pixels, with one division at most for each that shapes the envelope; the rest of the plane is but cleared |
//!
//! The parabolas of a clear pixel touch zero, so what lies beyond one in its row is never nearer: every
//! run of set pixels has an envelope of its own, between the two clear pixels that end it. With `k` and `m` px
//! to these, a parabola of height `g` crosses theirs at (k + g^2 / k) / 2 px on the one side and
//! (m + g^2 / m) / 2 px on the other. It is below both somewhere only if these add up to less than k + m, that
//! is, if g^2 < k m: in the inside of an object that is more high than wide, none is.

use crate::bitmap::{Bitmap, Plane, WORD_BITS, Word};
use crate::limits::CapacityError;
use bytemuck::{Pod, Zeroable};
use core::ops::Range;

/// One pixel, in the unit of stored distances: 1/16 px.
pub const DISTANCE_PX: u16 = 16;

/// A part of the lower envelope of a run; positions count from the clear pixel before the run.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Parabola {
    /// Position of its lowest point, px.
    apex: u16,
    /// First position at which no other parabola is lower, px.
    from: u16,
    /// Its value at position 0, px^2: the squares of `apex` and of the distance along the column there; below 2^25.
    base: u32,
}

impl Parabola {
    /// A value to fill scratch memory with.
    pub const NONE: Self = Self { apex: 0, from: 0, base: 0 };
}

/// Parabolas of scratch for an image of this width.
pub const fn scratch_parabolas(width: usize) -> usize {
    width + 2
}

/// The plane of distances in 1/16 px, isqrt(256 d^2), over `data`; 0 where the bitmap is clear.
///
/// # Errors
/// A [`CapacityError`] when the memory is too short.
pub fn distance<'p>(
    bitmap: &Bitmap<'_>,
    data: &'p mut [u16],
    scratch: &mut [Parabola],
) -> Result<Plane<'p, u16>, CapacityError> {
    let mut plane = along_columns(bitmap, data)?;
    let envelope = check(bitmap, scratch)?;
    for v in rows(bitmap) {
        for run in Runs::of(bitmap.row(v as i32)) {
            let pixels = plane.row_mut(v).get_mut(run).unwrap_or_default();
            along_run(pixels, envelope, |_, pixel, square| *pixel = root(square));
        }
    }
    Ok(plane)
}

/// Squared distances, px^2, handed to `sink` row by row with the number of the row, 0 where the bitmap
/// is clear. `row` holds one row; what `columns` holds afterwards has no meaning.
///
/// # Errors
/// A [`CapacityError`] when the memory is too short.
pub fn squared_distances(
    bitmap: &Bitmap<'_>,
    columns: &mut [u16],
    scratch: &mut [Parabola],
    row: &mut [u32],
    mut sink: impl FnMut(usize, &[u32]),
) -> Result<(), CapacityError> {
    let limit = row.len();
    let row =
        row.get_mut(..bitmap.size().width).ok_or(CapacityError { what: "distances in a row", limit })?;
    let mut plane = along_columns(bitmap, columns)?;
    let envelope = check(bitmap, scratch)?;
    for v in 0..bitmap.size().height {
        row.fill(0);
        for run in Runs::of(bitmap.row(v as i32)) {
            let squares = row.get_mut(run.clone()).unwrap_or_default();
            along_run(plane.row_mut(v).get_mut(run).unwrap_or_default(), envelope, |k, _, square| {
                if let Some(place) = squares.get_mut(k) {
                    *place = square;
                }
            });
        }
        sink(v, row);
    }
    Ok(())
}

fn check<'s>(bitmap: &Bitmap<'_>, scratch: &'s mut [Parabola]) -> Result<&'s mut [Parabola], CapacityError> {
    let limit = scratch.len();
    let needed = scratch_parabolas(bitmap.size().width);
    scratch.get_mut(..needed).ok_or(CapacityError { what: "parabolas of scratch", limit })
}

/// The rows from the first to the last one with a set pixel.
fn rows(bitmap: &Bitmap<'_>) -> Range<usize> {
    let first = bitmap.words().iter().position(|word| *word != 0);
    let last = bitmap.words().iter().rposition(|word| *word != 0);
    let n = bitmap.pitch();
    first.zip(last).map_or(0..0, |(first, last)| first / n..last / n + 1)
}

/// The runs of set pixels of a row, from left to right.
#[derive(Clone, Debug)]
pub struct Runs<'a> {
    row: &'a [Word],
    /// Where to look on.
    from: usize,
}

impl<'a> Runs<'a> {
    /// Those of a row of a bitmap.
    pub const fn of(row: &'a [Word]) -> Self {
        Self { row, from: 0 }
    }

    /// The first pixel from `from` on at which the row, with all words changed by `flip`, is set.
    fn next_set(&self, from: usize, flip: Word) -> Option<usize> {
        let mut i = from / WORD_BITS;
        let mut word = (self.row.get(i)? ^ flip) >> (from % WORD_BITS) << (from % WORD_BITS);
        while word == 0 {
            i += 1;
            word = self.row.get(i)? ^ flip;
        }
        Some(i * WORD_BITS + word.trailing_zeros() as usize)
    }
}

impl Iterator for Runs<'_> {
    type Item = Range<usize>;

    fn next(&mut self) -> Option<Range<usize>> {
        let start = self.next_set(self.from, 0)?;
        self.from = self.next_set(start, Word::MAX).unwrap_or(self.row.len() * WORD_BITS);
        Some(start..self.from)
    }
}

/// First pass: the distance to the nearest clear pixel of the same column, px.
fn along_columns<'p>(bitmap: &Bitmap<'_>, data: &'p mut [u16]) -> Result<Plane<'p, u16>, CapacityError> {
    let size = bitmap.size();
    let limit = data.len();
    let pixels = data.get_mut(..size.pixels()).ok_or(CapacityError { what: "pixels in a plane", limit })?;
    pixels.fill(0);
    for v in rows(bitmap) {
        let Some((above, here)) = pixels.split_at_mut_checked(v * size.width) else { break };
        let above = v.checked_sub(1).and_then(|v| above.get(v * size.width..));
        for run in Runs::of(bitmap.row(v as i32)) {
            let here = here.get_mut(run.clone()).unwrap_or_default();
            match above.and_then(|above| above.get(run)) {
                Some(above) => here.iter_mut().zip(above).for_each(|(out, above)| *out = above + 1),
                None => here.fill(1),
            }
        }
    }
    for v in rows(bitmap).rev() {
        let rows = pixels.get_mut(v * size.width..).and_then(|rows| rows.split_at_mut_checked(size.width));
        let Some((here, below)) = rows else { break };
        for run in Runs::of(bitmap.row(v as i32)) {
            let here = here.get_mut(run.clone()).unwrap_or_default();
            match below.get(run) {
                Some(below) => {
                    here.iter_mut().zip(below).for_each(|(out, below)| *out = (*out).min(below + 1));
                }
                None => here.fill(1),
            }
        }
    }
    Plane::over(size, data)
}

/// Second pass over one run: `emit` gets the place in the run, the entry of the first pass to overwrite, and
/// the squared distance of every pixel.
fn along_run(run: &mut [u16], envelope: &mut [Parabola], mut emit: impl FnMut(usize, &mut u16, u32)) {
    let top = lower_envelope(run, envelope);
    let mut until = run.len();
    for part in envelope.get(..=top).unwrap_or_default().iter().rev() {
        let from = usize::from(part.from).max(1);
        // From one position to the next a parabola grows by 2 more than before.
        let (apex, x) = (u32::from(part.apex), from as u32);
        // A sum below 2^26; modulo 2^32 the differences are right, since squares are below 2^24.
        let mut square = (x * x + part.base).wrapping_sub(2 * apex * x);
        let mut growth = (2 * x + 1).wrapping_sub(2 * apex);
        let pixels = run.get_mut(from - 1..until).unwrap_or_default();
        for (k, pixel) in (from - 1..).zip(pixels) {
            emit(k, pixel, square);
            square = square.wrapping_add(growth);
            growth = growth.wrapping_add(2);
        }
        until = from - 1;
    }
}

/// The lower envelope of a run and the two clear pixels around it, from left to right; returns the index
/// of its last part.
fn lower_envelope(run: &[u16], envelope: &mut [Parabola]) -> usize {
    // The clear pixel before the run is 0 at position 0: nothing ever removes it.
    if let Some(zeroth) = envelope.first_mut() {
        *zeroth = Parabola::NONE;
    }
    let (mut top, mut last) = (0, Parabola::NONE);
    let end = run.len() as u32 + 1;
    for (x, &height) in (1..).zip(run.iter().chain(&[0])) {
        let least = u32::from(height).pow(2);
        if least != 0 && least >= x * (end - x) {
            continue;
        }
        // Positions are at most 2^12 + 1, and what is kept of squares of heights is below 2^23: below 2^25.
        let base = x * x + least;
        // At position y they differ by the difference of their bases, less 2 y for each px between their apexes.
        let mut apart = 2 * (x - u32::from(last.apex));
        // At most 2^12 x (2^13 + 2), and the base.
        while top > 0 && last.base + u32::from(last.from) * apart > base {
            top -= 1;
            last = envelope.get(top).copied().unwrap_or_default();
            apart = 2 * (x - u32::from(last.apex));
        }
        // The last position at which the one before is not above this one.
        let before = base.saturating_sub(last.base).checked_div(apart).unwrap_or(0);
        if before < run.len() as u32 {
            top += 1;
            last = Parabola { apex: x as u16, from: before as u16 + 1, base };
            if let Some(place) = envelope.get_mut(top) {
                *place = last;
            }
        }
    }
    top
}

/// Distances of squares below this are read off.
const SMALL: usize = 1024;

/// The distances of small squares.
static ROOTS: [u16; SMALL] = {
    let mut roots = [0; SMALL];
    let mut square = 0;
    while square < SMALL {
        roots[square] = (UNIT * square as u32).isqrt() as u16;
        square += 1;
    }
    roots
};

/// 1 px^2, in the unit of squared distances.
const UNIT: u32 = (DISTANCE_PX as u32).pow(2);

/// isqrt(256 d^2) of d^2 below 2^24: beyond the small squares one step of Newton's from the root of a square
/// 4^k times smaller, which is 2^k times smaller and at least 256. That is off by 1/512 at most, so that the
/// step ends less than one above the root of anything below 2^32, and never below it.
fn root(square: u32) -> u16 {
    if let Some(&root) = ROOTS.get(square as usize) {
        return root;
    }
    let k = (u32::BITS - SMALL.ilog2() - square.leading_zeros()).div_ceil(2);
    let guess = ROOTS.get((square >> (2 * k)) as usize).map_or(1, |root| u32::from(root + 1)) << k;
    // Below 2^8 x 2^24, and its root below 2^16.
    let square = UNIT * square;
    let root = (guess + square.checked_div(guess).unwrap_or(0)) / 2;
    (root - u32::from(root * root > square)) as u16
}
