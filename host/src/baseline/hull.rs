//! The visual hull of two silhouettes (Laurentini 1994): all that both cones of rays share.
//!
//! Two eyes side by side leave it open along the rays: it reaches many times its width into depth. So it
//! gets the same chance as a person's guess: it is cut to be no deeper than the lesser of its width and
//! height, about the depth of the silhouettes' centroids.

use nalgebra::Point3;

use super::Outline;
use crate::mesh::Mesh;
use crate::shape::isosurface::isosurface;
use crate::stage::rectify::RectifiedCamera;

/// Brings the slope of the field below 1: linear interpolation between pixels and slanting rays make it
/// steeper than the distance in the image.
const SLOPE: f64 = 0.5;

/// The hull of the left and the right outline in cells of `cell` mm; empty if no depth explains both.
#[must_use]
pub fn visual_hull(outlines: [&Outline; 2], camera: &RectifiedCamera, cell: f64) -> Mesh {
    let Some([near, far]) = depths(outlines, camera) else { return Mesh::default() };
    let corners = outlines[0].bounds().map(|p| camera.ray(p.x, p.y));
    let bounds = [near, far].into_iter().flat_map(|z| corners.map(|ray| Point3::from(ray * z)));
    let (low, high) = bounds
        .fold((Point3::from([f64::MAX; 3]), Point3::from([f64::MIN; 3])), |(l, h), p| (l.inf(&p), h.sup(&p)));
    let scale = SLOPE * near / camera.f;
    let field = |p: &Point3<f64>| {
        let depth = (near - p.z).max(p.z - far);
        camera.project(p).map_or(depth, |pixels| {
            let outside = outlines[0].at(&pixels[0]).max(outlines[1].at(&pixels[1]));
            depth.max(outside * scale)
        })
    };
    isosurface(&field, [low, high], cell)
}

/// The nearest and the farthest depth that the hull is cut at, mm.
fn depths([left, right]: [&Outline; 2], camera: &RectifiedCamera) -> Option<[f64; 2]> {
    let [low, high] = left.bounds();
    let depth = camera.depth(left.centroid().x - right.centroid().x)?;
    let half = (high - low).min() / 2.0 * depth / camera.f;
    Some([(depth - half).max(depth / 2.0), depth + half])
}
