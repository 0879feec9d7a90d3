//! From one stereo pair to one solid: the only file of the host that chains stages.
//!
//! ```text
//! images + calibration -> rectified pair -> core (shared::pipeline) -> its memory
//!                   a device's shape off the wire -> resumed there -> its memory
//! its memory -> balls, refined, smoothed, radii from viewing rays (grow) -> round cones -> surface
//!     -> left camera's axes
//! ```

mod device;
mod grow;
mod options;
mod paper;

pub use device::{describe, optics};
pub(crate) use options::settings;
pub use options::{Mode, Options, Pieces, Profile, Radius, Skeleton};

use crate::calibration::StereoCamera;
use crate::curves::Curves;
use crate::memory::Storage;
use crate::mesh::Mesh;
use crate::mesh::body::keep_largest_body;
use crate::stage::rectify::{PixelBox, Rectification, RectifiedCamera, RectifyError};
use crate::stage::surface::{RoundCone, SurfaceError, surface};
use grow::Described;
use image::GrayImage;
use nalgebra::{Point2, Point3, Vector3};
use options::core_settings;
use shared::bitmap::{Grey, Size};
use shared::camera::PairModel;
use shared::fixed::PX;
use shared::pipeline::{self, Finding, Kernels, Memory, Observer, Outcome, Settings, Side, scratch_words};
use shared::stage::depth::Optics;
use std::time::{Duration, Instant};

/// Cells along the diagonal of a mesh at most, unless the user says otherwise.
const MAX_CELLS: f64 = 300.0;

/// What became of a pair.
#[derive(Clone, Debug)]
pub struct Reconstruction {
    /// The solid's surface, left camera's axes, mm.
    pub mesh: Mesh,
    /// Its curve skeleton with radii.
    pub skeleton: Curves,
    /// Its boundary as seen from the left.
    pub boundary: Curves,
    /// What the core says.
    pub outcome: Outcome,
    /// The rectified cameras.
    pub camera: RectifiedCamera,
    /// Whether the images had to be resampled.
    pub resampled: bool,
    /// Grid spacing of the mesh, mm.
    pub cell: f64,
    /// Round cones in the union.
    pub cones: usize,
    /// Loose bodies left out, and their part of the volume.
    pub dropped: (usize, f64),
    /// Time of each host stage.
    pub times: Vec<(&'static str, Duration)>,
}

/// Why there is no model.
#[derive(Debug, thiserror::Error)]
pub enum Refusal {
    /// The pair cannot be rectified with this calibration.
    #[error(transparent)]
    Rectify(#[from] RectifyError),
    /// The pair is of another size than the calibration.
    #[error(transparent)]
    Calibration(#[from] crate::calibration::CalibrationError),
    /// The core refuses the pair.
    #[error("{}", crate::report::words::sentence(.0))]
    Gate(Finding),
    /// The balls give no surface.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
    /// Nothing could be triangulated in front of the cameras.
    #[error(
        "no point of the object lies in front of both cameras; check the calibration and that left and right are not swapped"
    )]
    Behind,
}

impl From<Finding> for Refusal {
    fn from(finding: Finding) -> Self {
        Self::Gate(finding)
    }
}

/// Reconstruct the object of a pair; `observer` sees what the core's stages make.
///
/// # Errors
/// A [`Refusal`] that says what is wrong and what to do.
pub fn reconstruct(
    left: GrayImage,
    right: GrayImage,
    calibration: &StereoCamera,
    options: &Options,
    observer: &mut impl Observer,
) -> Result<Reconstruction, Refusal> {
    let mut clock = Clock::start();
    calibration.left.check_size(left.width(), left.height())?;
    calibration.right.check_size(right.width(), right.height())?;
    let rectification = rectification(&left, &right, calibration, options)?;
    let camera = rectification.camera();
    let images = rectification.images(left, right)?;
    clock.lap("rectify");

    let (width, height) = images[0].dimensions();
    let mut storage = Storage::new(width as usize, height as usize).map_err(Finding::from)?;
    let mut memory = storage.lend();
    let [left, right] = [&images[0], &images[1]].map(grey);
    let outcome = pipeline::run(&mut memory, left?, right?, &settings(&camera, options), observer)?;
    clock.lap("core");

    let resampled = !rectification.is_identity();
    finish(camera, resampled, &memory, outcome, options, clock)
}

/// Reconstruct the object of a shape that a device has sent: it stands in `memory`, and `outcome` with it, as
/// [`ShapeLists::of`](shared::wire::ShapeLists::of) has read it there. `observer` sees what was sent and what
/// follows from it.
///
/// # Errors
/// As [`reconstruct`].
pub fn reconstruct_shape(
    memory: &mut Memory<'_>,
    outcome: Outcome,
    model: &PairModel,
    options: &Options,
    observer: &mut impl Observer,
) -> Result<Reconstruction, Refusal> {
    let mut clock = Clock::start();
    model.check().map_err(RectifyError::from)?;
    pipeline::resume(memory, &outcome, optics(model), observer).map_err(Finding::from)?;
    clock.lap("core");
    finish(model.into(), model.eyes.is_some(), memory, outcome, options, clock)
}

/// From what the core leaves in its memory to the solid.
fn finish(
    camera: RectifiedCamera,
    resampled: bool,
    memory: &Memory<'_>,
    outcome: Outcome,
    options: &Options,
    mut clock: Clock,
) -> Result<Reconstruction, Refusal> {
    let grown = match options.mode {
        Mode::Default => grow::grow(&camera, &Described::of(memory, &outcome), options, &mut clock),
        Mode::Paper { .. } => paper::grow(&camera, memory),
    };
    clock.lap("grow");
    if grown.cones.is_empty() {
        let erased = |f: &Finding| matches!(f, Finding::SkeletonErased(_));
        return Err(outcome.findings.iter().find(|f| erased(f)).map_or(Refusal::Behind, |f| (*f).into()));
    }
    let cell = options.cell.unwrap_or_else(|| default_cell(&camera, &grown.cones));
    let body = keep_largest_body(surface(&grown.cones, cell)?);
    clock.lap("surface");
    let turned = |curves: Curves| Curves {
        points: curves.points.iter().map(|p| camera.to_left_camera(*p)).collect(),
        ..curves
    };
    Ok(Reconstruction {
        mesh: Mesh {
            vertices: body.mesh.vertices.iter().map(|p| camera.to_left_camera(*p)).collect(),
            faces: body.mesh.faces,
        },
        skeleton: turned(grown.skeleton),
        boundary: turned(grown.boundary),
        outcome,
        camera,
        resampled,
        cell,
        cones: grown.cones.len(),
        dropped: (body.dropped, body.dropped_volume),
        times: clock.laps,
    })
}

/// Times of consecutive stages.
struct Clock {
    last: Instant,
    laps: Vec<(&'static str, Duration)>,
}

impl Clock {
    fn start() -> Self {
        Self { last: Instant::now(), laps: Vec::new() }
    }

