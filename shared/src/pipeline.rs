//! The pipeline: the only file that chains stages.
//!
//! ```text
//! each eye:  grey -> median -> threshold -> mask -> contour -> hull
//!                                            mask -> distance -> skeleton -> graph, pruned
//! the pair:  hulls -> invariants -> disparity plane -> row matching -> depth of each medial ball
//!            graph + balls -> branches -> NURBS
//! ```
//!
//! With [`Method::Paper`] the pair goes the paper's way instead: hulls of the pixels, the hulls' own
//! vertices, an affine map, and the nearest right point of each mapped left one, for boundary and skeleton
//! alike. Both methods run on the same stages.
//!
//! All memory is lent ([`Memory`]); what remains there afterwards is the result, and what passes by on the
//! way can be seen by an [`Observer`]. Integers only: the same input gives the same bits everywhere.

use crate::bitmap::{Bitmap, Grey, Plane, Size, Word};
use crate::fixed::{ONE, PX, UNIT, div_round, saturate};
use crate::limits::{CapacityError, MAX_SIDE, push};
use crate::point::{Pixel, PixelPoint};
use crate::stage::binarise::{self, Histogram, Polarity, Threshold, Tone};
use crate::stage::boundary::{Element, boundary};
use crate::stage::branch::{Ball, Balls, Sample, trace_branch, trace_pixels};
use crate::stage::clean::{self, Components};
use crate::stage::contour::{ContourLoop, ContourPoint, EdgeCrossing, contour, frontier};
use crate::stage::correspond::{CutMatch, PaperMatching, VertexMatch, match_cuts, match_vertices};
use crate::stage::depth::{BallDepth, Optics, ball_depths};
use crate::stage::distance::{self, Parabola};
use crate::stage::graph::{Graph, NodeKind};
use crate::stage::hull::{RowExtent, bitmap_extents, convex_hull};
use crate::stage::medial::{MedialBall, medial_balls};
use crate::stage::nearest::{Pair, pair_nearest};
use crate::stage::nurbs::{self, Control, FitParams, Nurbs};
use crate::stage::plane::{ImagePlane, Observation};
use crate::stage::prune::{self, Pruning, Tip};
use crate::stage::rows::{
    ContourMatch, RowCrossing, RowStatistics, Rows, Trusted, match_rows, row_crossings,
};
use crate::stage::thinning::{self, Rule};
use heapless::{Vec, VecView};

/// One of the two eyes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The left eye, in whose image the model is described.
    Left,
    /// The right eye.
    Right,
}

/// How the two views are matched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Hulls cut at equal heights, row matching, depth from contour contacts; gates refuse.
    Default,
    /// As the paper's section 4.1 says; gates only warn.
    Paper(PaperMatching),
}

/// Every choice of the pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Whether a 3x3 median comes before the threshold.
    pub median: bool,
    /// Level between object and background.
    pub threshold: Threshold,
    /// Whether the object is bright or dark.
    pub polarity: Polarity,
    /// How the mask is thinned.
    pub thinning: Rule,
    /// Which branches of the skeleton go.
    pub pruning: Pruning,
    /// How branches become curves.
    pub curves: FitParams,
    /// How the views are matched.
    pub method: Method,
    /// The cameras.
    pub optics: Optics,
}

impl Settings {
    /// What works (docs/algorithm.md).
    pub fn new(optics: Optics) -> Self {
        Self {
            median: true,
            threshold: Threshold::Otsu,
            polarity: Polarity::BrightObject,
            thinning: Rule::EdtOrdered,
            pruning: Pruning::default(),
            curves: FitParams::default(),
            method: Method::Default,
            optics,
        }
    }

    /// As literally as the paper's prose allows; branches shorter than 10 px are pruned.
    pub fn paper(optics: Optics, matching: PaperMatching) -> Self {
        Self {
            median: false,
            thinning: Rule::HitOrMiss,
            pruning: Pruning::Length { px: 10 * PX },
            method: Method::Paper(matching),
            ..Self::new(optics)
        }
    }
}

