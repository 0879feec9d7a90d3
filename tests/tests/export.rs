//! What `host convert` writes says the same to other programs: bounds, volume, orientation, curves.
//!
//! glTF is opened by the crate `gltf`, which also validates it, STL and OBJ by `stl_io` and `tobj`. Where
//! `OSSATURE_RULER` names a Python with `trimesh`, that opens all of them too; without, the test says so.

use host::curves::Curves;
use host::geometry::Geometry;
use host::mesh::Mesh;
use host::mesh::read::{read, read_geometry};
use host::shape::Shape;
use nalgebra::{Point3, Vector3};
use oracle::nurbs;
use oracle::program::{host, within};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

/// A shape off all axes, so that no turn of it goes unnoticed.
fn shape() -> Mesh {
    let mut mesh = Shape::Teapot.mesh(6.0);
    mesh.vertices.iter_mut().for_each(|p| *p += Vector3::new(11.0, -23.0, 450.0));
    mesh
}

fn skeleton() -> Curves {
    let points: Vec<_> = (0..9).map(|i| Point3::new(f64::from(i), f64::from(i % 3) * 2.0, 400.0)).collect();
    let radii = (0..9).map(|i| 1.0 + f64::from(i) / 4.0).collect();
    Curves { points, radii, edges: (1..9).map(|i| [i - 1, i]).collect() }
}

/// Bounds, volume and number of faces.
type Measures = ([Point3<f64>; 2], f64, usize);

fn measures(mesh: &Mesh) -> Measures {
    (mesh.bounds().unwrap(), mesh.volume(), mesh.faces.len())
}

fn alike(found: &Measures, truth: &Measures, name: &str) {
    for (a, b) in found.0.iter().zip(&truth.0) {
        assert!((a - b).amax() < 1e-3, "{name}: {a} is not {b}");
    }
    assert!((found.1 / truth.1 - 1.0).abs() < 1e-4, "{name}: volume {} is not {}", found.1, truth.1);
    assert_eq!(found.2, truth.2, "{name}");
}

/// From the axes and metres of glTF back to the camera's, mm.
fn back([x, y, z]: [f32; 3]) -> Point3<f64> {
    Point3::from([x, -y, -z].map(f64::from)) * 1000.0
}

fn gltf_mesh(path: &Path) -> Mesh {
    let (document, buffers, _) = gltf::import(path).unwrap();
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    assert_eq!(primitive.mode(), gltf::mesh::Mode::Triangles);
    let reader = primitive.reader(|buffer| Some(&buffers[buffer.index()]));
    let vertices: Vec<_> = reader.read_positions().unwrap().map(back).collect();
    let normals: Vec<_> = reader.read_normals().unwrap().collect();
    assert_eq!(normals.len(), vertices.len());
    let faces: Vec<u32> = reader.read_indices().unwrap().into_u32().collect();
    let mesh = Mesh { vertices, faces: faces.as_chunks().0.to_vec() };
    let outward = mesh.faces.iter().enumerate().filter(|(face, corners)| {
        let normal = normals[corners[0] as usize];
        mesh.area_normal(*face).dot(&back(normal).coords) > 0.0
    });
    assert!(outward.count() * 100 > mesh.faces.len() * 99, "normals look outward");
    mesh
}

#[test]
fn a_mesh_is_the_same_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let source = within(folder.path(), "shape.ply");
    host::export::ply::write_mesh(Path::new(&source), &shape(), &[]).unwrap();
    let truth = measures(&shape());
    for format in ["stl", "obj", "ply", "glb"] {
        let path = within(folder.path(), &format!("out.{format}"));
        host(&["convert", &source, &path]).unwrap();
        let path = Path::new(&path);
        let mesh = if format == "glb" { gltf_mesh(path) } else { read(path).unwrap() };
        alike(&measures(&mesh), &truth, format);
    }
    let bytes = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert!(bytes("out.stl").starts_with(b"Ossature; unit mm;"));
    assert!(bytes("out.obj").starts_with(b"# Ossature; unit mm;"));
}

