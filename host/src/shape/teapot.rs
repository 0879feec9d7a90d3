//! The teapot: body, lid and knob as a solid of revolution, spout and handle as bent tubes.
//!
//! Our own design. Measures are mm; heights count upwards from the table, distances from the axis.

use nalgebra::Point3;

use super::field::{Revolution, Tube, intersection, smooth_line, union};
use super::{Solid, turn};

/// Outline of body, lid and knob: height and radius.
const OUTLINE: [[f64; 2]; 23] = [
    [0.0, 0.0],
    [0.0, 25.0],
    [1.2, 29.5],
    [4.6, 33.0],
    [9.5, 38.5],
    [18.0, 47.0],
    [32.0, 51.5],
    [46.0, 48.5],
    [57.0, 41.0],
    [61.5, 38.2],
    [65.0, 37.6],
    [68.2, 38.4],
    [71.0, 37.2],
    [72.2, 34.0],
    [73.8, 29.0],
    [78.0, 17.0],
    [80.6, 7.5],
    [83.5, 5.0],
    [86.0, 7.0],
    [90.0, 9.2],
    [94.0, 7.4],
    [96.0, 3.6],
    [96.4, 0.0],
];
/// Spout: distance to the right, height, depth and radius.
const SPOUT: [[f64; 4]; 6] = [
    [36.0, 22.0, 0.0, 15.0],
    [52.0, 26.0, 0.0, 12.0],
    [62.0, 38.0, 0.0, 8.5],
    [67.0, 52.0, 0.0, 6.6],
    [73.0, 65.0, 0.0, 5.6],
    [81.0, 75.0, 0.0, 5.4],
];
/// Where the spout is cut off, a height.
const LIP: f64 = 70.0;
/// Handle, from its upper root to the lower one.
const HANDLE: [[f64; 4]; 7] = [
    [-40.0, 56.0, 0.0, 5.2],
    [-56.0, 62.0, 0.0, 5.0],
    [-70.0, 59.0, 0.0, 4.8],
    [-77.0, 47.0, 0.0, 4.8],
    [-74.0, 33.0, 0.0, 4.8],
    [-62.0, 22.0, 0.0, 5.0],
    [-44.0, 17.0, 0.0, 5.6],
];
/// Width over which the spout and the handle flow into the body.
const SPOUT_BLEND: f64 = 8.0;
const HANDLE_BLEND: f64 = 6.0;
/// Height that stands on the optical axis.
const MIDDLE: f64 = 46.0;

pub(super) fn solid() -> Solid {
    let pot = Revolution::new(&smooth_line(&OUTLINE, 8));
    let spout = Tube::new(&smooth_line(&SPOUT, 5));
    let handle = Tube::new(&smooth_line(&HANDLE, 5));
    Solid {
        field: Box::new(move |p| {
            let q = Point3::new(p.x, MIDDLE - p.y, p.z);
            let mut pot = pot.at(q.y, q.coords.xz().norm());
            // Where a tube is too far away to blend, its distance does not matter.
            if spout.at_least(&q) < pot + SPOUT_BLEND {
                pot = union(pot, intersection(spout.at(&q), q.y - LIP, 2.5), SPOUT_BLEND);
            }
            if handle.at_least(&q) < pot + HANDLE_BLEND {
                pot = union(pot, handle.at(&q), HANDLE_BLEND);
            }
            pot
        }),
        low: Point3::new(-83.0, MIDDLE - 97.0, -53.0),
        high: Point3::new(88.0, MIDDLE, 53.0),
        turn: turn([1.0, 0.0, 0.0], 16.0),
    }
}
