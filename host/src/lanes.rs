//! Eight numbers in single precision at once, in what registers a machine has.
//!
//! [`Floats`] tells what holds them, and [`crate::wide::widest`] chooses it. All kinds give the same bits, as no
//! operation is fused or approximated, but for what `min` and `max` do not tell.

use std::ops::{Add, Div, Mul, Sub};

use wide::f32x8;

/// How many.
pub(crate) const LANES: usize = 8;

/// Eight numbers, or as many masks: what a comparison gives.
pub(crate) trait Floats:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// Eight numbers from memory.
    fn load(numbers: &[f32; LANES]) -> Self;

    /// The numbers.
    fn store(self) -> [f32; LANES];

    /// The same number eight times.
    fn splat(number: f32) -> Self;

    /// Square roots; no number of what is negative.
    fn sqrt(self) -> Self;

    /// The lesser of two numbers. Neither may be none; the sign of a zero is not told.
    fn min(self, other: Self) -> Self;

    /// The greater of two numbers. Neither may be none; the sign of a zero is not told.
    fn max(self, other: Self) -> Self;

    /// Where the first number is less; not if either is none.
    fn is_below(self, other: Self) -> Self;

    /// Where the first number is not greater; not if either is none.
    fn is_at_most(self, other: Self) -> Self;

    /// Where both masks are set, or the number where the mask is, and 0 elsewhere.
    fn and(self, mask: Self) -> Self;

    /// The first number where `self`, a mask, is set, and the second one elsewhere.
    fn choose(self, set: Self, clear: Self) -> Self;

    /// A mask as a bit each.
    fn bits(self) -> u32;
}

/// Any machine's.
impl Floats for f32x8 {
    #[inline(always)]
    fn load(numbers: &[f32; LANES]) -> Self {
        (*numbers).into()
    }

    #[inline(always)]
    fn store(self) -> [f32; LANES] {
        self.to_array()
    }

    #[inline(always)]
    fn splat(number: f32) -> Self {
        Self::splat(number)
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self::sqrt(self)
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.fast_min(other)
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.fast_max(other)
    }

    #[inline(always)]
    fn is_below(self, other: Self) -> Self {
        self.simd_lt(other)
    }

    #[inline(always)]
    fn is_at_most(self, other: Self) -> Self {
        self.simd_le(other)
    }

    #[inline(always)]
    fn and(self, mask: Self) -> Self {
        self & mask
    }

    #[inline(always)]
    fn choose(self, set: Self, clear: Self) -> Self {
        self.bitselect(set, clear)
    }

    #[inline(always)]
    fn bits(self) -> u32 {
        self.to_bitmask()
    }
}

/// Something to be done in lanes of any kind, or with the instructions on words that come with the widest.
pub(crate) trait Work {
    /// What comes of it.
    type Output;

    /// Does it. To be inlined, with all that it does to lanes: so a compiler may use their registers. Closures on lanes
    /// that are handed to others may not be.
    fn run<L: Floats>(self) -> Self::Output;
}