#[test]
fn confidence_goes_along_where_the_format_has_a_place_for_it() {
    let folder = tempfile::tempdir().unwrap();
    let [source, copy, glb, stl] =
        ["known.ply", "copy.ply", "out.glb", "out.stl"].map(|name| within(folder.path(), name));
    let known: Vec<f64> = (0..shape().vertices.len()).map(|i| f64::from((i % 9) as u8) / 8.0).collect();
    let scalars = [("confidence", &known[..])];
    host::export::ply::write_known_mesh(Path::new(&source), &shape(), &scalars, &[]).unwrap();
    for output in [&copy, &glb, &stl] {
        host(&["convert", &source, output]).unwrap();
    }
    let Geometry::Mesh { mesh, confidence } = read_geometry(Path::new(&copy)).unwrap() else { panic!() };
    assert_eq!((mesh.vertices.len(), confidence), (known.len(), known.clone()));

    let (document, buffers, _) = gltf::import(&glb).unwrap();
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    let accessor = primitive.get(&gltf::Semantic::Extras("CONFIDENCE".into())).unwrap();
    let data = |buffer: gltf::Buffer<'_>| Some(&buffers[buffer.index()][..]);
    let found: Vec<f32> = gltf::accessor::Iter::new(accessor, data).unwrap().collect();
    assert!(found.iter().map(|value| f64::from(*value)).eq(known));
}

#[test]
fn a_skeleton_is_the_same_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let source = within(folder.path(), "skeleton.ply");
    host::export::ply::write_curves(Path::new(&source), &skeleton(), &[]).unwrap();
    assert_eq!(read_geometry(Path::new(&source)).unwrap(), Geometry::Curves(skeleton()));

    let path = within(folder.path(), "skeleton.glb");
    host(&["convert", &source, &path]).unwrap();
    let (document, buffers, _) = gltf::import(&path).unwrap();
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    assert_eq!(primitive.mode(), gltf::mesh::Mode::Lines);
    let reader = primitive.reader(|buffer| Some(&buffers[buffer.index()]));
    for (found, truth) in reader.read_positions().unwrap().map(back).zip(skeleton().points) {
        assert!((found - truth).amax() < 1e-3, "{found} is not {truth}");
    }
    let radius = primitive.get(&gltf::Semantic::Extras("RADIUS".into())).unwrap();
    let data = |buffer: gltf::Buffer<'_>| Some(&buffers[buffer.index()][..]);
    let radii: Vec<f32> = gltf::accessor::Iter::new(radius, data).unwrap().collect();
    let metres = skeleton().radii.into_iter().map(|r| (r / 1000.0) as f32);
    assert!(radii.iter().copied().eq(metres), "{radii:?}");
    let ends: Vec<u32> = reader.read_indices().unwrap().into_u32().collect();
    assert_eq!(ends, skeleton().edges.as_flattened());

    // A folder of results gives its skeleton where only that fits.
    let path = within(folder.path(), "skeleton.swc");
    host(&["convert", folder.path().to_str().unwrap(), &path]).unwrap();
    let text = std::fs::read_to_string(path).unwrap();
    let lines: Vec<Vec<f64>> = text
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| line.split(' ').map(|word| word.parse().unwrap()).collect())
        .collect();
    let truth = skeleton();
    assert_eq!(lines.len(), truth.points.len());
    for (i, line) in lines.iter().enumerate() {
        let p = truth.points[i];
        let parent = if i == 0 { -1.0 } else { i as f64 };
        assert_eq!(*line, [i as f64 + 1.0, 0.0, p.x, p.y, p.z, truth.radii[i], parent]);
    }
}

