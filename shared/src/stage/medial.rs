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
//!   Choi 2012), found in one pass in the order of the points. Points q seen at more than 60 degrees from the normal are left
//!   out: there the separation angle p - centre - q is below 60 degrees, and the disc is born of noise of
//!   the contour itself.
//! * **Kept** are balls with no contour point more than 0.4 px inside.
//! * **Cost**: a point begins with its neighbour's contact and looks only at the strips ([`Strips`]) that its disc
//!   meets, 20 to 50 of any contour; on a circle, where every disc is the same, at all points (decisions/0013).
//! * **Bounds**: squared lengths below 2^43; a disc that nothing has stopped has a radius below 2^27, so twice a radius
//!   times a height stays below 2^50. A ball's radius is at most the distance of its contacts, below 2^21: a disc
//!   shrinks to d^2 / 2h only where h >= d / 2.

use crate::arena::{Arena, List};
use crate::fixed::{PX, UNIT, div_floor};
use crate::limits::{CapacityError, push};
use crate::point::{Direction, PixelPoint};
use crate::stage::contour::ContourPoint;
use crate::strips::{Disc, Placed, Strips};
use heapless::VecView;

/// A disc inside the silhouette that touches its contour in two places.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MedialBall {
    /// Centre.
    pub centre: PixelPoint,
    /// Radius, 1/256 px; below 2^21.
    pub rho: i32,
    /// The two contour points that it touches; the ball was grown from the first.
    pub contacts: [u32; 2],
}

impl Placed for MedialBall {
    fn place(&self) -> PixelPoint {
        self.centre
    }
}

impl Placed for ContourPoint {
    fn place(&self) -> PixelPoint {
        self.at
    }
}

/// How deep a contour point may lie in a ball, 1/256 px: the contour's own noise.
const SLACK: i32 = PX * 2 / 5;

/// A point that is less high above the tangent does not lie deep, see [`is_empty`].
const LEAST_HEIGHT: i32 = SLACK / 3;

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
    let strips = Strips::new(points, &mut scratch)?;
    let mut inside = List::new(scratch.take(points.len(), "points in a disc")?, "points in a disc");
    let mut near = 0;
    for i in 0..points.len() {
        let Some(grown) = grow(points, &strips, (i, near), &mut inside)? else { continue };
        near = grown.contact;
        if is_empty(points, &strips, &grown, &inside) {
            let contacts = [i as u32, grown.contact as u32];
            push(balls, MedialBall { centre: grown.centre(), rho: grown.rho, contacts }, "medial balls")?;
        }
    }
    Ok(())
}

/// So many points of the contour are tried where the neighbour's contact is none.
const TRIED: usize = 16;

/// The radius of a disc that nothing has stopped yet, 1/256 px.
const UNLIMITED: i32 = i32::MAX >> 4;

/// A disc that touches a contour point from inside.
#[derive(Clone, Copy)]
struct Touching {
    at: PixelPoint,
    inward: Direction,
    /// Squared length of `inward`, 1/2^28, and the length, 1/16384: (x^2 + 1) / 2, no less than x and hardly more.
    squared: u32,
    length: i32,
    /// Radius, 1/256 px; at most [`UNLIMITED`].
    rho: i32,
    /// The point that it was last shrunk to; its own point before.
    contact: usize,
}

/// What a point is to a disc that touches another one.
enum Sight {
    /// It lies outside, or hardly inside and beside the disc's own point.
    Outside,
    /// It lies inside, more than 60 degrees from the normal.
    Aside,
    /// It shrinks the disc to this radius.
    Shrinks(i32),
    /// It would, were the disc larger than this: at twice the radius, where rounding makes inside and outside.
    Beyond(i32),
}

impl Touching {
    fn sight(&self, q: PixelPoint) -> Sight {
        let height = self.inward.along(self.at, q);
        if height <= 0 {
            return Sight::Outside;
        }
        let distance_squared = self.at.distance_squared(q);
        // Heights are below 2^22, radii below 2^27: products below 2^46 and 2^50.
        let is_aside = 4 * product(height, height) < distance_squared;
        if is_aside && height < LEAST_HEIGHT || distance_squared >= product(2 * self.rho, height) {
            Sight::Outside
        } else if is_aside {
            Sight::Aside
        } else if height >= 2 * self.rho {
            Sight::Beyond(height / 2)
        } else {
            // Less than the radius, since the disc reaches over the point; no more than the distance, see **Bounds**.
            Sight::Shrinks(div_floor(distance_squared as u64, 2 * height as u64) as i32)
        }
    }

