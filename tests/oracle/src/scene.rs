//! Pairs of pictures of the built-in shapes, rendered once, and pairs that are drawn.

use host::calibration::{Camera, Lens, StereoCamera};
use host::reconstruct::{Options, Reconstruction, Refusal, reconstruct};
use host::render::render;
use host::shape::Shape;
use host::view::Pinhole;
use image::{GrayImage, Luma};
use nalgebra::Rotation3;
use std::collections::BTreeMap;
use std::sync::{LazyLock, Mutex, PoisonError};

/// Both images.
pub type Pair = [GrayImage; 2];

/// How much smaller than the cameras of the shapes, 640x480, the pictures are: 1 or 2.
pub type Scale = u32;

/// The calibration of the pictures at a scale.
pub fn camera(scale: Scale) -> StereoCamera {
    StereoCamera::rectified(640 / scale, 480 / scale, 750.0 / f64::from(scale), 60.0)
}

/// The calibration of cameras that see what those of [`camera`] see nearly: their lenses bend, and the right one
/// is turned.
pub fn bent_camera(scale: Scale) -> StereoCamera {
    let straight = camera(scale);
    let mut k = [0.0; 12];
    k[0] = -0.02;
    let lens = Lens::Polynomial(k);
    let turn = Rotation3::from_euler_angles(0.0, 0.004, 0.0);
    StereoCamera {
        left: Camera { lens, ..straight.left },
        right: Camera { lens, ..straight.right },
        rotation: turn.into_inner(),
        translation: turn * straight.translation,
    }
}

/// What both eyes see of a shape; rendered once a process.
pub fn pair(shape: Shape, scale: Scale) -> Pair {
    static SEEN: LazyLock<Mutex<BTreeMap<(&str, Scale), Pair>>> = LazyLock::new(Mutex::default);
    let mut seen = SEEN.lock().unwrap_or_else(PoisonError::into_inner);
    seen.entry((shape.name(), scale)).or_insert_with(|| views(scale).map(|view| see(shape, view))).clone()
}

/// The cameras of the pictures at a scale.
pub fn views(scale: Scale) -> [Pinhole; 2] {
    Pinhole::pair().map(|view| Pinhole {
        size: view.size.map(|side| side / scale),
        focal: view.focal / f64::from(scale),
        principal: [639.0, 479.0].map(|last| ((last + 1.0) / f64::from(scale) - 1.0) / 2.0),
        ..view
    })
}

/// What a camera sees of a shape.
pub fn see(shape: Shape, view: Pinhole) -> GrayImage {
    render(&shape.mesh(1.5 * shape.cell()), &[view]).remove(0)
}

/// A picture of what is inside, bright on dark, each pixel from 16 points of its square.
pub fn draw(width: u32, height: u32, inside: impl Fn(f64, f64) -> bool) -> GrayImage {
    GrayImage::from_fn(width, height, |u, v| {
        let at = |k: u32, i: u32| f64::from(k) + (f64::from(i) + 0.5) / 4.0 - 0.5;
        let covered = (0..16).filter(|i| inside(at(u, i % 4), at(v, i / 4))).count();
        Luma([12 + (covered * 188 / 16) as u8])
    })
}

/// A pair of 320x240 px in which `inside` is seen at a disparity that changes with the row by `slope`.
pub fn drawn_pair(disparity: f64, slope: f64, inside: impl Fn(f64, f64) -> bool) -> Pair {
    let right = |u: f64, v: f64| inside(u + disparity + slope * (v - 119.5), v);
    [draw(320, 240, &inside), draw(320, 240, right)]
}

/// What the right eye sees of a shape when its sensor sits `by` px too high.
pub fn right_moved_down(shape: Shape, scale: Scale, by: f64) -> GrayImage {
    let [_, mut view] = views(scale);
    view.principal[1] += by;
    see(shape, view)
}

/// Reconstruct a pair of pictures of the scale that their size tells.
///
/// # Errors
/// Those of [`reconstruct`].
pub fn model(pair: &Pair, options: &Options) -> Result<Reconstruction, Refusal> {
    let [left, right] = pair.clone();
    let camera = camera(640 / left.width().max(1));
    reconstruct(left, right, &camera, options, &mut ())
}
