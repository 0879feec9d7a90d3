//! Rectification by table and integers, as a device does it: places against the exact camera model,
//! pictures against the host's resampler, bits against frozen ones, and any table without a panic.
//!
//! `REGENERATE=1 cargo test -p system-tests --test warp` writes the frozen checksums anew;
//! `-- --nocapture` prints the figures.

use host::calibration::{Camera, Lens, StereoCamera};
use host::stage::rectify::{Eye, Rectification, RectifiedCamera, RectifyError};
use image::{GrayImage, Luma};
use nalgebra::{Point2, Rotation3, Vector2, Vector3};
use proptest::prelude::*;
use shared::bitmap::{Grey, Size};
use shared::camera::CameraError;
use shared::fixed::PX;
use shared::stage::warp::{Place, Warp, knots};
use std::fmt::Write as _;

/// Lenses of modules with 320 columns: what they are, their focal length in px, and how they bend.
const LENSES: [(&str, f64, Lens); 7] = [
    ("pinhole", 300.0, Lens::NONE),
    ("barrel", 300.0, polynomial([-0.3, 0.1, 1e-3, -5e-4, -0.01])),
    ("strong barrel", 240.0, polynomial([-0.4, 0.2, 2e-3, 1e-3, -0.04])),
    ("k1 alone", 300.0, polynomial([-0.3, 0.0, 0.0, 0.0, 0.0])),
    ("pincushion", 350.0, polynomial([0.15, -0.05, 0.0, 1e-3, 0.0])),
    (
        "rational",
        250.0,
        Lens::Polynomial([0.3, -0.05, 1e-3, 5e-4, 0.01, 0.6, 0.05, -0.01, 1e-3, -2e-4, -1e-3, 1e-4]),
    ),
    ("fisheye, 90 degrees", 200.0, Lens::Equidistant([0.02, -0.01, 0.003, -5e-4])),
];
/// Degrees by which the cameras are turned towards one another, tilted and rolled.
const TURNS: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [5.0, 0.5, -0.7], [10.0, -2.0, 2.0], [-3.0, 1.0, 4.0]];

