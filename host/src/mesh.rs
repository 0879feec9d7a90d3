//! A triangle mesh in millimetres: what the surface stage makes, and what files and renderers take.

use nalgebra::Point3;

/// Triangles over shared vertices.
///
/// Coordinates are millimetres in the left camera's axes (x right, y down, z forward). Seen from
/// outside, the corners of a face run counter-clockwise, so that normals point outward.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions, mm.
    pub vertices: Vec<Point3<f64>>,
    /// Corners of each triangle, as indices into `vertices`.
    pub faces: Vec<[u32; 3]>,
}
