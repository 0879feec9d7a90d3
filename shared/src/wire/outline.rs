//! A shape's contour with its matches, loop by loop, and plain rows of points.
//!
//! ```text
//! each loop:  points 16 bits | touches the border 1 | was matched 1
//! each point: u, v | border 1 where the loop touches it | disparity beyond the plane, turn where matched
//! ```
//!
//! Both sides take disparities and turns relative to what the reader has: the plane at the position that was
//! sent, and the normal that follows from the positions that were sent. So rounding does not add up. The
//! normals need the whole loop: its positions come first, then its matches.

use super::WireError;
use super::rice::{BitReader, BitWriter, Channel, Expect};
use super::shape::{DISPARITY_STEP, POSITION_STEP, RANGE, Shape, ShapeLists, TURN_STEP};
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

/// A position that is sent: rows of points share the channels of u and v.
pub(super) struct Positions {
    u: Channel,
    v: Channel,
}

impl Positions {
    pub(super) const fn new(expect: Expect) -> Self {
        Self { u: Channel::new(expect), v: Channel::new(expect) }
    }

    pub(super) const fn restart(&mut self) {
        self.u.restart();
        self.v.restart();
    }

    pub(super) fn write(&mut self, p: PixelPoint, bits: &mut BitWriter<'_, '_>) {
        self.u.write(steps(p.u, POSITION_STEP), bits);
        self.v.write(steps(p.v, POSITION_STEP), bits);
    }

    pub(super) fn read(&mut self, bits: &mut BitReader<'_, '_>) -> Result<PixelPoint, WireError> {
        Ok(PixelPoint { u: length(&mut self.u, bits)?, v: length(&mut self.v, bits)? })
    }
}

/// The next coordinate or radius of a channel, 1/256 px.
pub(super) fn length(channel: &mut Channel, bits: &mut BitReader<'_, '_>) -> Result<i32, WireError> {
    let x = channel.read(bits)?.checked_mul(POSITION_STEP);
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
    let mut positions = Positions::new(Expect::Onward);
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
        bits.put(u32::from(touches), 1);
        bits.put(u32::from(known), 1);
        positions.restart();
        for p in points {
            positions.write(p.at, bits);
            if touches {
                bits.put(u32::from(p.border), 1);
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
    let mut positions = Positions::new(Expect::Onward);
    let (mut excesses, mut turns) = (Channel::new(Expect::Onward), Channel::new(Expect::Onward));
    for _ in 0..loops {
        let here = ContourLoop { start: lists.contour.len(), len: bits.take(16)? as usize };
        if here.len < MIN_LOOP {
            return Err(WireError::Invalid("contour loop"));
        }
        let (touches, known) = (bits.flag()?, bits.flag()?);
        positions.restart();
        for _ in here.range() {
            let at = positions.read(bits)?;
            let border = touches && bits.flag()?;
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
    let mut positions = Positions::new(Expect::Same);
    for p in points {
        positions.write(*p, bits);
    }
}

/// Read a row of points.
pub(super) fn read_points(
    count: u16,
    bits: &mut BitReader<'_, '_>,
    mut take: impl FnMut(PixelPoint) -> Result<(), CapacityError>,
) -> Result<(), WireError> {
    let mut positions = Positions::new(Expect::Same);
    for _ in 0..count {
        take(positions.read(bits)?)?;
    }
    Ok(())
}
