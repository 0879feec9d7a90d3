//! What one eye's picture gave, in figures.

use super::super::record::Parts;
use crate::stage::balls::px;
use serde::Serialize;
use shared::stage::binarise::Tone;
use shared::stage::contour::ContourLoop;
use shared::stage::distance::DISTANCE_PX;
use shared::stage::graph::NodeKind;

/// The figures of an eye.
#[derive(Serialize)]
pub(super) struct EyeFigures {
    /// Grey values above it are bright.
    threshold_grey: u8,
    /// `bright` or `dark`: the object's side of the threshold.
    tone: Option<&'static str>,
    /// How many pixels have each grey value, 0 to 255.
    histogram_px: Option<Vec<u32>>,
    area_px2: usize,
    /// First column and row of the object.
    first_px: Option<[u16; 2]>,
    /// Last column and row of the object.
    last_px: Option<[u16; 2]>,
    components: Option<u32>,
    largest_component_px2: Option<u32>,
    second_component_px2: Option<u32>,
    boundary_px: Option<usize>,
    contour_points: Option<usize>,
    contour_loops: Option<usize>,
    contour_length_px: Option<f64>,
    /// Radius of the largest disc about a pixel.
    widest_px: Option<f64>,
    thinning_cycles: Option<u32>,
    thinning_deleted_px: Option<u32>,
    edges_before_pruning: Option<usize>,
    edges: Option<usize>,
    branches_pruned: Option<usize>,
    pixels_pruned: Option<usize>,
    ends: Option<usize>,
    junctions: Option<usize>,
    isolated: Option<usize>,
    rings: Option<usize>,
    hull_vertices: usize,
    control_points: usize,
}

impl EyeFigures {
    pub(super) fn of(eye: &Parts) -> Self {
        // A device sends neither rasters nor graphs, and the contour of the left eye alone.
        let seen = eye.tone.is_some();
        let traced = seen || !eye.contour.is_empty();
        let nodes = |kind| seen.then(|| eye.nodes.iter().filter(|n| n.kind == kind).count());
        Self {
            threshold_grey: eye.level,
            tone: eye.tone.map(|tone| match tone {
                Tone::Bright => "bright",
                Tone::Dark => "dark",
            }),
            histogram_px: seen.then(|| eye.histogram.clone()),
            area_px2: eye.area,
            first_px: eye.bounds.map(|b| [b.min.u, b.min.v]),
            last_px: eye.bounds.map(|b| [b.max.u, b.max.v]),
            components: seen.then_some(eye.components.count),
            largest_component_px2: seen.then_some(eye.components.largest),
            second_component_px2: seen.then_some(eye.components.second),
            boundary_px: seen.then_some(eye.boundary),
            contour_points: traced.then_some(eye.contour.len()),
            contour_loops: traced.then_some(eye.loops.len()),
            contour_length_px: traced.then(|| eye.loops.iter().map(|l| length(eye, *l)).sum()),
            widest_px: seen.then_some(f64::from(eye.widest) / f64::from(DISTANCE_PX)),
            thinning_cycles: seen.then_some(eye.thinning.cycles),
            thinning_deleted_px: seen.then_some(eye.thinning.deleted),
            edges_before_pruning: seen.then_some(eye.pruning.edges_before),
            edges: seen.then_some(eye.pruning.edges_after),
            branches_pruned: seen.then_some(eye.pruning.branches_removed),
            pixels_pruned: seen.then_some(eye.pruning.pixels_removed),
            ends: nodes(NodeKind::End),
            junctions: nodes(NodeKind::Junction),
            isolated: nodes(NodeKind::Isolated),
            rings: nodes(NodeKind::Loop),
            hull_vertices: eye.hull.len(),
            control_points: eye.controls.len(),
        }
    }
}

/// Length of a loop of the contour, px.
fn length(eye: &Parts, l: ContourLoop) -> f64 {
    let step = |i: usize| px(eye.contour[i].at.distance(eye.contour[l.step(i, 1)].at));
    l.range().map(step).sum()
}
