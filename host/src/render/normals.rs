//! Normals for shading: smooth over curved parts, flat beside sharp edges.
//!
//! In: a mesh. Out: for each face, a unit normal at each of its corners: the mean of the normals of the
//! faces around that vertex, weighed by area, of those that differ from this face's by less than the
//! crease angle. Cost: O(faces times the faces around a vertex).

use nalgebra::Vector3;

use crate::mesh::Mesh;

/// Cosine of the crease angle, 40 degrees: between the 20 degrees by which faces of a coarse round mesh
/// differ and the 90 degrees of a block.
const CREASE: f64 = 0.766;

/// Unit normals at the corners of each face; zero for a face without area.
pub(super) fn corner_normals(mesh: &Mesh) -> Vec<[Vector3<f64>; 3]> {
    let areas: Vec<Vector3<f64>> = mesh
        .faces
        .iter()
        .map(|face| {
            let [a, b, c] = face.map(|v| mesh.vertices[v as usize]);
            (b - a).cross(&(c - a))
        })
        .collect();
    let units: Vec<Vector3<f64>> = areas.iter().map(unit).collect();
    let around = Fans::new(mesh);
    let corner = |face: usize, vertex: u32| {
        let near = around.faces(vertex).iter().map(|&f| f as usize);
        unit(&near.filter(|&f| f == face || units[f].dot(&units[face]) > CREASE).map(|f| areas[f]).sum())
    };
    mesh.faces.iter().enumerate().map(|(face, corners)| corners.map(|vertex| corner(face, vertex))).collect()
}

fn unit(v: &Vector3<f64>) -> Vector3<f64> {
    v.try_normalize(0.0).unwrap_or_default()
}

/// The faces around each vertex, one list after the other.
struct Fans {
    starts: Vec<u32>,
    faces: Vec<u32>,
}

impl Fans {
    fn new(mesh: &Mesh) -> Self {
        let mut starts = vec![0; mesh.vertices.len() + 1];
        for &vertex in mesh.faces.iter().flatten() {
            starts[vertex as usize + 1] += 1;
        }
        for vertex in 0..mesh.vertices.len() {
            starts[vertex + 1] += starts[vertex];
        }
        let mut next = starts.clone();
        let mut faces = vec![0; mesh.faces.len() * 3];
        for (face, corners) in mesh.faces.iter().enumerate() {
            for &vertex in corners {
                let place = &mut next[vertex as usize];
                faces[*place as usize] = face as u32;
                *place += 1;
            }
        }
        Self { starts, faces }
    }

    fn faces(&self, vertex: u32) -> &[u32] {
        let vertex = vertex as usize;
        &self.faces[self.starts[vertex] as usize..self.starts[vertex + 1] as usize]
    }
}
