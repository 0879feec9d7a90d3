//! Curves and points in space: what a skeleton and a boundary are.

pub mod spline;

use nalgebra::Point3;

/// A curve, several, or a set of points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curves {
    /// Points, left camera's axes, mm.
    pub points: Vec<Point3<f64>>,
    /// Radius of the solid at each point, mm; empty where it has no meaning.
    pub radii: Vec<f64>,
    /// Neighbouring points.
    pub edges: Vec<[u32; 2]>,
}

impl Curves {
    /// Empties it, and keeps its memory.
    pub(crate) fn clear(&mut self) {
        self.points.clear();
        self.radii.clear();
        self.edges.clear();
    }
}
