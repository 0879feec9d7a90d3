//! The paper's Figures 13 and 14: the animal grown from skeletons of more and more branches.

use rayon::prelude::*;
use serde::Serialize;

use super::Effort;
use super::study::Subject;
use crate::mesh::Mesh;
use crate::reconstruct::{Options, Skeleton};
use crate::report::record::Record;

/// The model of one skeleton.
#[derive(Debug, Serialize)]
pub(super) struct Point {
    /// Branches asked for.
    pub(super) branches: u16,
    /// Branches that the left skeleton has.
    pub(super) found: usize,
    /// Symmetric mean error, mm.
    pub(super) mean_mm: Option<f64>,
    /// The same, % of the truth's diagonal.
    pub(super) mean_pct: Option<f64>,
    /// Mean distance from the truth to the model, mm: what is missing weighs here.
    pub(super) missing_mm: Option<f64>,
    /// Volume in common over volume of either.
    pub(super) volume_iou: Option<f64>,
    /// Why there is no model.
    pub(super) refused: Option<String>,
}

/// A model for each number of branches.
pub(super) fn grow(
    subject: &Subject,
    effort: &Effort,
    step: &(dyn Fn() + Sync),
) -> Vec<(Point, Option<Mesh>)> {
    let one = |branches: &u16| {
        let mut record = Record::figures_only();
        let options = Options {
            skeleton: Skeleton::Nurbs,
            branches: Some(*branches),
            cell: effort.cell,
            ..Options::default()
        };
        let (mesh, refused) = match subject.model(&options, &mut record) {
            Ok(made) => (Some(made.mesh), None),
            Err(reason) => (None, Some(reason)),
        };
        let measured = mesh.as_ref().map(|mesh| subject.measure(mesh, effort));
        let distance = measured.as_ref().and_then(|e| e.distance);
        let point = Point {
            branches: *branches,
            found: record.eyes[0].parts.branches.len(),
            mean_mm: distance.map(|d| d.symmetric.mean_mm),
            mean_pct: distance.map(|d| d.symmetric.mean_pct),
            missing_mm: distance.map(|d| d.truth_to_model.mean_mm),
            volume_iou: measured.and_then(|e| e.volume_iou),
            refused,
        };
        step();
        (point, mesh)
    };
    effort.branches.par_iter().map(one).collect()
}
