//! Whether a mesh is closed, and of how many bodies it consists.
//!
//! Vertices within 1e-8 mm count as one, so that a mesh of loose triangles is judged by its shape.

use std::collections::HashMap;

use crate::mesh::Mesh;

/// Vertices are one if they agree in multiples of this, mm.
const SAME: f64 = 1e-8;

/// Whether every directed edge is matched by its reverse, as often as it occurs. Bodies may touch or
/// overlap. A mesh without faces is not closed.
pub(super) fn is_closed(mesh: &Mesh) -> bool {
    let mut edges = directed_edges(mesh);
    let mut reversed: Vec<[u32; 2]> = edges.iter().map(|&[a, b]| [b, a]).collect();
    edges.sort_unstable();
    reversed.sort_unstable();
    !edges.is_empty() && edges == reversed
}

/// Number of parts that stay together when faces hold on to each other at the edges that exactly two
/// of them share.
pub(super) fn bodies(mesh: &Mesh) -> usize {
    let mut edges: Vec<([u32; 2], usize)> = directed_edges(mesh)
        .iter()
        .enumerate()
        .map(|(number, &[a, b])| ([a.min(b), a.max(b)], number / 3))
        .collect();
    edges.sort_unstable();
    let mut parts = Parts((0..edges.len() / 3).collect());
    let mut count = parts.0.len();
    for shared in edges.chunk_by(|a, b| a.0 == b.0).filter(|shared| shared.len() == 2) {
        count -= usize::from(parts.join(shared[0].1, shared[1].1));
    }
    count
}

/// The three edges of each face that has three different corners.
fn directed_edges(mesh: &Mesh) -> Vec<[u32; 2]> {
    let mut first = HashMap::with_capacity(mesh.vertices.len());
    let welded: Vec<u32> = mesh
        .vertices
        .iter()
        .enumerate()
        .map(|(number, vertex)| {
            let key = <[f64; 3]>::from(vertex.coords).map(|x| (x / SAME).round() as i64);
            *first.entry(key).or_insert(number as u32)
        })
        .collect();
    mesh.faces
        .iter()
        .map(|face| face.map(|v| welded[v as usize]))
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .flat_map(|[a, b, c]| [[a, b], [b, c], [c, a]])
        .collect()
}

/// Disjoint sets, each a tree of which every member names its parent and the root itself.
struct Parts(Vec<usize>);

impl Parts {
    fn root(&mut self, mut member: usize) -> usize {
        while self.0[member] != member {
            self.0[member] = self.0[self.0[member]];
            member = self.0[member];
        }
        member
    }

    /// Whether the two were apart.
    fn join(&mut self, a: usize, b: usize) -> bool {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a] = b;
        a != b
    }
}
