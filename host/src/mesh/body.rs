//! The separate bodies of a mesh, and the largest of them.
//!
//! Faces that share a vertex belong together. A closed piece of surface that looks outward bounds a body;
//! one that looks inward bounds a hollow, which no camera sees and which is no body.

use super::Mesh;

/// What [`keep_largest_body`] left.
#[derive(Clone, Debug, PartialEq)]
pub struct LargestBody {
    /// The largest body, without hollows.
    pub mesh: Mesh,
    /// How many other bodies were dropped.
    pub dropped: usize,
    /// Their share of the volume of all bodies, 0 to 1.
    pub dropped_volume: f64,
}

/// Keeps the body of greatest volume of a closed mesh, and nothing else: not its hollows either.
#[must_use]
pub fn keep_largest_body(mesh: Mesh) -> LargestBody {
    let (piece, count) = pieces(&mesh);
    if count <= 1 {
        return LargestBody { mesh, dropped: 0, dropped_volume: 0.0 };
    }
    let of_face = |face: usize| piece[mesh.faces[face][0] as usize] as usize;
    let mut volumes = vec![0.0; count];
    for face in 0..mesh.faces.len() {
        volumes[of_face(face)] += mesh.volume_under(face);
    }
    let largest = (1..count).fold(0, |best, i| if volumes[i] >= volumes[best] { i } else { best });
    let bodies = || volumes.iter().filter(|&&volume| volume > 0.0);
    let total: f64 = bodies().sum();
    LargestBody {
        dropped: bodies().count().saturating_sub(1),
        dropped_volume: if total > 0.0 { 1.0 - volumes[largest] / total } else { 0.0 },
        mesh: extract(&mesh, |face| of_face(face) == largest),
    }
}

/// The connected piece of each vertex, numbered from 0 in the order of their first vertices, and how many
/// there are; vertices of no face are pieces of their own.
fn pieces(mesh: &Mesh) -> (Vec<u32>, usize) {
    let mut parent: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    for &[a, b, c] in &mesh.faces {
        let joined = join(&mut parent, a, b);
        join(&mut parent, joined, c);
    }
    // A parent never comes after its child, so one pass names them all.
    let mut count = 0;
    for vertex in 0..parent.len() {
        let above = parent[vertex] as usize;
        parent[vertex] = if above == vertex { count } else { parent[above] };
        count += u32::from(above == vertex);
    }
    (parent, count as usize)
}

/// Joins the sets of `a` and `b`, and returns their root.
fn join(parent: &mut [u32], a: u32, b: u32) -> u32 {
    let (a, b) = (root(parent, a), root(parent, b));
    let (low, high) = (a.min(b), a.max(b));
    parent[high as usize] = low;
    low
}

/// The representative of `x` in a forest of disjoint sets, whose paths are halved on the way.
fn root(parent: &mut [u32], mut x: u32) -> u32 {
    while parent[x as usize] != x {
        let above = parent[parent[x as usize] as usize];
        parent[x as usize] = above;
        x = above;
    }
    x
}

/// The faces chosen by `keep`, with the vertices that they use, in their order.
fn extract(mesh: &Mesh, keep: impl Fn(usize) -> bool) -> Mesh {
    let mut kept = Mesh::default();
    let mut moved = vec![None; mesh.vertices.len()];
    for (_, face) in mesh.faces.iter().enumerate().filter(|&(face, _)| keep(face)) {
        kept.faces.push(face.map(|corner| {
            *moved[corner as usize].get_or_insert_with(|| {
                kept.vertices.push(mesh.vertices[corner as usize]);
                kept.vertices.len() as u32 - 1
            })
        }));
    }
    kept
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Vector3};

    use super::*;

    /// A regular tetrahedron with its middle at `x`; turned inside out if `size` is negative.
    fn tetrahedron(x: f64, size: f64) -> Mesh {
        let corners = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
        let vertices = corners.map(|c| Point3::from(c) * size + Vector3::new(x, 0.0, 0.0)).to_vec();
        Mesh { vertices, faces: vec![[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]] }
    }

    fn together(meshes: &[Mesh]) -> Mesh {
        let mut all = Mesh::default();
        for mesh in meshes {
            let first = all.vertices.len() as u32;
            all.vertices.extend(&mesh.vertices);
            all.faces.extend(mesh.faces.iter().map(|face| face.map(|corner| corner + first)));
        }
        all
    }

    #[test]
    fn keeps_the_largest_and_tells_what_it_dropped() {
        let meshes = [tetrahedron(0.0, 1.0), tetrahedron(50.0, 3.0), tetrahedron(90.0, 2.0)];
        let got = keep_largest_body(together(&meshes));
        assert!((got.mesh.volume() - meshes[1].volume()).abs() < 1e-9);
        assert_eq!((got.mesh.vertices.len(), got.mesh.faces.len(), got.dropped), (4, 4, 2));
        assert!((got.dropped_volume - 9.0 / 36.0).abs() < 1e-12);
    }

    #[test]
    fn a_hollow_is_filled_and_is_no_body() {
        let solid = tetrahedron(0.0, 3.0);
        let got = keep_largest_body(together(&[tetrahedron(0.0, -0.5), solid.clone()]));
        assert_eq!((got.mesh.faces.len(), got.dropped, got.dropped_volume), (4, 0, 0.0));
        assert!((got.mesh.volume() - solid.volume()).abs() < 1e-9);
    }

    #[test]
    fn nothing_stays_nothing() {
        assert_eq!(keep_largest_body(Mesh::default()).mesh, Mesh::default());
    }
}
