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
use oracle::program::{host, within};
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
        (&mesh, "a.step", "must end in .ply, .stl, .obj, .glb or .swc"),
        (&mesh, "a", "must end in"),
    ] {
        let error = host(&["convert", input, &within(folder.path(), output)]).unwrap_err().to_string();
        assert!(error.contains(told), "{output}: {error}");
        assert!(!folder.path().join(output).exists());
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
