//! The solid of a shape: balls, their depth refined and smoothed, and how far they reach.
//!
//! * **In**: what the core says of an object ([`Described`]), whether it ran here or on a device, and the
//!   rectified cameras. **Out**: round cones and curves in rectified axes, mm.

use super::{Clock, Grown, Options, Pieces, Profile, Radius, Skeleton};
use crate::curves::Curves;
use crate::stage::balls::{self, Ball, Edge, boundary_rays, distance_to_points, distance_to_rays, px2};
use crate::stage::curve::curve_balls;
use crate::stage::rectify::RectifiedCamera;
use crate::stage::refine::refine;
use crate::stage::smooth::smooth;
use crate::stage::solid::{Chain, SolidBall, outermost, solid, spheres};
use nalgebra::Point3;
use shared::pipeline::{Memory, Outcome};
use shared::stage::branch::Sample;
use shared::stage::contour::ContourLoop;
use shared::stage::depth::BallDepth;
use shared::stage::medial::MedialBall;
use shared::wire::Shape;

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

/// Grow the solid.
pub(super) fn grow(
    camera: &RectifiedCamera,
    described: &Described<'_>,
    options: &Options,
    clock: &mut Clock,
) -> Grown {
    let shape = &described.shape;
    let edges = balls::edges(shape.contour, shape.matches);
    let (mut grown, chains) = match options.skeleton {
        Skeleton::Full => {
            let chain = |l: &ContourLoop| Chain { start: l.start, len: l.len, closed: true };
            let all = balls::balls(camera, &edges, described.balls, described.depths);
            (all, shape.loops.iter().map(chain).collect())
        }
        Skeleton::Nurbs => curve_balls(camera, &edges, shape.branches, shape.controls),
    };
    if options.profile == Profile::Full {
        refine(camera, &edges, &mut grown);
    }
    clock.lap("refine");
    smooth(&mut grown, &shape.outcome.plane);
    clock.lap("smooth");
    let boundary = boundary(camera, shape.loops, &edges);
    let rays = boundary_rays(camera, &edges);
    let reach = |ball: &Ball, centre: &Point3<f64>| match options.radius {
        Radius::Rays => distance_to_rays(&rays, centre),
        Radius::Boundary => distance_to_points(&boundary.points, centre),
        Radius::Transform => ball.rho * centre.z / camera.f.hypot(ball.rho),
    };
    let solid_ball = |ball: &Ball| {
        let centre = ball.centre(camera)?;
        let radius = reach(ball, &centre);
        let solid = SolidBall { centre, radius, at: ball.at, place: ball.place };
        (radius.is_finite() && radius > 0.0).then_some(solid)
    };
    let solid_balls: Vec<SolidBall> = grown.iter().filter_map(solid_ball).collect();
    clock.lap("radii");
    let pixel = solid_balls.iter().map(|b| b.centre.z / camera.f).fold(f64::INFINITY, f64::min);
    let outermost = outermost(&solid_balls, pixel);
    let cones = match options.pieces {
        Pieces::Cones => solid(&outermost, &chains),
        Pieces::Balls => spheres(&outermost),
    };
    Grown { cones, skeleton: skeleton(described, &solid_balls), boundary }
}

/// The branches of the skeleton through the solid's balls.
fn skeleton(described: &Described<'_>, balls: &[SolidBall]) -> Curves {
    let mut curves = Curves::default();
    for branch in described.shape.branches {
        let first = curves.points.len() as u32;
        let samples = &described.samples[branch.samples..branch.samples + branch.sample_count];
        for sample in samples {
            let at = px2(sample.ball.at());
            let nearest =
                balls.iter().min_by(|a, b| (a.at - at).norm_squared().total_cmp(&(b.at - at).norm_squared()));
            if let Some(ball) = nearest {
                curves.points.push(ball.centre);
                curves.radii.push(ball.radius);
            }
        }
        let last = curves.points.len() as u32;
        curves.edges.extend((first + 1..last).map(|k| [k - 1, k]));
        if branch.closed && last > first {
            curves.edges.push([last - 1, first]);
        }
    }
    curves
}

/// The boundary in space: each contour point at its disparity.
fn boundary(camera: &RectifiedCamera, loops: &[ContourLoop], edges: &[Edge]) -> Curves {
    let mut curves = Curves::default();
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
    curves
}
