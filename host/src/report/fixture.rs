//! A reconstructed capsule for the tests of what is written about a run.

use super::Run;
use super::record::Record;
use crate::calibration::StereoCamera;
use crate::reconstruct::{Mode, Options, Reconstruction, reconstruct};
use crate::render::render;
use crate::shape::Shape;
use crate::view::Pinhole;

/// A run that owns its parts.
pub(crate) struct Capsule {
    calibration: StereoCamera,
    options: Options,
    record: Record,
    pub(crate) made: Reconstruction,
}

impl Capsule {
    /// Rendered, reconstructed, recorded.
    pub(crate) fn new(mode: Mode, mut record: Record) -> Self {
        let images = render(&Shape::Capsule.mesh(3.0), &Pinhole::pair());
        let [left, right] = <[_; 2]>::try_from(images).expect("two views give two images");
        let calibration = StereoCamera::rectified(640, 480, 750.0, 60.0);
        let options = Options { mode, cell: Some(4.0), ..Options::default() };
        let made = reconstruct(left, right, &calibration, &options, &mut record).expect("a good pair");
        Self { calibration, options, record, made }
    }

    pub(crate) fn run(&self) -> Run<'_> {
        Run {
            calibration: &self.calibration,
            options: &self.options,
            reconstruction: &self.made,
            record: &self.record,
            truth: None,
        }
    }
}
