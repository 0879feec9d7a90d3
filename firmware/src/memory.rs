//! The memory that the core borrows, sized for small pictures: 160x120 px fit the board's largest
//! bank of RAM.

use heapless::Vec;
use shared::bitmap::{Size, WORD_BITS, Word};
use shared::pipeline::{Branch, EyeMemory, MAX_COVER, Memory, Scratch};
use shared::point::{Pixel, PixelPoint};
use shared::stage::branch::{Ball, Sample};
use shared::stage::contour::{ContourLoop, ContourPoint, EdgeCrossing};
use shared::stage::depth::BallDepth;
use shared::stage::distance::{Parabola, scratch_parabolas};
use shared::stage::graph::{Edge, Graph, Member, Node};
use shared::stage::medial::MedialBall;
use shared::stage::nurbs::Control;
use shared::stage::prune::Tip;
use shared::stage::rows::{ContourMatch, RowCrossing, Trusted};
use shared::stage::thinning::scratch_order;

/// Columns of a picture, px.
pub const WIDTH: usize = 160;
/// Rows of a picture, px.
pub const HEIGHT: usize = 120;

const PIXELS: usize = WIDTH * HEIGHT;
const WORDS: usize = WIDTH.div_ceil(WORD_BITS) * HEIGHT;
/// Contour points: one a pixel of arc, for an outline of three times the picture's circumference.
const POINTS: usize = 1536;
/// Pixels of a skeleton, and samples of its branches with their tips.
const PATH: usize = 512;
/// Nodes, edges and loops of a skeleton.
const PARTS: usize = 64;
/// Control points of all curves: one per 8 px, and three more a branch.
const CONTROLS: usize = 256;
/// Pixels of the largest object that the pipeline does not refuse.
const OBJECT: usize = PIXELS * MAX_COVER as usize / 100 + 1;
/// The largest distance to the background, 1/16 px: half the picture's height.
const DEPTH: u16 = HEIGHT as u16 * 16 / 2;

/// One eye's lists.
#[derive(Debug)]
struct Eye {
    mask: [Word; WORDS],
    skeleton: [Word; WORDS],
    rows: [u32; HEIGHT + 1],
    contour: Vec<ContourPoint, POINTS>,
    loops: Vec<ContourLoop, PARTS>,
    hull: Vec<PixelPoint, { 2 * HEIGHT + 4 }>,
    crossings: Vec<RowCrossing, POINTS>,
    nodes: Vec<Node, PARTS>,
    edges: Vec<Edge, PARTS>,
    path: Vec<Pixel, PATH>,
    members: Vec<Member, PARTS>,
    samples: Vec<Sample, PATH>,
    branches: Vec<Branch, PARTS>,
    controls: Vec<Control, CONTROLS>,
}

impl Eye {
    const fn new() -> Self {
        Self {
            mask: [0; WORDS],
            skeleton: [0; WORDS],
            rows: [0; HEIGHT + 1],
            contour: Vec::new(),
            loops: Vec::new(),
            hull: Vec::new(),
            crossings: Vec::new(),
            nodes: Vec::new(),
            edges: Vec::new(),
            path: Vec::new(),
            members: Vec::new(),
            samples: Vec::new(),
            branches: Vec::new(),
            controls: Vec::new(),
        }
    }

    fn lend(&mut self) -> EyeMemory<'_> {
        EyeMemory {
            mask: &mut self.mask,
            skeleton: &mut self.skeleton,
            rows: &mut self.rows,
            contour: &mut self.contour,
            loops: &mut self.loops,
            hull: &mut self.hull,
            crossings: &mut self.crossings,
            graph: Graph {
                nodes: &mut self.nodes,
                edges: &mut self.edges,
                path: &mut self.path,
                members: &mut self.members,
            },
            samples: &mut self.samples,
            branches: &mut self.branches,
            controls: &mut self.controls,
        }
    }
}

/// All memory of the pipeline, for a `static`.
#[derive(Debug)]
pub struct Storage {
    eyes: [Eye; 2],
    grey: [u8; PIXELS],
    words: [Word; 2 * WORDS],
    plane: [u16; PIXELS],
    parabolas: [Parabola; scratch_parabolas(WIDTH)],
    order: [u32; scratch_order(OBJECT, DEPTH)],
    entries: [i64; 7 * CONTROLS],
    sides: [[i64; 4]; CONTROLS],
    edges: Vec<EdgeCrossing, { 2 * POINTS }>,
    tips: Vec<Tip, PARTS>,
    trusted: Vec<Trusted, POINTS>,
    points: Vec<Ball, 0>,
    matches: Vec<ContourMatch, POINTS>,
    balls: Vec<MedialBall, POINTS>,
    depths: Vec<BallDepth, POINTS>,
    boundary_pairs: Vec<shared::stage::nearest::Pair, 0>,
    skeleton_pairs: Vec<shared::stage::nearest::Pair, 0>,
}

impl Storage {
    /// Empty memory.
    #[expect(clippy::new_without_default, reason = "a default value would be built on the stack")]
    pub const fn new() -> Self {
        Self {
            eyes: [Eye::new(), Eye::new()],
            grey: [0; PIXELS],
            words: [0; 2 * WORDS],
            plane: [0; PIXELS],
            parabolas: [Parabola::NONE; scratch_parabolas(WIDTH)],
            order: [0; scratch_order(OBJECT, DEPTH)],
            entries: [0; 7 * CONTROLS],
            sides: [[0; 4]; CONTROLS],
            edges: Vec::new(),
            tips: Vec::new(),
            trusted: Vec::new(),
            points: Vec::new(),
            matches: Vec::new(),
            balls: Vec::new(),
            depths: Vec::new(),
            boundary_pairs: Vec::new(),
            skeleton_pairs: Vec::new(),
        }
    }

    /// The pictures that it is for.
    pub const fn size() -> Size {
        Size { width: WIDTH, height: HEIGHT }
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
                edges: &mut self.edges,
                tips: &mut self.tips,
                trusted: &mut self.trusted,
                points: &mut self.points,
                entries: &mut self.entries,
                sides: &mut self.sides,
            },
            matches: &mut self.matches,
            balls: &mut self.balls,
            depths: &mut self.depths,
            boundary_pairs: &mut self.boundary_pairs,
            skeleton_pairs: &mut self.skeleton_pairs,
        }
    }
}

/// The board's RAM less the two pictures, the stack and what the runtime keeps.
const BUDGET: usize = 512 * 1024 - 2 * PIXELS - 64 * 1024;
const _: () = assert!(size_of::<Storage>() <= BUDGET, "the core's memory must fit the board");
