//! What a run borrows: memory of any size, named once.

use super::Kernels;
use crate::arena;
use crate::bitmap::{Size, Word};
use crate::point::PixelPoint;
use crate::stage::branch::Sample;
use crate::stage::clean;
use crate::stage::contour::{ContourLoop, ContourPoint, EdgeCrossing};
use crate::stage::depth::BallDepth;
use crate::stage::distance::{Parabola, scratch_parabolas};
use crate::stage::graph::Graph;
use crate::stage::medial::MedialBall;
use crate::stage::nearest::Pair;
use crate::stage::nurbs::{Control, Nurbs};
use crate::stage::parallel_thinning;
use crate::stage::prune::Tip;
use crate::stage::rows::{ContourMatch, RowCrossing, Trusted};
use heapless::VecView;

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
    /// The mask: [`Size::words`].
    pub mask: &'a mut [Word],
    /// The contour, about one entry a pixel of arc.
    pub contour: &'a mut VecView<ContourPoint>,
    /// Its loops.
    pub loops: &'a mut VecView<ContourLoop>,
    /// Vertices of the convex hull.
    pub hull: &'a mut VecView<PixelPoint>,
    /// The skeleton's graph; the right eye's is empty unless the method or an observer asks for it.
    pub graph: Graph<'a>,
    /// Samples of its branches.
    pub samples: &'a mut VecView<Sample>,
    /// Its branches.
    pub branches: &'a mut VecView<Branch>,
    /// Control points of their curves.
    pub controls: &'a mut VecView<Control>,
}

/// All memory of the pipeline.
pub struct Memory<'a> {
    /// Left and right eye.
    pub eyes: [EyeMemory<'a>; 2],
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
    /// What passes: [`scratch_words`].
    pub scratch: &'a mut [u64],
    /// How this machine runs the inner loops.
    pub kernels: Kernels,
}

/// Words of scratch that pictures of a size need, if a contour has up to `points` points and a curve up to
/// `controls` control points. `order` is [`scratch_order`](crate::stage::sequential_thinning::scratch_order) where
/// thinning keeps to the distance, or 0.
pub const fn scratch_words(size: Size, points: usize, controls: usize, order: usize) -> usize {
    let bitmap = arena::words::<Word>(size.words());
    let distance = arena::words::<u16>(size.pixels()) + bitmap;
    let parabolas = arena::words::<Parabola>(scratch_parabolas(size.width));
    let ordered = max(parabolas, arena::words::<u32>(order));
    let pruning = bitmap + arena::words::<Tip>(points / 8);
    let skeleton =
        distance + max(max(ordered, arena::words::<Word>(parallel_thinning::scratch_words(size))), pruning);
    let rows = 2 * (arena::words::<u32>(size.height + 1) + arena::words::<RowCrossing>(points));
    let pair = rows + arena::words::<Trusted>(points);
    max(max(outline_words(size, points), skeleton), max(pair, (7 + 4) * controls))
}

/// The part of them that [`Run::outline`](super::Run::outline) needs.
pub const fn outline_words(size: Size, points: usize) -> usize {
    let bitmap = arena::words::<Word>(size.words());
    // A loop has up to sqrt 2 cracks a point, the staircase of a diagonal.
    let cracks = arena::words::<EdgeCrossing>(points * 3 / 2);
    arena::words::<u8>(size.pixels()) + max(clean::scratch_words(size), bitmap + cracks)
}

const fn max(a: usize, b: usize) -> usize {
    if a > b { a } else { b }
}

impl Memory<'_> {
    /// Empty every list of results, lest an earlier run's stay there.
    pub(super) fn clear(&mut self) {
        for eye in &mut self.eyes {
            eye.contour.clear();
            eye.loops.clear();
            eye.hull.clear();
            eye.graph.clear();
            eye.samples.clear();
            eye.branches.clear();
            eye.controls.clear();
        }
        self.matches.clear();
        self.balls.clear();
        self.depths.clear();
        self.boundary_pairs.clear();
        self.skeleton_pairs.clear();
    }
}
