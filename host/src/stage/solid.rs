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
//! * **Cost**: n log n for n balls, where neighbours in the list are near one another (`runs.rs`).

use super::surface::RoundCone;
use crate::runs::{ROUNDED, Runs, Search};
use nalgebra::{Point3, Vector2};
use std::ops::Range;

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

/// Finds the balls that stick out, and keeps its memory for the next ones.
#[derive(Debug, Default)]
pub struct Outermost {
    /// The balls, largest first.
    order: Vec<usize>,
    kept: Vec<bool>,
    centres: Runs<3>,
    /// Radius of the largest ball kept under each node; less than any if there is none.
    reach: Vec<f64>,
}

impl Outermost {
    /// Leaves the balls that stick out of all larger ones, in their order; `pixel` is the size of a pixel at the
    /// object, mm.
    pub fn keep(&mut self, balls: &mut Vec<SolidBall>, pixel: f64) {
        self.order.clear();
        self.order.extend(0..balls.len());
        self.order.sort_unstable_by(|&a, &b| balls[b].radius.total_cmp(&balls[a].radius).then(a.cmp(&b)));
        self.centres.build(balls.iter().map(|ball| ball.centre.coords.into()));
        self.kept.clear();
        self.kept.resize(balls.len(), false);
        self.reach.clear();
        self.reach.resize(self.centres.nodes(), f64::NEG_INFINITY);
        for &i in &self.order {
            let ball = &balls[i];
            let (kept, reach) = (&self.kept, &self.reach);
            let mut search = Around { balls, kept, reach, ball, slack: SLACK * pixel, found: false };
            self.centres.search(&ball.centre.coords.into(), &mut search);
            if !search.found {
                self.kept[i] = true;
                for node in self.centres.above(i) {
                    self.reach[node] = self.reach[node].max(ball.radius);
                }
            }
        }
        let mut kept = self.kept.iter();
        balls.retain(|_| kept.next() == Some(&true));
    }
}

/// Looks for a ball kept from which another one does not stick out.
struct Around<'a> {
    balls: &'a [SolidBall],
    kept: &'a [bool],
    reach: &'a [f64],
    ball: &'a SolidBall,
    slack: f64,
    found: bool,
}

impl Search for Around<'_> {
    fn enters(&self, node: usize, square: f64) -> bool {
        let reach = self.reach[node] + self.slack - self.ball.radius;
        !self.found && reach >= 0.0 && square <= reach * reach * ROUNDED
    }

    fn visit(&mut self, run: Range<usize>) {
        let holds = |larger: &SolidBall| {
            let reach = larger.radius + self.slack - self.ball.radius;
            (larger.centre - self.ball.centre).norm_squared() <= reach * reach
        };
        self.found = run.into_iter().any(|k| self.kept[k] && holds(&self.balls[k]));
    }
}

/// Fill `cones` with the round cones of a set of balls, in the order of their places.
pub fn solid(balls: &[SolidBall], chains: &[Chain], cones: &mut Vec<RoundCone>) {
    cones.clear();
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
}

/// Fill `cones` with the balls alone.
pub fn spheres(balls: &[SolidBall], cones: &mut Vec<RoundCone>) {
    cones.clear();
    cones.extend(balls.iter().map(|b| RoundCone { centres: [b.centre; 2], radii: [b.radius; 2] }));
}

/// Whether the axis runs on from one ball to the other.
fn joined(a: &SolidBall, b: &SolidBall) -> bool {
    (a.at - b.at).norm() <= NEAR_PX && (a.centre - b.centre).norm() <= a.radius.max(b.radius)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Each ball held against all larger ones that were kept.
    fn naive(balls: &[SolidBall], pixel: f64) -> Vec<SolidBall> {
        let mut order: Vec<usize> = (0..balls.len()).collect();
        order.sort_by(|&a, &b| balls[b].radius.total_cmp(&balls[a].radius));
        let mut kept: Vec<usize> = Vec::new();
        for i in order {
            let inside = |&k: &usize| {
                let reach = balls[k].radius + SLACK * pixel - balls[i].radius;
                (balls[k].centre - balls[i].centre).norm_squared() <= reach * reach
            };
            if !kept.iter().any(inside) {
                kept.push(i);
            }
        }
        kept.sort_unstable();
        kept.into_iter().map(|i| balls[i]).collect()
    }

    #[test]
    fn what_sticks_out_is_what_no_larger_ball_holds() {
        let mut random = Random::new(3);
        let mut outermost = Outermost::default();
        for (count, step, pixel) in
            [(0, 1.0, 1.0), (1, 1.0, 1.0), (400, 0.3, 0.6), (400, 0.02, 0.0), (300, 30.0, 1.0)]
        {
            let mut walk = Point3::new(0.0, 0.0, 500.0);
            let mut ball = |place: usize| {
                walk += nalgebra::Vector3::from_fn(|_, _| step * random.normal());
                // Some radii coincide.
                let radius = 5.0
                    + (4.0 * random.uniform()).floor()
                    + if place.is_multiple_of(2) { random.normal() } else { 0.0 };
                SolidBall { centre: walk, radius, at: walk.coords.xy(), place }
            };
            let balls: Vec<SolidBall> = (0..count).map(&mut ball).collect();
            let mut kept = balls.clone();
            outermost.keep(&mut kept, pixel);
            assert!(kept == naive(&balls, pixel), "{count} balls, {step} mm apart");
        }
    }
}
