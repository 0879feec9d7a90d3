//! The computer mouse: two swells, a waist between them, a flat base and a wheel.

use nalgebra::{Point3, Vector3};

use super::field::{Tapered, ellipsoid, intersection, union};
use super::{Solid, turn};

/// Height of the base under the middle, mm (y points down).
const BASE: f64 = 16.0;

pub(super) fn solid() -> Solid {
    let wheel =
        Tapered { ends: [Point3::new(44.0, -12.0, -4.0), Point3::new(44.0, -12.0, 4.0)], radii: [9.0, 9.0] };
    Solid {
        field: Box::new(move |p| {
            let palm =
                ellipsoid(&(p.coords - Vector3::new(-24.0, 6.0, 0.0)), &Vector3::new(50.0, 40.0, 44.0));
            let buttons =
                ellipsoid(&(p.coords - Vector3::new(32.0, 8.0, 0.0)), &Vector3::new(44.0, 28.0, 41.0));
            let body = union(palm, buttons, 30.0);
            let standing = intersection(body, p.y - BASE, 12.0);
            union(standing, wheel.at(p), 5.0)
        }),
        low: Point3::new(-82.0, -40.0, -50.0),
        high: Point3::new(84.0, BASE, 50.0),
        turn: turn([0.0, 0.0, 1.0], 24.0) * turn([1.0, 0.0, 0.0], 50.0) * turn([0.0, 1.0, 0.0], -12.0),
    }
}