/// Something about the input that the user should know; whether it is fatal, [`Finding::refuses`] says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Finding {
    /// The images differ in size: (width, height) of both.
    SizesDiffer {
        /// Of the left image, px.
        left: (usize, usize),
        /// Of the right image, px.
        right: (usize, usize),
    },
    /// No component of 64 px, or no contrast at all; the area of the largest.
    NoObject(Side, u32),
    /// The object covers most of the image, in percent.
    FillsImage(Side, u32),
    /// The second component's area, in percent of the largest.
    SecondObject(Side, u32),
    /// Right area over left area, in 1/65536.
    AreasDiffer(i32),
    /// The object is cut off by the image's border.
    TouchesBorder(Side),
    /// The object's height, px, too little to match anything by.
    TooLow(Side, u32),
    /// The hull is too flat to be cut: row extents are used instead.
    FlatHull,
    /// Another shift of the hull has a smaller e_omega, but not by much: the rows decide. That shift.
    Ambiguous(usize),
    /// The hulls are no affine images of each other, or are so by another shift than that of the rows: their
    /// mean residual, 1/256 px.
    NotAffine(i32),
    /// The least disparity of the object's hull, 1/256 px, is negative or next to nothing: the eyes are
    /// swapped, or one view is mirrored.
    SwappedEyes(i32),
    /// Top and bottom of the object differ between the views by these rows, 1/256 px.
    NotRectified {
        /// Right less left row of the highest point.
        top: i32,
        /// Right less left row of the lowest point.
        bottom: i32,
    },
    /// Share of the left contour's row crossings without partner, in 1/65536.
    Unmatched(i32),
    /// The paper's hull matching found no map.
    NoMap,
    /// A list was too short.
    Capacity(CapacityError),
}

impl From<CapacityError> for Finding {
    fn from(error: CapacityError) -> Self {
        Self::Capacity(error)
    }
}

/// Least difference of the mean grey values on both sides of Otsu's level: below it, there is but one side.
const MIN_CONTRAST: u64 = 8;
/// Fewest pixels of an object.
const MIN_AREA: u32 = 64;
/// An object that covers more of the image than this is the background, percent.
pub const MAX_COVER: u32 = 60;
/// A second component this large gets a warning, percent of the first.
const SECOND_COVER: u32 = 10;
/// Least height of an object, px.
const MIN_HEIGHT: u32 = 8;
/// Right over left area, in 1/65536.
const AREA_RATIO: core::ops::RangeInclusive<i32> = ONE * 7 / 10..=ONE * 14 / 10;
/// Most that the rows of top and bottom may differ, and most by which both may be off, 1/256 px.
const MAX_TILT: i32 = PX;
const MAX_OFFSET: i32 = 3 * PX;
/// A vertical offset below this is taken for noise, 1/256 px.
const MIN_OFFSET: i32 = PX / 8;
/// Unmatched share that warns and that refuses, in 1/65536.
const UNMATCHED_WARNS: i32 = ONE * 15 / 100;
const UNMATCHED_REFUSES: i32 = ONE / 4;
/// Mean distance of the cut hull's vertices from the disparity plane that refuses: this part of the hull's
/// mean width and height, and a pixel at least.
const MAX_RESIDUAL: i32 = ONE / 50;
/// An object nearer to infinity than this is not where it seems: the eyes are swapped or a view is
/// mirrored, 1/256 px.
const MIN_DISPARITY: i32 = 2 * PX;
/// The paper's reduced hulls have at most this many vertices: n^3 triples are looked at.
pub const PAPER_VERTICES: usize = 24;

impl Finding {
    /// Whether no trustworthy model can come of it.
    pub fn refuses(&self) -> bool {
        match self {
            Self::SecondObject(..) | Self::TouchesBorder(_) | Self::FlatHull | Self::Ambiguous(_) => false,
            Self::Unmatched(share) => *share > UNMATCHED_REFUSES,
            _ => true,
        }
    }

    /// Whether there is nothing to go on with, whatever the method.
    const fn is_fatal(&self) -> bool {
        matches!(self, Self::SizesDiffer { .. } | Self::NoObject(..) | Self::NoMap | Self::Capacity(_))
    }
}

