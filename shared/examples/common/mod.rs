//! What the examples share: memory for pictures of 160x120 px, and a pair to look at.
//!
//! [`Storage`] is what to copy: its size is known when the program is built, so that it fits a `static`, and the
//! capacities below are all there is to change for larger pictures. A list that is too short is an error that names
//! it; nothing is overwritten.

use core::array::from_fn;
use heapless::Vec;
use shared::bitmap::{Size, Word};
use shared::pipeline::{Branch, EyeMemory, Kernels, Memory, scratch_words};
use shared::point::{Pixel, PixelPoint};
use shared::stage::branch::Sample;
use shared::stage::contour::{ContourLoop, ContourPoint};
use shared::stage::depth::BallDepth;
use shared::stage::graph::{Edge, Graph, Member, Node};
use shared::stage::medial::MedialBall;
use shared::stage::nearest::Pair;
use shared::stage::nurbs::Control;
use shared::stage::rows::ContourMatch;

/// Size of the pictures, px.
pub(crate) const SIZE: Size = Size { width: 160, height: 120 };
/// Points of a contour, one a pixel of arc.
const POINTS: usize = 480;
/// Loops of a contour; nodes, edges and branches of a skeleton.
const PARTS: usize = 64;
/// Pixels of a skeleton, and samples of its branches.
const PATH: usize = 320;
/// Control points of all curves: one per 8 px, and three more a branch.
const CONTROLS: usize = 96;
/// Vertices of a hull while it is made: two a row, and top and bottom.
const HULL: usize = 2 * SIZE.height + 4;
/// What passes. The rules that thin in parallel need no order of the pixels: 0.
const SCRATCH: usize = scratch_words(SIZE, POINTS, CONTROLS, 0);

/// All memory of the pipeline.
pub(crate) struct Storage {
    eyes: [Eye; 2],
    matches: Vec<ContourMatch, POINTS>,
    balls: Vec<MedialBall, POINTS>,
    depths: Vec<BallDepth, POINTS>,
    /// The paper's method alone fills these.
    pairs: [Vec<Pair, 0>; 2],
    scratch: [u64; SCRATCH],
}

struct Eye {
    mask: [Word; SIZE.words()],
    contour: Vec<ContourPoint, POINTS>,
    loops: Vec<ContourLoop, PARTS>,
    hull: Vec<PixelPoint, HULL>,
    nodes: Vec<Node, PARTS>,
    edges: Vec<Edge, PARTS>,
    path: Vec<Pixel, PATH>,
    members: Vec<Member, PARTS>,
    samples: Vec<Sample, PATH>,
    branches: Vec<Branch, PARTS>,
    controls: Vec<Control, CONTROLS>,
}

impl Storage {
    /// Empty memory, at no cost when the program runs.
    pub(crate) const fn new() -> Self {
        Self {
            eyes: [const { Eye::new() }; 2],
            matches: Vec::new(),
            balls: Vec::new(),
            depths: Vec::new(),
            pairs: [const { Vec::new() }; 2],
            scratch: [0; SCRATCH],
        }
    }

    /// Lend it to a run, with the inner loops that this machine is to use.
    pub(crate) fn lend(&mut self, kernels: Kernels) -> Memory<'_> {
        let [boundary_pairs, skeleton_pairs] = &mut self.pairs;
        Memory {
            eyes: self.eyes.each_mut().map(Eye::lend),
            matches: &mut self.matches,
            balls: &mut self.balls,
            depths: &mut self.depths,
            boundary_pairs,
            skeleton_pairs,
            scratch: &mut self.scratch,
            kernels,
        }
    }
}

impl Eye {
    const fn new() -> Self {
        Self {
            mask: [0; SIZE.words()],
            contour: Vec::new(),
            loops: Vec::new(),
            hull: Vec::new(),
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
            contour: &mut self.contour,
            loops: &mut self.loops,
            hull: &mut self.hull,
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

/// Both pictures of a pair, a byte a pixel.
pub(crate) type Pictures = [[u8; SIZE.pixels()]; 2];

/// Draw both views of a bright slingshot on a dark ground: three arms from one knot, one of which comes nearer
/// to its end. A device has a camera instead.
pub(crate) fn draw(pictures: &mut Pictures) {
    // An arm's end as (column, row, disparity), px.
    let (knot, ends) = ([80, 60, 20], [[48, 24, 20], [112, 24, 20], [80, 102, 28]]);
    for picture in pictures.iter_mut() {
        picture.fill(20);
    }
    for end in ends {
        for step in 0..=64 {
            let [u, v, disparity]: [i32; 3] = from_fn(|k| knot[k] + (end[k] - knot[k]) * step / 64);
            for (eye, picture) in (0..).zip(pictures.iter_mut()) {
                disc(picture, [u + 10 - eye * disparity, v]);
            }
        }
    }
}

/// A bright disc of radius 8 px.
fn disc(picture: &mut [u8], [u, v]: [i32; 2]) {
    for (i, pixel) in picture.iter_mut().enumerate() {
        let (du, dv) = ((i % SIZE.width) as i32 - u, (i / SIZE.width) as i32 - v);
        if du * du + dv * dv <= 8 * 8 {
            *pixel = 200;
        }
    }
}
