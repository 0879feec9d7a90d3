//! Nearest partners under an affine map: how the paper pairs boundary and skeleton points (section 4.1.3).
//!
//! "The boundary points lying within the area of the convex hull of the matched vertices will also
//! correspond": each left point is mapped, and the nearest right point is its partner.
//!
//! * **Cost**: linear in the number of points, where neighbours in a list are neighbours in the plane.

use crate::arena::Arena;
use crate::fixed::isqrt;
use crate::limits::{CapacityError, push};
use crate::point::PixelPoint;
use crate::stage::plane::AffineMap;
use crate::strips::{Disc, Strips};
use heapless::VecView;

/// A left point and its right partner.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pair {
    /// In the left image.
    pub left: PixelPoint,
    /// In the right image.
    pub right: PixelPoint,
}

/// Pair each left point with the right point nearest to its image; of equals, the first.
///
/// # Errors
/// A [`CapacityError`] when `pairs` or the scratch is too short.
pub fn pair_nearest<R: Iterator<Item = PixelPoint>>(
    left: impl Iterator<Item = PixelPoint>,
    right: impl Fn() -> R,
    map: &AffineMap,
    mut scratch: Arena<'_>,
    pairs: &mut VecView<Pair>,
) -> Result<(), CapacityError> {
    pairs.clear();
    let points = scratch.take::<PixelPoint>(right().count(), "right points")?;
    points.iter_mut().zip(right()).for_each(|(place, point)| *place = point);
    let points = &*points;
    let strips = Strips::new(points, &mut scratch)?;
    let Some(mut nearest) = points.first() else { return Ok(()) };
    for left in left {
        // The last partner is near this one; one just as far away may come before it.
        // Within 2^30 + 2^21 of the origin: squares below 2^61 each, their root below 2^31.
        let centre = map.apply(left);
        let mut least = centre.distance_squared(*nearest) + 1;
        let disc = |squared: i64| Disc { centre, radius: isqrt(squared.cast_unsigned()) as i32 + 1 };
        strips.walk(disc(least), |_, right, within| {
            let squared = centre.distance_squared(*right);
            if squared < least {
                (least, nearest, *within) = (squared, right, disc(squared));
            }
        });
        push(pairs, Pair { left, right: *nearest }, "pairs")?;
    }
    Ok(())
}
