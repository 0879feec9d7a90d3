//! Calibration files, through the public door: three formats of one rig mean one geometry, and no text
//! makes the reader panic or return a pair that rectification does not survive.

use host::calibration::StereoCamera;
use host::stage::rectify::{Eye, PixelBox, Rectification};
use nalgebra::{Point2, Point3, Vector3};
use proptest::prelude::*;

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
   cols: 4
   dt: d
   data: [ -0.25, 0.1, 0.001, -0.002 ]
M2: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 760., 0., 320., 0., 761., 240., 0., 0., 1. ]
D2: !!opencv-matrix
   rows: 4
   cols: 1
   dt: d
   data: [ 0.1, -0.05, 0., 0. ]
R: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 0.96, 0., 0.28, 0., 1., 0., -0.28, 0., 0.96 ]
T: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ -48., 0., 14. ]
";

const KALIBR: &str = "\
cam0:
  camera_model: pinhole
  distortion_coeffs: [-0.25, 0.1, 0.001, -0.002]
  distortion_model: radtan
  intrinsics: [750.0, 751.0, 319.5, 239.5]
  resolution: [640, 480]
cam1:
  T_cn_cnm1:
  - [0.96, 0.0, 0.28, -0.048]
  - [0.0, 1.0, 0.0, 0.0]
  - [-0.28, 0.0, 0.96, 0.014]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: pinhole
  distortion_coeffs: [0.1, -0.05, 0.0, 0.0]
  distortion_model: radtan
  intrinsics: [760.0, 761.0, 320.0, 240.0]
  resolution: [640, 480]
";

const ROS_LEFT: &str = "\
image_width: 640
image_height: 480
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
  data: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
projection_matrix:
  rows: 3
  cols: 4
  data: [700.0, 0.0, 310.0, 0.0, 0.0, 700.0, 240.0, 0.0, 0.0, 0.0, 1.0, 0.0]
";

/// The eye that makes all of the turn; Tx = -35 is 50 mm at 700 px.
const ROS_RIGHT: &str = "\
image_width: 640
image_height: 480
camera_matrix:
  rows: 3
  cols: 3
  data: [760.0, 0.0, 320.0, 0.0, 761.0, 240.0, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [0.1, -0.05, 0.0, 0.0, 0.0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [0.96, 0.0, -0.28, 0.0, 1.0, 0.0, 0.28, 0.0, 0.96]
projection_matrix:
  rows: 3
  cols: 4
  data: [700.0, 0.0, 310.0, -35.0, 0.0, 700.0, 240.0, 0.0, 0.0, 0.0, 1.0, 0.0]
";

fn parsed(text: &str) -> Result<StereoCamera, String> {
    StereoCamera::parse(text).map_err(|error| error.to_string())
}

fn ros(left: &str, right: &str) -> Result<StereoCamera, String> {
    let folder = tempfile::tempdir().expect("folder");
    for (name, text) in [("left.yaml", left), ("right.yaml", right)] {
        std::fs::write(folder.path().join(name), text).expect("write");
    }
    let read = StereoCamera::read(folder.path());
    assert_eq!(StereoCamera::parse_two(left, right).ok(), read.as_ref().ok().copied());
    read.map_err(|error| error.to_string())
}

#[test]
fn three_formats_of_one_rig_are_one_pair() {
    let opencv = parsed(OPENCV).expect("opencv");
    for other in [parsed(KALIBR).expect("kalibr"), ros(ROS_LEFT, ROS_RIGHT).expect("ros")] {
        assert_eq!((opencv.left, opencv.right), (other.left, other.right));
        assert!((opencv.rotation - other.rotation).amax() < 1e-14);
        assert!((opencv.translation - other.translation).amax() < 1e-12);
    }
}

#[test]
fn a_point_seen_by_raw_cameras_is_found_in_left_axes() {
    let pair = parsed(OPENCV).expect("opencv");
    let point = Point3::new(-40.0, 10.0, 300.0);
    let onto = |p: Vector3<f64>| Point2::new(p.x / p.z, p.y / p.z);
    let left = pair.left.pixel_of(onto(point.coords));
    let right = pair.right.pixel_of(onto(pair.rotation * point.coords + pair.translation));
    let half = Vector3::new(60.0, 60.0, 0.0).xy();
    let boxes = [left, right].map(|pixel| PixelBox { min: pixel - half, max: pixel + half });
    let rectified = Rectification::around(&pair, boxes).expect("verged");
    let l = rectified.rectified_pixel(Eye::Left, left).expect("left");
    let r = rectified.rectified_pixel(Eye::Right, right).expect("right");
    let camera = rectified.camera();
    let found = camera.to_left_camera(camera.point(l.x, l.y, l.x - r.x).expect("in front"));
    assert!((l.y - r.y).abs() < 1e-9 && (found - point).norm() < 1e-9);
}

/// What files suffer: lost pieces, other numbers, foreign characters.
fn mutated(text: &'static str) -> impl Strategy<Value = String> {
    let pieces = prop_oneof![
        Just(String::new()),
        "[-0-9.eE]{1,6}",
        Just(".Nan".to_owned()),
        Just("-.Inf".to_owned()),
        Just("1e308".to_owned()),
        "[\\[\\]{}:,&*!|>'\"%@`#~ \n\t-]{1,4}",
        "\\PC{0,8}",
    ];
    let edit = (0..text.len(), 0..40_usize, pieces);
    proptest::collection::vec(edit, 1..5).prop_map(move |edits| {
        let mut bytes = text.as_bytes().to_vec();
        for (at, lost, piece) in edits {
            let at = at.min(bytes.len());
            let end = (at + lost).min(bytes.len());
            bytes.splice(at..end, piece.into_bytes());
        }
        String::from_utf8_lossy(&bytes).into_owned()
    })
}

/// Reading ends in a sentence, or in a sound pair that rectification ends with too.
fn survives(outcome: Result<StereoCamera, String>) {
    match outcome {
        Ok(pair) => {
            assert!(pair.check().is_ok() && pair.translation.iter().all(|t| t.is_finite()));
            if let Ok(rectified) = Rectification::whole(&pair) {
                let camera = rectified.camera();
                assert!(camera.width >= 1 && camera.height >= 1 && camera.f > 0.0);
            }
        }
        Err(sentence) => assert!(sentence.contains(' '), "{sentence}"),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn no_opencv_text_panics(text in mutated(OPENCV)) {
        survives(parsed(&text));
    }

    #[test]
    fn no_kalibr_text_panics(text in mutated(KALIBR)) {
        survives(parsed(&text));
    }

    #[test]
    fn no_ros_text_panics(text in mutated(ROS_RIGHT)) {
        survives(ros(ROS_LEFT, &text));
    }

    #[test]
    fn no_text_at_all_panics(text in "\\PC{0,200}") {
        survives(parsed(&text));
    }
}
