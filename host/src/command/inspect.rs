//! Run one stage of one view, draw what it makes, and time it.
//!
//! The image is thresholded; a mask of 0 and 255 stays as it is. Stages boundary, distance, thinning and
//! hull then work on that mask as it is, and their time runs from the bytes of the mask (0 or 255) to those
//! of the result, packing and unpacking included and the threshold not, with memory set aside before: so
//! they can be set beside another program. That of binarise runs from grey to mask bytes. All other stages run within the pipeline, after its median
//! filter and its cleaning, and their time is their own part of it.
//!
//! Stages:
//!   binarise   the threshold
//!   clean      the largest component, without pinholes
//!   boundary   the mask less its erosion by a 3x3 square
//!   distance   to the background
//!   thinning   by --rule, exactly as published
//!   graph      the skeleton's branches, pruned
//!   contour    sub-pixel loops
//!   hull       convex hull of the mask's pixels
//!   medial     the discs that touch the contour twice
//!   nurbs      the branches' curves
//!
//! Examples:
//!   host inspect --stage thinning --rule guo-hall --repeat 100 --json mask.png
//!   host inspect --stage graph --out graph.png left.png
//!   host inspect --stage distance --raw distance.png mask.png

mod alone;
mod within;

use super::{Failure, note, say, say_json};
use crate::output::write_together;
use crate::report::layers::Seen;
use crate::report::pictures::sheet;
use crate::report::record::{Parts, Rasters};
use crate::report::words::{parse_polarity, parse_rule, parse_threshold};
use crate::source::picture::{self, Loaded};
use crate::stage::balls::px;
use clap::ValueEnum;
use clap::error::ErrorKind;
use image::{DynamicImage, GrayImage, ImageFormat, RgbImage};
use serde_json::{Map, Value, json};
use shared::stage::binarise::{Polarity, Threshold};
use shared::stage::distance::DISTANCE_PX;
use shared::stage::medial::MedialBall;
use shared::stage::thinning::Rule;
use std::io::Cursor;
use std::path::PathBuf;
use std::time::Duration;

/// What to inspect.
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// Image of one view, or its mask (0 and 255)
    image: PathBuf,
    /// The stage to run
    #[arg(long, value_enum)]
    stage: Stage,
    /// How the mask is thinned
    #[arg(long, value_parser = parse_rule, default_value = "edt", value_name = "edt|hit-or-miss|zhang-suen|guo-hall")]
    rule: Rule,
    /// Grey level between object and background
    #[arg(long, value_parser = parse_threshold, default_value = "otsu", value_name = "otsu|N")]
    threshold: Threshold,
    /// Whether the object is brighter or darker than the background
    #[arg(long, value_parser = parse_polarity, default_value = "bright", value_name = "bright|dark|auto")]
    polarity: Polarity,
    /// Run it so many times and report the median time
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=100_000), default_value = "1", value_name = "N")]
    repeat: u32,
    /// Print a JSON object with `median_us` instead of lines
    #[arg(long)]
    pub(super) json: bool,
    /// Draw the result, enlarged, as PNG
    #[arg(long, value_name = "PICTURE")]
    out: Option<PathBuf>,
    /// Write the raster itself as PNG: masks as 0 and 255 in 8 bits, distances in 1/16 px, rounded down, in 16 bits
    #[arg(long, value_name = "FILE")]
    raw: Option<PathBuf>,
}

/// The stages of one view.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Stage {
    Binarise,
    Clean,
    Boundary,
    Distance,
    Thinning,
    #[value(alias = "prune")]
    Graph,
    Contour,
    Hull,
    Medial,
    Nurbs,
}

/// What a stage made, and how long it took each time.
#[derive(Debug, Default)]
struct Made {
    parts: Parts,
    rasters: Rasters,
    /// Medial balls.
    balls: Vec<MedialBall>,
    times: Vec<Duration>,
}

impl Made {
    /// The median time, µs.
    fn median_us(&self) -> f64 {
        let mut times = self.times.clone();
        times.sort_unstable();
        times.get(times.len() / 2).map_or(0.0, |time| time.as_nanos() as f64 / 1e3)
    }
}

