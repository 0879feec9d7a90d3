//! The program as its users meet it: the binary, its exit codes, what it prints and the files it leaves.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};
use std::sync::LazyLock;

use assert_cmd::Command;
use host::calibration::{Distortion, StereoCamera};
use host::mesh::Mesh;
use host::shape::Shape;
use nalgebra::{Rotation3, Vector3};
use serde_json::Value;
use tempfile::TempDir;

/// A quarter of the usual pixels: quick, and enough to tell right from wrong.
const SMALL: [&str; 4] = ["--size", "320x240", "--focal", "375"];

/// A small pair of a torus: left.png, right.png, calib.yaml, truth.ply.
static TORUS: LazyLock<TempDir> = LazyLock::new(|| {
    let folder = TempDir::new().unwrap();
    let mut args = vec!["render", "torus", "--out", folder.path().to_str().unwrap()];
    args.extend(SMALL);
    good(Path::new("."), &args);
    folder
});

fn torus(name: &str) -> String {
    TORUS.path().join(name).display().to_string()
}

fn run(folder: &Path, args: &[&str]) -> Output {
    Command::cargo_bin("host").unwrap().current_dir(folder).args(args).output().unwrap()
}

/// Standard output of a run that succeeds.
fn good(folder: &Path, args: &[&str]) -> String {
    let output = run(folder, args);
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{args:?}: {told}");
    String::from_utf8(output.stdout).unwrap()
}

