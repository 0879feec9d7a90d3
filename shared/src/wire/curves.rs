//! A shape's branches with their curves.
//!
//! ```text
//! each branch:  both nodes | number of control points | closed 1 bit | weighted 1
//! each control: u, v | radius | disparity beyond the plane | weight 32 bits where weighted
//! ```
//!
//! A curve that is not weighted has unit weights, as every fit gives them.

use super::WireError;
use super::outline::{disparity, excess, length, sent, steps};
use super::rice::{BitReader, BitWriter, Channel, Expect};
use super::shape::{POSITION_STEP, Shape, ShapeLists};
use crate::fixed::ONE;
use crate::limits::{CapacityError, push};
use crate::pipeline::Branch;
use crate::point::PixelPoint;
use crate::stage::branch::Ball;
use crate::stage::nurbs::Control;
use crate::stage::plane::ImagePlane;

/// A control point in numbers to send: u, v, radius, disparity beyond the plane.
type Numbers = [i32; 4];

fn numbers(ball: Ball, plane: &ImagePlane) -> Numbers {
    let [u, v, rho] = [ball.u, ball.v, ball.rho].map(|x| steps(x, POSITION_STEP));
    [u, v, rho, excess(ball.d, sent(ball.at()), plane)]
}

fn ball([u, v, rho, excess]: Numbers, plane: &ImagePlane) -> Result<Ball, WireError> {
    let (u, v, rho) = (length(u)?, length(v)?, length(rho)?);
    Ok(Ball { u, v, rho, d: disparity(excess, PixelPoint { u, v }, plane) })
}

struct Curves {
    nodes: Channel,
    counts: Channel,
    channels: [Channel; 4],
}

impl Curves {
    fn new() -> Self {
        let unsteady = || Channel::new(Expect::Same);
        let channels = [(); 4].map(|()| Channel::new(Expect::Onward));
        Self { nodes: unsteady(), counts: unsteady(), channels }
    }

    fn node(&mut self, bits: &mut BitReader<'_, '_>) -> Result<u16, WireError> {
        u16::try_from(self.nodes.read(bits)?).map_err(|_| WireError::Invalid("node"))
    }

    fn restart(&mut self) {
        for channel in &mut self.channels {
            channel.restart();
        }
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
            for (channel, x) in curves.channels.iter_mut().zip(numbers(*ball, plane)) {
                channel.write(x, bits);
            }
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
        let controls = lists.controls.len();
        curves.restart();
        for _ in 0..count {
            let mut numbers = Numbers::default();
            for (channel, x) in curves.channels.iter_mut().zip(&mut numbers) {
                *x = channel.read(bits)?;
            }
            let weight = if weighted { bits.take(32)? as i32 } else { ONE };
            push(lists.controls, Control { ball: ball(numbers, plane)?, weight }, "control points")?;
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
