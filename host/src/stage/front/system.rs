//! Normal equations on a lattice, and their solution.
//!
//! * **In**: terms (residual, weight, slopes) that each concern a node, or neighbours in one of the stencils of second
//!   differences. **Out**: the least-squares step at each node.
//! * **Form**: a node is coupled to twelve others at most, and the matrix is symmetric: a diagonal and six bands,
//!   stored for a whole rectangle of nodes with a margin, so that no bound is looked at and loops run over registers.
//!   Nodes outside the object have zeros everywhere but on the diagonal.
//! * **Method**: conjugate gradients (Hestenes and Stiefel 1952), preconditioned by the diagonal. Long waves are
//!   settled on coarser lattices, so that few turns are left for the finest (decisions/0023).
//! * **Cost**: 13 multiplications a node and turn. Sequential: the same bits for any number of threads.

use super::pool::{Lent, Shelf};

/// Margin of a lattice on each side, nodes: as far as a stencil reaches.
pub(super) const MARGIN: usize = 2;

/// Bands of the upper half.
const BANDS: usize = 6;

/// Part of the residual that may be left: the next step of Gauss-Newton begins there.
const TOLERANCE: f64 = 0.03;
/// Turns at most.
const TURNS: usize = 40;

/// Symmetric equations.
#[derive(Debug)]
pub(super) struct System<'p> {
    offsets: [usize; BANDS],
    diagonal: Lent<'p, f64>,
    bands: [Lent<'p, f64>; BANDS],
    right: Lent<'p, f64>,
    /// Nodes that are none of the margin.
    inner: std::ops::Range<usize>,
}

impl<'p> System<'p> {
    /// Equations without terms for rows of `width` nodes, margins included.
    pub(super) fn new(shelf: &'p Shelf<f64>, width: usize, nodes: usize) -> Self {
        let zeros = || shelf.filled(0.0, nodes);
        Self {
            offsets: [1, 2, width - 1, width, width + 1, 2 * width],
            diagonal: zeros(),
            bands: std::array::from_fn(|_| zeros()),
            right: zeros(),
            inner: MARGIN * width..nodes - MARGIN * width,
        }
    }

    /// Take all terms away.
    pub(super) fn clear(&mut self) {
        self.diagonal.fill(0.0);
        self.bands.iter_mut().for_each(|band| band.fill(0.0));
        self.right.fill(0.0);
    }

    /// Add `weight` (residual + slope x)^2 / 2 for the node `at`.
    pub(super) fn add(&mut self, at: usize, weight: f64, residual: f64, slope: f64) {
        self.diagonal[at] += weight * slope * slope;
        self.right[at] -= weight * slope * residual;
    }

    /// The same for the sum of slopes times nodes, in the order of their places, which a stencil couples.
    pub(super) fn couple<const N: usize>(
        &mut self,
        places: [usize; N],
        slopes: [f64; N],
        weight: f64,
        residual: f64,
    ) {
        for (i, (&from, &slope)) in places.iter().zip(&slopes).enumerate() {
            self.add(from, weight, residual, slope);
            for (&to, &other) in places.iter().zip(&slopes).skip(i + 1) {
                if let Some(band) = self.offsets.iter().position(|&offset| offset == to - from) {
                    self.bands[band][from] += weight * slope * other;
                }
            }
        }
    }

    /// The matrix times `x` into `product`.
    fn multiply(&self, x: &[f64], product: &mut [f64]) {
        let inner = self.inner.clone();
        let out = &mut product[inner.clone()];
        for ((out, x), diagonal) in out.iter_mut().zip(&x[inner.clone()]).zip(&self.diagonal[inner.clone()]) {
            *out = diagonal * x;
        }
        for (band, &offset) in self.bands.iter().zip(&self.offsets) {
            let ahead = &x[inner.start + offset..inner.end + offset];
            let behind = &x[inner.start - offset..inner.end - offset];
            let here = &band[inner.clone()];
            let there = &band[inner.start - offset..inner.end - offset];
            for ((((out, ahead), behind), here), there) in
                out.iter_mut().zip(ahead).zip(behind).zip(here).zip(there)
            {
                *out += here * ahead + there * behind;
            }
        }
    }

    /// Solve for x, from 0.
    pub(super) fn solve(&self, x: &mut [f64]) {
        let shelf = self.right.shelf();
        let scale = shelf.of(self.diagonal.iter().map(|&d| if d > 0.0 { d.recip() } else { 0.0 }));
        x.fill(0.0);
        let mut residual = shelf.of(self.right.iter().copied());
        let mut along = shelf.of(residual.iter().zip(scale.iter()).map(|(r, s)| r * s));
        let mut product = shelf.filled(0.0, x.len());
        let mut size = dot(&residual, &along);
        let enough = size * TOLERANCE * TOLERANCE;
        for _ in 0..TURNS {
            if size <= enough {
                return;
            }
            self.multiply(&along, &mut product);
            let step = size / dot(&along, &product);
            add(x, &along, step);
            add(&mut residual, &product, -step);
            for ((product, residual), scale) in product.iter_mut().zip(residual.iter()).zip(scale.iter()) {
                *product = residual * scale;
            }
            let before = size;
            size = dot(&residual, &product);
            let keep = size / before;
            for (along, product) in along.iter_mut().zip(product.iter()) {
                *along = product + keep * *along;
            }
        }
    }
}

/// Adds `share` of each value.
pub(super) fn add(sums: &mut [f64], values: &[f64], share: f64) {
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum += share * value;
    }
}

/// The sum of products, in eight sums side by side, whose order no compiler may choose.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    let mut sums = [0.0; 8];
    for (a, b) in a.iter().zip(b) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    sums.iter().sum::<f64>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f64>()
}
