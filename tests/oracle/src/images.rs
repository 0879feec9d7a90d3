//! The pictures that speed is measured on: drawn by formulas at any size, and the cases with known truth.
//!
//! Each is a pair as the core gets it, of one object that keeps clear of the border. Lengths in the drawings
//! are those of a picture of 480 rows.

use crate::cases;
use crate::raster::Random;
use crate::scene::Pair;
use host::calibration::StereoCamera;
use host::memory::Storage;
use host::render::Noise;
use host::stage::rectify::Rectification;
use image::{GrayImage, Luma};
use shared::arena::Arena;
use shared::bitmap::{Bitmap, Grey, Size, Word};
use shared::pack::unpack;
use shared::pipeline::{Run, Settings, Side};
use shared::stage::depth::Optics;

/// A picture to measure on.
pub struct Image {
    /// Its name with its size, such as `ring 640x480`.
    pub name: String,
    /// What the cameras gave.
    pub raw: Pair,
    /// Their calibration.
    pub camera: StereoCamera,
    /// The pair as a device rectifies it.
    pub pair: Pair,
    /// What the core has to know of the cameras.
    pub optics: Optics,
    /// The left object's mask, cleaned.
    pub mask: Vec<Word>,
}

/// A drawn object: its signed distance, negative inside, from a point relative to the middle.
pub type Outline = Box<dyn Fn(f64, f64) -> f64>;

/// The drawn objects: a ring, a body with thick limbs, and blobs in noise.
pub const DRAWN: [&str; 3] = ["ring", "limbs", "blobs"];

impl Image {
    /// A pair of pictures with their calibration.
    ///
    /// # Panics
    /// When the core finds no object in the left one.
    pub fn new(name: &str, raw: Pair, camera: StereoCamera) -> Self {
        let (pair, optics) = rectified(&raw, &camera);
        let mask = mask(&pair[0], optics);
        let (width, height) = pair[0].dimensions();
        Self { name: format!("{name} {width}x{height}"), raw, camera, pair, optics, mask }
    }

    /// One of [`DRAWN`].
    ///
    /// # Panics
    /// When there is none of this name.
    pub fn drawn(name: &str, width: u32, height: u32) -> Self {
        let outline: Outline = match name {
            "ring" => Box::new(ring),
            "limbs" => Box::new(limbs),
            "blobs" => blobs(),
            _ => panic!("nothing is drawn by the name of {name}"),
        };
        let noise = Noise { sigma: 20.0, salt_and_pepper: 0.02, seed: 0 };
        Self::of(name, (width, height), &*outline, (name == "blobs").then_some(noise))
    }

    /// A flat object, a sixteenth of the width nearer to the left in the right picture.
    pub fn of(
        name: &str,
        (width, height): (u32, u32),
        outline: &dyn Fn(f64, f64) -> f64,
        noise: Option<Noise>,
    ) -> Self {
        let scale = f64::from(height) / 480.0;
        let disparity = f64::from(width) / 16.0;
        let raw = [(0.0, 1), (disparity, 2)].map(|(moved, seed)| {
            let mut image = GrayImage::from_fn(width, height, |u, v| {
                let x = f64::from(u) + moved - (f64::from(width) + disparity) / 2.0;
                let y = f64::from(v) - f64::from(height) / 2.0;
                let covered = (0.5 - scale * outline(x / scale, y / scale)).clamp(0.0, 1.0);
                Luma([12 + (188.0 * covered) as u8])
            });
            if let Some(noise) = noise {
                Noise { seed, ..noise }.apply(&mut image);
            }
            image
        });
        Self::new(name, raw, StereoCamera::rectified(width, height, 750.0 * scale, 60.0))
    }

    /// Width and height.
    pub fn size(&self) -> Size {
        size(&self.pair[0])
    }

    /// The mask, a byte a pixel: 0 or 255.
    ///
    /// # Panics
    /// Never: there are as many words as the size says.
    pub fn mask_bytes(&self) -> Vec<u8> {
        let mut bytes = vec![0; self.size().pixels()];
        let mut words = self.mask.clone();
        unpack(&Bitmap::over(self.size(), &mut words).unwrap(), &mut bytes).unwrap();
        bytes
    }
}

