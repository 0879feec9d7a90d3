//! What the commands that reconstruct have in common: the choices of the method, and the cameras.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use clap::builder::ValueHint;
use clap::error::ErrorKind;
use image::GrayImage;
use shared::stage::binarise::{Polarity, Threshold};
use shared::stage::thinning::Rule;

use super::{Failure, line, words_of};
use crate::calibration::StereoCamera;
use crate::reconstruct::{self, Front, Options, Pieces, Profile, Radius, Skeleton};
use crate::report::words::{parse_polarity, parse_rule, parse_threshold};
use crate::source::scene::{self, BackgroundError, Known, Region, Scene};
use crate::source::{Layout, Pair};

/// Shortest and longest focal length that is believed, image widths: 136 and 3 degrees of view.
const FOCALS: [f64; 2] = [0.2, 20.0];

/// How the solid is found.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Method")]
pub struct MethodArgs {
    /// The method: what works, or what the paper says to the letter
    #[arg(
        long,
        value_enum,
        default_value = "default",
        hide_possible_values = true,
        value_name = "default|paper"
    )]
    mode: Mode,
    /// Consecutive quadruplets of hull vertices compared, with --mode paper [default: 3]
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=3), value_name = "1|2|3")]
    omega: Option<u8>,
    /// Grey level between object and background
    #[arg(long, value_parser = parse_threshold, default_value = "otsu", value_name = "otsu|N")]
    threshold: Threshold,
    /// Whether the object is brighter or darker than the background
    #[arg(long, value_parser = parse_polarity, default_value = "bright", value_name = "bright|dark|auto")]
    polarity: Polarity,
    /// How the outline is thinned [default: edt, or hit-or-miss with --mode paper]
    #[arg(long, value_parser = parse_rule, value_name = "edt|hit-or-miss|zhang-suen|guo-hall")]
    thinning: Option<Rule>,
    /// All that the pictures have, or what a small device makes of them [default: full]
    #[arg(long, value_enum, hide_possible_values = true, value_name = "full|device")]
    profile: Option<Profile>,
    /// Prune the skeleton to so many branches, instead of by what stands out
    #[arg(long, value_name = "N")]
    branches: Option<u16>,
    #[command(flatten)]
    grow: GrowArgs,
}

/// How the solid is grown.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Method")]
pub struct GrowArgs {
    /// Balls at every contour point, or along the curves of the skeleton [default: full, of a device nurbs]
    #[arg(long, value_enum, hide_possible_values = true, value_name = "full|nurbs")]
    skeleton: Option<Skeleton>,
    /// How far a ball reaches: to the nearest viewing ray of the outline, to the nearest point of the boundary
    /// in space, or as the distance transform of its view says [default: rays]
    #[arg(long, value_enum, hide_possible_values = true, value_name = "rays|boundary|transform")]
    radius: Option<Radius>,
    /// Round cones between neighbouring balls, or the balls alone [default: cones]
    #[arg(long, value_enum, hide_possible_values = true, value_name = "cones|balls")]
    surface: Option<Pieces>,
    /// The visible side: from balls, from the grey levels of both images, or from these where they are to be
    /// trusted [default: balls]
    #[arg(long, value_enum, hide_possible_values = true, value_name = "balls|grey|auto")]
    front: Option<Front>,
    /// Grid spacing of the model's mesh, mm; its edges are about 0.6 of it [default: two to three pixels at the object]
    #[arg(long, value_parser = positive, value_name = "MM")]
    resolution: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Mode {
    Default,
    Paper,
}

impl MethodArgs {
    /// Whether it was said how the object is told from the background.
    pub fn tells_object(&self) -> bool {
        self.threshold != Threshold::Otsu || self.polarity != Polarity::BrightObject
    }

    /// The choices for a device's shape, in the terms of [`crate::reconstruct`].
    ///
    /// # Errors
    ///
    /// A [`clap::Error`] if one of them is none that a device has.
    pub fn device_options(&self) -> Result<Options, Failure> {
        let chosen = self.options()?;
        if self.mode == Mode::Paper || self.thinning.is_some() || self.branches.is_some() {
            return Err(usage(
                "--mode paper, --thinning and --branches are nothing that a device can be told",
            ));
        }
        let device = self.grow.device_options();
        Ok(Options {
            profile: self.profile.unwrap_or(device.profile),
            threshold: chosen.threshold,
            polarity: chosen.polarity,
            ..device
        })
    }

