//! One eye, in two steps: from its picture to mask and contour, from the mask to its pruned skeleton.

use super::finding::{Gates, MAX_COVER, MIN_AREA, MIN_CONTRAST, MIN_HEIGHT, SECOND_COVER};
use super::{Branch, EyeMemory, Finding, Kernels, Method, Observer, Product, Settings, Side};
use crate::arena::Arena;
use crate::bitmap::{Bitmap, Grey, PixelBox, Size, Word};
use crate::fixed::{ONE, PX};
use crate::limits::{CapacityError, push};
use crate::point::Pixel;
use crate::stage::binarise::{self, Histogram, Threshold};
use crate::stage::boundary::{Element, boundary};
use crate::stage::branch::{Sample, trace_pixels};
use crate::stage::clean;
use crate::stage::contour::{ContourPoint, contour, frontier};
use crate::stage::distance::{self, scratch_parabolas};
use crate::stage::graph::{Graph, NodeKind};
use crate::stage::nurbs::{self, FitParams};
use crate::stage::prune;
use crate::stage::sequential_thinning;
use crate::stage::thinning;
use heapless::VecView;

/// What scratch for bitmaps is called when it runs out.
const WORDS: &str = "words of scratch";

/// What one eye's picture gives beside its lists.
#[derive(Clone, Copy, Debug)]
pub(super) struct EyeFigures {
    pub(super) size: Size,
    pub(super) area: u32,
    pub(super) top: ContourPoint,
    pub(super) bottom: ContourPoint,
}

/// From the picture to the mask and the contour of its object.
pub(super) fn outline(
    side: Side,
    grey: Grey<'_>,
    eye: &mut EyeMemory<'_>,
    mut scratch: Arena<'_>,
    (settings, kernels): (&Settings, &Kernels),
    gates: &mut Gates,
    observer: &mut impl Observer,
) -> Result<EyeFigures, Finding> {
    let size = grey.size();
    let mut saw = |product: Product<'_>| observer.saw(Some(side), product);
    let filtered = filtered(size, settings, &mut scratch)?;
    let (grey, mask, area) =
        silhouette(side, grey, (eye.mask, filtered, scratch.fork()), (settings, kernels), gates, &mut saw)?;

    saw(Product::Boundary(&boundary(&mask, Element::Square, scratch.fork().take(size.words(), WORDS)?)?));
    let edges = settings.sub_pixel.then_some(grey);
    contour(edges, &mask, scratch, eye.contour, eye.loops)?;
    saw(Product::Contour(eye.contour, eye.loops));
    if eye.contour.iter().any(|p| p.border) {
        gates.meet(Finding::TouchesBorder(side))?;
    }
    let Some((top, bottom)) = frontier(eye.contour) else { return Err(Finding::NoObject(side, area)) };
    let height = ((bottom.at.v - top.at.v) / PX) as u32;
    if height < MIN_HEIGHT {
        gates.meet(Finding::TooLow(side, height))?;
    }
    Ok(EyeFigures { size, area, top, bottom })
}

/// From the mask to the graph of its pruned skeleton and, the paper's way, its curves.
pub(super) fn skeleton(
    (side, size): (Side, Size),
    eye: &mut EyeMemory<'_>,
    mut scratch: Arena<'_>,
    (settings, kernels): (&Settings, &Kernels),
    gates: &mut Gates,
    observer: &mut impl Observer,
) -> Result<(), Finding> {
    let mut saw = |product: Product<'_>| observer.saw(Some(side), product);
    let mask = Bitmap::over(size, eye.mask)?;
    {
        let mut scratch = scratch.fork();
        let mut skeleton = Bitmap::new(size, scratch.take(size.words(), WORDS)?)?;
        let plane = {
            let plane = scratch.take(size.pixels(), "pixels in a plane")?;
            let mut passing = scratch.fork();
            let parabolas = passing.take(scratch_parabolas(size.width), "parabolas of scratch")?;
            distance::distance(&mask, plane, parabolas)?
        };
        saw(Product::Distance(&plane));
        skeleton.copy_from(&mask);
        let thinned =
            thinning::thin(&mut skeleton, (settings.thinning, kernels.thin), &plane, scratch.fork())?;
        sequential_thinning::minimal(&mut skeleton);
        saw(Product::Skeleton(&skeleton, thinned));
        if skeleton.count() == 0 {
            gates.meet(Finding::SkeletonErased(side))?;
        }
        let pruned = prune::prune(&mut skeleton, &plane, settings.pruning, scratch, &mut eye.graph)?;
        saw(Product::Graph(&skeleton, &eye.graph, pruned));
        if matches!(settings.method, Method::Default) {
            return Ok(());
        }
        // The paper describes the skeletons of both views before it matches them.
        eye.samples.clear();
        eye.branches.clear();
        each_branch(&eye.graph, |path, _, nodes, closed| {
            let start = eye.samples.len();
            trace_pixels(path, &plane, eye.samples)?;
            add_branch(eye.branches, eye.samples, start, nodes, closed)
        })?;
    }
    fit_curves(eye, scratch, &settings.curves)?;
    follow_curves(eye)?;
    saw(Product::Curves(eye.branches, eye.controls));
    Ok(())
}

