//! A plane over the image: one value that changes linearly with u and v, fitted robustly.
//!
//! Between two narrow views an object's image changes by an affine map (paper section 4.1.2). In a
//! rectified pair rows stay rows, so the map is a plane of disparity, d = a u + b v + c; a general map is
//! two planes, one a coordinate.
//!
//! * **How**: least squares with Cauchy weights 1 / (1 + (e / 1 px)^2), re-weighted six times, and
//!   a ridge of 1 px^2 on both slopes, so that a narrow object does not get a wild slope.
//! * **Bounds**: coordinates and values within 2^20 (1/256 px), at most 2^16 observations of weight at most 2^14:
//!   plain sums stay below 2^51, sums of products below 2^72.
//! * **Cost**: linear in the number of observations, one 32-bit division each a round.

use crate::fixed::{ONE, saturate};
use crate::point::PixelPoint;

/// value = level + slope_u (u - origin.u) + slope_v (v - origin.v).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ImagePlane {
    /// Where `level` holds: the centre of gravity of what was fitted.
    pub origin: PixelPoint,
    /// Value at the origin, 1/256 px.
    pub level: i32,
    /// Change of the value per unit of u, in 1/65536.
    pub slope_u: i32,
    /// Change of the value per unit of v, in 1/65536.
    pub slope_v: i32,
}

/// A value seen at a point, and how much it counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Observation {
    /// Where.
    pub at: PixelPoint,
    /// What, 1/256 px.
    pub value: i32,
    /// Weight, 0..=16384.
    pub weight: i32,
}

/// Rounds of re-weighting.
const ROUNDS: usize = 6;
/// One pixel squared in units of [`PixelPoint`].
const PX2: i128 = 1 << 16;

impl ImagePlane {
    /// The value at a point, 1/256 px.
    pub const fn at(&self, p: PixelPoint) -> i32 {
        // Slopes of at most 2^24, distances below 2^21: products below 2^45, the rise of both below 2^30.
        let rise = self.slope_u as i64 * (p.u - self.origin.u) as i64
            + self.slope_v as i64 * (p.v - self.origin.v) as i64;
        saturate(self.level as i64 + ((rise + (ONE as i64 / 2)) >> 16))
    }

    /// The robust fit, or `None` without an observation of positive weight.
    #[expect(clippy::needless_pass_by_value, reason = "iterators are handed over, and cloned for each pass")]
    pub fn fit(observations: impl Iterator<Item = Observation> + Clone) -> Option<Self> {
        let mut plane = Self::fit_once(observations.clone())?;
        for _ in 0..ROUNDS {
            let weighted = observations.clone().map(|o| plane.reweighted(o));
            // Weights may all round to nothing when nothing fits: the last plane is then the answer.
            match Self::fit_once(weighted) {
                Some(better) => plane = better,
                None => break,
            }
        }
        Some(plane)
    }

    /// The observation with a weight that tells how far from the plane it is.
    fn reweighted(&self, o: Observation) -> Observation {
        let error = (i64::from(o.value) - i64::from(self.at(o.at))).unsigned_abs();
        // From 2^15 on the weight, 2^14 / (1 + 2^14) at most, rounds to nothing; below, all is below 2^31.
        let weight = if error < 1 << 15 {
            ((o.weight.cast_unsigned() << 16) / (PX2 as u32 + error as u32 * error as u32)).cast_signed()
        } else {
            0
        };
        Observation { weight, ..o }
    }

    /// Weighted least squares with the ridge.
    fn fit_once(observations: impl Iterator<Item = Observation>) -> Option<Self> {
        let mut sums = Sums::default();
        observations.for_each(|o| sums.add(o));
        sums.plane()
    }
}

/// Sums over weighted observations: of weights, of a coordinate or the value d, and of products of two.
#[derive(Clone, Copy, Default)]
struct Sums {
    weight: i64,
    u: i64,
    v: i64,
    d: i64,
    uu: i128,
    vv: i128,
    uv: i128,
    ud: i128,
    vd: i128,
}

/// Neither is copied into each of the many callers that iterators make: an image of the firmware would be 20 kB larger.
impl Sums {
    /// One more; each of its terms is below 2^56.
    #[inline(never)]
    fn add(&mut self, o: Observation) {
        let [w, u, v, d] = [o.weight, o.at.u, o.at.v, o.value].map(i64::from);
        let (wu, wv) = (w * u, w * v);
        self.weight += w;
        self.u += wu;
        self.v += wv;
        self.d += w * d;
        self.uu += i128::from(wu * u);
        self.vv += i128::from(wv * v);
        self.uv += i128::from(wu * v);
        self.ud += i128::from(wu * d);
        self.vd += i128::from(wv * d);
    }

