//! A raw picture to its rectified one, row by row.
//!
//! | | |
//! |---|---|
//! | in | a [`Mapping`], once a calibration; then a raw picture and the number of a row |
//! | out | that row of the rectified picture |
//! | table | the raw place of each [`STEP`]th pixel each way and of one more on every side, 1/256 px; see [`knots`] |
//! | between | knots: four down and then four along, by the rule below; raw pixels: four, linearly |
//! | outside | the raw picture repeats its border |
//! | bounds | places are cut to +-4096 px = 2^20 / 256; every sum is below 2^31 |
//! | cost | a row: 2 x 4 products a knot; a pixel: 2 x 4 products for its place and 6 for its value |
//!
//! Bessel's rule to second differences: with D = p0 - p1 - p2 + p3, a share t of the way from p1 to p2 lies
//! at p1 + t (p2 - p1) - t (1 - t) D / 4. It is exact for parabolas and off by at most 0.008 STEP^3 times
//! the third derivative otherwise: with the rounding, 0.013 px for lenses of modules. The line from p1 to p2
//! would be off by STEP^2 / 8 times the second, 0.13 px or more; `tests/tests/warp.rs` has the figures.
//!
//! The table is lent and made once; the raw picture is read where it lies, and no other memory is used. So a
//! device can rectify each row as it is wanted, as often as it is.

use crate::bitmap::{Grey, Size};
use crate::camera::Mapping;
use crate::fixed::{PX, PX_BITS, confined};
use crate::limits::{CapacityError, MAX_SIDE};

/// Rectified pixels from knot to knot, a power of two.
pub const STEP: usize = 16;

/// A place in a raw picture: column and row, 1/256 px.
pub type Place = [i32; 2];

/// Farthest place from the first pixel, 1/256 px.
const FAR: i32 = MAX_SIDE as i32 * PX;

/// Knots along a side of the table: one every [`STEP`] px, one before the first and two after the last that
/// starts a stretch.
const fn knots_along(side: usize) -> usize {
    side.div_ceil(STEP) + 3
}

/// Places in the table of a rectified picture: 414, so 3.3 kB, for 320x240.
pub const fn knots(size: Size) -> usize {
    knots_along(size.width) * knots_along(size.height)
}

/// How the rectified picture of one eye is made of its raw one.
#[derive(Clone, Copy, Debug)]
pub struct Warp<'t> {
    size: Size,
    /// By rows; nothing where the raw picture is rectified already.
    table: Option<&'t [Place]>,
}

impl<'t> Warp<'t> {
    /// The way of a picture that is rectified already: it passes untouched.
    pub const fn untouched(size: Size) -> Self {
        Self { size, table: None }
    }

    /// The way along a mapping, whose table fills the first [`knots`] places of `memory`.
    ///
    /// # Errors
    /// A [`CapacityError`] when `memory` is too short.
    pub fn new(mapping: &Mapping, memory: &'t mut [Place]) -> Result<Self, CapacityError> {
        let size = mapping.size();
        let limit = memory.len();
        let table = memory.get_mut(..knots(size)).ok_or(CapacityError { what: "knots", limit })?;
        let pixel = |knot: usize| (knot * STEP) as i32 - STEP as i32;
        for (j, row) in table.chunks_exact_mut(knots_along(size.width)).enumerate() {
            for (i, place) in row.iter_mut().enumerate() {
                *place = mapping.fixed_raw(pixel(i), pixel(j));
            }
        }
        Self::along(size, table)
    }

    /// The way along a table that was made before, or elsewhere. Whatever it holds, rows can be made of it.
    ///
    /// # Errors
    /// A [`CapacityError`] when `table` has fewer than [`knots`] places.
    pub const fn along(size: Size, table: &'t [Place]) -> Result<Self, CapacityError> {
        if table.len() < knots(size) {
            return Err(CapacityError { what: "knots", limit: table.len() });
        }
        Ok(Self { size, table: Some(table) })
    }

    /// Size of the rectified picture.
    pub const fn size(&self) -> Size {
        self.size
    }

