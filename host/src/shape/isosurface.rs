//! The zero level of a function as a closed mesh, by marching tetrahedra.
//!
//! In: a function of space, negative inside, with slope at most 1 (so that its value at a point
//! bounds the distance to the surface from below), a box that holds the surface, and a cell size in
//! mm. Out: a closed, manifold mesh whose normals point outward. Every cell of a cubic grid is cut
//! into six tetrahedra around its diagonal (Kuhn 1960), alike in all cells, so that neighbours agree on
//! their common faces and no case is ambiguous; vertices sit where grid edges cross the surface, found
//! by the regula falsi. Cost: evaluations in proportion to the surface's area over the cell's, as
//! blocks of cells that are farther from the surface than their own size are skipped.
//!
//! Sharp edges come out bevelled by up to a cell. Parts thinner than a cell may be lost.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use crate::mesh::Mesh;

/// Cells a side of the blocks that are visited or skipped as a whole.
const BLOCK: usize = 8;
/// Most cells along a side of the box.
const MOST_CELLS: f64 = 2048.0;
/// Vertices keep this part of their edge off the grid's nodes, so that no face is degenerate where
/// the surface passes through a node.
const OFF_NODE: f64 = 1e-3;
/// Distance from the surface at which a vertex is on it, mm.
const EXACT: f64 = 1e-7;
/// Corners of a cell in the order in which each tetrahedron meets them: bits 0, 1 and 2 of a corner
/// are its steps along x, y and z. The odd permutations of the axes are in the second half.
const TETRAHEDRA: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 1, 5, 7], [0, 2, 3, 7], [0, 4, 6, 7]];

/// A grid edge: its lower node times 8, plus the steps along x, y and z as bits.
type Edge = u64;

/// The zero level of `field` inside the box `bounds`, in cells of `cell` mm (raised, if need be, to
/// 1/2048 of the box's longest side).
pub(crate) fn isosurface(
    field: &(impl Fn(&Point3<f64>) -> f64 + Sync + ?Sized),
    bounds: [Point3<f64>; 2],
    cell: f64,
) -> Mesh {
    let grid = Grid::new(bounds, cell);
    let faces: Vec<[Edge; 3]> =
        (0..grid.block_count()).into_par_iter().flat_map_iter(|block| grid.march(field, block)).collect();
    let mut edges: Vec<Edge> = faces.iter().flatten().copied().collect();
    edges.par_sort_unstable();
    edges.dedup();
    let index = |edge: Edge| edges.partition_point(|&other| other < edge) as u32;
    Mesh {
        faces: faces.par_iter().map(|face| face.map(index)).collect(),
        vertices: edges.par_iter().map(|&edge| grid.crossing(field, edge)).collect(),
    }
}

struct Grid {
    origin: Point3<f64>,
    cell: f64,
    /// Blocks along each axis.
    blocks: [usize; 3],
}

impl Grid {
    fn new([low, high]: [Point3<f64>; 2], cell: f64) -> Self {
        let cell = cell.max((high - low).max() / MOST_CELLS);
        // The uneven margins keep the planes of symmetry of a shape off the grid's nodes.
        let origin = low - cell * Vector3::new(1.137, 1.271, 1.419);
        let blocks = |side: f64| ((side / cell + 3.0) / BLOCK as f64).ceil() as usize;
        let sides = high - low;
        Self { origin, cell, blocks: [blocks(sides.x), blocks(sides.y), blocks(sides.z)] }
    }

    fn block_count(&self) -> usize {
        self.blocks.iter().product()
    }

    fn position(&self, node: [usize; 3]) -> Point3<f64> {
        self.origin + self.cell * Vector3::from(node.map(|i| i as f64))
    }

    /// Nodes along x and y, for numbering.
    fn strides(&self) -> [usize; 2] {
        [self.blocks[0] * BLOCK + 1, self.blocks[1] * BLOCK + 1]
    }

    fn edge(&self, [i, j, k]: [usize; 3], steps: usize) -> Edge {
        let [x, y] = self.strides();
        (((k * y + j) * x + i) * 8 + steps) as Edge
    }

    /// The two ends of an edge.
    fn ends(&self, edge: Edge) -> [Point3<f64>; 2] {
        let [x, y] = self.strides();
        let (node, steps) = (edge as usize / 8, edge as usize % 8);
        let from = [node % x, node / x % y, node / (x * y)];
        [self.position(from), self.position(step(from, steps))]
    }