    /// The plane that fits what was added, or `None` without a positive weight.
    #[inline(never)]
    fn plane(&self) -> Option<ImagePlane> {
        let total = self.weight;
        if total <= 0 {
            return None;
        }
        let mean = |sum: i64| (sum / total) as i32;
        let (origin, level) = (PixelPoint { u: mean(self.u), v: mean(self.v) }, mean(self.d));
        let [weight, mean_u, mean_v, mean_d] =
            [total, origin.u.into(), origin.v.into(), level.into()].map(i128::from);
        // sum w (x - m) (y - n) = sum w x y - m sum w y - n sum w x + m n sum w, whatever m and n are.
        let centred = |xy: i128, (x, m): (i64, i128), (y, n): (i64, i128)| {
            xy - m * i128::from(y) - n * i128::from(x) + m * n * weight
        };
        let (u, v, d) = ((self.u, mean_u), (self.v, mean_v), (self.d, mean_d));
        let ridge = weight * PX2;
        let (uu, vv) = (centred(self.uu, u, u) + ridge, centred(self.vv, v, v) + ridge);
        let (uv, ud, vd) = (centred(self.uv, u, v), centred(self.ud, u, d), centred(self.vd, v, d));
        // Sums reach 2^72; 40 bits are plenty for a slope, and keep the products below within i128.
        let excess = (128 - uu.max(vv).leading_zeros()).saturating_sub(40);
        let [uu, vv, uv, ud, vd] = [uu, vv, uv, ud, vd].map(|s| s >> excess);
        let determinant = uu * vv - uv * uv;
        if determinant <= 0 {
            return Some(ImagePlane { origin, level, ..ImagePlane::default() });
        }
        // Values vary by at most 2^26 times the ridge, so covariances with them are below 2^53, numerators below 2^94.
        let slope = |n: i128| ((n << 16) / determinant).clamp(-(1 << 24), 1 << 24) as i32;
        Some(ImagePlane {
            origin,
            level,
            slope_u: slope(ud * vv - vd * uv),
            slope_v: slope(vd * uu - ud * uv),
        })
    }
}

/// An affine map of the image plane: u' and v' as planes over u and v.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AffineMap {
    /// The new horizontal coordinate.
    pub u: ImagePlane,
    /// The new vertical coordinate.
    pub v: ImagePlane,
}

impl AffineMap {
    /// The map that takes the first point of each pair nearest to the second, robustly.
    #[expect(clippy::needless_pass_by_value, reason = "iterators are handed over, and cloned for each pass")]
    pub fn fit(pairs: impl Iterator<Item = (PixelPoint, PixelPoint)> + Clone) -> Option<Self> {
        let observe = |f: fn(PixelPoint) -> i32| {
            ImagePlane::fit(pairs.clone().map(move |(a, b)| Observation {
                at: a,
                value: f(b),
                weight: 1 << 14,
            }))
        };
        Some(Self { u: observe(|p| p.u)?, v: observe(|p| p.v)? })
    }

    /// Where a point goes. A map that was fitted takes |u|, |v| < 2^20 below 2^30 + 2^21: its slopes are at most 256,
    /// and no point lies more than 2^21 from the origin.
    pub const fn apply(&self, p: PixelPoint) -> PixelPoint {
        PixelPoint { u: self.u.at(p), v: self.v.at(p) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixed::PX;
    use crate::samples;

    #[test]
    fn a_plane_comes_back_in_spite_of_outliers() {
        let truth = |p: PixelPoint| 80 * PX + (p.u * 3 - p.v * 2) / 100;
        let points = (0..60i32).map(|k| PixelPoint { u: (k * 37 % 101) * PX, v: (k * 53 % 97) * PX });
        let seen = points.clone().enumerate().map(|(k, at)| {
            let value = if k % 7 == 3 { truth(at) + 25 * PX } else { truth(at) };
            Observation { at, value, weight: 1 << 14 }
        });
        let plane = ImagePlane::fit(seen).unwrap();
        assert!(points.into_iter().all(|p| (plane.at(p) - truth(p)).abs() < PX / 8), "{plane:?}");
    }

    #[test]
    fn extremes_do_not_overflow() {
        let corner = |s: i32| PixelPoint { u: s * (1 << 20), v: -s * (1 << 20) };
        let seen =
            [-1, 1, 1, -1].map(|s| Observation { at: corner(s), value: s * (1 << 20), weight: 1 << 14 });
        assert!(ImagePlane::fit(seen.iter().copied().cycle().take(samples(1 << 16, 1 << 8))).is_some());
        assert_eq!(ImagePlane::fit(core::iter::empty()), None);
    }
}
