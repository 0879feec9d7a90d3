//! What goes wrong: what is said, the exit code, and what is left.

use super::*;

#[test]
fn failures_are_json_too_if_asked_for() {
    let folder = TempDir::new().unwrap();
    let failing: [&[&str]; 4] = [
        &["replay", "none.png"],
        &["evaluate", "none.ply", "none.ply"],
        &["inspect", "--stage", "hull", "none.png"],
        &["demo", "--out", "/dev/null/below"],
    ];
    for args in failing {
        let output = run(folder.path(), &[args, &["--json"]].concat());
        assert_eq!(output.status.code(), Some(1), "{args:?}");
        let told = json(std::str::from_utf8(&output.stdout).unwrap());
        let error = format!("error: {}\n", told["error"].as_str().unwrap());
        assert_eq!(error, String::from_utf8(output.stderr).unwrap());
        assert!(run(folder.path(), args).stdout.is_empty());
    }
}

#[test]
fn what_is_suspicious_about_a_file_is_told_with_its_refusal() {
    let folder = TempDir::new().unwrap();
    let dark = |name: &str| {
        let image = image::open(torus(name)).unwrap().into_luma8();
        let values = image.as_raw().iter().map(|&grey| u16::from(grey)).collect();
        let deep = image::ImageBuffer::<image::Luma<u16>, Vec<u16>>::from_raw(320, 240, values).unwrap();
        deep.save(folder.path().join(name)).unwrap();
    };
    ["left.png", "right.png"].into_iter().for_each(dark);
    let error = bad(folder.path(), &["replay", "left.png", "right.png", "--calib", &torus("calib.yaml")], 1);
    assert!(error.contains("left.png has 16 bits a pixel"), "{error}");
}

