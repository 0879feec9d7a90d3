//! The pictures that compare: models beside the truth, and the plot of Figure 14.

use image::{GrayImage, RgbImage};
use std::io;
use std::path::Path;

use super::branches::Point;
use super::study::{Study, Subject, Way};
use crate::mesh::Mesh;
use crate::output::png;
use crate::report::pictures::gallery::{From, gallery, look, square};
use crate::report::pictures::plot::{Line, plot};
use crate::view::{Calibrated, View};

/// Numbers of branches that are shown, as in the paper's Figure 13.
const SHOWN: [u16; 4] = [2, 4, 8, 16];

fn write(folder: &Path, name: &str, picture: &RgbImage) -> io::Result<()> {
    std::fs::write(folder.join(name), png(picture)?)
}

/// Every way's model beside the truth, from the front and from above.
pub(super) fn beside_baselines(folder: &Path, subject: &Subject, study: &Study) -> io::Result<()> {
    let models = study.ways.iter().filter_map(|(way, found)| Some((way.name(), &found.as_ref().ok()?.mesh)));
    let models: Vec<(&str, &Mesh)> = [("truth", &subject.truth)].into_iter().chain(models).collect();
    let title = format!("{}: the truth and every way, from the left camera and from above", subject.shape);
    write(folder, &format!("ways-{}.png", study.name), &gallery(&title, &views(&models, &subject.truth)))
}

/// A row a direction, a column a model.
fn views(models: &[(&str, &Mesh)], frame: &Mesh) -> Vec<Vec<(String, GrayImage)>> {
    let row = |from: From| {
        let pictures = models.iter().map(|(name, mesh)| Some(((*name).to_owned(), look(mesh, frame, from)?)));
        pictures.flatten().collect()
    };
    [From::Front, From::Above].map(row).into()
}

/// Figure 9: the noisy pair and what was made of it.
pub(super) fn noise(folder: &Path, subject: &Subject, study: &Study) -> io::Result<()> {
    let middle = subject.truth.bounds().map(|[low, high]| nalgebra::center(&low, &high));
    let photograph = |eye: usize| {
        let view = Calibrated::pair(&subject.calibration)[eye];
        let centre = middle.and_then(|middle| view.project(&middle)).unwrap_or_default();
        square(&subject.images[eye], centre.into())
    };
    let mut row: Vec<(String, GrayImage)> =
        vec![("left image".to_owned(), photograph(0)), ("right image".to_owned(), photograph(1))];
    if let Some(found) = study.found(Way::Full) {
        for (name, from) in [("model, front", From::Front), ("model, from above", From::Above)] {
            row.extend(look(&found.mesh, &subject.truth, from).map(|picture| (name.to_owned(), picture)));
        }
    }
    let title = "Noise of 20 grey levels, 2 % salt and pepper: the pair and its model";
    write(folder, "fig-09-noise.png", &gallery(title, &[row]))
}

/// Figures 13 and 14: some of the models, and the error of all.
pub(super) fn branches(folder: &Path, subject: &Subject, grown: &[(Point, Option<Mesh>)]) -> io::Result<()> {
    let shown = grown.iter().filter(|(point, _)| SHOWN.contains(&point.branches));
    let named: Vec<(String, &Mesh)> = shown
        .filter_map(|(point, mesh)| Some((format!("{} branches", point.branches), mesh.as_ref()?)))
        .collect();
    let mut models: Vec<(&str, &Mesh)> = named.iter().map(|(name, mesh)| (name.as_str(), *mesh)).collect();
    models.push(("truth", &subject.truth));
    let title = "The animal from skeletons of more and more branches";
    write(folder, "fig-13-branches.png", &gallery(title, &views(&models, &subject.truth)))?;
    let line = |name, value: fn(&Point) -> Option<f64>| {
        let points = grown.iter().filter_map(|(point, _)| Some([f64::from(point.branches), value(point)?]));
        Line { name, points: points.collect() }
    };
    let lines = [line("truth to model", |p| p.missing_mm), line("symmetric", |p| p.mean_mm)];
    let title = "Error of the animal against the number of branches";
    let picture = plot(title, "branches of the skeleton", "mean error, mm", &lines);
    write(folder, "fig-14-accuracy.png", &picture)
}
