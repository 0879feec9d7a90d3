//! The choices of a reconstruction, and the core's settings that follow from them.

use super::RectifiedCamera;
use crate::source::scene::Known;
use clap::ValueEnum;
use serde::Serialize;
use shared::fixed::PX;
use shared::pipeline::Settings;
use shared::stage::binarise;
use shared::stage::correspond::PaperMatching;
use shared::stage::depth::Optics;
use shared::stage::prune::Pruning;
use shared::stage::thinning::Rule;

/// The two ways to match and to grow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// What works (docs/algorithm.md); gates refuse.
    #[default]
    Default,
    /// As the paper says, with omega of 1, 2 or 3; gates warn.
    Paper {
        /// Consecutive quadruplets compared.
        omega: usize,
    },
}

/// Which balls make the solid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Skeleton {
    /// One at every contour point: all medial balls.
    #[default]
    Full,
    /// Those along the curves of the pruned skeleton, its compact description.
    Nurbs,
}

/// How far a ball reaches.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Radius {
    /// To the nearest viewing ray of the left boundary.
    #[default]
    Rays,
    /// To the nearest boundary point in space: the paper's rule.
    Boundary,
    /// As far as its image in the left view says: the distance transform.
    Transform,
}

/// What the solid is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Pieces {
    /// Round cones between neighbouring balls.
    #[default]
    Cones,
    /// The balls alone.
    Balls,
}

/// Where the visible side of the solid comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Front {
    /// Balls, whose cross-sections are round.
    #[default]
    Balls,
    /// Where the grey levels of both eyes agree.
    Grey,
    /// The grey levels where they are to be trusted, balls elsewhere.
    Auto,
}

/// How much is made of the pictures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Profile {
    /// Everything: contours between pixels, depth refined by tangent planes.
    #[default]
    Full,
    /// What a small device has: contours of the mask alone, depth from the contacts alone.
    Device,
}

/// The choices of a reconstruction.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options {
    /// Matching and growing.
    pub mode: Mode,
    /// Thinning rule, if not the mode's own.
    pub thinning: Option<Rule>,
    /// How much is made of the pictures (default mode).
    pub profile: Profile,
    /// Which balls make the solid (default mode).
    pub skeleton: Skeleton,
    /// Edges that pruning leaves of the skeleton, if not as many as stand out.
    pub branches: Option<u16>,
    /// How far a ball reaches (default mode).
    pub radius: Radius,
    /// What the solid is made of (default mode).
    pub pieces: Pieces,
    /// Where the visible side comes from; of a device's shape from balls, unless its pictures came beside it.
    pub front: Front,
    /// Level between object and background.
    pub threshold: binarise::Threshold,
    /// Whether the object is bright or dark.
    pub polarity: binarise::Polarity,
    /// Grid spacing of the mesh, mm; by default two to three pixels at the object, by the thickness of its limbs.
    pub cell: Option<f64>,
    /// Whether the mesh is to be looked at alone: then by default twice as coarse, a quarter of the faces.
    pub draft: bool,
    /// What was done to the images before they came here; told in the report.
    pub scene: Known,
}

impl Options {
    /// The solid from what a device sends: its skeleton's curves, depth from the contacts alone.
    #[must_use]
    pub fn device() -> Self {
        Self { profile: Profile::Device, skeleton: Skeleton::Nurbs, ..Self::default() }
    }
}

/// The core's settings for a camera.
pub(crate) fn settings(camera: &RectifiedCamera, options: &Options) -> Settings {
    let fixed = |x: f64| (x * f64::from(PX)).round() as i32;
    let optics = Optics { focal: fixed(camera.f), disparity_offset: fixed(camera.disparity_offset()) };
    core_settings(optics, options)
}

/// The core's settings for cameras whose optics alone matter to it.
pub(super) fn core_settings(optics: Optics, options: &Options) -> Settings {
    let chosen = match options.mode {
        Mode::Default if options.profile == Profile::Device => Settings::device(optics),
        Mode::Default => Settings::new(optics),
        Mode::Paper { omega } => Settings::paper(optics, PaperMatching { omega, ..PaperMatching::default() }),
    };
    Settings {
        threshold: options.threshold,
        polarity: options.polarity,
        thinning: options.thinning.unwrap_or(chosen.thinning),
        pruning: options.branches.map_or(chosen.pruning, Pruning::Branches),
        ..chosen
    }
}
