//! Every capacity of the core, with its arithmetic.
//!
//! Stages take their memory from the caller: rasters as slices, lists as [`heapless::VecView`]. The same
//! code thus runs on 320x240 pixels in a microcontroller and on 3840x2160 on a PC; what differs is how
//! much memory the caller lends. Only small, shape-independent sizes are fixed here.

use core::fmt;

/// Largest image side, px. Coordinates in 1/256 px then stay below 2^20, a squared distance below
/// 2^43, and a product of two such lengths with a Q1.14 direction below 2^55: all fit an `i64`.
pub const MAX_SIDE: usize = 4096;

/// Horizontal cuts through the hull, two vertices each (docs/algorithm.md, step 11).
pub const HULL_CUTS: usize = 6;

/// Crossings of one row with all contours of a view. An object that crosses a row more often than
/// this is a comb; its further crossings are left unmatched.
pub const ROW_CROSSINGS: usize = 64;

/// A list or raster was lent less memory than the input needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CapacityError {
    /// What there was too much of, in the plural.
    pub what: &'static str,
    /// How many of them the lent memory holds.
    pub limit: usize,
}

impl fmt::Display for CapacityError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "more than {} {}", self.limit, self.what)
    }
}

impl core::error::Error for CapacityError {}

/// Append to a list, or say what overflowed.
pub(crate) fn push<T>(
    list: &mut heapless::VecView<T>,
    item: T,
    what: &'static str,
) -> Result<(), CapacityError> {
    let limit = list.capacity();
    list.push(item).map_err(|_| CapacityError { what, limit })
}