/// What passes by on the way, for pictures, timings and records.
pub enum Product<'a> {
    /// The filtered image, its histogram, the level and the object's side of it.
    Threshold(Grey<'a>, &'a Histogram, u8, Tone),
    /// The cleaned mask and what was cleaned away.
    Mask(&'a Bitmap<'a>, Components),
    /// A minus its erosion.
    Boundary(&'a Bitmap<'a>),
    /// The contour in loops.
    Contour(&'a [ContourPoint], &'a [ContourLoop]),
    /// Distance to the background, 1/16 px.
    Distance(&'a Plane<'a, u16>),
    /// The thinned mask, one pixel wide.
    Skeleton(&'a Bitmap<'a>, thinning::Report),
    /// The skeleton that pruning left, and its graph.
    Graph(&'a Bitmap<'a>, &'a Graph<'a>, prune::Report),
    /// Vertices of the convex hull, in the coordinates that are matched: right rows moved by the
    /// vertical offset.
    Hull(&'a [PixelPoint]),
    /// The hulls, cut and matched.
    Cuts(&'a CutMatch),
    /// The hulls' vertices, matched the paper's way.
    Vertices(&'a VertexMatch),
    /// Each left contour point's partner.
    Rows(&'a [ContourMatch], RowStatistics),
    /// Balls of the left view and their depths.
    Balls(&'a [MedialBall], &'a [BallDepth]),
    /// Pairs of points, left and right: boundary and skeleton.
    Pairs(&'a [Pair], &'a [Pair]),
    /// The curves of the skeleton are fitted.
    Curves(&'a [Branch], &'a [Control]),
}

/// Looks on while the pipeline runs.
pub trait Observer {
    /// A stage has made something; products of the pair come with `None`.
    fn saw(&mut self, side: Option<Side>, product: Product<'_>);
}

/// Nobody looks on.
impl Observer for () {
    fn saw(&mut self, _: Option<Side>, _: Product<'_>) {}
}

/// A branch of the skeleton: stretches of the samples and of the control points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Branch {
    /// Nodes of the graph at its ends.
    pub nodes: [u16; 2],
    /// First sample.
    pub samples: usize,
    /// Number of samples.
    pub sample_count: usize,
    /// First control point.
    pub controls: usize,
    /// Number of control points.
    pub control_count: usize,
    /// Whether it is a ring.
    pub closed: bool,
}

impl Branch {
    /// Its curve, given all control points.
    pub fn curve<'c>(&self, controls: &'c [Control]) -> Option<Nurbs<'c>> {
        Nurbs::new(controls.get(self.controls..self.controls + self.control_count)?, self.closed)
    }
}

/// Memory of one eye; the lists hold the result afterwards.
pub struct EyeMemory<'a> {
    /// [`Size::words`] for the mask.
    pub mask: &'a mut [Word],
    /// [`Size::words`] for the skeleton.
    pub skeleton: &'a mut [Word],
    /// The contour, about one entry a pixel of arc.
    pub contour: &'a mut VecView<ContourPoint>,
    /// Its loops.
    pub loops: &'a mut VecView<ContourLoop>,
    /// Vertices of the convex hull.
    pub hull: &'a mut VecView<PixelPoint>,
    /// Where the contour crosses rows: about one entry a row for each of its sides.
    pub crossings: &'a mut VecView<RowCrossing>,
    /// One entry more than rows.
    pub rows: &'a mut [u32],
    /// The skeleton's graph.
    pub graph: Graph<'a>,
    /// Samples of its branches.
    pub samples: &'a mut VecView<Sample>,
    /// Its branches.
    pub branches: &'a mut VecView<Branch>,
    /// Control points of their curves.
    pub controls: &'a mut VecView<Control>,
}

/// Memory that holds nothing of interest afterwards.
pub struct Scratch<'a> {
    /// [`Size::pixels`] for the filtered image.
    pub grey: &'a mut [u8],
    /// Twice [`Size::words`].
    pub words: &'a mut [Word],
    /// [`Size::pixels`] for distances.
    pub plane: &'a mut [u16],
    /// [`distance::scratch_parabolas`].
    pub parabolas: &'a mut [Parabola],
    /// [`thinning::scratch_order`].
    pub order: &'a mut [u32],
    /// Cracks of the longest contour loop.
    pub edges: &'a mut VecView<EdgeCrossing>,
    /// Ends of the skeleton.
    pub tips: &'a mut VecView<Tip>,
    /// As many as contour points.
    pub trusted: &'a mut VecView<Trusted>,
    /// Points along the longest curve.
    pub points: &'a mut VecView<Ball>,
    /// Seven a control point of the longest curve.
    pub entries: &'a mut [i64],
    /// One a control point of the longest curve.
    pub sides: &'a mut [[i64; 4]],
}

