//! The paper's solid.

use super::Grown;
use crate::curves::Curves;
use crate::stage::balls::{distance_to_points, px2};
use crate::stage::rectify::RectifiedCamera;
use crate::stage::solid::{SolidBall, outermost, spheres};
use crate::stage::triangulate::triangulate;
use nalgebra::Point3;
use shared::pipeline::Memory;
use shared::stage::nearest::Pair;

/// Triangulated pairs, and a sphere about each skeleton point that reaches to the
/// nearest boundary point.
pub(super) fn grow(camera: &RectifiedCamera, memory: &Memory<'_>) -> Grown {
    let lift = |pairs: &[Pair]| -> Vec<Point3<f64>> {
        pairs.iter().filter_map(|p| triangulate(camera, px2(p.left), px2(p.right))).collect()
    };
    let boundary = Curves { points: lift(memory.boundary_pairs), ..Curves::default() };
    let centres = lift(memory.skeleton_pairs);
    let radii: Vec<f64> = centres.iter().map(|c| distance_to_points(&boundary.points, c)).collect();
    let ball = |(place, (&centre, &radius)): (usize, (&Point3<f64>, &f64))| {
        let [left, _] = camera.project(&centre)?;
        let ball = SolidBall { centre, radius, at: left.coords, place };
        (radius.is_finite() && radius > 0.0).then_some(ball)
    };
    let balls: Vec<SolidBall> = centres.iter().zip(&radii).enumerate().filter_map(ball).collect();
    Grown {
        cones: spheres(&outermost(&balls, 0.0)),
        skeleton: Curves { points: centres, radii, edges: Vec::new() },
        boundary,
    }
}
