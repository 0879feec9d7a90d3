//! The visual hull of two silhouettes (Laurentini 1994): all that both cones of rays share.
//!
//! Two eyes side by side leave it open along the rays: an object wider than its disparity is explained by
//! points at any distance. So it is cut at the depths at which the left silhouette, moved by that depth's
//! disparity, still covers three quarters of the smaller of the two: any more generous cut makes it worse.

use nalgebra::Point3;

use super::Outline;
use crate::mesh::Mesh;
use crate::shape::isosurface::isosurface;
use crate::stage::rectify::RectifiedCamera;

/// Part of the smaller silhouette that both must share for a depth to be possible.
const SHARED: f64 = 0.75;
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

/// The nearest and the farthest possible depth, mm.
fn depths([left, right]: [&Outline; 2], camera: &RectifiedCamera) -> Option<[f64; 2]> {
    let pixels: Vec<_> = left.pixels().collect();
    let least = pixels.len().min(right.pixels().count()) as f64 * SHARED;
    let widest = left.bounds()[1].x - right.bounds()[0].x;
    let offset = camera.disparity_offset();
    let possible = |d: &f64| {
        let shift = nalgebra::Vector2::new(*d, 0.0);
        pixels.iter().filter(|p| right.at(&(*p - shift)) < 0.0).count() as f64 >= least
    };
    let first = (1.0 - offset).ceil() as i64;
    let disparities: Vec<f64> = (first..=widest.ceil() as i64).map(|d| d as f64).filter(possible).collect();
    Some([camera.depth(*disparities.last()?)?, camera.depth(*disparities.first()?)?])
}
