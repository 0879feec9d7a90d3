//! Solver of symmetric positive definite systems with a narrow band and a few full rows at the end, as
//! spline fits have them: factorisation L D L^T within the envelope, in fixed point.
//!
//! ```text
//!   open curve         closed curve (the last three rows couple to the first)
//!   x                  x
//!   x x                x x
//!   x x x              x x x
//!   x x x x            x x x x
//!     x x x x          x x x x x      full
//!       x x x x        x x x x x x    full
//!         x x x x      x x x x x x x  full
//! ```
//!
//! The envelope (each row from its first entry to the diagonal) takes no fill-in beyond itself.
//!
//! **In**: entries in 1/2^30, at most 1 in magnitude; right sides in any unit below 2^40.
//! **Out**: the solution in the unit of the right sides. **Bounds**: by Cauchy and Schwarz all sums of
//! products in the factorisation stay below the largest diagonal entry. Whatever comes in, results
//! saturate at 2^52, so that sums of up to 2^14 products fit an `i128`; pivots below 2^-20 are raised to it.
//! **Error**: about 2^-30 x the condition number, relative to the largest unknown. **Cost**: about 16
//! products per row for the band and 6 more per row for the full ones, one 64-bit division a row.

use crate::limits::CapacityError;

/// Entries left of the diagonal in a banded row: those of a cubic spline.
const BAND: usize = 3;
/// Bits below the point of an entry.
pub const ENTRY_BITS: u32 = 30;
/// Smallest pivot: 2^-20.
const LEAST_PIVOT: i64 = 1 << (ENTRY_BITS - 20);
/// Largest number of rows, so that a sum of products of saturated numbers fits an `i128`.
const MAX_ROWS: usize = 1 << 14;

/// The lower half of a symmetric matrix, entries in 1/2^30.
pub struct Envelope<'a> {
    rows: usize,
    /// First of the full rows.
    full: usize,
    entries: &'a mut [i64],
}

impl<'a> Envelope<'a> {
    /// A matrix of zeros, the last three rows full or not.
    ///
    /// # Errors
    /// A [`CapacityError`] when the scratch is too short.
    pub fn new(rows: usize, cyclic: bool, entries: &'a mut [i64]) -> Result<Self, CapacityError> {
        let full = if cyclic { rows.saturating_sub(BAND) } else { rows };
        let limit = entries.len();
        let entries = entries
            .get_mut(..Self::entries(rows, cyclic))
            .filter(|_| rows <= MAX_ROWS)
            .ok_or(CapacityError { what: "entries in an envelope", limit })?;
        entries.fill(0);
        Ok(Self { rows, full, entries })
    }

    /// Entries that a matrix takes.
    pub const fn entries(rows: usize, cyclic: bool) -> usize {
        let full = if cyclic { rows.saturating_sub(BAND) } else { rows };
        full * (BAND + 1) + (rows - full) * rows
    }

    /// Column of the first entry of a row.
    const fn first(&self, row: usize) -> usize {
        if row < self.full { row.saturating_sub(BAND) } else { 0 }
    }

    const fn slot(&self, row: usize, column: usize) -> usize {
        if row < self.full {
            row * (BAND + 1) + BAND + column - row
        } else {
            self.full * (BAND + 1) + (row - self.full) * self.rows + column
        }
    }

    fn entry(&self, row: usize, column: usize) -> i64 {
        self.entries.get(self.slot(row, column)).copied().unwrap_or(0)
    }

    fn change(&mut self, row: usize, column: usize, change: impl FnOnce(i64) -> i64) {
        let slot = self.slot(row, column);
        if let Some(entry) = self.entries.get_mut(slot) {
            *entry = change(*entry);
        }
    }

    /// Add to the entry at (i, j) and (j, i); nothing happens outside the envelope.
    pub fn add(&mut self, i: usize, j: usize, value: i64) {
        let (row, column) = (i.max(j), i.min(j));
        if row < self.rows && column >= self.first(row) {
            self.change(row, column, |entry| bounded(entry.saturating_add(value)));
        }
    }

    /// Divide all entries by 2^bits, rounding to the nearest.
    pub fn scale_down(&mut self, bits: u32) {
        for entry in self.entries.iter_mut() {
            *entry = shift(*entry as i128, bits);
        }
    }

    /// Turn the matrix into its factors: L below the diagonal, 1/D on it.
    pub fn factorise(&mut self) {
        for i in 0..self.rows {
            let from = self.first(i);
            // C = L D first, each row's dot products with the rows above it.
            for j in from..i {
                let sum: i128 = (from.max(self.first(j))..j)
                    .map(|k| self.entry(i, k) as i128 * self.entry(j, k) as i128)
                    .sum();
                self.change(i, j, |entry| entry.saturating_sub(shift(sum, ENTRY_BITS)));
            }
            let mut sum = 0;
            for k in from..i {
                let inverse = self.entry(k, k) as i128;
                self.change(i, k, |c| {
                    let l = shift(c as i128 * inverse, ENTRY_BITS);
                    sum += c as i128 * l as i128;
                    l
                });
            }
            self.change(i, i, |entry| {
                let pivot = entry.saturating_sub(shift(sum, ENTRY_BITS)).max(LEAST_PIVOT);
                (1 << (2 * ENTRY_BITS)) / pivot
            });
        }
    }

    /// Solve in place for several right sides, of as many rows; [`Self::factorise`] comes first.
    pub fn solve<const N: usize>(&self, sides: &mut [[i64; N]]) {
        if sides.len() < self.rows {
            return;
        }
        for i in 0..self.rows {
            let from = self.first(i);
            let (above, here) = sides.split_at_mut(i);
            let mut sums = [0; N];
            for (j, known) in (from..i).zip(&above[from..]) {
                let l = self.entry(i, j) as i128;
                for (sum, y) in sums.iter_mut().zip(known) {
                    *sum += l * *y as i128;
                }
            }
            for (y, sum) in here[0].iter_mut().zip(sums) {
                *y = bounded(bounded(*y) - shift(sum, ENTRY_BITS));
            }
        }
        for (i, side) in sides.iter_mut().enumerate().take(self.rows) {
            let inverse = self.entry(i, i) as i128;
            *side = side.map(|y| shift(y as i128 * inverse, ENTRY_BITS));
        }
        for i in (0..self.rows).rev() {
            let from = self.first(i);
            let (above, here) = sides.split_at_mut(i);
            for (j, side) in (from..i).zip(&mut above[from..]) {
                let l = self.entry(i, j) as i128;
                for (y, x) in side.iter_mut().zip(here[0]) {
                    *y = bounded(*y - shift(l * x as i128, ENTRY_BITS));
                }
            }
        }
    }
}

/// Largest magnitude of an entry or an unknown.
const LIMIT: i64 = 1 << 52;

const fn bounded(value: i64) -> i64 {
    if value > LIMIT {
        LIMIT
    } else if value < -LIMIT {
        -LIMIT
    } else {
        value
    }
}

/// `value / 2^bits` rounded to the nearest, within [`LIMIT`].
fn shift(value: i128, bits: u32) -> i64 {
    let half = if bits == 0 { 0 } else { 1 << (bits - 1) };
    ((value + half) >> bits).clamp(-LIMIT as i128, LIMIT as i128) as i64
}
