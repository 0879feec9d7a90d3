//! Exact files of every format, and what each fault must say.

use super::lens::unbend;
use super::*;

const OPENCV: &str = "\
%YAML:1.0
---
image_width: 640
image_height: 480
M1: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 750., 0., 319.5, 0., 751., 239.5, 0., 0., 1. ]
D1: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -2.5e-01, 0.1, 1.0e-03, -.002, 0. ]
M2: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 760., 0., 320., 0., 761.,
       240., 0., 0., 1. ]
D2: !!opencv-matrix
   rows: 4
   cols: 1
   dt: d
   data: [ 0., 0., 0., 0. ]
R: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 0.96, 0., 0.28, 0., 1., 0., -0.28, 0., 0.96 ]
T: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ -60., 0.5, 2. ]
";

const ROS_LEFT: &str = "\
image_width: 640
image_height: 480
camera_name: narrow_stereo/left
camera_matrix:
  rows: 3
  cols: 3
  data: [750.0, 0.0, 319.5, 0.0, 751.0, 239.5, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.25, 0.1, 0.001, -0.002, 0.0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [0.96, 0.0, 0.28, 0.0, 1.0, 0.0, -0.28, 0.0, 0.96]
projection_matrix:
  rows: 3
  cols: 4
  data: [700.0, 0.0, 310.0, 0.0, 0.0, 700.0, 240.0, 0.0, 0.0, 0.0, 1.0, 0.0]
";

const KALIBR: &str = "\
cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.25, 0.1, 0.001, -0.002]
  distortion_model: radtan
  intrinsics: [750.0, 751.0, 319.5, 239.5]
  resolution: [640, 480]
  rostopic: /cam0/image_raw
cam1:
  T_cn_cnm1:
  - [0.96, 0.0, 0.28, -0.06]
  - [0.0, 1.0, 0.0, 0.0005]
  - [-0.28, 0.0, 0.96, 0.002]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [0]
  camera_model: pinhole
  distortion_coeffs: [0.01, -0.02, 0.003, -0.004]
  distortion_model: equidistant
  intrinsics: [760.0, 761.0, 320.0, 240.0]
  resolution: [640, 480]
  rostopic: /cam1/image_raw
";

fn ros_right() -> String {
    ROS_LEFT.replace("0.28", "0.0").replace("0.96", "1.0").replace("310.0, 0.0,", "310.0, -42.0,")
}

fn expected_left() -> Camera {
    Camera {
        width: 640,
        height: 480,
        fx: 750.0,
        fy: 751.0,
        cx: 319.5,
        cy: 239.5,
        skew: 0.0,
        lens: Lens::Polynomial([-0.25, 0.1, 0.001, -0.002, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
    }
}

fn turn() -> Matrix3<f64> {
    Matrix3::new(0.96, 0.0, 0.28, 0.0, 1.0, 0.0, -0.28, 0.0, 0.96)
}

/// The sentence that a text is refused with.
fn refusal(text: &str) -> String {
    StereoCamera::parse(text).expect_err("should be refused").to_string()
}

#[test]
fn opencv_is_read_with_each_of_its_headers() {
    let body = OPENCV.strip_prefix("%YAML:1.0\n---\n").expect("header");
    for header in ["%YAML:1.0\n---\n", "%YAML:1.0\n", "%YAML 1.2\n---\n", "", "\u{feff}%YAML:1.0\r\n---\r\n"]
    {
        let pair = StereoCamera::parse(&format!("{header}{body}")).expect(header);
        assert_eq!(pair.left, expected_left());
        assert_eq!(
            [pair.right.fx, pair.right.fy, pair.right.cx, pair.right.cy],
            [760.0, 761.0, 320.0, 240.0]
        );
        assert_eq!(pair.right.lens, Lens::NONE);
        assert!((pair.rotation - turn()).amax() < 1e-15);
        assert_eq!(pair.translation, Vector3::new(-60.0, 0.5, 2.0));
    }
}

#[test]
fn opencv_synonyms_are_read() {
    let text = OPENCV
        .replace("M1:", "cameraMatrix1:")
        .replace("D2:", "distCoeffs2:")
        .replace("M2:", "K2:")
        .replace("image_width: 640\nimage_height: 480", "imageSize: [ 640, 480 ]");
    assert_eq!(StereoCamera::parse(&text).expect("synonyms"), StereoCamera::parse(OPENCV).expect("plain"));
}

#[test]
fn a_ros_pair_is_read_in_millimetres() {
    let folder = tempfile::tempdir().expect("folder");
    let (left, right) = (folder.path().join("left.yaml"), folder.path().join("right.yaml"));
    std::fs::write(&left, ROS_LEFT).expect("left");
    std::fs::write(&right, ros_right()).expect("right");
    let pair = StereoCamera::read(folder.path()).expect("folder");
    assert_eq!(pair.left, expected_left());
    assert!((pair.rotation - turn()).amax() < 1e-15);
    assert!((pair.translation - Vector3::new(-60.0, 0.0, 0.0)).amax() < 1e-12);

    let list = format!("{},{}", left.display(), right.display());
    assert_eq!(StereoCamera::read(&list).expect("list"), pair);
    let swapped = format!("{},{}", right.display(), left.display());
    assert!(matches!(StereoCamera::read(&swapped), Err(CalibrationError::Swapped { .. })));
    assert!(refusal(ROS_LEFT).contains("left.yaml,right.yaml"));
    std::fs::remove_file(right).expect("remove");
    let refused = StereoCamera::read(folder.path()).expect_err("one eye");
    assert!(crate::command::words_of(&refused).contains("right.yaml"));
}

#[test]
fn an_opencv_pair_of_intrinsics_and_extrinsics_is_read() {
    let folder = tempfile::tempdir().expect("folder");
    let cut = OPENCV.find("R: ").expect("R");
    std::fs::write(folder.path().join("intrinsics.yml"), &OPENCV[..cut]).expect("intrinsics");
    std::fs::write(folder.path().join("extrinsics.yml"), format!("%YAML:1.0\n---\n{}", &OPENCV[cut..]))
        .expect("extrinsics");
    let pair = StereoCamera::read(folder.path()).expect("folder");
    assert_eq!(pair, StereoCamera::parse(OPENCV).expect("plain"));
}

#[test]
fn a_kalibr_camchain_is_read_in_millimetres() {
    let pair = StereoCamera::parse(KALIBR).expect("camchain");
    assert_eq!(pair.left, expected_left());
    assert_eq!(pair.right.lens, Lens::Equidistant([0.01, -0.02, 0.003, -0.004]));
    assert!((pair.rotation - turn()).amax() < 1e-15);
    assert!((pair.translation - Vector3::new(-60.0, 0.5, 2.0)).amax() < 1e-12);
}

#[test]
fn what_is_written_is_read_back_to_the_bit() {
    let file = tempfile::tempdir().expect("folder");
    let path = file.path().join("calib.yaml");
    for pair in [StereoCamera::rectified(640, 480, 750.0, 60.0), StereoCamera::parse(OPENCV).expect("pair")] {
        pair.write_opencv_yaml(&path).expect("write");
        assert_eq!(StereoCamera::read(&path).expect("read"), pair);
    }
    let fisheye = StereoCamera::parse(KALIBR).expect("camchain");
    assert!(matches!(fisheye.write_opencv_yaml(&path), Err(CalibrationError::Inexpressible { .. })));
    assert_eq!(std::fs::read_dir(file.path()).expect("list").count(), 1);
}

/// The sentence that a pair of texts is refused with.
fn ros_refusal(left: &str, right: &str) -> String {
    let folder = tempfile::tempdir().expect("folder");
    std::fs::write(folder.path().join("left.yaml"), left).expect("left");
    std::fs::write(folder.path().join("right.yaml"), right).expect("right");
    crate::command::words_of(&StereoCamera::read(folder.path()).expect_err("should be refused"))
}

#[test]
fn a_number_that_is_not_finite_is_refused_with_its_key_and_line() {
    for bad in [".Nan", ".NaN", "nan", ".Inf", "-.Inf", "inf", "1e999"] {
        assert!(
            refusal(&OPENCV.replace("751.", bad)).starts_with("calibration line 9: `M1` holds"),
            "{bad}: {}",
            refusal(&OPENCV.replace("751.", bad))
        );
        assert!(
            refusal(&OPENCV.replace("240.,", &format!("{bad},"))).starts_with("calibration line 20: `M2`")
        );
        assert!(refusal(&KALIBR.replace("-0.06", bad)).starts_with("calibration line 11: `T_cn_cnm1`"));
        let left = ros_refusal(&ROS_LEFT.replace("751.0", bad), &ros_right());
        assert!(left.contains("left.yaml line 7: `camera_matrix` holds"), "{bad}: {left}");
        let right = ros_refusal(ROS_LEFT, &ros_right().replace("-42.0", bad));
        assert!(right.contains("right.yaml line 20: `projection_matrix` holds"), "{bad}: {right}");
    }
}

#[test]
fn every_fault_has_its_sentence() {
    let cases = [
        ("T: ", "U: ", "`T` is missing"),
        ("image_width: 640\n", "", "`image_width` is missing"),
        ("image_width: 640", "image_width: 0", "line 3: `image_width` should be a positive number of pixels"),
        ("751., 239.5", "0., 239.5", "line 5: `M1` is singular"),
        ("0., 0., 1. ]\nD1", "0., 0., 0. ]\nD1", "line 5: `M1` is singular"),
        (
            "-.002, 0. ]",
            "-.002 ]",
            "`D1` should be a 1x5 matrix, as its rows and cols say, but has 4 elements",
        ),
        ("rows: 3\n   cols: 1", "rows: 1\n   cols: 2", "`T` should be"),
        ("751.", "fast", "line 9: `M1` should be a number"),
        ("0., 1., 0., -0.28", "0., 1.1, 0., -0.28", "line 26: `R` is not a rotation"),
        ("0., 1., 0., -0.28", "0., -1., 0., -0.28", "line 26: `R` is not a rotation"),
        ("[ -60., 0.5, 2. ]", "[ 0., 0., 0. ]", "the baseline is 0"),
        ("[ -60., 0.5, 2. ]", "[ 60., 0., 0. ]", "the eyes are swapped"),
        ("[ -60., 0.5, 2. ]", "[ -3., -60., 0. ]", "top-bottom pair: the second camera is 60.0 mm below"),
        ("[ -60., 0.5, 2. ]", "[ -20., 0., 60. ]", "do not look side by side"),
        (
            "[ -60., 0.5, 2. ]",
            "[ -60000., 0., 0. ]",
            "the baseline is 60000 mm, outside 1 to 1000 mm; check the units",
        ),
        ("[ -60., 0.5, 2. ]", "[ -0.06, 0., 0. ]", "the baseline is 0.06 mm"),
        ("M1: !!opencv-matrix", "M1: [", "not YAML"),
        ("---\n", "---\nimage_width: 5\n", "not YAML"),
    ];
    for (from, to, sentence) in cases {
        assert!(OPENCV.contains(from), "{from}");
        let said = refusal(&OPENCV.replace(from, to));
        assert!(said.contains(sentence), "{sentence:?} is not in {said:?}");
    }
    for text in ["", "~", "42", "[1, 2]", "key: value"] {
        assert!(
            refusal(text).contains("no calibration format has these keys"),
            "{text:?}: {}",
            refusal(text)
        );
    }
    assert!(refusal("<?xml version=\"1.0\"?>\n<opencv_storage>\n<M1>").contains("YAML"));
    assert!(refusal(&KALIBR.replace("radtan", "fov")).contains("lens model `fov`"));
    assert!(refusal(&KALIBR.replace("pinhole", "omni")).contains("camera_model pinhole"));
}

#[test]
fn a_missing_or_foreign_file_is_refused() {
    let missing = StereoCamera::read("no/such/calib.yaml").expect_err("missing").to_string();
    assert!(missing.starts_with("cannot read the calibration no/such/calib.yaml"));
    let folder = tempfile::tempdir().expect("folder");
    let film = folder.path().join("film.yaml");
    std::fs::write(&film, vec![0xff; 2 << 20]).expect("film");
    assert!(matches!(StereoCamera::read(&film), Err(CalibrationError::Unreadable { .. })));
}

#[test]
fn another_resolution_is_refused_by_both_sizes() {
    let pair = StereoCamera::parse(OPENCV).expect("pair");
    assert!(pair.check_size(640, 480).is_ok());
    let said = pair.check_size(1280, 960).expect_err("other size").to_string();
    assert!(said.contains("640x480") && said.contains("1280x960"), "{said}");
}

/// OpenCV's documented formula, written out once more, term by term.
fn opencv_formula(k: &[f64; 12], x: f64, y: f64) -> (f64, f64) {
    let r = (x * x + y * y).sqrt();
    let q = (1.0 + k[0] * r.powi(2) + k[1] * r.powi(4) + k[4] * r.powi(6))
        / (1.0 + k[5] * r.powi(2) + k[6] * r.powi(4) + k[7] * r.powi(6));
    (
        x * q
            + 2.0 * k[2] * x * y
            + k[3] * (r.powi(2) + 2.0 * x.powi(2))
            + k[8] * r.powi(2)
            + k[9] * r.powi(4),
        y * q
            + k[2] * (r.powi(2) + 2.0 * y.powi(2))
            + 2.0 * k[3] * x * y
            + k[10] * r.powi(2)
            + k[11] * r.powi(4),
    )
}

#[test]
fn lenses_bend_as_documented_and_unbend_to_a_billionth_of_a_pixel() {
    let lenses = [
        [0.0; 12],
        [-0.28, 0.07, 2e-4, -3e-4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.15, -0.3, 1e-3, 1e-3, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [3.2, 1.1, 1e-4, -1e-4, 0.05, 3.5, 2.0, 0.3, 1e-3, -1e-4, 2e-3, 1e-4],
    ];
    for k in lenses {
        let camera = Camera { lens: Lens::Polynomial(k), skew: 0.3, ..expected_left() };
        for (row, col) in (0..480).step_by(16).flat_map(|row| (0..640).step_by(16).map(move |col| (row, col)))
        {
            let pixel = Point2::new(f64::from(col), f64::from(row));
            let ray = camera.ray_of(pixel).expect("inside the image");
            let (x, y) = opencv_formula(&k, ray.x, ray.y);
            let by_formula = Point2::new(750.0 * x + 0.3 * y + 319.5, 751.0 * y + 239.5);
            assert!((camera.pixel_of(ray) - by_formula).norm() < 1e-9);
            assert!((camera.pixel_of(ray) - pixel).norm() < 1e-9);
        }
    }
}

#[test]
fn fisheye_lenses_bend_by_angle() {
    let k = [0.01, -0.02, 0.003, -0.004];
    let camera = Camera { lens: Lens::Equidistant(k), ..expected_left() };
    for degrees in [0.0_f64, 1.0, 30.0, 60.0, 80.0] {
        let t = degrees.to_radians();
        let bent = t + k[0] * t.powi(3) + k[1] * t.powi(5) + k[2] * t.powi(7) + k[3] * t.powi(9);
        let pixel = camera.pixel_of(Point2::new(0.6 * t.tan(), 0.8 * t.tan()));
        assert!((pixel - Point2::new(750.0 * 0.6 * bent + 319.5, 751.0 * 0.8 * bent + 239.5)).norm() < 1e-9);
        let back = camera.ray_of(pixel).expect("in front");
        assert!((back.coords.norm() - t.tan()).abs() < 1e-9);
    }
    assert_eq!(camera.ray_of(Point2::new(319.5 + 750.0 * 1.7, 239.5)), None);
}

#[test]
fn a_lens_that_folds_is_not_inverted_beyond_the_fold() {
    // x (1 - x^2 / 3) is largest at x = 1, where it is 2/3.
    let k = [-1.0 / 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let lens = Lens::Polynomial(k);
    assert!((unbend(&lens, Point2::new(0.609_375, 0.0)).expect("before the fold").x - 0.75).abs() < 1e-12);
    assert_eq!(unbend(&lens, Point2::new(0.67, 0.0)), None);
    assert_eq!(unbend(&lens, Point2::new(f64::NAN, 0.0)), None);
}
