//! From one stereo pair to one solid: the only folder of the host that chains stages.
//!
//! ```text
//! images + calibration -> rectified pair -> core (shared::pipeline) -> its memory
//!                   a device's shape off the wire -> resumed there -> its memory
//! its memory -> balls, refined, smoothed, radii from viewing rays (grow) -> round cones -> surface
//!     -> the visible side where both eyes see it (front, on request) -> left camera's axes
//! ```

mod device;
mod grow;
mod options;
mod paper;
mod workspace;

pub use device::describe;
pub(crate) use options::settings;
pub use options::{Front, Mode, Options, Pieces, Profile, Radius, Skeleton};
pub use workspace::{Seen, Workspace};

use crate::calibration::StereoCamera;
use crate::curves::Curves;
use crate::mesh::Mesh;
use crate::stage::front::Measured;
use crate::stage::rectify::{RectifiedCamera, RectifyError};
use crate::stage::surface::SurfaceError;
use grow::Growth;
use image::GrayImage;
use options::core_settings;
use shared::bitmap::{Grey, Size};
use shared::camera::PairModel;
use shared::pipeline::{Finding, Memory, Observer, Outcome};
use std::time::{Duration, Instant};

/// What became of a pair.
#[derive(Clone, Debug)]
pub struct Reconstruction {
    /// The solid's surface, left camera's axes, mm.
    pub mesh: Mesh,
    /// What was measured of its visible side, if that was asked for.
    pub front: Option<Measured>,
    /// Why it was not measured, if that was asked for.
    pub unmeasured: Option<Unmeasured>,
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

/// Why the visible side of what a device has sent is from balls, though it was to be measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unmeasured {
    /// Its pictures did not come with it, or not whole.
    NoPictures,
    /// Pictures came, but by their size or the object's area they are not those of the shape.
    OtherPictures,
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
    #[error("{} (docs/gates/{}.md)", crate::report::words::sentence(.0), crate::report::words::name(.0))]
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

/// Reconstruct the object of a pair; `observer` sees what the core's stages make. For many pairs, a [`Workspace`]
/// does the same in the memory of the last one.
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
    let views = [left, right];
    Workspace::default().reconstruct(views.each_ref(), calibration, options, observer)
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
    Workspace::default().reconstruct_shape((memory, outcome), None, model, options, observer)
}

/// Times of consecutive stages.
#[derive(Debug)]
struct Clock {
    last: Instant,
    laps: Vec<(&'static str, Duration)>,
}

impl Default for Clock {
    fn default() -> Self {
        Self { last: Instant::now(), laps: Vec::new() }
    }
}

impl Clock {
    fn start(&mut self) {
        self.laps.clear();
        self.last = Instant::now();
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
