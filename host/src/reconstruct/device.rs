//! The device's part, played by the host: from raw pictures to the frame that a camera device sends, in its
//! steps and to its bits (`firmware`), but for its small memory. What is made of a frame is the same
//! wherever it comes from.

use super::{Options, Refusal, core_settings, grey};
use crate::calibration::StereoCamera;
use crate::memory::Storage;
use crate::stage::rectify::Rectification;
use image::GrayImage;
use shared::camera::PairModel;
use shared::pipeline::{Finding, Observer, Product, Side, run};
use shared::wire::{Exposure, MAX_FRAME, PairReport, Shape, ToHost};

/// The device's model of a calibration, and the frame that a device of this calibration sends of a pair of raw
/// pictures, whether its core describes or refuses them.
///
/// # Errors
/// When the calibration is not that of these pictures, or beyond what a device takes.
pub fn describe(
    left: GrayImage,
    right: GrayImage,
    calibration: &StereoCamera,
    options: &Options,
) -> Result<(PairModel, Vec<u8>), Refusal> {
    calibration.left.check_size(left.width(), left.height())?;
    calibration.right.check_size(right.width(), right.height())?;
    let rectification = Rectification::same_size(calibration)?;
    let images = rectification.device_images(left, right)?;
    let model = rectification.model();
    let settings = core_settings((&model).into(), options);

    let (width, height) = images[0].dimensions();
    let mut storage = Storage::new(width as usize, height as usize).map_err(Finding::from)?;
    let mut memory = storage.lend();
    let mut levels = Levels::default();
    let [left, right] = images.each_ref().map(grey);
    let outcome = run(&mut memory, left?, right?, &settings, &mut levels);
    let report = ToHost::Pair(PairReport {
        number: 0,
        stamps: [0; 2],
        levels: levels.0,
        exposures: [Exposure::default(); 2],
        result: outcome.as_ref().map(|outcome| Shape::of(&memory, outcome)).map_err(|finding| *finding),
    });
    let mut frame = vec![0; MAX_FRAME];
    let length = report.encode(0, &mut frame).map_err(Finding::from)?;
    frame.truncate(length);
    Ok((model, frame))
}

/// Keeps the levels between object and background.
#[derive(Default)]
struct Levels([u8; 2]);

impl Observer for Levels {
    fn saw(&mut self, side: Option<Side>, product: Product<'_>) {
        if let (Some(side), Product::Threshold(_, _, level, _)) = (side, product) {
            self.0[side as usize] = level;
        }
    }
}
