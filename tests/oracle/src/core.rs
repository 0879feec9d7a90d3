//! The core on plain pictures, with memory in which any one part can be too short.

use heapless::Vec as List;
use shared::bitmap::{Grey, Size, Word};
use shared::pipeline::{
    self, Branch, EyeMemory, Finding, Kernels, Memory, Observer, Outcome, Settings, scratch_words,
};
use shared::point::{Pixel, PixelPoint};
use shared::stage::branch::Sample;
use shared::stage::contour::{ContourLoop, ContourPoint};
use shared::stage::depth::BallDepth;
use shared::stage::graph::{Edge, Graph, Member, Node};
use shared::stage::medial::MedialBall;
use shared::stage::nearest::Pair;
use shared::stage::nurbs::{Control, MAX_CONTROLS};
use shared::stage::rows::ContourMatch;
use shared::stage::sequential_thinning::scratch_order;

/// `picture[v][u]`: a grey value.
pub type Picture = Vec<Vec<u8>>;

/// What must hold of the lists after every run that gives an outcome.
///
/// # Panics
/// When it does not.
pub fn hangs_together(memory: &Memory<'_>, outcome: &Outcome) {
    assert!(outcome.areas.iter().all(|area| *area >= 1));
    for eye in &memory.eyes {
        let mut next = 0;
        for l in eye.loops.iter() {
            assert!(l.start == next && l.len >= 8);
            next += l.len;
        }
        assert_eq!(next, eye.contour.len());
        for branch in eye.branches.iter() {
            assert!(branch.samples + branch.sample_count <= eye.samples.len());
            assert!(branch.controls + branch.control_count <= eye.controls.len());
        }
    }
    assert_eq!(memory.balls.len(), memory.depths.len());
    assert!(memory.balls.iter().all(|ball| ball.rho > 0));
}

/// The parts of one eye's memory, then those that both eyes share.
pub const PARTS: [&str; 17] = [
    "mask",
    "contour",
    "loops",
    "hull",
    "nodes",
    "edges",
    "path",
    "members",
    "samples",
    "branches",
    "controls",
    "matches",
    "balls",
    "depths",
    "boundary pairs",
    "skeleton pairs",
    "scratch",
];

#[derive(Default)]
struct EyeLists<const N: usize> {
    contour: Box<List<ContourPoint, N>>,
    loops: Box<List<ContourLoop, N>>,
    hull: Box<List<PixelPoint, N>>,
    nodes: Box<List<Node, N>>,
    edges: Box<List<Edge, N>>,
    path: Box<List<Pixel, N>>,
    members: Box<List<Member, N>>,
    samples: Box<List<Sample, N>>,
    branches: Box<List<Branch, N>>,
    controls: Box<List<Control, N>>,
}

#[derive(Default)]
struct Lists<const N: usize> {
    eyes: [EyeLists<N>; 2],
    matches: Box<List<ContourMatch, N>>,
    balls: Box<List<MedialBall, N>>,
    depths: Box<List<BallDepth, N>>,
    boundary_pairs: Box<List<Pair, N>>,
    skeleton_pairs: Box<List<Pair, N>>,
}

#[derive(Default)]
struct Slices {
    masks: [Vec<Word>; 2],
    scratch: Vec<u64>,
}

impl Slices {
    fn fit(&mut self, size: Size) {
        for words in &mut self.masks {
            words.resize(size.words(), 0x55);
        }
        let order = scratch_order(size.pixels(), u16::MAX);
        self.scratch.resize(scratch_words(size, 16384, MAX_CONTROLS, order), 0x55);
    }
}

/// Memory for pictures of up to some thousand contour points, used again and again as it was left.
#[derive(Default)]
pub struct Core {
    long: Lists<16384>,
    short: Lists<3>,
    slices: Slices,
}

impl Core {
    /// All memory, but for the part named, of which there is as good as none.
    pub fn lend(&mut self, size: Size, missing: &str) -> Memory<'_> {
        let Self { long, short, slices } = self;
        slices.fit(size);
        macro_rules! list {
            ($name:literal, $long:expr, $short:expr) => {
                if missing == $name { &mut *$short } else { &mut *$long }
            };
        }
        macro_rules! slice {
            ($name:literal, $all:expr) => {{
                let keep = if missing == $name { 3.min($all.len()) } else { $all.len() };
                &mut $all[..keep]
            }};
        }
        let [left, right] = &mut long.eyes;
        let [short_left, short_right] = &mut short.eyes;
        let [left_mask, right_mask] = &mut slices.masks;
        macro_rules! eye {
            ($long:expr, $short:expr, $mask:expr) => {
                EyeMemory {
                    mask: slice!("mask", $mask),
                    contour: list!("contour", $long.contour, $short.contour),
                    loops: list!("loops", $long.loops, $short.loops),
                    hull: list!("hull", $long.hull, $short.hull),
                    graph: Graph {
                        nodes: list!("nodes", $long.nodes, $short.nodes),
                        edges: list!("edges", $long.edges, $short.edges),
                        path: list!("path", $long.path, $short.path),
                        members: list!("members", $long.members, $short.members),
                    },
                    samples: list!("samples", $long.samples, $short.samples),
                    branches: list!("branches", $long.branches, $short.branches),
                    controls: list!("controls", $long.controls, $short.controls),
                }
            };
        }
        Memory {
            eyes: [eye!(left, short_left, left_mask), eye!(right, short_right, right_mask)],
            matches: list!("matches", long.matches, short.matches),
            balls: list!("balls", long.balls, short.balls),
            depths: list!("depths", long.depths, short.depths),
            boundary_pairs: list!("boundary pairs", long.boundary_pairs, short.boundary_pairs),
            skeleton_pairs: list!("skeleton pairs", long.skeleton_pairs, short.skeleton_pairs),
            scratch: slice!("scratch", slices.scratch),
            kernels: Kernels::PORTABLE,
        }
    }

    /// The whole core on two pictures; `look` sees what it left in its memory.
    ///
    /// # Errors
    /// Those of the core.
    pub fn run(
        &mut self,
        [left, right]: [&Picture; 2],
        settings: &Settings,
        missing: &str,
        observer: &mut impl Observer,
        look: impl FnOnce(&Memory<'_>, &Outcome),
    ) -> Result<Outcome, Finding> {
        let size = size(left);
        let (left_bytes, right_bytes) = (left.concat(), right.concat());
        let grey = |picture: &Picture, bytes| {
            let size = self::size(picture);
            Grey::new(size, size.width, bytes).unwrap()
        };
        let (a, b) = (grey(left, &left_bytes), grey(right, &right_bytes));
        let mut memory = self.lend(size, missing);
        let outcome = pipeline::run(&mut memory, a, b, settings, observer)?;
        look(&memory, &outcome);
        Ok(outcome)
    }
}

/// Width and height of a picture.
pub fn size(picture: &Picture) -> Size {
    Size::new(picture.first().map_or(0, Vec::len), picture.len()).unwrap()
}

/// A picture of a function of the pixel.
pub fn picture(width: usize, height: usize, grey: impl Fn(usize, usize) -> u8) -> Picture {
    (0..height).map(|v| (0..width).map(|u| grey(u, v)).collect()).collect()
}
