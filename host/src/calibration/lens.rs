//! From the image of a ray back to the ray: the inverse of [`Lens::bend`], which the core has no use for.
//!
//! Newton's method on normalised points, from the image itself, with the derivatives of the lens models, of which
//! `shared/src/camera.rs` names the sources.

use nalgebra::{Matrix2, Point2, Vector2};
use shared::camera::Lens;

/// Newton's method doubles the digits at each step; a lens that needs more has folded.
const MAX_STEPS: usize = 40;
/// Residual at which the inverse has converged: 1e-9 px at a focal length of 10,000 px.
const CONVERGED: f64 = 1e-13;

/// The normalised point whose image is `bent`, or nothing when the iteration does not converge on the sheet that
/// holds the optical axis: there the lens model folds over, or the ray stands at right angles to the axis or beyond.
pub(super) fn unbend(lens: &Lens, bent: Point2<f64>) -> Option<Point2<f64>> {
    match lens {
        _ if *lens == Lens::NONE => Some(bent),
        Lens::Polynomial(k) => {
            let mut ideal = bent.coords;
            for _ in 0..MAX_STEPS {
                let (residual, jacobian) = (lens.bend(ideal) - bent.coords, jacobian(k, ideal));
                if !(jacobian.determinant() > 0.0 && jacobian.trace() > 0.0) {
                    return None;
                }
                if residual.norm() <= CONVERGED * (1.0 + bent.coords.norm()) {
                    return Some(ideal.into());
                }
                ideal -= jacobian.try_inverse()? * residual;
            }
            None
        }
        Lens::Equidistant(k) => {
            // The angle alone changes, so the whole is found in one dimension.
            let target = bent.coords.norm();
            let mut theta = target;
            for _ in 0..MAX_STEPS {
                let (reached, slope) = equidistant(k, theta);
                if !(slope > 0.0 && theta.is_finite()) {
                    return None;
                }
                if (reached - target).abs() <= CONVERGED * (1.0 + target) {
                    let in_front = (0.0..std::f64::consts::FRAC_PI_2).contains(&theta);
                    let scale = if target == 0.0 { 1.0 } else { theta.tan() / target };
                    return in_front.then(|| bent * scale);
                }
                theta -= (reached - target) / slope;
            }
            None
        }
    }
}

/// The derivative of a polynomial lens by the ideal point.
fn jacobian(k: &[f64; 12], ideal: Vector2<f64>) -> Matrix2<f64> {
    let [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4] = *k;
    let (x, y) = (ideal.x, ideal.y);
    let r2 = x * x + y * y;
    let above = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    let below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6));
    let radial = above / below;
    let above_slope = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3);
    let below_slope = k4 + r2 * (2.0 * k5 + r2 * 3.0 * k6);
    let by_r2 = ideal * ((above_slope - radial * below_slope) / below)
        + Vector2::new(s1 + 2.0 * r2 * s2, s3 + 2.0 * r2 * s4);
    let mixed = 2.0 * (p1 * x + p2 * y);
    let direct = Matrix2::new(
        radial + 2.0 * p1 * y + 6.0 * p2 * x,
        mixed,
        mixed,
        radial + 6.0 * p1 * y + 2.0 * p2 * x,
    );
    direct + by_r2 * Vector2::new(2.0 * x, 2.0 * y).transpose()
}

/// The angle of an image, and its derivative by the angle of its ray.
fn equidistant(k: &[f64; 4], theta: f64) -> (f64, f64) {
    let t2 = theta * theta;
    let [k1, k2, k3, k4] = *k;
    let scale = 1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4)));
    let slope = 1.0 + t2 * (3.0 * k1 + t2 * (5.0 * k2 + t2 * (7.0 * k3 + t2 * 9.0 * k4)));
    (theta * scale, slope)
}
