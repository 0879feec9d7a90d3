//! A model from a built-in pair, held against the truth: no camera, no files, no network.
//!
//! Renders a shape (torus, torus_tilt, sphere, capsule, screwdriver, block, teapot, mouse or animal),
//! reconstructs it from the two images alone, and measures how far the model is from the shape. Leaves the images,
//! calib.yaml, truth.ply, model.ply, skeleton.ply, boundary.ply, report.json, pictures, and report.html, which shows
//! all of it in a browser: the model turning, both views with every stage, the error in colour.
//!
//! Examples:
//!   host demo
//!   host demo teapot --out teapot
//!   host replay teapot --out again

use std::path::PathBuf;
use std::time::Instant;

use nalgebra::Vector3;
use serde_json::json;

use super::model::{self, Model, Order, Place};
use super::scene::{Scene, write};
use super::table::Table;
use super::{Failure, evaluate, say, say_json};
use crate::calibration::StereoCamera;
use crate::evaluate::{Evaluation, Options};
use crate::mesh::Mesh;
use crate::reconstruct::{self, Workspace};
use crate::shape::Shape;
use crate::view::Calibrated;

/// Points on each surface from which errors are measured: the mean is right to 0.01 mm.
const SAMPLES: usize = 5_000;

/// Arguments of `demo`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The shape
    #[arg(default_value = "torus", value_parser = shape)]
    name: Shape,
    /// Folder for the results [default: ossature-demo/NAME]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Leave out report.html
    #[arg(long)]
    no_report: bool,
    /// Print one JSON document instead of text
    #[arg(long)]
    pub(super) json: bool,
}

/// Renders, reconstructs, compares.
///
/// # Errors
///
/// If the results cannot be written.
pub fn run(args: &Args) -> Result<(), Failure> {
    let start = Instant::now();
    let shape = args.name;
    let folder = args.out.clone().unwrap_or_else(|| PathBuf::from("ossature-demo").join(shape.name()));
    let scene = Scene::new(shape.mesh(shape.cell()), StereoCamera::rectified(640, 480, 750.0, 60.0));
    write(&folder, &scene)?;
    let rendered = start.elapsed();
    let [left, right] = [0, 1].map(|eye| scene.images[eye].clone());
    let order = Order {
        images: [left, right],
        calibration: &scene.calibration,
        options: &reconstruct::Options::default(),
        pictures: true,
        truth: Some(&scene.truth),
        place: Place { folder: Some(&folder), report: args.json, page: !args.no_report },
    };
    let (model, made) = model::make_and_keep(order, &mut Workspace::default())?;
    let found = measure(&made.mesh, &scene);
    if args.json {
        return say_json(&json!({
            "shape": shape.name(),
            "folder": folder.display().to_string(),
            "size_mm": <[f64; 3]>::from(model.size),
            "size_error_mm": size_error(&model, &scene),
            "warnings": &model.warnings,
            "evaluation": found,
            "report": model.report,
        }));
    }
    let mut table = Table::new(shape.name());
    model.tell(&mut table);
    let [width, height, depth] = size_error(&model, &scene);
    table.row("size error", &format!("{width:+.1} mm wide, {height:+.1} high, {depth:+.1} deep"));
    evaluate::tell(&found, &mut table);
    for warning in &model.warnings {
        table.warning(warning);
    }
    let [all, rendered, made] = [start.elapsed(), rendered, model.time].map(|time| time.as_secs_f64());
    table.row(
        "time",
        &format!("{all:.2} s: {rendered:.2} to render, {made:.2} for the model, rest to compare"),
    );
    table.row("files", &folder.display().to_string());
    say(table.text())
}

fn measure(model: &Mesh, scene: &Scene) -> Evaluation {
    let options = Options { samples: SAMPLES, ..Options::default() };
    let views = Calibrated::pair(&scene.calibration);
    crate::evaluate::evaluate(model, &scene.truth, &views, &options)
}

/// By how much the box around the model is larger than that around the shape, mm.
fn size_error(model: &Model, scene: &Scene) -> [f64; 3] {
    let truth = scene.truth.bounds().map_or_else(Vector3::zeros, |[low, high]| high - low);
    (model.size - truth).into()
}

/// The error as text, which is what the parser shows.
fn shape(name: &str) -> Result<Shape, String> {
    name.parse().map_err(|unknown: crate::shape::UnknownShape| unknown.to_string())
}
