//! Balls along the NURBS curves of the skeleton: the solid from the compact description alone.
//!
//! * **In**: the curves that the core fitted to the branches, in (u, v, rho, d).
//! * **Out**: balls a fixed step of arc apart, in chains.
//! * **How**: a ball touches the contour at the point nearest to its centre, and at the nearest of those
//!   seen more than 73 degrees from there. Its depth is as well known as the contacts', but at least
//!   a quarter: the fit has averaged along the curve already.
//! * **Cost**: a search of the contour's runs (`runs.rs`) a ball.

use super::balls::{Ball, Edge, centre_ray, px, px2};
use super::rectify::RectifiedCamera;
use super::solid::Chain;
use crate::runs::Runs;
use nalgebra::Vector2;
use shared::fixed::PX;
use shared::pipeline::Branch;
use shared::stage::nurbs::Control;
use std::convert::Infallible;

/// Arc between balls, px.
const STEP: i32 = 2;
/// Cosine of the least angle between both contacts, seen from the centre: 73 degrees.
const APART: f64 = 0.3;
/// Least trust in a ball's depth.
const LEAST_WEIGHT: f64 = 0.25;

/// Fill `balls` with those of all curves and `chains` with the chain of each; `runs` are those of the edges.
pub fn curve_balls(
    camera: &RectifiedCamera,
    (edges, runs): (&[Edge], &Runs<2>),
    (branches, controls): (&[Branch], &[Control]),
    (balls, chains): (&mut Vec<Ball>, &mut Vec<Chain>),
) {
    balls.clear();
    chains.clear();
    // Only a spoilt message has curves and no contour: they touch nothing.
    if edges.is_empty() {
        return;
    }
    for branch in branches {
        let Some(curve) = branch.curve(controls) else { continue };
        let start = balls.len();
        let Ok(()) = curve.sample::<Infallible>(STEP * PX, |point| {
            let (at, rho) = (px2(point.at()), px(point.rho));
            let contacts = contacts(edges, runs, at);
            let weight = contacts.iter().map(|&k| edges[k].weight).sum::<f64>() / 2.0;
            balls.push(Ball {
                at,
                rho,
                disparity: px(point.d),
                weight: weight.max(LEAST_WEIGHT),
                contacts,
                place: balls.len(),
                ray: centre_ray(camera, at, rho, edges[contacts[0]].at - edges[contacts[1]].at),
            });
            Ok(())
        });
        chains.push(Chain { start, len: balls.len() - start, closed: branch.closed });
    }
}

/// The contour points that a ball about `at` touches; the nearest twice if there is no other side.
fn contacts(edges: &[Edge], runs: &Runs<2>, at: Vector2<f64>) -> [usize; 2] {
    let nearest = |counts: &dyn Fn(Vector2<f64>) -> bool| {
        let square = |k: usize| {
            let way = edges[k].at - at;
            if counts(way) { way.norm_squared() } else { f64::INFINITY }
        };
        runs.nearest(&at.into(), 1.0, square).map(|(k, _)| k)
    };
    let first = nearest(&|_| true).unwrap_or(0);
    let towards = (edges[first].at - at).try_normalize(0.0).unwrap_or_default();
    [first, nearest(&|way| way.dot(&towards) < APART * way.norm()).unwrap_or(first)]
}
