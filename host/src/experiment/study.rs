//! One shape, made in every way and held against the truth.

use image::GrayImage;
use serde::Serialize;
use serde::ser::{SerializeMap, Serializer};
use std::path::Path;

use super::Effort;
use crate::baseline::{Outline, inflation, visual_hull};
use crate::calibration::StereoCamera;
use crate::evaluate::{Evaluation, Options as Fineness, Section, evaluate};
use crate::export::ExportError;
use crate::mesh::Mesh;
use crate::output;
use crate::reconstruct::{Front, Mode, Options, Skeleton, reconstruct};
use crate::render::{Noise, render};
use crate::report::Run;
use crate::report::record::Record;
use crate::shape::Shape;
use crate::stage::rectify::Rectification;
use crate::view::Calibrated;

/// Diagonal of a model, in those of the truth, up to which there is a point in measuring it.
const MOST_TIMES: f64 = 20.0;

/// A way from a pair to a solid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// As the paper says.
    Paper,
    /// The default: all medial balls.
    Full,
    /// The default with the balls of the fitted curves alone.
    Nurbs,
    /// Two-view visual hull.
    Hull,
    /// One silhouette inflated.
    Inflation,
}

impl Way {
    /// Every way, in the order of the tables.
    pub const ALL: [Self; 5] = [Self::Full, Self::Nurbs, Self::Paper, Self::Hull, Self::Inflation];

    /// Its name at the head of a column.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper mode",
            Self::Full => "default",
            Self::Nurbs => "default, curves",
            Self::Hull => "visual hull",
            Self::Inflation => "inflation",
        }
    }

    /// Its name in the JSON.
    const fn key(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Full => "full",
            Self::Nurbs => "nurbs",
            Self::Hull => "visual_hull",
            Self::Inflation => "inflation",
        }
    }
}

/// A shape before the cameras.
pub(super) struct Subject {
    /// Name of its folder.
    pub(super) name: String,
    pub(super) shape: Shape,
    pub(super) images: [GrayImage; 2],
    pub(super) calibration: StereoCamera,
    /// Its surface, left camera's axes, mm.
    pub(super) truth: Mesh,
}

impl Subject {
    /// A shape as it is.
    pub(super) fn new(shape: Shape, effort: &Effort) -> Self {
        let calibration = StereoCamera::rectified(640, 480, 750.0, 60.0);
        let truth = shape.mesh(shape.cell() * effort.truth);
        let mut images = render(&truth, &Calibrated::pair(&calibration)).into_iter();
        let images = [images.next(), images.next()].map(Option::unwrap_or_default);
        Self { name: shape.name().to_owned(), shape, images, calibration, truth }
    }

    /// A shape in the noise of the paper's Figure 9.
    pub(super) fn noisy(shape: Shape, effort: &Effort) -> Self {
        let mut subject = Self::new(shape, effort);
        for (image, seed) in subject.images.iter_mut().zip(1..) {
            Noise { sigma: 20.0, salt_and_pepper: 0.02, seed }.apply(image);
        }
        Self { name: format!("{}_noise", subject.name), ..subject }
    }

    /// A model by one of the project's own modes, in cells of `cell` mm.
    pub(super) fn model(
        &self,
        options: &Options,
        record: &mut Record,
    ) -> Result<crate::reconstruct::Reconstruction, String> {
        let [left, right] = self.images.clone();
        reconstruct(left, right, &self.calibration, options, record).map_err(|refusal| refusal.to_string())
    }

    /// How far a model is from the truth.
    pub(super) fn measure(&self, model: &Mesh, effort: &Effort) -> Evaluation {
        let fineness = Fineness { samples: effort.samples, ..Fineness::default() };
        evaluate(model, &self.truth, &Calibrated::pair(&self.calibration), &fineness)
    }
}

/// What came of a shape.
#[derive(Debug, Serialize)]
pub struct Study {
    /// Name of its folder.
    pub name: String,
    /// What became of each way, or why nothing did.
    #[serde(serialize_with = "by_key")]
    pub ways: Vec<(Way, Result<Found, String>)>,
}

/// A model and its measures.
#[derive(Debug)]
pub struct Found {
    /// The model, left camera's axes, mm.
    pub mesh: Mesh,
    /// How far it is from the truth.
    pub evaluation: Evaluation,
}

