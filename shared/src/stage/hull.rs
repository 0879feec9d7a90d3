//! Convex hull with its vertices in order, from the two ends of each row.
//!
//! Paper: section 4.1.1 with its reference 3: candidate vertices are collected by scanning the image, then those
//! at which the polygon is not convex go. Method: the monotone chain of Andrew 1979, over rows instead of
//! sorted points: rows come sorted.
//!
//! | | |
//! |---|---|
//! | in | [`RowExtent`]s, v strictly ascending, left <= right, 1/256 px, within +-2^20 (clamped to it) |
//! | out | vertices in 1/256 px, clockwise on the screen, from the left end of the top row on: along the top, down the right side, up the left |
//! | left out | vertices collinear with their neighbours |
//! | degenerate | nothing: 0 vertices; one point: 1; all collinear: 2, the top (else the left) one first |
//! | capacity | two more than the hull of any upper part of the rows has |
//! | cost | linear in the rows; every decision by the exact [`orient`] |
//!
//! Rows out of order give some polygon, not a panic.

use crate::bitmap::Bitmap;
use crate::fixed::PX;
use crate::limits::{CapacityError, MAX_SIDE};
use crate::point::{PixelPoint, orient};
use core::mem::swap;
use heapless::VecView;

/// The outermost points of a row, 1/256 px. Rows between those of pixels are welcome.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RowExtent {
    /// Vertical coordinate of the row.
    pub v: i32,
    /// Horizontal coordinate of its left end.
    pub left: i32,
    /// Horizontal coordinate of its right end, not less than `left`.
    pub right: i32,
}

/// The outermost set pixels of each row that has any, by their centres.
pub fn bitmap_extents(bitmap: &Bitmap<'_>) -> impl Iterator<Item = RowExtent> {
    let at = |pixels: usize| pixels as i32 * PX;
    bitmap.spans().map(move |(v, first, last)| RowExtent { v: at(v), left: at(first), right: at(last) })
}

/// The convex hull of the rows; replaces what `out` held.
///
/// While the rows come in, the right chain grows from the start of the list and the left chain from its
/// end, so that the left one already lies in the order in which it is wanted: from the bottom up.
///
/// # Errors
/// A [`CapacityError`] when `out` is too short.
pub fn convex_hull(
    extents: impl IntoIterator<Item = RowExtent>,
    out: &mut VecView<PixelPoint>,
) -> Result<(), CapacityError> {
    let overflow = CapacityError { what: "hull vertices", limit: out.capacity() };
    let extents = extents.into_iter();
    // A chain has a vertex a row at most.
    let most = extents.size_hint().1.map_or(usize::MAX, |rows| rows.saturating_mul(2));
    let limit = out.capacity().min(most);
    out.clear();
    out.resize_default(limit).map_err(|_| overflow)?;
    let points = out.as_mut_slice();
    let (mut right, mut left) = (0, 0);
    for extent in extents {
        let end = point(extent.right, extent.v);
        while let Some([.., before, last]) = points.get(..right)
            && orient(*before, *last, end) <= 0
        {
            right -= 1;
        }
        let start = point(extent.left, extent.v);
        while let Some([last, before, ..]) = points.get(limit - left..)
            && orient(*before, *last, start) >= 0
        {
            left -= 1;
        }
        if right + left + 2 > limit {
            out.clear();
            return Err(overflow);
        }
        (right, left) = (right + 1, left + 1);
        for (place, point) in [(right - 1, end), (limit - left, start)] {
            if let Some(place) = points.get_mut(place) {
                *place = point;
            }
        }
    }
    let length = join(points, right, left);
    out.truncate(length);
    Ok(())
}

/// Put the left chain behind the right one, without the points they share; returns how many there are.
fn join(points: &mut [PixelPoint], right: usize, left: usize) -> usize {
    if right == 0 || left == 0 {
        return 0;
    }
    let mut bottom_up = points.len() - left;
    if points.get(right - 1) == points.get(bottom_up) {
        bottom_up += 1;
    }
    let mut length = right;
    while let Some(&point) = points.get(bottom_up)
        && let Some(place) = points.get_mut(length)
    {
        *place = point;
        (length, bottom_up) = (length + 1, bottom_up + 1);
    }
    if length > 1 && points.get(length - 1) == points.first() {
        return length - 1;
    }
    // The last one comes first.
    let chain = points.get_mut(..length).unwrap_or_default();
    if let Some(mut before) = chain.last().copied() {
        chain.iter_mut().for_each(|point| swap(point, &mut before));
    }
    length
}

/// The point, brought to where `orient` is exact: products of differences are then at most 2^42.
fn point(u: i32, v: i32) -> PixelPoint {
    const LIMIT: i32 = MAX_SIDE as i32 * PX;
    PixelPoint { u: u.clamp(-LIMIT, LIMIT), v: v.clamp(-LIMIT, LIMIT) }
}
