//! The visible side, measured: where the grey levels of both images tell the depth of the surface that both eyes see,
//! it is moved there from where balls put it.
//!
//! * **In**: a closed mesh in rectified axes, mm, both rectified images, and the masks of the object in them.
//! * **Out**: the same faces, with their vertices moved along the rays of the left eye, and how much is known of each.
//! * **The back** is not seen and stays as balls have it, but for a little where one limb hides another. So does the
//!   left outline, which is measured already.
//! * **Promise**: the mesh stays closed and manifold; the same bits for any number of threads.
//! * **Cost**: about the pixels of the object, some thousand operations each.
//!
//! `raster.rs` says how far the model is along each ray, `lattice.rs` puts nodes on it, `picture.rs` and `stereo.rs`
//! compare the eyes there, `field.rs` finds how far each node moves (`system.rs` solves) and where that is to be
//! trusted (with `light.rs`), `warp.rs` moves the mesh, and `confidence.rs` says how well it is known.

mod confidence;
mod field;
mod lattice;
mod light;
mod picture;
mod pool;
mod raster;
mod stereo;
mod system;
mod warp;

use super::rectify::RectifiedCamera;
use crate::mesh::Mesh;
use field::Scene;
use image::GrayImage;
use lattice::rim;
use light::highlights;
use nalgebra::Point3;
use picture::Picture;
pub use pool::Pool;
use pool::{Lent, Shelf};
use raster::{Depths, Frame};
use shared::bitmap::Bitmap;
use stereo::{FULL, View, spread};
use warp::warp;

/// Pixels around the object that are looked at as well.
const AROUND: i32 = 12;
/// Distances to the outline matter up to here, px.
const REACH: usize = 8;

/// A rectified pair and what is known of it.
#[derive(Debug)]
pub struct Sight<'a> {
    /// Left and right image.
    pub images: [&'a GrayImage; 2],
    /// The object in them.
    pub masks: [Bitmap<'a>; 2],
    /// What their pixels mean.
    pub camera: &'a RectifiedCamera,
    /// Right less left row of the same point, px.
    pub rows: f64,
}

/// What was measured.
#[derive(Clone, Debug)]
pub struct Measured {
    /// How well each vertex of the mesh is known, 0 to 1.
    pub confidence: Vec<f64>,
    /// Part of the left view of the object whose depth both eyes tell better than balls.
    pub share: f64,
    /// Part of it that was not trusted and left to balls.
    pub distrusted: f64,
    /// Standard deviation of a grey level.
    pub noise: f64,
    /// Standard deviation of the difference between the eyes, grey levels: on the balls, and on what was measured.
    pub residuals: [f64; 2],
    /// What the right eye's grey levels are multiplied by to become those of the left one.
    pub gain: f64,
    /// What is added to them then.
    pub offset: f64,
    /// Right less left row of the same point, px.
    pub rows: f64,
}

/// Move the visible side of `mesh` to where both eyes see it: everywhere, or, if it is `gated`, where the grey levels
/// are to be trusted. The memory is the pool's.
#[must_use]
pub fn measure(pool: &Pool, mesh: &mut Mesh, sight: &Sight<'_>, gated: bool) -> Measured {
    let images = [0, 1].map(|eye| project(pool, mesh, sight.camera, eye));
    let views =
        [0, 1].map(|eye| view(pool, mesh, &images[eye], (sight.images[eye], &sight.masks[eye]), gated));
    let left = &views[0];
    let on = |(near, rim): (&f64, &f64)| near.is_finite() && *rim > 0.0;
    let object = pool.flags.of(left.depths.near.iter().zip(left.rim.levels.iter()).map(on));
    let (camera, rows, noise) = (sight.camera, sight.rows, noise(pool, left));
    let field =
        field::measure(&Scene { pool, mesh, views: &views, camera, object: &object, noise, rows, gated });

    let lattice = &field.lattice;
    let change =
        pool.numbers.of(lattice.unit.iter().zip(field.moved.iter()).map(|(unit, moved)| unit * moved));
    let behind =
        warp(&pool.numbers, mesh, &images[0], &left.depths, |at| lattice.look_up(&change, at).unwrap_or(0.0));
    let share = |has: &dyn Fn(usize) -> bool| {
        lattice.nodes().filter(|&node| has(node)).count() as f64 / lattice.nodes().count().max(1) as f64
    };
    Measured {
        confidence: confidence::of_vertices(pool, mesh, (&field, camera), &images[0], &behind).keep(),
        share: share(&|node| field.is_measured(node)),
        distrusted: share(&|node| field.held[node]),
        noise,
        residuals: field.spreads,
        gain: field.response.gain,
        offset: field.response.offset,
        rows: field.response.rows,
    }
}

/// Column, row and 1 / depth of each vertex in an eye.
fn project<'p>(pool: &'p Pool, mesh: &Mesh, camera: &RectifiedCamera, eye: usize) -> Lent<'p, [f64; 3]> {
    let seen = |vertex: &Point3<f64>| {
        let image = camera.project(vertex).map(|views| [views[eye].x, views[eye].y, 1.0 / vertex.z]);
        image.unwrap_or([f64::NAN; 3])
    };
    pool.images.of(mesh.vertices.iter().map(seen))
}

