//! One silhouette inflated: every disc inside it becomes a ball, all at one depth.
//!
//! About the plane at the object's mean depth Z, a point of the left image at distance D (px) inside the
//! outline carries a ball of radius D Z / f; the solid is their union:
//!
//! ```text
//! half thickness^2 (q) = max over p of (D(p)^2 - |q - p|^2) (Z / f)^2,
//! Z = f B / d,   d the disparity of the silhouettes' centroids
//! ```
//!
//! A disc becomes a ball, a strip of even width a cylinder; depth does not vary along the object. It is what
//! is left of the method when the second view gives one number.

use nalgebra::Point3;

use super::Outline;
use crate::mesh::Mesh;
use crate::mesh::body::Bodies;
use crate::stage::rectify::RectifiedCamera;
use crate::stage::solid::{Outermost, SolidBall, spheres};
use crate::stage::surface::surface;

/// The left outline inflated, in cells of `cell` mm; empty if the centroids lie behind the cameras.
#[must_use]
pub fn inflation([left, right]: [&Outline; 2], camera: &RectifiedCamera, cell: f64) -> Mesh {
    let disparity = left.centroid().x - right.centroid().x;
    let Some(depth) = camera.depth(disparity) else { return Mesh::default() };
    let pixel = depth / camera.f;
    let ball = |(place, at): (usize, nalgebra::Point2<f64>)| SolidBall {
        centre: Point3::from(camera.ray(at.x, at.y) * depth),
        radius: -left.at(&at) * pixel,
        at: at.coords,
        place,
    };
    let mut balls: Vec<SolidBall> = left.pixels().enumerate().map(ball).filter(|b| b.radius > 0.0).collect();
    Outermost::default().keep(&mut balls, pixel);
    let mut cones = Vec::new();
    spheres(&balls, &mut cones);
    let mut inflated = surface(&cones, cell).unwrap_or_default();
    Bodies::default().keep_largest(&mut inflated);
    inflated
}
