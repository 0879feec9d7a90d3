//! Normals for shading: smooth over curved parts, flat beside sharp edges.
//!
//! In: a mesh. Out: for each face, a unit normal at each of its corners: the mean of the normals of the
//! faces around that vertex that differ from this face's by less than the crease angle, with the weights
//! of Max (1999), which give the exact normal of a sphere however it is cut into triangles. Cost:
//! O(faces times the faces around a vertex).

use nalgebra::Vector3;

use crate::mesh::Mesh;

/// Cosine of the crease angle, 40 degrees: between the 20 degrees by which faces of a coarse round mesh
/// differ and the 90 degrees of a block.
const CREASE: f64 = 0.766;

/// Edges shorter than this part of the mesh's root mean square edge count as this long, so that the
/// tiny faces where a grid node lies on the surface, whose normals are rounding, have no weight.
const SHORTEST: f64 = 0.1;

/// Unit normals at the corners of each face; zero for a face without area.
pub(super) fn corner_normals(mesh: &Mesh) -> Vec<[Vector3<f64>; 3]> {
    let edges = |&face: &[u32; 3]| -> f64 { squared_edges(mesh, face).iter().sum() };
    let mean_square = mesh.faces.iter().map(edges).sum::<f64>() / (3.0 * mesh.faces.len().max(1) as f64);
    let least = mean_square * SHORTEST * SHORTEST;
    let weighed: Vec<_> = mesh.faces.iter().map(|&face| weighed_normals(mesh, face, least)).collect();
    let units: Vec<Vector3<f64>> = weighed.iter().map(|corners| unit(&corners[0])).collect();
    let around = Fans::new(mesh);
    let corner = |face: usize, vertex: u32| {
        let near =
            around.corners(vertex).iter().filter(|&&(f, _)| units[f as usize].dot(&units[face]) > CREASE);
        unit(&near.map(|&(f, corner)| weighed[f as usize][corner as usize]).sum())
    };
    mesh.faces.iter().enumerate().map(|(face, corners)| corners.map(|vertex| corner(face, vertex))).collect()
}

/// The normal of a face with the weight it has at each corner: the sine of the angle there over the
/// product of the two edges' lengths, whose squares count as at least `least`.
fn weighed_normals(mesh: &Mesh, face: [u32; 3], least: f64) -> [Vector3<f64>; 3] {
    let [a, b, c] = face.map(|v| mesh.vertices[v as usize]);
    let normal = (b - a).cross(&(c - a));
    let squares = squared_edges(mesh, face).map(|square| square.max(least));
    [1, 2, 0].map(|next| normal / (squares[next] * squares[(next + 1) % 3]).max(f64::MIN_POSITIVE))
}

/// Squared lengths of the edges opposite the corners.
fn squared_edges(mesh: &Mesh, face: [u32; 3]) -> [f64; 3] {
    let [a, b, c] = face.map(|v| mesh.vertices[v as usize]);
    [c - b, a - c, b - a].map(|edge| edge.norm_squared())
}

fn unit(v: &Vector3<f64>) -> Vector3<f64> {
    v.try_normalize(0.0).unwrap_or_default()
}

/// The face corners at each vertex, one list after the other.
struct Fans {
    starts: Vec<u32>,
    corners: Vec<(u32, u8)>,
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
        let mut corners = vec![(0, 0); mesh.faces.len() * 3];
        for (face, vertices) in mesh.faces.iter().enumerate() {
            for (corner, &vertex) in vertices.iter().enumerate() {
                let place = &mut next[vertex as usize];
                corners[*place as usize] = (face as u32, corner as u8);
                *place += 1;
            }
        }
        Self { starts, corners }
    }

    /// The corners at a vertex: face, and which of its three.
    fn corners(&self, vertex: u32) -> &[(u32, u8)] {
        let vertex = vertex as usize;
        &self.corners[self.starts[vertex] as usize..self.starts[vertex + 1] as usize]
    }
}
