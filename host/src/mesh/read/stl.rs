//! STL, ascii and binary, by `stl_io`; corners with the same coordinates become one vertex.

use std::io::Cursor;

use nalgebra::Point3;

use crate::mesh::Mesh;

/// The bytes of a binary file before its triangles: a title, and their number.
const HEADER: usize = 84;

/// The bytes of a triangle in a binary file.
const TRIANGLE: usize = 50;

/// The mesh in the bytes of an STL file.
///
/// # Errors
///
/// What is wrong.
pub(super) fn parse(bytes: &[u8]) -> Result<Mesh, String> {
    let mut bytes = bytes.to_vec();
    if is_binary(&bytes) {
        // Some programs begin the title of binary files with the "solid" that tells ascii files.
        bytes[..HEADER - 4].fill(0);
    }
    let stl = stl_io::read_stl(&mut Cursor::new(bytes)).map_err(|error| error.to_string())?;
    let vertices = stl.vertices.iter().map(|vertex| Point3::from(vertex.0.map(f64::from))).collect();
    let faces = stl.faces.iter().map(|face| face.vertices.map(|corner| corner as u32)).collect();
    Ok(Mesh { vertices, faces })
}

/// Whether the length is what the number of triangles makes it.
fn is_binary(bytes: &[u8]) -> bool {
    let count = bytes.get(HEADER - 4..).and_then(|rest| rest.first_chunk()).map(|&n| u32::from_le_bytes(n));
    count.is_some_and(|count| (bytes.len() - HEADER) as u64 == u64::from(count) * TRIANGLE as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ASCII: &str = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n\
        endloop\nendfacet\nfacet normal 0 0 1\nouter loop\nvertex 1 0 0\nvertex 1 1 0\nvertex 0 1 0\nendloop\n\
        endfacet\nendsolid a\n";

    fn binary(title: &[u8], triangles: &[[[f32; 3]; 3]]) -> Vec<u8> {
        let mut bytes = title.to_vec();
        bytes.resize(80, b' ');
        bytes.extend((triangles.len() as u32).to_le_bytes());
        for triangle in triangles {
            bytes.extend([0; 12]);
            bytes.extend(triangle.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
            bytes.extend([0; 2]);
        }
        bytes
    }

    #[test]
    fn ascii_and_binary_give_the_same_mesh() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
        let triangles = [[0, 1, 2], [1, 3, 2]].map(|face| face.map(|corner: usize| corners[corner]));
        let mesh = parse(ASCII.as_bytes()).unwrap();
        assert_eq!(mesh.faces, [[0, 1, 2], [1, 3, 2]]);
        assert_eq!(parse(&binary(b"title", &triangles)).unwrap(), mesh);
        assert_eq!(parse(&binary(b"solid but binary", &triangles)).unwrap(), mesh);
    }

    #[test]
    fn a_count_of_four_billion_is_an_error_and_not_an_allocation() {
        let mut bytes = binary(b"title", &[[[0.0; 3]; 3]]);
        bytes[80..84].fill(0xff);
        assert!(parse(&bytes).is_err());
    }

    #[test]
    fn a_bit_turned_anywhere_does_not_panic() {
        for whole in [binary(b"solid", &[[[0.5; 3]; 3]; 2]), ASCII.into()] {
            for place in 0..whole.len() * 8 {
                let mut bytes = whole.clone();
                bytes[place / 8] ^= 1 << (place % 8);
                let _ = parse(&bytes);
            }
        }
    }

    #[test]
    fn a_file_cut_anywhere_is_an_error() {
        let whole = binary(b"title", &[[[0.0; 3]; 3]; 2]);
        for length in 0..whole.len() {
            assert!(parse(&whole[..length]).is_err(), "{length}");
        }
        let end = ASCII.find("endsolid").unwrap();
        for length in 0..end {
            assert!(parse(&ASCII.as_bytes()[..length]).is_err(), "{length}");
        }
    }
}