/// Memory for the filtered picture, if there is to be one.
fn filtered<'a>(
    size: Size,
    settings: &Settings,
    scratch: &mut Arena<'a>,
) -> Result<&'a mut [u8], CapacityError> {
    scratch.take(if settings.median { size.pixels() } else { 0 }, "pixels in a picture")
}

/// The filtered picture, the cleaned mask of its largest object, and that one's area.
fn silhouette<'a>(
    side: Side,
    grey: Grey<'a>,
    (mask, filtered, mut scratch): (&'a mut [Word], &'a mut [u8], Arena<'_>),
    (settings, kernels): (&Settings, &Kernels),
    gates: &mut Gates,
    saw: &mut impl FnMut(Product<'_>),
) -> Result<(Grey<'a>, Bitmap<'a>, u32), Finding> {
    let size = grey.size();
    let pixels = size.pixels() as u32;
    let grey = if settings.median { binarise::median(grey, filtered, kernels.median_row)? } else { grey };
    let histogram = binarise::histogram(grey);
    let level = settings.threshold.level(&histogram);
    let tone = settings.polarity.tone(grey, level);
    saw(Product::Threshold(grey, &histogram, level, tone));
    if settings.threshold == Threshold::Otsu && contrast(&histogram, level) < MIN_CONTRAST {
        gates.meet(Finding::NoObject(side, 0))?;
    }

    let mut mask = binarise::binarise(grey, level, tone, mask)?;
    let components = clean::keep_largest(&mut mask, scratch.fork())?;
    let holes = clean::fill_holes(&mut mask, clean::HOLE_AREA, scratch)?;
    let area = components.largest + holes.area;
    saw(Product::Mask(&mask, components));
    if area < MIN_AREA {
        gates.meet(Finding::NoObject(side, area))?;
    }
    let percent = |part: u32, whole: u32| (u64::from(part) * 100 / u64::from(whole.max(1))) as u32;
    if percent(area, pixels) > MAX_COVER {
        gates.meet(Finding::FillsImage(side, percent(area, pixels)))?;
    }
    if percent(components.second, components.largest) > SECOND_COVER {
        gates.meet(Finding::SecondObject(side, percent(components.second, components.largest)))?;
    }
    Ok((grey, mask, area))
}

/// The box of the object in a picture, found and judged as a run would: what a rectification is laid
/// around. The lent memory is that of a mask, and scratch as for an outline of no points
/// ([`outline_words`](super::outline_words)).
///
/// # Errors
/// The first [`Finding`] that refuses.
pub fn object_box(
    side: Side,
    grey: Grey<'_>,
    (mask, scratch): (&mut [Word], &mut [u64]),
    (settings, kernels): (&Settings, &Kernels),
) -> Result<PixelBox, Finding> {
    let (mut gates, mut scratch) = (Gates::new(settings), Arena::new(scratch));
    let filtered = filtered(grey.size(), settings, &mut scratch)?;
    let (_, mask, _) =
        silhouette(side, grey, (mask, filtered, scratch), (settings, kernels), &mut gates, &mut |_| ())?;
    mask.bounds().ok_or(Finding::NoObject(side, 0))
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
pub(super) fn each_branch(
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
pub(super) fn add_branch(
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
pub(super) fn fit_curves(
    eye: &mut EyeMemory<'_>,
    mut scratch: Arena<'_>,
    params: &FitParams,
) -> Result<(), CapacityError> {
    eye.controls.clear();
    for branch in eye.branches.iter_mut() {
        branch.controls = eye.controls.len();
        let samples = branch.samples..branch.samples + branch.sample_count;
        let samples = eye.samples.get(samples).unwrap_or_default();
        branch.control_count = nurbs::fit(samples, branch.closed, params, scratch.fork(), eye.controls)?;
    }
    Ok(())
}

/// Replace the samples by points of the fitted curves, a pixel apart.
pub(super) fn follow_curves(eye: &mut EyeMemory<'_>) -> Result<(), CapacityError> {
    eye.samples.clear();
    for branch in eye.branches.iter_mut() {
        branch.samples = eye.samples.len();
        if let Some(curve) = branch.curve(eye.controls) {
            curve.sample(PX, |ball| push(eye.samples, Sample { ball, weight: ONE }, "branch samples"))?;
        }
        branch.sample_count = eye.samples.len() - branch.samples;
    }
    Ok(())
}
