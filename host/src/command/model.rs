//! One pair to one model: reconstructed, written, and told about.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use image::GrayImage;
use nalgebra::Vector3;

use shared::camera::PairModel;
use shared::wire::Decoder;

use super::table::{Table, count, percent, sides};
use super::{Failure, words_of};
use crate::calibration::StereoCamera;
use crate::mesh::Mesh;
use crate::output;
use crate::reconstruct::{Front, Options, Reconstruction, Refusal, Seen, Workspace, describe};
use crate::report::record::Record;
use crate::report::times::{self, Stage};
use crate::report::{Refused, Run, numbers, words};
use crate::source::serial::inbox::{Inbox, Message, Pair};

/// All that a model comes from.
pub(super) struct Order<'a> {
    pub(super) images: [GrayImage; 2],
    pub(super) calibration: &'a StereoCamera,
    pub(super) options: &'a Options,
    /// Whether to draw the stages.
    pub(super) pictures: bool,
    /// The true surface, to be shown beside the model.
    pub(super) truth: Option<&'a Mesh>,
    pub(super) place: Place<'a>,
}

/// Where results go.
#[derive(Clone, Copy)]
pub(super) struct Place<'a> {
    /// None if it is only looked at.
    pub(super) folder: Option<&'a Path>,
    /// Whether the report is wanted here as well.
    pub(super) report: bool,
    /// Whether there is to be a page about it.
    pub(super) page: bool,
}

/// That there is no model of a pair, in words, and why.
#[derive(Clone, Debug, thiserror::Error)]
#[error("{words}")]
pub(super) struct NoModel {
    words: String,
    pub(super) refusal: Arc<Refusal>,
}

impl From<Refusal> for NoModel {
    fn from(refusal: Refusal) -> Self {
        Self { words: words_of(&refusal), refusal: Arc::new(refusal) }
    }
}

impl Place<'_> {
    /// Why there is no model of a pair. That of an earlier one must not stand for it.
    pub(super) fn cleared(&self, failure: impl Into<Failure>) -> Failure {
        let failure = failure.into();
        match self.folder.map_or(Ok(()), output::clear) {
            Ok(()) => failure,
            Err(error) => {
                format!("{}; files of an earlier model stay: {}", words_of(&*failure), words_of(&error))
                    .into()
            }
        }
    }

    /// That a pair is refused, with a page about it if that is wanted. The model of an earlier one must not stand for
    /// it.
    fn refused(&self, options: &Options, record: &Record, refusal: Refusal) -> NoModel {
        let mut refused = NoModel::from(refusal);
        let Some(folder) = self.folder else { return refused };
        let refusal = &*refused.refusal;
        if let Err(error) = output::clear(folder) {
            refused.words += &format!("; files of an earlier model stay: {}", words_of(&error));
        } else if self.page {
            refused.words += &match output::write_refused(folder, &Refused { options, record, refusal }) {
                Ok(page) => format!("; {} shows it", page.display()),
                Err(failure) => format!("; and {}", words_of(&failure)),
            };
        }
        refused
    }
}

/// What is told of a model; its surface is in its file alone.
pub(super) struct Model {
    /// The box around it, mm.
    pub(super) size: Vector3<f64>,
    /// From the left camera, mm.
    distance: f64,
    vertices: usize,
    faces: usize,
    /// Everything that the user should know, in words.
    pub(super) warnings: Vec<String>,
    /// As in `report.json`, if it is wanted.
    pub(super) report: serde_json::Value,
    pub(super) stages: Vec<Stage>,
    /// For its files.
    pub(super) writing: Duration,
    /// From images to files.
    pub(super) time: Duration,
}

/// Reconstructs and writes.
pub(super) fn make(order: Order<'_>, workspace: &mut Workspace) -> Result<Model, Failure> {
    let (model, made) = make_and_keep(order, workspace)?;
    workspace.recycle(made);
    Ok(model)
}

/// Reconstructs and writes, and keeps what was made.
pub(super) fn make_and_keep(
    order: Order<'_>,
    workspace: &mut Workspace,
) -> Result<(Model, Reconstruction), Failure> {
    let mut record = if order.pictures { Record::new() } else { Record::figures_only() };
    make_recorded(order, &mut record, workspace)
}

/// Reconstructs and writes, and keeps what was made and, even of a pair that is refused, what the core showed.
pub(super) fn make_recorded(
    order: Order<'_>,
    record: &mut Record,
    workspace: &mut Workspace,
) -> Result<(Model, Reconstruction), Failure> {
    let start = Instant::now();
    let Order { images, calibration, options, pictures, truth, place } = order;
    let made = match workspace.reconstruct(images.each_ref(), calibration, options, record) {
        Ok(made) => made,
        Err(refusal) => {
            record.complete(images.each_ref(), options);
            return Err(place.refused(options, record, refusal).into());
        }
    };
    // What a live page shows is not drawn into the folder too, unless it is wanted there.
    let bare = (!pictures && place.folder.is_some()).then(|| record.figures());
    let record = bare.as_ref().unwrap_or(record);
    let run = Run { calibration, options, reconstruction: &made, record, truth };
    Ok((Model::written(place, &run, start)?, made))
}

