//! Wavefront OBJ: `v` and `f` lines of a mesh, `v` and `l` lines of curves, `p` lines of points. The format has no unit; a
//! comment says mm. Radii of curves do not fit in.

use std::fmt::Display;
use std::io::{self, Write};
use std::path::Path;

use nalgebra::Point3;

use super::{ExportError, TITLE, write_whole};
use crate::curves::Curves;
use crate::mesh::Mesh;

/// Writes a mesh.
///
/// # Errors
///
/// If the file cannot be written.
pub fn write_mesh(path: &Path, mesh: &Mesh) -> Result<(), ExportError> {
    write(path, &mesh.vertices, 'f', &mesh.faces)
}

/// Writes curves, or points where there are no edges.
///
/// # Errors
///
/// If the file cannot be written.
pub fn write_curves(path: &Path, curves: &Curves) -> Result<(), ExportError> {
    if curves.edges.is_empty() {
        let points: Vec<_> = (0..curves.points.len() as u32).map(|point| [point]).collect();
        return write(path, &curves.points, 'p', &points);
    }
    write(path, &curves.points, 'l', &curves.edges)
}

/// Points, then elements of `N` of them, which are numbered from 1.
fn write<const N: usize>(
    path: &Path,
    points: &[Point3<f64>],
    element: impl Display,
    elements: &[[u32; N]],
) -> Result<(), ExportError> {
    write_whole(path, |file| {
        writeln!(file, "# {TITLE}")?;
        // Single precision is what every other format has: about 0.03 um at half a metre.
        points.iter().try_for_each(|p| writeln!(file, "v {} {} {}", p.x as f32, p.y as f32, p.z as f32))?;
        elements.iter().try_for_each(|corners| {
            write!(file, "{element}")?;
            corners.iter().try_for_each(|corner| write!(file, " {}", u64::from(*corner) + 1))?;
            writeln!(file)
        })?;
        io::Result::Ok(())
    })
}
