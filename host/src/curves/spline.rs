//! The skeleton's branches as rational B-splines in space: the compact description, lifted out of the image.
//!
//! * **In**: a branch in (u, v, radius, disparity), px, as the core fits it, and the rectified cameras.
//! * **Out**: the same curve in (x, y, z, radius), mm, left camera's axes.
//! * **How**: with s = disparity + offset and baseline B, a point is ((u - cx), (v - cy), f) B / s and a radius
//!   rho B / s: a projective map, under which a rational curve stays one. Its control points are mapped as points are,
//!   and their weights multiplied by s (Piegl and Tiller 1997, "The NURBS Book", section 4.2): nothing is fitted again.
//! * **Not promised**: that the solid's balls lie on it. They are refined by more than a device sends, and under
//!   perspective the middle of a ball's image lies a little outside its centre's (`stage/balls.rs`).

use crate::stage::balls::px;
use crate::stage::rectify::RectifiedCamera;
use nalgebra::Point3;
use serde::{Deserialize, Serialize};
use shared::fixed::ONE;
use shared::pipeline::Branch;
use shared::stage::nurbs::Control;

/// All curves are cubic.
pub(crate) const DEGREE: usize = 3;
/// Digits of a millimetre, and of a weight, that are kept.
const PRECISION: f64 = 1e6;

/// A rational B-spline: every knot vector has `degree` + 1 more entries than there are control points, and the curve
/// runs from the knot numbered `degree` to the one as far from the end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spline {
    /// Of the polynomials.
    pub degree: usize,
    /// Whether it ends where it begins: then its first `degree` control points follow once more after the last.
    pub closed: bool,
    /// Nodes of the skeleton's graph at its ends: branches with a node in common meet there.
    pub nodes: [u16; 2],
    /// Uniform, in spans; clamped at the ends of an open curve.
    pub knots: Vec<i32>,
    /// Positive.
    pub weights: Vec<f64>,
    /// x, y, z and radius, mm, left camera's axes.
    pub controls: Vec<[f64; 4]>,
}

impl Spline {
    /// Whether its numbers are as many as they must be, finite, and in order.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let n = self.controls.len();
        let finite = self.controls.iter().flatten().all(|x| x.is_finite());
        (1..n).contains(&self.degree)
            && (self.weights.len(), self.knots.len()) == (n, n + self.degree + 1)
            && self.knots.is_sorted()
            && self.weights.iter().all(|weight| weight.is_finite() && *weight > 0.0)
            && finite
    }

    /// The curve of a branch, if there is one and all of it lies in front of the cameras.
    #[must_use]
    pub fn of(branch: &Branch, controls: &[Control], camera: &RectifiedCamera) -> Option<Self> {
        let curve = branch.curve(controls)?;
        let rounded = |x: f64| (x * PRECISION).round() / PRECISION;
        let lift = |control: &Control| {
            let ball = control.ball;
            let shift = px(ball.d) + camera.disparity_offset();
            let scale = camera.baseline_mm / shift;
            let at = Point3::new(px(ball.u) - camera.cx, px(ball.v) - camera.cy, camera.f) * scale;
            let at = camera.to_left_camera(at);
            let lifted = [at.x, at.y, at.z, px(ball.rho) * scale].map(rounded);
            (shift > 0.0).then_some((lifted, f64::from(control.weight) / f64::from(ONE) * shift))
        };
        let mut lifted: Vec<_> = curve.controls().iter().map(lift).collect::<Option<_>>()?;
        let knots = knots(lifted.len(), curve.closed());
        if curve.closed() {
            lifted.extend_from_within(..DEGREE);
        }
        // A common factor changes nothing; numbers near 1 read better.
        let first = lifted.first()?.1;
        Some(Self {
            degree: DEGREE,
            closed: curve.closed(),
            nodes: branch.nodes,
            knots,
            weights: lifted.iter().map(|(_, weight)| rounded(weight / first)).collect(),
            controls: lifted.into_iter().map(|(control, _)| control).collect(),
        })
    }
}

/// Clamped uniform knots of an open curve, periodic uniform ones of a closed curve.
pub(crate) fn knots(controls: usize, closed: bool) -> Vec<i32> {
    let (controls, degree) = (controls as i32, DEGREE as i32);
    if closed {
        return (-degree..=controls + degree).collect();
    }
    let spans = controls - degree;
    (-degree..=spans + degree).map(|knot| knot.clamp(0, spans)).collect()
}
