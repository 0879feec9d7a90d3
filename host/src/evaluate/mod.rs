//! How far a reconstructed mesh is from the truth.
//!
//! In: two meshes in the left camera's frame, mm, and the views whose silhouettes are compared. Out: an
//! [`Evaluation`]. The truth should be closed and outward; of the model nothing is asked. Each measure
//! is a file here: distances between the surfaces, overlap of the volumes, the cross-sections of the
//! paper's Table 4, and closedness and bodies. The same input gives the same bits for any number of
//! threads.

use nalgebra::Point3;
use serde::Serialize;

use crate::bvh::Bvh;
use crate::mesh::Mesh;
use crate::render::Silhouette;
use crate::view::View;

mod distance;
mod sections;
mod topology;
mod volume;

pub use distance::{Deviation, Distances};
pub use sections::{Section, Sections, sections_of};

/// How finely to measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Points on each surface from which distances are measured.
    pub samples: usize,
    /// Cells along each side of the grid on which volumes are compared.
    pub grid: usize,
    /// Number of cross-sections along the longest axis.
    pub sections: usize,
    /// Seed of the samples.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self { samples: 20_000, grid: 96, sections: 8, seed: 0 }
    }
}

/// All measures of a model against the truth.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evaluation {
    /// Vertices of the model.
    pub vertices: usize,
    /// Faces of the model.
    pub faces: usize,
    /// Whether every edge of the model's faces is matched by one the other way round.
    pub closed: bool,
    /// Parts of the model that no edge joins.
    pub bodies: usize,
    /// Diagonal of the truth's box, mm: what percentages refer to.
    pub truth_diagonal_mm: f64,
    /// Distances between the surfaces; `None` if either has no area.
    pub distance: Option<Distances>,
    /// Volume that both hold over volume that either holds; `None` unless both are closed.
    pub volume_iou: Option<f64>,
    /// The model's volume over the truth's; `None` unless the model is closed.
    pub volume_ratio: Option<f64>,
    /// Pixels in both silhouettes over pixels in either, for each view.
    pub silhouette_iou: Vec<f64>,
    /// Cross-sections along the longest axis.
    pub sections: Sections,
}

/// Measures `model` against `truth`.
pub fn evaluate<V: View>(model: &Mesh, truth: &Mesh, views: &[V], options: &Options) -> Evaluation {
    let trees = [Bvh::new(model), Bvh::new(truth)];
    let closed = topology::is_closed(model);
    let [low, high] = bounds(truth);
    let diagonal = (high - low).norm();
    let silhouette_iou = views
        .iter()
        .map(|view| Silhouette::of(model, &trees[0], view).iou(&Silhouette::of(truth, &trees[1], view)))
        .collect();
    Evaluation {
        vertices: model.vertices.len(),
        faces: model.faces.len(),
        closed,
        bodies: topology::bodies(model),
        truth_diagonal_mm: diagonal,
        distance: distance::distances([model, truth], &trees, diagonal, options),
        volume_iou: (closed && topology::is_closed(truth)).then(|| volume::iou(model, truth, options.grid)),
        volume_ratio: closed.then(|| (volume::signed(model) / volume::signed(truth)).abs()),
        silhouette_iou,
        sections: sections::sections(model, truth, options.sections),
    }
}

/// Lower and upper corner of the box around a mesh, mm; empty for a mesh without vertices.
fn bounds(mesh: &Mesh) -> [Point3<f64>; 2] {
    let Some(first) = mesh.vertices.first() else { return [Point3::origin(); 2] };
    mesh.vertices.iter().fold([*first; 2], |[low, high], v| [low.inf(v), high.sup(v)])
}

#[cfg(test)]
mod tests;
