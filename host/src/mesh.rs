//! A triangle mesh in millimetres: what the surface stage makes, and what files and renderers take.

pub mod body;
pub mod read;

use nalgebra::{Point3, Vector3};

/// Triangles over shared vertices.
///
/// Coordinates are millimetres in the left camera's axes (x right, y down, z forward). Seen from
/// outside, the corners of a face run counter-clockwise, so that normals point outward.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions, mm.
    pub vertices: Vec<Point3<f64>>,
    /// Corners of each triangle, as indices into `vertices`.
    pub faces: Vec<[u32; 3]>,
}

impl Mesh {
    /// Positions of the corners of face `face`, mm.
    ///
    /// # Panics
    ///
    /// If there is no such face.
    #[must_use]
    pub fn corners(&self, face: usize) -> [Point3<f64>; 3] {
        self.faces[face].map(|corner| self.vertices[corner as usize])
    }

    /// Outward normal of face `face`, its length twice the face's area, mm².
    ///
    /// # Panics
    ///
    /// If there is no such face.
    #[must_use]
    pub fn area_normal(&self, face: usize) -> Vector3<f64> {
        let [a, b, c] = self.corners(face);
        (b - a).cross(&(c - a))
    }

    /// The lowest and the highest coordinates of the vertices, mm; none of an empty mesh.
    #[must_use]
    pub fn bounds(&self) -> Option<[Point3<f64>; 2]> {
        let &first = self.vertices.first()?;
        let grow = |[low, high]: [Point3<f64>; 2], p: &Point3<f64>| [low.inf(p), high.sup(p)];
        Some(self.vertices.iter().fold([first; 2], grow))
    }

    /// The volume that a closed mesh bounds, mm³; negative when its faces look inward.
    #[must_use]
    pub fn volume(&self) -> f64 {
        (0..self.faces.len()).map(|face| self.volume_under(face)).sum()
    }

    /// The volume that a closed mesh bounds, mm³, as [`Mesh::volume`], and the area of its surface, mm², in
    /// one pass.
    #[must_use]
    pub fn volume_and_area(&self) -> (f64, f64) {
        (0..self.faces.len()).fold((-0.0, -0.0), |(volume, area), face| {
            (volume + self.volume_under(face), area + self.area_normal(face).norm() / 2.0)
        })
    }

    /// The part of the volume between face `face` and the first vertex, mm³, signed. Measured from a
    /// vertex and not from the camera, a far-off mesh loses no digits.
    fn volume_under(&self, face: usize) -> f64 {
        let apex = self.vertices[0];
        let [a, b, c] = self.corners(face).map(|p| p - apex);
        a.dot(&b.cross(&c)) / 6.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The corner of a box of 1 x 2 x 3 mm, away from the origin.
    fn tetrahedron() -> Mesh {
        let vertices = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]]
            .map(|v| Point3::from(v) + Vector3::new(7.0, 8.0, 9.0));
        Mesh { vertices: vertices.to_vec(), faces: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] }
    }

    #[test]
    fn measures_a_tetrahedron() {
        let mesh = tetrahedron();
        assert_eq!(mesh.volume(), 1.0);
        assert_eq!(mesh.volume_and_area(), (1.0, 9.0));
        assert_eq!(mesh.area_normal(0), Vector3::new(0.0, 0.0, -2.0));
        assert_eq!(mesh.bounds(), Some([Point3::new(7.0, 8.0, 9.0), Point3::new(8.0, 10.0, 12.0)]));
        let turned = Mesh { faces: mesh.faces.iter().map(|&[a, b, c]| [a, c, b]).collect(), ..mesh };
        assert_eq!(turned.volume(), -1.0);
    }

    #[test]
    fn an_empty_mesh_has_no_bounds_and_no_volume() {
        assert_eq!(Mesh::default().bounds(), None);
        assert_eq!(Mesh::default().volume(), 0.0);
    }
}
