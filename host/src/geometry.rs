//! What stands in a file of this program: a mesh, or curves.

use crate::curves::Curves;
use crate::mesh::Mesh;

/// A mesh or curves.
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// Triangles.
    Mesh {
        /// Themselves.
        mesh: Mesh,
        /// How well each vertex is known, 0 to 1; empty where nobody says.
        confidence: Vec<f64>,
    },
    /// Points, with edges and radii where there are any.
    Curves(Curves),
}

impl From<Mesh> for Geometry {
    fn from(mesh: Mesh) -> Self {
        Self::Mesh { mesh, confidence: Vec::new() }
    }
}
