//! The inner loops that a machine may run its own way.

use crate::stage::{binarise, parallel_thinning};

/// The few loops that the time of a run goes into, as functions: a machine with wide registers lends its
/// own beside its memory. Each gives the bits that the portable one gives, for any input.
#[derive(Clone, Copy, Debug)]
pub struct Kernels {
    /// As [`binarise::median_row`].
    pub median_row: binarise::MedianRow,
    /// As [`parallel_thinning::thin`].
    pub thin: parallel_thinning::Thin,
}

impl Kernels {
    /// What every machine can do.
    pub const PORTABLE: Self = Self { median_row: binarise::median_row, thin: parallel_thinning::thin };
}