#[test]
fn wrong_usage_is_2() {
    let folder = TempDir::new().unwrap();
    let wrong: [&[&str]; 21] = [
        &["fly"],
        &["replay"],
        &["replay", "a", "b", "--omega", "4", "--mode", "paper"],
        &["replay", "a", "b", "--omega", "2"],
        &["replay", "a", "b", "--front", "auto", "--mode", "paper"],
        &["replay", "a", "b", "--front", "grey", "--background", "first"],
        &["replay", "a", "b", "--front", "auto", "--background", "desk.png"],
        &["capture", "--front", "auto", "--background", "first"],
        &["replay", "a", "b", "--threshold", "256"],
        &["replay", "a", "b", "--polarity", "grey"],
        &["replay", "a", "b", "--resolution", "0"],
        &["replay", "a", "b", "--focal", "750"],
        &["replay", "a", "b", "--jobs", "0"],
        &["replay", "a", "b", "--calib", "c", "--focal", "1", "--baseline", "1"],
        &["demo", "cube"],
        &["render", "nothing", "--out", "x"],
        &["render", "torus", "--focal", "0.5", "--out", "x"],
        &["render", "torus", "--focal", "1e7", "--out", "x"],
        &["render", "torus"],
        &["render", "torus", "--out", "x", "--size", "640"],
        &["completions", "cmd"],
    ];
    for args in wrong {
        bad(folder.path(), args, 2);
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn refusals_are_1_say_what_to_do_and_leave_nothing() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    let (left, right, calibration) = (torus("left.png"), torus("right.png"), torus("calib.yaml"));
    fs::copy(&left, path("l.png")).unwrap();
    fs::copy(&right, path("r.png")).unwrap();
    let png = fs::read(&left).unwrap();
    fs::write(path("cut.png"), &png[..png.len() / 2]).unwrap();
    fs::write(path("huge.pgm"), "P5 60000 60000 255\n").unwrap();
    fs::write(path("file"), "").unwrap();
    fs::write(path("broken.obj"), "v 0 0 0\n").unwrap();
    image::GrayImage::new(4097, 1).save(path("long.png")).unwrap();
    image::GrayImage::new(320, 241).save(path("tall.png")).unwrap();
    StereoCamera::rectified(640, 480, 750.0, 60.0).write_opencv_yaml(path("large.yaml")).unwrap();
    fs::write(path("nan.yaml"), fs::read_to_string(&calibration).unwrap().replacen("375.0", ".Nan", 1))
        .unwrap();
    let before = fs::read_dir(folder.path()).unwrap().count();
    let refused: [(&[&str], &str); 22] = [
        (&["replay", "l.png", "r.png"], "give --calib FILE"),
        (&["replay", "l.png", "none.png"], "there is no file or folder"),
        (&["replay", "none.png"], "there is no file or folder none.png"),
        (&["replay", "cut.png", &right, "--calib", &calibration], "cut.png is damaged or cut short"),
        (&["replay", "huge.pgm", &right, "--calib", &calibration], "larger than is read"),
        (&["replay", "file", &right, "--calib", &calibration], "file is no image"),
        (&["replay", &left, "tall.png", "--calib", &calibration], "320x240 images, but these are 320x241"),
        (&["replay", &left, &right, "--calib", "large.yaml"], "640x480 images, but these are 320x240"),
        (&["replay", &left, &right, "--calib", "nan.yaml"], "line 9"),
        (&["replay", &left, &right, "--calib", "none.yaml"], "cannot read the calibration none.yaml"),
        (&["replay", &left, &right, "--focal", "375", "--baseline", "60000"], "check the units"),
        (&["replay", &left, &right, "--focal", "0.5", "--baseline", "60"], "--focal must be 64 to 6400 px"),
        (&["replay", &left, &right, "--focal", "1e7", "--baseline", "60"], "0.2 to 20 image widths"),
        (&["replay", &right, &left], "give them in the other order"),
        (&["replay", &left, &left], "both named left"),
        (&["replay", "long.png", "r.png"], "long.png has a view of 4097x1 px"),
        (&["replay", "l.png", "--calib", &calibration], "give two"),
        (&["replay", &left, &right, "--out", "file/below"], "cannot write file/below"),
        (&["render", "broken.obj", "--out", "x"], "has no faces"),
        (&["render", "torus", "--place", "auto", "--distance", "10", "--out", "x"], "behind the left camera"),
        (
            &["render", "torus", "--place", "auto", "--distance", "1e6", "--out", "x"],
            "nothing of the mesh is to be seen",
        ),
        (&["evaluate", "none.ply", "broken.obj"], "cannot read none.ply"),
    ];
    for (args, told) in refused {
        let error = bad(folder.path(), args, 1);
        assert!(error.contains(told), "{args:?}: {error}");
        assert_eq!(error.lines().count(), 1, "{error}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), before, "{args:?} left files");
    }
}

#[test]
fn nobody_listening_is_no_failure() {
    let folder = TempDir::new().unwrap();
    let program = Command::cargo_bin("host").unwrap().get_program().to_owned();
    for args in [&["completions", "bash"][..], &["--help"], &["replay", "a", "b"]] {
        let mut child = std::process::Command::new(&program)
            .current_dir(folder.path())
            .args(args)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop((child.stdout.take(), child.stderr.take()));
        let code = child.wait().unwrap().code();
        assert!(matches!(code, Some(0 | 1)), "{args:?}: {code:?}");
    }
}

#[test]
fn a_calibration_of_another_resolution_is_refused_by_both_sizes() {
    let folder = TempDir::new().unwrap();
    StereoCamera::rectified(640, 480, 750.0, 60.0)
        .write_opencv_yaml(folder.path().join("large.yaml"))
        .unwrap();
    let (left, right) = (torus("left.png"), torus("right.png"));
    let told = bad(folder.path(), &["replay", &left, &right, "--calib", "large.yaml", "--out", "model"], 1);
    assert!(told.contains("640x480") && told.contains("320x240"), "{told}");
    assert!(!folder.path().join("model").exists());
}

/// A limit on the length of files stands for a full disk: writing fails in the middle.
#[test]
#[cfg(unix)]
fn a_full_disk_is_a_failure_that_leaves_what_was_there() {
    let folder = TempDir::new().unwrap();
    let args = ["replay", &torus("left.png"), &torus("right.png"), "--no-pictures", "--out", "model"];
    let program = Command::cargo_bin("host").unwrap().get_program().to_owned();
    // Blocks of 512 bytes; without the signal, writing beyond them is an error like any other.
    let limited = |blocks: &str| {
        let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" \"$@\"");
        let output = std::process::Command::new("sh")
            .current_dir(folder.path())
            .args(["-c", &script])
            .arg(&program)
            .args(args)
            .output()
            .unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    for blocks in ["0", "1", "64"] {
        let (code, told) = limited(blocks);
        assert_eq!(code, Some(1), "{blocks}: {told}");
        assert!(told.starts_with("error: cannot write model"), "{told}");
        let left = fs::read_dir(folder.path().join("model")).map_or(0, |files| files.count());
        assert_eq!(left, 0, "{blocks}: something is left");
    }
    good(folder.path(), &args);
    let whole = results(&folder.path().join("model"));
    assert_eq!(limited("64").0, Some(1));
    assert_eq!(results(&folder.path().join("model")), whole, "the results before are untouched");
    assert_eq!(limited("unlimited").0, Some(0));
}

#[test]
#[cfg(target_os = "linux")]
fn a_disk_without_room_is_named_and_holds_whole_files_alone() {
    let folder = TempDir::new().unwrap();
    let [left, right, truth] = ["left.png", "right.png", "truth.ply"].map(torus);
    let convert = ["convert", &truth, "disk/truth.obj"];
    let render = [&["render", "torus", "--out", "disk"], &SMALL[..]].concat();
    let replay = ["replay", &left, &right, "--out", "disk/model"];
    // What a command names, what is there before, and what of a whole run may be there afterwards.
    let old: &[u8] = b"old";
    let cases: [(&[&str], _, &[_], &[&str]); 5] = [
        (&replay, "disk/model", &[], &[]),
        (&replay, "disk/model", &[("model/model.ply", old), ("model/report.json", old)], &[]),
        (&convert, "disk/truth.obj", &[], &[]),
        (&convert, "disk/truth.obj", &[("truth.obj", old)], &[]),
        (&render, "disk/truth.ply", &[("truth.ply", old)], &["left.png", "right.png", "calib.yaml"]),
    ];
    for (args, named, before, new) in cases {
        let Some(ended) = disk::on_a_small_disk(folder.path(), before, args) else { return };
        assert_eq!(ended.code, Some(1), "{args:?}: {}", ended.told);
        let told = ended.told.lines().find(|line| line.starts_with("error: ")).unwrap_or_default();
        assert!(told.contains(named) && told.contains("there is no room"), "{args:?}: {}", ended.told);
        let mut files = ended.files;
        for name in new {
            assert!(files.remove(*name) == Some(fs::read(torus(name)).unwrap()), "{args:?}: {name}");
        }
        let before: Vec<_> =
            before.iter().map(|(name, bytes)| ((*name).to_owned(), bytes.to_vec())).collect();
        assert!(files.iter().map(|(n, b)| (n.clone(), b.clone())).eq(before), "{args:?}: {:?}", files.keys());
    }
}
