//! PLY files (G. Turk, "The PLY Polygon File Format", 1994), binary little-endian.
//!
//! Vertices have float32 `x y z`, then one float32 property a scalar. A mesh has `element face` with an int32 list
//! `vertex_indices`; points have `element edge` with int32 `vertex1 vertex2` where they are a curve.

use std::{
    io::{self, Write},
    path::Path,
};

use nalgebra::Point3;

use super::{ExportError, write_whole};
use crate::curves::Curves;
use crate::mesh::Mesh;

/// So many vertices or faces are written at once: what stays in the cache until the system has copied it.
const RECORDS: usize = 4096;

/// Named values, one a point, in units that the name's reader knows (a `radius` is in mm).
pub type Scalars<'a> = &'a [(&'a str, &'a [f64])];

/// Points with what is known at each, and the edges between them if they are a curve.
#[derive(Clone, Copy, Debug, Default)]
pub struct Points<'a> {
    /// Positions, mm.
    pub positions: &'a [Point3<f64>],
    /// What is known.
    pub scalars: Scalars<'a>,
    /// Pairs of indices into `positions`.
    pub edges: &'a [[u32; 2]],
}

/// Writes a mesh. `comments` go to the header, a line each.
///
/// # Errors
///
/// If the file cannot be written, or has more than 2^31 - 1 vertices or faces, or a comment has a line
/// break.
pub fn write_mesh(path: &Path, mesh: &Mesh, comments: &[&str]) -> Result<(), ExportError> {
    write_known_mesh(path, mesh, &[], comments)
}

/// Writes a mesh with what is known at each vertex. `comments` go to the header, a line each.
///
/// # Errors
///
/// As [`write_mesh`] and [`write_points`].
pub fn write_known_mesh(
    path: &Path,
    mesh: &Mesh,
    scalars: Scalars<'_>,
    comments: &[&str],
) -> Result<(), ExportError> {
    let counts = [("vertices", mesh.vertices.len()), ("faces", mesh.faces.len())];
    check(path, comments, &counts, mesh.faces.as_flattened(), mesh.vertices.len())?;
    check_scalars(path, scalars, mesh.vertices.len())?;
    write_whole(path, |file| mesh_into(file, mesh, scalars, comments))
}

/// The bytes of such a file.
pub(crate) fn mesh_into(
    file: &mut impl Write,
    mesh: &Mesh,
    scalars: Scalars<'_>,
    comments: &[&str],
) -> io::Result<()> {
    begin(file, comments, mesh.vertices.len(), scalars)?;
    writeln!(file, "element face {}", mesh.faces.len())?;
    writeln!(file, "property list uchar int vertex_indices\nend_header")?;
    let mut records = Vec::new();
    for (chunk, vertices) in mesh.vertices.chunks(RECORDS).enumerate() {
        records.clear();
        for (k, vertex) in vertices.iter().enumerate() {
            let record = [vertex.x, vertex.y, vertex.z].map(|x| (x as f32).to_le_bytes());
            records.extend_from_slice(record.as_flattened());
            for (_, values) in scalars {
                records.extend_from_slice(&(values[chunk * RECORDS + k] as f32).to_le_bytes());
            }
        }
        file.write_all(&records)?;
    }
    for faces in mesh.faces.chunks(RECORDS) {
        records.clear();
        for face in faces {
            let mut record = [3; 13];
            record[1..].copy_from_slice(face.map(u32::to_le_bytes).as_flattened());
            records.extend_from_slice(&record);
        }
        file.write_all(&records)?;
    }
    Ok(())
}

/// Writes points, or a curve. `comments` go to the header, a line each.
///
/// # Errors
///
/// As [`write_mesh`]; and if a scalar's name is not one word or its values are not one a point.
pub fn write_points(path: &Path, points: &Points, comments: &[&str]) -> Result<(), ExportError> {
    let count = points.positions.len();
    let counts = [("points", count), ("edges", points.edges.len())];
    check(path, comments, &counts, points.edges.as_flattened(), count)?;
    check_scalars(path, points.scalars, count)?;
    write_whole(path, |file| {
        begin(file, comments, count, points.scalars)?;
        if !points.edges.is_empty() {
            writeln!(file, "element edge {}", points.edges.len())?;
            writeln!(file, "property int vertex1\nproperty int vertex2")?;
        }
        writeln!(file, "end_header")?;
        for (i, position) in points.positions.iter().enumerate() {
            floats(file, position.iter().chain(points.scalars.iter().map(|(_, values)| &values[i])))?;
        }
        points.edges.iter().try_for_each(|edge| indices(file, edge))
    })
}

/// Writes curves, with `radius` where they have one. `comments` go to the header, a line each.
///
/// # Errors
///
/// As [`write_points`].
pub fn write_curves(path: &Path, curves: &Curves, comments: &[&str]) -> Result<(), ExportError> {
    let radius = [("radius", &curves.radii[..])];
    let points = Points {
        positions: &curves.points,
        scalars: if curves.radii.is_empty() { &[] } else { &radius },
        edges: &curves.edges,
    };
    write_points(path, &points, comments)
}