/// What speed is measured on: everything drawn at 640x480 and at 1920x1080, and the cases with known truth
/// where there are any.
pub fn all() -> Vec<Image> {
    let sizes = [(640, 480), (1920, 1080)];
    let drawn = sizes.into_iter().flat_map(|(w, h)| DRAWN.map(|name| Image::drawn(name, w, h)));
    let cases = cases::folder().map(|folder| cases::cases(&folder)).unwrap_or_default();
    let opened = cases.iter().map(|case| {
        let (raw, camera) = cases::open(case);
        Image::new(&format!("case {}", cases::name(case)), raw, camera)
    });
    drawn.chain(opened).collect()
}

/// A pair as a device rectifies it, and what the core has to know of its cameras.
///
/// # Panics
/// When the pair cannot be rectified.
pub fn rectified([left, right]: &Pair, camera: &StereoCamera) -> (Pair, Optics) {
    let rectification = Rectification::same_size(camera).unwrap();
    let model = rectification.model();
    let pair = rectification.device_images(left.clone(), right.clone()).unwrap();
    (pair, Optics::from(&model))
}

/// Width and height of a picture.
///
/// # Panics
/// When it is larger than the core takes.
pub fn size(image: &GrayImage) -> Size {
    Size::new(image.width() as usize, image.height() as usize).unwrap()
}

/// A picture as the core takes it.
///
/// # Panics
/// As [`size`].
pub fn grey(image: &GrayImage) -> Grey<'_> {
    Grey::new(size(image), size(image).width, image.as_raw()).unwrap()
}

/// The mask that the core makes of a picture.
fn mask(image: &GrayImage, optics: Optics) -> Vec<Word> {
    let Size { width, height } = size(image);
    let mut storage = Storage::new(width, height).unwrap();
    let mut memory = storage.lend();
    let mut run = Run::new(&mut memory, &Settings::new(optics));
    let [eye, _] = &mut memory.eyes;
    run.outline(Side::Left, grey(image), eye, Arena::new(memory.scratch), &mut ()).unwrap();
    eye.mask.to_vec()
}

fn ring(x: f64, y: f64) -> f64 {
    (x.hypot(y) - 160.0).abs() - 40.0
}

/// Distance to a segment, less a radius.
fn limb([x, y]: [f64; 2], [a, b]: [[f64; 2]; 2], radius: f64) -> f64 {
    let along = [b[0] - a[0], b[1] - a[1]];
    let from = [x - a[0], y - a[1]];
    let length = along[0].powi(2) + along[1].powi(2);
    let share = ((from[0] * along[0] + from[1] * along[1]) / length).clamp(0.0, 1.0);
    (from[0] - share * along[0]).hypot(from[1] - share * along[1]) - radius
}

fn limbs(x: f64, y: f64) -> f64 {
    const LIMBS: [([[f64; 2]; 2], f64); 7] = [
        ([[-90.0, -20.0], [70.0, -10.0]], 62.0),
        ([[-110.0, 0.0], [-150.0, 170.0]], 28.0),
        ([[-70.0, 0.0], [-50.0, 175.0]], 30.0),
        ([[60.0, 0.0], [50.0, 180.0]], 27.0),
        ([[90.0, 0.0], [140.0, 165.0]], 29.0),
        ([[80.0, -30.0], [190.0, -140.0]], 38.0),
        ([[-120.0, -40.0], [-225.0, -150.0]], 20.0),
    ];
    LIMBS.iter().map(|(ends, radius)| limb([x, y], *ends, *radius)).fold(f64::INFINITY, f64::min)
}

/// Discs, the middle of each in an earlier one.
fn blobs() -> Outline {
    let mut random = Random(7);
    let mut share = || random.below(1 << 20) as f64 / f64::from(1 << 20);
    let mut discs: Vec<[f64; 3]> = vec![[0.0, 0.0, 70.0]];
    while discs.len() < 14 {
        let [x, y, radius] = discs[(share() * discs.len() as f64) as usize];
        let (sin, cos) = (share() * std::f64::consts::TAU).sin_cos();
        let next = [x + radius * cos, y + radius * sin, 30.0 + 40.0 * share()];
        if next[0].abs() + next[2] < 260.0 && next[1].abs() + next[2] < 200.0 {
            discs.push(next);
        }
    }
    Box::new(move |x, y| discs.iter().map(|[u, v, r]| (x - u).hypot(y - v) - r).fold(f64::INFINITY, f64::min))
}