/// What an eye sees around the object, and if it is `gated` what shines there.
fn view<'p>(
    pool: &'p Pool,
    mesh: &Mesh,
    images: &[[f64; 3]],
    (image, mask): (&GrayImage, &Bitmap<'_>),
    gated: bool,
) -> View<'p> {
    let size = [image.width() as i32, image.height() as i32];
    let side = |axis: usize| {
        let all = || images.iter().map(|image| image[axis]);
        let low = all().fold(f64::INFINITY, f64::min).floor() as i32;
        let high = all().fold(f64::NEG_INFINITY, f64::max).ceil() as i32;
        let low = low.saturating_sub(AROUND).clamp(0, (size[axis] - 2).max(0));
        let high = high.saturating_add(AROUND).max(low + 1).min(size[axis] - 1);
        (low, (high - low + 1) as usize)
    };
    let ((u, width), (v, height)) = (side(0), side(1));
    let frame = Frame { corner: [u, v], width, height };
    let level = |[u, v]: [i32; 2]| f64::from(image.get_pixel(u as u32, v as u32).0[0]);
    let picture = Picture { frame, levels: pool.numbers.of(frame.pixels().map(level)) };
    let inside = pool.flags.of(frame.pixels().map(|[u, v]| mask.get(u, v)));
    let rim = rim(&pool.numbers, &inside, width, REACH);
    let numbers = &pool.numbers;
    let mut view = View {
        depths: Depths::of(pool, mesh, images, frame),
        core: ones(numbers, rim.iter().map(|&rim| rim > 1.0)),
        rim: Picture { frame, levels: rim },
        full: Picture { frame, levels: ones(numbers, picture.levels.iter().map(|&level| level >= FULL)) },
        shines: Picture { frame, levels: numbers.filled(0.0, picture.levels.len()) },
        picture,
    };
    if gated {
        view.shines.levels = ones(numbers, highlights(pool, &view, mesh).iter().copied());
    }
    view
}

/// 1 for what is set, else 0.
fn ones<'p>(shelf: &'p Shelf<f64>, set: impl Iterator<Item = bool>) -> Lent<'p, f64> {
    shelf.of(set.map(|set| f64::from(u8::from(set))))
}

/// The standard deviation of a grey level, from the background around the object.
fn noise(pool: &Pool, view: &View<'_>) -> f64 {
    let Frame { width, .. } = view.picture.frame;
    let outside = pool.flags.of(view.rim.levels.iter().map(|&rim| rim == 0.0));
    let far = rim(&pool.numbers, &outside, width, 6);
    let levels = &view.picture.levels;
    let deviation = |place: usize| {
        let around =
            [place - width, place, place + width].map(|row| levels[row - 1] + levels[row] + levels[row + 1]);
        levels[place] - around.iter().sum::<f64>() / 9.0
    };
    let inner = |place: &usize| far[*place] >= 5.0 && *place > width && *place + width + 1 < levels.len();
    // The mean has a ninth of the level itself.
    spread(&pool.numbers, (0..levels.len()).filter(inner).map(deviation)) * 3.0 / 8.0_f64.sqrt()
}
