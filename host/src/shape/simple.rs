//! Ball, torus and capsule: solids whose volume and outline are known in closed form.

use nalgebra::{Matrix3, Point3};

use super::field::Tapered;
use super::{Solid, turn};

pub(super) fn sphere() -> Solid {
    Solid {
        field: Box::new(|p| p.coords.norm() - 60.0),
        low: Point3::new(-60.0, -60.0, -60.0),
        high: Point3::new(60.0, 60.0, 60.0),
        turn: Matrix3::identity(),
    }
}

/// The torus around z, tilted about a diagonal of the image so that no axis of the image is special.
pub(super) fn torus(tilt_degrees: f64) -> Solid {
    Solid {
        field: Box::new(|p| {
            let from_ring = p.coords.xy().norm() - 40.0;
            (from_ring * from_ring + p.z * p.z).sqrt() - 20.0
        }),
        low: Point3::new(-60.0, -60.0, -20.0),
        high: Point3::new(60.0, 60.0, 20.0),
        turn: turn([1.0, 1.0, 0.0], tilt_degrees),
    }
}

pub(super) fn capsule() -> Solid {
    let axis =
        Tapered { ends: [Point3::new(-45.0, 0.0, 0.0), Point3::new(45.0, 0.0, 0.0)], radii: [30.0, 30.0] };
    Solid {
        field: Box::new(move |p| axis.at(p)),
        low: Point3::new(-75.0, -30.0, -30.0),
        high: Point3::new(75.0, 30.0, 30.0),
        turn: turn([0.0, 0.0, 1.0], 30.0) * turn([0.0, 1.0, 0.0], -20.0),
    }
}