    /// Make it as small as a point allows that shrinks it, but for one unit: the disc searched for is smaller, and
    /// the point shrinks this one still. Whether it does.
    fn narrow(&mut self, q: PixelPoint) -> bool {
        let Sight::Shrinks(rho) = self.sight(q) else { return false };
        self.rho = rho.max(self.inward.along(self.at, q) / 2) + 1;
        true
    }

    fn centre(&self) -> PixelPoint {
        // A radius below 2^27 by at most 2^14: within 2^27, so that the centre is within 2^28.
        let offset = |n: i16| ((product(self.rho, n.into()) + (1 << 13)) >> 14) as i32;
        PixelPoint { u: self.at.u + offset(self.inward.u), v: self.at.v + offset(self.inward.v) }
    }

    /// Every point that is not outside lies in here: |q - p|^2 < 2 rho n . (q - p) is a disc about p + rho n
    /// of radius rho |n|; two units more are for rounding.
    fn disc(&self) -> Disc {
        let radius = (product(self.rho, self.length) >> 14) as i32 + 2;
        Disc { centre: self.centre(), radius }
    }
}

fn product(a: i32, b: i32) -> i64 {
    i64::from(a) * i64::from(b)
}

/// The largest disc that touches point `i` from inside and no point within 60 degrees of its normal; the
/// points aside that may lie in it are listed. A contact is looked for at point `near` first.
fn grow(
    points: &[ContourPoint],
    strips: &Strips<'_, ContourPoint>,
    (i, near): (usize, usize),
    inside: &mut List<'_, u32>,
) -> Result<Option<Touching>, CapacityError> {
    let (at, inward) = (points[i].at, points[i].normal.reversed());
    let (u, v) = (i32::from(inward.u), i32::from(inward.v));
    let squared = (u * u + v * v).cast_unsigned();
    let length = ((squared >> 14).cast_signed() + UNIT) / 2 + 1;
    let mut start = Touching { at, inward, squared, length, rho: UNLIMITED, contact: i };
    for q in points.get(near.saturating_sub(1)..points.len().min(near + 2)).unwrap_or_default() {
        start.narrow(q.at);
    }
    if start.rho == UNLIMITED {
        for q in points.iter().step_by(points.len().div_ceil(TRIED)) {
            start.narrow(q.at);
        }
    }
    if start.rho == UNLIMITED {
        strips.walk(start.disc(), |_, q, disc| {
            if start.narrow(q.at) {
                *disc = start.disc();
            }
        });
        if start.rho == UNLIMITED {
            return Ok(None);
        }
    }
    loop {
        inside.clear();
        let (mut grown, mut larger, mut full) = (start, None, Ok(()));
        strips.walk(start.disc(), |j, q, disc| match grown.sight(q.at) {
            Sight::Outside => {}
            Sight::Shrinks(rho) => {
                (grown.rho, grown.contact) = (rho, j);
                *disc = grown.disc();
            }
            Sight::Beyond(rho) if grown.contact == i => {
                larger = Some(rho + 1);
                disc.radius = 0;
            }
            Sight::Aside | Sight::Beyond(_) => full = inside.push(j as u32).and(full),
        });
        full?;
        match larger {
            Some(rho) => start.rho = rho,
            None => return Ok(Some(grown).filter(|g| g.contact != i && g.rho > 0)),
        }
    }
}

/// Whether no contour point lies deep inside the disc.
fn is_empty(
    points: &[ContourPoint],
    strips: &Strips<'_, ContourPoint>,
    grown: &Touching,
    inside: &[u32],
) -> bool {
    let (centre, radius) = (grown.centre(), (grown.rho - SLACK).max(0));
    // With S the slack and x the normal's length, let rho (1 - x^2) be at most S / 2, which it always is of rounded
    // normals. Then whatever lies deep was seen inside, and is LEAST_HEIGHT high: the disc of radius rho - S begins
    // x (S - rho (1 - x)) > S / 2 above the tangent, and heights are cut by less than 1, which
    // rho^2 (1 - x^2) + (S - 1)^2 < 2 rho (S - 2) allows for.
    if i64::from(grown.rho) * ((1 << 28) - i64::from(grown.squared)) <= i64::from(SLACK / 2) << 28 {
        let least = product(radius, radius);
        let is_deep = |q: &ContourPoint| centre.distance_squared(q.at) < least;
        return !inside.iter().any(|&j| points.get(j as usize).is_some_and(is_deep));
    }
    let mut empty = true;
    strips.walk(Disc { centre, radius }, |_, _, _| empty = false);
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
        medial_balls(&points, Arena::new(&mut [0; 128]), &mut balls).unwrap();
        assert_eq!(balls.len(), 120);
        for ball in &balls {
            assert_eq!((ball.centre.v, ball.rho), (10 * PX, 10 * PX));
            assert_eq!(ball.contacts[0] ^ 1, ball.contacts[1], "the point opposite");
        }
    }
}
