//! What was given: the options with everything that follows from them, the images, the calibration.

use super::super::{Run, words};
use crate::calibration::{Camera, Lens};
use crate::reconstruct::{Front, Mode, Pieces, Profile, Radius, Skeleton, settings};
use crate::source::scene::Region;
use crate::stage::balls::px;
use serde::Serialize;
use shared::fixed::ONE;
use shared::pipeline::Method;
use shared::stage::binarise::Threshold;
use shared::stage::prune::Pruning;

/// Every choice of the run.
#[derive(Serialize)]
pub(super) struct Choices {
    /// `default` or `paper`.
    mode: &'static str,
    /// Consecutive quadruplets compared, in paper mode.
    omega: Option<usize>,
    /// By how much triangles of matched vertices may differ in area, in paper mode.
    triangle_threshold_share: Option<f64>,
    median_filter: bool,
    /// `otsu` or `fixed`; a device's is its own.
    threshold: Option<&'static str>,
    /// A device's is its own.
    polarity: Option<&'static str>,
    thinning: &'static str,
    /// `none`, `protrusion`, `length` or `branches`.
    pruning: &'static str,
    pruning_px: Option<f64>,
    pruning_branches: Option<u16>,
    /// How much is made of the pictures, in default mode.
    profile: Option<Profile>,
    /// Which balls make the solid, in default mode.
    skeleton: Option<Skeleton>,
    /// How far they reach, in default mode.
    radius: Option<Radius>,
    /// What the solid is made of, in default mode.
    surface: Option<Pieces>,
    /// Where its visible side comes from.
    front: Front,
    curve_spacing_px: f64,
    curve_smoothing: f64,
    curve_end_weight: i32,
    /// Grid spacing of the mesh, if it was given.
    cell_mm: Option<f64>,
    /// Whether the images are differences to an empty scene.
    background_taken_away: bool,
    /// The part of the images that was looked at, if not all.
    region_px: Option<Region>,
}

impl Choices {
    pub(super) fn of(run: &Run<'_>) -> Self {
        let chosen = settings(&run.reconstruction.camera, run.options);
        let (mode, omega) = match run.options.mode {
            Mode::Default => ("default", None),
            Mode::Paper { omega } => ("paper", Some(omega)),
        };
        let seen = run.record.eyes.iter().any(|eye| eye.parts.tone.is_some());
        let share = |x: i32| f64::from(x) / f64::from(ONE);
        let (pruning, pruning_px, pruning_branches) = match chosen.pruning {
            Pruning::None => ("none", None, None),
            Pruning::Protrusion { px: length } => ("protrusion", Some(px(length)), None),
            Pruning::Length { px: length } => ("length", Some(px(length)), None),
            Pruning::Branches(n) => ("branches", None, Some(n)),
        };
        Self {
            mode,
            omega,
            triangle_threshold_share: match chosen.method {
                Method::Default => None,
                Method::Paper(paper) => Some(share(paper.threshold)),
            },
            median_filter: chosen.median,
            threshold: seen.then_some(match chosen.threshold {
                Threshold::Otsu => "otsu",
                Threshold::Fixed(_) => "fixed",
            }),
            polarity: seen.then(|| words::polarity_name(chosen.polarity)),
            thinning: words::rule_name(chosen.thinning),
            pruning,
            pruning_px,
            pruning_branches,
            profile: omega.is_none().then_some(run.options.profile),
            skeleton: omega.is_none().then_some(run.options.skeleton),
            radius: omega.is_none().then_some(run.options.radius),
            surface: omega.is_none().then_some(run.options.pieces),
            front: run.options.front,
            curve_spacing_px: px(chosen.curves.spacing),
            curve_smoothing: share(chosen.curves.smoothing),
            curve_end_weight: chosen.curves.end_weight,
            cell_mm: run.options.cell,
            background_taken_away: run.options.scene.background,
            region_px: run.options.scene.region,
        }
    }
}

/// Sizes before and after rectification.
#[derive(Serialize)]
pub(super) struct Images {
    left_size_px: [u32; 2],
    right_size_px: [u32; 2],
    rectified_size_px: [u32; 2],
    /// Whether the images had to be resampled to be rectified.
    resampled: bool,
}

impl Images {
    pub(super) fn of(run: &Run<'_>) -> Self {
        let size = |camera: &Camera| [camera.width, camera.height];
        let rectified = &run.reconstruction.camera;
        Self {
            left_size_px: size(&run.calibration.left),
            right_size_px: size(&run.calibration.right),
            rectified_size_px: [rectified.width, rectified.height],
            resampled: run.reconstruction.resampled,
        }
    }
}

/// The cameras as given and as rectified.
#[derive(Serialize)]
pub(super) struct Calibration {
    left: Eye,
    right: Eye,
    baseline_mm: f64,
    /// Angle between the two cameras.
    turn_degrees: f64,
    rectified_focal_px: f64,
    /// Where the rectified left axis meets the image.
    rectified_axis_px: [f64; 2],
    /// Added to a disparity before depth = focal x baseline / disparity holds.
    disparity_offset_px: f64,
}

#[derive(Serialize)]
struct Eye {
    focal_px: [f64; 2],
    axis_px: [f64; 2],
    /// Whether its lens distorts.
    distorted: bool,
}

impl Eye {
    fn of(camera: &Camera) -> Self {
        Self {
            focal_px: [camera.fx, camera.fy],
            axis_px: [camera.cx, camera.cy],
            distorted: camera.lens != Lens::NONE,
        }
    }
}

impl Calibration {
    pub(super) fn of(run: &Run<'_>) -> Self {
        let (given, camera) = (run.calibration, &run.reconstruction.camera);
        let cosine = (given.rotation.trace() - 1.0) / 2.0;
        Self {
            left: Eye::of(&given.left),
            right: Eye::of(&given.right),
            baseline_mm: camera.baseline_mm,
            turn_degrees: cosine.clamp(-1.0, 1.0).acos().to_degrees(),
            rectified_focal_px: camera.f,
            rectified_axis_px: [camera.cx, camera.cy],
            disparity_offset_px: camera.disparity_offset(),
        }
    }
}
