//! Models from recorded stereo pairs.
//!
//! INPUT is two files, LEFT RIGHT; or one image that holds both views; or a folder or pattern with many
//! pairs, named left_0001 and right_0001, im0 and im1 (Middlebury), cam0/data and cam1/data (EuRoC), or
//! lying in a folder each as left.png and right.png; case makes no difference. Images may be PNG, JPEG,
//! PGM, BMP or TIFF; colours become grey, and what is transparent black.
//!
//! The pair's calibration is --calib, or else calib.yaml beside the images (or in a folder above them, up
//! to the one named). Without any, give --focal and --baseline if the pair is rectified.
//!
//! An object on a desk is found by --background, the same scene without it, and --roi, where it is.
//!
//! Two files, or one, leave their results in --out; folders and patterns leave those of each pair in a
//! folder of its own below. There: model.ply (closed, mm, axes of the left camera), skeleton.ply,
//! boundary.ply, report.json and pictures of every stage. What does not give a trustworthy model is
//! refused with the reason, and leaves no files, nor those of an earlier run, but with --report a page that shows
//! why; the other pairs go on.
//!
//! Pairs are made side by side, one a core; --timings tells where their time goes. Undisturbed times are those of
//! --jobs 1.
//!
//! --view shows each pair on a page in the browser as it is made, in their order, at --rate pairs a second; what is
//! set there holds from the next pair on, and for the last one until Ctrl-C. docs/live.md tells more.
//!
//! --as-device makes of pictures what a camera device would make of them and send (`host listen`).
//!
//! INPUT may also be a recording of a camera device (`host listen --record`), which gives the models that it
//! gave live; it holds its calibration.
//!
//! Examples:
//!   host replay left.png right.png --calib calib.yaml
//!   host replay left.png right.png --focal 750 --baseline 60
//!   host replay both.png --layout side-by-side --calib calib.yaml --out cup
//!   host replay recordings/ --out models --no-pictures --json > models.json
//!   host replay 'recordings/*/left.png' --polarity dark
//!   host replay recording/ --background first --roi 100,40,400,400
//!   host replay recording/ --view --rate 5

mod follow;

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::builder::ArgPredicate;
use image::GrayImage;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use super::listen::Wanted;
use super::model::{self, Model, Order, Place};
use super::options::{CameraArgs, MethodArgs, SceneArgs, usage};
use super::table::Table;
use super::timings::Timings;
use super::view::{self, Beside, ViewArgs};
use super::{Failure, crew, listen, note, say, say_json, shown, told, words_of};
use crate::live::View;
use crate::reconstruct::{Options, Workspace};
use crate::source::find::{Found, find};
use crate::source::picture::PictureError;
use crate::source::scene::Scene;
use crate::source::serial::recording::is_recording;
use crate::source::{Files, Layout, Pair, Views};

/// Arguments of `replay`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// LEFT RIGHT, or one image with both views, or folders or patterns of pairs
    #[arg(required = true)]
    pub(super) input: Vec<String>,
    /// How views lie in files [default: as the number of files says]
    #[arg(long, value_enum)]
    pub(super) layout: Option<Layout>,
    /// Exchange left and right
    #[arg(long)]
    swap: bool,
    /// Go the way of a camera device: its rectification, its steps, what its link carries; --skeleton is nurbs
    /// and --profile device then, unless given
    #[arg(long, conflicts_with = "view")]
    as_device: bool,
    #[command(flatten)]
    pub(super) cameras: CameraArgs,
    #[command(flatten)]
    pub(super) scene: SceneArgs,
    #[command(flatten)]
    method: MethodArgs,
    /// Threads, at most four a core [default: one a core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..), conflicts_with = "view")]
    jobs: Option<u16>,
    #[command(flatten)]
    view: ViewArgs,
    /// Pairs shown a second, at most [default: as fast as they are made]
    #[arg(long, value_name = "N", value_parser = view::rate, requires = "view")]
    rate: Option<f64>,
    /// Folder for the results
    #[arg(
        long,
        value_name = "DIR",
        default_value_if("view", ArgPredicate::IsPresent, None),
        default_value = "ossature-out"
    )]
    out: Option<PathBuf>,
    /// Draw no pictures of the stages
    #[arg(long)]
    no_pictures: bool,
    /// Tell on standard error how long each stage took
    #[arg(long)]
    timings: bool,
    /// Leave report.html as well, a page that shows all of it in a browser
    #[arg(long)]
    report: bool,
    /// Print one JSON document instead of text
    #[arg(long)]
    json: bool,
}

/// What became of a pair.
pub(super) struct Done<'a> {
    pair: &'a Pair,
    /// None if it was only looked at.
    folder: Option<PathBuf>,
    pub(super) result: Result<Success, Failure>,
}

/// What is told of a pair's model.
pub(super) struct Success {
    model: Model,
    /// For its images.
    loading: Duration,
    warnings: Vec<String>,
    /// The calibration, if it was found beside the images.
    calibration: Option<PathBuf>,
}

