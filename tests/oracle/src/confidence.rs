//! Whether the confidence of a vertex says how far it is off.

use host::bvh::Bvh;
use host::mesh::Mesh;
use host::reconstruct::Reconstruction;
use nalgebra::Point3;
use rayon::prelude::*;

/// What is known of a vertex.
#[derive(Clone, Copy, Debug)]
pub struct Vertex {
    /// What the front says.
    pub confidence: f64,
    /// Distance to the truth, mm.
    pub error: f64,
    /// Whether the left eye sees it.
    pub visible: bool,
}

/// The vertices of a measured model, in the left camera's axes as its truth is; none if nothing was measured.
#[must_use]
pub fn vertices(made: &Reconstruction, truth: &Mesh) -> Vec<Vertex> {
    let Some(front) = &made.front else { return Vec::new() };
    let (itself, truth) = (Bvh::new(&made.mesh), Bvh::new(truth));
    let vertex = |(point, &confidence): (&Point3<f64>, &f64)| {
        let hit = itself.first_hit(&Point3::origin(), &point.coords);
        let visible = hit.is_none_or(|hit| hit.parameter > 1.0 - 1e-3);
        Vertex { confidence, error: truth.distance(point), visible }
    };
    made.mesh.vertices.par_iter().zip(&front.confidence).map(vertex).collect()
}

/// The mean error of the least confident fifth over that of the most confident one: of all vertices, and of the
/// visible ones.
#[must_use]
pub fn ratios(vertices: &[Vertex]) -> [f64; 2] {
    let ratio = |mut vertices: Vec<Vertex>| {
        vertices.sort_by(|a, b| a.confidence.total_cmp(&b.confidence));
        let fifth = vertices.len() / 5;
        let sum = |part: &[Vertex]| part.iter().map(|vertex| vertex.error).sum::<f64>();
        sum(&vertices[..fifth]) / sum(&vertices[vertices.len() - fifth..])
    };
    [ratio(vertices.to_vec()), ratio(vertices.iter().copied().filter(|vertex| vertex.visible).collect())]
}
