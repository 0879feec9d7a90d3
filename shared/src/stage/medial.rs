//! Medial balls: the largest disc inside the silhouette that touches each contour point, the 2D medial
//! axis (paper section 2.1) to a fraction of a pixel and with the two places that it touches.
//!
//! The thinned skeleton says which branches there are; these balls say where exactly their centres are,
//! how wide the object is there, and, through the contacts, at which depth.
//!
//! * **In**: contour points with outward normals.
//! * **Out**: at most one ball a contour point: centre, radius, and its two contacts.
//! * **How**: a disc that touches contour point p with normal n has its centre on the normal. It touches
//!   another point q when its radius is |q - p|^2 / (2 n . (q - p)), n pointing inwards, so the largest empty
//!   disc has the least such radius over all q: the fixed point of the shrinking-ball method (Ma, Bae and
//!   Choi 2012), found in one pass. Points q seen at more than 60 degrees from the normal are left
//!   out: there the separation angle p - centre - q is below 60 degrees, and the disc is born of noise of
//!   the contour itself.
//! * **Kept** are balls with no contour point more than 0.4 px inside.
//! * **Cost**: quadratic in the contour's length; multiplications only in the inner loop.
//! * **Bounds**: squared lengths below 2^43, radius times dot product below 2^62.

use crate::arena::Arena;
use crate::fixed::{PX, div_floor};
use crate::limits::{CapacityError, push};
use crate::point::{Direction, PixelPoint};
use crate::stage::contour::ContourPoint;
use crate::strips::{Disc, Strips};
use heapless::VecView;

/// A disc inside the silhouette that touches its contour in two places.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MedialBall {
    /// Centre.
    pub centre: PixelPoint,
    /// Radius, 1/256 px.
    pub rho: i32,
    /// The two contour points that it touches; the ball was grown from the first.
    pub contacts: [u32; 2],
}

/// How deep a contour point may lie in a ball, 1/256 px: the contour's own noise.
const SLACK: i32 = PX * 2 / 5;

/// The medial balls of a contour, in the order of the points that they grow from.
///
/// # Errors
/// A [`CapacityError`] when `balls` or the scratch is too short.
pub fn medial_balls(
    points: &[ContourPoint],
    mut scratch: Arena<'_>,
    balls: &mut VecView<MedialBall>,
) -> Result<(), CapacityError> {
    balls.clear();
    let strips = Strips::new(points.len(), |i| points[i].at, &mut scratch)?;
    let mut near = 0;
    for i in 0..points.len() {
        let Some(ball) = grow(points, &strips, i, near) else { continue };
        near = ball.contacts[1] as usize;
        if is_empty(points, &strips, &ball) {
            push(balls, ball, "medial balls")?;
        }
    }
    Ok(())
}

/// A disc that touches a contour point from inside, while it shrinks.
#[derive(Clone, Copy)]
struct Growth {
    at: PixelPoint,
    inward: Direction,
    /// Length of `inward`, 1/16384, rounded up.
    length: i64,
    /// Radius, 1/256 px.
    rho: i64,
    /// The point that it was last shrunk to.
    contact: Option<usize>,
}

/// What a point means to a disc that touches another one.
enum Sight {
    /// Not inside, or more than 60 degrees from the normal.
    Nothing,
    /// It shrinks the disc to this radius.
    Shrinks(i64),
    /// It would if the disc were larger than this.
    TooFar(i64),
}

impl Growth {
    fn sight(&self, q: PixelPoint) -> Sight {
        let height = i64::from(self.inward.along(self.at, q));
        if height <= 0 {
            return Sight::Nothing;
        }
        let distance_squared = self.at.distance_squared(q);
        if distance_squared >= 2 * self.rho * height || 4 * height * height < distance_squared {
            return Sight::Nothing;
        }
        if height < 2 * self.rho {
            Sight::Shrinks(div_floor(distance_squared as u64, 2 * height as u64) as i64)
        } else {
            Sight::TooFar(height / 2)
        }
    }

    fn centre(&self) -> PixelPoint {
        let offset = |n: i16| ((self.rho * i64::from(n) + (1 << 13)) >> 14) as i32;
        PixelPoint { u: self.at.u + offset(self.inward.u), v: self.at.v + offset(self.inward.v) }
    }

    /// Every point that shrinks it lies in here: |q - p|^2 < 2 rho n . (q - p) is a disc about p + rho n of
    /// radius rho |n|; two units more are for rounding.
    fn disc(&self) -> Disc {
        let radius = ((self.rho * self.length) >> 14) + 2;
        Disc { centre: self.centre(), squared: radius * radius }
    }
}

/// The largest disc that touches point `i` from inside and no point within 60 degrees of its normal.
fn grow(points: &[ContourPoint], strips: &Strips<'_>, i: usize, near: usize) -> Option<MedialBall> {
    let (at, inward) = (points[i].at, points[i].normal.reversed());
    let (u, v) = (i32::from(inward.u), i32::from(inward.v));
    let length = i64::from((u * u + v * v).cast_unsigned().isqrt()) + 1;
    let mut start = Growth { at, inward, length, rho: i64::from(i32::MAX >> 4), contact: None };
    for q in &points[near.saturating_sub(1)..points.len().min(near + 2)] {
        if let Sight::Shrinks(rho) = start.sight(q.at) {
            start.rho = rho.max(i64::from(inward.along(at, q.at)) / 2) + 1;
        }
    }
    let grown = loop {
        let (mut growth, mut larger) = (start, None);
        strips.walk(&mut start.disc(), |j, disc| match growth.sight(points[j].at) {
            Sight::Shrinks(rho) => {
                (growth.rho, growth.contact) = (rho, Some(j));
                *disc = growth.disc();
            }
            Sight::TooFar(rho) if growth.contact.is_none() => {
                larger = Some(rho + 1);
                disc.squared = 0;
            }
            _ => {}
        });
        match larger {
            Some(rho) => start.rho = rho,
            None => break growth,
        }
    };
    let rho = grown.rho as i32;
    grown.contact.filter(|_| rho > 0).map(|j| MedialBall { centre: grown.centre(), rho, contacts: [i as u32, j as u32] })
}

/// Whether no contour point lies deep inside the ball.
fn is_empty(points: &[ContourPoint], strips: &Strips<'_>, ball: &MedialBall) -> bool {
    let least = i64::from((ball.rho - SLACK).max(0)).pow(2);
    let mut empty = true;
    strips.walk(&mut Disc { centre: ball.centre, squared: least }, |j, disc| {
        if ball.centre.distance_squared(points[j].at) < least {
            (empty, disc.squared) = (false, 0);
        }
    });
    empty
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::point::Direction;
    use heapless::Vec;

    #[test]
    fn a_stadium_has_its_balls_on_the_axis() {
        // Two horizontal walls 20 px apart; outward normals up and down.
        let wall = |k: i32| ContourPoint {
            at: PixelPoint { u: k / 2 * PX, v: if k % 2 == 0 { 0 } else { 20 * PX } },
            normal: Direction { u: 0, v: if k % 2 == 0 { -16384 } else { 16384 } },
            border: false,
        };
        let points: Vec<_, 120> = (0..120).map(wall).collect();
        let mut balls = Vec::<_, 120>::new();
        medial_balls(&points, Arena::new(&mut [0; 256]), &mut balls).unwrap();
        assert_eq!(balls.len(), 120);
        for ball in &balls {
            assert_eq!((ball.centre.v, ball.rho), (10 * PX, 10 * PX));
            assert_eq!(ball.contacts[0] ^ 1, ball.contacts[1], "the point opposite");
        }
    }
}
