//! Models from a stereo camera that Linux knows.
//!
//! Plug it in, see with `host list-devices` what it is called, and give it with its calibration. Each pair
//! becomes a model in a folder of its own, 000001, 000002 and so on below --out, as `host replay` would make
//! it. The newest pair is always next: what the camera sends while a model is made is dropped and counted.
//! Ctrl-C ends after the model at hand; a second one ends at once.
//!
//! Both eyes may lie side by side, on top of each other or byte by byte in one camera's frames, or be two
//! cameras, left one first, whose frames are paired by time. Layout, pixel format, size and rate are taken
//! from the calibration and from what the camera offers, unless you say otherwise. The first pairs are thrown
//! away while the exposure settles (--skip).
//!
//! --best makes one model, of the pair of a burst with the fewest warnings and then the smallest part of the
//! outline without counterpart. --record keeps every pair that was worked on; `host replay` makes the same
//! models of it, byte for byte, unless something was set on a live page in between; with --only-record it
//! makes none, and needs no calibration. --background first takes the first pair for the scene without the
//! object. --wait goes on with a camera that was unplugged when it is back, whatever its node is then.
//!
//! --view shows each pair on a page in the browser as it is made, where threshold, polarity, region and exposure can be
//! set for the next one; models are then written only if --out is given. docs/live.md tells more.
//!
//! --publish tells a fleet of each pair and its model, and takes orders from it (docs/fleet.md).
//!
//! Succeeds if any pair gave a model (with --only-record: was recorded) and the camera did not fail.
//! docs/capture.md tells more.
//!
//! Examples:
//!   host capture --device /dev/video0 --calib calib.yaml
//!   host capture --device /dev/video0 --focal 700 --baseline 60 --frames 20 --best --out cup
//!   host capture --device /dev/video0 --device /dev/video2 --format MJPG --fps 15 --calib calib.yaml
//!   host capture --device /dev/video0 --calib calib.yaml --view
//!   host capture --device /dev/video0 --calib calib.yaml --background first --record session --seconds 30
//!   host capture --device /dev/video0 --record board --only-record --fps 5

mod session;
mod telling;

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::ValueEnum;
use clap::builder::ArgPredicate;

use super::options::{CameraArgs, MethodArgs, NoCalibration, SceneArgs, positive, usage};
use super::publish::PublishArgs;
use super::view::ViewArgs;
use super::{Failure, interruption, note, told};
use crate::reconstruct::Options;
use crate::source::v4l::choose::{Choice, Request, Size, choose};
use crate::source::v4l::device::Device;
use crate::source::v4l::errors::CameraError;
use crate::source::v4l::format::FourCc;
use crate::source::v4l::kernel::Kernel;
use crate::source::v4l::layout::Layout;
use crate::source::v4l::live::Optics;
use crate::source::v4l::pair::Pairs;
use crate::source::v4l::watch::Wait;
use session::{Rig, Session};

/// Longest side of a frame that is asked for, px.
const MAX_FRAME: u32 = 2 * shared::limits::MAX_SIDE as u32;

/// Arguments of `capture`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The camera; twice for two cameras, the left one first
    #[arg(long, value_name = "PATH", required = true)]
    device: Vec<PathBuf>,
    /// Where the eyes are in a frame
    #[arg(
        long,
        value_enum,
        default_value = "auto",
        hide_possible_values = true,
        value_name = "auto|side-by-side|top-bottom|interleaved|two"
    )]
    layout: Eyes,
    /// Exchange left and right
    #[arg(long)]
    swap: bool,
    /// Pixel format, such as MJPG or YUYV [default: the best for the size]
    #[arg(long, value_name = "FOURCC")]
    format: Option<FourCc>,
    /// Size of a frame, px, with both eyes if it holds both [default: the calibration's, or the largest]
    #[arg(long, value_name = "WxH", value_parser = frame_size)]
    size: Option<Size>,
    /// Frames a second [default: the camera's]
    #[arg(long, value_name = "N", value_parser = positive)]
    fps: Option<f64>,
    #[command(flatten)]
    cameras: CameraArgs,
    #[command(flatten)]
    scene: SceneArgs,
    #[command(flatten)]
    method: MethodArgs,
    /// End after so many pairs [default: at Ctrl-C]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    frames: Option<u64>,
    /// End after so many seconds
    #[arg(long, value_name = "N", value_parser = positive, conflicts_with = "frames")]
    seconds: Option<f64>,
    /// Pairs thrown away at the start
    #[arg(long, value_name = "N", default_value_t = 5)]
    skip: u64,
    /// Wait so many seconds for a camera that was unplugged, wherever it is plugged in again [default: end at once]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    wait: Option<u32>,
    /// Make one model, of the best pair
    #[arg(long, conflicts_with_all = ["view", "publish"])]
    best: bool,
    /// Folder that keeps the pairs, new or empty
    #[arg(long, value_name = "DIR")]
    record: Option<PathBuf>,
    /// Make no models
    #[arg(long, requires = "record", conflicts_with_all = ["best", "background", "roi", "view", "publish"])]
    only_record: bool,
    #[command(flatten)]
    view: ViewArgs,
    /// Folder for the results
    #[arg(
        long,
        value_name = "DIR",
        default_value_ifs([("view", ArgPredicate::IsPresent, None), ("publish", ArgPredicate::IsPresent, None)]),
        default_value = "ossature-capture"
    )]
    out: Option<PathBuf>,
    /// Draw no pictures of the stages
    #[arg(long)]
    no_pictures: bool,
    /// Tell on standard error how long each stage took
    #[arg(long, conflicts_with = "only_record")]
    timings: bool,
    /// Leave report.html as well, a page that shows all of it in a browser
    #[arg(long, conflicts_with = "only_record")]
    report: bool,
    /// Print one JSON document at the end instead of text
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    publish: PublishArgs,
}

