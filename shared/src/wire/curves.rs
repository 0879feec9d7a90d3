//! A shape's branches with their curves.
//!
//! ```text
//! each branch:  both nodes | number of control points | closed 1 bit | weighted 1
//! each control: u, v | radius | disparity beyond the plane | weight 32 bits where weighted
//! ```
//!
//! A curve that is not weighted has unit weights, as every fit gives them.

use super::WireError;
use super::outline::{Positions, disparity, excess, length, sent, steps};
use super::rice::{BitReader, BitWriter, Channel, Expect};
use super::shape::{POSITION_STEP, Shape, ShapeLists};
use crate::fixed::ONE;
use crate::limits::{CapacityError, push};
use crate::pipeline::Branch;
use crate::point::PixelPoint;
use crate::stage::branch::Ball;
use crate::stage::nurbs::Control;
use crate::stage::plane::ImagePlane;

struct Curves {
    nodes: Channel,
    counts: Channel,
    positions: Positions,
    radii: Channel,
    excesses: Channel,
}

impl Curves {
    const fn new() -> Self {
        Self {
            nodes: Channel::new(Expect::Same),
            counts: Channel::new(Expect::Same),
            positions: Positions::new(Expect::Onward),
            radii: Channel::new(Expect::Onward),
            excesses: Channel::new(Expect::Onward),
        }
    }

    fn node(&mut self, bits: &mut BitReader<'_, '_>) -> Result<u16, WireError> {
        u16::try_from(self.nodes.read(bits)?).map_err(|_| WireError::Invalid("node"))
    }

    const fn restart(&mut self) {
        self.positions.restart();
        self.radii.restart();
        self.excesses.restart();
    }
}

/// Append the branches with their control points.
pub(super) fn write_branches(
    shape: &Shape<'_>,
    plane: &ImagePlane,
    bits: &mut BitWriter<'_, '_>,
) -> Result<(), CapacityError> {
    let mut curves = Curves::new();
    for branch in shape.branches {
        let missing = CapacityError { what: "control points", limit: shape.controls.len() };
        let controls = branch.curve(shape.controls).ok_or(missing)?.controls();
        let weighted = controls.iter().any(|c| c.weight != ONE);
        for node in branch.nodes {
            curves.nodes.write(node.into(), bits);
        }
        curves.counts.write(controls.len() as i32, bits);
        bits.put(u32::from(branch.closed), 1);
        bits.put(u32::from(weighted), 1);
        curves.restart();
        for Control { ball, weight } in controls {
            curves.positions.write(ball.at(), bits);
            curves.radii.write(steps(ball.rho, POSITION_STEP), bits);
            curves.excesses.write(excess(ball.d, sent(ball.at()), plane), bits);
            if weighted {
                bits.put(*weight as u32, 32);
            }
        }
    }
    Ok(())
}

/// Read the branches with their control points.
pub(super) fn read_branches(
    lists: &mut ShapeLists<'_>,
    branches: u16,
    plane: &ImagePlane,
    bits: &mut BitReader<'_, '_>,
) -> Result<(), WireError> {
    let mut curves = Curves::new();
    for _ in 0..branches {
        let nodes = [curves.node(bits)?, curves.node(bits)?];
        let count = curves.counts.read(bits)?;
        let (closed, weighted) = (bits.flag()?, bits.flag()?);
        curves.restart();
        let controls = lists.controls.len();
        for _ in 0..count {
            let at @ PixelPoint { u, v } = curves.positions.read(bits)?;
            let rho = length(curves.radii.read(bits)?)?;
            let d = disparity(curves.excesses.read(bits)?, at, plane);
            let weight = if weighted { bits.take(32)? as i32 } else { ONE };
            push(lists.controls, Control { ball: Ball { u, v, rho, d }, weight }, "control points")?;
        }
        let control_count = lists.controls.len() - controls;
        let branch = Branch { nodes, samples: 0, sample_count: 0, controls, control_count, closed };
        if branch.curve(lists.controls).is_none() {
            return Err(WireError::Invalid("number of control points"));
        }
        push(lists.branches, branch, "branches")?;
    }
    Ok(())
}
