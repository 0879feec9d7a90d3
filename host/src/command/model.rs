//! One pair to one model: reconstructed, written, and told about.

use std::path::Path;
use std::time::{Duration, Instant};

use image::GrayImage;
use nalgebra::Vector3;

use super::Failure;
use super::table::{Table, count, percent, sides};
use crate::calibration::StereoCamera;
use crate::mesh::Mesh;
use crate::output;
use crate::reconstruct::{Options, Reconstruction, reconstruct};
use crate::report::record::Record;
use crate::report::{Run, numbers, words};

/// All that a model comes from.
pub(super) struct Order<'a> {
    pub(super) images: [GrayImage; 2],
    pub(super) calibration: &'a StereoCamera,
    pub(super) options: &'a Options,
    /// Whether to draw the stages.
    pub(super) pictures: bool,
    /// The true surface, to be shown beside the model.
    pub(super) truth: Option<&'a Mesh>,
    /// Where the results go.
    pub(super) folder: &'a Path,
}

/// What has come of it.
pub(super) struct Model {
    pub(super) reconstruction: Reconstruction,
    /// As in `report.json`.
    pub(super) report: serde_json::Value,
    /// From images to files.
    pub(super) time: Duration,
}

/// Reconstructs and writes.
pub(super) fn make(order: Order<'_>) -> Result<Model, Failure> {
    let start = Instant::now();
    let Order { images: [left, right], calibration, options, truth, .. } = order;
    let mut record = if order.pictures { Record::new() } else { Record::figures_only() };
    let reconstruction = reconstruct(left, right, calibration, options, &mut record)?;
    let run = Run { calibration, options, reconstruction: &reconstruction, record: &record, truth };
    output::write(order.folder, &run)?;
    let report = serde_json::from_slice(&numbers::json(&run))?;
    Ok(Model { reconstruction, report, time: start.elapsed() })
}

impl Model {
    /// The box around the model, mm.
    pub(super) fn size(&self) -> Vector3<f64> {
        self.reconstruction.mesh.bounds().map_or_else(Vector3::zeros, |[low, high]| high - low)
    }

    /// Everything that the user should know, in words.
    pub(super) fn warnings(&self) -> Vec<String> {
        warnings(&self.reconstruction)
    }

    /// Adds what people want to know to a table.
    pub(super) fn tell(&self, table: &mut Table) {
        let mesh = &self.reconstruction.mesh;
        let distance = mesh.bounds().map_or(0.0, |[low, high]| nalgebra::center(&low, &high).coords.norm());
        table.row("size", &sides(self.size()));
        table.row("distance", &format!("{distance:.0} mm from the left camera"));
        table.row("model", &format!("{} vertices, {} faces", mesh.vertices.len(), mesh.faces.len()));
    }
}

/// Everything that the user should know about a reconstruction, in words.
pub(super) fn warnings(made: &Reconstruction) -> Vec<String> {
    let mut warnings: Vec<String> = made.outcome.findings.iter().map(words::sentence).collect();
    let (bodies, share) = made.dropped;
    if bodies > 0 {
        let pieces = count(bodies, "loose piece", "loose pieces");
        warnings.push(format!("{pieces} with {} of the volume left out", percent(share)));
    }
    warnings
}
