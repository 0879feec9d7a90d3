//! Points about a pixel apart along a curve: the contour's.
//!
//! * **In, out**: positions in steps of 1/32 px.
//! * **How**: a curve goes on about as it came. Along the axis on which it moved less, the step to the next
//!   point is foretold to be the last one; the step along the other axis follows from its length of a pixel.
//!   This takes 7 bits a point; second differences of both coordinates would take 9.
//! * **Cost**: a square root a point.

use super::WireError;
use super::rice::{BitReader, BitWriter, Channel, Expect, Rice};
use super::shape::POSITION_STEP;
use crate::fixed::PX;

/// Square of the length of a step: a pixel and half a unit, since resampling rounds the number of points
/// down.
const SQUARE: i32 = {
    let pixel = PX / POSITION_STEP;
    pixel * pixel + pixel
};

/// The points of several curves, one after the other.
pub(super) struct Walk {
    /// The first two points of a curve.
    starts: [Channel; 2],
    aside: Rice,
    ahead: Rice,
    /// The last point and the one before, and how many of this curve there were.
    past: [[i32; 2]; 2],
    known: u32,
}

impl Walk {
    pub(super) fn new() -> Self {
        let starts = [0, 1].map(|_| Channel::new(Expect::Same));
        Self { starts, aside: Rice::new(1 << 4), ahead: Rice::new(1 << 2), past: [[0; 2]; 2], known: 0 }
    }

    /// Another curve begins.
    pub(super) fn restart(&mut self) {
        self.known = 0;
        for channel in &mut self.starts {
            channel.restart();
        }
    }

    pub(super) fn write(&mut self, p: [i32; 2], bits: &mut BitWriter<'_, '_>) {
        if self.known < 2 {
            for (channel, x) in self.starts.iter_mut().zip(p) {
                channel.write(x, bits);
            }
        } else {
            let [last, before] = self.past;
            let (way, swapped) = minor_first(difference(last, before));
            let [aside, ahead] = swap_if(difference(p, last), swapped);
            self.aside.write(aside.wrapping_sub(way[0]), bits);
            self.ahead.write(ahead.wrapping_sub(major(aside, way[1])), bits);
        }
        self.note(p);
    }

    pub(super) fn read(&mut self, bits: &mut BitReader<'_, '_>) -> Result<[i32; 2], WireError> {
        let p = if self.known < 2 {
            let [u, v] = &mut self.starts;
            [u.read(bits)?, v.read(bits)?]
        } else {
            let [last, before] = self.past;
            let (way, swapped) = minor_first(difference(last, before));
            let aside = self.aside.read(bits)?.wrapping_add(way[0]);
            let ahead = self.ahead.read(bits)?.wrapping_add(major(aside, way[1]));
            let [u, v] = swap_if([aside, ahead], swapped);
            [last[0].wrapping_add(u), last[1].wrapping_add(v)]
        };
        self.note(p);
        Ok(p)
    }

    const fn note(&mut self, p: [i32; 2]) {
        self.past = [p, self.past[0]];
        self.known = self.known.saturating_add(1);
    }
}

const fn difference(a: [i32; 2], b: [i32; 2]) -> [i32; 2] {
    [a[0].wrapping_sub(b[0]), a[1].wrapping_sub(b[1])]
}

/// The vector with its smaller part first, and whether that is v.
const fn minor_first(way: [i32; 2]) -> ([i32; 2], bool) {
    let swapped = way[0].unsigned_abs() > way[1].unsigned_abs();
    (swap_if(way, swapped), swapped)
}

const fn swap_if([a, b]: [i32; 2], swapped: bool) -> [i32; 2] {
    if swapped { [b, a] } else { [a, b] }
}

/// The larger part of a step, given the smaller one, in the direction in which the curve came.
fn major(aside: i32, way: i32) -> i32 {
    let length = SQUARE.saturating_sub(aside.saturating_mul(aside)).max(0).isqrt();
    if way < 0 { -length } else { length }
}
