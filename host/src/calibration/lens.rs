//! Lens distortion, and its inverse.
//!
//! Both work on normalised points: where the ray (x, y, 1) meets the plane at distance 1, no unit.
//! Sources: OpenCV 4 documentation, "Camera calibration and 3D reconstruction", for the rational and
//! thin-prism model; Kannala and Brandt, "A generic camera model" (2006), as in OpenCV's `fisheye`
//! and Kalibr's `equidistant`, for the other. A tilted sensor (OpenCV's 14 coefficients) is not
//! supported.

use nalgebra::{Matrix2, Point2, Vector2};

/// Newton's method doubles the digits at each step; a lens that needs more has folded.
const MAX_STEPS: usize = 40;
/// Residual at which the inverse has converged: 1e-9 px at a focal length of 10,000 px.
const CONVERGED: f64 = 1e-13;

/// How a lens moves the image of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distortion {
    /// OpenCV's k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4: plumb-bob is the first five, rational the first
    /// eight, thin prism all twelve. Kalibr's `radtan` is the first four.
    Polynomial([f64; 12]),
    /// k1..k4 of theta (1 + k1 theta^2 + k2 theta^4 + ..), with theta the angle to the optical axis.
    Equidistant([f64; 4]),
}

impl Distortion {
    /// A perfect pinhole.
    pub const NONE: Self = Self::Polynomial([0.0; 12]);

    /// Whether every ray stays where it is.
    #[must_use]
    pub fn is_none(&self) -> bool {
        *self == Self::NONE
    }

    /// The distorted place of a normalised point.
    #[must_use]
    #[inline]
    pub fn apply(&self, ideal: Point2<f64>) -> Point2<f64> {
        match self {
            Self::Polynomial(k) => polynomial(k, ideal).0,
            Self::Equidistant(k) => {
                let radius = ideal.coords.norm();
                if radius == 0.0 { ideal } else { ideal * (equidistant(k, radius.atan()).0 / radius) }
            }
        }
    }

    /// The normalised point whose distorted place is `distorted`, or nothing when the iteration does
    /// not converge on the sheet that holds the optical axis: there the lens model folds over, or the
    /// ray stands at right angles to the axis or beyond.
    #[must_use]
    pub fn remove(&self, distorted: Point2<f64>) -> Option<Point2<f64>> {
        match self {
            _ if self.is_none() => Some(distorted),
            Self::Polynomial(k) => {
                let mut ideal = distorted;
                for _ in 0..MAX_STEPS {
                    let (reached, jacobian) = polynomial(k, ideal);
                    let residual = reached - distorted;
                    if !(jacobian.determinant() > 0.0 && jacobian.trace() > 0.0) {
                        return None;
                    }
                    if residual.norm() <= CONVERGED * (1.0 + distorted.coords.norm()) {
                        return Some(ideal);
                    }
                    ideal -= jacobian.try_inverse()? * residual;
                }
                None
            }
            Self::Equidistant(k) => {
                let target = distorted.coords.norm();
                let mut theta = target;
                for _ in 0..MAX_STEPS {
                    let (reached, slope) = equidistant(k, theta);
                    if !(slope > 0.0 && theta.is_finite()) {
                        return None;
                    }
                    if (reached - target).abs() <= CONVERGED * (1.0 + target) {
                        let in_front = (0.0..std::f64::consts::FRAC_PI_2).contains(&theta);
                        let scale = if target == 0.0 { 1.0 } else { theta.tan() / target };
                        return in_front.then(|| distorted * scale);
                    }
                    theta -= (reached - target) / slope;
                }
                None
            }
        }
    }
}

/// The distorted point and its derivative by the ideal one, which costs nothing where it is not used.
#[inline(always)]
fn polynomial(k: &[f64; 12], ideal: Point2<f64>) -> (Point2<f64>, Matrix2<f64>) {
    let [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4] = *k;
    let (x, y) = (ideal.x, ideal.y);
    let r2 = x * x + y * y;
    let above = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    let below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6));
    let radial = above / below;
    let tangential =
        Vector2::new(2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x), p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y);
    let prism = Vector2::new(r2 * (s1 + r2 * s2), r2 * (s3 + r2 * s4));
    let distorted = ideal * radial + tangential + prism;

    let above_slope = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3);
    let below_slope = k4 + r2 * (2.0 * k5 + r2 * 3.0 * k6);
    let by_r2 = ideal.coords * ((above_slope - radial * below_slope) / below)
        + Vector2::new(s1 + 2.0 * r2 * s2, s3 + 2.0 * r2 * s4);
    let mixed = 2.0 * (p1 * x + p2 * y);
    let direct = Matrix2::new(
        radial + 2.0 * p1 * y + 6.0 * p2 * x,
        mixed,
        mixed,
        radial + 6.0 * p1 * y + 2.0 * p2 * x,
    );
    (distorted, direct + by_r2 * Vector2::new(2.0 * x, 2.0 * y).transpose())
}

/// The distorted angle and its derivative.
fn equidistant(k: &[f64; 4], theta: f64) -> (f64, f64) {
    let t2 = theta * theta;
    let [k1, k2, k3, k4] = *k;
    let scale = 1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4)));
    let slope = 1.0 + t2 * (3.0 * k1 + t2 * (5.0 * k2 + t2 * (7.0 * k3 + t2 * 9.0 * k4)));
    (theta * scale, slope)
}
