//! Wavefront OBJ, by `tobj`.

use std::io::Cursor;

use nalgebra::Point3;

use crate::mesh::Mesh;

/// The mesh in the bytes of an OBJ file, all its objects and groups together.
///
/// # Errors
///
/// What is wrong.
pub(super) fn parse(bytes: &[u8]) -> Result<Mesh, String> {
    let shape = shape_only(&String::from_utf8_lossy(bytes));
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..tobj::LoadOptions::default()
    };
    let mut lines = Cursor::new(shape.as_bytes());
    let (models, _) = tobj::load_obj_buf(&mut lines, &options, |_| Err(tobj::LoadError::OpenFileFailed))
        .map_err(|error| {
            use tobj::LoadError::{FaceParseError, FaceVertexOutOfBounds, PositionParseError};
            let read = &shape.as_bytes()[..lines.position() as usize];
            let line = read.iter().filter(|byte| **byte == b'\n').count();
            match error {
                PositionParseError => format!("line {line} is no vertex"),
                FaceParseError => format!("line {line} is no face"),
                FaceVertexOutOfBounds => "a face names a vertex that is not there".into(),
                other => other.to_string(),
            }
        })?;
    let mut mesh = Mesh::default();
    for tobj::Model { mesh: model, .. } in models {
        let coordinates = model.positions.as_chunks().0;
        mesh.vertices.extend(coordinates.iter().map(|&p: &[f32; 3]| Point3::from(p.map(f64::from))));
        mesh.faces.extend(model.indices.as_chunks().0);
    }
    Ok(mesh)
}

/// The positions and faces of the file alone, in the lines where they stand. Groups would split vertices that they share, and `tobj`
/// overflows on texture and normal indices that are not there.
fn shape_only(text: &str) -> String {
    let mut shape = String::with_capacity(text.len());
    for line in text.lines() {
        let mut words = line.split_whitespace();
        let kept: Vec<&str> = match words.next() {
            Some("v") => ["v"].into_iter().chain(words.take(3)).collect(),
            Some("f") => ["f"].into_iter().chain(words.map(position_index)).collect(),
            _ => Vec::new(),
        };
        shape.push_str(&kept.join(" "));
        shape.push('\n');
    }
    shape
}

/// The first index of a corner `position/texture/normal`; where it is missing 0, which OBJ has not.
fn position_index(corner: &str) -> &str {
    corner.split('/').next().filter(|index| !index.is_empty()).unwrap_or("0")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_polygons_groups_and_relative_indices() {
        let text = "# a square and a triangle\nmtllib none.mtl\nv 0 0 0 1 0 0\nv 1 0 0\nvt 0 0\nv 1 1 0\nv 0 1 0.5\n\
            o one\nf 1/1/9 2//7 3 4/1\ng two\nusemtl red\nl 1 2\nf -4 -2 -1\n";
        let mesh = parse(text.as_bytes()).unwrap();
        assert_eq!(mesh.vertices.len(), 4);
        assert_eq!(mesh.faces, [[0, 1, 2], [0, 2, 3], [0, 2, 3]]);
        assert_eq!(mesh.vertices[3], Point3::new(0.0, 1.0, 0.5));
    }

    #[test]
    fn refuses_what_is_no_face_or_vertex() {
        let vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
        for bad in [
            "f 1 2 4",
            "f 0 1 2",
            "f a b c",
            "f 1 2 99999999999999999999",
            "f 1 2 9223372036854775807",
            "f -9223372036854775808 1 2",
            "f -9 1 2",
            "f",
            "v 1 2",
            "v x y z",
            "f 1 2 /3",
        ] {
            assert!(parse(format!("{vertices}{bad}\n").as_bytes()).is_err(), "{bad}");
        }
    }

    #[test]
    fn the_line_is_told() {
        let told = |bad: &str| parse(format!("# a triangle\nv 0 0 0\n\nvt 1 1\n{bad}\nv 1 0 0\n").as_bytes());
        assert_eq!(told("v 1 x 0").unwrap_err(), "line 5 is no vertex");
        assert_eq!(told("f 1 a 2").unwrap_err(), "line 5 is no face");
    }

    #[test]
    fn a_bit_turned_or_a_file_cut_anywhere_does_not_panic() {
        let whole = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/2/3 -2/1 3\ng a\nusemtl b\nf 1 2 3 1\n";
        for place in 0..whole.len() * 8 {
            let mut bytes = whole.to_vec();
            bytes[place / 8] ^= 1 << (place % 8);
            let _ = parse(&bytes);
            let _ = parse(&whole[..place / 8]);
        }
    }
}
