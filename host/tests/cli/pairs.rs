//! Pairs, however they are given.

use super::*;

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

/// Puts the pair of the torus there as `a` and as `b`.
fn two_pairs(folder: &Path) {
    for pair in ["a", "b"].map(|name| folder.join(name)) {
        fs::create_dir_all(&pair).unwrap();
        for file in ["left.png", "right.png", "calib.yaml"] {
            fs::copy(torus(file), pair.join(file)).unwrap();
        }
    }
}

#[test]
fn results_beside_their_pairs_do_not_hide_them() {
    let folder = TempDir::new().unwrap();
    two_pairs(&folder.path().join("many"));
    for _ in 0..2 {
        let told = good(folder.path(), &["replay", "many", "--out", "many", "--json", "--jobs", "65535"]);
        assert_eq!(json(&told)["pairs"].as_array().unwrap().len(), 2);
        assert!(folder.path().join("many/a/pictures").is_dir());
    }
}

#[test]
fn timings_are_a_row_a_stage_beside_the_results() {
    let folder = TempDir::new().unwrap();
    two_pairs(&folder.path().join("many"));
    let output = run(folder.path(), &["replay", "many", "--no-pictures", "--timings", "--json"]);
    assert_eq!(json(std::str::from_utf8(&output.stdout).unwrap())["pairs"].as_array().unwrap().len(), 2);
    let told = String::from_utf8(output.stderr).unwrap();
    let lines: Vec<&str> = told.lines().collect();
    assert_eq!(lines[0], "stage                   median ms   worst ms      share");
    let (last, rows) = lines[1..].split_last().unwrap();
    assert!(last.starts_with("2 pairs in ") && last.ends_with(" a second"), "{told}");
    let names: Vec<&str> = rows.iter().map(|row| row[..22].trim()).collect();
    let eye = |side, stages: &[&str]| stages.iter().map(|s| format!("{side} {s}")).collect::<Vec<_>>();
    let outline = ["threshold", "mask", "boundary", "contour"];
    let skeleton = ["distance", "thinning", "graph"];
    let expected = [
        ["load", "rectify"].map(String::from).to_vec(),
        [eye("left", &outline), eye("right", &outline)].concat(),
        [eye("left", &skeleton), eye("right", &skeleton)].concat(),
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
