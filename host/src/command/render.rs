//! A stereo pair of any mesh: try what the method makes of an object before building anything.
//!
//! WHAT is a built-in shape (sphere, torus, torus_tilt, capsule, screwdriver, block, teapot, mouse, animal) or a
//! mesh file: PLY, OBJ or STL. A file's unit is taken for a millimetre (see --scale). A mesh is moved to
//! the middle of what both cameras see; a built-in shape stands there already. The cameras are an ideal
//! pair, or those of --calib, with its lenses and its turn.
//!
//! Leaves left.png, right.png, calib.yaml, and truth.ply: the mesh as it was seen, in mm and in the axes
//! of the left camera, for `host evaluate`.
//!
//! Examples:
//!   host render bunny.obj --scale 1000 --out pair
//!   host replay pair --out model
//!   host evaluate model/pair/model.ply pair/truth.ply
//!   host render torus --noise 10 --salt-and-pepper 0.02 --out noisy
//!   host render teapot --texture clouds --gloss 0.5 --gamma 2.2 --gain 1,1.1 --out hard

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use nalgebra::Point3;
use serde_json::json;

use super::looks::Looks;
use super::options::{check_focal, positive, usage};
use super::scene::{Scene, write};
use super::table::{Table, sides};
use super::{Failure, note, say, say_json, shown};
use crate::calibration::StereoCamera;
use crate::mesh::Mesh;
use crate::mesh::read::read;
use crate::shape::{Shape, UnknownShape};
use crate::view::{Calibrated, View};

/// Least height of an object in the image that is worth trying, px.
const MIN_HEIGHT: f64 = 40.0;

/// Arguments of `render`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A built-in shape, or a mesh file
    #[arg(value_name = "SHAPE|MESH")]
    what: String,
    /// Calibration of the cameras that look; otherwise an ideal pair
    #[arg(long, value_name = "FILE", conflicts_with_all = ["size", "focal", "baseline"])]
    calib: Option<PathBuf>,
    /// Size of the images, px
    #[arg(long, value_name = "WxH", value_parser = size, default_value = "640x480")]
    size: [u32; 2],
    /// Focal length, px
    #[arg(long, value_name = "PX", value_parser = positive, default_value_t = 750.0)]
    focal: f64,
    /// Distance between the cameras, mm
    #[arg(long, value_name = "MM", value_parser = positive, default_value_t = 60.0)]
    baseline: f64,
    /// Millimetres in a unit of the mesh file
    #[arg(long, value_name = "FACTOR", value_parser = positive, default_value_t = 1.0)]
    scale: f64,
    /// Where the object stands [default: auto for a file, as-is for a shape]
    #[arg(long, value_enum)]
    place: Option<Place>,
    /// Distance to the middle of the object, mm, with --place auto
    #[arg(long, value_name = "MM", value_parser = positive, default_value_t = 450.0)]
    distance: f64,
    #[command(flatten)]
    looks: Looks,
    /// Folder for the files
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Print one JSON document instead of text
    #[arg(long)]
    pub(super) json: bool,
}

/// Where the object stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Place {
    /// In the middle of what both cameras see.
    Auto,
    /// Where its coordinates say: mm, axes of the left camera.
    AsIs,
}

/// Renders and writes.
///
/// # Errors
///
/// If a file cannot be read or written, or neither camera would see the object.
pub fn run(args: &Args) -> Result<(), Failure> {
    let calibration = match &args.calib {
        Some(path) => StereoCamera::read(path)?,
        None => {
            check_focal(args.focal, args.size[0]).map_err(|what| usage(&what))?;
            StereoCamera::rectified(args.size[0], args.size[1], args.focal, args.baseline)
        }
    };
    calibration.check()?;
    let views = Calibrated::pair(&calibration);
    let (mut mesh, place) = mesh(&args.what, args.scale)?;
    if args.place.unwrap_or(place) == Place::Auto {
        put_at(&mut mesh, &middle(&views, args.distance));
    }
    let warnings = views.iter().zip(["left", "right"]).map(|(view, eye)| seen(&mesh, view, eye));
    let warnings = warnings.collect::<Result<Vec<_>, _>>()?;
    let mut scene = Scene::with_looks(mesh, calibration, &args.looks);
    check_shown(&scene)?;
    let warnings: Vec<String> = warnings.into_iter().flatten().collect();
    for warning in &warnings {
        note(&format!("warning: {warning}"));
    }
    args.looks.disturb(&mut scene.images);
    write(&args.out, &scene)?;
    let size = scene.truth.bounds().map(|[low, high]| high - low);
    let folder = shown(&args.out);
    if args.json {
        let size = size.map(<[f64; 3]>::from);
        return say_json(
            &json!({ "name": args.what, "folder": folder, "size_mm": size, "warnings": warnings }),
        );
    }
    let mut table = Table::new(&args.what);
    if let Some(size) = size {
        table.row("size", &sides(size));
    }
    table.row("files", &folder);
    say(table.text())
}

