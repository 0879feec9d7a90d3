//! The memory that the core's pipeline borrows, allocated once for the largest size of image.

use shared::bitmap::{Bitmap, Size, Word};
use shared::limits::CapacityError;
use shared::pipeline::{Branch, EyeMemory, Memory, scratch_words};
use shared::point::PixelPoint;
use shared::stage::branch::Sample;
use shared::stage::contour::{ContourLoop, ContourPoint};
use shared::stage::depth::BallDepth;
use shared::stage::graph::{Edge, Graph, Member, Node};
use shared::stage::medial::MedialBall;
use shared::stage::nearest::Pair;
use shared::stage::nurbs::{Control, MAX_CONTROLS};
use shared::stage::rows::ContourMatch;
use shared::stage::sequential_thinning::scratch_order;

/// Contour points, path pixels and crossings: a silhouette of 3840x2160 has about 12,000.
const POINTS: usize = 1 << 15;
/// Nodes, edges and loops.
const PARTS: usize = 1 << 12;

type List<T, const N: usize> = Box<heapless::Vec<T, N>>;

/// What one eye needs.
#[derive(Default)]
struct Eye {
    mask: Vec<Word>,
    contour: List<ContourPoint, POINTS>,
    loops: List<ContourLoop, PARTS>,
    hull: List<PixelPoint, POINTS>,
    nodes: List<Node, PARTS>,
    edges: List<Edge, PARTS>,
    path: List<shared::point::Pixel, POINTS>,
    members: List<Member, PARTS>,
    samples: List<Sample, POINTS>,
    branches: List<Branch, PARTS>,
    controls: List<Control, POINTS>,
}

impl Eye {
    fn lend(&mut self) -> EyeMemory<'_> {
        EyeMemory {
            mask: &mut self.mask,
            contour: &mut *self.contour,
            loops: &mut *self.loops,
            hull: &mut *self.hull,
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
    scratch: Vec<u64>,
    matches: List<ContourMatch, POINTS>,
    balls: List<MedialBall, POINTS>,
    depths: List<BallDepth, POINTS>,
    boundary_pairs: List<Pair, POINTS>,
    skeleton_pairs: List<Pair, POINTS>,
}

impl Default for Storage {
    /// Memory for images without pixels.
    fn default() -> Self {
        Self {
            size: Size { width: 0, height: 0 },
            eyes: Default::default(),
            scratch: Vec::new(),
            matches: List::default(),
            balls: List::default(),
            depths: List::default(),
            boundary_pairs: List::default(),
            skeleton_pairs: List::default(),
        }
    }
}

impl Storage {
    /// Memory for images of this size.
    ///
    /// # Errors
    /// A [`CapacityError`] for images beyond [`shared::limits::MAX_SIDE`].
    pub fn new(width: usize, height: usize) -> Result<Self, CapacityError> {
        let mut storage = Self::default();
        storage.fit(width, height)?;
        Ok(storage)
    }

    /// Make it memory for images of another size. Nothing is allocated unless they are larger than all before.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn fit(&mut self, width: usize, height: usize) -> Result<(), CapacityError> {
        let size = Size::new(width, height)?;
        self.size = size;
        for eye in &mut self.eyes {
            lengthen(&mut eye.mask, size.words());
        }
        let order = scratch_order(size.pixels(), u16::MAX);
        lengthen(&mut self.scratch, scratch_words(size, POINTS, MAX_CONTROLS, order));
        Ok(())
    }

    /// The size it is for.
    pub const fn size(&self) -> Size {
        self.size
    }

    /// The masks that the last run has left, left and right.
    ///
    /// # Errors
    /// None after a run: the memory fits its images.
    pub fn masks(&mut self) -> Result<[Bitmap<'_>; 2], CapacityError> {
        let [left, right] = &mut self.eyes;
        Ok([Bitmap::over(self.size, &mut left.mask)?, Bitmap::over(self.size, &mut right.mask)?])
    }

    /// Lend it to a run of the pipeline.
    pub fn lend(&mut self) -> Memory<'_> {
        let [left, right] = &mut self.eyes;
        Memory {
            eyes: [left.lend(), right.lend()],
            matches: &mut *self.matches,
            balls: &mut *self.balls,
            depths: &mut *self.depths,
            boundary_pairs: &mut *self.boundary_pairs,
            skeleton_pairs: &mut *self.skeleton_pairs,
            scratch: &mut self.scratch,
            kernels: crate::wide::kernels(),
        }
    }
}

/// Give a list a length. What stood in it is of no use, and memory that the system gives is zero already.
fn lengthen<T: Clone + Default>(list: &mut Vec<T>, length: usize) {
    if length > list.capacity() {
        *list = vec![T::default(); length];
    } else {
        list.resize(length, T::default());
    }
}