/// The splines of a torus, whose branch is a ring, and of a capsule are the core's curves: a point of theirs, by the
/// recursion of Cox and de Boor, is seen where the curve in the image runs, and as large.
#[test]
fn splines_are_the_cores_curves_in_space() {
    for (shape, ring) in [("torus", true), ("capsule", false)] {
        let folder = tempfile::tempdir().unwrap();
        let [out, path] = ["out", "curves.json"].map(|name| within(folder.path(), name));
        host(&["demo", shape, "--no-report", "--out", &out]).unwrap();
        host(&["convert", &out, &path]).unwrap();
        let json = |path: &Path| -> Value { serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap() };
        let (report, document) = (json(&Path::new(&out).join("report.json")), json(Path::new(&path)));
        assert_eq!((&document["unit"], &document["coordinates"][3]), (&"mm".into(), &"radius".into()));
        let number = |value: &Value| value.as_f64().unwrap();
        let camera = &report["calibration"];
        let [f, offset] = ["rectified_focal_px", "disparity_offset_px"].map(|name| number(&camera[name]));
        let axis = [0, 1].map(|k| number(&camera["rectified_axis_px"][k]));
        let (splines, curves) =
            (document["curves"].as_array().unwrap(), report["curves"]["left"].as_array().unwrap());
        assert!(!splines.is_empty() && splines.len() == curves.len());
        assert_eq!(splines.iter().any(|spline| spline["closed"] == true), ring, "{shape}");
        for (spline, curve) in splines.iter().zip(curves) {
            let list =
                |name: &str| -> Vec<f64> { spline[name].as_array().unwrap().iter().map(number).collect() };
            let (knots, weights, controls) = (list("knots"), list("weights"), &spline["controls"]);
            assert_eq!(knots.len(), weights.len() + 4);
            let image: Vec<([f64; 4], f64)> = curve["controls"]
                .as_array()
                .unwrap()
                .iter()
                .map(|c| {
                    (
                        ["u_px", "v_px", "radius_px", "disparity_px"].map(|name| number(&c[name])),
                        number(&c["weight"]),
                    )
                })
                .collect();
            let end = knots[weights.len()];
            for t in (0..=40).map(|k| f64::from(k) / 40.0 * end) {
                let shares: Vec<f64> =
                    weights.iter().enumerate().map(|(i, w)| w * nurbs::basis(&knots, i, 3, t)).collect();
                let sum: f64 = shares.iter().sum();
                let at = |axis: usize| -> f64 {
                    shares
                        .iter()
                        .enumerate()
                        .map(|(i, share)| share * number(&controls[i][axis]))
                        .sum::<f64>()
                        / sum
                };
                let [x, y, z, radius] = [0, 1, 2, 3].map(at);
                let scale = f / z;
                let baseline = number(&camera["baseline_mm"]);
                let found =
                    [axis[0] + x * scale, axis[1] + y * scale, radius * scale, baseline * scale - offset];
                let truth = nurbs::evaluate(&image, ring, t);
                for (a, b) in found.iter().zip(truth) {
                    assert!((a - b).abs() < 1e-3, "{shape} at {t}: {found:?} is not {truth:?}");
                }
            }
        }
    }
}

#[test]
fn points_without_edges_stay_points() {
    let folder = tempfile::tempdir().unwrap();
    let source = within(folder.path(), "boundary.ply");
    let points = Curves { points: skeleton().points, ..Curves::default() };
    host::export::ply::write_curves(Path::new(&source), &points, &[]).unwrap();
    let [glb, obj] = ["points.glb", "points.obj"].map(|name| within(folder.path(), name));
    host(&["convert", &source, &glb]).unwrap();
    let (document, buffers, _) = gltf::import(&glb).unwrap();
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    assert_eq!(primitive.mode(), gltf::mesh::Mode::Points);
    let reader = primitive.reader(|buffer| Some(&buffers[buffer.index()]));
    assert_eq!(reader.read_positions().unwrap().count(), points.points.len());
    host(&["convert", &source, &obj]).unwrap();
    let text = std::fs::read_to_string(obj).unwrap();
    assert_eq!(text.lines().filter(|line| line.starts_with("p ")).count(), points.points.len());
}

