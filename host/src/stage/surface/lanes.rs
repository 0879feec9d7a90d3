//! Vectors of which each part is four numbers in single precision: one for each of four cones or points.

pub(super) use wide::f32x4 as Lanes;

/// How many.
pub(super) const LANES: usize = 4;

/// A vector of four.
pub(super) type Vectors = [Lanes; 3];

/// The same vector four times.
#[inline(always)]
pub(super) fn all([x, y, z]: [f32; 3]) -> Vectors {
    [Lanes::splat(x), Lanes::splat(y), Lanes::splat(z)]
}

/// The scalar product of two vectors.
#[inline(always)]
pub(super) fn dot(a: Vectors, b: Vectors) -> Lanes {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The sum of two vectors.
#[inline(always)]
pub(super) fn plus(a: Vectors, b: Vectors) -> Vectors {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// A vector less so many times another.
#[inline(always)]
pub(super) fn less(a: Vectors, b: Vectors, times: Lanes) -> Vectors {
    [a[0] - b[0] * times, a[1] - b[1] * times, a[2] - b[2] * times]
}
