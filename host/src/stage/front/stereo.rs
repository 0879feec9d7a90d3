//! How well both eyes agree on a surface: grey levels of the left image against those of the right one where the
//! surface would be seen there.
//!
//! * **In**: both images with their masks, and a lattice over the left object.
//! * **Out**: for each node that both eyes see, the residual I_L - g I_R - o in grey levels and its slope by
//!   displacement. Gain g, offset o and what is left of a vertical offset between the eyes are fitted along the way.
//! * **Visible** is what the right eye sees of the ball model: nothing nearer on its ray, not too slanted, and no
//!   nearer than 1.5 px to either outline.
//! * **Cost**: a few look-ups a node.

use super::field::Scene;
use super::lattice::Lattice;
use super::picture::Picture;
use super::pool::{Lent, Shelf};
use super::raster::{Depths, NOTHING};
use nalgebra::{Matrix3, Vector3};

/// What may lie before a point without hiding it, as a part of its depth.
const BEHIND: f64 = 0.011;
/// Cosine of the most slanted surface that is compared.
const SLANTED: f64 = 0.12;
/// Distance from both outlines, px: nearer, the background is mixed in.
const CLEAR: f64 = 1.5;
/// Half of the distance over which slopes of the images are measured, px.
const SLOPE: f64 = 0.75;
/// Grey levels from here on say nothing: the sensor was full.
pub(super) const FULL: f64 = 252.0;

/// What one eye sees.
#[derive(Debug)]
pub(super) struct View<'p> {
    /// The image as it is.
    pub(super) picture: Picture<'p>,
    /// The ball model's depths in it.
    pub(super) depths: Depths<'p>,
    /// 1 where a pixel and its neighbours are the object's, else 0: the weights of a blur.
    pub(super) core: Lent<'p, f64>,
    /// Distance to the outline, px.
    pub(super) rim: Picture<'p>,
    /// 1 where the sensor was full, else 0.
    pub(super) full: Picture<'p>,
    /// 1 where a highlight may spoil what is seen, else 0; 0 everywhere unless they were looked for.
    pub(super) shines: Picture<'p>,
}

/// How the right image answers the left one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Response {
    pub(super) gain: f64,
    /// Grey levels.
    pub(super) offset: f64,
    /// Right less left row, px.
    pub(super) rows: f64,
}

/// A node that both eyes see.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    pub(super) node: usize,
    /// Grey levels in both images.
    left: f64,
    right: f64,
    /// Slopes of the right image, grey levels a px.
    slopes: [f64; 2],
    /// Disparity f B / z, px.
    shift: f64,
    /// Whether it is of use: inside both outlines, and neither sensor full nor spoilt by a highlight.
    pub(super) counts: bool,
}

impl Seen {
    /// Residual, grey levels.
    pub(super) fn residual(&self, response: &Response) -> f64 {
        self.left - response.gain * self.right - response.offset
    }

    /// Its slope by the displacement of a node whose `unit` this is.
    pub(super) fn slope(&self, response: &Response, unit: f64) -> f64 {
        -response.gain * self.slopes[0] * self.shift * unit
    }
}

/// The nodes that both eyes see on the ball model.
pub(super) fn visible<'p>(lattice: &Lattice<'p>, scene: &Scene<'_, 'p>) -> Lent<'p, usize> {
    let Scene { mesh, views: [left, right], camera, .. } = scene;
    let pixel = |x: f64| x.round() as i32;
    let sees = |&node: &usize| {
        let ([u, v], depth) = (lattice.at[node], lattice.depth[node]);
        let column = u - camera.disparity(depth);
        let hidden = |place: usize| right.depths.near[place] < depth * (1.0 - BEHIND);
        let behind = right.depths.frame.place(pixel(column), pixel(v)).is_none_or(hidden);
        let face =
            left.depths.frame.place(pixel(u), pixel(v)).map_or(NOTHING, |place| left.depths.face[place]);
        let at_rim = lattice.rim[node] <= CLEAR || right.rim.at(column, v + scene.rows) <= CLEAR;
        if behind || face == NOTHING || at_rim {
            return false;
        }
        let to_right = camera.ray(u, v) * depth - Vector3::x() * camera.baseline_mm;
        let normal = mesh.area_normal(face as usize);
        -normal.dot(&to_right) > SLANTED * normal.norm() * to_right.norm()
    };
    scene.pool.places.of(lattice.nodes().filter(sees))
}