/// Runs the stage, writes the files that were asked for, and prints its figures.
///
/// # Errors
///
/// A [`clap::Error`] for `--raw` of a stage without raster; otherwise a sentence for the user.
pub fn run(args: &Args) -> Result<(), Failure> {
    let no_raster = matches!(args.stage, Stage::Contour | Stage::Hull | Stage::Medial | Stage::Nurbs);
    if args.raw.is_some() && no_raster {
        let what = "--raw: this stage makes no raster; --json has its figures\n";
        return Err(clap::Error::raw(ErrorKind::ArgumentConflict, what).into());
    }
    let Loaded { image, warnings } = picture::load_view(&args.image)?;
    for warning in warnings {
        note(&format!("warning: {warning}"));
    }
    let made = make(args, &image)?;
    let mut files = Vec::new();
    if let Some(path) = &args.out {
        let picture = draw(args.stage, &made).ok_or("there is nothing to draw: the mask is empty")?;
        files.push((path.as_path(), png(&picture.into())?));
    }
    if let Some(path) = &args.raw {
        files.push((path, png(&raster(args.stage, &made))?));
    }
    write_together(&files)?;
    let figures = figures(args, &image, &made);
    if args.json {
        return say_json(&Value::Object(figures));
    }
    let lines = figures.iter().map(|(name, value)| format!("{name:<24} {}\n", plain(value)));
    say(&lines.collect::<String>())
}

fn make(args: &Args, image: &GrayImage) -> Result<Made, Failure> {
    match args.stage {
        Stage::Clean | Stage::Graph | Stage::Contour | Stage::Medial | Stage::Nurbs => {
            within::make(args, image)
        }
        _ => Ok(alone::make(args, image)?),
    }
}

fn draw(stage: Stage, made: &Made) -> Option<RgbImage> {
    let views = [Seen { name: "", parts: &made.parts, rasters: Some(&made.rasters) }];
    match stage {
        Stage::Binarise | Stage::Clean | Stage::Boundary => sheet::mask(&views),
        Stage::Distance => sheet::distance(&views),
        Stage::Thinning => sheet::thinned(&views),
        Stage::Graph => sheet::skeleton(&views),
        Stage::Contour => sheet::contour(&views),
        Stage::Hull => sheet::hull(&views),
        Stage::Medial => sheet::medial(&views, &made.balls),
        Stage::Nurbs => sheet::curves(&views),
    }
}

/// The stage's raster as it is.
fn raster(stage: Stage, made: &Made) -> DynamicImage {
    let rasters = &made.rasters;
    match stage {
        Stage::Distance => rasters.distance.clone().into(),
        Stage::Boundary => rasters.boundary.clone().into(),
        Stage::Thinning => rasters.skeleton.clone().into(),
        Stage::Graph => rasters.pruned.clone().into(),
        _ => rasters.mask.clone().into(),
    }
}

fn png(picture: &DynamicImage) -> Result<Vec<u8>, Failure> {
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, ImageFormat::Png)?;
    Ok(bytes.into_inner())
}

/// All that is printed.
fn figures(args: &Args, image: &GrayImage, made: &Made) -> Map<String, Value> {
    let parts = &made.parts;
    let mut figures = Map::new();
    let mut say = |name: &str, value: Value| figures.insert(name.into(), value);
    let stage = args.stage.to_possible_value().map_or_else(String::new, |v| v.get_name().to_owned());
    say("stage", stage.into());
    say("median_us", made.median_us().into());
    say("repeats", args.repeat.into());
    say("width_px", image.width().into());
    say("height_px", image.height().into());
    say("threshold_grey", parts.level.into());
    say("area_px2", parts.area.into());
    match args.stage {
        Stage::Binarise => {}
        Stage::Clean => {
            say("components", parts.components.count.into());
            say("second_component_px2", parts.components.second.into());
        }
        Stage::Boundary => {
            say("boundary_px", parts.boundary.into());
        }
        Stage::Distance => {
            say("widest_px", (f64::from(parts.widest) / f64::from(DISTANCE_PX)).into());
        }
        Stage::Thinning => {
            say("rule", crate::report::words::rule_name(args.rule).into());
            say("skeleton_px", (parts.area as u64 - u64::from(parts.thinning.deleted)).into());
            say("cycles", parts.thinning.cycles.into());
        }
        Stage::Graph => {
            say("nodes", parts.nodes.len().into());
            say("edges_before_pruning", parts.pruning.edges_before.into());
            say("edges", parts.pruning.edges_after.into());
        }
        Stage::Contour => {
            say("loops", parts.loops.len().into());
            say("points", parts.contour.len().into());
        }
        Stage::Hull => {
            let vertices: Vec<Value> = parts.hull.iter().map(|p| json!([px(p.u), px(p.v)])).collect();
            say("vertices", vertices.len().into());
            say("vertices_px", vertices.into());
        }
        Stage::Medial => {
            say("balls", made.balls.len().into());
        }
        Stage::Nurbs => {
            say("curves", parts.branches.len().into());
            say("control_points", parts.controls.len().into());
        }
    }
    figures
}

fn plain(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

#[cfg(test)]
mod tests;