/// All memory of the pipeline.
pub struct Memory<'a> {
    /// Left and right eye.
    pub eyes: [EyeMemory<'a>; 2],
    /// What passes.
    pub scratch: Scratch<'a>,
    /// One a left contour point.
    pub matches: &'a mut VecView<ContourMatch>,
    /// At most one a left contour point.
    pub balls: &'a mut VecView<MedialBall>,
    /// One a ball.
    pub depths: &'a mut VecView<BallDepth>,
    /// The paper's pairs of boundary pixels; may be without capacity otherwise.
    pub boundary_pairs: &'a mut VecView<Pair>,
    /// The paper's pairs of skeleton points; may be without capacity otherwise.
    pub skeleton_pairs: &'a mut VecView<Pair>,
}

/// How many findings a run can have.
pub const MAX_FINDINGS: usize = 24;

/// What a run says beside what it leaves in its memory.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Outcome {
    /// Everything the user should know.
    pub findings: Vec<Finding, MAX_FINDINGS>,
    /// Areas of the object in both views, px.
    pub areas: [u32; 2],
    /// Right less left row of the object, 1/256 px, as corrected for.
    pub vertical_offset: i32,
    /// Right less left row of the highest and the lowest point, 1/256 px.
    pub frontier_offsets: [i32; 2],
    /// The object's disparity plane.
    pub plane: ImagePlane,
    /// The hulls, cut and matched (default method).
    pub cuts: Option<CutMatch>,
    /// The hulls' vertices, matched (paper's method).
    pub vertices: Option<VertexMatch>,
    /// How row matching went.
    pub rows: RowStatistics,
}

/// Collects findings and stops at those that refuse.
struct Gates {
    outcome: Outcome,
    lenient: bool,
}

impl Gates {
    fn meet(&mut self, finding: Finding) -> Result<(), Finding> {
        if finding.is_fatal() || (finding.refuses() && !self.lenient) {
            return Err(finding);
        }
        // Each gate is met at most once an eye, so the list cannot fill up.
        let _ = self.outcome.findings.push(finding);
        Ok(())
    }
}

/// What one eye's picture gives beside its lists.
struct EyeFigures {
    area: u32,
    top: ContourPoint,
    bottom: ContourPoint,
}

/// Describe and match one rectified pair.
///
/// # Errors
/// The first [`Finding`] that refuses; with [`Method::Paper`] only one that leaves nothing to go on with.
pub fn run(
    memory: &mut Memory<'_>,
    left: Grey<'_>,
    right: Grey<'_>,
    settings: &Settings,
    observer: &mut impl Observer,
) -> Result<Outcome, Finding> {
    let lenient = matches!(settings.method, Method::Paper(_));
    let mut gates = Gates { outcome: Outcome::default(), lenient };
    if left.size() != right.size() {
        let pair = |s: Size| (s.width, s.height);
        gates.meet(Finding::SizesDiffer { left: pair(left.size()), right: pair(right.size()) })?;
    }
    forget(memory);
    let [left_eye, right_eye] = &mut memory.eyes;
    let scratch = &mut memory.scratch;
    let figures = [
        see(Side::Left, left, left_eye, scratch, settings, &mut gates, observer)?,
        see(Side::Right, right, right_eye, scratch, settings, &mut gates, observer)?,
    ];
    compare(&figures, &mut gates)?;
    match settings.method {
        Method::Default => match_views(memory, left.size(), settings, &mut gates, observer)?,
        Method::Paper(paper) => match_as_paper(memory, left.size(), paper, &mut gates, observer)?,
    }
    Ok(gates.outcome)
}

/// Empty the lists that one method fills and the other does not, lest an earlier run's stay there.
fn forget(memory: &mut Memory<'_>) {
    for eye in &mut memory.eyes {
        eye.crossings.clear();
        eye.samples.clear();
        eye.branches.clear();
        eye.controls.clear();
    }
    memory.matches.clear();
    memory.balls.clear();
    memory.depths.clear();
    memory.boundary_pairs.clear();
    memory.skeleton_pairs.clear();
}

