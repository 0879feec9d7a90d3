//! Distances between two surfaces.
//!
//! In: two meshes with their trees of boxes. Out: statistics of the exact distances from points spread
//! evenly over either surface to the other. The points are drawn in equal steps of area, one at random
//! in each step (stratified sampling), which leaves less to chance than independent points. Cost:
//! O(samples log faces).

use nalgebra::Point3;
use rayon::prelude::*;
use serde::Serialize;

use super::Options;
use crate::bvh::Bvh;
use crate::mesh::Mesh;
use crate::random::Random;

/// Statistics of distances in one direction or both.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Deviation {
    /// Mean, mm.
    pub mean_mm: f64,
    /// Root of the mean square, mm.
    pub rms_mm: f64,
    /// 95th percentile, mm.
    pub p95_mm: f64,
    /// Maximum over the samples, mm.
    pub max_mm: f64,
    /// Mean, % of the diagonal of the truth's box; likewise those that follow.
    pub mean_pct: f64,
    /// Root of the mean square, %.
    pub rms_pct: f64,
    /// 95th percentile, %.
    pub p95_pct: f64,
    /// Maximum over the samples, %.
    pub max_pct: f64,
}

/// Distances both ways.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Distances {
    /// From points of the model to the truth.
    pub model_to_truth: Deviation,
    /// From points of the truth to the model.
    pub truth_to_model: Deviation,
    /// Of both together; its mean weighs both directions alike.
    pub symmetric: Deviation,
}

/// Distances between `meshes`, model and truth; `None` if either has no area.
pub(super) fn distances(
    meshes: [&Mesh; 2],
    trees: &[Bvh; 2],
    diagonal: f64,
    options: &Options,
) -> Option<Distances> {
    let from = |mesh: &Mesh, other: &Bvh, seed: u64| -> Option<Vec<f64>> {
        let points = samples(mesh, options.samples, seed)?;
        Some(points.par_iter().map(|point| other.distance(point)).collect())
    };
    let model = from(meshes[0], &trees[1], options.seed)?;
    let truth = from(meshes[1], &trees[0], options.seed.wrapping_add(1))?;
    let both = [model.as_slice(), &truth].concat();
    Some(Distances {
        model_to_truth: Deviation::of(model, diagonal),
        truth_to_model: Deviation::of(truth, diagonal),
        symmetric: Deviation::of(both, diagonal),
    })
}

/// Points on a mesh, evenly spread by area; `None` if it has none.
fn samples(mesh: &Mesh, count: usize, seed: u64) -> Option<Vec<Point3<f64>>> {
    let mut total = 0.0;
    let ends: Vec<f64> = mesh
        .faces
        .iter()
        .map(|face| {
            let [a, b, c] = face.map(|v| mesh.vertices[v as usize]);
            total += (b - a).cross(&(c - a)).norm();
            total
        })
        .collect();
    if count == 0 || total.partial_cmp(&0.0) != Some(std::cmp::Ordering::Greater) {
        return None;
    }
    let mut random = Random::new(seed);
    let point = |step: usize| {
        let area = total * (step as f64 + random.uniform()) / count as f64;
        let face = ends.partition_point(|&end| end <= area).min(ends.len() - 1);
        let [a, b, c] = mesh.faces[face].map(|v| mesh.vertices[v as usize]);
        // Uniform on the triangle (Turk 1990).
        let (root, along) = (random.uniform().sqrt(), random.uniform());
        a + (b - a) * (root * (1.0 - along)) + (c - a) * (root * along)
    };
    Some((0..count).map(point).collect())
}

impl Deviation {
    /// The statistics of at least one distance.
    fn of(mut distances: Vec<f64>, diagonal: f64) -> Self {
        distances.sort_by(f64::total_cmp);
        let n = distances.len() as f64;
        let mean_mm = distances.iter().sum::<f64>() / n;
        let rms_mm = (distances.iter().map(|d| d * d).sum::<f64>() / n).sqrt();
        let p95_mm = percentile(&distances, 0.95);
        let max_mm = percentile(&distances, 1.0);
        let [mean_pct, rms_pct, p95_pct, max_pct] =
            [mean_mm, rms_mm, p95_mm, max_mm].map(|mm| 100.0 * mm / diagonal);
        Self { mean_mm, rms_mm, p95_mm, max_mm, mean_pct, rms_pct, p95_pct, max_pct }
    }
}

/// Percentile of sorted values, linear between neighbours.
fn percentile(sorted: &[f64], part: f64) -> f64 {
    let place = part * (sorted.len() - 1) as f64;
    let below = sorted[place.floor() as usize];
    below + (sorted[place.ceil() as usize] - below) * place.fract()
}
