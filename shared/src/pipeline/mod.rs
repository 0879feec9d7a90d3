//! The pipeline: the only folder that chains stages.
//!
//! ```text
//! each eye:  grey -> median -> threshold -> mask -> contour -> hull
//! the left:                                  mask -> distance -> skeleton -> graph, pruned
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

mod default;
mod eye;
mod finding;
mod kernels;
mod memory;
mod observer;
mod paper;
mod resume;

pub use eye::object_box;
pub use finding::{Finding, MAX_COVER};
pub use kernels::Kernels;
pub use memory::{Branch, EyeMemory, Memory, outline_words, scratch_words};
pub use observer::{Observer, Product};
pub use paper::PAPER_VERTICES;
pub use resume::resume;

use crate::arena::Arena;
use crate::bitmap::{Grey, Size};
use crate::fixed::{ONE, PX, div_round, saturate};
use crate::limits::MAX_SIDE;
use crate::stage::binarise::{Polarity, Threshold};
use crate::stage::contour::ContourPoint;
use crate::stage::correspond::{CutMatch, PaperMatching, VertexMatch};
use crate::stage::depth::Optics;
use crate::stage::nurbs::FitParams;
use crate::stage::plane::ImagePlane;
use crate::stage::prune::Pruning;
use crate::stage::rows::RowStatistics;
use crate::stage::thinning::Rule;
use eye::EyeFigures;
use finding::{AREA_RATIO, Gates, MAX_OFFSET, MAX_TILT, MIN_OFFSET, NOTED_OFFSET};
use heapless::Vec;

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
    /// Whether the contour follows the grey values between pixels, or the mask alone.
    pub sub_pixel: bool,
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
            sub_pixel: true,
            thinning: Rule::EdtOrdered,
            pruning: Pruning::default(),
            curves: FitParams::default(),
            method: Method::Default,
            optics,
        }
    }

    /// What a small device does: contours of the mask alone, and a thinning rule that needs no order of the
    /// pixels, so that a block of scratch of twice the picture is enough.
    pub fn device(optics: Optics) -> Self {
        Self { sub_pixel: false, thinning: Rule::HitOrMiss, ..Self::new(optics) }
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

/// Describe and match one rectified pair. The right eye is thinned for the paper's method, and for an observer that
/// wants to see it ([`Observer::wants_both_skeletons`]), on whom nothing but that eye's graph depends.
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
    let mut run = Run::new(memory, settings);
    same_size(left.size(), right.size())?;
    let [left_eye, right_eye] = &mut memory.eyes;
    let mut scratch = Arena::new(memory.scratch);
    run.outline(Side::Left, left, left_eye, scratch.fork(), observer)?;
    run.outline(Side::Right, right, right_eye, scratch.fork(), observer)?;
    run.skeleton(Side::Left, left_eye, scratch.fork(), observer)?;
    match settings.method {
        Method::Paper(_) => run.skeleton(Side::Right, right_eye, scratch, observer)?,
        Method::Default if observer.wants_both_skeletons() => {
            // Neither what is found there nor a lack of memory is the pair's.
            let (kernels, mut gates) = (&memory.kernels, Gates::new(settings));
            let whose = (Side::Right, right.size());
            if eye::skeleton(whose, right_eye, scratch, (settings, kernels), &mut gates, observer).is_err() {
                right_eye.graph.clear();
            }
        }
        Method::Default => (),
    }
    run.pair(memory, observer)
}

/// A run in its steps, for a device that has room for but one picture at a time: the outlines of both eyes, the
/// left one's skeleton, then the pair. [`run`] goes the same steps.
#[derive(Debug)]
pub struct Run {
    settings: Settings,
    kernels: Kernels,
    gates: Gates,
    figures: [Option<EyeFigures>; 2],
}

impl Run {
    /// A new run, which forgets what an earlier one left in the memory.
    pub fn new(memory: &mut Memory<'_>, settings: &Settings) -> Self {
        memory.clear();
        let (kernels, gates) = (memory.kernels, Gates::new(settings));
        Self { settings: *settings, kernels, gates, figures: [None; 2] }
    }

    /// From an eye's picture to mask and contour. The picture is not needed any more after this.
    ///
    /// # Errors
    /// The first [`Finding`] that refuses.
    pub fn outline(
        &mut self,
        side: Side,
        grey: Grey<'_>,
        eye: &mut EyeMemory<'_>,
        scratch: Arena<'_>,
        observer: &mut impl Observer,
    ) -> Result<(), Finding> {
        let Self { settings, kernels, gates, .. } = self;
        let figures = eye::outline(side, grey, eye, scratch, (settings, kernels), gates, observer)?;
        self.figures[side as usize] = Some(figures);
        Ok(())
    }

    /// From an eye's mask to its skeleton. The pair needs the right eye's in the paper's method alone.
    ///
    /// # Errors
    /// The first [`Finding`] that refuses.
    pub fn skeleton(
        &mut self,
        side: Side,
        eye: &mut EyeMemory<'_>,
        scratch: Arena<'_>,
        observer: &mut impl Observer,
    ) -> Result<(), Finding> {
        let figures = self.figures[side as usize].ok_or(Finding::NoObject(side, 0))?;
        let Self { settings, kernels, gates, .. } = self;
        eye::skeleton((side, figures.size), eye, scratch, (settings, kernels), gates, observer)
    }

    /// From both eyes to the described pair.
    ///
    /// # Errors
    /// The first [`Finding`] that refuses.
    pub fn pair(mut self, memory: &mut Memory<'_>, observer: &mut impl Observer) -> Result<Outcome, Finding> {
        let [Some(left), Some(right)] = self.figures else {
            let side = if self.figures[0].is_none() { Side::Left } else { Side::Right };
            return Err(Finding::NoObject(side, 0));
        };
        same_size(left.size, right.size)?;
        compare(&[left, right], &mut self.gates)?;
        let (settings, gates) = (&self.settings, &mut self.gates);
        match settings.method {
            Method::Default => default::match_views(memory, left.size, settings, gates, observer)?,
            Method::Paper(paper) => paper::match_as_paper(memory, left.size, paper, gates, observer)?,
        }
        Ok(self.gates.outcome)
    }
}

/// Masks of two sizes have no rows in common, whatever the method.
fn same_size(left: Size, right: Size) -> Result<(), Finding> {
    let sides = |size: Size| (size.width, size.height);
    if left == right { Ok(()) } else { Err(Finding::SizesDiffer { left: sides(left), right: sides(right) }) }
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
    if mean.abs() >= NOTED_OFFSET {
        gates.meet(Finding::VerticalOffset(mean))?;
    }
    gates.outcome.vertical_offset = if mean.abs() < MIN_OFFSET { 0 } else { mean };
    Ok(())
}

const _: () = assert!(MAX_SIDE <= 1 << 12, "coordinates are stated to be below 2^20");
