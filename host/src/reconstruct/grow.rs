//! The solid of a shape: balls, their depth refined and smoothed, and how far they reach.
//!
//! * **In**: what the core says of an object ([`Described`]), whether it ran here or on a device, and the
//!   rectified cameras. **Out**: round cones and curves in rectified axes, mm, in a [`Growth`], which is filled anew
//!   by each object and allocates nothing once its lists are long enough.

use super::{Clock, Options, Pieces, Profile, Radius, Skeleton};
use crate::curves::Curves;
use crate::runs::Runs;
use crate::stage::balls::{self, Ball, Edge, Rays, distance_to_points, px2};
use crate::stage::curve::curve_balls;
use crate::stage::rectify::RectifiedCamera;
use crate::stage::refine::refine;
use crate::stage::simplify::simplify;
use crate::stage::smooth::Smoother;
use crate::stage::solid::{Chain, Outermost, SolidBall, solid, spheres};
use crate::stage::surface::RoundCone;
use nalgebra::Point3;
use shared::pipeline::{Memory, Outcome};
use shared::stage::branch::Sample;
use shared::stage::contour::ContourLoop;
use shared::stage::depth::BallDepth;
use shared::stage::medial::MedialBall;
use shared::wire::Shape;

/// So far the solid may move when its round cones become fewer, as a part of a pixel: what balls may stick out
/// of others and be left out, and less than their noise.
const TOLERANCE: f64 = 0.05;

/// A shape and what follows from it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Described<'a> {
    shape: Shape<'a>,
    /// Samples of its branches.
    samples: &'a [Sample],
    /// Its medial balls.
    balls: &'a [MedialBall],
    /// One a ball.
    depths: &'a [BallDepth],
}

impl<'a> Described<'a> {
    /// What stands in the core's memory after a run of the default method, or after
    /// [`resume`](shared::pipeline::resume).
    pub(super) fn of(memory: &'a Memory<'_>, outcome: &'a Outcome) -> Self {
        Self {
            shape: Shape::of(memory, outcome),
            samples: memory.eyes[0].samples,
            balls: memory.balls,
            depths: memory.depths,
        }
    }
}

/// The solid, and all that it grows from.
#[derive(Debug, Default)]
pub(super) struct Growth {
    /// The solid.
    pub(super) cones: Vec<RoundCone>,
    /// The curve skeleton.
    pub(super) skeleton: Curves,
    /// The boundary in space.
    pub(super) boundary: Curves,
    edges: Vec<Edge>,
    balls: Vec<Ball>,
    chains: Vec<Chain>,
    smoother: Smoother,
    rays: Rays,
    /// Points of an image among which the nearest is looked for.
    pub(super) image_runs: Runs<2>,
    /// Points in space among which the nearest is looked for.
    pub(super) runs: Runs<3>,
    pub(super) solid_balls: Vec<SolidBall>,
    pub(super) outermost: Outermost,
}

impl Growth {
    /// Grow the solid.
    pub(super) fn grow(
        &mut self,
        camera: &RectifiedCamera,
        described: &Described<'_>,
        options: &Options,
        clock: &mut Clock,
    ) {
        let shape = &described.shape;
        balls::edges(shape.contour, shape.matches, &mut self.edges);
        self.lift(camera, described, options.skeleton);
        if options.profile == Profile::Full {
            refine(camera, &self.edges, &mut self.balls);
        }
        clock.lap("refine");
        self.smoother.smooth(&mut self.balls, &shape.outcome.plane);
        clock.lap("smooth");
        boundary(camera, shape.loops, &self.edges, &mut self.boundary);
        self.inflate(camera, options.radius);
        clock.lap("radii");
        self.thread(described);
        let pixel = self.solid_balls.iter().map(|b| b.centre.z / camera.f).fold(f64::INFINITY, f64::min);
        self.outermost.keep(&mut self.solid_balls, pixel);
        match options.pieces {
            Pieces::Cones => solid(&self.solid_balls, &self.chains, &mut self.cones),
            Pieces::Balls => spheres(&self.solid_balls, &mut self.cones),
        }
        simplify(&mut self.cones, TOLERANCE * pixel);
    }

