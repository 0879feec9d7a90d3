//! The screwdriver: grip, collar and shaft as a solid of revolution about x, the tip ground flat.

use nalgebra::Point3;

use super::field::{Revolution, intersection, smooth_line};
use super::{Solid, turn};

/// Outline as position along the axis and radius, mm. Points given twice are corners.
const OUTLINE: [[f64; 2]; 22] = [
    [-90.0, 0.0],
    [-89.0, 8.0],
    [-84.0, 13.5],
    [-72.0, 15.5],
    [-56.0, 15.0],
    [-36.0, 14.5],
    [-20.0, 13.5],
    [-10.0, 10.5],
    [-4.0, 9.5],
    [2.0, 10.5],
    [6.0, 11.0],
    [6.0, 11.0],
    [10.0, 8.0],
    [10.0, 8.0],
    [10.0, 4.0],
    [10.0, 4.0],
    [66.0, 4.0],
    [72.0, 4.2],
    [80.0, 5.6],
    [90.0, 5.2],
    [90.0, 5.2],
    [90.0, 0.0],
];
/// Half the thickness of the tip at its end, mm.
const EDGE: f64 = 0.9;
/// How the half thickness grows away from the end.
const GRIND: f64 = 0.16;

pub(super) fn solid() -> Solid {
    let turned = Revolution::new(&smooth_line(&OUTLINE, 4));
    let slope = (1.0 + GRIND * GRIND).sqrt();
    Solid {
        field: Box::new(move |p| {
            let radius = p.coords.yz().norm();
            let ground = (p.z.abs() - EDGE - GRIND * (90.0 - p.x)) / slope;
            intersection(turned.at(p.x, radius), ground, 1.0)
        }),
        low: Point3::new(-90.0, -16.0, -16.0),
        high: Point3::new(90.0, 16.0, 16.0),
        turn: turn([0.0, 0.0, 1.0], -24.0) * turn([0.0, 1.0, 0.0], -15.0) * turn([1.0, 0.0, 0.0], 30.0),
    }
}