/// One eye: from its picture to contour and pruned skeleton.
fn see(
    side: Side,
    grey: Grey<'_>,
    eye: &mut EyeMemory<'_>,
    scratch: &mut Scratch<'_>,
    settings: &Settings,
    gates: &mut Gates,
    observer: &mut impl Observer,
) -> Result<EyeFigures, Finding> {
    let size = grey.size();
    let mut saw = |product: Product<'_>| observer.saw(Some(side), product);
    let grey = if settings.median { binarise::median(grey, scratch.grey)? } else { grey };
    let histogram = binarise::histogram(grey);
    let level = settings.threshold.level(&histogram);
    let tone = settings.polarity.tone(grey, level);
    saw(Product::Threshold(grey, &histogram, level, tone));
    if settings.threshold == Threshold::Otsu && contrast(&histogram, level) < MIN_CONTRAST {
        gates.meet(Finding::NoObject(side, 0))?;
    }

    let mut mask = binarise::binarise(grey, level, tone, eye.mask)?;
    let components = clean::keep_largest(&mut mask, scratch.words)?;
    clean::fill_holes(&mut mask, clean::HOLE_AREA, scratch.words)?;
    let area = mask.count() as u32;
    saw(Product::Mask(&mask, components));
    if area < MIN_AREA {
        gates.meet(Finding::NoObject(side, area))?;
    }
    let percent = |part: u32, whole: u32| (u64::from(part) * 100 / u64::from(whole.max(1))) as u32;
    if percent(area, size.pixels() as u32) > MAX_COVER {
        gates.meet(Finding::FillsImage(side, percent(area, size.pixels() as u32)))?;
    }
    if percent(components.second, components.largest) > SECOND_COVER {
        gates.meet(Finding::SecondObject(side, percent(components.second, components.largest)))?;
    }

    let (seen, _) = scratch.words.split_at_mut(size.words().min(scratch.words.len()));
    saw(Product::Boundary(&boundary(&mask, Element::Square, seen)?));
    contour(grey, &mask, &mut Bitmap::new(size, seen)?, scratch.edges, eye.contour, eye.loops)?;
    saw(Product::Contour(eye.contour, eye.loops));
    if eye.contour.iter().any(|p| p.border) {
        gates.meet(Finding::TouchesBorder(side))?;
    }
    let Some((top, bottom)) = frontier(eye.contour) else { return Err(Finding::NoObject(side, area)) };
    let height = ((bottom.at.v - top.at.v) / PX) as u32;
    if height < MIN_HEIGHT {
        gates.meet(Finding::TooLow(side, height))?;
    }

    let plane = distance::distance(&mask, scratch.plane, scratch.parabolas)?;
    saw(Product::Distance(&plane));
    let mut skeleton = Bitmap::new(size, eye.skeleton)?;
    skeleton.copy_from(&mask);
    let thinned = thinning::thin(&mut skeleton, settings.thinning, &plane, scratch.words, scratch.order)?;
    thinning::minimal(&mut skeleton);
    saw(Product::Skeleton(&skeleton, thinned));
    let pruned =
        prune::prune(&mut skeleton, &plane, settings.pruning, scratch.words, scratch.tips, &mut eye.graph)?;
    saw(Product::Graph(&skeleton, &eye.graph, pruned));
    if matches!(settings.method, Method::Paper(_)) {
        // The paper describes the skeletons of both views before it matches them.
        eye.samples.clear();
        eye.branches.clear();
        each_branch(&eye.graph, |path, _, nodes, closed| {
            let start = eye.samples.len();
            trace_pixels(path, &plane, eye.samples)?;
            add_branch(eye.branches, eye.samples, start, nodes, closed)
        })?;
        fit_curves(eye, scratch, &settings.curves)?;
        follow_curves(eye, scratch)?;
        saw(Product::Curves(eye.branches, eye.controls));
    }
    Ok(EyeFigures { area, top, bottom })
}

/// Difference of the mean grey values above the level and up to it; 0 when one side is empty.
fn contrast(histogram: &Histogram, level: u8) -> u64 {
    let (low, high) = histogram.split_at(usize::from(level) + 1);
    let mean = |bins: &[u32], first: usize| {
        let sum = (first as u64..).zip(bins).map(|(value, n)| value * u64::from(*n)).sum::<u64>();
        sum.checked_div(bins.iter().map(|n| u64::from(*n)).sum())
    };
    mean(high, low.len()).zip(mean(low, 0)).map_or(0, |(high, low)| high - low)
}

