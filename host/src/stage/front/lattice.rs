//! A lattice of nodes over the object in the left image, and what the ball model says at each.
//!
//! * **In**: the depths of the model's first stretch along each left ray, and the mask of the left view.
//! * **Out**: one node a square of `step` px, with the means over the pixels of the square that both hold; and the
//!   stencils of second differences, none across a jump in depth.
//! * **Cost**: the pixels of the frame.

use super::pool::{Lent, Pool, Shelf};
use super::raster::Depths;
use super::system::MARGIN;

/// Where the surface falls away from the eye more steeply than this, in mm a mm across, it is taken for a jump.
const STEEPEST: f64 = 5.2;
/// So near the outline the surface turns away without a jump, px.
pub(super) const RIM: f64 = 3.0;
/// Least half thickness, mm.
const THINNEST: f64 = 0.3;
/// What is added to the half thickness by which displacements are measured, so that the rim can move too, mm.
const SOFT: f64 = 1.5;

/// A second difference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stencil {
    /// Of three nodes in a row, by the middle one.
    Along(usize),
    /// Of three nodes in a column, by the middle one.
    Down(usize),
    /// Of four nodes in a square, by the upper left one.
    Twist(usize),
}

/// The lattice.
#[derive(Debug)]
pub(super) struct Lattice<'p> {
    /// Side of a square, px.
    pub(super) step: usize,
    /// Nodes in a row, margins included.
    pub(super) width: usize,
    /// Whether a node lies on the object; what follows is meaningful there alone.
    pub(super) on: Lent<'p, bool>,
    /// Image of the node, px.
    pub(super) at: Lent<'p, [f64; 2]>,
    /// Depth of the model's front, mm.
    pub(super) depth: Lent<'p, f64>,
    /// Half of the model's thickness, mm.
    pub(super) half: Lent<'p, f64>,
    /// Distance to the outline, px, up to the reach of `rim`.
    pub(super) rim: Lent<'p, f64>,
    /// Change of ln depth by a displacement of 1.
    pub(super) unit: Lent<'p, f64>,
    pub(super) stencils: Lent<'p, Stencil>,
    corner: [i32; 2],
}

impl<'p> Lattice<'p> {
    /// The lattice of squares of `step` px over the pixels of `object`, which have `rim` px to the outline.
    pub(super) fn new(
        pool: &'p Pool,
        step: usize,
        depths: &Depths<'_>,
        (object, rim): (&[bool], &[f64]),
        focal: f64,
    ) -> Self {
        let frame = depths.frame;
        let [columns, rows] = [frame.width, frame.height].map(|side| side.div_ceil(step));
        let width = columns + 2 * MARGIN;
        let nodes = width * (rows + 2 * MARGIN);
        let zeros = || pool.numbers.filled(0.0, nodes);
        let mut count = pool.places.filled(0, nodes);
        let mut at = pool.pixels.filled([0.0; 2], nodes);
        let (mut depth, mut half, mut rims) = (zeros(), zeros(), zeros());
        for (place, [u, v]) in frame.pixels().enumerate().filter(|(place, _)| object[*place]) {
            let node = (place / frame.width / step + MARGIN) * width + place % frame.width / step + MARGIN;
            count[node] += 1;
            at[node][0] += f64::from(u);
            at[node][1] += f64::from(v);
            depth[node] += depths.near[place];
            half[node] += (depths.far[place] - depths.near[place]) / 2.0;
            rims[node] += rim[place];
        }
        // The finest lattice knows its object to the pixel; coarser ones lead to it and may reach beyond.
        let least = if step <= 2 { step * step } else { step * step / 2 };
        let mut unit = zeros();
        (0..nodes).for_each(|node| {
            let pixels = count[node].max(1) as f64;
            at[node] = at[node].map(|sum| sum / pixels);
            depth[node] /= pixels;
            half[node] = (half[node] / pixels).max(THINNEST);
            rims[node] /= pixels;
            unit[node] = libm::hypot(half[node], SOFT) / depth[node].max(f64::MIN_POSITIVE);
        });
        let on = pool.flags.of(count.iter().map(|&count| count >= least));
        let stencils = stencils(&pool.stencils, width, (&on, &depth, &rims), STEEPEST * step as f64 / focal);
        Self { step, width, on, at, depth, half, rim: rims, unit, stencils, corner: frame.corner }
    }

    /// The nodes on the object.
    pub(super) fn nodes(&self) -> impl Iterator<Item = usize> {
        (0..self.on.len()).filter(|&node| self.on[node])
    }

    /// Pixels of a node's square, in those of the finest lattice.
    pub(super) fn area(&self) -> f64 {
        (self.step * self.step) as f64 / 4.0
    }

