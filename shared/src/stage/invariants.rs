//! Convex hull affine invariants (paper section 4.1.2, equations 1 and 2).
//!
//! Four consecutive hull vertices span four triangles; an affine map multiplies all areas by the same
//! factor, so the six ratios of these areas do not change. Only two of them are independent, since
//! S123 + S134 = S124 + S234, but all six stay, as the paper has them.
//!
//! * **In**: ordered vertices of a closed polygon.
//! * **Out**: ratios in 1/65536, clamped to [2^-8, 2^8] because a nearly flat triangle makes them
//!   explode; or their base-two logarithms in 1/65536, which weigh S_k / S_l like S_l / S_k. Along a straight
//!   side an area is nothing but the noise of its vertices, and its logarithm anything. So what half a
//!   pixel of height over the quadruplet's longest chord makes is added to all four areas before.
//! * **Bounds**: areas below 2^44, differences below 2^24, e_omega below 2^54 for omega <= 3.

use crate::fixed::{ONE, PX, log2};
use crate::point::{PixelPoint, orient};
use core::num::{NonZeroU64, NonZeroUsize};

/// How ratios of areas are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// By their difference: equation 2 as written.
    Ratio,
    /// By the difference of their logarithms, areas below the noise of a vertex taken as alike.
    Logarithm,
}

/// How far a vertex may be off, 1/256 px.
const VERTEX_NOISE: i64 = PX as i64 / 2;

/// The pairs whose ratios these are.
const fn pairs<T: Copy>([a, b, c, d]: [T; 4]) -> [(T, T); 6] {
    [(a, b), (a, c), (a, d), (b, c), (b, d), (c, d)]
}

/// The six ratios I12, I13, I14, I23, I24, I34 of a quadruplet, 1/65536.
pub type FeatureVector = [i32; 6];

/// The feature vector of quadruplet `i`: vertices i, i + 1, i + 2, i + 3 around the polygon.
///
/// All zero for a polygon without vertices.
pub fn feature_vector(polygon: &[PixelPoint], i: usize, measure: Measure) -> FeatureVector {
    let Some(n) = NonZeroUsize::new(polygon.len()) else { return [0; 6] };
    let [a, b, c, d] = [0, 1, 2, 3].map(|k| polygon.get((i + k) % n).copied().unwrap_or_default());
    let areas = [orient(a, b, c), orient(a, b, d), orient(a, c, d), orient(b, c, d)]
        .map(|s| NonZeroU64::new(s.unsigned_abs()).unwrap_or(NonZeroU64::MIN));
    match measure {
        // Areas below 2^44, so the shift stays below 2^60.
        Measure::Ratio => pairs(areas).map(|(k, l)| ((k.get() << 16) / l).clamp(1 << 8, 1 << 24) as i32),
        Measure::Logarithm => {
            let chord = a.distance(c).max(b.distance(d)).max(a.distance(d));
            // A chord below 2^22, times 2^7; with an area below 2^45.
            let noise = (i64::from(chord) * VERTEX_NOISE) as u64;
            let logarithms = areas.map(|s| log2(s.get() + noise));
            pairs(logarithms).map(|(k, l)| (k - l).clamp(-8 * ONE, 8 * ONE))
        }
    }
}

/// Squared distance of two feature vectors, in 1/2^32.
pub fn feature_distance(left: &FeatureVector, right: &FeatureVector) -> u64 {
    let square = |d: u32| u64::from(d) * u64::from(d);
    // Six squares of differences below 2^24: below 2^51.
    left.iter().zip(right).map(|(a, b)| square(a.abs_diff(*b))).sum()
}

/// e_omega(i, j): the squared distance of `omega` consecutive feature vectors, from quadruplet `i` of the
/// left and `j` of the right polygon on (equation 2), in 1/2^32.
pub fn e_omega(
    (left, i): (&[PixelPoint], usize),
    (right, j): (&[PixelPoint], usize),
    omega: usize,
    measure: Measure,
) -> u64 {
    let features = |k| (feature_vector(left, i + k, measure), feature_vector(right, j + k, measure));
    (0..omega).map(features).map(|(a, b)| feature_distance(&a, &b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEXAGON: [(i32, i32); 6] =
        [(0, 0), (900, -300), (2000, 100), (2200, 1500), (800, 2100), (-300, 1200)];

    fn polygon(map: impl Fn(i32, i32) -> (i32, i32)) -> [PixelPoint; 6] {
        HEXAGON.map(|(u, v)| {
            let (u, v) = map(u * 64, v * 64);
            PixelPoint { u, v }
        })
    }

    #[test]
    fn an_affine_map_changes_nothing() {
        let (left, right) =
            (polygon(|u, v| (u, v)), polygon(|u, v| (3 * u / 4 + v / 8 + 5000, v - u / 16 - 300)));
        for measure in [Measure::Ratio, Measure::Logarithm] {
            for i in 0..6 {
                let same = e_omega((&left, i), (&right, i), 3, measure);
                let other = (1..6).map(|s| e_omega((&left, i), (&right, i + s), 3, measure)).min().unwrap();
                assert!(same < 1 << 20 && same < other / 100, "{measure:?} {i}: {same} against {other}");
            }
        }
    }

    #[test]
    fn two_ratios_give_the_other_four() {
        // S123 + S134 = S124 + S234, divided by S234.
        let f = feature_vector(&polygon(|u, v| (u, v)), 2, Measure::Ratio);
        let (s1, s2, s3) = (f[2], f[4], f[5]);
        assert!((s1 + s3 - s2 - ONE).abs() <= 4);
    }

    #[test]
    fn flat_quadruplets_are_clamped_and_their_noise_says_little() {
        let flat = [0, 1, 2, 3].map(|k| PixelPoint { u: k * 4096, v: 0 });
        let noisy = [0, 1, 2, 3].map(|k| PixelPoint { u: k * 4096, v: [0, 20, -20, 0][k as usize] });
        for polygon in [flat, noisy] {
            let logarithms = feature_vector(&polygon, 0, Measure::Logarithm);
            assert!(logarithms.iter().all(|l| l.abs() < ONE / 4), "{logarithms:?}");
        }
        assert!(feature_vector(&flat, 0, Measure::Ratio).iter().all(|r| (1 << 8..=1 << 24).contains(r)));
        assert_eq!(feature_vector(&[], 3, Measure::Ratio), [0; 6]);
    }
}