const fn polynomial([k1, k2, p1, p2, k3]: [f64; 5]) -> Lens {
    Lens::Polynomial([k1, k2, p1, p2, k3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
}

/// Two modules of 320 x 240 px, 60 mm apart, neither quite like the other.
fn pair(f: f64, lens: Lens, [verging, tilt, roll]: [f64; 3]) -> StereoCamera {
    let left =
        Camera { width: 320, height: 240, fx: f, fy: f * 1.005, cx: 163.3, cy: 117.2, skew: 0.0, lens };
    let right = Camera { fx: f * 0.99, cx: 156.0, cy: 121.5, skew: 0.3, ..left };
    let turn = Rotation3::from_euler_angles(tilt.to_radians(), verging.to_radians(), roll.to_radians());
    StereoCamera {
        left,
        right,
        rotation: turn.into_inner(),
        translation: turn * Vector3::new(-60.0, 0.8, 1.5),
    }
}

fn population() -> impl Iterator<Item = (&'static str, [f64; 3], StereoCamera)> {
    LENSES.into_iter().flat_map(|(name, f, lens)| TURNS.map(|turn| (name, turn, pair(f, lens, turn))))
}

/// Whether an exact raw place lies in its picture.
fn inside(raw: Vector2<f64>) -> bool {
    (0.0..=319.0).contains(&raw.x) && (0.0..=239.0).contains(&raw.y)
}

/// An object with soft and hard edges at every angle on a ground with a slope.
fn picture() -> GrayImage {
    GrayImage::from_fn(320, 240, |u, v| {
        let (x, y) = (f64::from(u) - 160.0, f64::from(v) - 120.0);
        let soft = 180.0 / (1.0 + ((x.hypot(y) - 70.0) / 0.6).exp());
        let hard = if (x + 0.3 * y).abs() < 6.0 { 50.0 } else { 0.0 };
        let waves = 8.0 * (x / 5.0).sin() * (y / 7.0).cos();
        Luma([(12.0 + f64::from(u) / 32.0 + soft + hard + waves).round().clamp(0.0, 255.0) as u8])
    })
}

/// What a raw pixel sees, by the inverse of its lens, is seen there again. The lens itself is held against OpenCV's
/// formulas where calibrations are read (`host/src/calibration/tests.rs`).
#[test]
fn the_mapping_is_the_inverse_of_the_hosts() {
    for (name, turn, pair) in population() {
        let rectification = Rectification::same_size(&pair).unwrap();
        let maps = rectification.model().mappings().unwrap().unwrap();
        for (eye, map) in [Eye::Left, Eye::Right].into_iter().zip(maps) {
            for (u, v) in (0..320).step_by(29).flat_map(|u| (0..240).step_by(17).map(move |v| (u, v))) {
                let raw = Point2::new(f64::from(u), f64::from(v));
                let there = rectification.rectified_pixel(eye, raw).unwrap();
                let off = (map.raw(there.coords) - raw.coords).norm();
                assert!(off < 1e-8, "{name} {turn:?} {eye} ({u}, {v}): {off} px");
            }
        }
    }
}

#[test]
fn the_table_is_the_model_to_a_fiftieth_of_a_pixel() {
    for (name, turn, pair) in population() {
        let model = Rectification::same_size(&pair).unwrap().model();
        let (mut worst, mut sum, mut count) = (0.0_f64, 0.0, 0);
        for map in model.mappings().unwrap().unwrap() {
            let mut memory = vec![[0; 2]; knots(map.size())];
            let warp = Warp::new(&map, &mut memory).unwrap();
            for v in 0..240 {
                let mut u = 0;
                warp.each_place(v, |place| {
                    let exact = map.raw(Vector2::new(f64::from(u), v as f64));
                    u += 1;
                    if inside(exact) {
                        let off = (Vector2::from(place.map(f64::from)) / f64::from(PX) - exact).amax();
                        worst = worst.max(off);
                        sum += off * off;
                        count += 1;
                    }
                });
                assert_eq!(u, 320);
            }
        }
        let rms = (sum / f64::from(count)).sqrt();
        println!("{name:20} {turn:?}: {rms:.4} px rms, {worst:.4} at most; {count} places inside");
        assert!(count > 90_000, "the canvas shows little of the pictures");
        assert!(worst < 0.02 && rms < 0.005, "{name} {turn:?}: {worst} px, {rms} rms");
    }
}

/// Why the rule is not the plain one: lines between knots need them every 4 px, 16 times as many.
#[test]
fn lines_between_knots_would_not_do() {
    let barrel = pair(LENSES[1].1, LENSES[1].2, TURNS[1]);
    let [map, _] = Rectification::same_size(&barrel).unwrap().model().mappings().unwrap().unwrap();
    let worst = |step: i32| {
        let knot = |i: i32, j: i32| map.raw(Vector2::new(f64::from(i * step), f64::from(j * step)));
        let pixels = (0..240).flat_map(|v| (0..320).map(move |u| (u, v)));
        pixels.fold(0.0_f64, |worst, (u, v)| {
            let exact = map.raw(Vector2::new(f64::from(u), f64::from(v)));
            let (i, j) = (u / step, v / step);
            let share = |x: i32| f64::from(x % step) / f64::from(step);
            let along = |j| knot(i, j).lerp(&knot(i + 1, j), share(u));
            let off = (along(j).lerp(&along(j + 1), share(v)) - exact).amax();
            if inside(exact) { worst.max(off) } else { worst }
        })
    };
    let found = [4, 8, 16].map(worst);
    println!("lines between knots every 4, 8, 16 px are off by {found:.3?} px at most");
    assert!(found[0] < 0.02 && found[1] > 0.02 && found[2] > 0.1, "{found:?}");
}

#[test]
fn pictures_are_those_of_the_exact_resampler() {
    for (name, turn, pair) in population() {
        let rectification = Rectification::same_size(&pair).unwrap();
        let exact = rectification.images(picture(), picture()).unwrap();
        let device = rectification.device_images(picture(), picture()).unwrap();
        let maps = rectification.model().mappings().unwrap().unwrap();
        let (mut worst, mut sum, mut count) = (0, 0, 0);
        for ((exact, device), map) in exact.iter().zip(&device).zip(maps) {
            assert_eq!(exact.dimensions(), device.dimensions());
            for (u, v, grey) in exact.enumerate_pixels() {
                if inside(map.raw(Vector2::new(f64::from(u), f64::from(v)))) {
                    let off = u64::from(grey.0[0].abs_diff(device.get_pixel(u, v).0[0]));
                    worst = worst.max(off);
                    sum += off;
                    count += 1;
                }
            }
        }
        let mean = sum as f64 / f64::from(count);
        println!("{name:20} {turn:?}: {mean:.4} grey values off, {worst} at most");
        // The steepest edge of the picture rises by 60 a pixel.
        assert!(worst <= 2 && mean < 0.1, "{name} {turn:?}: {worst}, {mean} in the mean");
    }
}

/// Rows agree and depth is right for the canvas that a device has, and what both eyes see stays in it.
#[test]
fn the_canvas_of_a_device_keeps_the_picture_and_the_geometry() {
    for (name, turn, pair) in population() {
        let rectification = Rectification::same_size(&pair).unwrap();
        let camera = RectifiedCamera::from(&rectification.model());
        assert_eq!(camera, rectification.camera());
        assert_eq!((camera.width, camera.height), (320, 240));
        let see = |camera: &Camera, p: Vector3<f64>| camera.pixel_of(Point2::new(p.x / p.z, p.y / p.z));
        let (mut both, mut kept) = (0, 0);
        for i in 0..1000_u32 {
            // A lattice that fills the left view between 200 and 800 mm.
            let share = |step: u32, of: u32| f64::from((i / step) % of) / f64::from(of - 1);
            let pixel = Point2::new(319.0 * share(1, 10), 239.0 * share(10, 10));
            let z = 200.0 + 600.0 * share(100, 10);
            let ray = pair.left.ray_of(pixel).unwrap();
            let point = Vector3::new(ray.x * z, ray.y * z, z);
            let right = see(&pair.right, pair.rotation * point + pair.translation);
            if !inside(right.coords) {
                continue;
            }
            let l = rectification.rectified_pixel(Eye::Left, pixel).unwrap();
            let r = rectification.rectified_pixel(Eye::Right, right).unwrap();
            assert!((l.y - r.y).abs() < 1e-6, "{name} {turn:?}");
            let found = camera.to_left_camera(camera.point(l.x, l.y, l.x - r.x).unwrap());
            assert!((found.coords - point).norm() < 1e-6 * z, "{name} {turn:?}");
            both += 1;
            kept += u32::from(inside(l.coords) && inside(r.coords));
        }
        println!("{name:20} {turn:?}: f {:.1} px, {kept} of {both} seen by both kept", camera.f);
        assert!(both > 300 && f64::from(kept) > 0.8 * f64::from(both), "{name} {turn:?}: {kept} of {both}");
    }
}

#[test]
fn a_rectified_pair_passes_to_the_bit() {
    let pair = StereoCamera::rectified(320, 240, 300.0, 60.0);
    let rectification = Rectification::same_size(&pair).unwrap();
    let model = rectification.model();
    assert!(model.eyes.is_none() && model.mappings() == Ok(None));
    assert_eq!(rectification.device_images(picture(), picture()).unwrap(), [picture(), picture()]);
    let size = Size::new(320, 240).unwrap();
    let (raw, picture) = (picture(), picture());
    let raw = Grey::new(size, 320, &raw).unwrap();
    let mut row = [0; 320];
    for v in 0..240 {
        Warp::untouched(size).row(v, raw, &mut row);
        assert_eq!(row, picture.as_raw()[320 * v..320 * (v + 1)]);
    }
}

#[test]
fn what_a_device_cannot_take_is_refused() {
    let large = StereoCamera::rectified(5000, 240, 300.0, 60.0);
    let rectification = Rectification::same_size(&large).unwrap();
    assert_eq!(rectification.model().check(), Err(CameraError::Size));
    let images = || GrayImage::new(5000, 240);
    let refused = rectification.device_images(images(), images());
    assert!(matches!(refused, Err(RectifyError::Device(CameraError::Size))));
    let crossed = pair(1000.0, Lens::NONE, [0.0, 25.0, 0.0]);
    assert!(matches!(Rectification::same_size(&crossed), Err(RectifyError::Apart)));
    assert!(Warp::along(Size::new(320, 240).unwrap(), &[[0; 2]; 413]).is_err());
}

/// Half a calibration fits the means of 2x2 pixels.
#[test]
fn a_calibration_can_be_halved() {
    let full = pair(300.0, polynomial([-0.3, 0.1, 1e-3, -5e-4, -0.01]), [5.0, 0.5, -0.7]);
    let half = full.halved();
    assert_eq!((half.left.width, half.right.height), (160, 120));
    for ray in [Point2::new(0.0, 0.0), Point2::new(0.3, -0.2), Point2::new(-0.4, 0.35)] {
        let (fine, coarse) = (full.left.pixel_of(ray), half.left.pixel_of(ray));
        // The pixel (u, v) of the reduced image covers 2u - 0.5 to 2u + 1.5 of the other.
        assert!((coarse.coords * 2.0 + Vector2::repeat(0.5) - fine.coords).norm() < 1e-9);
    }
}

/// FNV-1a, 64 bits.
fn checksum(bytes: impl IntoIterator<Item = u8>) -> u64 {
    bytes.into_iter().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3))
}