    /// The choices in the terms of [`crate::reconstruct`].
    ///
    /// # Errors
    ///
    /// A [`clap::Error`] if they contradict each other.
    pub fn options(&self) -> Result<Options, Failure> {
        let mode = match (self.mode, self.omega) {
            (Mode::Default, None) => reconstruct::Mode::Default,
            (Mode::Paper, omega) => reconstruct::Mode::Paper { omega: usize::from(omega.unwrap_or(3)) },
            (Mode::Default, Some(_)) => return Err(usage("--omega belongs to --mode paper")),
        };
        let grow = &self.grow;
        let chosen = grow.skeleton.is_some() || grow.radius.is_some() || grow.surface.is_some();
        if chosen && self.mode == Mode::Paper {
            return Err(usage(
                "--skeleton, --radius and --surface belong to --mode default; the paper has its own",
            ));
        }
        let front = grow.front.unwrap_or_default();
        if front != Front::Balls && self.mode == Mode::Paper {
            return Err(usage("--front grey and auto belong to --mode default; the paper has balls alone"));
        }
        Ok(Options {
            mode,
            thinning: self.thinning,
            profile: self.profile.unwrap_or_default(),
            skeleton: grow.skeleton.unwrap_or_default(),
            branches: self.branches,
            radius: grow.radius.unwrap_or_default(),
            pieces: grow.surface.unwrap_or_default(),
            front,
            threshold: self.threshold,
            polarity: self.polarity,
            cell: grow.resolution,
            draft: false,
            scene: Known::default(),
        })
    }
}

impl GrowArgs {
    /// The choices for what a device sends, in the terms of [`crate::reconstruct`].
    #[must_use]
    pub fn device_options(&self) -> Options {
        let device = Options::device();
        Options {
            skeleton: self.skeleton.unwrap_or(device.skeleton),
            radius: self.radius.unwrap_or_default(),
            pieces: self.surface.unwrap_or_default(),
            front: self.front.unwrap_or_default(),
            cell: self.resolution,
            ..device
        }
    }
}

/// What the pixels mean.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Cameras")]
pub struct CameraArgs {
    /// Calibration of the pair: OpenCV (M1 D1 M2 D2 R T), ROS or Kalibr
    #[arg(long, value_name = "FILE", conflicts_with_all = ["focal", "baseline"])]
    calib: Option<PathBuf>,
    /// Focal length of a rectified pair without calibration, px
    #[arg(long, value_name = "PX", value_parser = positive, requires = "baseline")]
    focal: Option<f64>,
    /// Distance between its cameras, mm
    #[arg(long, value_name = "MM", value_parser = positive, requires = "focal")]
    baseline: Option<f64>,
}

/// There is nothing to tell millimetres by.
#[derive(Debug, thiserror::Error)]
#[error(
    "there is no calibration, and without one the model has no scale; give --calib FILE, put calib.yaml beside the \
     images, or give --focal PX and --baseline MM of a rectified pair"
)]
pub struct NoCalibration;

impl CameraArgs {
    /// Whether anything was given.
    pub const fn are_given(&self) -> bool {
        self.calib.is_some() || self.focal.is_some() || self.baseline.is_some()
    }

    /// The calibration for a pair with these images, and the file beside the images that it comes from, if it
    /// does.
    ///
    /// # Errors
    ///
    /// [`NoCalibration`], or what is wrong with the one there is.
    pub fn of(&self, pair: &Pair, left: &GrayImage) -> Result<(StereoCamera, Option<PathBuf>), Failure> {
        if let Some(camera) = self.rectified(left.dimensions())? {
            return Ok((camera, None));
        }
        if let Some(path) = &self.calib {
            return Ok((StereoCamera::read(path)?, None));
        }
        let beside = pair.calibration.clone().ok_or(NoCalibration)?;
        Ok((StereoCamera::read(&beside)?, Some(beside)))
    }