/// Standard error of a run that fails with a code.
fn bad(folder: &Path, args: &[&str], code: i32) -> String {
    let output = run(folder, args);
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{args:?}: {told}");
    assert!(told.starts_with("error: "), "{told}");
    told
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

/// The bytes of every file that a run leaves, but for the times in the report.
fn results(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let read = |name: &str| fs::read(folder.join(name)).unwrap();
    let mut report = json(std::str::from_utf8(&read("report.json")).unwrap());
    assert!(report.as_object_mut().unwrap().remove("times_ms").is_some());
    let mut files: Vec<_> =
        ["model.ply", "skeleton.ply", "boundary.ply"].map(|name| (name.to_owned(), read(name))).to_vec();
    files.push(("report.json".into(), report.to_string().into_bytes()));
    files
}

/// What two torus files give.
fn expected() -> Vec<(String, Vec<u8>)> {
    static RESULTS: LazyLock<Vec<(String, Vec<u8>)>> = LazyLock::new(|| {
        let folder = TempDir::new().unwrap();
        good(
            folder.path(),
            &["replay", &torus("left.png"), &torus("right.png"), "--no-pictures", "--jobs", "1"],
        );
        results(&folder.path().join("ossature-out"))
    });
    RESULTS.clone()
}

#[test]
fn demos_are_as_good_as_they_say() {
    for (name, percent) in [("torus", 0.1), ("sphere", 0.1)] {
        let folder = TempDir::new().unwrap();
        let told = json(&good(folder.path(), &["demo", name, "--json"]));
        let error = told["evaluation"]["distance"]["symmetric"]["mean_pct"].as_f64().unwrap();
        assert!(error < percent, "{name}: {error} %");
        assert!(told["evaluation"]["volume_iou"].as_f64().unwrap() > 0.98);
        for axis in told["size_error_mm"].as_array().unwrap() {
            assert!(axis.as_f64().unwrap().abs() < 1.0, "{name}: {told}");
        }
        let left = folder.path().join("ossature-demo").join(name);
        for file in ["left.png", "right.png", "calib.yaml", "truth.ply", "model.ply", "report.json"] {
            assert!(left.join(file).is_file(), "{file}");
        }
        // What the demo leaves can be replayed.
        let again = ["replay", left.to_str().unwrap(), "--out", "again", "--no-pictures"];
        good(folder.path(), &again);
        let [first, second] =
            [left, folder.path().join("again").join(name)].map(|f| fs::read(f.join("model.ply")));
        assert_eq!(first.unwrap(), second.unwrap());
    }
}

fn as_obj(mesh: &Mesh, scale: f64) -> String {
    let vertices =
        mesh.vertices.iter().map(|v| format!("v {} {} {}\n", v.x * scale, v.y * scale, v.z * scale));
    let faces = mesh.faces.iter().map(|[a, b, c]| format!("f {} {} {}\n", a + 1, b + 1, c + 1));
    vertices.chain(faces).collect()
}

fn as_stl(mesh: &Mesh) -> String {
    let face = |corners: &[u32; 3]| {
        let corner = |&v: &u32| {
            let v = mesh.vertices[v as usize];
            format!("vertex {} {} {}\n", v.x, v.y, v.z)
        };
        let corners: String = corners.iter().map(corner).collect();
        format!("facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n")
    };
    let faces: String = mesh.faces.iter().map(face).collect();
    format!("solid capsule\n{faces}endsolid capsule\n")
}

/// Mean error in percent of a model of what was rendered into `pair`.
fn error_of(folder: &Path, pair: &str) -> f64 {
    good(folder, &["replay", pair, "--no-pictures"]);
    let model = format!("ossature-out/{pair}/model.ply");
    let (truth, calibration) = (format!("{pair}/truth.ply"), format!("{pair}/calib.yaml"));
    let told =
        good(folder, &["evaluate", &model, &truth, "--calib", &calibration, "--samples", "2000", "--json"]);
    let told = json(&told);
    assert!(told["silhouette_iou"][1].as_f64().unwrap() > 0.97, "{told}");
    told["distance"]["symmetric"]["mean_pct"].as_f64().unwrap()
}

#[test]
fn any_mesh_can_be_tried() {
    let folder = TempDir::new().unwrap();
    let capsule = Shape::Capsule.mesh(6.0);
    fs::write(folder.path().join("capsule.obj"), as_obj(&capsule, 1e-3)).unwrap();
    fs::write(folder.path().join("capsule.stl"), as_stl(&capsule)).unwrap();
    host::export::ply::write_mesh(&folder.path().join("capsule.ply"), &capsule, &[]).unwrap();
    for (file, scale) in [("capsule.obj", "1000"), ("capsule.stl", "1"), ("capsule.ply", "1")] {
        let pair = file.replace('.', "-");
        let mut args = vec!["render", file, "--scale", scale, "--out", &pair];
        args.extend(SMALL);
        good(folder.path(), &args);
        let error = error_of(folder.path(), &pair);
        assert!(error < 0.4, "{file}: {error} %");
    }
}

#[test]
fn turned_cameras_with_lenses_give_the_same_shape() {
    let folder = TempDir::new().unwrap();
    let mut pair = StereoCamera::rectified(320, 240, 375.0, 60.0);
    pair.rotation = Rotation3::from_euler_angles(0.01, 0.1, -0.01).into_inner();
    pair.translation = Vector3::new(-60.0, 1.0, 4.0);
    pair.left.distortion =
        Distortion::Polynomial([-0.2, 0.05, 1e-3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    pair.right.distortion =
        Distortion::Polynomial([-0.18, 0.04, 0.0, 5e-4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    pair.write_opencv_yaml(folder.path().join("turned.yaml")).unwrap();
    good(folder.path(), &["render", "torus", "--place", "auto", "--calib", "turned.yaml", "--out", "pair"]);
    let error = error_of(folder.path(), "pair");
    assert!(error < 0.4, "{error} %");
}

#[test]
fn every_way_to_give_a_pair_gives_the_same_bytes() {
    let folder = TempDir::new().unwrap();
    let [left, right] = ["left.png", "right.png"].map(|name| image::open(torus(name)).unwrap().into_luma8());
    let (width, height) = left.dimensions();
    let put = |beside: bool| {
        let (w, h) = if beside { (2 * width, height) } else { (width, 2 * height) };
        let mut both = image::GrayImage::new(w, h);
        let (x, y) = if beside { (width, 0) } else { (0, height) };
        image::imageops::replace(&mut both, &left, 0, 0);
        image::imageops::replace(&mut both, &right, x.into(), y.into());
        both
    };
    put(true).save(folder.path().join("beside.png")).unwrap();
    put(false).save(folder.path().join("above.png")).unwrap();
    let euroc = folder.path().join("euroc");
    for (image, eye) in [(&left, "cam0"), (&right, "cam1")] {
        fs::create_dir_all(euroc.join(eye).join("data")).unwrap();
        // Colour, to be turned back into the same grey.
        let colour = image::DynamicImage::from(image.clone()).into_rgb8();
        colour.save(euroc.join(eye).join("data/1403636579763555584.png")).unwrap();
    }
    fs::copy(torus("calib.yaml"), euroc.join("calib.yaml")).unwrap();

    let calibration = torus("calib.yaml");
    let (left, right) = (torus("left.png"), torus("right.png"));
    let root = TORUS.path().to_str().unwrap();
    let name = TORUS.path().file_name().unwrap().to_str().unwrap();
    let ways: [(&[&str], PathBuf); 7] = [
        (&["beside.png", "--calib", &calibration], "".into()),
        (&["beside.png", "--calib", &calibration, "--layout", "side-by-side"], "".into()),
        (&["above.png", "--calib", &calibration], "".into()),
        (&[&right, &left, "--swap", "--jobs", "2"], "".into()),
        (&[&left, &right, "--focal", "375", "--baseline", "60"], "".into()),
        (&[root], name.into()),
        (&["euroc"], "1403636579763555584".into()),
    ];
    for (number, (way, below)) in ways.iter().enumerate() {
        let out = format!("out-{number}");
        let mut args = vec!["replay", "--no-pictures", "--out", &out];
        args.extend(*way);
        good(folder.path(), &args);
        assert!(results(&folder.path().join(&out).join(below)) == expected(), "{way:?}");
    }
}

#[test]
fn one_refused_pair_does_not_stop_the_others() {
    let folder = TempDir::new().unwrap();
    for pair in ["a", "b", "c"] {
        fs::create_dir(folder.path().join(pair)).unwrap();
        for file in ["left.png", "right.png"] {
            fs::copy(torus(file), folder.path().join(pair).join(file)).unwrap();
        }
    }
    fs::copy(torus("calib.yaml"), folder.path().join("calib.yaml")).unwrap();
    image::GrayImage::new(320, 240).save(folder.path().join("b/left.png")).unwrap();
    fs::write(folder.path().join("left_9.png"), "").unwrap();
    let output = run(folder.path(), &["replay", ".", "--no-pictures", "--json", "--out", "out"]);
    assert_eq!(output.status.code(), Some(1));
    let told = String::from_utf8(output.stderr).unwrap();
    assert!(told.starts_with("error: b: no object in the left image"), "{told}");
    assert!(told.ends_with("error: 1 of 3 pairs were refused\n"), "{told}");
    let told = json(std::str::from_utf8(&output.stdout).unwrap());
    let names: Vec<_> =
        told["pairs"].as_array().unwrap().iter().map(|pair| pair["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["a", "b", "c"]);
    assert!(told["pairs"][0]["report"]["model"]["vertices"].as_u64().unwrap() > 1000);
    assert!(told["pairs"][1]["error"].as_str().unwrap().contains("no object"));
    assert_eq!(told["without_partner"].as_array().unwrap().len(), 1);
    assert!(!folder.path().join("out/b").exists());
    assert!(results(&folder.path().join("out/c")) == results(&folder.path().join("out/a")));
    assert!(results(&folder.path().join("out/a"))[0] == expected()[0]);
}

#[test]
fn results_beside_their_pairs_do_not_hide_them() {
    let folder = TempDir::new().unwrap();
    for pair in ["many/a", "many/b"] {
        fs::create_dir_all(folder.path().join(pair)).unwrap();
        for file in ["left.png", "right.png", "calib.yaml"] {
            fs::copy(torus(file), folder.path().join(pair).join(file)).unwrap();
        }
    }
    for _ in 0..2 {
        let told = good(folder.path(), &["replay", "many", "--out", "many", "--json", "--jobs", "65535"]);
        assert_eq!(json(&told)["pairs"].as_array().unwrap().len(), 2);
        assert!(folder.path().join("many/a/pictures").is_dir());
    }
}

#[test]
fn timings_are_a_row_a_stage_beside_the_results() {
    let folder = TempDir::new().unwrap();
    for pair in ["many/a", "many/b"] {
        fs::create_dir_all(folder.path().join(pair)).unwrap();
        for file in ["left.png", "right.png", "calib.yaml"] {
            fs::copy(torus(file), folder.path().join(pair).join(file)).unwrap();
        }
    }
    let output = run(folder.path(), &["replay", "many", "--no-pictures", "--timings", "--json"]);
    assert_eq!(json(std::str::from_utf8(&output.stdout).unwrap())["pairs"].as_array().unwrap().len(), 2);
    let told = String::from_utf8(output.stderr).unwrap();
    let lines: Vec<&str> = told.lines().collect();
    assert_eq!(lines[0], "stage                   median ms   worst ms      share");
    let (last, rows) = lines[1..].split_last().unwrap();
    assert!(last.starts_with("2 pairs in ") && last.ends_with(" a second"), "{told}");
    let names: Vec<&str> = rows.iter().map(|row| row[..22].trim()).collect();
    let eye = |side| {
        ["threshold", "mask", "boundary", "contour", "distance", "thinning", "graph"]
            .map(|s| format!("{side} {s}"))
    };
    let expected = [
        ["load", "rectify"].map(String::from).to_vec(),
        [eye("left"), eye("right")].concat(),
        ["left hull", "right hull", "pair correspondence", "pair rows", "pair balls", "pair curves"]
            .map(String::from)
            .to_vec(),
        ["refine", "smooth", "radii", "grow", "surface", "write", "rest", "all"].map(String::from).to_vec(),
    ];
    assert_eq!(names, expected.concat());
    let share = |row: &&str| row[44..].trim_end_matches(" %").trim().parse::<f64>().unwrap();
    let shares: f64 = rows[..rows.len() - 1].iter().map(share).sum();
    assert!((shares - 100.0).abs() < 3.0, "{told}");
}

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

/// Names that are no text are JSON all the same.
#[cfg(target_os = "linux")]
#[test]
fn folders_of_any_name_are_told() {
    use std::os::unix::ffi::OsStrExt;
    let folder = TempDir::new().unwrap();
    let odd = std::ffi::OsStr::from_bytes(b"odd\xff");
    fs::create_dir(folder.path().join(odd)).unwrap();
    for file in ["left.png", "right.png", "calib.yaml"] {
        fs::copy(torus(file), folder.path().join(odd).join(file)).unwrap();
    }
    fs::copy(torus("left.png"), folder.path().join(odd).join("left_7.png")).unwrap();
    let host = || {
        let mut command = Command::cargo_bin("host").unwrap();
        command.current_dir(folder.path());
        command
    };
    let replay = host().args(["replay", ".", "--no-pictures", "--json", "--out"]).arg(odd).output().unwrap();
    assert_eq!(replay.status.code(), Some(0), "{replay:?}");
    let told = json(std::str::from_utf8(&replay.stdout).unwrap());
    assert!(told["pairs"][0]["calibration_found"].as_str().unwrap().ends_with("calib.yaml"), "{told}");
    assert!(told["without_partner"][0].as_str().unwrap().ends_with("left_7.png"), "{told}");
    let capture =
        ["capture", "--device", "/dev/null", "--focal", "300", "--baseline", "60", "--json", "--out"];
    assert_eq!(host().args(capture).arg(odd).output().unwrap().status.code(), Some(1));
    for (args, code) in [
        (&["man", "--json"][..], 0),
        (&["config", "--json", "--init"], 1),
        (&["convert", "--json", "a.ply"], 1),
    ] {
        let output = host().args(args).arg(odd).output().unwrap();
        assert_eq!(output.status.code(), Some(code), "{args:?}: {output:?}");
        json(std::str::from_utf8(&output.stdout).unwrap());
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
fn a_render_that_does_not_fit_is_told() {
    let folder = TempDir::new().unwrap();
    for (distance, told) in [("180", "does not fit"), ("3000", "px high")] {
        let args = [
            "render",
            "torus",
            "--place",
            "auto",
            "--distance",
            distance,
            "--size",
            "320x240",
            "--focal",
            "375",
        ];
        let output = run(folder.path(), &[&args[..], &["--out", "pair"]].concat());
        assert_eq!(output.status.code(), Some(0));
        let warning = String::from_utf8(output.stderr).unwrap();
        assert!(warning.starts_with("warning: the mesh") && warning.contains(told), "{warning}");
    }
}

#[test]
fn noise_follows_the_seed() {
    let folder = TempDir::new().unwrap();
    let left = |seed: &str, out: &str| {
        let mut args = vec![
            "render",
            "sphere",
            "--noise",
            "5",
            "--salt-and-pepper",
            "0.01",
            "--seed",
            seed,
            "--out",
            out,
        ];
        args.extend(SMALL);
        good(folder.path(), &args);
        ["left.png", "right.png"].map(|name| fs::read(folder.path().join(out).join(name)).unwrap())
    };
    let [first, again, other] = [left("1", "a"), left("1", "b"), left("2", "c")];
    assert!(first == again && first != other && first[0] != first[1]);
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
fn help_shows_how() {
    for args in [
        &["--help"][..],
        &["replay", "--help"],
        &["demo", "--help"],
        &["render", "--help"],
        &["evaluate", "--help"],
        &["convert", "--help"],
    ] {
        assert!(good(Path::new("."), args).contains("Examples:"), "{args:?}");
    }
    assert_eq!(good(Path::new("."), &["--version"]), concat!("host ", env!("CARGO_PKG_VERSION"), "\n"));
}

#[test]
fn convert_says_what_a_format_has_no_place_for() {
    let folder = TempDir::new().unwrap();
    let known = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                 property float confidence\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
                 0 0 0 1\n1 0 0 1\n0 1 0 1\n3 0 1 2\n";
    fs::write(folder.path().join("a.ply"), known).unwrap();
    let left_out = |output: &str| {
        let told = json(&good(folder.path(), &["convert", "a.ply", output, "--json"]));
        (told["left_out"].clone(), good(folder.path(), &["convert", "a.ply", output]).contains("left out"))
    };
    for output in ["b.stl", "b.obj"] {
        assert_eq!(left_out(output), ("confidence".into(), true), "{output}");
    }
    for output in ["b.ply", "b.glb"] {
        assert_eq!(left_out(output), (Value::Null, false), "{output}");
    }
}

#[test]
fn every_command_has_a_manual_page() {
    let folder = TempDir::new().unwrap();
    good(folder.path(), &["man", "pages"]);
    let pages = folder.path().join("pages");
    let main = fs::read_to_string(pages.join("host.1")).unwrap();
    for name in ["replay", "capture", "listen", "demo", "convert", "man"] {
        assert!(main.contains(&format!("host\\-{name}(1)")), "{name}");
        assert!(
            fs::read_to_string(pages.join(format!("host-{name}.1"))).unwrap().contains("Examples:"),
            "{name}"
        );
    }
}

#[test]
fn experiments_leave_a_page_its_figures_and_their_numbers() {
    let folder = TempDir::new().unwrap();
    let told = json(&good(folder.path(), &["experiments", "--quick", "--front", "auto", "--json"]));
    let left = folder.path().join("ossature-experiments");
    assert_eq!(json(&fs::read_to_string(left.join("experiments.json")).unwrap()), told);
    let mut names: Vec<_> = fs::read_dir(&left).unwrap().map(|e| e.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["animal", "experiments.json", "experiments.md", "figures", "torus", "torus_noise"]);
    // Every file that the page shows is there.
    let page = fs::read_to_string(left.join("experiments.md")).unwrap();
    assert_eq!(told["front"], "auto");
    assert!(page.contains("measured in the grey levels"));
    let links: Vec<_> =
        page.split("](").skip(1).map(|rest| rest.split(')').next().unwrap_or_default()).collect();
    assert!(links.len() > 15, "{links:?}");
    for link in links {
        assert!(left.join(link).is_file(), "{link}");
    }
    let error = |shape: usize, way: &str| {
        told["shapes"][shape]["ways"][way]["distance"]["symmetric"]["mean_mm"].as_f64().unwrap_or(f64::NAN)
    };
    assert_eq!(told["shapes"][0]["name"], "torus");
    for shape in 0..3 {
        for baseline in ["visual_hull", "inflation"] {
            assert!(error(shape, "full") < error(shape, baseline), "{shape}, {baseline}");
            assert_eq!(told["shapes"][shape]["ways"][baseline]["closed"], true, "{shape}, {baseline}");
        }
    }
    assert!(error(0, "full") < 0.2 && error(0, "full") < error(0, "paper"));
    let parts = told["parts"].as_array().unwrap();
    assert_eq!(parts.len(), 2 + 2 + 4 + 6);
    assert!(parts.iter().all(|row| row["mean_mm"]["full"].as_f64().is_some_and(|mm| mm < 8.0)), "{parts:?}");
    let missing = |point: &Value| point["missing_mm"].as_f64().unwrap();
    let branches = told["branches"].as_array().unwrap();
    assert!(3.0 * missing(&branches[3]) < missing(&branches[0]), "{branches:?}");
}