impl Study {
    /// What became of a way.
    #[must_use]
    pub fn found(&self, way: Way) -> Option<&Found> {
        self.ways.iter().find(|(w, _)| *w == way).and_then(|(_, found)| found.as_ref().ok())
    }

    /// Symmetric mean error of a way, mm and % of the truth's diagonal.
    #[must_use]
    pub fn error(&self, way: Way) -> Option<[f64; 2]> {
        let distance = self.found(way)?.evaluation.distance.as_ref()?;
        Some([distance.symmetric.mean_mm, distance.symmetric.mean_pct])
    }
}

/// Mean smallest distance of a section, both ways alike, mm.
pub(super) fn section_mm(section: &Section) -> Option<f64> {
    Some((section.model_to_truth_mm? + section.truth_to_model_mm?) / 2.0)
}

/// Makes a shape in every way; the default's files go into `folder`.
pub(super) fn study(subject: &Subject, effort: &Effort, folder: &Path) -> Result<Study, ExportError> {
    let mut record = Record::new();
    let options = Options { cell: effort.cell, front: effort.front, ..Options::default() };
    let full = subject.model(&options, &mut record);
    if let Ok(made) = &full {
        let run = Run {
            calibration: &subject.calibration,
            options: &options,
            reconstruction: made,
            record: &record,
            truth: Some(&subject.truth),
        };
        output::write(folder, &run, false)?;
    }
    let own = |options: Options| subject.model(&options, &mut Record::figures_only()).map(|made| made.mesh);
    let mesh = |way: Way| match way {
        Way::Full => full.as_ref().map(|made| made.mesh.clone()).map_err(Clone::clone),
        Way::Nurbs => own(Options { skeleton: Skeleton::Nurbs, ..options }),
        Way::Paper => own(Options { mode: Mode::Paper { omega: 3 }, front: Front::Balls, ..options }),
        Way::Hull => {
            baseline(subject, &record, |outlines, camera| visual_hull(outlines, camera, effort.baseline_cell))
        }
        Way::Inflation => {
            baseline(subject, &record, |outlines, camera| inflation(outlines, camera, effort.baseline_cell))
        }
    };
    let found = |way: Way| {
        let mesh = mesh(way)?;
        sane(&mesh, &subject.truth)?;
        Ok(Found { evaluation: subject.measure(&mesh, effort), mesh })
    };
    Ok(Study { name: subject.name.clone(), ways: Way::ALL.map(|way| (way, found(way))).into() })
}

/// Whether a model can be compared at all: balls that fly apart make a solid of kilometres.
fn sane(model: &Mesh, truth: &Mesh) -> Result<(), String> {
    let diagonal = |mesh: &Mesh| mesh.bounds().map_or(0.0, |[low, high]| (high - low).norm());
    let times = diagonal(model) / diagonal(truth);
    if times > MOST_TIMES {
        return Err(format!("its balls fly apart: the solid is {times:.0} times as large as the object"));
    }
    Ok(())
}

/// A baseline's mesh from the outlines that were recorded, in the left camera's axes.
fn baseline(
    subject: &Subject,
    record: &Record,
    make: impl Fn([&Outline; 2], &crate::stage::rectify::RectifiedCamera) -> Mesh,
) -> Result<Mesh, String> {
    let camera = Rectification::whole(&subject.calibration).map_err(|error| error.to_string())?.camera();
    let [Some(left), Some(right)] = [0, 1].map(|eye| Outline::of(&record.eyes[eye].parts)) else {
        return Err("one of the views has no outline".to_owned());
    };
    let mut mesh = make([&left, &right], &camera);
    if mesh.faces.is_empty() {
        return Err("no depth explains both silhouettes".to_owned());
    }
    for vertex in &mut mesh.vertices {
        *vertex = camera.to_left_camera(*vertex);
    }
    Ok(mesh)
}

fn by_key<S: Serializer>(ways: &[(Way, Result<Found, String>)], serializer: S) -> Result<S::Ok, S::Error> {
    let mut map = serializer.serialize_map(Some(ways.len()))?;
    for (way, found) in ways {
        match found {
            Ok(found) => map.serialize_entry(way.key(), &found.evaluation)?,
            Err(reason) => map.serialize_entry(way.key(), &serde_json::json!({ "refused": reason }))?,
        }
    }
    map.end()
}

/// A value a way under the ways' names in the JSON.
pub(super) fn values_by_key<S: Serializer>(
    values: &[(Way, Option<f64>)],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_map(values.iter().map(|(way, value)| (way.key(), value)))
}
