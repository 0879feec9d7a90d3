//! What a run says, in the order in which it arises: what the core made ([`record`]), how long it took ([`times`]),
//! the figures (`report.json`, [`numbers`]), the layers of what is drawn, the pictures ([`pictures`]), the page
//! ([`page`]), and sentences for people ([`words`]).

pub mod words;
pub mod record;
pub mod times;
pub mod numbers;
pub(crate) mod layers;
pub mod pictures;
pub mod page;

use crate::calibration::StereoCamera;
use crate::mesh::Mesh;
use crate::reconstruct::{Options, Reconstruction, Refusal};
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

/// A pair of which no model came.
#[derive(Clone, Copy, Debug)]
pub struct Refused<'a> {
    /// The choices made.
    pub options: &'a Options,
    /// What the core made before it stopped, and the images as they came ([`Record::complete`]).
    pub record: &'a Record,
    /// Why.
    pub refusal: &'a Refusal,
}

#[cfg(test)]
pub(crate) mod fixture;
