//! Vectors of which each part is eight numbers: one for each of eight cones, edges or points.

use crate::lanes::{Floats, LANES};

/// A vector of eight.
pub(super) type Vectors<L> = [L; 3];

/// The same vector eight times.
#[inline(always)]
pub(super) fn all<L: Floats>([x, y, z]: [f32; 3]) -> Vectors<L> {
    [L::splat(x), L::splat(y), L::splat(z)]
}

/// Eight vectors from memory.
#[inline(always)]
pub(super) fn load<L: Floats>([x, y, z]: &[[f32; LANES]; 3]) -> Vectors<L> {
    [L::load(x), L::load(y), L::load(z)]
}

/// Eight vectors to memory.
#[inline(always)]
pub(super) fn store<L: Floats>([x, y, z]: Vectors<L>) -> [[f32; LANES]; 3] {
    [x.store(), y.store(), z.store()]
}

/// The scalar product of two vectors.
#[inline(always)]
pub(super) fn dot<L: Floats>(a: Vectors<L>, b: Vectors<L>) -> L {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The sum of two vectors.
#[inline(always)]
pub(super) fn plus<L: Floats>(a: Vectors<L>, b: Vectors<L>) -> Vectors<L> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// A vector so many times.
#[inline(always)]
pub(super) fn times<L: Floats>(a: Vectors<L>, times: L) -> Vectors<L> {
    [a[0] * times, a[1] * times, a[2] * times]
}

/// A vector less so many times another.
#[inline(always)]
pub(super) fn less<L: Floats>(a: Vectors<L>, b: Vectors<L>, times: L) -> Vectors<L> {
    [a[0] - b[0] * times, a[1] - b[1] * times, a[2] - b[2] * times]
}

/// The first vector where a mask is set, and the second one elsewhere.
#[inline(always)]
pub(super) fn choose<L: Floats>(mask: L, a: Vectors<L>, b: Vectors<L>) -> Vectors<L> {
    [mask.choose(a[0], b[0]), mask.choose(a[1], b[1]), mask.choose(a[2], b[2])]
}
