//! The visible side: what of the model was measured, and what is inferred.

use super::super::Run;
use crate::stage::front::Measured;
use serde::Serialize;

/// Where the model's shape comes from. The outline is always measured, and the back never.
#[derive(Serialize)]
pub(super) struct Front {
    measured: &'static str,
    inferred: &'static str,
    /// `null` where the visible side is from balls.
    grey: Option<Grey>,
}

/// What the grey levels gave.
#[derive(Serialize)]
struct Grey {
    /// Part of the left view of the object whose depth both eyes tell better than balls.
    measured_share: f64,
    /// Part of it that was not trusted and stays as balls have it.
    distrusted_share: f64,
    /// Standard deviation of a grey level.
    noise_grey: f64,
    /// Of the difference between the eyes, grey levels: on the balls, and on what was measured.
    residual_balls_grey: f64,
    residual_measured_grey: f64,
    /// How the right eye answers the left one.
    gain: f64,
    offset_grey: f64,
    /// Right less left row, all of it.
    vertical_offset_px: f64,
    mean_confidence: f64,
}

impl Front {
    pub(super) fn of(run: &Run<'_>) -> Self {
        let grey = run.reconstruction.front.as_ref().map(Grey::of);
        let balls = run.reconstruction.front.as_ref().is_none_or(|measured| measured.share == 0.0);
        Self {
            measured: if balls {
                "the outline, by both eyes"
            } else {
                "the outline, and the depth of what both eyes see of the side towards them (model.ply: confidence)"
            },
            inferred: if balls {
                "all else: cross-sections are taken to be round"
            } else {
                "the back, whose thickness one pair cannot show, and what only one eye sees: from round cross-sections"
            },
            grey,
        }
    }
}

impl Grey {
    fn of(measured: &Measured) -> Self {
        let vertices = measured.confidence.len().max(1) as f64;
        Self {
            measured_share: measured.share,
            distrusted_share: measured.distrusted,
            noise_grey: measured.noise,
            residual_balls_grey: measured.residuals[0],
            residual_measured_grey: measured.residuals[1],
            gain: measured.gain,
            offset_grey: measured.offset,
            vertical_offset_px: measured.rows,
            mean_confidence: measured.confidence.iter().sum::<f64>() / vertices,
        }
    }
}