/// Hand each edge of the graph, and each isolated node, to `take` with its free ends, nodes and closure.
fn each_branch(
    graph: &Graph<'_>,
    mut take: impl FnMut(&[Pixel], [bool; 2], [u16; 2], bool) -> Result<(), CapacityError>,
) -> Result<(), CapacityError> {
    let free = |n: u16| graph.nodes.get(usize::from(n)).is_some_and(|n| n.kind == NodeKind::End);
    for edge in graph.edges.iter() {
        take(graph.pixels(edge), edge.nodes.map(free), edge.nodes, edge.closed)?;
    }
    for member in graph.members.iter() {
        if graph.nodes.get(usize::from(member.node)).is_some_and(|n| n.kind == NodeKind::Isolated) {
            take(&[member.pixel], [false; 2], [member.node; 2], false)?;
        }
    }
    Ok(())
}

/// Note the samples from `start` on as a branch, if there are any.
fn add_branch(
    branches: &mut VecView<Branch>,
    samples: &[Sample],
    start: usize,
    nodes: [u16; 2],
    closed: bool,
) -> Result<(), CapacityError> {
    let sample_count = samples.len() - start;
    if sample_count == 0 {
        return Ok(());
    }
    push(
        branches,
        Branch { nodes, samples: start, sample_count, controls: 0, control_count: 0, closed },
        "branches",
    )
}

/// Fit a curve to each branch.
fn fit_curves(
    eye: &mut EyeMemory<'_>,
    scratch: &mut Scratch<'_>,
    params: &FitParams,
) -> Result<(), CapacityError> {
    eye.controls.clear();
    for branch in eye.branches.iter_mut() {
        branch.controls = eye.controls.len();
        let samples = &eye.samples[branch.samples..branch.samples + branch.sample_count];
        let mut lent = nurbs::Scratch { entries: scratch.entries, sides: scratch.sides };
        branch.control_count = nurbs::fit(samples, branch.closed, params, &mut lent, eye.controls)?;
    }
    Ok(())
}

/// Replace the samples by points of the fitted curves, a pixel apart.
fn follow_curves(eye: &mut EyeMemory<'_>, scratch: &mut Scratch<'_>) -> Result<(), CapacityError> {
    eye.samples.clear();
    for branch in eye.branches.iter_mut() {
        scratch.points.clear();
        if let Some(curve) = branch.curve(eye.controls) {
            curve.sample(PX, scratch.points)?;
        }
        branch.samples = eye.samples.len();
        branch.sample_count = scratch.points.len();
        for &ball in scratch.points.iter() {
            push(eye.samples, Sample { ball, weight: ONE }, "branch samples")?;
        }
    }
    Ok(())
}

/// Gates that look at both views; notes the vertical offset.
fn compare([left, right]: &[EyeFigures; 2], gates: &mut Gates) -> Result<(), Finding> {
    gates.outcome.areas = [left.area, right.area];
    let ratio = saturate(div_round(i64::from(right.area) * i64::from(ONE), i64::from(left.area)));
    if !AREA_RATIO.contains(&ratio) {
        gates.meet(Finding::AreasDiffer(ratio))?;
    }
    let offset = |l: &ContourPoint, r: &ContourPoint| (!l.border && !r.border).then_some(r.at.v - l.at.v);
    let offsets = (offset(&left.top, &right.top), offset(&left.bottom, &right.bottom));
    let (top, bottom) = match offsets {
        (Some(top), Some(bottom)) => (top, bottom),
        (Some(one), None) | (None, Some(one)) => (one, one),
        (None, None) => (0, 0),
    };
    gates.outcome.frontier_offsets = [top, bottom];
    let mean = (top + bottom) / 2;
    if mean.abs() > MAX_OFFSET || (top - bottom).abs() > MAX_TILT {
        gates.meet(Finding::NotRectified { top, bottom })?;
    }
    gates.outcome.vertical_offset = if mean.abs() < MIN_OFFSET { 0 } else { mean };
    Ok(())
}