/// A device is told a model, and makes of it what the PC makes of it. The model is written out here: its
/// rotations are made on the PC alone, by functions that differ from machine to machine in the last place.
#[test]
fn every_machine_makes_the_same_tables_and_pictures() {
    use shared::camera::{EyeModel, Lens, PairModel};
    let level = [[1.0, 0.0, 0.0], [0.0, 0.96, -0.28], [0.0, 0.28, 0.96]];
    let verged = [[0.96, 0.0, 0.28], [0.0, 1.0, 0.0], [-0.28, 0.0, 0.96]];
    let eye = |lens, turn| EyeModel { focal: [300.0, 301.5], skew: 0.25, centre: [163.3, 117.2], lens, turn };
    let model = PairModel {
        width: 200,
        height: 150,
        focal: 250.0,
        columns: [20.5, 180.25],
        row: 130.0,
        baseline: 60.0,
        to_left: level,
        eyes: Some([
            eye(
                Lens::Polynomial([-0.3, 0.1, 1e-3, -5e-4, -0.01, 0.0, 0.02, 0.0, 1e-3, 0.0, 0.0, 1e-4]),
                level,
            ),
            eye(Lens::Equidistant([0.02, -0.01, 0.003, -5e-4]), verged),
        ]),
    };
    // Integers alone, so that the picture is the same everywhere.
    let raw: Vec<u8> = (0..320 * 240_u32).map(|i| ((i % 320 * (i / 320) / 7) ^ (i / 11)) as u8).collect();
    let raw = Grey::new(Size::new(320, 240).unwrap(), 320, &raw).unwrap();
    let mut found = String::new();
    for (name, map) in ["left", "right"].into_iter().zip(model.mappings().unwrap().unwrap()) {
        let mut memory = vec![[0; 2]; knots(map.size())];
        let warp = Warp::new(&map, &mut memory).unwrap();
        let mut image = [[0; 200]; 150];
        for (v, row) in image.iter_mut().enumerate() {
            warp.row(v, raw, row);
        }
        let table = checksum(memory.iter().flatten().flat_map(|x| x.to_le_bytes()));
        let _ = writeln!(found, "{name} table {table:016x}");
        let _ = writeln!(found, "{name} picture {:016x}", checksum(image.into_iter().flatten()));
    }
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/frozen/warp.txt");
    if std::env::var_os("REGENERATE").is_some() {
        std::fs::write(file, &found).unwrap();
    }
    let frozen = std::fs::read_to_string(file).unwrap_or_default();
    assert_eq!(found, frozen, "changed on purpose? REGENERATE=1 freezes what is found");
}