    /// Row `v` of the rectified picture of `raw`. Fills as many pixels as the shorter of the row and `out`
    /// has; none outside the picture.
    pub fn row(&self, v: usize, raw: Grey<'_>, out: &mut [u8]) {
        let Some(table) = self.table else {
            return out.iter_mut().zip(raw.row(v)).for_each(|(out, &grey)| *out = grey);
        };
        let mut pixels = out.iter_mut();
        self.places(table, v, |place| {
            if let Some(out) = pixels.next() {
                *out = grey_at(raw, place);
            }
        });
    }

    /// Shows the raw places of row `v` from left to right, 1/256 px; none where the picture passes untouched.
    pub fn each_place(&self, v: usize, visit: impl FnMut(Place)) {
        if let Some(table) = self.table {
            self.places(table, v, visit);
        }
    }

    fn places(&self, table: &[Place], v: usize, mut visit: impl FnMut(Place)) {
        if v >= self.size.height {
            return;
        }
        let columns = knots_along(self.size.width);
        let (above, down) = (v / STEP, (v % STEP) as i32);
        let knot = |i: usize| {
            let place = |j: usize| match table.get((above + j) * columns + i) {
                Some(&[x, y]) => [x.clamp(-FAR, FAR), y.clamp(-FAR, FAR)],
                None => [0; 2],
            };
            let [x, y] = stretches([place(0), place(1), place(2), place(3)]);
            [x.at(down), y.at(down)]
        };
        let mut four = [knot(0), knot(1), knot(2), knot(3)];
        for first in (0..self.size.width).step_by(STEP) {
            let [x, y] = stretches(four);
            for along in 0..STEP.min(self.size.width - first) {
                visit([x.at(along as i32), y.at(along as i32)]);
            }
            four = [four[1], four[2], four[3], knot(first / STEP + 4)];
        }
    }
}

/// One coordinate between two knots, by the rule above.
#[derive(Clone, Copy)]
struct Stretch {
    start: i32,
    end: i32,
    /// D of the rule.
    bend: i32,
}

impl Stretch {
    const fn new([before, start, end, after]: [i32; 4]) -> Self {
        Self { start, end, bend: before - start - end + after }
    }

    /// The coordinate `share` / STEP of the way. For knots up to 1.25 x 2^20 the line is below 1.25 x 2^30
    /// and the bend below 1.25 x 2^28.
    const fn at(self, share: i32) -> i32 {
        const SCALE: i32 = 4 * (STEP * STEP) as i32;
        let rest = STEP as i32 - share;
        let line = 4 * STEP as i32 * (rest * self.start + share * self.end);
        (line - share * rest * self.bend + SCALE / 2) >> SCALE.ilog2()
    }
}

/// Columns and rows between the second and the third of four knots.
const fn stretches([a, b, c, d]: [Place; 4]) -> [Stretch; 2] {
    [Stretch::new([a[0], b[0], c[0], d[0]]), Stretch::new([a[1], b[1], c[1], d[1]])]
}

/// The grey value at a place, linearly between pixels; 0 if the picture has none.
fn grey_at(raw: Grey<'_>, [x, y]: Place) -> u8 {
    let Size { width, height } = raw.size();
    let inside = |x: i32, side: usize| confined(x, 0, (side as i32 - 1) * PX);
    let (x, y) = (inside(x, width), inside(y, height));
    let (u, v) = ((x >> PX_BITS) as usize, (y >> PX_BITS) as usize);
    let (right, below) = ((x & (PX - 1)) as u32, (y & (PX - 1)) as u32);
    let mix = |a: u32, b: u32, share: u32| a * (PX as u32 - share) + b * share;
    let along = |row: &[u8]| {
        let here = row.get(u).copied().unwrap_or(0);
        mix(u32::from(here), u32::from(row.get(u + 1).copied().unwrap_or(here)), right)
    };
    let sum = mix(along(raw.row(v)), along(raw.row((v + 1).min(height.saturating_sub(1)))), below);
    // Below 2^8 x 2^8 x 2^8.
    ((sum + (1 << 15)) >> 16) as u8
}
