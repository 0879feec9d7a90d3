//! `host calibrate` and `docs/calibrate.py`: a drawn board gives back the cameras that saw it, and rows tell a
//! wrong calibration from a right one.
//!
//! The script runs in the Python that `OSSATURE_RULER` names, which `ci.sh` sets up; without that, its test is
//! skipped with a line on standard error.

use std::path::Path;
use std::process::{Command as Process, Output};

use assert_cmd::Command;
use host::calibration::{Camera, Lens, StereoCamera};
use image::{GrayImage, Luma};
use nalgebra::{Point2, Rotation3, Vector3};
use serde_json::Value;
use tempfile::TempDir;

/// Inner corners of the board, and the side of its squares, mm.
const BOARD: [f64; 2] = [9.0, 6.0];
const SQUARE: f64 = 25.0;

fn run(folder: &Path, args: &[&str]) -> Output {
    Command::cargo_bin("host").unwrap().current_dir(folder).args(args).output().unwrap()
}

/// Two cameras that are turned against each other, behind lenses.
fn cameras() -> StereoCamera {
    let mut pair = StereoCamera::rectified(640, 480, 600.0, 60.0);
    pair.left.fy = 604.0;
    pair.right.fx = 610.0;
    pair.right.cy += 6.0;
    pair.rotation = Rotation3::from_euler_angles(0.01, 0.03, -0.008).into_inner();
    pair.translation = Vector3::new(-60.0, 0.7, 1.5);
    let lens =
        |k1: f64, k2: f64| Lens::Polynomial([k1, k2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    (pair.left.lens, pair.right.lens) = (lens(-0.12, 0.03), lens(-0.1, 0.02));
    pair
}

/// What the board is at a place of its plane, mm from its first inner corner: white paper, dark squares, and
/// grey where there is no board.
fn tone(at: Point2<f64>) -> f64 {
    let square = at.map(|x| (x / SQUARE).floor());
    let inside = (-1.0..BOARD[0]).contains(&square.x) && (-1.0..BOARD[1]).contains(&square.y);
    let margin = (-2.0..=BOARD[0]).contains(&square.x) && (-2.0..=BOARD[1]).contains(&square.y);
    match (inside, margin) {
        (true, _) if (square.x + square.y).rem_euclid(2.0) < 1.0 => 20.0,
        (_, true) => 230.0,
        _ => 90.0,
    }
}

/// The board as a camera sees it. Points of the plane are `to_camera (x, y, 0) + corner`; a pixel is the mean of
/// 3x3 rays.
fn seen(camera: &Camera, to_camera: &Rotation3<f64>, corner: &Vector3<f64>) -> GrayImage {
    let normal = to_camera * Vector3::z();
    GrayImage::from_fn(camera.width, camera.height, |u, v| {
        let rays = (0..9).map(|n| [f64::from(n % 3), f64::from(n / 3)].map(|step| (step - 1.0) / 3.0));
        let tones = rays.map(|[du, dv]| {
            let ray = camera.ray_of(Point2::new(f64::from(u) + du, f64::from(v) + dv));
            ray.map_or(90.0, |ray| {
                let ray = Vector3::new(ray.x, ray.y, 1.0);
                let hit = ray * (normal.dot(corner) / normal.dot(&ray)) - corner;
                tone(Point2::from((to_camera.inverse() * hit).xy()))
            })
        });
        Luma([(tones.sum::<f64>() / 9.0).round() as u8])
    })
}

/// Draws pairs of the board in many poses.
fn draw_boards(folder: &Path, pair: &StereoCamera) {
    for number in 0..20 {
        // Well spread, without chance: multiples of irrational numbers.
        let part = |step: f64| (f64::from(number) * step).fract() - 0.5;
        let turn = Rotation3::from_euler_angles(1.1 * part(0.618), 1.1 * part(0.755), 0.6 * part(0.414));
        let middle =
            Vector3::new(120.0 * part(0.325) + 20.0, 90.0 * part(0.569), 430.0 + 200.0 * part(0.236));
        let corner = middle - turn * Vector3::new(4.0 * SQUARE, 2.5 * SQUARE, 0.0);
        let to_right = Rotation3::from_matrix_unchecked(pair.rotation);
        let views = [
            ("left", seen(&pair.left, &turn, &corner)),
            ("right", seen(&pair.right, &(to_right * turn), &(to_right * corner + pair.translation))),
        ];
        for (eye, view) in views {
            view.save(folder.join(format!("{eye}_{number:06}.png"))).unwrap();
        }
    }
}

/// Renders an object that the calibration is checked on.
fn render_check(folder: &Path, pair: &StereoCamera) {
    pair.write_opencv_yaml(folder.join("truth.yaml")).unwrap();
    for (shape, distance) in [("sphere", "450"), ("torus", "520"), ("teapot", "480")] {
        let out = format!("check/{shape}");
        let args = [
            "render",
            shape,
            "--place",
            "auto",
            "--distance",
            distance,
            "--calib",
            "truth.yaml",
            "--out",
            &out,
        ];
        let output = run(folder, &args);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        std::fs::remove_file(folder.join(out).join("calib.yaml")).unwrap();
    }
}

#[test]
fn rows_tell_a_right_calibration_from_a_wrong_one() {
    let folder = TempDir::new().unwrap();
    let pair = cameras();
    render_check(folder.path(), &pair);
    let output = run(folder.path(), &["calibrate", "--check", "check", "--calib", "truth.yaml", "--json"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(told["pairs"].as_array().unwrap().len(), 3);
    assert!(told["rms_px"].as_f64().unwrap() < 0.1, "{told}");
    // The right camera nods by half a degree: 5 px.
    let nod = Rotation3::from_euler_angles(0.5_f64.to_radians(), 0.0, 0.0);
    let mut wrong = pair;
    wrong.rotation = (nod * Rotation3::from_matrix_unchecked(pair.rotation)).into_inner();
    wrong.translation = nod * pair.translation;
    wrong.write_opencv_yaml(folder.path().join("wrong.yaml")).unwrap();
    let output = run(folder.path(), &["calibrate", "--check", "check", "--calib", "wrong.yaml"]);
    let error = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(error.contains("rows differ by 5.") && error.contains("calibrate again"), "{error}");
    // Each pair is told all the same.
    let told = String::from_utf8(output.stdout).unwrap();
    assert_eq!(told.matches("in column").count(), 6, "{told}");
    let output = run(folder.path(), &["calibrate", "--check", "check", "--calib", "wrong.yaml", "--json"]);
    assert_eq!(output.status.code(), Some(1));
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(told["error"].as_str().unwrap().contains("rows differ"), "{told}");
    for pair in told["pairs"].as_array().unwrap() {
        let columns = pair["columns_px"].as_array().unwrap();
        // The objects stand in the middle of the view.
        assert!(columns.iter().all(|u| (100.0..540.0).contains(&u.as_f64().unwrap())), "{told}");
    }
}

#[test]
fn a_drawn_board_gives_back_the_cameras_that_saw_it() {
    let Some(python) = std::env::var_os("OSSATURE_RULER") else {
        eprintln!("SKIPPED: OSSATURE_RULER names no Python with OpenCV, so docs/calibrate.py is not run");
        return;
    };
    let folder = TempDir::new().unwrap();
    let truth = cameras();
    draw_boards(folder.path(), &truth);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/calibrate.py");
    let output = Process::new(python)
        .current_dir(folder.path())
        .arg(script)
        .args([".", "9x6", "25", "calib.yaml"])
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{told}{}", String::from_utf8_lossy(&output.stderr));
    println!("{told}");
    let found = StereoCamera::read(folder.path().join("calib.yaml")).unwrap();
    for (found, truth) in [(found.left, truth.left), (found.right, truth.right)] {
        for (found, truth) in [(found.fx, truth.fx), (found.fy, truth.fy)] {
            assert!((found / truth - 1.0).abs() < 0.002, "focal length {found} px, not {truth}");
        }
    }
    let [found_mm, truth_mm] = [found, truth].map(|pair| pair.translation.norm());
    assert!((found_mm / truth_mm - 1.0).abs() < 0.002, "baseline {found_mm} mm, not {truth_mm}");
    render_check(folder.path(), &truth);
    let output = run(folder.path(), &["calibrate", "--check", "check", "--calib", "calib.yaml", "--json"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    println!("rows: {} px", told["rms_px"]);
    assert!(told["rms_px"].as_f64().unwrap() < 0.3, "{told}");
}
