//! `host capture` and `host list-devices` without a camera: wrong usage, and what is told when there is none.

use std::fs;
use std::path::Path;
use std::process::Output;

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

fn run(folder: &Path, args: &[&str]) -> Output {
    Command::cargo_bin("host").unwrap().current_dir(folder).args(args).output().unwrap()
}

/// Standard error of a run that fails with a code and leaves no files.
fn bad(args: &[&str], code: i32) -> String {
    let folder = TempDir::new().unwrap();
    let output = run(folder.path(), args);
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{args:?}: {told}");
    assert!(told.starts_with("error: "), "{told}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "{args:?} left files");
    told
}

#[test]
fn wrong_usage_is_2() {
    let wrong: [&[&str]; 19] = [
        &["capture"],
        &["capture", "--device"],
        &["capture", "--device", "a", "--device", "b", "--device", "c", "--calib", "c"],
        &["capture", "--device", "a", "--layout", "two", "--calib", "c"],
        &["capture", "--device", "a", "--layout", "beside"],
        &["capture", "--device", "a", "--device", "a", "--calib", "c"],
        &["capture", "--device", "a", "--device", "b", "--layout", "side-by-side"],
        &["capture", "--device", "a", "--format", "MJPEG"],
        &["capture", "--device", "a", "--size", "640"],
        &["capture", "--device", "a", "--size", "640x99999"],
        &["capture", "--device", "a", "--fps", "0"],
        &["capture", "--device", "a", "--frames", "0"],
        &["capture", "--device", "a", "--frames", "3", "--seconds", "3"],
        &["capture", "--device", "a", "--roi", "1,2,3"],
        &["capture", "--device", "a", "--background", "b", "--polarity", "dark"],
        &["capture", "--device", "a", "--only-record"],
        &["capture", "--device", "a", "--only-record", "--record", "b", "--best"],
        &["calibrate", "--calib", "a"],
        &["list-devices", "all"],
    ];
    for args in wrong {
        bad(args, 2);
    }
}

/// A camera that is not there is told, and nothing is left behind.
#[cfg(target_os = "linux")]
#[test]
fn what_is_no_camera_says_so() {
    let one = ["--focal", "300", "--baseline", "60"];
    let told = |device: &str, more: &[&str]| bad(&[&["capture", "--device", device], more].concat(), 1);
    let error = told("/dev/video-none", &one);
    assert!(error.contains("/dev/video-none cannot be opened: there is no such device"), "{error}");
    let error = told("/dev/null", &one);
    assert!(error.contains("/dev/null") && error.contains("no Video4Linux device"), "{error}");
    let error = told("/dev/video-none", &[]);
    assert!(error.contains("give --calib FILE"), "{error}");
    let error = told("/dev/null", &["--calib", "none.yaml"]);
    assert!(error.contains("cannot read the calibration none.yaml"), "{error}");
    let error = told("/dev/null", &[&one[..], &["--background", "none.png"]].concat());
    assert!(error.contains("no background: there is no file or folder none.png"), "{error}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_failure_is_json_too_if_asked_for() {
    let folder = TempDir::new().unwrap();
    let args = ["capture", "--device", "/dev/null", "--focal", "300", "--baseline", "60", "--json"];
    let output = run(folder.path(), &args);
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(told["error"].as_str().is_some_and(|error| error.contains("/dev/null")), "{told}");
}

#[cfg(target_os = "linux")]
#[test]
fn devices_are_listed_even_if_there_are_none() {
    let folder = TempDir::new().unwrap();
    let output = run(folder.path(), &["list-devices", "--json"]);
    assert_eq!(output.status.code(), Some(0));
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    let cameras = told["cameras"].as_array().unwrap();
    let text = run(folder.path(), &["list-devices"]);
    let text = String::from_utf8(text.stdout).unwrap();
    assert_eq!(cameras.is_empty(), text.starts_with("no camera"), "{text}");
}

#[cfg(not(target_os = "linux"))]
#[test]
fn elsewhere_a_sentence_says_why_not() {
    let error = bad(&["list-devices"], 1);
    assert!(error.contains("only Linux"), "{error}");
}

#[test]
fn a_background_and_a_region_are_for_recorded_pairs_too() {
    let folder = TempDir::new().unwrap();
    let render = ["render", "torus", "--size", "320x240", "--focal", "375", "--out", "session/a"];
    assert!(run(folder.path(), &render).status.success());
    let empty = image::GrayImage::from_pixel(320, 240, image::Luma([2]));
    for name in ["left_0.png", "right_0.png"] {
        empty.save(folder.path().join("session").join(name)).unwrap();
    }
    fs::copy(folder.path().join("session/a/calib.yaml"), folder.path().join("session/calib.yaml")).unwrap();
    let scene = ["--roi", "20,10,280,220", "--no-pictures", "--json"];
    let replay = |more: &[&str]| {
        let output = run(folder.path(), &[&["replay"], more, &scene].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let told: Value = serde_json::from_slice(&output.stdout).unwrap();
        told["pairs"][0]["report"].clone()
    };
    let pair = ["session/a/left.png", "session/a/right.png"];
    let files = [&pair[..], &["--background", "session/left_0.png,session/right_0.png"]].concat();
    let report = replay(&files);
    assert_eq!(report["options"]["background_taken_away"], true);
    assert_eq!(report["images"]["left_size_px"][0], 280);
    assert_eq!(report["options"]["region_px"]["x"], 20);
    let error = bad(&["replay", ".", "--background", "first", "--roi", "0,0,20,20"], 1);
    assert!(error.contains("there are no images in ."), "{error}");
    let single = run(folder.path(), &[&["replay"], &pair[..], &["--background", "first"]].concat());
    assert_eq!(single.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&single.stderr).contains("pairs after it"));
}