/// Reconstructs every pair.
///
/// # Errors
///
/// If there is no pair, or any is refused.
pub fn run(args: &Args) -> Result<(), Failure> {
    if let [input] = args.input.as_slice()
        && is_recording(Path::new(input))
    {
        let options = Options { draft: args.out.is_none(), ..recording_options(args)? };
        let wanted = Wanted { page: args.report, json: args.json, timings: args.timings };
        let place = (args.out.as_deref(), wanted);
        let replayed = args.view.open(input, view::settings(&options), follow::limits_of_recording);
        let replayed = replayed.map_err(Failure::from).and_then(|view| {
            listen::replay(Path::new(input), &options, place, view.map(|view| (view, args.rate)))
        });
        return told(args.json, replayed);
    }
    let (options, mut scene) = told(args.json, how(args))?;
    let mut found = told(args.json, pairs(args))?;
    if args.scene.takes_first() {
        scene.background = Some(told(args.json, first(args, &mut found))?);
    }
    let mut timings = Timings::begin();
    let title = args.input.join(" ");
    let limits = || follow::limits(&args.scene);
    let view =
        told(args.json, args.view.open(&title, view::settings(&options), limits).map_err(Failure::from))?;
    let done = match view {
        Some(view) => follow::all(args, (options, scene), &found, view),
        None => all(args, (&options, &scene), &found),
    };
    let done = told(args.json, done)?;
    if args.timings {
        let made = done.iter().filter_map(|done| done.result.as_ref().ok());
        made.for_each(|success| timings.add(Some(success.loading), &success.model));
        timings.tell();
    }
    if args.json {
        say_json(&as_json(&done, &found))?;
    } else {
        say(&as_text(&done, &found))?;
    }
    summary(done, &found)
}

/// The choices for a recording.
fn recording_options(args: &Args) -> Result<Options, Failure> {
    let of_pictures = args.layout.is_some() || args.swap || args.as_device;
    if of_pictures || args.cameras.are_given() || args.scene.is_known() || args.method.tells_object() {
        return Err(usage(
            "a recording holds its calibration and what the device found in its pictures: leave out --layout, --swap, \
             --as-device, --calib, --focal, --baseline, --background, --roi, --threshold and --polarity",
        ));
    }
    args.method.device_options()
}

/// How each pair is made. A background that is the first pair comes later.
///
/// # Errors
///
/// If what was chosen contradicts itself, or the background cannot be read.
pub(super) fn how(args: &Args) -> Result<(Options, Scene), Failure> {
    let options = if args.as_device { args.method.device_options() } else { args.method.options() }?;
    let mut options = Options { draft: args.out.is_none(), ..options };
    let one_file = args.layout.filter(|layout| *layout != Layout::Two);
    let scene = args.scene.scene(one_file, args.swap, &mut options)?;
    Ok((options, scene))
}

/// The pairs that are named.
pub(super) fn pairs(args: &Args) -> Result<Found, Failure> {
    let found = find(&args.input, args.layout)?;
    if found.single && !args.swap && found.pairs.iter().any(|pair| pair.files.are_named_in_reverse()) {
        return Err("left and right are swapped: the first file is named right and the second left; give them in the \
                    other order, and with --swap if their names are wrong"
            .into());
    }
    Ok(found)
}

/// The views of the first pair, which is taken from the others.
fn first(args: &Args, found: &mut Found) -> Result<[GrayImage; 2], Failure> {
    if found.pairs.len() < 2 {
        return Err(
            "--background first needs a pair of the empty scene and pairs after it, in a folder or pattern"
                .into(),
        );
    }
    let mut images = found.pairs.remove(0).load()?.images;
    if args.swap {
        images.reverse();
    }
    Ok(images)
}

/// Every pair, in parallel; results in the order of the pairs.
fn all<'a>(args: &Args, how: (&Options, &Scene), found: &'a Found) -> Result<Vec<Done<'a>>, Failure> {
    let pairs = &found.pairs;
    let bar = if pairs.len() > 1 && std::io::stderr().is_terminal() {
        ProgressBar::new(pairs.len() as u64)
    } else {
        ProgressBar::hidden()
    };
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos}/{len} pairs, {eta} left") {
        bar.set_style(style);
    }
    let job = |workspace: &mut Workspace, index: usize| {
        let pair = &pairs[index];
        let done = one(args, how, (found.single, pair), workspace, None);
        bar.inc(1);
        done
    };
    let done = crew::run(pairs.len(), args.jobs.map(usize::from), &job)?;
    bar.finish_and_clear();
    Ok(done)
}

/// One pair, the only one or among others, shown if there is a page for it.
pub(super) fn one<'a>(
    args: &Args,
    how: (&Options, &Scene),
    (single, pair): (bool, &'a Pair),
    workspace: &mut Workspace,
    view: Option<&mut View>,
) -> Done<'a> {
    let in_out = |out: &PathBuf| if single { out.clone() } else { out.join(&pair.name) };
    let folder = args.out.as_ref().map(in_out);
    let result = attempt(args, how, (pair, folder.as_deref()), workspace, view);
    let result = result.map_err(|failure| with_guess(pair, failure));
    Done { pair, folder, result }
}

