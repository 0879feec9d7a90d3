//! Nearest partners under an affine map: how the paper pairs boundary and skeleton points (section 4.1.3).
//!
//! "The boundary points lying within the area of the convex hull of the matched vertices will also
//! correspond": each left point is mapped, and the nearest right point is its partner.
//!
//! * **Cost**: left points times right points.

use crate::limits::{CapacityError, push};
use crate::point::PixelPoint;
use crate::stage::plane::AffineMap;
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
/// A [`CapacityError`] when `pairs` is too short.
pub fn pair_nearest<R: Iterator<Item = PixelPoint>>(
    left: impl Iterator<Item = PixelPoint>,
    right: impl Fn() -> R,
    map: &AffineMap,
    pairs: &mut VecView<Pair>,
) -> Result<(), CapacityError> {
    pairs.clear();
    for left in left {
        let image = map.apply(left);
        if let Some(right) = right().min_by_key(|r| image.distance_squared(*r)) {
            push(pairs, Pair { left, right }, "pairs")?;
        }
    }
    Ok(())
}
