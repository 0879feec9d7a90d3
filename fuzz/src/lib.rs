//! What several targets do.

pub mod figure;

use host::geometry::Geometry;
use host::mesh::read::parse;
use std::path::Path;

/// Read bytes as the file of a mesh: what is read hangs together.
pub fn mesh(name: &str, bytes: &[u8]) {
    let (points, corners) = match parse(Path::new(name), bytes) {
        Ok(Geometry::Mesh { mesh, .. }) => (mesh.vertices, mesh.faces.as_flattened().to_vec()),
        Ok(Geometry::Curves(curves)) => (curves.points, curves.edges.as_flattened().to_vec()),
        Err(error) => return assert!(!error.to_string().is_empty()),
    };
    assert!(corners.iter().all(|corner| (*corner as usize) < points.len()));
    assert!(points.iter().all(|point| point.iter().all(|x| x.is_finite())));
}
