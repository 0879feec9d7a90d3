//! How far a model is from the truth.
//!
//! MODEL and TRUTH are meshes (PLY, OBJ or STL) in the same axes and in millimetres; nothing is moved to
//! fit. Distances are measured from points spread evenly over either surface to the other; percentages
//! refer to the diagonal of the truth's box. With --calib the silhouettes that both would have in the two
//! images are compared as well. The cross-sections are those of the paper's table 4.
//!
//! Examples:
//!   host evaluate model.ply truth.ply
//!   host evaluate model.ply scan.stl --calib calib.yaml --json

use std::path::PathBuf;

use super::table::{Table, count, percent};
use super::{Failure, say, say_json};
use crate::calibration::StereoCamera;
use crate::evaluate::{Evaluation, Options, evaluate};
use crate::mesh::read::read;
use crate::view::Calibrated;

/// Arguments of `evaluate`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The mesh to be judged
    model: PathBuf,
    /// The mesh it should be
    truth: PathBuf,
    /// Calibration of a pair, to compare silhouettes
    #[arg(long, value_name = "FILE")]
    calib: Option<PathBuf>,
    /// Points on each surface
    #[arg(long, value_name = "N", default_value_t = 20_000, value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    samples: u32,
    /// Print one JSON document instead of text
    #[arg(long)]
    pub(super) json: bool,
}

/// Compares two meshes.
///
/// # Errors
///
/// If a file cannot be read.
pub fn run(args: &Args) -> Result<(), Failure> {
    let views = match &args.calib {
        Some(path) => Calibrated::pair(&StereoCamera::read(path)?).to_vec(),
        None => Vec::new(),
    };
    let (model, truth) = (read(&args.model)?, read(&args.truth)?);
    let options = Options { samples: args.samples as usize, ..Options::default() };
    let found = evaluate(&model, &truth, &views, &options);
    if args.json {
        return say_json(&serde_json::to_value(&found)?);
    }
    let mut table = Table::new(&format!("{} against {}", args.model.display(), args.truth.display()));
    tell(&found, &mut table);
    tell_sections(&found, &mut table);
    say(table.text())
}

/// Adds the measures to a table.
pub(super) fn tell(found: &Evaluation, table: &mut Table) {
    if let Some(distance) = &found.distance {
        let both = &distance.symmetric;
        let row = |mm: f64, pct: f64| format!("{mm:.3} mm, {pct:.3} %");
        table.row("mean error", &row(both.mean_mm, both.mean_pct));
        table.row("rms error", &row(both.rms_mm, both.rms_pct));
        table.row("95 % within", &row(both.p95_mm, both.p95_pct));
        table.row("largest", &row(both.max_mm, both.max_pct));
    }
    if let Some(iou) = found.volume_iou {
        table.row("volume", &format!("{} in common", percent(iou)));
    }
    if let Some(ratio) = found.volume_ratio {
        table.row("", &format!("{} of the truth's", percent(ratio)));
    }
    if let [left, right] = found.silhouette_iou[..] {
        table.row("silhouettes", &format!("{} in common left, {} right", percent(left), percent(right)));
    }
    let closed = if found.closed { "closed" } else { "NOT closed" };
    table.row("mesh", &format!("{closed}, {}", count(found.bodies, "body", "bodies")));
}

fn tell_sections(found: &Evaluation, table: &mut Table) {
    let mm = |value: Option<f64>| value.map_or("none".to_owned(), |mm| format!("{mm:.3} mm"));
    for row in &found.sections.rows {
        let name = format!("section {}", row.section);
        let (there, back) = (mm(row.model_to_truth_mm), mm(row.truth_to_model_mm));
        table.row(&name, &format!("{there} to the truth, {back} back"));
    }
    table.row("sections", &format!("{} on average", mm(found.sections.mean_mm)));
}
