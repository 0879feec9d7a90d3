//! Depth of each ball from its contour contacts (docs/algorithm.md, step 17): no skeleton of the right view needed.
//!
//! A ball of radius rho touches the left contour where its normal is nL and the right one where it is nR.
//! Both contours of a sphere are circles about its centre, so the centre's disparity is that of a contact
//! plus what the turn from nL to nR moves the contact along the row, weighted by how far the contour
//! stands across it:
//!
//! ```text
//! d_m = sum nR_x (nR_x d_k + rho (1 - nL . nR)) / sum nR_x^2
//! ```
//!
//! with a twentieth of the plain average, which decides where both contacts run along the rows. A ball's
//! silhouette is seen r^2 / Z in front of its centre: d_c = d_m f^2 / (f^2 + rho^2).
//!
//! * **In**: balls, the matches of the left contour, the optics.
//! * **Out**: a disparity a ball, 1/256 px, and how well it is known.
//! * **Bounds**: radii below 2^21 (`medial`), disparities of matches below 2^31, the offset at most 2^20. A ball's
//!   disparity is brought to +-2^20: what a plane says far from what it was fitted to may be more.

use crate::camera::PairModel;
use crate::fixed::{PX, UNIT, div_round};
use crate::limits::{CapacityError, MAX_SIDE, push};
use crate::stage::contour::ContourPoint;
use crate::stage::medial::MedialBall;
use crate::stage::rows::ContourMatch;
use heapless::VecView;

/// What the depth of a ball depends on beside the images.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Optics {
    /// Focal length of both eyes, 1/256 px; below 2^23.
    pub focal: i32,
    /// What is added to a disparity before Z = f B / d holds, 1/256 px: the right principal point's column
    /// less the left one's; at most 2^20 either way.
    pub disparity_offset: i32,
}

impl From<&PairModel> for Optics {
    /// Those of a model that passes its check.
    fn from(model: &PairModel) -> Self {
        Self { focal: model.fixed_focal(), disparity_offset: model.fixed_disparity_offset() }
    }
}

/// The disparity of a ball's centre.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BallDepth {
    /// d_c = u_left - u_right of the centre, 1/256 px; at most 2^20 either way.
    pub disparity: i32,
    /// Mean n_x^2 of the contacts, 0..=16384.
    pub weight: i32,
}

/// Weight of the plain average of the contacts against n_x^2, 1/16384.
const PLAIN: i64 = UNIT as i64 / 20;

/// Farthest that two columns can be apart, 1/256 px.
const FARTHEST: i64 = MAX_SIDE as i64 * PX as i64;

/// The disparity of each ball's centre.
///
/// # Errors
/// A [`CapacityError`] when `depths` is too short.
pub fn ball_depths(
    balls: &[MedialBall],
    points: &[ContourPoint],
    matches: &[ContourMatch],
    optics: Optics,
    depths: &mut VecView<BallDepth>,
) -> Result<(), CapacityError> {
    debug_assert_eq!(points.len(), matches.len());
    depths.clear();
    for ball in balls {
        let depth = match ball.contacts.map(|k| points.get(k as usize).zip(matches.get(k as usize))) {
            [Some(p), Some(q)] => depth(ball.rho, p, q, optics),
            _ => BallDepth::default(),
        };
        push(depths, depth, "ball depths")?;
    }
    Ok(())
}

/// d_c of one ball and its weight.
fn depth(
    rho: i32,
    p: (&ContourPoint, &ContourMatch),
    q: (&ContourPoint, &ContourMatch),
    optics: Optics,
) -> BallDepth {
    let (mut sum, mut total) = (0i64, 0i64);
    for (point, matched) in [p, q] {
        if matched.weight > 0 {
            let across = i64::from(matched.normal_right.u);
            let turned = i64::from(UNIT - point.normal.dot(matched.normal_right));
            // Below 2^21 x 2^15, and 2^22 when shifted.
            let slide = (i64::from(rho) * turned) >> 14;
            // Below 2^14 x (2^14 x 2^31 + 2^22 x 2^14): 2^60.
            sum += (across * (across * i64::from(matched.disparity) + slide * i64::from(UNIT))) >> 14;
            total += (across * across) >> 14;
        }
    }
    let weight = (total / 2) as i32;
    let (dp, dq) = (i64::from(p.1.disparity), i64::from(q.1.disparity));
    let (wp, wq) = (i64::from(p.1.weight) + PLAIN, i64::from(q.1.weight) + PLAIN);
    // Weights below 2^15, disparities below 2^31.
    let plain = div_round(wp * dp + wq * dq, wp + wq);
    let matched = div_round(sum + PLAIN * plain, total + PLAIN);
    let factor = nearness(optics.focal, rho);
    let offset = i64::from(optics.disparity_offset);
    // Below 2^32 x 2^30.
    let disparity = (((matched + offset) * factor + (1 << 29)) >> 30) - offset;
    BallDepth { disparity: disparity.clamp(-FARTHEST, FARTHEST) as i32, weight }
}

