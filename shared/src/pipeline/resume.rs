//! A run taken up where a device left it: its shape has come over a link, and what was not sent follows.

use super::default::lift_balls;
use super::eye::follow_curves;
use super::{Memory, Observer, Outcome, Product, Side};
use crate::limits::CapacityError;
use crate::stage::depth::Optics;

/// Complete the memory that a shape of the default method was read into
/// ([`ShapeLists::of`](crate::wire::ShapeLists::of)) with its balls, their depths and samples of its curves;
/// the observer sees all that there is.
///
/// # Errors
/// A [`CapacityError`] when a list is too short.
pub fn resume(
    memory: &mut Memory<'_>,
    outcome: &Outcome,
    optics: Optics,
    observer: &mut impl Observer,
) -> Result<(), CapacityError> {
    let [left, right] = &mut memory.eyes;
    observer.saw(Some(Side::Left), Product::Contour(left.contour, left.loops));
    observer.saw(Some(Side::Left), Product::Hull(left.hull));
    observer.saw(Some(Side::Right), Product::Hull(right.hull));
    if let Some(cuts) = &outcome.cuts {
        observer.saw(None, Product::Cuts(cuts));
    }
    observer.saw(None, Product::Rows(memory.matches, outcome.rows));
    lift_balls(memory, optics, observer)?;
    let [left, _] = &mut memory.eyes;
    follow_curves(left)?;
    observer.saw(None, Product::Curves(left.branches, left.controls));
    Ok(())
}
