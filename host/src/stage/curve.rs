//! Balls along the NURBS curves of the skeleton: the solid from the compact description alone.
//!
//! * **In**: the curves that the core fitted to the branches, in (u, v, rho, d).
//! * **Out**: balls a fixed step of arc apart, in chains.
//! * **How**: a ball touches the contour at the point nearest to its centre, and at the nearest of those
//!   seen more than 73 degrees from there. Its depth is as well known as the contacts', but at least
//!   a quarter: the fit has averaged along the curve already.
//! * **Cost**: number of balls times contour length.

use super::balls::{Ball, Edge, centre_ray, px, px2};
use super::rectify::RectifiedCamera;
use super::solid::Chain;
use nalgebra::Vector2;
use shared::fixed::PX;
use shared::pipeline::Branch;
use shared::stage::branch;
use shared::stage::nurbs::Control;
use std::convert::Infallible;

/// Arc between balls, px.
const STEP: i32 = 2;
/// Cosine of the least angle between both contacts, seen from the centre: 73 degrees.
const APART: f64 = 0.3;
/// Least trust in a ball's depth.
const LEAST_WEIGHT: f64 = 0.25;

/// The balls of all curves and the chain of each.
pub fn curve_balls(
    camera: &RectifiedCamera,
    edges: &[Edge],
    branches: &[Branch],
    controls: &[Control],
) -> (Vec<Ball>, Vec<Chain>) {
    let (mut balls, mut chains) = (Vec::new(), Vec::new());
    for branch in branches {
        let Some(curve) = branch.curve(controls) else { continue };
        let mut points: Vec<branch::Ball> = Vec::new();
        let Ok(()) = curve.sample::<Infallible>(STEP * PX, |ball| {
            points.push(ball);
            Ok(())
        });
        let start = balls.len();
        chains.push(Chain { start, len: points.len(), closed: branch.closed });
        for (k, point) in points.iter().enumerate() {
            let (at, rho) = (px2(point.at()), px(point.rho));
            let contacts = contacts(edges, at);
            let weight = contacts.iter().map(|&k| edges[k].weight).sum::<f64>() / 2.0;
            balls.push(Ball {
                at,
                rho,
                disparity: px(point.d),
                weight: weight.max(LEAST_WEIGHT),
                contacts,
                place: start + k,
                ray: centre_ray(camera, at, rho, edges[contacts[0]].at - edges[contacts[1]].at),
            });
        }
    }
    (balls, chains)
}

/// The contour points that a ball about `at` touches; the nearest twice if there is no other side.
fn contacts(edges: &[Edge], at: Vector2<f64>) -> [usize; 2] {
    let nearest = |counts: &dyn Fn(Vector2<f64>) -> bool| {
        let candidates = (0..edges.len()).filter(|&k| counts(edges[k].at - at));
        candidates
            .min_by(|&a, &b| (edges[a].at - at).norm_squared().total_cmp(&(edges[b].at - at).norm_squared()))
    };
    let first = nearest(&|_| true).unwrap_or(0);
    let towards = (edges[first].at - at).try_normalize(0.0).unwrap_or_default();
    [first, nearest(&|way| way.dot(&towards) < APART * way.norm()).unwrap_or(first)]
}
