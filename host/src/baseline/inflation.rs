//! One silhouette inflated: the distance transform taken for half the thickness.
//!
//! About the plane at the object's mean depth Z, a point of the left image at distance D (px) inside the
//! outline is D Z / f thick to either side:
//!
//! ```text
//! |z - Z| <= D(u, v) Z / f,      Z = f B / d,   d the disparity of the silhouettes' centroids
//! ```
//!
//! A disc becomes a double cone, a strip of even width a roof; depth does not vary along the object.

use nalgebra::{Point3, Vector3};

use super::Outline;
use crate::mesh::Mesh;
use crate::shape::isosurface::isosurface;
use crate::stage::rectify::RectifiedCamera;

/// Brings the slope of the field below 1: depth and thickness both change along a slanting line.
const SLOPE: f64 = 0.4;

/// The left outline inflated, in cells of `cell` mm; empty if the centroids lie behind the cameras.
#[must_use]
pub fn inflation([left, right]: [&Outline; 2], camera: &RectifiedCamera, cell: f64) -> Mesh {
    let disparity = left.centroid().x - right.centroid().x;
    let Some(depth) = camera.depth(disparity) else { return Mesh::default() };
    let pixel = depth / camera.f;
    let thickest = left.pixels().map(|p| -left.at(&p)).fold(0.0, f64::max) * pixel + cell;
    let field = |p: &Point3<f64>| {
        let outside = camera.project(p).map_or(thickest, |[at, _]| left.at(&at) * pixel);
        SLOPE * (outside + (p.z - depth).abs())
    };
    let ends = [depth - thickest, depth + thickest];
    let corners =
        ends.into_iter().flat_map(|z| left.bounds().map(|p| Point3::from(camera.ray(p.x, p.y) * z)));
    let infinity = Point3::from(Vector3::repeat(f64::INFINITY));
    let (low, high) = corners.fold((infinity, -infinity), |(l, h), p| (l.inf(&p), h.sup(&p)));
    isosurface(&field, [low, high], cell)
}
