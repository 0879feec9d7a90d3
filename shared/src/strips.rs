//! Strips: thin rectangles around a row of points, in a hierarchy, to look at those near a place alone.
//!
//! Points that follow each other along a contour, a branch or a raster are neighbours in the plane. Eight of
//! them lie in a rectangle along their chord, four such stretches in a longer one, and so on (Ballard,
//! "Strip trees", 1981). The hierarchy is implicit: stretches begin at multiples of their length.
//!
//! * **In**: points, |u|, |v| < 2^20, by number; scratch for a strip of 24 bytes per six points.
//! * **Out**: the points inside a disc, in the order of their numbers.
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
/// How many of the longest strips there are at most.
const MOST_LONGEST: usize = 8;
/// The level of the longest strips that there can be, of 2^25 points.
const MAX_LEVEL: u32 = 11;

/// What has a place in the plane.
pub trait Placed {
    /// Where it is; |u|, |v| < 2^20.
    fn place(&self) -> PixelPoint;
}

impl Placed for PixelPoint {
    fn place(&self) -> PixelPoint {
        *self
    }
}

/// A disc that points are looked for in.
#[derive(Clone, Copy, Debug)]
pub struct Disc {
    /// Centre; |u|, |v| < 2^30 + 2^21.
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
    level: u32,
}

impl Strip {
    /// The strip of some points.
    fn around(stretch: &[impl Placed], level: u32) -> Self {
        let end = |point: Option<&_>| point.map(Placed::place).unwrap_or_default();
        let axis = axis(end(stretch.first()), end(stretch.last()));
        let (mut low, mut high) = ([i32::MAX; 2], [i32::MIN; 2]);
        for point in stretch {
            let [s, t] = turned(axis, point.place());
            (low, high) = ([low[0].min(s), low[1].min(t)], [high[0].max(s), high[1].max(t)]);
        }
        Self { axis, low: low.map(|x| x - 1), high: high.map(|x| x + 1), level }
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

/// The strips of a row of points: each before the shorter ones in it.
#[derive(Debug)]
pub struct Strips<'a, P> {
    points: &'a [P],
    strips: &'a [Strip],
}

/// How many points a strip of a level has; level 0 is the shortest.
const fn length(level: u32) -> usize {
    1 << (LEAF_BITS + FAN_BITS * level)
}

/// How many strips one of a level is with those in it.
const fn family(level: u32) -> usize {
    ((1 << (FAN_BITS * (level + 1))) - 1) / ((1 << FAN_BITS) - 1)
}

impl<'a, P: Placed> Strips<'a, P> {
    /// The strips of a row of points.
    ///
    /// # Errors
    /// A [`CapacityError`] when the scratch is too short.
    pub fn new<'s: 'a>(points: &'a [P], scratch: &mut Arena<'s>) -> Result<Self, CapacityError> {
        let count = points.len();
        let longest =
            (0..MAX_LEVEL).find(|&level| count <= length(level) * MOST_LONGEST).unwrap_or(MAX_LEVEL);
        let all = (0..=longest).map(|level| count.div_ceil(length(level))).sum();
        let strips = scratch.take::<Strip>(all, "strips")?;
        let starts = (0..count).step_by(length(0)).flat_map(|from| {
            let begin_here = move |level: &u32| from % length(*level) == 0;
            (0..=longest).rev().filter(begin_here).map(move |level| (from, level))
        });
        for (strip, (from, level)) in strips.iter_mut().zip(starts) {
            *strip = Strip::around(&points[from..count.min(from + length(level))], level);
        }
        Ok(Self { points, strips })
    }

    /// Show every point inside the disc, in order: its number, itself, and the disc, which may shrink on the way.
    pub fn walk(&self, mut disc: Disc, mut visit: impl FnMut(usize, &'a P, &mut Disc)) {
        let (mut i, mut from) = (0, 0);
        while let Some(strip) = self.strips.get(i) {
            if strip.is_apart(&disc) {
                i += family(strip.level);
                from += length(strip.level);
                continue;
            }
            i += 1;
            if strip.level == 0 {
                for (k, point) in self.points.iter().enumerate().skip(from).take(length(0)) {
                    if disc.centre.distance_squared(point.place()) < disc.squared {
                        visit(k, point, &mut disc);
                    }
                }
                from += length(0);
            }
        }
    }
}
