//! Stages that need what comes before them: the pipeline runs, with the image as both views, and shows
//! what it made of one.

use super::{Args, Failure, Made, Stage};
use crate::memory::Storage;
use crate::report::record::Record;
use crate::report::words;
use image::GrayImage;
use shared::bitmap::{Grey, Size};
use shared::fixed::PX;
use shared::pipeline::{self, Settings, Side};
use shared::stage::depth::Optics;

/// Depth is of no interest here: any focal length does, and any disparity between the image and itself
/// that puts the object in front of the cameras, 1/256 px.
const OPTICS: Optics = Optics { focal: 1000 * PX, disparity_offset: 100 * PX };

/// Run the pipeline as often as is asked for.
pub(super) fn make(args: &Args, image: &GrayImage) -> Result<Made, Failure> {
    let size = Size::new(image.width() as usize, image.height() as usize)?;
    let grey = Grey::new(size, size.width, image.as_raw())?;
    let settings = Settings {
        threshold: args.threshold,
        polarity: args.polarity,
        thinning: args.rule,
        ..Settings::new(OPTICS)
    };
    let mut storage = Storage::new(size.width, size.height)?;
    let mut made = Made::default();
    for _ in 0..args.repeat {
        let mut record = Record::new();
        let end = pipeline::run(&mut storage.lend(), grey, grey, &settings, &mut record);
        let lap =
            record.laps.iter().find(|lap| lap.stage == name(args.stage) && lap.side != Some(Side::Right));
        // A pair that is refused later has this stage's result nevertheless.
        match (lap, end) {
            (Some(lap), _) => made.times.push(lap.time),
            (None, Err(finding)) => return Err(words::sentence(&finding).into()),
            (None, Ok(_)) => return Err("the image gives no such thing".into()),
        }
        made.balls = record.pair.balls;
        let [eye, _] = record.eyes;
        (made.parts, made.rasters) = (eye.parts, eye.rasters.unwrap_or_default());
    }
    Ok(made)
}

/// The stage's name in a record.
const fn name(stage: Stage) -> &'static str {
    match stage {
        Stage::Contour => "contour",
        Stage::Graph => "graph",
        Stage::Medial => "balls",
        Stage::Nurbs => "curves",
        _ => "mask",
    }
}
