//! From one stereo pair to one solid: the only file of the host that chains stages.
//!
//! ```text
//! images + calibration -> rectified pair -> core (shared::pipeline) -> balls -> refined, smoothed
//!     -> radii from viewing rays -> round cones -> surface -> left camera's axes
//! ```

use crate::calibration::StereoCamera;
use crate::memory::Storage;
use crate::mesh::Mesh;
use crate::mesh::body::keep_largest_body;
use crate::source::scene::Known;
use crate::stage::balls::{self, Ball, Edge, boundary_rays, distance_to_points, distance_to_rays, px2};
use crate::stage::curve::curve_balls;
use crate::stage::rectify::{PixelBox, Rectification, RectifiedCamera, RectifyError};
use crate::stage::refine::refine;
use crate::stage::smooth::smooth;
use crate::stage::solid::{Chain, SolidBall, outermost, solid, spheres};
use crate::stage::surface::{RoundCone, SurfaceError, surface};
use crate::stage::triangulate::triangulate;
use clap::ValueEnum;
use image::GrayImage;
use nalgebra::{Point2, Point3, Vector3};
use serde::Serialize;
use shared::bitmap::{Grey, Size};
use shared::fixed::PX;
use shared::pipeline::{self, Finding, Memory, Observer, Outcome, Settings, Side, scratch_words};
use shared::stage::binarise;
use shared::stage::contour::ContourLoop;
use shared::stage::correspond::PaperMatching;
use shared::stage::depth::Optics;
use shared::stage::nearest::Pair;
use shared::stage::prune::Pruning;
use shared::stage::thinning::Rule;
use std::time::{Duration, Instant};

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
    /// Level between object and background.
    pub threshold: binarise::Threshold,
    /// Whether the object is bright or dark.
    pub polarity: binarise::Polarity,
    /// Grid spacing of the mesh, mm; by default that of a pixel at the object.
    pub cell: Option<f64>,
    /// What was done to the images before they came here; told in the report.
    pub scene: Known,
}

/// Cells along the diagonal of a mesh at most, unless the user says otherwise.
const MAX_CELLS: f64 = 300.0;

/// A curve or a set of points in space.
#[derive(Clone, Debug, Default)]
pub struct Curves {
    /// Points, left camera's axes, mm.
    pub points: Vec<Point3<f64>>,
    /// Radius of the solid at each point, mm; empty where it has no meaning.
    pub radii: Vec<f64>,
    /// Neighbouring points.
    pub edges: Vec<[u32; 2]>,
}

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

    let grown = match options.mode {
        Mode::Default => grow(&camera, &memory, &outcome, options, &mut clock)?,
        Mode::Paper { .. } => grow_as_paper(&camera, &memory),
    };
    clock.lap("grow");
    if grown.cones.is_empty() {
        let erased = |f: &Finding| matches!(f, Finding::SkeletonErased(_));
        return Err(outcome.findings.iter().find(|f| erased(f)).map_or(Refusal::Behind, |f| (*f).into()));
    }
    let cell = options.cell.unwrap_or_else(|| default_cell(&camera, &grown.cones));
    let body = keep_largest_body(&surface(&grown.cones, cell)?);
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
        resampled: !rectification.is_identity(),
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

/// The core's settings for a camera.
pub(crate) fn settings(camera: &RectifiedCamera, options: &Options) -> Settings {
    let fixed = |x: f64| (x * f64::from(PX)).round() as i32;
    let optics = Optics { focal: fixed(camera.f), disparity_offset: fixed(camera.disparity_offset()) };
    core_settings(optics, options)
}