/// The default way from two contours to the depth of every ball and curve.
fn match_views(
    memory: &mut Memory<'_>,
    size: Size,
    settings: &Settings,
    gates: &mut Gates,
    observer: &mut impl Observer,
) -> Result<(), Finding> {
    let [left, right] = &mut memory.eyes;
    let offset = gates.outcome.vertical_offset;
    for (eye, side, offset) in [(&mut *left, Side::Left, 0), (&mut *right, Side::Right, offset)] {
        let limit = eye.rows.len();
        let first = eye.rows.get_mut(..=size.height).ok_or(CapacityError { what: "ends of rows", limit })?;
        row_crossings(eye.contour, eye.loops, offset, first, eye.crossings)?;
        let rows = Rows { first, crossings: eye.crossings };
        convex_hull(contour_extents(eye.contour, rows, offset), eye.hull)?;
        observer.saw(Some(side), Product::Hull(eye.hull));
    }
    let left_rows = Rows { first: &left.rows[..=size.height], crossings: left.crossings };
    let right_rows = Rows { first: &right.rows[..=size.height], crossings: right.crossings };

    let plane = seed((left.hull, right.hull), (left_rows, right_rows), size.width, gates, observer)?;
    let least = left.hull.iter().map(|p| plane.at(*p)).min().unwrap_or(plane.level);
    let disparity = least.saturating_add(settings.optics.disparity_offset);
    if disparity < MIN_DISPARITY {
        gates.meet(Finding::SwappedEyes(disparity))?;
    }
    let statistics = match_rows(
        (left.contour, left.loops),
        right.contour,
        (left_rows, right_rows),
        &plane,
        memory.matches,
        memory.scratch.trusted,
    )?;
    gates.outcome.rows = statistics;
    observer.saw(None, Product::Rows(memory.matches, statistics));
    let share =
        div_round(i64::from(statistics.unmatched) * i64::from(ONE), i64::from(statistics.crossings)) as i32;
    if share > UNMATCHED_WARNS {
        gates.meet(Finding::Unmatched(share))?;
    }

    medial_balls(left.contour, memory.balls)?;
    ball_depths(memory.balls, left.contour, memory.matches, settings.optics, memory.depths)?;
    observer.saw(None, Product::Balls(memory.balls, memory.depths));
    left.samples.clear();
    left.branches.clear();
    let balls = Balls { balls: memory.balls, depths: memory.depths };
    each_branch(&left.graph, |path, free, nodes, closed| {
        let start = left.samples.len();
        trace_branch(path, free, balls, left.samples)?;
        add_branch(left.branches, left.samples, start, nodes, closed)
    })?;
    fit_curves(left, &mut memory.scratch, &settings.curves)?;
    observer.saw(None, Product::Curves(left.branches, left.controls));
    Ok(())
}

/// The contour's extents in every row that it crosses, and its highest and lowest points.
fn contour_extents(points: &[ContourPoint], rows: Rows<'_>, offset: i32) -> impl Iterator<Item = RowExtent> {
    let single = |p: ContourPoint| RowExtent { v: p.at.v - offset, left: p.at.u, right: p.at.u };
    let ends = frontier(points).map(|(top, bottom)| (single(top), single(bottom)));
    let across = (0..rows.len()).filter_map(move |v| {
        let row = rows.row(v);
        Some(RowExtent { v: v as i32 * PX, left: row.first()?.u, right: row.last()?.u })
    });
    // A frontier point exactly on a row is in that row's extent already.
    let between = move |e: &RowExtent| ends.is_some_and(|(top, bottom)| e.v > top.v && e.v < bottom.v);
    ends.map(|e| e.0).into_iter().chain(across.filter(between)).chain(ends.map(|e| e.1))
}