fn attempt(
    args: &Args,
    (options, scene): (&Options, &Scene),
    (pair, folder): (&Pair, Option<&Path>),
    workspace: &mut Workspace,
    view: Option<&mut View>,
) -> Result<Success, Failure> {
    let (start, place) = (Instant::now(), Place { folder, report: args.json, page: args.report });
    let mut views = pair.load().map_err(|error| place.cleared(error))?;
    if args.swap {
        views.images.reverse();
    }
    let Views { images, warnings } = views;
    let make = || {
        let (calibration, file) = args.cameras.of(pair, &images[0]).map_err(|error| place.cleared(error))?;
        let pictures = view.is_some().then(|| images.clone());
        let applied = scene.apply(images, &calibration);
        let (images, calibration) = applied.map_err(|error| place.cleared(error))?;
        let loading = start.elapsed();
        if args.as_device {
            let model = model::make_as_device(images, &calibration, options, place, workspace)?;
            return Ok((loading, model, file));
        }
        let drawn = !args.no_pictures;
        let order = Order { images, calibration: &calibration, options, pictures: drawn, truth: None, place };
        let model = match view {
            None => model::make(order, workspace)?,
            Some(view) => {
                let (name, remarks) = (pair.name.clone(), warnings.clone());
                let beside = Beside { name, pictures, remarks, dropped: 0, arrived: start };
                view::make(order, beside, view, workspace)?
            }
        };
        Ok((loading, model, file))
    };
    let (loading, model, calibration) = make().map_err(|failure| with_warnings(&warnings, failure))?;
    let warnings = warnings.into_iter().chain(model.warnings.iter().cloned()).collect();
    Ok(Success { model, loading, warnings, calibration })
}

/// A failure, told with more than its own words.
#[derive(Debug, thiserror::Error)]
#[error("{words}")]
struct Explained {
    words: String,
    failure: Failure,
}

impl Explained {
    fn by(more: &str, failure: Failure) -> Failure {
        Self { words: format!("{}; {more}", words_of(&*failure)), failure }.into()
    }
}

/// A failure itself, whatever was said about it.
pub(super) fn plain(failure: &Failure) -> &Failure {
    failure.downcast_ref::<Explained>().map_or(failure, |explained| plain(&explained.failure))
}

/// A failure, with what was suspicious about the files.
fn with_warnings(warnings: &[String], failure: Failure) -> Failure {
    if warnings.is_empty() { failure } else { Explained::by(&warnings.join("; "), failure) }
}

/// A failure, with a hint if the user may have forgotten the other image.
fn with_guess(pair: &Pair, failure: Failure) -> Failure {
    match pair.files {
        Files::One(_, None) if !plain(&failure).is::<PictureError>() => Explained::by(
            "one image was given and taken for both views: give two, or --layout if it was halved the wrong way",
            failure,
        ),
        _ => failure,
    }
}

fn as_text(done: &[Done<'_>], found: &Found) -> String {
    let mut text = String::new();
    for Done { pair, folder, result } in done {
        let Ok(success) = result else { continue };
        let mut table = Table::new(&pair.name);
        success.model.tell(&mut table);
        if let Some(path) = &success.calibration {
            table.row("calibration", &format!("{}, found beside the images", path.display()));
        }
        for warning in &success.warnings {
            table.warning(warning);
        }
        table.row("time", &format!("{:.2} s", success.model.time.as_secs_f64()));
        if let Some(folder) = folder {
            table.row("files", &shown(folder));
        }
        text.push_str(table.text());
    }
    if !found.single {
        let good = done.iter().filter(|done| done.result.is_ok()).count();
        text.push_str(&format!("{good} of {} pairs have a model", done.len()));
        if !found.alone.is_empty() {
            text.push_str(&format!("; {} images have no partner", found.alone.len()));
        }
        text.push('\n');
    }
    text
}

fn as_json(done: &[Done<'_>], found: &Found) -> serde_json::Value {
    let pair = |Done { pair, folder, result }: &Done<'_>| match result {
        Ok(Success { model, warnings, calibration, .. }) => json!({
            "name": pair.name,
            "folder": folder.as_deref().map(shown),
            "calibration_found": calibration.as_deref().map(shown),
            "warnings": warnings,
            "report": model.report,
        }),
        Err(failure) => json!({ "name": pair.name, "error": words_of(&**failure) }),
    };
    let alone: Vec<String> = found.alone.iter().map(|path| shown(path)).collect();
    json!({ "pairs": done.iter().map(pair).collect::<Vec<_>>(), "without_partner": alone })
}

/// Says which pairs were refused. The only pair's refusal is the command's.
fn summary(done: Vec<Done<'_>>, found: &Found) -> Result<(), Failure> {
    let count = done.len();
    let refused = done.into_iter().filter_map(|done| Some((done.pair, done.result.err()?)));
    let mut refused: Vec<_> = refused.collect();
    if found.single {
        return refused.pop().map_or(Ok(()), |(_, failure)| Err(failure));
    }
    for (pair, failure) in &refused {
        note(&format!("error: {}: {}", pair.name, words_of(&**failure)));
    }
    match refused.len() {
        0 => Ok(()),
        refused => Err(format!("{refused} of {count} pairs were refused").into()),
    }
}
