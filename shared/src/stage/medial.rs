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

use crate::fixed::PX;
use crate::limits::{CapacityError, push};
use crate::point::PixelPoint;
use crate::stage::contour::ContourPoint;
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
/// A [`CapacityError`] when `balls` is too short.
pub fn medial_balls(points: &[ContourPoint], balls: &mut VecView<MedialBall>) -> Result<(), CapacityError> {
    balls.clear();
    for i in 0..points.len() {
        if let Some(ball) = grow(points, i).filter(|b| is_empty(points, b)) {
            push(balls, ball, "medial balls")?;
        }
    }
    Ok(())
}

/// The largest disc that touches point `i` from inside and no point within 60 degrees of its normal.
fn grow(points: &[ContourPoint], i: usize) -> Option<MedialBall> {
    let (p, inward) = (points[i].at, points[i].normal.reversed());
    let (mut rho, mut contact) = (i64::from(i32::MAX >> 4), None);
    for (j, q) in points.iter().enumerate() {
        let height = i64::from(inward.along(p, q.at));
        // The cheap test first: no disc through a point behind p or farther than two radii ahead.
        if height > 0 && height < 2 * rho {
            let distance_squared = p.distance_squared(q.at);
            if distance_squared < 2 * rho * height && 4 * height * height >= distance_squared {
                (rho, contact) = (distance_squared / (2 * height), Some(j));
            }
        }
    }
    let offset = |n: i16| ((rho * i64::from(n) + (1 << 13)) >> 14) as i32;
    let centre = PixelPoint { u: p.u + offset(inward.u), v: p.v + offset(inward.v) };
    contact.filter(|_| rho > 0).map(|j| MedialBall {
        centre,
        rho: rho as i32,
        contacts: [i as u32, j as u32],
    })
}

/// Whether no contour point lies deep inside the ball.
fn is_empty(points: &[ContourPoint], ball: &MedialBall) -> bool {
    let least = i64::from((ball.rho - SLACK).max(0)).pow(2);
    points.iter().all(|q| ball.centre.distance_squared(q.at) >= least)
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
        medial_balls(&points, &mut balls).unwrap();
        assert_eq!(balls.len(), 120);
        for ball in &balls {
            assert_eq!((ball.centre.v, ball.rho), (10 * PX, 10 * PX));
            assert_eq!(ball.contacts[0] ^ 1, ball.contacts[1], "the point opposite");
        }
    }
}