    /// Faces in a block of cells, as the edges on which their corners lie.
    fn march(&self, field: &(impl Fn(&Point3<f64>) -> f64 + ?Sized), block: usize) -> Vec<[Edge; 3]> {
        const NODES: usize = BLOCK + 1;
        let [nx, ny, _] = self.blocks;
        let base = [block % nx, block / nx % ny, block / (nx * ny)].map(|b| b * BLOCK);
        let half = 0.5 * BLOCK as f64 * self.cell;
        let centre = self.position(base) + Vector3::repeat(half);
        let mut faces = Vec::new();
        if field(&centre).abs() > 1.001 * half * 3.0_f64.sqrt() {
            return faces;
        }
        let mut inside = [[[false; NODES]; NODES]; NODES];
        for (k, plane) in inside.iter_mut().enumerate() {
            for (j, row) in plane.iter_mut().enumerate() {
                // The sign cannot change nearer than the value, so the nodes up to there need no call.
                let (mut negative, mut safe) = (false, -1.0);
                for (i, node) in row.iter_mut().enumerate() {
                    if i as f64 * self.cell >= safe {
                        let value = field(&self.position([base[0] + i, base[1] + j, base[2] + k]));
                        negative = value < 0.0;
                        safe = i as f64 * self.cell + 0.999 * value.abs();
                    }
                    *node = negative;
                }
            }
        }
        for cell in 0..BLOCK * BLOCK * BLOCK {
            let [i, j, k] = [cell % BLOCK, cell / BLOCK % BLOCK, cell / (BLOCK * BLOCK)];
            let corners: [bool; 8] = std::array::from_fn(|c| {
                let [x, y, z] = step([i, j, k], c);
                inside[z][y][x]
            });
            if corners.iter().all(|&c| c == corners[0]) {
                continue;
            }
            let node = [base[0] + i, base[1] + j, base[2] + k];
            let edge = |a: usize, b: usize| self.edge(step(node, a & b), a ^ b);
            for (number, tetrahedron) in TETRAHEDRA.iter().enumerate() {
                cut(*tetrahedron, number >= 3, &corners, |[a, b, c]| {
                    faces.push([edge(a.0, a.1), edge(b.0, b.1), edge(c.0, c.1)]);
                });
            }
        }
        faces
    }

    /// Where the surface crosses an edge: regula falsi, the stale end's value halved (Illinois).
    fn crossing(&self, field: &(impl Fn(&Point3<f64>) -> f64 + ?Sized), edge: Edge) -> Point3<f64> {
        let [from, to] = self.ends(edge);
        let along = |t: f64| from + t * (to - from);
        let (mut a, mut b) = (0.0, 1.0);
        let (mut fa, mut fb) = (field(&from), field(&to));
        let mut t = 0.5;
        for _ in 0..40 {
            t = if fa == fb { 0.5 * (a + b) } else { (a * fb - b * fa) / (fb - fa) };
            let ft = field(&along(t));
            if ft.abs() < EXACT || b - a < 1e-12 {
                break;
            }
            if (ft < 0.0) == (fa < 0.0) {
                (a, fa) = (t, ft);
                fb *= 0.5;
            } else {
                (b, fb) = (t, ft);
                fa *= 0.5;
            }
        }
        along(t.clamp(OFF_NODE, 1.0 - OFF_NODE))
    }
}

/// The node `steps` away, a bit an axis.
fn step([i, j, k]: [usize; 3], steps: usize) -> [usize; 3] {
    [i + (steps & 1), j + (steps >> 1 & 1), k + (steps >> 2)]
}

/// Gives the faces of one tetrahedron to `emit`, each corner as the edge between two corners of the
/// cell. `odd` says that the corners run the left-handed way round.
fn cut(mut corners: [usize; 4], odd: bool, inside: &[bool; 8], mut emit: impl FnMut([(usize, usize); 3])) {
    let count = corners.iter().filter(|&&c| inside[c]).count();
    // Corners inside first. An insertion sort, as its exchanges tell the handedness.
    let mut flipped = odd;
    for end in 1..4 {
        for i in (0..end).rev() {
            if inside[corners[i + 1]] && !inside[corners[i]] {
                corners.swap(i, i + 1);
                flipped = !flipped;
            }
        }
    }
    if flipped {
        let pair = if count == 3 { 0 } else { 2 };
        corners.swap(pair, pair + 1);
    }
    let [a, b, c, d] = corners;
    match count {
        1 => emit([(a, b), (a, c), (a, d)]),
        2 => {
            emit([(a, c), (a, d), (b, d)]);
            emit([(a, c), (b, d), (b, c)]);
        }
        3 => emit([(a, d), (b, d), (c, d)]),
        _ => {}
    }
}