fn core_settings(optics: Optics, options: &Options) -> Settings {
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
    let found = pipeline::object_box(side, grey, (&mut mask, &mut scratch), settings)?;
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

/// Balls, their depth refined and smoothed, and how far they reach.
fn grow(
    camera: &RectifiedCamera,
    memory: &Memory<'_>,
    outcome: &Outcome,
    options: &Options,
    clock: &mut Clock,
) -> Result<Grown, Finding> {
    let eye = &memory.eyes[0];
    let edges = balls::edges(eye.contour, memory.matches);
    let (mut grown, chains) = match options.skeleton {
        Skeleton::Full => {
            let chain = |l: &ContourLoop| Chain { start: l.start, len: l.len, closed: true };
            let all = balls::balls(camera, &edges, memory.balls, memory.depths);
            (all, eye.loops.iter().map(chain).collect())
        }
        Skeleton::Nurbs => curve_balls(camera, &edges, eye.branches, eye.controls),
    };
    if options.profile == Profile::Full {
        refine(camera, &edges, &mut grown);
    }
    clock.lap("refine");
    smooth(&mut grown, &outcome.plane);
    clock.lap("smooth");
    let boundary = boundary(camera, eye.loops, &edges);
    let rays = boundary_rays(camera, &edges);
    let reach = |ball: &Ball, centre: &Point3<f64>| match options.radius {
        Radius::Rays => distance_to_rays(&rays, centre),
        Radius::Boundary => distance_to_points(&boundary.points, centre),
        Radius::Transform => ball.rho * centre.z / camera.f.hypot(ball.rho),
    };
    let solid_ball = |ball: &Ball| {
        let centre = ball.centre(camera)?;
        let radius = reach(ball, &centre);
        let solid = SolidBall { centre, radius, at: ball.at, place: ball.place };
        (radius.is_finite() && radius > 0.0).then_some(solid)
    };
    let solid_balls: Vec<SolidBall> = grown.iter().filter_map(solid_ball).collect();
    clock.lap("radii");
    let pixel = solid_balls.iter().map(|b| b.centre.z / camera.f).fold(f64::INFINITY, f64::min);
    let outermost = outermost(&solid_balls, pixel);
    let cones = match options.pieces {
        Pieces::Cones => solid(&outermost, &chains),
        Pieces::Balls => spheres(&outermost),
    };
    Ok(Grown { cones, skeleton: skeleton(memory, &solid_balls), boundary })
}

/// The branches of the skeleton through the solid's balls.
fn skeleton(memory: &Memory<'_>, balls: &[SolidBall]) -> Curves {
    let eye = &memory.eyes[0];
    let mut curves = Curves::default();
    for branch in eye.branches.iter() {
        let first = curves.points.len() as u32;
        let samples = &eye.samples[branch.samples..branch.samples + branch.sample_count];
        for sample in samples {
            let at = px2(sample.ball.at());
            let nearest =
                balls.iter().min_by(|a, b| (a.at - at).norm_squared().total_cmp(&(b.at - at).norm_squared()));
            if let Some(ball) = nearest {
                curves.points.push(ball.centre);
                curves.radii.push(ball.radius);
            }
        }
        let last = curves.points.len() as u32;
        curves.edges.extend((first + 1..last).map(|k| [k - 1, k]));
        if branch.closed && last > first {
            curves.edges.push([last - 1, first]);
        }
    }
    curves
}

/// The boundary in space: each contour point at its disparity.
fn boundary(camera: &RectifiedCamera, loops: &[ContourLoop], edges: &[Edge]) -> Curves {
    let mut curves = Curves::default();
    for l in loops {
        let first = curves.points.len() as u32;
        let points = edges[l.range()].iter().filter(|e| e.weight > 0.0);
        curves.points.extend(points.filter_map(|e| camera.point(e.at.x, e.at.y, e.disparity)));
        let last = curves.points.len() as u32;
        curves.edges.extend((first + 1..last).map(|k| [k - 1, k]));
        if last > first + 2 {
            curves.edges.push([last - 1, first]);
        }
    }
    curves
}

/// The paper's solid: triangulated pairs, and a sphere about each skeleton point that reaches to the
/// nearest boundary point.
fn grow_as_paper(camera: &RectifiedCamera, memory: &Memory<'_>) -> Grown {
    let lift = |pairs: &[Pair]| -> Vec<Point3<f64>> {
        pairs.iter().filter_map(|p| triangulate(camera, px2(p.left), px2(p.right))).collect()
    };
    let boundary = Curves { points: lift(memory.boundary_pairs), ..Curves::default() };
    let centres = lift(memory.skeleton_pairs);
    let radii: Vec<f64> = centres.iter().map(|c| distance_to_points(&boundary.points, c)).collect();
    let ball = |(place, (&centre, &radius)): (usize, (&Point3<f64>, &f64))| {
        let [left, _] = camera.project(&centre)?;
        let ball = SolidBall { centre, radius, at: left.coords, place };
        (radius.is_finite() && radius > 0.0).then_some(ball)
    };
    let balls: Vec<SolidBall> = centres.iter().zip(&radii).enumerate().filter_map(ball).collect();
    Grown {
        cones: spheres(&outermost(&balls, 0.0)),
        skeleton: Curves { points: centres, radii, edges: Vec::new() },
        boundary,
    }
}
