//! What is rendered, and what is made of it.

use super::*;

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
    pair.left.lens = Lens::Polynomial([-0.2, 0.05, 1e-3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    pair.right.lens = Lens::Polynomial([-0.18, 0.04, 0.0, 5e-4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    pair.write_opencv_yaml(folder.path().join("turned.yaml")).unwrap();
    good(folder.path(), &["render", "torus", "--place", "auto", "--calib", "turned.yaml", "--out", "pair"]);
    let error = error_of(folder.path(), "pair");
    assert!(error < 0.4, "{error} %");
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