    /// The calibration in the file that was named, if any was.
    ///
    /// # Errors
    ///
    /// [`NoCalibration`] if there is no other either, or what is wrong with it.
    pub fn file(&self) -> Result<Option<(StereoCamera, &Path)>, Failure> {
        match (&self.calib, self.focal) {
            (Some(path), _) => Ok(Some((StereoCamera::read(path)?, path))),
            (None, Some(_)) => Ok(None),
            (None, None) => Err(NoCalibration.into()),
        }
    }

    /// The cameras of a rectified pair of this size, px, if their numbers were given.
    ///
    /// # Errors
    ///
    /// If they cannot be.
    pub fn rectified(&self, (width, height): (u32, u32)) -> Result<Option<StereoCamera>, Failure> {
        let (Some(focal), Some(baseline)) = (self.focal, self.baseline) else { return Ok(None) };
        check_focal(focal, width)?;
        let camera = StereoCamera::rectified(width, height, focal, baseline);
        camera.check()?;
        Ok(Some(camera))
    }
}

/// What is known of the scene.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Scene")]
pub struct SceneArgs {
    /// The scene without the object, to be taken away: one image with both views, LEFT,RIGHT, a folder with
    /// one pair, or `first` for the first pair; then the object is bright, whatever it was
    #[arg(long, value_name = "FILE|first", value_hint = ValueHint::AnyPath)]
    background: Option<String>,
    /// The part of both views to look at, px
    #[arg(long, value_name = "X,Y,W,H")]
    roi: Option<Region>,
}

/// The word for the first pair.
const FIRST: &str = "first";

impl SceneArgs {
    /// Whether anything is known.
    pub const fn is_known(&self) -> bool {
        self.background.is_some() || self.roi.is_some()
    }

    /// Whether a background is taken away.
    pub const fn takes_background(&self) -> bool {
        self.background.is_some()
    }

    /// Whether the first pair is the background.
    pub fn takes_first(&self) -> bool {
        self.background.as_deref() == Some(FIRST)
    }

    /// What is known, and noted in the choices. A background that is the first pair comes later.
    ///
    /// # Errors
    ///
    /// A [`clap::Error`] if it contradicts the choices, or if the background cannot be read.
    pub fn scene(&self, layout: Option<Layout>, swap: bool, options: &mut Options) -> Result<Scene, Failure> {
        if self.background.is_some() && options.polarity != Polarity::BrightObject {
            return Err(usage("with --background the object is what is bright: leave --polarity out"));
        }
        if self.background.is_some() && options.front != Front::Balls {
            return Err(usage(
                "--front grey and auto compare grey levels, and a background taken away changes them; leave one of \
                 them out",
            ));
        }
        let named = self.background.as_ref().filter(|_| !self.takes_first());
        let views = named.map(|named| scene::background(named, layout)).transpose();
        let mut views =
            views.map_err(|error: BackgroundError| format!("no background: {}", words_of(&error)))?;
        if let Some(views) = &mut views
            && swap
        {
            views.images.reverse();
        }
        let scene = Scene { background: views.map(|views| views.images), region: self.roi };
        options.scene = Known { background: self.background.is_some(), region: self.roi };
        Ok(scene)
    }
}

/// Wrong usage that the parser cannot see.
pub(super) fn usage(what: &str) -> Failure {
    line::command().error(ErrorKind::ArgumentConflict, what).into()
}

/// Whether a lens of this focal length, px, can be in front of an image of this width, px.
pub(super) fn check_focal(focal: f64, width: u32) -> Result<(), String> {
    let [low, high] = FOCALS.map(|share| share * f64::from(width));
    if (low..=high).contains(&focal) {
        return Ok(());
    }
    Err(format!(
        "--focal must be {low:.0} to {high:.0} px, which is {} to {} image widths",
        FOCALS[0], FOCALS[1]
    ))
}

/// A number from 0 to `most`.
pub(super) fn share_of(most: f64) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| match text.parse::<f64>() {
        Ok(number) if (0.0..=most).contains(&number) => Ok(number),
        _ => Err(format!("must be 0 to {most}")),
    }
}

/// A positive number.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() && number > 0.0 => Ok(number),
        _ => Err("must be a positive number".into()),
    }
}
