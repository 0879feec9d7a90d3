//! Whether the confidence of a vertex says how far it is off.

use host::bvh::Bvh;
use host::mesh::Mesh;
use host::reconstruct::Reconstruction;
use nalgebra::Point3;
use rayon::prelude::*;

/// What is known of a vertex.
#[derive(Clone, Copy, Debug)]
pub struct Vertex {
    /// Its error that the confidence promises, mm.
    pub expected: f64,
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
        Vertex { expected: 1.0 / confidence - 1.0, error: truth.distance(point), visible }
    };
    made.mesh.vertices.par_iter().zip(&front.confidence).map(vertex).collect()
}

/// All vertices, and the visible ones.
const WHICH: [fn(&Vertex) -> bool; 2] = [|_| true, |vertex| vertex.visible];

/// The mean error of the least confident fifth over that of the most confident one, of all vertices and of the visible
/// ones. The fifths are cut within each model, and errors count as parts of its mean error: so it does not matter which
/// model is the worse one.
#[must_use]
pub fn ratios(models: &[&[Vertex]]) -> [f64; 2] {
    WHICH.map(|counts| {
        let (mut least, mut most) = (0.0, 0.0);
        for model in models {
            let mut model: Vec<_> = model.iter().filter(|vertex| counts(vertex)).collect();
            model.sort_by(|a, b| b.expected.total_cmp(&a.expected));
            let mean = |part: &[&Vertex]| part.iter().map(|v| v.error).sum::<f64>() / part.len() as f64;
            let (fifth, of) = (model.len() / 5, mean(&model));
            least += mean(&model[..fifth]) / of;
            most += mean(&model[model.len() - fifth..]) / of;
        }
        least / most
    })
}

/// The mean error in the expected one, the mean over the models: of all vertices, and of the visible ones. Where errors
/// are as expected, and Gaussian, it is sqrt(2 / pi) = .8.
#[must_use]
pub fn shares(models: &[&[Vertex]]) -> [f64; 2] {
    WHICH.map(|counts| {
        let share = |model: &&[Vertex]| {
            let sum =
                |of: fn(&Vertex) -> f64| model.iter().filter(|vertex| counts(vertex)).map(of).sum::<f64>();
            sum(|vertex| vertex.error) / sum(|vertex| vertex.expected)
        };
        models.iter().map(share).sum::<f64>() / models.len() as f64
    })
}
