//! The teapot: body, lid and knob as a solid of revolution, spout and handle as bent tubes.
//!
//! Our own design. Measures are mm; heights count upwards from the table, distances from the axis.

use nalgebra::Point3;

use super::field::{Revolution, Tube, intersection, smooth_line, union};
use super::{Solid, turn};

/// Outline of body, lid and knob: height and radius. Points given twice are corners.
const OUTLINE: [[f64; 2]; 23] = [
    [0.0, 0.0],
    [0.0, 31.0],
    [0.0, 31.0],
    [3.5, 32.5],
    [5.0, 35.0],
    [16.0, 46.0],
    [32.0, 51.5],
    [48.0, 47.5],
    [60.0, 38.5],
    [65.0, 35.0],
    [67.5, 36.0],
    [70.0, 35.0],
    [70.0, 31.5],
    [70.0, 31.5],
    [75.0, 25.0],
    [79.0, 13.0],
    [81.0, 6.0],
    [84.0, 4.6],
    [86.5, 7.5],
    [90.0, 9.0],
    [93.5, 7.0],
    [95.0, 3.0],
    [95.3, 0.0],
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
/// Height that stands on the optical axis.
const MIDDLE: f64 = 46.0;

pub(super) fn solid() -> Solid {
    let pot = Revolution::new(smooth_line(&OUTLINE, 5));
    let spout = Tube::new(&smooth_line(&SPOUT, 5));
    let handle = Tube::new(&smooth_line(&HANDLE, 5));
    Solid {
        field: Box::new(move |p| {
            let q = Point3::new(p.x, MIDDLE - p.y, p.z);
            let body = pot.at(q.y, q.coords.xz().norm());
            let spout = intersection(spout.at(&q), q.y - LIP, 2.0);
            union(union(body, spout, 7.0), handle.at(&q), 5.0)
        }),
        low: Point3::new(-83.0, MIDDLE - 96.0, -53.0),
        high: Point3::new(88.0, MIDDLE, 53.0),
        turn: turn([1.0, 0.0, 0.0], 16.0),
    }
}
