//! Pictures of what each stage made, for people: a sheet a stage, both views side by side, cropped to the
//! object and enlarged by a whole number, so that pixels stay to be seen.

pub(crate) mod canvas;
pub(crate) mod gallery;
mod histogram;
mod invariants;
mod model;
mod panel;
pub(crate) mod plot;
pub(crate) mod sheet;

use super::Run;
use super::layers::pair::Pair;
use image::RgbImage;
use rayon::prelude::*;

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
    let eyes = &run.record.eyes;
    if eyes.iter().any(|eye| eye.rasters.is_none()) {
        return Vec::new();
    }
    let pair = Pair::of(run.record, run.options.mode, run.reconstruction.outcome.vertical_offset);
    let views = &pair.views;
    let painters: [&(dyn Fn() -> Option<RgbImage> + Sync); NAMES.len()] = [
        &|| Some(histogram::histograms(views)),
        &|| sheet::mask(views),
        &|| sheet::contour(views),
        &|| sheet::distance(views),
        &|| sheet::skeleton(views),
        &|| sheet::hulls(&pair),
        &|| pair.invariants().map(|found| invariants::chart(&found)),
        &|| sheet::correspondence(&pair),
        &|| sheet::curves(views),
        &|| model::model(&eyes[0], &run.reconstruction.mesh, run.truth),
    ];
    let named = NAMES.into_par_iter().zip(painters);
    named.filter_map(|(name, paint)| Some((name, paint()?))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reconstruct::Mode;
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