    /// The sums over the nodes around each, up to `reach` away in both directions.
    pub(super) fn sums_around(&self, values: &[f64], reach: usize) -> Lent<'p, f64> {
        let (width, rows) = (self.width, self.on.len() / self.width);
        let span = |k: usize, length: usize| k.saturating_sub(reach)..(k + reach + 1).min(length);
        let place = |k: usize| (k / width, k % width);
        let across = |k: usize| {
            let (row, column) = place(k);
            span(column, width).map(|column| values[row * width + column]).sum()
        };
        let sums = self.depth.shelf().of((0..values.len()).map(across));
        let down = |k: usize| {
            let (row, column) = place(k);
            span(row, rows).map(|row| sums[row * width + column]).sum()
        };
        self.depth.shelf().of((0..values.len()).map(down))
    }

    /// What nodes have, at a place of the image: bilinear between those on the object, or the mean of the nearest
    /// ones; none more than three squares away from all.
    pub(super) fn look_up(&self, values: &[f64], [u, v]: [f64; 2]) -> Option<f64> {
        let middle = (self.step as f64 - 1.0) / 2.0;
        let along = |x: f64, corner: i32| (x - f64::from(corner) - middle) / self.step as f64 + MARGIN as f64;
        let (x, y) = (along(u, self.corner[0]), along(v, self.corner[1]));
        let rows = self.on.len() / self.width;
        mean_near([x, y], [self.width, rows], |place| self.on[place].then(|| values[place]))
    }
}

/// The bilinear mean at a place of a raster, of the values that there are; of the first ring around that has any if
/// there is none; none beyond three pixels, nor at a place that is no number.
pub(super) fn mean_near(
    [x, y]: [f64; 2],
    [width, height]: [usize; 2],
    value: impl Fn(usize) -> Option<f64>,
) -> Option<f64> {
    if !x.is_finite() || !y.is_finite() {
        return None;
    }
    let (column, row) = (x.floor() as i32, y.floor() as i32);
    let (s, t) = (x - f64::from(column), y - f64::from(row));
    for reach in 0..=3 {
        let (mut sum, mut total) = (0.0, 0.0);
        let around = |middle: i32| middle.saturating_sub(reach)..=middle.saturating_add(1 + reach);
        for j in around(row) {
            for i in around(column) {
                if i < 0 || j < 0 || i as usize >= width || j as usize >= height {
                    continue;
                }
                let Some(value) = value(j as usize * width + i as usize) else { continue };
                let weight = if reach == 0 {
                    (if i == column { 1.0 - s } else { s }) * (if j == row { 1.0 - t } else { t })
                } else {
                    1.0
                };
                sum += weight * value;
                total += weight;
            }
        }
        if total > 1e-6 {
            return Some(sum / total);
        }
    }
    None
}

/// The second differences of nodes on the object whose depths differ by no more than `steepest` of the depth from
/// one to the next.
fn stencils<'p>(
    shelf: &'p Shelf<Stencil>,
    width: usize,
    (on, depth, rim): (&[bool], &[f64], &[f64]),
    steepest: f64,
) -> Lent<'p, Stencil> {
    let near = |a: usize, b: usize| on[a] && on[b] && (depth[a] - depth[b]).abs() < steepest * depth[a];
    let mut stencils = shelf.empty(3 * on.len());
    for node in (0..on.len()).filter(|&node| on[node]) {
        if near(node - 1, node) && near(node, node + 1) {
            stencils.push(Stencil::Along(node));
        }
        if near(node - width, node) && near(node, node + width) {
            stencils.push(Stencil::Down(node));
        }
        let square = [node, node + 1, node + width, node + width + 1];
        if square.iter().all(|&corner| on[corner]) {
            let depths = square.map(|corner| depth[corner]);
            let [low, high] = [
                depths.iter().copied().fold(f64::INFINITY, f64::min),
                depths.iter().copied().fold(0.0, f64::max),
            ];
            let at_rim = (rim[square[0]] + rim[square[3]]) / 2.0 < RIM;
            if high - low < steepest * depth[node] || at_rim {
                stencils.push(Stencil::Twist(node));
            }
        }
    }
    stencils
}

/// Distance of each pixel to the nearest one that is not set, px, up to `reach`; all outside the frame is unset.
pub(super) fn rim<'p>(shelf: &'p Shelf<f64>, set: &[bool], width: usize, reach: usize) -> Lent<'p, f64> {
    let height = set.len() / width.max(1);
    let most = reach as f64;
    let mut down = shelf.filled(0.0, set.len());
    for u in 0..width {
        for v in (0..height).filter(|v| set[v * width + u]) {
            let clear = |distance: &usize| {
                let above = v.checked_sub(*distance).is_none_or(|row| !set[row * width + u]);
                above || v + distance >= height || !set[(v + distance) * width + u]
            };
            down[v * width + u] = (1..reach).find(clear).map_or(most, |distance| distance as f64);
        }
    }
    let nearest = |place: usize| {
        let (row, u) = (place - place % width, place % width);
        let square = |du: i64| {
            let column = u as i64 + du;
            let inside = column >= 0 && column < width as i64;
            let below = if inside { down[row + column as usize] } else { 0.0 };
            below * below + (du * du) as f64
        };
        let reach = reach as i64;
        if set[place] { (-reach..=reach).map(square).fold(most * most, f64::min).sqrt() } else { 0.0 }
    };
    shelf.of((0..set.len()).map(nearest))
}