#[test]
fn what_a_format_cannot_hold_is_refused_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let [mesh, curves] = ["mesh.ply", "curves.ply"].map(|name| within(folder.path(), name));
    host::export::ply::write_mesh(Path::new(&mesh), &shape(), &[]).unwrap();
    host::export::ply::write_curves(Path::new(&curves), &skeleton(), &[]).unwrap();
    for (input, output, told) in [
        (&mesh, "a.swc", "SWC holds skeletons alone"),
        (&curves, "a.stl", "STL holds triangles alone"),
        (&mesh, "a.json", "JSON holds NURBS alone"),
        (&mesh, "a.step", "must end in .ply, .stl, .obj, .glb, .swc or .json"),
        (&mesh, "a", "must end in"),
    ] {
        let error = host(&["convert", input, &within(folder.path(), output)]).unwrap_err().to_string();
        assert!(error.contains(told), "{output}: {error}");
        assert!(!folder.path().join(output).exists());
    }
}

#[test]
fn a_report_without_curves_is_refused_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let [report, output] = ["report.json", "curves.json"].map(|name| within(folder.path(), name));
    for (text, told) in [("{\"curves_mm\": null}", "no curves in space"), ("[", "is no report.json")] {
        std::fs::write(&report, text).unwrap();
        for input in [report.as_str(), folder.path().to_str().unwrap()] {
            let error = host(&["convert", input, &output]).unwrap_err();
            assert!(error.contains(told), "{error}");
        }
    }
    assert!(!Path::new(&output).exists());
}

/// Names of files are bytes.
#[cfg(unix)]
#[test]
fn a_file_of_any_name_is_written_and_told_of() {
    use clap::Parser;
    use std::ffi::OsString;
    use std::os::unix::ffi::OsStringExt;
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join(OsString::from_vec(b"shape\xff.ply".to_vec()));
    let output = folder.path().join(OsString::from_vec(b"model\xfe.stl".to_vec()));
    host::export::ply::write_mesh(&source, &shape(), &[]).unwrap();
    for more in [&[][..], &["--json"]] {
        let words = ["host", "convert"].into_iter().chain(more.iter().copied()).map(OsString::from);
        let words = words.chain([source.clone().into(), output.clone().into()]);
        host::command::Cli::try_parse_from(words).unwrap().run().unwrap();
        assert_eq!(read(&output).unwrap().faces.len(), shape().faces.len());
    }
}

#[test]
fn another_program_reads_the_same() {
    let Some(python) = std::env::var_os("OSSATURE_RULER") else {
        eprintln!(
            "SKIPPED: OSSATURE_RULER is not set, so no file is opened by trimesh; ./ci.sh test sets it up"
        );
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let source = within(folder.path(), "shape.ply");
    host::export::ply::write_mesh(Path::new(&source), &shape(), &[]).unwrap();
    let (bounds, volume, faces) = measures(&shape());
    for (format, unit) in [("stl", 1.0), ("obj", 1.0), ("ply", 1.0), ("glb", 1000.0)] {
        let path = within(folder.path(), &format!("out.{format}"));
        host(&["convert", &source, &path]).unwrap();
        let script = "import sys, trimesh; m = trimesh.load(sys.argv[1], force='mesh'); \
            print(*m.bounds.ravel(), m.volume, len(m.faces), int(m.is_watertight))";
        let run = Command::new(&python).args(["-c", script, &path]).output().unwrap();
        assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
        let said = String::from_utf8(run.stdout).unwrap();
        let numbers: Vec<f64> = said.split_whitespace().map(|word| word.parse().unwrap()).collect();
        let at = |k: usize| Point3::new(numbers[k], numbers[k + 1], numbers[k + 2]) * unit;
        // In glTF y and z run the other way, so that the lowest becomes the highest.
        let [low, high] = [at(0), at(3)];
        let found = if unit == 1.0 {
            [low, high]
        } else {
            [Point3::new(low.x, -high.y, -high.z), Point3::new(high.x, -low.y, -low.z)]
        };
        let cubic = numbers[6] * unit.powi(3);
        alike(&(found, cubic, numbers[7] as usize), &(bounds, volume, faces), format);
        assert_eq!(numbers[8], 1.0, "{format} is watertight");
    }
}
