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
//! | cost | linear in the pixels, with one division per set pixel |
//!
//! The parabolas of a clear pixel touch zero, so what lies beyond one in its row is never nearer: every
//! run of set pixels has an envelope of its own, between the two clear pixels that end it.

use crate::bitmap::{Bitmap, Plane, WORD_BITS};
use crate::limits::CapacityError;
use bytemuck::{Pod, Zeroable};

/// One pixel, in the unit of stored distances: 1/16 px.
pub const DISTANCE_PX: u16 = 16;

/// A part of the lower envelope of a run; positions count from the clear pixel before the run.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Parabola {
    /// Position of its lowest point, px.
    apex: u16,
    /// Distance along the column there, px.
    height: u16,
    /// First position at which no other parabola is lower, px.
    from: u16,
}

impl Parabola {
    /// A value to fill scratch memory with.
    pub const NONE: Self = Self { apex: 0, height: 0, from: 0 };

    /// Its value at a position, px^2; below 2^25.
    const fn at(self, x: u16) -> u32 {
        (self.apex.abs_diff(x) as u32).pow(2) + (self.height as u32).pow(2)
    }

    /// The last position at which it is not above `other`, whose apex lies further right; at most 2^16 - 2.
    fn last_before(self, other: Self) -> u16 {
        let base = |p: Self| u32::from(p.apex).pow(2) + u32::from(p.height).pow(2);
        let last = base(other).saturating_sub(base(self)) / (2 * u32::from(other.apex - self.apex));
        last.min(u32::from(u16::MAX) - 1) as u16
    }
}

/// Parabolas of scratch for an image of this width.
pub const fn scratch_parabolas(width: usize) -> usize {
    width + 2
}

/// The plane of distances in 1/16 px, isqrt(256 d^2), over `data`; 0 where the bitmap is clear.
pub fn distance<'p>(
    bitmap: &Bitmap<'_>,
    data: &'p mut [u16],
    scratch: &mut [Parabola],
) -> Result<Plane<'p, u16>, CapacityError> {
    let mut plane = along_columns(bitmap, data)?;
    let envelope = check(bitmap, scratch)?;
    for v in 0..bitmap.size().height {
        let unit = u32::from(DISTANCE_PX).pow(2);
        along_row(plane.row_mut(v), envelope, |_, pixel, square| *pixel = (unit * square).isqrt() as u16);
    }
    Ok(plane)
}

/// Squared distances, px^2, handed to `sink` row by row with the number of the row, 0 where the bitmap
/// is clear. `row` holds one row; what `columns` holds afterwards has no meaning.
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
        along_row(plane.row_mut(v), envelope, |u, _, square| row[u] = square);
        sink(v, row);
    }
    Ok(())
}

fn check<'s>(bitmap: &Bitmap<'_>, scratch: &'s mut [Parabola]) -> Result<&'s mut [Parabola], CapacityError> {
    let limit = scratch.len();
    let needed = scratch_parabolas(bitmap.size().width);
    scratch.get_mut(..needed).ok_or(CapacityError { what: "parabolas of scratch", limit })
}

/// First pass: the distance to the nearest clear pixel of the same column, px.
fn along_columns<'p>(bitmap: &Bitmap<'_>, data: &'p mut [u16]) -> Result<Plane<'p, u16>, CapacityError> {
    let size = bitmap.size();
    let limit = data.len();
    let pixels = data.get_mut(..size.pixels()).ok_or(CapacityError { what: "pixels in a plane", limit })?;
    for v in 0..size.height {
        let (above, here) = pixels.split_at_mut(v * size.width);
        let above = above.rchunks_exact(size.width.max(1)).next().unwrap_or(&[]);
        for (u, out) in here.iter_mut().take(size.width).enumerate() {
            let set = (bitmap.row(v as i32)[u / WORD_BITS] >> (u % WORD_BITS) & 1) as u16;
            *out = set * (above.get(u).copied().unwrap_or(0) + 1);
        }
    }
    for v in (0..size.height).rev() {
        let (here, below) = pixels[v * size.width..].split_at_mut(size.width);
        for (u, out) in here.iter_mut().enumerate() {
            *out = (*out).min(below.get(u).copied().unwrap_or(0) + 1);
        }
    }
    Plane::over(size, data)
}

/// Second pass over one row: `emit` gets the column, the entry of the first pass to overwrite, and the
/// squared distance of every set pixel.
fn along_row(row: &mut [u16], envelope: &mut [Parabola], mut emit: impl FnMut(usize, &mut u16, u32)) {
    let mut u = 0;
    while u < row.len() {
        let length = row[u..].iter().take_while(|&&g| g != 0).count();
        let run = &mut row[u..u + length];
        let mut top = lower_envelope(run, envelope);
        for (k, pixel) in run.iter_mut().enumerate().rev() {
            let x = k as u16 + 1;
            while top > 0 && envelope[top].from > x {
                top -= 1;
            }
            emit(u + k, pixel, envelope[top].at(x));
        }
        u += length + 1;
    }
}

/// The lower envelope of a run and the two clear pixels around it, from left to right; returns the index
/// of its last part.
fn lower_envelope(run: &[u16], envelope: &mut [Parabola]) -> usize {
    if run.is_empty() {
        return 0;
    }
    // The clear pixel before the run is 0 at position 0: nothing ever removes it.
    envelope[0] = Parabola::default();
    let mut top = 0;
    for (k, &height) in run.iter().chain(&[0]).enumerate() {
        let mut next = Parabola { apex: k as u16 + 1, height, from: 0 };
        while top > 0 && envelope[top].at(envelope[top].from) > next.at(envelope[top].from) {
            top -= 1;
        }
        next.from = envelope[top].last_before(next) + 1;
        if usize::from(next.from) <= run.len() {
            top += 1;
            envelope[top] = next;
        }
    }
    top
}