/// The mesh that a name stands for, and where it belongs unless the user says otherwise.
fn mesh(what: &str, scale: f64) -> Result<(Mesh, Place), Failure> {
    let path = Path::new(what);
    if path.extension().is_none() && !path.is_file() {
        let shape: Shape = what.parse().map_err(|unknown: UnknownShape| usage(&unknown.to_string()))?;
        return Ok((shape.mesh(shape.cell()), Place::AsIs));
    }
    let mut mesh = read(path)?;
    for vertex in &mut mesh.vertices {
        *vertex *= scale;
    }
    if mesh.volume() < 0.0 {
        mesh.faces.iter_mut().for_each(|face| face.swap(1, 2));
    }
    Ok((mesh, Place::Auto))
}

/// The point in the middle of both images at a distance from the middle between the eyes, mm.
fn middle(views: &[Calibrated; 2], distance: f64) -> Point3<f64> {
    let axis = |view: &Calibrated| {
        let [width, height] = view.size().map(|side| (f64::from(side) - 1.0) / 2.0);
        view.ray(width, height).normalize()
    };
    let forward = axis(&views[0]) + axis(&views[1]);
    nalgebra::center(&views[0].centre(), &views[1].centre()) + forward.normalize() * distance
}

/// Moves the mesh so that the middle of its box is at a point.
fn put_at(mesh: &mut Mesh, point: &Point3<f64>) {
    if let Some([low, high]) = mesh.bounds() {
        let shift = point - nalgebra::center(&low, &high);
        mesh.vertices.iter_mut().for_each(|vertex| *vertex += shift);
    }
}

/// What the user should know about how an eye sees the mesh.
fn seen(mesh: &Mesh, view: &Calibrated, eye: &str) -> Result<Option<String>, Failure> {
    let [width, height] = view.size().map(f64::from);
    let mut low = [f64::INFINITY; 2];
    let mut high = [f64::NEG_INFINITY; 2];
    for vertex in &mesh.vertices {
        let Some((u, v)) = view.project(vertex) else {
            return Err(format!(
                "part of the mesh is behind the {eye} camera; give --place auto, a larger --distance or a smaller --scale"
            )
            .into());
        };
        low = [low[0].min(u), low[1].min(v)];
        high = [high[0].max(u), high[1].max(v)];
    }
    if high[0] < 0.0 || high[1] < 0.0 || low[0] >= width || low[1] >= height {
        return Err(format!("the {eye} camera does not see the mesh; give --place auto, or move it").into());
    }
    let fits = low[0] >= 1.0 && low[1] >= 1.0 && high[0] <= width - 2.0 && high[1] <= height - 2.0;
    let (wide, tall) = (high[0] - low[0], high[1] - low[1]);
    Ok(if !fits {
        Some(format!(
            "the mesh covers {wide:.0}x{tall:.0} px and does not fit the {eye} image; give a larger --distance or a \
             smaller --scale"
        ))
    } else if tall < MIN_HEIGHT {
        Some(format!(
            "the mesh is only {tall:.0} px high in the {eye} image; give a smaller --distance or a larger --scale"
        ))
    } else {
        None
    })
}

/// Whether both images show anything: what is small enough falls between the rays.
fn check_shown(scene: &Scene) -> Result<(), Failure> {
    for (image, eye) in scene.images.iter().zip(["left", "right"]) {
        if image.windows(2).all(|pixels| pixels[0] == pixels[1]) {
            return Err(format!(
                "nothing of the mesh is to be seen in the {eye} image; give --place auto, or another --distance or --scale"
            )
            .into());
        }
    }
    Ok(())
}

fn size(text: &str) -> Result<[u32; 2], String> {
    let side =
        |text: &str| text.parse().ok().filter(|side| (16..=shared::limits::MAX_SIDE as u32).contains(side));
    let sides = text.split_once('x').and_then(|(width, height)| Some([side(width)?, side(height)?]));
    sides.ok_or_else(|| format!("must be WIDTHxHEIGHT, each 16 to {}", shared::limits::MAX_SIDE))
}
