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

/// The mean error of the least confident fifth over that of the most confident one, of all vertices and of the visible
/// ones. The fifths are cut within each model, and errors count as parts of its mean error: so it does not matter which
/// model is the worse one.
#[must_use]
pub fn ratios(models: &[&[Vertex]]) -> [f64; 2] {
    let all = |_: &&Vertex| true;
    let visible = |vertex: &&Vertex| vertex.visible;
    let ratio = |counts: &dyn Fn(&&Vertex) -> bool| {
        let (mut least, mut most) = (0.0, 0.0);
        for model in models {
            let mut model: Vec<_> = model.iter().filter(counts).collect();
            model.sort_by(|a, b| a.confidence.total_cmp(&b.confidence));
            let mean = |part: &[&Vertex]| part.iter().map(|v| v.error).sum::<f64>() / part.len() as f64;
            let (fifth, of) = (model.len() / 5, mean(&model));
            least += mean(&model[..fifth]) / of;
            most += mean(&model[model.len() - fifth..]) / of;
        }
        least / most
    };
    [ratio(&all), ratio(&visible)]
}
