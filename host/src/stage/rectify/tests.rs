//! Rows, depths and pictures of rectified pairs, held against the raw cameras alone.

use image::Luma;

use super::*;
use crate::calibration::Lens;

/// Two unlike cameras with lenses, 80 mm apart, turned towards one another, tilted and rolled.
fn verged() -> StereoCamera {
    let left = Camera {
        width: 640,
        height: 480,
        fx: 700.0,
        fy: 704.0,
        cx: 325.0,
        cy: 236.0,
        skew: 0.0,
        lens: Lens::Polynomial([-0.28, 0.09, 1e-3, -5e-4, -0.01, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
    };
    let right =
        Camera { fx: 690.0, fy: 688.0, skew: 0.4, lens: Lens::Equidistant([0.02, -0.01, 0.0, 0.0]), ..left };
    let rotation = Rotation3::from_euler_angles(0.03, 0.15, -0.02).into_inner();
    StereoCamera { left, right, rotation, translation: Vector3::new(-79.0, 3.0, 12.0) }
}

/// Where the raw cameras see a point of the left camera's axes: their definition, and nothing else.
fn seen(pair: &StereoCamera, point: &Point3<f64>) -> [Point2<f64>; 2] {
    let onto = |camera: &Camera, p: Vector3<f64>| camera.pixel_of(Point2::new(p.x / p.z, p.y / p.z));
    let in_right = pair.rotation * point.coords + pair.translation;
    [onto(&pair.left, point.coords), onto(&pair.right, in_right)]
}

/// Points that spread over 100 mm around (0, 0, 450) mm, the same at each run (van der Corput).
fn points(n: u32) -> impl Iterator<Item = Point3<f64>> {
    let corput = |mut i: u32, base: u32| {
        let (mut sum, mut share) = (0.0, 1.0);
        while i > 0 {
            share /= f64::from(base);
            sum += share * f64::from(i % base);
            i /= base;
        }
        100.0 * (sum - 0.5)
    };
    (1..=n).map(move |i| Point3::new(corput(i, 2), corput(i, 3), 450.0 + corput(i, 5)))
}

/// The boxes of what both raw cameras see of some points.
fn boxes(pair: &StereoCamera) -> [PixelBox; 2] {
    [0, 1].map(|eye| {
        let pixels: Vec<_> = points(500).map(|point| seen(pair, &point)[eye]).collect();
        let extreme = |pick: fn(f64, f64) -> f64| {
            pixels.iter().copied().reduce(|a, b| Point2::new(pick(a.x, b.x), pick(a.y, b.y))).expect("points")
        };
        PixelBox { min: extreme(f64::min), max: extreme(f64::max) }
    })
}

/// A soft spot on a plain ground, drawn pixel by pixel.
fn spot(width: u32, height: u32, at: Point2<f64>) -> GrayImage {
    GrayImage::from_fn(width, height, |u, v| {
        let r2 = (f64::from(u) - at.x).powi(2) + (f64::from(v) - at.y).powi(2);
        Luma([(20.0 + 220.0 * (-r2 / 72.0).exp()).round() as u8])
    })
}

fn centre_of_mass(image: &GrayImage) -> Point2<f64> {
    let (mut sum, mut mass) = (Vector3::zeros(), 0.0);
    for (u, v, &Luma([grey])) in image.enumerate_pixels() {
        let weight = f64::from(grey.saturating_sub(22));
        sum += weight * Vector3::new(f64::from(u), f64::from(v), 0.0);
        mass += weight;
    }
    Point2::new(sum.x / mass, sum.y / mass)
}

#[test]
fn a_rectified_pair_passes_to_the_bit() {
    let mut pair = StereoCamera::rectified(64, 48, 75.0, 60.0);
    pair.right.cx += 5.0;
    let rectification = Rectification::whole(&pair).expect("rectified");
    let images = [spot(64, 48, Point2::new(20.0, 20.0)), spot(64, 48, Point2::new(15.0, 20.0))];
    assert!(rectification.is_identity());
    assert_eq!(rectification.images(images[0].clone(), images[1].clone()).expect("images"), images);
    let camera = rectification.camera();
    assert_eq!((camera.f, camera.baseline_mm, camera.disparity_offset()), (75.0, 60.0, 5.0));
    assert_eq!(camera.depth(10.0), Some(75.0 * 60.0 / 15.0));
    assert_eq!(camera.depth(-5.0), None);
    for changed in [
        StereoCamera { left: Camera { fx: 75.1, ..pair.left }, ..pair },
        StereoCamera { right: Camera { cy: 24.0, ..pair.right }, ..pair },
        StereoCamera { translation: Vector3::new(-60.0, 0.1, 0.0), ..pair },
        StereoCamera { rotation: Rotation3::new(Vector3::x() * 1e-3).into_inner(), ..pair },
    ] {
        assert!(!Rectification::whole(&changed).expect("rectifiable").is_identity());
    }
}

#[test]
fn rows_agree_and_depth_is_exact() {
    let pair = verged();
    let rectification = Rectification::around(&pair, boxes(&pair)).expect("verged");
    let camera = rectification.camera();
    for point in points(2000) {
        let [left, right] = seen(&pair, &point);
        let l = rectification.rectified_pixel(Eye::Left, left).expect("left");
        let r = rectification.rectified_pixel(Eye::Right, right).expect("right");
        assert!((l.y - r.y).abs() < 1e-6, "rows {} and {}", l.y, r.y);
        let rectified = camera.point(l.x, l.y, l.x - r.x).expect("in front");
        assert!((camera.to_left_camera(rectified) - point).norm() < 1e-6);
        let [again, _] = camera.project(&rectified).expect("in front");
        assert!((again - l).norm() < 1e-9 && (camera.disparity(rectified.z) - (l.x - r.x)).abs() < 1e-9);
    }
}

#[test]
fn the_object_has_room_and_both_eyes_one_axis() {
    let pair = verged();
    let rectification = Rectification::around(&pair, boxes(&pair)).expect("verged");
    let camera = rectification.camera();
    assert_eq!(camera.disparity_offset(), 0.0);
    assert_eq!(camera.f, 704.0);
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    let mut columns = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    for point in points(500) {
        for ((eye, pixel), span) in
            [Eye::Left, Eye::Right].into_iter().zip(seen(&pair, &point)).zip(&mut columns)
        {
            let at = rectification.rectified_pixel(eye, pixel).expect("inside");
            assert!((0.24 * height..0.76 * height).contains(&at.y), "row {} of {height}", at.y);
            *span = [span[0].min(at.x), span[1].max(at.x)];
        }
    }
    for [first, last] in columns {
        let wide = last - first;
        assert!(wide <= width / 2.0 && first >= 0.45 * wide && width - last >= 0.45 * wide);
    }
}

#[test]
fn long_lenses_far_apart_get_an_axis_each() {
    let mut pair = verged();
    for camera in [&mut pair.left, &mut pair.right] {
        *camera = Camera { fx: 9000.0, fy: 9000.0, skew: 0.0, lens: Lens::NONE, ..*camera };
    }
    pair.rotation = Rotation3::from_euler_angles(0.0, 0.25, 0.0).into_inner();
    pair.translation = Vector3::new(-400.0, 0.0, 50.0);
    let rectification = Rectification::whole(&pair).expect("verged");
    let camera = rectification.camera();
    assert!(camera.disparity_offset().abs() > 100.0 && camera.width <= MAX_SIDE && camera.height <= MAX_SIDE);
    let point = Point3::new(3.0, 4.0, 1600.0);
    let [left, right] = seen(&pair, &point);
    let l = rectification.rectified_pixel(Eye::Left, left).expect("left");
    let r = rectification.rectified_pixel(Eye::Right, right).expect("right");
    let found = camera.to_left_camera(camera.point(l.x, l.y, l.x - r.x).expect("in front"));
    assert!((l.y - r.y).abs() < 1e-6 && (found - point).norm() < 1e-6);
}

#[test]
fn a_canvas_too_long_is_scaled_down() {
    let mut pair = verged();
    pair.left =
        Camera { width: 4000, height: 3000, fx: 4400.0, fy: 4400.0, cx: 2000.0, cy: 1500.0, ..pair.left };
    pair.left.lens = Lens::NONE;
    pair.right = pair.left;
    let camera = Rectification::whole(&pair).expect("verged").camera();
    assert_eq!(camera.width.max(camera.height), MAX_SIDE);
    assert!(camera.f < 4400.0);
}

#[test]
fn a_spot_lands_where_the_mapping_says() {
    let pair = verged();
    let rectification = Rectification::around(&pair, boxes(&pair)).expect("verged");
    for point in
        [Point3::new(0.0, 0.0, 450.0), Point3::new(-20.0, 25.0, 480.0), Point3::new(30.0, -20.0, 420.0)]
    {
        let [left, right] = seen(&pair, &point);
        let images = rectification.images(spot(640, 480, left), spot(640, 480, right)).expect("images");
        for (eye, raw, image) in [(Eye::Left, left, &images[0]), (Eye::Right, right, &images[1])] {
            let there = rectification.rectified_pixel(eye, raw).expect("inside");
            // The lens bends a spot 6 px wide a little; grey values are rounded.
            let off = (centre_of_mass(image) - there).norm();
            assert!(off < 0.05, "{eye:?} {off} px off");
        }
    }
}

#[test]
fn the_border_repeats_outwards() {
    let pair = verged();
    let rectification = Rectification::whole(&pair).expect("verged");
    let plain = GrayImage::from_pixel(640, 480, Luma([37]));
    let half = GrayImage::from_fn(640, 480, |u, _| Luma([if u < 320 { 200 } else { 10 }]));
    let [left, right] = rectification.images(plain, half).expect("images");
    assert!(left.pixels().all(|&pixel| pixel == Luma([37])));
    let middle = right.height() / 2;
    assert_eq!(*right.get_pixel(0, middle), Luma([200]));
    assert_eq!(*right.get_pixel(right.width() - 1, middle), Luma([10]));
}

#[test]
fn wrong_images_and_wrong_pairs_are_refused() {
    let pair = verged();
    let rectification = Rectification::whole(&pair).expect("verged");
    let said = rectification.images(GrayImage::new(640, 480), GrayImage::new(320, 240)).expect_err("size");
    assert!(said.to_string().contains("640x480") && said.to_string().contains("320x240"));
    let swapped = StereoCamera { translation: -pair.translation, ..pair };
    assert!(matches!(
        Rectification::whole(&swapped),
        Err(RectifyError::Calibration(CalibrationError::Swapped { .. }))
    ));
    let mut folded = pair;
    folded.left.lens = Lens::Polynomial([-1.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert!(matches!(Rectification::whole(&folded), Err(RectifyError::Lens { eye: Eye::Left, .. })));
    assert!(Rectification::around(&folded, boxes(&folded)).is_ok());
    let nowhere = PixelBox { min: Point2::new(f64::NAN, 0.0), max: Point2::new(1.0, 1.0) };
    assert!(Rectification::around(&pair, [nowhere; 2]).is_err());
}

/// `cv2.stereoRectify` 4.x on two photographs of a toy dinosaur 5 degrees apart (Middlebury multi-view,
/// dinoRing): its R1, R2 and baseline.
#[test]
fn the_turns_are_those_of_opencv() {
    let camera = Camera {
        width: 480,
        height: 640,
        fx: 3325.5,
        fy: 3310.4,
        cx: 200.55,
        cy: 322.27,
        skew: 0.0,
        lens: Lens::NONE,
    };
    #[rustfmt::skip]
    let (rotation, left, right) = (
        Matrix3::new(
            0.996_194_795_687_308_8, -0.023_780_983_744_164_77, 0.083_847_443_954_374_35,
            0.023_818_060_877_878_53, 0.999_716_153_898_956_7, 0.000_558_219_935_354_965,
            -0.083_836_919_203_533_64, 0.001_440_987_730_110_29, 0.996_478_446_597_227,
        ),
        Matrix3::new(
            0.999_232_938, -0.015_480_023_1, 0.035_970_877_1,
            0.015_483_991_1, 0.999_880_102, 0.000_168_280_195,
            -0.035_969_169_2, 0.000_388_821_626, 0.999_352_824,
        ),
        Matrix3::new(
            0.998_814_849, 0.008_344_241_44, -0.047_950_713_9,
            -0.008_338_951_25, 0.999_965_182, 0.000_310_372_436,
            0.047_951_634_2, 0.000_089_854_067_5, 0.998_849_655,
        ),
    );
    let translation = Vector3::new(-55.108_311_242_100_21, -0.460_382_677_359_277_2, 2.645_618_324_512_27);
    let pair = StereoCamera { left: camera, right: camera, rotation, translation };
    let turns = bouguet(&pair);
    assert!((turns[0].matrix() - left).amax() < 2e-9 && (turns[1].matrix() - right).amax() < 2e-9);
    let camera = Rectification::whole(&pair).expect("verged").camera();
    assert!((camera.baseline_mm - 55.173_700_405_943_37).abs() < 1e-12);
}