    /// The balls that the solid is made of, and their chains.
    fn lift(&mut self, camera: &RectifiedCamera, described: &Described<'_>, skeleton: Skeleton) {
        let Self { edges, balls, chains, image_runs, .. } = self;
        let shape = &described.shape;
        match skeleton {
            Skeleton::Full => {
                let chain = |l: &ContourLoop| Chain { start: l.start, len: l.len, closed: true };
                balls::balls(camera, edges, (described.balls, described.depths), balls);
                chains.clear();
                chains.extend(shape.loops.iter().map(chain));
            }
            Skeleton::Nurbs => {
                image_runs.build(edges.iter().map(|edge| edge.at.into()));
                let curves = (shape.branches, shape.controls);
                curve_balls(camera, (edges, image_runs), curves, (balls, chains));
            }
        }
    }

    /// The balls in space, as far as they are in front of the cameras and reach anywhere.
    fn inflate(&mut self, camera: &RectifiedCamera, radius: Radius) {
        let Self { boundary, rays, runs, solid_balls, .. } = self;
        match radius {
            Radius::Rays => rays.build(camera, &self.edges),
            Radius::Boundary => runs.build(boundary.points.iter().map(|p| p.coords.into())),
            Radius::Transform => {}
        }
        let reach = |ball: &Ball, centre: &Point3<f64>| match radius {
            Radius::Rays => rays.distance(centre),
            Radius::Boundary => distance_to_points(&boundary.points, runs, centre),
            Radius::Transform => ball.rho * centre.z / camera.f.hypot(ball.rho),
        };
        let solid_ball = |ball: &Ball| {
            let centre = ball.centre(camera)?;
            let radius = reach(ball, &centre);
            let solid = SolidBall { centre, radius, at: ball.at, place: ball.place };
            (radius.is_finite() && radius > 0.0).then_some(solid)
        };
        solid_balls.clear();
        solid_balls.extend(self.balls.iter().filter_map(solid_ball));
    }

    /// The branches of the skeleton, threaded through the solid's balls.
    fn thread(&mut self, described: &Described<'_>) {
        let Self { skeleton: curves, solid_balls: balls, image_runs, .. } = self;
        image_runs.build(balls.iter().map(|ball| ball.at.into()));
        curves.clear();
        for branch in described.shape.branches {
            let first = curves.points.len() as u32;
            let samples = &described.samples[branch.samples..branch.samples + branch.sample_count];
            for sample in samples {
                let at = px2(sample.ball.at());
                let square = |k: usize| (balls[k].at - at).norm_squared();
                if let Some((nearest, _)) = image_runs.nearest(&at.into(), 1.0, square) {
                    curves.points.push(balls[nearest].centre);
                    curves.radii.push(balls[nearest].radius);
                }
            }
            let last = curves.points.len() as u32;
            curves.edges.extend((first + 1..last).map(|k| [k - 1, k]));
            if branch.closed && last > first {
                curves.edges.push([last - 1, first]);
            }
        }
    }
}

/// The boundary in space: each contour point at its disparity.
fn boundary(camera: &RectifiedCamera, loops: &[ContourLoop], edges: &[Edge], curves: &mut Curves) {
    curves.clear();
    for l in loops {
        let first = curves.points.len() as u32;
        let points = edges[l.range()].iter().filter(|e| e.weight > 0.0);
        curves.points.extend(points.filter_map(|e| camera.point(e.at.x, e.at.y, e.disparity)));
        let last = curves.points.len() as u32;
        curves.edges.extend((first + 1..last).map(|k| [k - 1, k]));
        if last > first + 2 {
            curves.edges.push([last - 1, first]);
        }
    }
}
