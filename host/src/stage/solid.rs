//! The solid: which balls are joined to round cones.
//!
//! The union of balls of the paper's section 4.2 has dents between neighbouring centres. The medial axis
//! runs on between them, so the convex hull of two neighbouring balls, a round cone, belongs to the
//! object as well. Neighbours are balls grown from neighbouring contour points, or next to each other on a
//! curve, whose centres lie close in the image and in depth: where the axis branches or jumps there is no
//! cone.
//!
//! Contour points around a round part of the object all have nearly the same ball. Those that stick out of
//! a larger one by less than a twentieth of a pixel add nothing but the noise of their radii and are left out: a
//! sphere keeps a few balls instead of hundreds.
//!
//! * **Cost**: number of balls times balls kept.

use super::surface::RoundCone;
use nalgebra::{Point3, Vector2};

/// A ball in space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolidBall {
    /// Centre, mm.
    pub centre: Point3<f64>,
    /// Radius, mm.
    pub radius: f64,
    /// Centre of its image in the left view, px.
    pub at: Vector2<f64>,
    /// Its place among the places of all chains.
    pub place: usize,
}

/// A run of places whose balls follow one another: a contour loop or a curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Chain {
    /// First place.
    pub start: usize,
    /// Number of places.
    pub len: usize,
    /// Whether the first place follows the last.
    pub closed: bool,
}

/// Centres farther apart in the image are no neighbours, px.
const NEAR_PX: f64 = 3.0;
/// Places between neighbours at most: some have no ball.
const NEAR_PLACES: usize = 3;

/// How far a ball may stick out of a larger one and still be left out, as a part of a pixel there.
const SLACK: f64 = 0.05;

/// The balls that stick out of all larger ones, in their order; `pixel` is the size of a pixel at the
/// object, mm.
pub fn outermost(balls: &[SolidBall], pixel: f64) -> Vec<SolidBall> {
    let mut by_radius: Vec<usize> = (0..balls.len()).collect();
    by_radius.sort_by(|&a, &b| balls[b].radius.total_cmp(&balls[a].radius));
    let mut kept: Vec<usize> = Vec::new();
    for i in by_radius {
        let ball = &balls[i];
        let inside = |&k: &usize| {
            let reach = balls[k].radius + SLACK * pixel - ball.radius;
            (balls[k].centre - ball.centre).norm_squared() <= reach * reach
        };
        if !kept.iter().any(inside) {
            kept.push(i);
        }
    }
    kept.sort_unstable();
    kept.into_iter().map(|i| balls[i]).collect()
}

/// The round cones of a set of balls, in the order of their places.
pub fn solid(balls: &[SolidBall], chains: &[Chain]) -> Vec<RoundCone> {
    let mut cones = Vec::with_capacity(balls.len());
    for chain in chains {
        let from = balls.partition_point(|b| b.place < chain.start);
        let to = balls.partition_point(|b| b.place < chain.start + chain.len);
        let run = &balls[from..to];
        for (k, ball) in run.iter().enumerate() {
            let next = &run[(k + 1) % run.len()];
            let ahead = (next.place + chain.len - ball.place) % chain.len;
            let follows = ahead <= NEAR_PLACES && (chain.closed || next.place > ball.place);
            let end = if follows && joined(ball, next) { next } else { ball };
            cones.push(RoundCone { centres: [ball.centre, end.centre], radii: [ball.radius, end.radius] });
        }
    }
    cones
}

/// The balls alone, as round cones.
pub fn spheres(balls: &[SolidBall]) -> Vec<RoundCone> {
    balls.iter().map(|b| RoundCone { centres: [b.centre; 2], radii: [b.radius; 2] }).collect()
}

/// Whether the axis runs on from one ball to the other.
fn joined(a: &SolidBall, b: &SolidBall) -> bool {
    (a.at - b.at).norm() <= NEAR_PX && (a.centre - b.centre).norm() <= a.radius.max(b.radius)
}