/// The disparity plane from the matched hulls, or from the rows' extents where a hull cannot be cut.
fn seed(
    (left, right): (&[PixelPoint], &[PixelPoint]),
    (left_rows, right_rows): (Rows<'_>, Rows<'_>),
    width: usize,
    gates: &mut Gates,
    observer: &mut impl Observer,
) -> Result<ImagePlane, Finding> {
    let cuts = if left.len() < 4 || right.len() < 4 { None } else { match_cuts(left, right) };
    let plane = if let Some(cuts) = &cuts {
        observer.saw(None, Product::Cuts(cuts));
        // Where the image ends, neither hull says anything of the object.
        let inside = |p: PixelPoint| (0..(width as i32 - 1) * PX).contains(&p.u);
        let whole = |&(a, b): &(PixelPoint, PixelPoint)| inside(a) && inside(b);
        let pairs = cuts.left.into_iter().zip(cuts.right).filter(whole);
        let cut_off = pairs.clone().count() < cuts.left.len();
        let contradicted = !cut_off && cuts.shift != 0;
        if cuts.least != 0 && !contradicted {
            gates.meet(Finding::Ambiguous(cuts.least))?;
        }
        let seen = pairs.map(|(a, b)| observation(a, b.u));
        let plane = ImagePlane::fit(seen.clone());
        let off = |o: Observation| plane.map_or(0, |p| i64::from((o.value - p.at(o.at)).abs()));
        let residual = div_round(seen.clone().map(off).sum(), seen.count() as i64) as i32;
        let allowed = (i64::from(mean_side(&cuts.left)) * i64::from(MAX_RESIDUAL)) >> 16;
        if contradicted || i64::from(residual) > allowed.max(i64::from(PX)) {
            gates.meet(Finding::NotAffine(residual))?;
        }
        plane
    } else {
        gates.meet(Finding::FlatHull)?;
        ImagePlane::fit((0..left_rows.len()).flat_map(move |v| {
            let (a, b) = (left_rows.row(v), right_rows.row(v));
            let pair = |a: Option<&RowCrossing>, b: Option<&RowCrossing>| {
                Some(observation(PixelPoint { u: a?.u, v: v as i32 * PX }, b?.u))
            };
            [pair(a.first(), b.first()), pair(a.last(), b.last())].into_iter().flatten()
        }))
    };
    gates.outcome.cuts = cuts;
    let plane = plane.ok_or(Finding::NoMap)?;
    gates.outcome.plane = plane;
    Ok(plane)
}

/// Mean of width and height of the points' box, 1/256 px.
fn mean_side(points: &[PixelPoint]) -> i32 {
    let span = |of: fn(&PixelPoint) -> i32| {
        points.iter().map(of).max().unwrap_or(0) - points.iter().map(of).min().unwrap_or(0)
    };
    (span(|p| p.u) + span(|p| p.v)) / 2
}

/// The disparity that a point would have if it were the right view's at column `u`.
const fn observation(at: PixelPoint, u: i32) -> Observation {
    Observation { at, value: at.u - u, weight: UNIT }
}

/// The paper's way: an affine map from the hulls, then the nearest point for boundary and skeleton.
fn match_as_paper(
    memory: &mut Memory<'_>,
    size: Size,
    paper: PaperMatching,
    gates: &mut Gates,
    observer: &mut impl Observer,
) -> Result<(), Finding> {
    let [left, right] = &mut memory.eyes;
    for (eye, side) in [(&mut *left, Side::Left), (&mut *right, Side::Right)] {
        let mask = Bitmap::over(size, eye.mask)?;
        convex_hull(bitmap_extents(&mask), eye.hull)?;
        observer.saw(Some(side), Product::Hull(eye.hull));
    }
    let matched = match_vertices(left.hull, right.hull, PAPER_VERTICES, paper).ok_or(Finding::NoMap)?;
    observer.saw(None, Product::Vertices(&matched));
    gates.outcome.vertices = Some(matched);

    let words = size.words().min(memory.scratch.words.len());
    let (a, b) = memory.scratch.words.split_at_mut(words);
    let boundaries = [
        boundary(&Bitmap::over(size, left.mask)?, Element::Square, a)?,
        boundary(&Bitmap::over(size, right.mask)?, Element::Square, b)?,
    ];
    let points = |i: usize| boundaries[i].pixels().map(Pixel::centre);
    pair_nearest(points(0), || points(1), &matched.map, memory.boundary_pairs)?;
    let skeleton = |samples: &'_ VecView<Sample>, k: usize| samples[k].ball.at();
    let (l, r) = (&*left.samples, &*right.samples);
    pair_nearest(
        (0..l.len()).map(|k| skeleton(l, k)),
        || (0..r.len()).map(|k| skeleton(r, k)),
        &matched.map,
        memory.skeleton_pairs,
    )?;
    observer.saw(None, Product::Pairs(memory.boundary_pairs, memory.skeleton_pairs));
    Ok(())
}

const _: () = assert!(MAX_SIDE <= 1 << 12, "coordinates are stated to be below 2^20");
