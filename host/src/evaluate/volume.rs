//! Volumes of closed meshes and how far they overlap.
//!
//! In: closed meshes. Out: the part that both hold of what either holds, on a grid over both boxes. A
//! cell counts as inside if the line through its centre along z has crossed the surface inwards more
//! often than outwards. Each triangle is drawn on to the columns of cells that it covers, so that no
//! search is needed. Cost: O(faces + cells + columns covered).

use nalgebra::{Matrix3, Point3, Vector3};

use super::bounds;
use crate::mesh::Mesh;

/// Shift of the columns in parts of a cell, which keeps them off edges that follow the grid.
const SHIFT: [f64; 2] = [1.37e-4, 2.11e-4];

/// Volume, mm^3; negative for a mesh turned inside out.
pub(super) fn signed(mesh: &Mesh) -> f64 {
    let origin = bounds(mesh)[0];
    let corners = |face: &[u32; 3]| face.map(|v| mesh.vertices[v as usize] - origin);
    mesh.faces.iter().map(|face| Matrix3::from_columns(&corners(face)).determinant()).sum::<f64>() / 6.0
}

/// Intersection over union of two volumes on `cells`^3 cells; 0 if no cell is inside either.
pub(super) fn iou(a: &Mesh, b: &Mesh, cells: usize) -> f64 {
    let [low, high] = [bounds(a), bounds(b)]
        .into_iter()
        .reduce(|x, y| [x[0].inf(&y[0]), x[1].sup(&y[1])])
        .unwrap_or_default();
    let pad = (high - low) * 0.01 + Vector3::repeat(1e-3);
    let grid = Grid { low: low - pad, cell: (high - low + 2.0 * pad) / cells as f64, cells };
    let (a, b) = (grid.occupancy(a), grid.occupancy(b));
    let count = |test: fn(bool, bool) -> bool| a.iter().zip(&b).filter(|&(&a, &b)| test(a, b)).count();
    count(|a, b| a && b) as f64 / count(|a, b| a || b).max(1) as f64
}

struct Grid {
    low: Point3<f64>,
    cell: Vector3<f64>,
    cells: usize,
}

impl Grid {
    /// Whether each cell is inside the mesh, columns along z one after the other.
    fn occupancy(&self, mesh: &Mesh) -> Vec<bool> {
        let outward = signed(mesh) >= 0.0;
        // How many times more the surface is entered than left between a cell and the one before.
        let mut steps = vec![0i32; self.cells * self.cells * self.cells];
        for face in &mesh.faces {
            let [a, b, c] = face.map(|v| self.in_cells(&mesh.vertices[v as usize]));
            self.draw(&[a, b, c], |column, z, up| {
                let next = (z.ceil().max(0.0) as usize).min(self.cells);
                if next < self.cells {
                    steps[column * self.cells + next] += if up == outward { -1 } else { 1 };
                }
            });
        }
        let mut inside = Vec::with_capacity(steps.len());
        for column in steps.chunks(self.cells.max(1)) {
            inside.extend(column.iter().scan(0, |depth, step| {
                *depth += step;
                Some(*depth > 0)
            }));
        }
        inside
    }

    /// Coordinates in which cell centres, in the columns' case shifted ones, are integers.
    fn in_cells(&self, point: &Point3<f64>) -> Vector3<f64> {
        (point - self.low).component_div(&self.cell) - Vector3::new(0.5 + SHIFT[0], 0.5 + SHIFT[1], 0.5)
    }

    /// Calls `cross` for each column that a triangle covers, with the height at which it does and
    /// whether its normal points up. A column on an edge belongs to one of the edge's two faces.
    fn draw(&self, [a, b, c]: &[Vector3<f64>; 3], mut cross: impl FnMut(usize, f64, bool)) {
        let normal = (b - a).cross(&(c - a));
        let (low, high) = (a.inf(b).inf(c), a.sup(b).sup(c));
        // The conversions clip below zero; a triangle between two columns gives an empty range.
        let range =
            |low: f64, high: f64| low.ceil() as usize..((high + 1.0).floor() as usize).min(self.cells);
        for x in range(low.x, high.x) {
            for y in range(low.y, high.y) {
                let left = |p: &Vector3<f64>, q: &Vector3<f64>| {
                    let (px, py, qx, qy) = (p.x - x as f64, p.y - y as f64, q.x - x as f64, q.y - y as f64);
                    let side = px * qy - py * qx;
                    side > 0.0 || (side == 0.0 && (px, py) < (qx, qy))
                };
                if left(a, b) == left(b, c) && left(b, c) == left(c, a) && normal.z != 0.0 {
                    let slope = normal.x * (x as f64 - a.x) + normal.y * (y as f64 - a.y);
                    cross(x * self.cells + y, a.z - slope / normal.z, normal.z > 0.0);
                }
            }
        }
    }
}
