//! The memory that the core's pipeline borrows, allocated once for a size of image.

use shared::bitmap::{Size, Word};
use shared::limits::CapacityError;
use shared::pipeline::{Branch, EyeMemory, Memory, Scratch};
use shared::point::PixelPoint;
use shared::stage::branch::{Ball, Sample};
use shared::stage::contour::{ContourLoop, ContourPoint, EdgeCrossing};
use shared::stage::depth::BallDepth;
use shared::stage::distance::{Parabola, scratch_parabolas};
use shared::stage::graph::{Edge, Graph, Member, Node};
use shared::stage::medial::MedialBall;
use shared::stage::nearest::Pair;
use shared::stage::nurbs::{Control, MAX_CONTROLS};
use shared::stage::prune::Tip;
use shared::stage::rows::{ContourMatch, RowCrossing, Trusted};
use shared::stage::thinning::scratch_order;

/// Contour points, path pixels and crossings: a silhouette of 3840x2160 has about 12,000.
const POINTS: usize = 1 << 15;
/// Nodes, edges and loops.
const PARTS: usize = 1 << 12;

type List<T, const N: usize> = Box<heapless::Vec<T, N>>;

/// What one eye needs.
#[derive(Default)]
struct Eye {
    mask: Vec<Word>,
    skeleton: Vec<Word>,
    rows: Vec<u32>,
    contour: List<ContourPoint, POINTS>,
    loops: List<ContourLoop, PARTS>,
    hull: List<PixelPoint, POINTS>,
    crossings: List<RowCrossing, POINTS>,
    nodes: List<Node, PARTS>,
    edges: List<Edge, PARTS>,
    path: List<shared::point::Pixel, POINTS>,
    members: List<Member, PARTS>,
    samples: List<Sample, POINTS>,
    branches: List<Branch, PARTS>,
    controls: List<Control, POINTS>,
}

impl Eye {
    fn new(size: Size) -> Self {
        Self {
            mask: vec![0; size.words()],
            skeleton: vec![0; size.words()],
            rows: vec![0; size.height + 1],
            ..Self::default()
        }
    }

    fn lend(&mut self) -> EyeMemory<'_> {
        EyeMemory {
            mask: &mut self.mask,
            skeleton: &mut self.skeleton,
            rows: &mut self.rows,
            contour: &mut *self.contour,
            loops: &mut *self.loops,
            hull: &mut *self.hull,
            crossings: &mut *self.crossings,
            graph: Graph {
                nodes: &mut *self.nodes,
                edges: &mut *self.edges,
                path: &mut *self.path,
                members: &mut *self.members,
            },
            samples: &mut *self.samples,
            branches: &mut *self.branches,
            controls: &mut *self.controls,
        }
    }
}

/// All of it.
pub struct Storage {
    size: Size,
    eyes: [Eye; 2],
    grey: Vec<u8>,
    words: Vec<Word>,
    plane: Vec<u16>,
    parabolas: Vec<Parabola>,
    order: Vec<u32>,
    entries: Vec<i64>,
    sides: Vec<[i64; 4]>,
    edges: List<EdgeCrossing, POINTS>,
    tips: List<Tip, PARTS>,
    trusted: List<Trusted, POINTS>,
    points: List<Ball, POINTS>,
    matches: List<ContourMatch, POINTS>,
    balls: List<MedialBall, POINTS>,
    depths: List<BallDepth, POINTS>,
    boundary_pairs: List<Pair, POINTS>,
    skeleton_pairs: List<Pair, POINTS>,
}

impl Storage {
    /// Memory for images of this size.
    ///
    /// # Errors
    /// A [`CapacityError`] for images beyond [`shared::limits::MAX_SIDE`].
    pub fn new(width: usize, height: usize) -> Result<Self, CapacityError> {
        let size = Size::new(width, height)?;
        let pixels = size.pixels();
        Ok(Self {
            size,
            eyes: [Eye::new(size), Eye::new(size)],
            grey: vec![0; pixels],
            words: vec![0; 2 * size.words()],
            plane: vec![0; pixels],
            parabolas: vec![Parabola::default(); scratch_parabolas(width)],
            order: vec![0; scratch_order(pixels, u16::MAX)],
            entries: vec![0; 7 * MAX_CONTROLS],
            sides: vec![[0; 4]; MAX_CONTROLS],
            edges: List::default(),
            tips: List::default(),
            trusted: List::default(),
            points: List::default(),
            matches: List::default(),
            balls: List::default(),
            depths: List::default(),
            boundary_pairs: List::default(),
            skeleton_pairs: List::default(),
        })
    }

    /// The size it was made for.
    pub const fn size(&self) -> Size {
        self.size
    }

    /// Lend it to a run of the pipeline.
    pub fn lend(&mut self) -> Memory<'_> {
        let [left, right] = &mut self.eyes;
        Memory {
            eyes: [left.lend(), right.lend()],
            scratch: Scratch {
                grey: &mut self.grey,
                words: &mut self.words,
                plane: &mut self.plane,
                parabolas: &mut self.parabolas,
                order: &mut self.order,
                edges: &mut *self.edges,
                tips: &mut *self.tips,
                trusted: &mut *self.trusted,
                points: &mut *self.points,
                entries: &mut self.entries,
                sides: &mut self.sides,
            },
            matches: &mut *self.matches,
            balls: &mut *self.balls,
            depths: &mut *self.depths,
            boundary_pairs: &mut *self.boundary_pairs,
            skeleton_pairs: &mut *self.skeleton_pairs,
        }
    }
}
