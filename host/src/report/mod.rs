//! What a run says, in the order in which it arises: what the core made ([`record`]), how long it took ([`times`]),
//! the figures (`report.json`, [`numbers`]), the pictures ([`pictures`]), the page ([`page`]), and sentences for
//! people ([`words`]).

pub mod words;
pub mod record;
pub mod times;
pub mod numbers;
pub mod pictures;
pub mod page;

use crate::calibration::StereoCamera;
use crate::mesh::Mesh;
use crate::reconstruct::{Options, Reconstruction};
use record::Record;

/// One finished run: all that its report is made of.
#[derive(Clone, Copy, Debug)]
pub struct Run<'a> {
    /// The pair's calibration.
    pub calibration: &'a StereoCamera,
    /// The choices made.
    pub options: &'a Options,
    /// What came of it.
    pub reconstruction: &'a Reconstruction,
    /// What the core made on the way; pictures are drawn only if it kept rasters.
    pub record: &'a Record,
    /// The true surface in the left camera's axes, mm, to be shown beside the model.
    pub truth: Option<&'a Mesh>,
}

#[cfg(test)]
pub(crate) mod fixture;
