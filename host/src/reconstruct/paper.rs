//! The paper's solid.

use super::Growth;
use crate::stage::balls::{distance_to_points, px2};
use crate::stage::rectify::RectifiedCamera;
use crate::stage::solid::{SolidBall, spheres};
use crate::stage::triangulate::triangulate;
use nalgebra::Point3;
use shared::pipeline::Memory;
use shared::stage::nearest::Pair;

impl Growth {
    /// Triangulated pairs, and a sphere about each skeleton point that reaches to the nearest boundary point.
    pub(super) fn grow_as_paper(&mut self, camera: &RectifiedCamera, memory: &Memory<'_>) {
        let Self { boundary, skeleton, runs, solid_balls, .. } = self;
        let lift = |pairs: &[Pair], points: &mut Vec<Point3<f64>>| {
            points.extend(pairs.iter().filter_map(|p| triangulate(camera, px2(p.left), px2(p.right))));
        };
        boundary.clear();
        lift(memory.boundary_pairs, &mut boundary.points);
        skeleton.clear();
        lift(memory.skeleton_pairs, &mut skeleton.points);
        runs.build(boundary.points.iter().map(|p| p.coords.into()));
        let radius = |centre| distance_to_points(&boundary.points, runs, centre);
        skeleton.radii.extend(skeleton.points.iter().map(radius));
        let ball = |(place, (&centre, &radius)): (usize, (&Point3<f64>, &f64))| {
            let [left, _] = camera.project(&centre)?;
            let ball = SolidBall { centre, radius, at: left.coords, place };
            (radius.is_finite() && radius > 0.0).then_some(ball)
        };
        solid_balls.clear();
        solid_balls.extend(skeleton.points.iter().zip(&skeleton.radii).enumerate().filter_map(ball));
        self.outermost.keep(solid_balls, 0.0);
        spheres(solid_balls, &mut self.cones);
    }
}
