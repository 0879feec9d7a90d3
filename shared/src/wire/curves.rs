//! A shape's branches with their curves.
//!
//! ```text
//! each branch:  nodes 2 x 16 bits | closed 1 | weighted 1 | control points 10
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
use crate::stage::nurbs::{Control, MAX_CONTROLS, Nurbs};
use crate::stage::plane::ImagePlane;

/// Bits of a number of control points.
const COUNT_BITS: u32 = 10;
const _: () = assert!(MAX_CONTROLS < 1 << COUNT_BITS);

struct Curves {
    positions: Positions,
    radii: Channel,
    excesses: Channel,
}

impl Curves {
    fn new() -> Self {
        let channel = || Channel::new(Expect::Onward);
        Self { positions: Positions::new(Expect::Onward), radii: channel(), excesses: channel() }
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
            bits.put(u32::from(node), 16);
        }
        bits.put(u32::from(branch.closed), 1);
        bits.put(u32::from(weighted), 1);
        bits.put(controls.len() as u32, COUNT_BITS);
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
        let nodes = [bits.take(16)? as u16, bits.take(16)? as u16];
        let (closed, weighted) = (bits.flag()?, bits.flag()?);
        let (controls, control_count) = (lists.controls.len(), bits.take(COUNT_BITS)? as usize);
        curves.restart();
        for _ in 0..control_count {
            let at @ PixelPoint { u, v } = curves.positions.read(bits)?;
            let rho = length(&mut curves.radii, bits)?;
            let d = disparity(curves.excesses.read(bits)?, at, plane);
            let weight = if weighted { bits.take(32)? as i32 } else { ONE };
            push(lists.controls, Control { ball: Ball { u, v, rho, d }, weight }, "control points")?;
        }
        let branch = Branch { nodes, samples: 0, sample_count: 0, controls, control_count, closed };
        if branch.curve(lists.controls).as_ref().map(Nurbs::closed) != Some(closed) {
            return Err(WireError::Invalid("number of control points"));
        }
        push(lists.branches, branch, "branches")?;
    }
    Ok(())
}
