//! `report.json`: every figure of a run.
//!
//! Field names are stable within a `format_version` and carry their unit (`_px`, `_mm`, `_ms`; `_px2` is an
//! area in pixels, `_share` a part of one); what a mode does not have, or a device does not send, is `null`. Pixels are those of the
//! rectified images. All but `times_ms` is the same for every run on the same input.

mod choices;
mod curves;
mod eye;
mod front;
mod matching;

use super::times::{Part, stages};
use super::{Run, words};
use crate::curves::spline::Spline;
use crate::reconstruct::{Mode, Reconstruction, Refusal, Unmeasured};
use choices::{Calibration, Choices, Images};
use curves::Curve;
use eye::EyeFigures;
use front::Front;
use matching::Matching;
use serde::Serialize;
use shared::pipeline::{Finding, Side};
use std::time::Duration;

/// Version of the fields.
const FORMAT_VERSION: u32 = 1;

#[derive(Serialize)]
struct Report {
    format: &'static str,
    format_version: u32,
    /// Of the program.
    version: &'static str,
    options: Choices,
    images: Images,
    calibration: Calibration,
    eyes: Eyes<EyeFigures>,
    matching: Matching,
    /// Everything the user should know about the input.
    gates: Vec<Gate>,
    model: Model,
    /// What of it was measured, and what is inferred.
    front: Front,
    /// The compact description: the skeleton's branches as NURBS.
    curves: Eyes<Vec<Curve>>,
    /// Those of the left view in space; `null` in paper mode, which describes each view by itself.
    curves_mm: Option<Vec<Spline>>,
    times_ms: Times,
}

#[derive(Serialize)]
struct Eyes<T> {
    left: T,
    right: T,
}

impl<T> Eyes<T> {
    fn of([left, right]: [T; 2]) -> Self {
        Self { left, right }
    }
}

/// A finding.
#[derive(Serialize)]
pub(super) struct Gate {
    name: &'static str,
    /// `warning`, or `refusal` where only the paper's mode goes on.
    severity: &'static str,
    sentence: String,
}

impl Gate {
    /// Everything that was found about a model.
    pub(super) fn all(made: &Reconstruction) -> Vec<Self> {
        let findings = made.outcome.findings.iter().map(Self::of);
        findings.chain(made.unmeasured.map(Self::unmeasured)).collect()
    }

    pub(super) fn of(finding: &Finding) -> Self {
        Self {
            name: words::name(finding),
            severity: if finding.refuses() { "refusal" } else { "warning" },
            sentence: words::sentence(finding),
        }
    }

    /// What is no finding of the core, but leaves a part of the model to balls.
    fn unmeasured(why: Unmeasured) -> Self {
        Self { name: "unmeasured", severity: "warning", sentence: words::unmeasured(why).into() }
    }

    /// What is no finding of the core, but leaves no model either.
    pub(super) fn refusal(refusal: &Refusal) -> Self {
        Self { name: "refused", severity: "refusal", sentence: refusal.to_string() }
    }
}

/// The solid; its lengths are in the left camera's axes.
#[derive(Serialize)]
struct Model {
    vertices: usize,
    faces: usize,
    volume_mm3: f64,
    surface_area_mm2: f64,
    lowest_mm: Option<[f64; 3]>,
    highest_mm: Option<[f64; 3]>,
    /// Depth of the middle of its box.
    depth_mm: Option<f64>,
    /// Grid spacing of the mesh.
    cell_mm: f64,
    cones: usize,
    bodies_dropped: usize,
    volume_dropped_share: f64,
    skeleton_points: usize,
    /// Length of the curve skeleton; the paper's is a set of points.
    skeleton_length_mm: Option<f64>,
    boundary_points: usize,
}

impl Model {
    fn of(run: &Run<'_>) -> Self {
        let made = run.reconstruction;
        let mesh = &made.mesh;
        let bounds = mesh.bounds();
        let (volume_mm3, surface_area_mm2) = mesh.volume_and_area();
        let length = |[a, b]: &[u32; 2]| {
            (made.skeleton.points[*b as usize] - made.skeleton.points[*a as usize]).norm()
        };
        let edges = &made.skeleton.edges;
        Self {
            vertices: mesh.vertices.len(),
            faces: mesh.faces.len(),
            volume_mm3,
            surface_area_mm2,
            lowest_mm: bounds.map(|b| b[0].into()),
            highest_mm: bounds.map(|b| b[1].into()),
            depth_mm: bounds.map(|[low, high]| (low.z + high.z) / 2.0),
            cell_mm: made.cell,
            cones: made.cones,
            bodies_dropped: made.dropped.0,
            volume_dropped_share: made.dropped.1,
            skeleton_points: made.skeleton.points.len(),
            skeleton_length_mm: (!edges.is_empty()).then(|| edges.iter().map(length).sum()),
            boundary_points: made.boundary.points.len(),
        }
    }
}

/// Times, ms.
#[derive(Serialize)]
struct Times {
    /// Of the host's stages, in their order; `core` holds all of the core's.
    host: serde_json::Map<String, serde_json::Value>,
    left: serde_json::Map<String, serde_json::Value>,
    right: serde_json::Map<String, serde_json::Value>,
    pair: serde_json::Map<String, serde_json::Value>,
}

impl Times {
    fn of(run: &Run<'_>) -> Self {
        let of = |part: Part| {
            let stages = stages(run).into_iter().filter(|stage| stage.part == part);
            let ms = |time: Duration| (time.as_secs_f64() * 1e6).round() / 1e3;
            stages.map(|stage| (stage.name.into(), ms(stage.time).into())).collect()
        };
        let [left, right] = [Side::Left, Side::Right].map(|side| of(Part::Eye(side)));
        Self { host: of(Part::Host), left, right, pair: of(Part::Pair) }
    }
}

/// The left view's curves in space.
fn splines(run: &Run<'_>) -> Vec<Spline> {
    let (left, camera) = (&run.record.eyes[0].parts, &run.reconstruction.camera);
    left.branches.iter().filter_map(|branch| Spline::of(branch, &left.controls, camera)).collect()
}

/// `report.json` of a run.
#[must_use]
pub fn json(run: &Run<'_>) -> Vec<u8> {
    let eyes = &run.record.eyes;
    let report = Report {
        format: "ossature-report",
        format_version: FORMAT_VERSION,
        version: env!("CARGO_PKG_VERSION"),
        options: Choices::of(run),
        images: Images::of(run),
        calibration: Calibration::of(run),
        eyes: Eyes::of([EyeFigures::of(&eyes[0].parts), EyeFigures::of(&eyes[1].parts)]),
        matching: Matching::of(run),
        gates: Gate::all(run.reconstruction),
        model: Model::of(run),
        front: Front::of(run),
        curves: Eyes::of([Curve::all(&eyes[0].parts), Curve::all(&eyes[1].parts)]),
        curves_mm: (run.options.mode == Mode::Default).then(|| splines(run)),
        times_ms: Times::of(run),
    };
    // Names are strings and numbers finite or null: nothing here can fail to be JSON.
    let mut text = serde_json::to_vec_pretty(&report).unwrap_or_default();
    text.push(b'\n');
    text
}

#[cfg(test)]
mod tests;
