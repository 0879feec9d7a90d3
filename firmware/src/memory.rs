//! The memory that the core borrows, for pictures of a fixed size.
//!
//! One block of scratch serves every step of a run, and holds the picture before it: what a step needs in
//! passing, the next one has again. A picture is gone when its outline is known, so both eyes share the
//! place.

use heapless::Vec;
use shared::arena;
use shared::bitmap::{Size, Word};
use shared::pipeline::{Branch, EyeMemory, Kernels, Memory, outline_words, scratch_words};
use shared::point::{Pixel, PixelPoint};
use shared::stage::branch::Sample;
use shared::stage::contour::{ContourLoop, ContourPoint};
use shared::stage::depth::BallDepth;
use shared::stage::graph::{Edge, Graph, Member, Node};
use shared::stage::medial::MedialBall;
use shared::stage::nearest::Pair;
use shared::stage::nurbs::Control;
use shared::stage::rows::ContourMatch;

/// How this machine runs the core's inner loops.
#[cfg(target_os = "none")]
const KERNELS: Kernels = crate::board::dsp::KERNELS;
/// How this machine runs the core's inner loops.
#[cfg(not(target_os = "none"))]
const KERNELS: Kernels = Kernels::PORTABLE;

/// Loops of a contour.
const LOOPS: usize = 64;

/// A picture's size and what it may hold.
#[derive(Clone, Copy, Debug)]
pub struct Capacities {
    /// The pictures' size.
    pub size: Size,
    /// Points of a contour, one a pixel of arc.
    pub points: usize,
    /// Nodes of a skeleton, and edges, before pruning: what hit-or-miss makes of a real picture's edge has
    /// more than what is left of it.
    pub parts: usize,
    /// Pixels of a skeleton, and samples of its branches with their tips.
    pub path: usize,
    /// Control points of all curves: one per 8 px, and three more a branch.
    pub controls: usize,
}

impl Capacities {
    /// Words of a mask.
    pub const fn mask(self) -> usize {
        self.size.words()
    }

    /// Words of scratch: those of the core, or a picture beside the core's first step.
    pub const fn scratch(self) -> usize {
        let core = scratch_words(self.size, self.points, self.controls, 0);
        let first = arena::words::<u8>(self.size.pixels()) + outline_words(self.size, self.points);
        if core > first { core } else { first }
    }

    /// Vertices of a hull while it is made: two a row, and top and bottom.
    pub const fn hull(self) -> usize {
        2 * self.size.height + 4
    }
}

/// Memory of a certain size, for a `static`.
pub trait Storage {
    /// What it is for.
    const CAPACITIES: Capacities;

    /// Lend it to a run of the pipeline.
    fn lend(&mut self) -> Memory<'_>;
}

