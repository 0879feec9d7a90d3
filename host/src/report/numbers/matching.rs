//! How the two views were matched, in figures.

use super::super::Run;
use crate::stage::balls::{px, px2};
use serde::Serialize;
use shared::fixed::ONE;
use shared::stage::correspond::{CutMatch, VertexMatch};
use shared::stage::plane::ImagePlane;

/// The figures of the match.
#[derive(Serialize)]
pub(super) struct Matching {
    right_area_over_left: f64,
    vertical_offset: VerticalOffset,
    /// Null in paper mode, and when the hull was too flat.
    invariants: Option<Invariants>,
    /// Null in paper mode.
    disparity: Option<Disparity>,
    /// Null in paper mode.
    rows: Option<Rows>,
    /// Null in the default mode.
    paper: Option<Paper>,
}

/// Right less left row of the object.
#[derive(Serialize)]
struct VerticalOffset {
    top_px: f64,
    bottom_px: f64,
    applied_px: f64,
}

/// What the invariants of the cut hulls say.
#[derive(Serialize)]
struct Invariants {
    /// The cyclic shift of the least e_omega.
    least_shift: usize,
    /// The shift chosen: that of the least e_omega, but the rows' answer, 0, where both are tied.
    shift: usize,
    /// Whether the least e_omega alone is at the rows' answer.
    agrees_with_rows: bool,
    /// The least e_omega of another shift over that of the chosen one: below 1 for a tie that the rows
    /// decide.
    margin: f64,
    /// For each shift, squared base-two logarithms.
    e_omega: Vec<f64>,
    /// Mean distance of the matched vertices from the disparity plane.
    hull_residual_px: f64,
}

/// disparity = level + slope_u (u - origin_u) + slope_v (v - origin_v).
#[derive(Serialize)]
struct Disparity {
    origin_px: [f64; 2],
    level_px: f64,
    slope_u: f64,
    slope_v: f64,
    /// Depth of the level.
    depth_mm: Option<f64>,
}

/// Crossings of the left contour with the rows.
#[derive(Serialize)]
struct Rows {
    crossings: u32,
    unmatched: u32,
    unmatched_share: f64,
    balls: usize,
}

/// The paper's match.
#[derive(Serialize)]
struct Paper {
    /// First vertices of the matched quadruplets.
    quadruplet_left: usize,
    quadruplet_right: usize,
    /// The least e_omega, squared ratios.
    e_omega: f64,
    matched_vertices: usize,
    /// Right column of a left point.
    map_u: AffinePlane,
    /// Right row of a left point.
    map_v: AffinePlane,
    boundary_pairs: usize,
    skeleton_pairs: usize,
}

/// value = level + slope_u (u - origin_u) + slope_v (v - origin_v).
#[derive(Serialize)]
struct AffinePlane {
    origin_px: [f64; 2],
    level_px: f64,
    slope_u: f64,
    slope_v: f64,
}

fn ratio(x: impl Into<f64>) -> f64 {
    x.into() / f64::from(ONE)
}

impl Matching {
    pub(super) fn of(run: &Run<'_>) -> Self {
        let outcome = &run.reconstruction.outcome;
        let pair = &run.record.pair;
        let paper = outcome.vertices.as_ref().map(|found| Paper {
            boundary_pairs: pair.boundary_pairs.len(),
            skeleton_pairs: pair.skeleton_pairs.len(),
            ..Paper::of(found)
        });
        let default = paper.is_none();
        Self {
            right_area_over_left: f64::from(outcome.areas[1]) / f64::from(outcome.areas[0].max(1)),
            vertical_offset: VerticalOffset {
                top_px: px(outcome.frontier_offsets[0]),
                bottom_px: px(outcome.frontier_offsets[1]),
                applied_px: px(outcome.vertical_offset),
            },
            invariants: outcome.cuts.as_ref().map(|cuts| Invariants::of(cuts, &outcome.plane)),
            disparity: default.then(|| Disparity {
                origin_px: px2(outcome.plane.origin).into(),
                level_px: px(outcome.plane.level),
                slope_u: ratio(outcome.plane.slope_u),
                slope_v: ratio(outcome.plane.slope_v),
                depth_mm: run.reconstruction.camera.depth(px(outcome.plane.level)),
            }),
            rows: default.then(|| Rows {
                crossings: outcome.rows.crossings,
                unmatched: outcome.rows.unmatched,
                unmatched_share: f64::from(outcome.rows.unmatched) / f64::from(outcome.rows.crossings.max(1)),
                balls: pair.balls.len(),
            }),
            paper,
        }
    }
}

impl Invariants {
    fn of(cuts: &CutMatch, plane: &ImagePlane) -> Self {
        let residual = cuts.left.iter().zip(&cuts.right).map(|(a, b)| px((a.u - b.u - plane.at(*a)).abs()));
        Self {
            least_shift: cuts.least,
            shift: cuts.shift,
            agrees_with_rows: cuts.least == 0,
            margin: ratio(cuts.margin()),
            e_omega: cuts.errors.map(ratio).to_vec(),
            hull_residual_px: residual.sum::<f64>() / cuts.left.len() as f64,
        }
    }
}

impl Paper {
    fn of(found: &VertexMatch) -> Self {
        Self {
            quadruplet_left: found.quadruplets.0,
            quadruplet_right: found.quadruplets.1,
            e_omega: ratio(found.error as f64),
            matched_vertices: found.vertices,
            map_u: AffinePlane::of(&found.map.u),
            map_v: AffinePlane::of(&found.map.v),
            boundary_pairs: 0,
            skeleton_pairs: 0,
        }
    }
}

impl AffinePlane {
    fn of(plane: &ImagePlane) -> Self {
        Self {
            origin_px: px2(plane.origin).into(),
            level_px: px(plane.level),
            slope_u: ratio(plane.slope_u),
            slope_v: ratio(plane.slope_v),
        }
    }
}