impl Args {
    /// The cameras, as a heading.
    fn title(&self) -> String {
        self.device.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(" ")
    }
}

/// Layouts as they are asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Eyes {
    Auto,
    SideBySide,
    TopBottom,
    Interleaved,
    Two,
}

impl Eyes {
    /// The layout, if it is given; two cameras have one alone.
    fn layout(self, cameras: usize) -> Result<Option<Layout>, Failure> {
        match (self, cameras) {
            (Self::Auto, 1) => Ok(None),
            (Self::SideBySide, 1) => Ok(Some(Layout::SideBySide)),
            (Self::TopBottom, 1) => Ok(Some(Layout::TopBottom)),
            (Self::Interleaved, 1) => Ok(Some(Layout::Interleaved)),
            (Self::Auto | Self::Two, 2) => Ok(Some(Layout::Two)),
            (Self::Two, _) => {
                Err(usage("--layout two needs two cameras: give --device twice, the left one first"))
            }
            (_, 2) => Err(usage("the frames of two cameras lie in no layout: leave --layout out")),
            _ => Err(usage("a pair has two eyes: give one --device or two")),
        }
    }
}

/// Reads cameras until enough is done.
///
/// # Errors
///
/// A [`clap::Error`] for wrong usage; if a camera fails, results cannot be written, or no pair gave a model.
pub fn run(args: &Args) -> Result<(), Failure> {
    let layout = args.layout.layout(args.device.len())?;
    if let [left, right] = args.device.as_slice()
        && left == right
    {
        return Err(usage("both devices are the same camera: give two, or one that sees with both eyes"));
    }
    if args.publish.boards().len() > 1 {
        return Err(usage("one camera is one board: give --publish once"));
    }
    let draft = args.out.is_none() && !args.publish.is_wanted();
    let mut options = Options { draft, ..args.method.options()? };
    let prepared = told(args.json, {
        let scene = args.scene.scene(None, args.swap, &mut options);
        scene.and_then(|scene| Ok((scene, open(args, layout)?, interruption()?)))
    });
    let (scene, mut rig, stop) = prepared?;
    let session = told(args.json, Session::begin(args, &options, scene, &mut rig))?;
    session.run(rig, &stop)
}

/// Opens the cameras and sets them as the calibration and the user say.
fn open(args: &Args, layout: Option<Layout>) -> Result<Rig<Kernel>, Failure> {
    let file = match args.cameras.file() {
        Err(failure) if args.only_record && failure.is::<NoCalibration>() => None,
        file => file?,
    };
    let camera = |eye: usize, path: &Path| {
        let view = file.map(|(pair, _)| if eye == 0 { pair.left } else { pair.right });
        let request = Request {
            code: args.format,
            size: args.size,
            rate: args.fps,
            layout,
            view: view.map(|camera| (camera.width, camera.height)),
        };
        let mut kernel = Kernel::open(path)?;
        let choice = choose(kernel.camera(), &request)?;
        kernel.set(&choice)?;
        if args.wait.is_some() {
            kernel.tell_apart();
        }
        note(&told_choice(path, &choice, &kernel));
        Ok::<_, CameraError>((kernel, choice))
    };
    let (first, choice) = camera(0, &args.device[0])?;
    let second = args.device.get(1).map(|path| camera(1, path)).transpose()?;
    let view = choice.layout.view(choice.size);
    if let (Some((_, right)), None) = (&second, &file)
        && right.size != view
    {
        return Err(CameraError::Sizes { left: view, right: right.size }.into());
    }
    let calibration = match file {
        Some((camera, _)) => Some(camera),
        None => args.cameras.rectified(view)?,
    };
    let second = second.map(|(kernel, _)| kernel);
    let file = file.map(|(_, path)| path.to_path_buf());
    let (layout, swap) = (choice.layout, args.swap);
    let cameras = || [Some(&first), second.as_ref()].into_iter().flatten();
    let formats = cameras().map(Kernel::format).collect();
    let dials = if args.view.is_wanted() || args.publish.is_wanted() {
        cameras().filter_map(Kernel::dial).collect()
    } else {
        Vec::new()
    };
    let optics = Optics { formats, layout, swap };
    let most = Duration::from_secs(args.wait.unwrap_or(0).into());
    let pairs = Pairs::of(first, second).waiting(Wait { most, tell: note });
    Ok(Rig { pairs, optics, calibration, file, dials })
}

/// What a camera was set to.
fn told_choice(path: &Path, choice: &Choice, kernel: &Kernel) -> String {
    let (width, height) = choice.size;
    let rate = kernel.period().map(|period| format!(" at {:.0}/s", 1.0 / period.as_secs_f64()));
    let rate = rate.unwrap_or_default();
    format!("{}: {} {width}x{height}{rate}, {}", path.display(), choice.code, choice.layout.name())
}

fn frame_size(text: &str) -> Result<Size, String> {
    let side = |text: &str| text.parse().ok().filter(|side| (16..=MAX_FRAME).contains(side));
    let sides = text.split_once('x').and_then(|(width, height)| Some((side(width)?, side(height)?)));
    sides.ok_or_else(|| format!("must be WIDTHxHEIGHT, each 16 to {MAX_FRAME}"))
}