/// Refuses what the header or an int32 cannot say, and indices that lead nowhere.
fn check(
    path: &Path,
    comments: &[&str],
    counts: &[(&str, usize)],
    indices: &[u32],
    vertices: usize,
) -> Result<(), ExportError> {
    let refuse = |what| Err(ExportError::Content { path: path.to_path_buf(), what });
    if let Some((what, count)) = counts.iter().find(|&&(_, count)| i32::try_from(count).is_err()) {
        return refuse(format!("{count} {what} are more than the format can number"));
    }
    if let Some(comment) = comments.iter().find(|comment| comment.contains(['\n', '\r'])) {
        return refuse(format!("the comment {comment:?} has a line break"));
    }
    if let Some(index) = indices.iter().find(|&&index| index as usize >= vertices) {
        return refuse(format!("vertex {index} is named, but there are only {vertices}"));
    }
    Ok(())
}

/// Refuses scalars whose names are not one word or whose values are not one a vertex.
fn check_scalars(path: &Path, scalars: Scalars<'_>, vertices: usize) -> Result<(), ExportError> {
    for (name, values) in scalars {
        let one_word = !name.is_empty() && name.chars().all(|c| c.is_ascii_graphic());
        if !one_word || values.len() != vertices {
            let what = format!("the scalar \"{name}\" is not one word with {vertices} values");
            return Err(ExportError::Content { path: path.to_path_buf(), what });
        }
    }
    Ok(())
}

fn begin(file: &mut impl Write, comments: &[&str], vertices: usize, scalars: Scalars<'_>) -> io::Result<()> {
    writeln!(file, "ply\nformat binary_little_endian 1.0")?;
    for comment in comments {
        writeln!(file, "comment {comment}")?;
    }
    writeln!(file, "element vertex {vertices}\nproperty float x\nproperty float y\nproperty float z")?;
    scalars.iter().try_for_each(|(name, _)| writeln!(file, "property float {name}"))
}

fn floats<'a>(file: &mut impl Write, values: impl Iterator<Item = &'a f64>) -> io::Result<()> {
    for &value in values {
        file.write_all(&(value as f32).to_le_bytes())?;
    }
    Ok(())
}

fn indices(file: &mut impl Write, values: &[u32]) -> io::Result<()> {
    values.iter().try_for_each(|value| file.write_all(&value.to_le_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::read::read;

    fn triangle() -> Mesh {
        let vertices = [[0.0, 0.5, 1.0], [2.0, -3.0, 4.0], [100.25, 0.0, 1e-3]].map(Point3::from).to_vec();
        Mesh { vertices, faces: vec![[0, 1, 2], [2, 1, 0]] }
    }

    #[test]
    fn a_mesh_comes_back_as_it_was_in_single_precision() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.ply");
        write_mesh(&path, &triangle(), &["unit mm", "one more"]).unwrap();
        let mut expected = triangle();
        expected.vertices[2].z = f64::from(1e-3_f32);
        assert_eq!(read(&path).unwrap(), expected);
    }

    #[test]
    fn what_is_known_of_vertices_stands_behind_their_places() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.ply");
        let known = [("confidence", &[0.25, 0.5, 1.0][..])];
        write_known_mesh(&path, &triangle(), &known, &[]).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let end = b"end_header\n";
        let header = bytes.windows(end.len()).position(|w| w == end).unwrap();
        let text = std::str::from_utf8(&bytes[..header]).unwrap();
        assert!(text.contains("property float z\nproperty float confidence\nelement face 2\n"), "{text}");
        let first: Vec<f32> =
            bytes[header + end.len()..][..16].as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
        assert_eq!(first, [0.0, 0.5, 1.0, 0.25]);
        assert_eq!(read(&path).unwrap().faces, triangle().faces);
        assert!(write_known_mesh(&path, &triangle(), &[("confidence", &[1.0])], &[]).is_err());
    }

    #[test]
    fn the_bytes_of_a_curve_are_these() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("skeleton.ply");
        let positions = [Point3::new(1.0, 2.0, 3.0), Point3::new(0.0, 0.0, 0.0)];
        let points = Points { positions: &positions, scalars: &[("radius", &[4.0, 0.5])], edges: &[[0, 1]] };
        write_points(&path, &points, &["unit mm"]).unwrap();
        let mut expected = b"ply\nformat binary_little_endian 1.0\ncomment unit mm\nelement vertex 2\n\
            property float x\nproperty float y\nproperty float z\nproperty float radius\n\
            element edge 1\nproperty int vertex1\nproperty int vertex2\nend_header\n"
            .to_vec();
        expected.extend([1.0_f32, 2.0, 3.0, 4.0, 0.0, 0.0, 0.0, 0.5].map(f32::to_le_bytes).as_flattened());
        expected.extend([0, 0, 0, 0, 1, 0, 0, 0]);
        assert_eq!(std::fs::read(&path).unwrap(), expected);
    }

    #[test]
    fn refuses_contradictions_and_writes_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bad.ply");
        let mut mesh = triangle();
        assert!(write_mesh(&path, &mesh, &["two\nlines"]).is_err());
        mesh.faces[0][1] = 3;
        let error = write_mesh(&path, &mesh, &[]).unwrap_err().to_string();
        assert!(error.ends_with("bad.ply: vertex 3 is named, but there are only 3"), "{error}");
        let positions = [Point3::origin()];
        for scalar in [("radius", &[][..]), ("two words", &[1.0][..]), ("", &[1.0][..])] {
            let points = Points { positions: &positions, scalars: &[scalar], edges: &[] };
            assert!(write_points(&path, &points, &[]).is_err());
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
