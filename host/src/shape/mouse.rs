//! The computer mouse: two swells, a waist between them, a flat base and a wheel.

use nalgebra::{Point3, Vector3};

use super::field::{Tapered, ellipsoid, intersection, union};
use super::{Solid, turn};

/// Height of the base under the middle, mm (y points down).
const BASE: f64 = 14.0;

pub(super) fn solid() -> Solid {
    let wheel =
        Tapered { ends: [Point3::new(30.0, -15.0, -3.0), Point3::new(30.0, -15.0, 3.0)], radii: [7.0, 7.0] };
    Solid {
        field: Box::new(move |p| {
            let palm = ellipsoid(&(p.coords - Vector3::new(-20.0, 6.0, 0.0)), &Vector3::new(42.0, 34.0, 36.0));
            let buttons = ellipsoid(&(p.coords - Vector3::new(24.0, 8.0, 0.0)), &Vector3::new(38.0, 25.0, 31.0));
            let body = union(palm, buttons, 26.0);
            let standing = intersection(body, p.y - BASE, 10.0);
            union(standing, wheel.at(p), 3.0)
        }),
        low: Point3::new(-70.0, -34.0, -42.0),
        high: Point3::new(70.0, BASE, 42.0),
        turn: turn([0.0, 0.0, 1.0], 24.0) * turn([1.0, 0.0, 0.0], 48.0) * turn([0.0, 1.0, 0.0], -12.0),
    }
}
