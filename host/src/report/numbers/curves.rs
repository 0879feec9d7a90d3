//! The skeleton's branches as NURBS: with these a reader can rebuild every ball.

use super::super::record::Parts;
use crate::curves::spline::{DEGREE, knots};
use crate::stage::balls::px;
use serde::Serialize;
use shared::fixed::ONE;
use shared::pipeline::Branch;
use shared::stage::nurbs::Control;

/// A rational B-spline in (u, v, radius, disparity), px.
///
/// The knots of a closed curve are periodic: its first three control points follow once more after the
/// last. Evaluated radii are floored at 0.3 px.
#[derive(Serialize)]
pub(super) struct Curve {
    degree: usize,
    closed: bool,
    /// Nodes of the graph at its ends.
    nodes: [u16; 2],
    /// In spans: the curve runs from 0 to the number of spans.
    knots: Vec<i32>,
    controls: Vec<ControlPoint>,
}

#[derive(Serialize)]
struct ControlPoint {
    u_px: f64,
    v_px: f64,
    radius_px: f64,
    /// 0 where a view is described by itself, as the paper does.
    disparity_px: f64,
    weight: f64,
}

impl ControlPoint {
    fn of(control: &Control) -> Self {
        let ball = control.ball;
        Self {
            u_px: px(ball.u),
            v_px: px(ball.v),
            radius_px: px(ball.rho),
            disparity_px: px(ball.d),
            weight: f64::from(control.weight) / f64::from(ONE),
        }
    }
}

impl Curve {
    /// All curves of an eye.
    pub(super) fn all(eye: &Parts) -> Vec<Self> {
        eye.branches.iter().filter_map(|branch| Self::of(branch, &eye.controls)).collect()
    }

    fn of(branch: &Branch, controls: &[Control]) -> Option<Self> {
        let curve = branch.curve(controls)?;
        Some(Self {
            degree: DEGREE,
            closed: curve.closed(),
            nodes: branch.nodes,
            knots: knots(curve.controls().len(), curve.closed()),
            controls: curve.controls().iter().map(ControlPoint::of).collect(),
        })
    }
}
