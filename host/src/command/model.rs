//! One pair to one model: reconstructed, written, and told about.

use std::path::Path;
use std::time::{Duration, Instant};

use image::GrayImage;
use nalgebra::Vector3;

use shared::camera::PairModel;
use shared::wire::Decoder;

use super::Failure;
use super::table::{Table, count, percent, sides};
use crate::calibration::StereoCamera;
use crate::mesh::Mesh;
use crate::output;
use crate::reconstruct::{Options, Reconstruction, Refusal, describe, reconstruct, reconstruct_shape};
use crate::report::record::Record;
use crate::report::{Run, numbers, words};
use crate::source::serial::inbox::{Inbox, Message, Pair};

/// All that a model comes from.
pub(super) struct Order<'a> {
    pub(super) images: [GrayImage; 2],
    pub(super) calibration: &'a StereoCamera,
    pub(super) options: &'a Options,
    /// Whether to draw the stages.
    pub(super) pictures: bool,
    /// What a page about it is called, if there is to be one.
    pub(super) page: Option<&'a str>,
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
    let report = written(order.folder, &run, order.page)?;
    Ok(Model { reconstruction, report, time: start.elapsed() })
}

/// Reconstructs and writes what a device of this calibration would send of the images.
pub(super) fn make_as_device(
    [left, right]: [GrayImage; 2],
    calibration: &StereoCamera,
    options: &Options,
    folder: &Path,
) -> Result<Model, Failure> {
    let start = Instant::now();
    let (device, bytes) = describe(left, right, calibration, options)?;
    let mut inbox = Inbox::new()?;
    let mut buffer = vec![0; bytes.len()];
    let mut decoder = Decoder::new(&mut buffer);
    let pair = bytes.into_iter().find_map(|byte| decoder.push(byte).map(|frame| inbox.read(&frame)));
    let Some(Message::Pair(pair)) = pair.transpose()? else {
        return Err("the frame of a pair was lost on its way through memory".into());
    };
    let model = receive((&mut inbox, *pair), &device, options, folder)?;
    Ok(Model { time: start.elapsed(), ..model })
}

/// Reconstructs and writes what a device has sent; its shape stands in the inbox.
pub(super) fn receive(
    (inbox, pair): (&mut Inbox, Pair),
    model: &PairModel,
    options: &Options,
    folder: &Path,
) -> Result<Model, Failure> {
    let start = Instant::now();
    let outcome = pair.result.map_err(Refusal::from)?;
    let mut record = Record::figures_only();
    for (k, eye) in record.eyes.iter_mut().enumerate() {
        (eye.parts.level, eye.parts.area) = (pair.levels[k], outcome.areas[k] as usize);
    }
    let reconstruction = reconstruct_shape(&mut inbox.memory(), outcome, model, options, &mut record)?;
    let calibration = &model.into();
    let run = Run { calibration, options, reconstruction: &reconstruction, record: &record, truth: None };
    let report = written(folder, &run, None)?;
    Ok(Model { reconstruction, report, time: start.elapsed() })
}

/// Writes all files of a run; returns its report.
fn written(folder: &Path, run: &Run<'_>, page: Option<&str>) -> Result<serde_json::Value, Failure> {
    output::write(folder, run, page)?;
    Ok(serde_json::from_slice(&numbers::json(run))?)
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
