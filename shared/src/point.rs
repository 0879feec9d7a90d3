//! Points of the image plane and the one exact predicate on them.

use crate::fixed::PX;

/// A pixel by column and row.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
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
        (self.distance_squared(other) as u64).isqrt() as i32
    }

    /// The point a fraction `num / den` of the way to `other`.
    pub const fn lerp(self, other: Self, num: i32, den: i32) -> Self {
        Self {
            u: self.u + crate::fixed::div_round((other.u - self.u) as i64 * num as i64, den as i64) as i32,
            v: self.v + crate::fixed::div_round((other.v - self.v) as i64 * num as i64, den as i64) as i32,
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
