//! Pictures of what each stage made.

use super::Run;
use image::RgbImage;

/// File names of all pictures that a run may have, in the order of the stages.
pub const NAMES: [&str; 0] = [];

/// The pictures of a run with their file names; none without rasters.
#[must_use]
pub fn draw(_: &Run<'_>) -> Vec<(&'static str, RgbImage)> {
    Vec::new()
}
