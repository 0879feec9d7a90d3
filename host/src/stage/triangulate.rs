//! Triangulation: the point in space whose images a pair of pixels are (paper section 4.2, its reference 10).
//!
//! In a rectified pair a match that lies on one row is triangulated exactly by Z = f B / d. The paper's
//! matches do not keep to rows. Of all pairs of points on a common row, the least-squares nearest to such
//! a match has the mean of both rows (Hartley and Sturm's optimum, which Lindstrom 2010 computes for general
//! pairs, has this closed form in rectified ones), so rows are averaged.

use super::rectify::RectifiedCamera;
use nalgebra::{Point3, Vector2};

/// The point that the left image shows at `left` and the right one at `right`, px; rectified axes, mm.
/// Nothing unless it is in front of the cameras.
pub fn triangulate(camera: &RectifiedCamera, left: Vector2<f64>, right: Vector2<f64>) -> Option<Point3<f64>> {
    camera.point(left.x, (left.y + right.y) / 2.0, left.x - right.x)
}
