//! Points of the image plane and the one exact predicate on them.

use crate::fixed::{PX, UNIT, div_round, hypot, isqrt};
use bytemuck::{Pod, Zeroable};

/// A pixel by column and row.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord, Pod, Zeroable)]
#[repr(C)]
pub struct Pixel {
    /// Column, px from the left.
    pub u: u16,
    /// Row, px from the top.
    pub v: u16,
}

impl Pixel {
    /// The pixel's centre.
    pub const fn centre(self) -> PixelPoint {
        PixelPoint { u: self.u as i32 * PX, v: self.v as i32 * PX }
    }
}

/// A point of the image plane in 1/256 px; pixel centres lie at whole pixels, v points down.
/// |u|, |v| < 2^20.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord, Pod, Zeroable)]
#[repr(C)]
pub struct PixelPoint {
    /// Horizontal coordinate, 1/256 px.
    pub u: i32,
    /// Vertical coordinate, 1/256 px.
    pub v: i32,
}

impl PixelPoint {
    /// Squared distance, in (1/256 px)^2; below 2^43.
    pub const fn distance_squared(self, other: Self) -> i64 {
        let (du, dv) = ((self.u - other.u) as i64, (self.v - other.v) as i64);
        du * du + dv * dv
    }

    /// Distance, 1/256 px, rounded down.
    pub const fn distance(self, other: Self) -> i32 {
        isqrt(self.distance_squared(other) as u64) as i32
    }

    /// The point a fraction `num / den` of the way to `other`.
    pub const fn lerp(self, other: Self, num: i32, den: i32) -> Self {
        // Differences below 2^21, products below 2^52.
        Self {
            u: self.u + div_round((other.u - self.u) as i64 * num as i64, den as i64) as i32,
            v: self.v + div_round((other.v - self.v) as i64 * num as i64, den as i64) as i32,
        }
    }

    /// The pixel whose square holds the point, if it has non-negative coordinates.
    pub fn pixel(self) -> Option<Pixel> {
        let (u, v) = ((self.u + PX / 2).div_euclid(PX), (self.v + PX / 2).div_euclid(PX));
        Some(Pixel { u: u16::try_from(u).ok()?, v: u16::try_from(v).ok()? })
    }
}

/// Twice the signed area of the triangle a, b, c, in (1/256 px)^2: positive when the turn at b is to
/// the right as seen on the screen (v down), zero when the three are collinear. Exact; below 2^44.
pub const fn orient(a: PixelPoint, b: PixelPoint, c: PixelPoint) -> i64 {
    (b.u - a.u) as i64 * (c.v - a.v) as i64 - (b.v - a.v) as i64 * (c.u - a.u) as i64
}

/// A unit vector of the image plane, in 1/16384.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Direction {
    /// Horizontal part, +-[`UNIT`].
    pub u: i16,
    /// Vertical part, +-[`UNIT`].
    pub v: i16,
}

impl Direction {
    /// The direction of the vector `(u, v)`, |u|, |v| < 2^30; `None` for the zero vector.
    pub fn of(u: i32, v: i32) -> Option<Self> {
        let length = i64::from(hypot(u, v));
        if length == 0 {
            return None;
        }
        // |x| < 2^30: the product is below 2^44.
        let part = |x: i32| {
            div_round(i64::from(x) * i64::from(UNIT), length).clamp(-UNIT as i64, UNIT as i64) as i16
        };
        Some(Self { u: part(u), v: part(v) })
    }

    /// Cosine of the angle to another direction, in 1/16384.
    pub const fn dot(self, other: Self) -> i32 {
        (self.u as i32 * other.u as i32 + self.v as i32 * other.v as i32) >> 14
    }

    /// Sine of the turn to another direction (positive towards +v from +u), in 1/16384.
    pub const fn cross(self, other: Self) -> i32 {
        (self.u as i32 * other.v as i32 - self.v as i32 * other.u as i32) >> 14
    }

    /// Turned by the angle whose sine is `sine` / 16384, |angle| <= 90 degrees.
    pub fn turned(self, sine: i32) -> Self {
        let sine = sine.clamp(-UNIT, UNIT);
        let cosine = ((UNIT * UNIT - sine * sine) as u32).isqrt() as i32;
        // Four factors of at most 2^14: sums of at most 2^29.
        let (u, v) = (i32::from(self.u), i32::from(self.v));
        Self::of((u * cosine - v * sine) >> 14, (u * sine + v * cosine) >> 14).unwrap_or(self)
    }

    /// Component along this direction of the vector from `a` to `b`, 1/256 px.
    pub const fn along(self, a: PixelPoint, b: PixelPoint) -> i32 {
        // Each product below 2^35; the component, of a vector shorter than 2^21.5, below 2^22.
        ((self.u as i64 * (b.u - a.u) as i64 + self.v as i64 * (b.v - a.v) as i64) >> 14) as i32
    }

    /// The opposite direction.
    pub const fn reversed(self) -> Self {
        Self { u: -self.u, v: -self.v }
    }
}
