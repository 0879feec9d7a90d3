//! The paper's Table 4: cross-sections along the longest axis, compared outline by outline.
//!
//! In: two meshes. Out: for planes in the middle of equal slices of the truth, the mean distance from
//! points of either outline to the nearest point of the other. Points lie every 0.1 mm, so that a
//! distance of zero may read as up to 0.05 mm and one of 0.5 mm is right to 0.003 mm. Cost: O(faces) a
//! section and O(n log n) for its n points.

use nalgebra::{Matrix3, Point3, SymmetricEigen, Vector3};
use rayon::prelude::*;
use serde::Serialize;

use super::bounds;
use crate::bvh::Bvh;
use crate::mesh::Mesh;

/// Distance between points along an outline, mm.
const STEP: f64 = 0.1;
/// How much more the surface must spread along its longest axis than along the second for that axis
/// to be well defined.
const DISTINCT: f64 = 1.1;

/// One cross-section.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Section {
    /// Number of the section, from 1.
    pub section: usize,
    /// Mean distance from the model's outline to the truth's, mm; `None` if the plane misses either.
    pub model_to_truth_mm: Option<f64>,
    /// Mean distance the other way, mm.
    pub truth_to_model_mm: Option<f64>,
}

/// The table of cross-sections.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sections {
    /// Unit vector across which the sections lie.
    pub axis: [f64; 3],
    /// The sections, in order along the axis.
    pub rows: Vec<Section>,
    /// Mean of the rows' distances from model to truth, mm; `None` if all are missing.
    pub mean_mm: Option<f64>,
    /// Number of planes that miss either mesh.
    pub missing: usize,
}

/// The table of `count` sections.
pub(super) fn sections(model: &Mesh, truth: &Mesh, count: usize) -> Sections {
    let axis = long_axis(truth);
    let rows = sections_of(model, truth, &axis, count, &|_| true);
    let found: Vec<f64> = rows.iter().filter_map(|row| row.model_to_truth_mm).collect();
    Sections {
        axis: axis.into(),
        missing: count - found.len(),
        mean_mm: (!found.is_empty()).then(|| found.iter().sum::<f64>() / found.len() as f64),
        rows,
    }
}

/// The sections of a part of the truth, in the middle of `count` equal slices of it across `axis` (a unit
/// vector). Distances run from the points that belong to the part to all of the other outline.
pub fn sections_of(
    model: &Mesh,
    truth: &Mesh,
    axis: &Vector3<f64>,
    count: usize,
    belongs: &(impl Fn(&Point3<f64>) -> bool + Sync),
) -> Vec<Section> {
    let heights = truth.vertices.iter().filter(|v| belongs(v)).map(|v| v.coords.dot(axis));
    let (low, high) =
        heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), h| (low.min(h), high.max(h)));
    let row = |i: usize| {
        let height = low + (i as f64 + 0.5) / count as f64 * (high - low);
        let points = [model, truth].map(|mesh| outline(mesh, axis, height));
        let [to_truth, to_model] = [(0, 1), (1, 0)].map(|(from, to)| {
            let own: Vec<_> = points[from].iter().copied().filter(belongs).collect();
            (!own.is_empty() && !points[to].is_empty()).then(|| mean_distance(&own, &points[to]))
        });
        Section { section: i + 1, model_to_truth_mm: to_truth, truth_to_model_mm: to_model }
    };
    (0..count).into_par_iter().map(row).collect()
}

/// Principal axis of the surface; the longest side of its box where the first two spreads are alike.
/// Its largest component is positive.
fn long_axis(mesh: &Mesh) -> Vector3<f64> {
    let eigen = SymmetricEigen::new(covariance(mesh));
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let axis = if eigen.eigenvalues[order[0]] > DISTINCT * eigen.eigenvalues[order[1]] {
        eigen.eigenvectors.column(order[0]).into_owned()
    } else {
        let [low, high] = bounds(mesh);
        let mut axis = Vector3::zeros();
        axis[(high - low).imax()] = 1.0;
        axis
    };
    axis * axis[axis.iamax()].signum()
}

/// Covariance of a point anywhere on the surface: for a triangle with corners `p`, the integral of
/// `x x^T` is its area / 12 times (sum of `p p^T` + (sum of p)(sum of p)^T).
fn covariance(mesh: &Mesh) -> Matrix3<f64> {
    let origin = bounds(mesh)[0];
    let (mut area, mut first, mut second) = (0.0, Vector3::zeros(), Matrix3::zeros());
    for face in &mesh.faces {
        let corners = face.map(|v| mesh.vertices[v as usize] - origin);
        let [a, b, c] = corners;
        let part = 0.5 * (b - a).cross(&(c - a)).norm();
        let sum = a + b + c;
        let squares = corners.iter().map(|p| p * p.transpose()).sum::<Matrix3<f64>>();
        area += part;
        first += sum * (part / 3.0);
        second += (squares + sum * sum.transpose()) * (part / 12.0);
    }
    let mean = first / area.max(f64::MIN_POSITIVE);
    second / area.max(f64::MIN_POSITIVE) - mean * mean.transpose()
}

/// Points along the mesh's cut by a plane.
fn outline(mesh: &Mesh, axis: &Vector3<f64>, height: f64) -> Vec<Point3<f64>> {
    let mut points = Vec::new();
    for face in &mesh.faces {
        let corners = face.map(|v| mesh.vertices[v as usize]);
        let above = corners.map(|p| p.coords.dot(axis) - height);
        let mut ends = (0..3).filter_map(|i| {
            let j = (i + 1) % 3;
            let crosses = (above[i] < 0.0) != (above[j] < 0.0);
            crosses.then(|| corners[i] + (corners[j] - corners[i]) * (above[i] / (above[i] - above[j])))
        });
        let (Some(from), Some(to)) = (ends.next(), ends.next()) else { continue };
        let count = ((to - from).norm() / STEP).ceil().max(1.0) as usize;
        points.extend((0..count).map(|i| from + (to - from) * ((i as f64 + 0.5) / count as f64)));
    }
    points
}

/// Mean distance from points to the nearest of others.
fn mean_distance(from: &[Point3<f64>], to: &[Point3<f64>]) -> f64 {
    let others = Bvh::of_triangles(&to.iter().map(|&p| [p; 3]).collect::<Vec<_>>());
    from.iter().map(|point| others.distance(point)).sum::<f64>() / from.len() as f64
}
