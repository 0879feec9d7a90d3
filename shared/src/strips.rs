//! Strips: thin rectangles around a row of points, in a hierarchy, to look at those near a place alone.
//!
//! Points that follow each other along a contour, a branch or a raster are neighbours in the plane. Eight of
//! them lie in a rectangle along their chord, four such stretches in a longer one, and so on (Ballard,
//! "Strip trees", 1981). The hierarchy is implicit: stretches begin at multiples of their length.
//!
//! * **In**: points, |u|, |v| < 2^20, by number; scratch for a strip of 20 bytes per six points.
//! * **Out**: every point inside a disc, in the order of their numbers, and a few others.
//! * **How**: a rectangle's axes are no longer than 1, so that no length measured along them is too long, and its
//!   sides lie one unit farther out than its points do, so that no rounding brings a point into the disc
//!   that the rectangle is held apart from.
//! * **Cost**: building, some 15 instructions a point and level; a walk touches the strips that meet the disc:
//!   of points along a smooth line a number that grows with the logarithm of theirs.

use crate::arena::Arena;
use crate::fixed::UNIT;
use crate::limits::CapacityError;
use crate::point::PixelPoint;
use bytemuck::{Pod, Zeroable};

/// Bits of the number of points in the shortest strip.
const LEAF_BITS: u32 = 3;
/// Bits of the number of strips in a longer one.
const FAN_BITS: u32 = 2;
/// Most levels: those of 2^25 points.
const MAX_LEVELS: usize = 12;

/// A disc that points are looked for in.
#[derive(Clone, Copy, Debug)]
pub struct Disc {
    /// Centre; |u|, |v| < 2^28.
    pub centre: PixelPoint,
    /// Squared radius, (1/256 px)^2; points that far away are outside, and nothing is inside 0.
    pub squared: i64,
}

/// A rectangle around a stretch of points.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Strip {
    /// Its longer axis, 1/16384.
    axis: [i16; 2],
    /// Least coordinates along it and across.
    low: [i32; 2],
    /// Greatest coordinates along it and across.
    high: [i32; 2],
}

impl Strip {
    /// The strip of points number `from..to`, at least one.
    fn around(at: &impl Fn(usize) -> PixelPoint, from: usize, to: usize) -> Self {
        let axis = axis(at(from), at(to - 1));
        let (mut low, mut high) = ([i32::MAX; 2], [i32::MIN; 2]);
        for i in from..to {
            let [s, t] = turned(axis, at(i));
            (low, high) = ([low[0].min(s), low[1].min(t)], [high[0].max(s), high[1].max(t)]);
        }
        Self { axis, low: low.map(|x| x - 1), high: high.map(|x| x + 1) }
    }

    /// Whether it certainly has no point inside the disc.
    fn is_apart(&self, disc: &Disc) -> bool {
        let [s, t] = turned(self.axis, disc.centre);
        let along = (self.low[0] - s).max(s - self.high[0]).max(0);
        let across = (self.low[1] - t).max(t - self.high[1]).max(0);
        i64::from(along) * i64::from(along) + i64::from(across) * i64::from(across) >= disc.squared
    }
}

/// The direction from one point to another, 1/16384, never longer than 1.
fn axis(from: PixelPoint, to: PixelPoint) -> [i16; 2] {
    let (u, v) = (to.u - from.u, to.v - from.v);
    let bits = 32 - (u.unsigned_abs() | v.unsigned_abs()).leading_zeros();
    // 15 bits of the longer side: lengths below 2^16, products below 2^30.
    let scaled = |x: i32| if bits > 15 { x >> (bits - 15) } else { x << (15 - bits) };
    let (u, v) = (scaled(u), scaled(v));
    let length = (u * u + v * v).cast_unsigned().isqrt().cast_signed() + 1;
    [u, v].map(|x| ((x * UNIT) / length) as i16)
}

/// Coordinates along an axis and across, rounded down.
fn turned([a, b]: [i16; 2], p: PixelPoint) -> [i32; 2] {
    let (a, b, u, v) = (i64::from(a), i64::from(b), i64::from(p.u), i64::from(p.v));
    [((a * u + b * v) >> 14) as i32, ((a * v - b * u) >> 14) as i32]
}

/// The strips of a row of points.
#[derive(Debug)]
pub struct Strips<'a> {
    points: usize,
    /// Where each level begins, the shortest strips first.
    first: [usize; MAX_LEVELS],
    levels: usize,
    strips: &'a [Strip],
}

/// How many points a strip of a level has.
const fn length(level: usize) -> usize {
    1 << (LEAF_BITS + FAN_BITS * level as u32)
}

impl<'a> Strips<'a> {
    /// The strips of `points` points, of which `at` tells the places.
    ///
    /// # Errors
    /// A [`CapacityError`] when the scratch is too short.
    pub fn new(
        points: usize,
        at: impl Fn(usize) -> PixelPoint,
        scratch: &mut Arena<'a>,
    ) -> Result<Self, CapacityError> {
        let (mut first, mut levels, mut count) = ([0; MAX_LEVELS], 0, 0);
        loop {
            first[levels] = count;
            let here = points.div_ceil(length(levels));
            count += here;
            levels += 1;
            if here <= 1 << FAN_BITS || levels == MAX_LEVELS {
                break;
            }
        }
        let strips = scratch.take::<Strip>(count, "strips")?;
        let stretches = (0..levels).flat_map(|level| (0..points).step_by(length(level)).map(move |i| (level, i)));
        for (strip, (level, from)) in strips.iter_mut().zip(stretches) {
            *strip = Strip::around(&at, from, points.min(from + length(level)));
        }
        Ok(Self { points, first, levels, strips })
    }

    /// Show every point inside the disc, and a few others, in order; the disc may shrink on the way.
    pub fn walk(&self, disc: &mut Disc, mut visit: impl FnMut(usize, &mut Disc)) {
        let mut i = 0;
        while i < self.points {
            // The longest strip that begins here, then shorter ones, until one is apart.
            let mut level = (i.trailing_zeros().saturating_sub(LEAF_BITS) / FAN_BITS) as usize;
            level = level.min(self.levels - 1);
            loop {
                let strip = &self.strips[self.first[level] + i / length(level)];
                if strip.is_apart(disc) {
                    i += length(level);
                    break;
                }
                if level == 0 {
                    for j in i..self.points.min(i + length(0)) {
                        visit(j, disc);
                    }
                    i += length(0);
                    break;
                }
                level -= 1;
            }
        }
    }
}
