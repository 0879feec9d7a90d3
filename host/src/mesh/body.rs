//! The separate bodies of a mesh, and the largest of them.
//!
//! Faces that share a vertex belong together. A closed piece of surface that looks outward bounds a body;
//! one that looks inward bounds a hollow, which no camera sees and which is no body.

use super::Mesh;

/// What [`Bodies::keep_largest`] dropped.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dropped {
    /// How many bodies.
    pub bodies: usize,
    /// Their share of the volume of all bodies, 0 to 1.
    pub volume: f64,
}

/// Finds the bodies of one mesh after the other, and allocates nothing once its lists are long enough.
#[derive(Debug, Default)]
pub struct Bodies {
    /// The connected piece of each vertex.
    piece: Vec<u32>,
    /// Of each piece.
    volumes: Vec<f64>,
    /// Where each vertex goes.
    moved: Vec<u32>,
    /// The mesh that is put together.
    kept: Mesh,
}

/// Of a vertex that goes nowhere.
const NOWHERE: u32 = u32::MAX;

impl Bodies {
    /// Keeps the body of greatest volume of a closed mesh, and nothing else: not its hollows either.
    pub fn keep_largest(&mut self, mesh: &mut Mesh) -> Dropped {
        let count = self.find_pieces(mesh);
        if count <= 1 {
            return Dropped::default();
        }
        let of_face = |face: usize| self.piece[mesh.faces[face][0] as usize] as usize;
        self.volumes.clear();
        self.volumes.resize(count, 0.0);
        for face in 0..mesh.faces.len() {
            self.volumes[of_face(face)] += mesh.volume_under(face);
        }
        let volumes = &self.volumes;
        let largest = (1..count).fold(0, |best, i| if volumes[i] >= volumes[best] { i } else { best });
        let bodies = || volumes.iter().filter(|&&volume| volume > 0.0);
        let total: f64 = bodies().sum();
        let dropped = Dropped {
            bodies: bodies().count().saturating_sub(1),
            volume: if total > 0.0 { 1.0 - volumes[largest] / total } else { 0.0 },
        };
        self.extract(mesh, largest as u32);
        dropped
    }

    /// Numbers the connected pieces from 0 in the order of their first vertices, and returns how many there
    /// are; vertices of no face are pieces of their own.
    fn find_pieces(&mut self, mesh: &Mesh) -> usize {
        let parent = &mut self.piece;
        parent.clear();
        parent.extend(0..mesh.vertices.len() as u32);
        for &[a, b, c] in &mesh.faces {
            let joined = join(parent, a, b);
            join(parent, joined, c);
        }
        // A parent never comes after its child, so one pass names them all.
        let mut count = 0;
        for vertex in 0..parent.len() {
            let above = parent[vertex] as usize;
            parent[vertex] = if above == vertex { count } else { parent[above] };
            count += u32::from(above == vertex);
        }
        count as usize
    }

    /// Leaves the faces of a piece, with the vertices that they use, in their order.
    fn extract(&mut self, mesh: &mut Mesh, piece: u32) {
        let kept = &mut self.kept;
        kept.vertices.clear();
        kept.faces.clear();
        self.moved.clear();
        self.moved.resize(mesh.vertices.len(), NOWHERE);
        for face in mesh.faces.iter().filter(|face| self.piece[face[0] as usize] == piece) {
            kept.faces.push(face.map(|corner| {
                let moved = &mut self.moved[corner as usize];
                if *moved == NOWHERE {
                    *moved = kept.vertices.len() as u32;
                    kept.vertices.push(mesh.vertices[corner as usize]);
                }
                *moved
            }));
        }
        std::mem::swap(mesh, kept);
    }
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
        let (mut mesh, mut bodies) = (together(&meshes), Bodies::default());
        let dropped = bodies.keep_largest(&mut mesh);
        assert!((mesh.volume() - meshes[1].volume()).abs() < 1e-9);
        assert_eq!((mesh.vertices.len(), mesh.faces.len(), dropped.bodies), (4, 4, 2));
        assert!((dropped.volume - 9.0 / 36.0).abs() < 1e-12);
        // What is left of one mesh does not get into the next.
        mesh = together(&meshes[..1]);
        assert_eq!((bodies.keep_largest(&mut mesh), &mesh), (Dropped::default(), &meshes[0]));
    }

    #[test]
    fn a_hollow_is_filled_and_is_no_body() {
        let solid = tetrahedron(0.0, 3.0);
        let mut mesh = together(&[tetrahedron(0.0, -0.5), solid.clone()]);
        let dropped = Bodies::default().keep_largest(&mut mesh);
        assert_eq!((mesh.faces.len(), dropped), (4, Dropped::default()));
        assert!((mesh.volume() - solid.volume()).abs() < 1e-9);
    }

    #[test]
    fn nothing_stays_nothing() {
        let mut mesh = Mesh::default();
        Bodies::default().keep_largest(&mut mesh);
        assert_eq!(mesh, Mesh::default());
    }
}