/// The rule of `shared::stage::warp` in floats, from its words: four knots down, four along, then pixels.
fn naive(table: &[Place], columns: usize, raw: &[Vec<u8>], u: usize, v: usize) -> f64 {
    let bessel =
        |p: [f64; 4], t: f64| p[1] + t * (p[2] - p[1]) - t * (1.0 - t) * (p[0] - p[1] - p[2] + p[3]) / 4.0;
    let share = |x: usize| (x % 16) as f64 / 16.0;
    let [x, y] = [0, 1].map(|axis| {
        let knot = |i: usize, j: usize| f64::from(table[j * columns + i][axis].clamp(-(1 << 20), 1 << 20));
        let along =
            [0, 1, 2, 3].map(|i| bessel([0, 1, 2, 3].map(|j| knot(u / 16 + i, v / 16 + j)), share(v)));
        bessel(along, share(u)) / 256.0
    });
    let (x, y) = (x.clamp(0.0, raw[0].len() as f64 - 1.0), y.clamp(0.0, raw.len() as f64 - 1.0));
    let grey = |u: usize, v: usize| f64::from(raw[v.min(raw.len() - 1)][u.min(raw[0].len() - 1)]);
    let along = |v: usize| {
        let u = x as usize;
        grey(u, v) + (x - x.floor()) * (grey(u + 1, v) - grey(u, v))
    };
    along(y as usize) + (y - y.floor()) * (along(y as usize + 1) - along(y as usize))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    /// No table and no picture makes a row panic, and any row and length may be asked for.
    #[test]
    fn any_table_any_picture(
        width in 0_usize..70,
        height in 0_usize..40,
        sides in (0_usize..20, 0_usize..20),
        seed in any::<u64>(),
        extreme in any::<bool>(),
        beyond in 0_usize..5,
    ) {
        let mut state = seed | 1;
        let mut random = move || { state = state.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(1); (state >> 32) as i32 };
        let size = Size::new(width, height).unwrap();
        let ends = [i32::MIN, i32::MAX, 1 << 20, -(1 << 20)];
        let table: Vec<Place> = (0..knots(size))
            .map(|_| [0; 2].map(|_: i32| if extreme { ends[(random() & 3) as usize] } else { random() >> 8 }))
            .collect();
        let bytes: Vec<u8> = (0..sides.0 * sides.1).map(|_| random() as u8).collect();
        let raw = Grey::new(Size::new(sides.0, sides.1).unwrap(), sides.0, &bytes).unwrap();
        let warp = Warp::along(size, &table).unwrap();
        let mut out = vec![77; width + beyond];
        for v in [0, 1, height / 2, height.saturating_sub(1), height, usize::MAX] {
            warp.row(v, raw, &mut out);
            prop_assert!(out[width..].iter().all(|&grey| grey == 77));
        }
        warp.row(0, raw, &mut out[..width / 2]);
    }

    /// Integers against the rule in floats, on tables that move a pixel or two from knot to knot.
    #[test]
    fn rows_follow_the_rule(width in 1_usize..70, height in 1_usize..40, seed in any::<u64>()) {
        let mut state = seed | 1;
        let mut random = move |below: u64| {
            state = state.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(1);
            ((state >> 32) % below) as i32
        };
        let size = Size::new(width, height).unwrap();
        let columns = width.div_ceil(16) + 3;
        let table: Vec<Place> = (0..knots(size) as i32)
            .map(|k| [k % columns as i32, k / columns as i32].map(|x| (x - 1) * 16 * PX + random(1024) - 512))
            .collect();
        // A slope, so that a place that is rounded is a grey value that is rounded.
        let raw: Vec<Vec<u8>> = (0..50).map(|v| (0..80).map(|u| (2 * u + v) as u8).collect()).collect();
        let bytes = raw.concat();
        let grey = Grey::new(Size::new(80, 50).unwrap(), 80, &bytes).unwrap();
        let warp = Warp::along(size, &table).unwrap();
        let mut row = vec![0; width];
        for v in 0..height {
            warp.row(v, grey, &mut row);
            for (u, &found) in row.iter().enumerate() {
                let expected = naive(&table, columns, &raw, u, v);
                prop_assert!((f64::from(found) - expected).abs() < 0.52, "({u}, {v}): {found}, not {expected}");
            }
        }
    }
}
