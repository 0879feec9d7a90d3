//! Strips: boxes around stretches of a row of points, in a hierarchy, to look at those near a place alone.
//!
//! Points that follow each other along a contour, a branch or a raster are neighbours in the plane. Eight of
//! them lie in a small box, four such stretches in a larger one, and so on (after Ballard, "Strip trees", 1981).
//! The hierarchy is implicit: stretches begin at multiples of their length.
//!
//! * **In**: points, |u|, |v| < 2^20, by number; scratch for a strip of 20 bytes per six points.
//! * **Out**: the points inside a disc, in the order of their numbers.
//! * **How**: boxes are upright: one along its chord would be thinner, but takes twice as long to look at.
//! * **Cost**: building, some 10 instructions a point and level; a walk touches the strips that meet the disc:
//!   of points along a smooth line a number that grows with the logarithm of theirs.

use crate::arena::Arena;
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
/// Bits of a level.
const PLACE_BITS: u32 = 4;

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
    /// Radius, 1/256 px, not below 0; points that far away are outside.
    pub radius: i32,
}

/// A box around a stretch of points.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Strip {
    /// Least coordinates.
    low: [i32; 2],
    /// Greatest coordinates.
    high: [i32; 2],
    /// The number of its first point, above [`PLACE_BITS`] bits of its level.
    place: u32,
}

impl Strip {
    /// The strip of some points.
    fn around(stretch: &[impl Placed], place: u32) -> Self {
        let (mut low, mut high) = ([i32::MAX; 2], [i32::MIN; 2]);
        for point in stretch {
            let PixelPoint { u, v } = point.place();
            (low, high) = ([low[0].min(u), low[1].min(v)], [high[0].max(u), high[1].max(v)]);
        }
        Self { low, high, place }
    }

    /// Whether it certainly has no point inside the disc.
    fn is_apart(&self, disc: &Disc) -> bool {
        let PixelPoint { u, v } = disc.centre;
        let along = (self.low[0] - u).max(u - self.high[0]);
        let across = (self.low[1] - v).max(v - self.high[1]);
        let is_beside = along >= disc.radius || across >= disc.radius;
        is_beside || along > 0 && across > 0 && square(along) + square(across) >= square(disc.radius)
    }
}

fn square(x: i32) -> i64 {
    i64::from(x) * i64::from(x)
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
const FAMILY: [usize; 1 << PLACE_BITS] = {
    let mut family = [1; 1 << PLACE_BITS];
    let mut level = 1;
    while level <= MAX_LEVEL as usize {
        family[level] = (family[level - 1] << FAN_BITS) + 1;
        level += 1;
    }
    family
};

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
            let place = (from as u32) << PLACE_BITS | level;
            let stretch = points.get(from..count.min(from + length(level))).unwrap_or_default();
            *strip = Strip::around(stretch, place);
        }
        Ok(Self { points, strips })
    }

    /// Show every point inside the disc, in order: its number, itself, and the disc, which may shrink on the way.
    pub fn walk(&self, mut disc: Disc, mut visit: impl FnMut(usize, &'a P, &mut Disc)) {
        let mut i = 0;
        while let Some(strip) = self.strips.get(i) {
            let level = strip.place & ((1 << PLACE_BITS) - 1);
            if strip.is_apart(&disc) {
                i += FAMILY[level as usize];
                continue;
            }
            i += 1;
            if level == 0 {
                let from = (strip.place >> PLACE_BITS) as usize;
                let points = self.points.get(from..).unwrap_or_default();
                for (k, point) in (from..).zip(&points[..points.len().min(length(0))]) {
                    if disc.centre.distance_squared(point.place()) < square(disc.radius) {
                        visit(k, point, &mut disc);
                    }
                }
            }
        }
    }
}
