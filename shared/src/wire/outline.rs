//! A shape's contour with its matches, loop by loop, and plain rows of points.
//!
//! ```text
//! each loop: number of points 16 bits | was matched 1 | touches the border 1; where it does: at first 1
//!            each point: u, v; where a loop that touches goes on to the border or off it: for how long
//!            each point of a loop that was matched: disparity beyond the plane, turn
//! ```
//!
//! Both sides take disparities and turns relative to what the reader has: the plane at the position that was
//! sent, and the normal that follows from the positions that were sent. So rounding does not add up. The
//! normals need the whole loop: its positions come first, then its matches.

use super::WireError;
use super::rice::{BitReader, BitWriter, Channel, Expect, Rice};
use super::shape::{DISPARITY_STEP, POSITION_STEP, RANGE, Shape, ShapeLists, TURN_STEP};
use super::walk::Walk;
use crate::fixed::{div_round, saturate};
use crate::limits::{CapacityError, push};
use crate::point::{Direction, PixelPoint};
use crate::stage::contour::{ContourLoop, ContourPoint, MIN_LOOP, normal};
use crate::stage::plane::ImagePlane;
use crate::stage::rows::{ContourMatch, weight_across};

/// `x` in steps, rounded to the nearest.
pub(super) fn steps(x: i32, step: i32) -> i32 {
    div_round(i64::from(x.clamp(-RANGE, RANGE)), i64::from(step)) as i32
}

/// A coordinate or radius of so many steps, 1/256 px.
pub(super) fn length(steps: i32) -> Result<i32, WireError> {
    let x = steps.checked_mul(POSITION_STEP);
    x.filter(|x| (-RANGE..=RANGE).contains(x)).ok_or(WireError::Invalid("position"))
}

/// The position as the reader has it.
pub(super) fn sent(p: PixelPoint) -> PixelPoint {
    let sent = |x| steps(x, POSITION_STEP) * POSITION_STEP;
    PixelPoint { u: sent(p.u), v: sent(p.v) }
}

/// A disparity at a position that was sent, in steps beyond the plane.
pub(super) fn excess(disparity: i32, at: PixelPoint, plane: &ImagePlane) -> i32 {
    let disparity = i64::from(disparity.clamp(-RANGE, RANGE));
    saturate(div_round(disparity - i64::from(plane.at(at)), i64::from(DISPARITY_STEP)))
}

/// The disparity that is so many steps beyond the plane.
pub(super) fn disparity(excess: i32, at: PixelPoint, plane: &ImagePlane) -> i32 {
    let disparity = i64::from(plane.at(at)) + i64::from(excess) * i64::from(DISPARITY_STEP);
    saturate(disparity).clamp(-RANGE, RANGE)
}

/// Append the loops with their points and matches.
pub(super) fn write_contour(
    shape: &Shape<'_>,
    plane: &ImagePlane,
    bits: &mut BitWriter<'_, '_>,
) -> Result<(), CapacityError> {
    let (mut positions, mut runs) = (Walk::new(), Rice::new(1 << 6));
    let (mut excesses, mut turns) = (Channel::new(Expect::Onward), Channel::new(Expect::Onward));
    let missing = CapacityError { what: "contour points", limit: shape.contour.len() };
    let (mut contour, mut matches) = (shape.contour, shape.matches);
    for l in shape.loops {
        let len = u16::try_from(l.len).map_err(|_| missing)?;
        let (points, further) = contour.split_at_checked(l.len).ok_or(missing)?;
        let (matched, further_matches) = matches.split_at_checked(l.len).ok_or(missing)?;
        (contour, matches) = (further, further_matches);
        let touches = points.iter().any(|p| p.border);
        let known = matched.iter().any(|m| m.weight > 0);
        bits.put(u32::from(len), 16);
        bits.put(u32::from(known), 1);
        bits.put(u32::from(touches), 1);
        if touches {
            bits.put(u32::from(points.first().is_some_and(|p| p.border)), 1);
        }
        positions.restart();
        for run in points.chunk_by(|p, q| p.border == q.border) {
            if touches {
                runs.write(run.len() as i32, bits);
            }
            for p in run {
                positions.write([p.at.u, p.at.v].map(|x| steps(x, POSITION_STEP)), bits);
            }
        }
        if known {
            excesses.restart();
            turns.restart();
            let own = ContourLoop { start: 0, len: l.len };
            for (k, (p, m)) in points.iter().zip(matched).enumerate() {
                let left = normal(own, k, |k| points.get(k).map_or(p.at, |p| sent(p.at)));
                excesses.write(excess(m.disparity, sent(p.at), plane), bits);
                turns.write(steps(left.cross(m.normal_right), TURN_STEP), bits);
            }
        }
    }
    Ok(())
}

/// Read the loops with their points and matches.
pub(super) fn read_contour(
    lists: &mut ShapeLists<'_>,
    loops: u16,
    plane: &ImagePlane,
    bits: &mut BitReader<'_, '_>,
) -> Result<(), WireError> {
    let (mut positions, mut runs) = (Walk::new(), Rice::new(1 << 6));
    let (mut excesses, mut turns) = (Channel::new(Expect::Onward), Channel::new(Expect::Onward));
    for _ in 0..loops {
        let here = ContourLoop { start: lists.contour.len(), len: bits.take(16)? as usize };
        if here.len < MIN_LOOP {
            return Err(WireError::Invalid("contour loop"));
        }
        let known = bits.flag()?;
        let (mut border, mut run) = if bits.flag()? { (!bits.flag()?, 0) } else { (false, i32::MAX) };
        positions.restart();
        for _ in here.range() {
            if run == 0 {
                run = runs.read(bits)?;
                border = !border;
            }
            run = run.saturating_sub(1);
            let [u, v] = positions.read(bits)?;
            let at = PixelPoint { u: length(u)?, v: length(v)? };
            push(lists.contour, ContourPoint { at, normal: Direction::default(), border }, "contour points")?;
        }
        push(lists.loops, here, "contour loops")?;
        excesses.restart();
        turns.restart();
        for k in here.range() {
            let normal = normal(here, k, |k| lists.contour.get(k).map_or_else(PixelPoint::default, |p| p.at));
            let Some(point) = lists.contour.get_mut(k) else { continue };
            point.normal = normal;
            let (excess, turn) = if known { (excesses.read(bits)?, turns.read(bits)?) } else { (0, 0) };
            let normal_right = normal.turned(turn.saturating_mul(TURN_STEP));
            let weight = if known && !point.border { weight_across(normal_right) } else { 0 };
            let disparity = disparity(excess, point.at, plane);
            push(lists.matches, ContourMatch { disparity, weight, normal_right }, "contour matches")?;
        }
    }
    Ok(())
}

/// Append a row of points.
pub(super) fn write_points(points: &[PixelPoint], bits: &mut BitWriter<'_, '_>) {
    let (mut u, mut v) = (Channel::new(Expect::Same), Channel::new(Expect::Same));
    for p in points {
        u.write(steps(p.u, POSITION_STEP), bits);
        v.write(steps(p.v, POSITION_STEP), bits);
    }
}

/// Read a row of points.
pub(super) fn read_points(
    count: u16,
    bits: &mut BitReader<'_, '_>,
    mut take: impl FnMut(PixelPoint) -> Result<(), CapacityError>,
) -> Result<(), WireError> {
    let (mut u, mut v) = (Channel::new(Expect::Same), Channel::new(Expect::Same));
    for _ in 0..count {
        take(PixelPoint { u: length(u.read(bits)?)?, v: length(v.read(bits)?)? })?;
    }
    Ok(())
}
