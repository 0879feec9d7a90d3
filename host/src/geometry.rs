//! What stands in a file of this program: a mesh, or curves.

use crate::curves::Curves;
use crate::mesh::Mesh;

/// A mesh or curves.
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// Triangles.
    Mesh(Mesh),
    /// Points, with edges and radii where there are any.
    Curves(Curves),
}
