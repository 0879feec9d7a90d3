//! What a run borrows: memory of any size, named once.

use crate::bitmap::Word;
use crate::point::PixelPoint;
use crate::stage::branch::{Ball, Sample};
use crate::stage::contour::{ContourLoop, ContourPoint, EdgeCrossing};
use crate::stage::depth::BallDepth;
use crate::stage::distance::Parabola;
use crate::stage::graph::Graph;
use crate::stage::medial::MedialBall;
use crate::stage::nearest::Pair;
use crate::stage::nurbs::{Control, Nurbs};
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
    /// [`Size::words`](crate::bitmap::Size::words) for the mask.
    pub mask: &'a mut [Word],
    /// [`Size::words`](crate::bitmap::Size::words) for the skeleton.
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
    /// [`Size::pixels`](crate::bitmap::Size::pixels) for the filtered image.
    pub grey: &'a mut [u8],
    /// Twice [`Size::words`](crate::bitmap::Size::words).
    pub words: &'a mut [Word],
    /// [`Size::pixels`](crate::bitmap::Size::pixels) for distances.
    pub plane: &'a mut [u16],
    /// [`scratch_parabolas`](crate::stage::distance::scratch_parabolas).
    pub parabolas: &'a mut [Parabola],
    /// [`scratch_order`](crate::stage::thinning::scratch_order).
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

impl Memory<'_> {
    /// Empty every list of results, lest an earlier run's stay there.
    pub(super) fn clear(&mut self) {
        for eye in &mut self.eyes {
            eye.contour.clear();
            eye.loops.clear();
            eye.hull.clear();
            eye.crossings.clear();
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