/// Reconstructs and writes what a device of this calibration would send of the images.
pub(super) fn make_as_device(
    [left, right]: [GrayImage; 2],
    calibration: &StereoCamera,
    options: &Options,
    place: Place<'_>,
    workspace: &mut Workspace,
) -> Result<Model, Failure> {
    let start = Instant::now();
    let pictures = (options.front != Front::Balls).then(|| [left.clone(), right.clone()]);
    let described = describe(left, right, calibration, options);
    let (device, bytes) =
        described.map_err(|refusal| place.refused(options, &Record::figures_only(), refusal))?;
    let mut inbox = Inbox::new()?;
    let mut buffer = vec![0; bytes.len()];
    let mut decoder = Decoder::new(&mut buffer);
    let pair = bytes.into_iter().find_map(|byte| decoder.push(byte).map(|frame| inbox.read(&frame)));
    let Some(Message::Pair(pair)) = pair.transpose()? else {
        return Err("the frame of a pair was lost on its way through memory".into());
    };
    let mut record = Record::figures_only();
    let sent = (&mut inbox, *pair, pictures);
    let (model, made) = receive(sent, (&device, options), place, &mut record, workspace)?;
    workspace.recycle(made);
    Ok(Model { time: start.elapsed(), ..model })
}

/// Reconstructs and writes what a device has sent, and keeps it; its shape stands in the inbox, and its pictures may
/// have come beside it. The record must be one of figures only.
pub(super) fn receive(
    (inbox, pair, pictures): (&mut Inbox, Pair, Option<[GrayImage; 2]>),
    (model, options): (&PairModel, &Options),
    place: Place<'_>,
    record: &mut Record,
    workspace: &mut Workspace,
) -> Result<(Model, Reconstruction), Failure> {
    let start = Instant::now();
    let made = pair.result.map_err(Refusal::from).and_then(|outcome| {
        for (k, eye) in record.eyes.iter_mut().enumerate() {
            (eye.parts.level, eye.parts.area) = (pair.levels[k], outcome.areas[k] as usize);
        }
        let seen = pictures.map(|pictures| Seen { pictures, levels: pair.levels });
        workspace.reconstruct_shape((&mut inbox.memory(), outcome), seen, model, options, record)
    });
    let made = made.map_err(|refusal| place.refused(options, record, refusal))?;
    let calibration = &model.into();
    let run = Run { calibration, options, reconstruction: &made, record, truth: None };
    Ok((Model::written(place, &run, start)?, made))
}

impl Model {
    /// Writes all files of a run that began at `start`, if there is a folder for them.
    fn written(place: Place<'_>, run: &Run<'_>, start: Instant) -> Result<Self, Failure> {
        let begun = Instant::now();
        let report = match place.folder {
            Some(folder) => Some(output::write(folder, run, place.page)?),
            None => place.report.then(|| numbers::json(run)),
        };
        let report =
            report.filter(|_| place.report).map(|report| serde_json::from_slice(&report)).transpose()?;
        let mesh = &run.reconstruction.mesh;
        let bounds = mesh.bounds();
        Ok(Self {
            size: bounds.map_or_else(Vector3::zeros, |[low, high]| high - low),
            distance: bounds.map_or(0.0, |[low, high]| nalgebra::center(&low, &high).coords.norm()),
            vertices: mesh.vertices.len(),
            faces: mesh.faces.len(),
            warnings: warnings(run.reconstruction),
            report: report.unwrap_or_default(),
            stages: times::stages(run),
            writing: begun.elapsed(),
            time: start.elapsed(),
        })
    }

    /// Adds what people want to know to a table.
    pub(super) fn tell(&self, table: &mut Table) {
        table.row("size", &sides(self.size));
        table.row("distance", &format!("{:.0} mm from the left camera", self.distance));
        table.row("model", &format!("{} vertices, {} faces", self.vertices, self.faces));
    }
}

/// Everything that the user should know about a reconstruction, in words.
pub(super) fn warnings(made: &Reconstruction) -> Vec<String> {
    let mut warnings: Vec<String> = made.outcome.findings.iter().map(words::sentence).collect();
    warnings.extend(made.unmeasured.map(|why| words::unmeasured(why).to_owned()));
    let (bodies, share) = made.dropped;
    if bodies > 0 {
        let pieces = count(bodies, "loose piece", "loose pieces");
        warnings.push(format!("{pieces} with {} of the volume left out", percent(share)));
    }
    warnings
}
