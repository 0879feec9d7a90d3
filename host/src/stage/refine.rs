//! Refinement: the depth at which a ball also touches the tangent planes of the right view
//! (docs/algorithm.md, step 22).
//!
//! A ball on the left ray m = (x, y, 1) with angular radius rho^ touches the plane through the right
//! camera and its contour tangent when N_R . (Z m - B e_x) = Z rho^, N_R the plane's unit normal pointing
//! inwards. Both contacts together give 1 / Z by least squares,
//!
//! ```text
//! 1 / Z = sum (N_R . m - rho^) (B N_Rx) / sum (B N_Rx)^2
//! ```
//!
//! blended with the first depth by w / (w + 0.05), w = sum N_Rx^2, and kept within 3 % of it. Solving
//! freely for the centre and the radius instead is ill-conditioned.

use super::balls::{Ball, Edge};
use super::rectify::RectifiedCamera;
use nalgebra::{Vector2, Vector3};

/// Most that the depth may change, as a part of it.
const LIMIT: f64 = 0.03;
/// Sum of N_Rx^2 at which both depths count alike.
const HALF_TRUST: f64 = 0.05;

/// Move each ball along its ray to where it touches the right view's tangent planes.
pub fn refine(camera: &RectifiedCamera, edges: &[Edge], balls: &mut [Ball]) {
    for ball in balls {
        if let Some(first) = camera.depth(ball.disparity) {
            let inverse = inverse_depth(camera, edges, ball, 1.0 / first);
            ball.disparity = camera.disparity(1.0 / inverse);
        }
    }
}

/// 1 / Z of a ball that was at `first`, 1/mm.
fn inverse_depth(camera: &RectifiedCamera, edges: &[Edge], ball: &Ball, first: f64) -> f64 {
    let contacts = ball.contacts.map(|k| &edges[k]);
    let left = |e: &Edge| plane(e.at - Vector2::new(camera.cx, camera.cy), e.normal, camera.f);
    let angular = contacts.iter().map(|e| left(e).dot(&ball.ray)).sum::<f64>() / 2.0;
    let (mut numerator, mut denominator) = (0.0, 0.0);
    for e in contacts.iter().filter(|e| e.weight > 0.0) {
        let at = e.at - Vector2::new(e.disparity + camera.cx_right, camera.cy);
        let normal = plane(at, e.normal_right, camera.f);
        let moved = camera.baseline_mm * normal.x;
        numerator += (normal.dot(&ball.ray) - angular) * moved;
        denominator += moved * moved;
    }
    let trust = denominator / (camera.baseline_mm * camera.baseline_mm);
    if trust <= 0.0 {
        return first;
    }
    let change = (numerator / denominator - first).clamp(-LIMIT * first, LIMIT * first);
    first + trust / (trust + HALF_TRUST) * change
}

/// Unit normal, pointing into the object, of the plane through a camera's centre and the tangent of its
/// contour at `at`, px from the principal point.
fn plane(at: Vector2<f64>, outward: Vector2<f64>, f: f64) -> Vector3<f64> {
    let ray = Vector3::new(at.x / f, at.y / f, 1.0);
    let tangent = Vector3::new(-outward.y, outward.x, 0.0);
    let normal = ray.cross(&tangent).normalize();
    if normal.xy().dot(&outward) > 0.0 { -normal } else { normal }
}