/// f^2 / (f^2 + rho^2) in 1/2^30, rounded down; 0 where both are 0.
fn nearness(focal: i32, rho: i32) -> i64 {
    let (f2, rho2) = (u64::from(focal.unsigned_abs()).pow(2), u64::from(rho.unsigned_abs()).pow(2));
    // In two steps of 15 bits, which f < 2^23 and rho < 2^21 keep below 2^62: 128 bits are divided bit by bit.
    let whole = (f2 + rho2).max(1);
    let (high, rest) = ((f2 << 15) / whole, (f2 << 15) % whole);
    ((high << 15) | ((rest << 15) / whole)).cast_signed()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixed::PX;
    use crate::point::{Direction, PixelPoint};
    use heapless::Vec;

    /// A ball of radius 20 px seen from the front: both contacts, left and right, one disparity.
    fn rim(side: i32, turn: i32) -> (ContourPoint, ContourMatch) {
        let normal = Direction { u: (side * UNIT) as i16, v: 0 };
        let at = PixelPoint { u: side * 20 * PX, v: 0 };
        let matched =
            ContourMatch { disparity: 50 * PX, weight: UNIT as u16, normal_right: normal.turned(turn) };
        (ContourPoint { at, normal, border: false }, matched)
    }

    fn disparity(rims: [(ContourPoint, ContourMatch); 2], optics: Optics) -> BallDepth {
        let ball = MedialBall { centre: PixelPoint::default(), rho: 20 * PX, contacts: [0, 1] };
        let mut depths = Vec::<_, 1>::new();
        ball_depths(&[ball], &rims.map(|r| r.0), &rims.map(|r| r.1), optics, &mut depths).unwrap();
        depths[0]
    }

    #[test]
    fn a_contact_lies_in_front_of_the_centre() {
        let optics = Optics { focal: 400 * PX, disparity_offset: 0 };
        let found = disparity([rim(1, 0), rim(-1, 0)], optics);
        // 50 px times f^2 / (f^2 + rho^2), to a unit.
        let truth = 50.0 * 400.0 * 400.0 / (400.0 * 400.0 + 20.0 * 20.0) * f64::from(PX);
        assert!((f64::from(found.disparity) - truth).abs() <= 1.0, "{found:?}, {truth}");
        assert_eq!(found.weight, UNIT);
    }

    #[test]
    fn unmatched_contacts_give_their_plain_average_and_no_weight() {
        let mut rims = [rim(1, 0), rim(-1, 0)];
        rims.iter_mut().for_each(|r| r.1.weight = 0);
        rims[0].1.disparity = 60 * PX;
        let found = disparity(rims, Optics { focal: 1 << 22, disparity_offset: 0 });
        assert_eq!((found.disparity, found.weight), (55 * PX, 0));
    }

    #[test]
    fn values_are_exact_at_the_limits() {
        for focal in [0, 1, 1 << 22, (1 << 23) - 1] {
            for rho in [0, 1, 20 * PX, (1 << 21) - 1] {
                let (f2, rho2) = (i128::from(focal).pow(2), i128::from(rho).pow(2));
                let share = (f2 << 30) / (f2 + rho2).max(1);
                assert_eq!(i128::from(nearness(focal, rho)), share, "{focal} {rho}");
                for offset in [-1 << 20, 0, 1 << 20] {
                    for seen in [-1 << 20, 0, 1 << 20] {
                        let rims =
                            [rim(1, 0), rim(-1, 0)].map(|(p, m)| (p, ContourMatch { disparity: seen, ..m }));
                        let optics = Optics { focal, disparity_offset: offset };
                        let [p, q] = &rims;
                        let found = depth(rho, (&p.0, &p.1), (&q.0, &q.1), optics);
                        let (seen, offset) = (i128::from(seen), i128::from(offset));
                        let truth = (((seen + offset) * share + (1 << 29)) >> 30) - offset;
                        assert_eq!((i128::from(found.disparity), found.weight), (truth, UNIT));
                    }
                }
            }
        }
    }

    #[test]
    fn a_disparity_that_no_picture_has_is_brought_to_one_that_it_can_have() {
        for seen in [i32::MIN, -1 << 30, 1 << 30, i32::MAX] {
            for turn in [0, UNIT, -UNIT] {
                let rims =
                    [rim(1, turn), rim(-1, -turn)].map(|(p, m)| (p, ContourMatch { disparity: seen, ..m }));
                for disparity_offset in [-1 << 20, 0, 1 << 20] {
                    let found = disparity(rims, Optics { focal: (1 << 23) - 1, disparity_offset });
                    assert_eq!(i64::from(found.disparity), i64::from(seen.signum()) * FARTHEST);
                }
            }
        }
    }
}
