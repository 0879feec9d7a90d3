//! Pictures of what each stage made, for people: a sheet a stage, both views side by side, cropped to the
//! object and enlarged by a whole number, so that pixels stay to be seen.

pub(crate) mod canvas;
pub(crate) mod colour;
pub(crate) mod eye;
pub(crate) mod gallery;
mod histogram;
mod model;
mod pair;
mod panel;
pub(crate) mod plot;

use super::Run;
use crate::reconstruct::Mode;
use eye::Seen;
use image::RgbImage;
use rayon::prelude::*;
use shared::pipeline::Side;

use super::words::view;

/// File names of all pictures that a run may have, in the order of the stages.
pub const NAMES: [&str; 10] = [
    "0-threshold.png",
    "1-mask.png",
    "2-contour.png",
    "3-distance.png",
    "4-skeleton.png",
    "5-hull.png",
    "6-invariants.png",
    "7-correspondence.png",
    "8-curves.png",
    "model.png",
];

/// The pictures of a run with their file names; none without rasters.
#[must_use]
pub fn draw(run: &Run<'_>) -> Vec<(&'static str, RgbImage)> {
    let [left, right] = &run.record.eyes;
    let (Some(left_rasters), Some(right_rasters)) = (&left.rasters, &right.rasters) else {
        return Vec::new();
    };
    let views = [
        Seen { name: view(&Side::Left), parts: &left.parts, rasters: left_rasters },
        Seen { name: view(&Side::Right), parts: &right.parts, rasters: right_rasters },
    ];
    let pair = &run.record.pair;
    let (offset, omega) = match run.options.mode {
        Mode::Default => (run.reconstruction.outcome.vertical_offset, 0),
        // The paper's stages take rows as they are.
        Mode::Paper { omega } => (0, omega),
    };
    let painters: [&(dyn Fn() -> Option<RgbImage> + Sync); NAMES.len()] = [
        &|| Some(histogram::histograms(&views)),
        &|| eye::mask(&views),
        &|| eye::contour(&views),
        &|| eye::distance(&views),
        &|| eye::skeleton(&views),
        &|| pair::hulls(&views, pair, offset),
        &|| pair::invariants(&views, pair, omega),
        &|| pair::correspondence(&views, pair, offset),
        &|| eye::curves(&views),
        &|| model::model(left, &run.reconstruction.mesh, run.truth),
    ];
    let named = NAMES.into_par_iter().zip(painters);
    named.filter_map(|(name, paint)| Some((name, paint()?))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture::Capsule;
    use crate::report::record::Record;

    fn names(mode: Mode, record: Record) -> Vec<&'static str> {
        let capsule = Capsule::new(mode, record);
        let drawn = draw(&capsule.run());
        for (name, picture) in &drawn {
            let (width, height) = picture.dimensions();
            assert!(
                (400..2000).contains(&width) && (300..1200).contains(&height),
                "{name}: {width} x {height}"
            );
        }
        drawn.into_iter().map(|(name, _)| name).collect()
    }

    #[test]
    fn every_stage_has_its_picture_in_both_modes() {
        assert_eq!(names(Mode::Default, Record::new()), NAMES);
        assert_eq!(names(Mode::Paper { omega: 3 }, Record::new()), NAMES);
    }

    #[test]
    fn without_rasters_nothing_is_drawn() {
        assert!(names(Mode::Default, Record::figures_only()).is_empty());
    }
}
