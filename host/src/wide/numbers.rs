//! Floats of eight numbers in one register of AVX.

use core::arch::x86_64::*;
use core::ops::{Add, Div, Mul, Sub};

use crate::lanes::{Floats, LANES, Work};

#[derive(Clone, Copy)]
struct Avx(__m256);

const _: () = assert!(size_of::<[f32; LANES]>() == size_of::<__m256>());

/// A function of registers by one instruction.
macro_rules! by {
    ($instruction:ident($($register:expr),+)) => {
        // SAFETY: lanes are used below `avx2` only, whose caller sees to it that there are such registers.
        Self(unsafe { $instruction($($register.0),+) })
    };
}

impl Add for Avx {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        by!(_mm256_add_ps(self, other))
    }
}

impl Sub for Avx {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        by!(_mm256_sub_ps(self, other))
    }
}

impl Mul for Avx {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        by!(_mm256_mul_ps(self, other))
    }
}

impl Div for Avx {
    type Output = Self;

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        by!(_mm256_div_ps(self, other))
    }
}

impl Floats for Avx {
    #[inline(always)]
    fn load(numbers: &[f32; LANES]) -> Self {
        // SAFETY: as above; and there are as many numbers.
        Self(unsafe { _mm256_loadu_ps(numbers.as_ptr()) })
    }

    #[inline(always)]
    fn store(self) -> [f32; LANES] {
        let mut numbers = [0.0; LANES];
        // SAFETY: as above; and there are as many numbers.
        unsafe { _mm256_storeu_ps(numbers.as_mut_ptr(), self.0) };
        numbers
    }

    #[inline(always)]
    fn splat(number: f32) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm256_set1_ps(number) })
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        by!(_mm256_sqrt_ps(self))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        by!(_mm256_min_ps(self, other))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        by!(_mm256_max_ps(self, other))
    }

    #[inline(always)]
    fn is_below(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn is_at_most(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn and(self, mask: Self) -> Self {
        by!(_mm256_and_ps(self, mask))
    }

    #[inline(always)]
    fn choose(self, set: Self, clear: Self) -> Self {
        by!(_mm256_blendv_ps(clear, set, self))
    }

    #[inline(always)]
    fn bits(self) -> u32 {
        // SAFETY: as above.
        unsafe { _mm256_movemask_ps(self.0) as u32 }
    }
}

/// Does something in them.
///
/// # Safety
/// The machine has AVX2, BMI1, BMI2, LZCNT and POPCNT.
pub(super) unsafe fn avx2<W: Work>(work: W) -> W::Output {
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    fn compiled<W: Work>(work: W) -> W::Output {
        work.run::<Avx>()
    }
    // SAFETY: by the caller.
    unsafe { compiled(work) }
}

#[cfg(test)]
mod tests {
    use wide::f32x8;

    use super::*;
    use crate::wide::{has_avx2, widest};

    /// Each operation on numbers of all sorts.
    struct Everything;

    impl Work for Everything {
        type Output = Vec<u32>;

        fn run<L: Floats>(self) -> Vec<u32> {
            let sorts = [0.0, -0.0, 1.5, -3e38, f32::MIN_POSITIVE, f32::INFINITY, 1.0 / 3.0, -7e-12];
            let numbers = (0..LANES).map(|i| {
                let (mut a, mut b) = (sorts, sorts);
                a.rotate_left(i);
                b.reverse();
                let (a, b) = (L::load(&a), L::load(&b));
                let below = a.is_below(b);
                let root = (a * a).sqrt() + L::splat(-1.0).sqrt().is_below(a).and(a);
                let made = [
                    a + b,
                    a - b,
                    a * b,
                    a / b,
                    a.and(below),
                    b.and(a.is_at_most(b)),
                    below.choose(a, b),
                    root,
                ];
                let bits = made.map(|lanes| lanes.store().map(|x| if x.is_nan() { 0 } else { x.to_bits() }));
                let ends = [a.min(b), a.max(b)].map(|lanes| lanes.store().map(|x| (x + 0.0).to_bits()));
                [bits.as_flattened(), ends.as_flattened(), &[below.bits()]].concat()
            });
            numbers.flatten().collect()
        }
    }

    #[test]
    fn all_lanes_make_the_same_bits() {
        if !has_avx2() {
            let in_ci = std::env::var("CI").is_ok_and(|ci| ci == "true");
            assert!(!in_ci, "there is no AVX2, and nothing may be skipped");
            eprintln!("\n!!!! SKIPPED: this machine has no AVX2, so its lanes are NOT compared !!!!\n");
            return;
        }
        assert_eq!(widest(Everything), Everything.run::<f32x8>());
    }
}