/// Define a [`Storage`]. The right eye is outlined only, which is all that the default method asks of it.
macro_rules! storage {
    ($(#[$doc:meta])* $name:ident, $capacities:expr) => {
        $(#[$doc])*
        #[derive(Debug)]
        pub struct $name {
            left: Eye<{ $capacities.mask() }, { $capacities.hull() }, { $capacities.points }>,
            right: Eye<{ $capacities.mask() }, { $capacities.hull() }, { $capacities.points }>,
            described: Skeleton<{ $capacities.parts }, { $capacities.path }, { $capacities.controls }>,
            looked_at: Skeleton<0, 0, 0>,
            matches: Vec<ContourMatch, { $capacities.points }>,
            balls: Vec<MedialBall, { $capacities.points }>,
            depths: Vec<BallDepth, { $capacities.points }>,
            pairs: [Vec<Pair, 0>; 2],
            scratch: [u64; $capacities.scratch()],
        }

        impl $name {
            /// Empty memory.
            #[expect(clippy::new_without_default, reason = "a default value would be built on the stack")]
            pub const fn new() -> Self {
                Self {
                    left: Eye::new(),
                    right: Eye::new(),
                    described: Skeleton::new(),
                    looked_at: Skeleton::new(),
                    matches: Vec::new(),
                    balls: Vec::new(),
                    depths: Vec::new(),
                    pairs: [Vec::new(), Vec::new()],
                    scratch: [0; $capacities.scratch()],
                }
            }
        }

        impl Storage for $name {
            const CAPACITIES: Capacities = $capacities;

            fn lend(&mut self) -> Memory<'_> {
                let [boundary_pairs, skeleton_pairs] = &mut self.pairs;
                Memory {
                    eyes: [self.left.lend(&mut self.described), self.right.lend(&mut self.looked_at)],
                    matches: &mut self.matches,
                    balls: &mut self.balls,
                    depths: &mut self.depths,
                    boundary_pairs,
                    skeleton_pairs,
                    scratch: &mut self.scratch,
                    kernels: KERNELS,
                }
            }
        }
    };
}

const SMALL: Capacities =
    Capacities { size: Size { width: 160, height: 120 }, points: 480, parts: 64, path: 240, controls: 96 };
const QVGA: Capacities =
    Capacities { size: Size { width: 320, height: 240 }, points: 1536, parts: 128, path: 768, controls: 256 };
const VGA: Capacities = Capacities {
    size: Size { width: 640, height: 480 },
    points: 4096,
    parts: 256,
    path: 1536,
    controls: 512,
};

storage! {
    /// Pictures of 160x120 px: for boards with 128 KB of RAM.
    Small, SMALL
}
storage! {
    /// Pictures of 320x240 px: the camera modules' own size.
    Qvga, QVGA
}
storage! {
    /// Pictures of 640x480 px: for emulated boards with megabytes.
    Vga, VGA
}

/// What both eyes have: mask and contour.
#[derive(Debug)]
struct Eye<const MASK: usize, const HULL: usize, const POINTS: usize> {
    mask: [Word; MASK],
    contour: Vec<ContourPoint, POINTS>,
    loops: Vec<ContourLoop, LOOPS>,
    hull: Vec<PixelPoint, HULL>,
}

/// A skeleton, its graph and its curves.
#[derive(Debug)]
struct Skeleton<const PARTS: usize, const PATH: usize, const CONTROLS: usize> {
    nodes: Vec<Node, PARTS>,
    edges: Vec<Edge, PARTS>,
    path: Vec<Pixel, PATH>,
    members: Vec<Member, PARTS>,
    samples: Vec<Sample, PATH>,
    branches: Vec<Branch, PARTS>,
    controls: Vec<Control, CONTROLS>,
}

impl<const MASK: usize, const HULL: usize, const POINTS: usize> Eye<MASK, HULL, POINTS> {
    const fn new() -> Self {
        Self { mask: [0; MASK], contour: Vec::new(), loops: Vec::new(), hull: Vec::new() }
    }

    fn lend<'a, const PARTS: usize, const PATH: usize, const CONTROLS: usize>(
        &'a mut self,
        skeleton: &'a mut Skeleton<PARTS, PATH, CONTROLS>,
    ) -> EyeMemory<'a> {
        EyeMemory {
            mask: &mut self.mask,
            contour: &mut self.contour,
            loops: &mut self.loops,
            hull: &mut self.hull,
            graph: Graph {
                nodes: &mut skeleton.nodes,
                edges: &mut skeleton.edges,
                path: &mut skeleton.path,
                members: &mut skeleton.members,
            },
            samples: &mut skeleton.samples,
            branches: &mut skeleton.branches,
            controls: &mut skeleton.controls,
        }
    }
}

impl<const PARTS: usize, const PATH: usize, const CONTROLS: usize> Skeleton<PARTS, PATH, CONTROLS> {
    const fn new() -> Self {
        Self {
            nodes: Vec::new(),
            edges: Vec::new(),
            path: Vec::new(),
            members: Vec::new(),
            samples: Vec::new(),
            branches: Vec::new(),
            controls: Vec::new(),
        }
    }
}

// On the boards themselves, where a word has 32 bits.
#[cfg(target_pointer_width = "32")]
const _: () = {
    assert!(size_of::<Small>() <= 104 * 1024, "the small profile leaves 24 KB of 128 for stack and runtime");
    assert!(size_of::<Qvga>() <= 384 * 1024, "the board's profile leaves 16 KB of 400 for drivers");
};