    fn lap(&mut self, stage: &'static str) {
        let now = Instant::now();
        self.laps.push((stage, now - self.last));
        self.last = now;
    }
}

fn grey(image: &GrayImage) -> Result<Grey<'_>, Finding> {
    let (width, height) = (image.width() as usize, image.height() as usize);
    Ok(Grey::new(Size::new(width, height)?, width, image.as_raw())?)
}

/// How to rectify: around the object, whose box in both raw images must be known for that.
fn rectification(
    left: &GrayImage,
    right: &GrayImage,
    calibration: &StereoCamera,
    options: &Options,
) -> Result<Rectification, Refusal> {
    let whole = |image: &GrayImage| PixelBox {
        min: Point2::origin(),
        max: Point2::new(f64::from(image.width()) - 1.0, f64::from(image.height()) - 1.0),
    };
    let plain = Rectification::around(calibration, [whole(left), whole(right)]);
    if plain.as_ref().is_ok_and(Rectification::is_identity) {
        return Ok(plain?);
    }
    // What a camera is set to does not matter where the object lies.
    let settings = core_settings(Optics { focal: PX, disparity_offset: 0 }, options);
    let boxes = [object_box(left, Side::Left, &settings)?, object_box(right, Side::Right, &settings)?];
    Ok(Rectification::around(calibration, boxes)?)
}

/// The box of the object in a raw image.
fn object_box(image: &GrayImage, side: Side, settings: &Settings) -> Result<PixelBox, Finding> {
    let grey = grey(image)?;
    let size = grey.size();
    let (mut mask, mut scratch) = (vec![0; size.words()], vec![0; scratch_words(size, 0, 0, 0)]);
    let found = pipeline::object_box(side, grey, (&mut mask, &mut scratch), (settings, &Kernels::PORTABLE))?;
    let corner = |p: shared::point::Pixel| Point2::new(f64::from(p.u), f64::from(p.v));
    Ok(PixelBox { min: corner(found.min), max: corner(found.max) })
}

/// The mesh's grid spacing by default, mm: two pixels at the nearest ball, but no more than
/// [`MAX_CELLS`] along the diagonal, which only a model that is wrong would have.
fn default_cell(camera: &RectifiedCamera, cones: &[RoundCone]) -> f64 {
    let balls = || cones.iter().flat_map(|c| c.centres.into_iter().zip(c.radii));
    let depth = balls().map(|(c, _)| c.z).fold(f64::INFINITY, f64::min);
    let low =
        balls().fold(Point3::from([f64::INFINITY; 3]), |low, (c, r)| low.inf(&(c - Vector3::repeat(r))));
    let high =
        balls().fold(Point3::from([-f64::INFINITY; 3]), |high, (c, r)| high.sup(&(c + Vector3::repeat(r))));
    (2.0 * depth / camera.f).max((high - low).norm() / MAX_CELLS)
}

/// The solid in rectified axes.
struct Grown {
    cones: Vec<RoundCone>,
    skeleton: Curves,
    boundary: Curves,
}