/// Look nodes up in both images, where displacements put them.
pub(super) fn look<'p>(
    lattice: &Lattice<'p>,
    visible: &[usize],
    [left, right]: &[Picture<'p>; 2],
    scene: &Scene<'_, 'p>,
    (moved, response): (&[f64], &Response),
) -> Lent<'p, Seen> {
    let Scene { views, camera, .. } = scene;
    let spoilt = |view: &View<'_>, u: f64, v: f64| view.full.at(u, v) > 0.1 || view.shines.at(u, v) > 0.1;
    let seen = |&node: &usize| {
        let [u, v] = lattice.at[node];
        let depth = lattice.depth[node] * libm::exp(moved[node] * lattice.unit[node]);
        let (column, row) = (u - camera.disparity(depth), v + response.rows);
        let across = right.at(column + SLOPE, row) - right.at(column - SLOPE, row);
        let down = right.at(column, row + SLOPE) - right.at(column, row - SLOPE);
        let inside = views[1].rim.at(column, row) > CLEAR;
        Seen {
            node,
            left: left.at(u, v),
            right: right.at(column, row),
            slopes: [across, down].map(|difference| difference / (2.0 * SLOPE)),
            shift: camera.f * camera.baseline_mm / depth,
            counts: inside && !spoilt(&views[0], u, v) && !spoilt(&views[1], column, row),
        }
    };
    scene.pool.seen.of(visible.iter().map(seen))
}

/// Rounds of reweighting.
const ROUNDS: usize = 4;
/// Farthest from 1 that a gain goes, as a factor.
const MOST_GAIN: f64 = 4.0;
/// What the rows may be moved by at a time, and from what is known of them, px.
const MOST_ROWS: [f64; 2] = [0.1, 0.75];
/// How firmly the gain stays at 1, the offset at 0 and the rows as they are: so many pixels of slope 1 would say so.
const FIRM: [f64; 3] = [100.0, 1.0, 50.0];

/// The response that explains most of what was seen, from one near it.
pub(super) fn respond(shelf: &Shelf<f64>, seen: &[Seen], from: Response, known_rows: f64) -> Response {
    let used = || seen.iter().filter(|seen| seen.counts);
    let mut best = from;
    let mut moved = 0.0;
    for _ in 0..ROUNDS {
        let model = |seen: &Seen| seen.left - best.gain * (seen.right + moved * seen.slopes[1]) - best.offset;
        let scale = 2.0 * spread(shelf, used().map(model)).max(0.3);
        let mut normal = Matrix3::from_diagonal(&FIRM.into());
        let mut right = Vector3::new(FIRM[0], 0.0, 0.0);
        for seen in used() {
            let weight = 1.0 / (1.0 + (model(seen) / scale).powi(2));
            let slopes = Vector3::new(seen.right, 1.0, best.gain * seen.slopes[1]);
            normal += weight * slopes * slopes.transpose();
            right += weight * seen.left * slopes;
        }
        let Some(solved) = normal.cholesky().map(|factors| factors.solve(&right)) else { return from };
        best.gain = solved[0].clamp(MOST_GAIN.recip(), MOST_GAIN);
        moved = solved[2].clamp(-MOST_ROWS[0], MOST_ROWS[0]);
        // The offset that suits what was clamped.
        best.offset = (right[1] - normal[(1, 0)] * best.gain - normal[(1, 2)] * moved) / normal[(1, 1)];
    }
    best.rows = (from.rows + moved).clamp(known_rows - MOST_ROWS[1], known_rows + MOST_ROWS[1]);
    best
}

/// The standard deviation of values around 0, by the median of their sizes; 0 without any.
pub(super) fn spread(shelf: &Shelf<f64>, values: impl Iterator<Item = f64>) -> f64 {
    let mut sizes = shelf.of(values.map(f64::abs));
    if sizes.is_empty() {
        return 0.0;
    }
    let middle = sizes.len() / 2;
    let (_, &mut median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    1.4826 * median
}
