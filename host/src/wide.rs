//! Inner loops in the widest registers that this machine has: the core's, and the surface's.
//!
//! What a register holds is told by [`Lanes`](shared::lanes::Lanes), and of numbers by `Floats` in `lanes.rs`; the loops are
//! compiled once more for each width. Only this file and those in `wide/` are `unsafe` in the host: registers may be
//! used only where the machine has them.

#![expect(unsafe_code, reason = "the compiler cannot know which registers the machine has")]

#[cfg(all(target_arch = "x86_64", target_pointer_width = "64"))]
mod numbers;

use ::wide::{f32x8, u8x16};
use shared::bitmap::{Bitmap, Size, WORD_BITS, Word};
use shared::limits::CapacityError;
use shared::pack::pack_by;
use shared::pipeline::Kernels;
use shared::stage::parallel_thinning::Thin;

use crate::lanes::Work;

/// What this machine does best.
pub fn kernels() -> Kernels {
    let thin = widths().into_iter().rev().find_map(|(_, thin)| thin);
    Kernels { thin: thin.unwrap_or(Kernels::PORTABLE.thin), ..Kernels::PORTABLE }
}

/// As [`shared::pack::pack`], sixteen bytes at once.
///
/// # Errors
/// As there.
pub fn pack<'w>(size: Size, bytes: &[u8], words: &'w mut [Word]) -> Result<Bitmap<'w>, CapacityError> {
    pack_by(packed, size, bytes, words)
}

/// Bit `k` for each byte `k` that is not 0.
fn packed(bytes: &[u8; WORD_BITS]) -> Word {
    let sixteens = bytes.as_chunks().0.iter().rev();
    !sixteens.fold(0, |clear, sixteen| {
        clear << 16 | Word::from(u8x16::from(*sixteen).simd_eq(u8x16::ZERO).to_bitmask())
    })
}

