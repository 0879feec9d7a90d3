//! Binary STL by `stl_io`: triangles with their normals. The format has no unit; the title says mm.

use std::path::Path;

use stl_io::{Normal, Triangle, Vertex};

use super::{ExportError, TITLE, write_bytes};
use crate::mesh::Mesh;

/// Bytes of the title at the head of the file.
const TITLE_BYTES: usize = 80;

/// Writes a mesh.
///
/// # Errors
///
/// If the file cannot be written.
pub fn write_mesh(path: &Path, mesh: &Mesh) -> Result<(), ExportError> {
    let triangle = |face: usize| Triangle {
        normal: Normal::new(
            mesh.area_normal(face).try_normalize(0.0).unwrap_or_default().cast::<f32>().into(),
        ),
        vertices: mesh.corners(face).map(|p| Vertex::new(p.cast::<f32>().into())),
    };
    let mut bytes = Vec::new();
    stl_io::write_stl(&mut bytes, (0..mesh.faces.len()).map(triangle))
        .map_err(|source| ExportError::Io { path: path.to_path_buf(), source })?;
    // Of a title that began with "solid", some programs would think that text follows.
    bytes[..TITLE_BYTES].fill(b' ');
    bytes[..TITLE.len()].copy_from_slice(TITLE.as_bytes());
    write_bytes(path, &bytes)
}