/// Thinning in registers wider than a word, the narrowest first, where this machine has them.
#[cfg(all(target_arch = "x86_64", target_pointer_width = "64"))]
pub fn widths() -> [(&'static str, Option<Thin>); 2] {
    let avx2 = has_avx2();
    let avx512 = avx2
        && is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512dq");
    [("AVX2", avx2.then_some(x86::avx2 as Thin)), ("AVX-512", avx512.then_some(x86::avx512 as Thin))]
}

/// Thinning in registers wider than a word: there is none for this kind of machine.
#[cfg(not(all(target_arch = "x86_64", target_pointer_width = "64")))]
pub fn widths() -> [(&'static str, Option<Thin>); 0] {
    []
}

/// Whether this machine has AVX2, and the instructions on words that every machine with it has.
#[cfg(all(target_arch = "x86_64", target_pointer_width = "64"))]
#[inline]
fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
        && is_x86_feature_detected!("lzcnt")
        && is_x86_feature_detected!("popcnt")
}

/// Does something in the widest lanes of floats of this machine ([`Floats`](crate::lanes::Floats), not words as
/// [`kernels`] do); all make the same bits.
#[inline]
pub(crate) fn widest<W: Work>(work: W) -> W::Output {
    #[cfg(all(target_arch = "x86_64", target_pointer_width = "64"))]
    if has_avx2() {
        // SAFETY: the machine has what is asked for.
        return unsafe { numbers::avx2(work) };
    }
    work.run::<f32x8>()
}

#[cfg(all(target_arch = "x86_64", target_pointer_width = "64"))]
mod x86 {
    use core::arch::x86_64::*;
    use core::ops::{BitAnd, BitOr, BitXor, Not, Shl, Shr};
    use shared::arena::Arena;
    use shared::bitmap::{Bitmap, Word};
    use shared::lanes::Lanes;
    use shared::limits::CapacityError;
    use shared::stage::parallel_thinning::{Parallel, Report, thin_in_lanes};

    /// [`Lanes::with`].
    #[inline]
    #[target_feature(enable = "avx2")]
    fn avx2_with(words: __m256i, bits: __m256i) -> Word {
        let none = _mm256_cmpeq_epi64(_mm256_and_si256(words, bits), _mm256_setzero_si256());
        !_mm256_movemask_pd(_mm256_castsi256_pd(none)) as Word & 0b1111
    }

    /// [`Lanes::with`].
    #[inline]
    #[target_feature(enable = "avx512f")]
    fn avx512_with(words: __m512i, bits: __m512i) -> Word {
        _mm512_test_epi64_mask(words, bits).into()
    }

    /// A register as lanes: its type, words, features, instructions, and the thinning in it.
    macro_rules! lanes {
        ($name:ident $register:ty, $words:literal, $features:literal, $thin:ident, $splat:ident, $load:ident,
         $store:ident, $and:ident, $or:ident, $xor:ident, $shl:ident, $shr:ident, $with:ident) => {
            #[derive(Clone, Copy)]
            struct $name($register);

            const _: () = assert!(size_of::<[Word; $words]>() == size_of::<$register>());

            impl BitAnd for $name {
                type Output = Self;

                #[inline(always)]
                fn bitand(self, other: Self) -> Self {
                    // SAFETY: lanes are used below `$thin` only, which runs only where there are such registers.
                    Self(unsafe { $and(self.0, other.0) })
                }
            }

            impl BitOr for $name {
                type Output = Self;

                #[inline(always)]
                fn bitor(self, other: Self) -> Self {
                    // SAFETY: as above.
                    Self(unsafe { $or(self.0, other.0) })
                }
            }

            impl BitXor for $name {
                type Output = Self;

                #[inline(always)]
                fn bitxor(self, other: Self) -> Self {
                    // SAFETY: as above.
                    Self(unsafe { $xor(self.0, other.0) })
                }
            }

            impl Not for $name {
                type Output = Self;

                #[inline(always)]
                fn not(self) -> Self {
                    self ^ Self::splat(Word::MAX)
                }
            }

            impl Shl<u32> for $name {
                type Output = Self;

                #[inline(always)]
                fn shl(self, bits: u32) -> Self {
                    // SAFETY: as above.
                    Self(unsafe { $shl(self.0, _mm_cvtsi32_si128(bits as i32)) })
                }
            }

            impl Shr<u32> for $name {
                type Output = Self;

                #[inline(always)]
                fn shr(self, bits: u32) -> Self {
                    // SAFETY: as above.
                    Self(unsafe { $shr(self.0, _mm_cvtsi32_si128(bits as i32)) })
                }
            }

            impl Lanes for $name {
                const WORDS: usize = $words;

                #[inline(always)]
                fn splat(word: Word) -> Self {
                    // SAFETY: as above.
                    Self(unsafe { $splat(word as i64) })
                }

                #[inline(always)]
                fn load(words: &[Word], at: usize) -> Self {
                    let words: &[Word; $words] = words[at..].first_chunk().expect("enough words");
                    // SAFETY: as above; and there are as many words.
                    Self(unsafe { $load(words.as_ptr().cast()) })
                }

                #[inline(always)]
                fn store(self, words: &mut [Word], at: usize) {
                    let words: &mut [Word; $words] = words[at..].first_chunk_mut().expect("enough words");
                    // SAFETY: as above; and there are as many words.
                    unsafe { $store(words.as_mut_ptr().cast(), self.0) }
                }

                #[inline(always)]
                fn with(self, bits: Word) -> Word {
                    // SAFETY: as above.
                    unsafe { $with(self.0, Self::splat(bits).0) }
                }
            }

            pub(super) fn $thin(
                bitmap: &mut Bitmap<'_>,
                rule: Parallel,
                scratch: Arena<'_>,
            ) -> Result<Report, CapacityError> {
                #[target_feature(enable = $features)]
                fn compiled(
                    bitmap: &mut Bitmap<'_>,
                    rule: Parallel,
                    scratch: Arena<'_>,
                ) -> Result<Report, CapacityError> {
                    thin_in_lanes::<$name>(bitmap, rule, scratch)
                }
                // SAFETY: `widths` gives this function away only where there are such registers.
                unsafe { compiled(bitmap, rule, scratch) }
            }
        };
    }

    lanes!(Avx2 __m256i, 4, "avx2,bmi1,bmi2,lzcnt,popcnt", avx2, _mm256_set1_epi64x, _mm256_loadu_si256,
        _mm256_storeu_si256, _mm256_and_si256, _mm256_or_si256, _mm256_xor_si256, _mm256_sll_epi64, _mm256_srl_epi64,
        avx2_with);
    lanes!(Avx512 __m512i, 8, "avx512f,avx512bw,avx512vl,avx512dq,bmi1,bmi2,lzcnt,popcnt", avx512,
        _mm512_set1_epi64, _mm512_loadu_si512, _mm512_storeu_si512, _mm512_and_si512, _mm512_or_si512,
        _mm512_xor_si512, _mm512_sll_epi64, _mm512_srl_epi64, avx512_with);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_packed_as_by_the_core() {
        for width in 0..200 {
            let size = Size::new(width, 3).unwrap();
            let mask: Vec<u8> = (0..3 * width as u32)
                .map(|i| (i.wrapping_mul(0x9e37_79b9) >> 26).saturating_sub(30) as u8)
                .collect();
            let (mut words, mut expected) = ([Word::MAX; 64], [Word::MAX; 64]);
            let bitmap = pack(size, &mask, &mut words).unwrap();
            assert_eq!(bitmap, shared::pack::pack(size, &mask, &mut expected).unwrap(), "{width}");
        }
    }
}
