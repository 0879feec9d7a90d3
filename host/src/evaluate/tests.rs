//! Closed forms as oracles.
//!
//! The measures were also held against an independent ruler in Python (trimesh's rays and sections,
//! SciPy's trees, 20,000 independent points a side): every shape against itself moved and enlarged by
//! 3 %, and against the capsule. Volume and silhouette overlap, volume ratio and bodies agreed to all
//! four digits printed; symmetric means to 0.8 % and their RMS to 0.7 %, which is the sampling error of
//! the ruler's points; sections to 0.001 mm where the long axis is a side of the box; elsewhere
//! single rows to 4 % and their mean to 0.4 %, as the ruler takes its axis from random points and we from the surface itself.

use nalgebra::Vector3;

use super::*;
use crate::shape::Shape;
use crate::view::Pinhole;

const PLACE: Point3<f64> = Point3::new(30.0, 0.0, 450.0);

fn scaled(mesh: &Mesh, factor: f64) -> Mesh {
    let vertices = mesh.vertices.iter().map(|v| PLACE + (v - PLACE) * factor).collect();
    Mesh { vertices, faces: mesh.faces.clone() }
}

fn shifted(mesh: &Mesh, by: Vector3<f64>) -> Mesh {
    Mesh { vertices: mesh.vertices.iter().map(|v| v + by).collect(), faces: mesh.faces.clone() }
}

/// A cube of side `side` at the place of the shapes.
fn cube(side: f64) -> Mesh {
    let corner = |i: u32| Vector3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2));
    let vertices = (0..8).map(|i| PLACE + (corner(i) - Vector3::repeat(0.5)) * side).collect();
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    Mesh { vertices, faces: quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect() }
}

fn measure(model: &Mesh, truth: &Mesh) -> Evaluation {
    evaluate(model, truth, &Pinhole::pair(), &Options::default())
}

fn close(value: f64, expected: f64, tolerance: f64) {
    assert!((value - expected).abs() <= tolerance, "{value} is not {expected} to {tolerance}");
}

#[test]
fn a_mesh_is_itself() {
    let mesh = Shape::Teapot.mesh(4.0);
    let e = measure(&mesh, &mesh);
    let d = e.distance.expect("both have area");
    assert!(d.symmetric.max_mm < 1e-9);
    assert_eq!((e.closed, e.bodies), (true, 1));
    assert_eq!((e.volume_iou, e.volume_ratio), (Some(1.0), Some(1.0)));
    assert_eq!(e.silhouette_iou, [1.0, 1.0]);
    assert_eq!((e.sections.mean_mm, e.sections.missing), (Some(0.0), 0));
}

/// Balls of 60 and 63 mm: 3 mm apart everywhere; circles for sections, exact but for their chords.
#[test]
fn a_larger_ball_is_larger_by_the_difference_of_radii() {
    let truth = Shape::Sphere.mesh(2.0);
    let e = measure(&scaled(&truth, 1.05), &truth);
    let d = e.distance.expect("both have area");
    for deviation in [d.model_to_truth, d.truth_to_model, d.symmetric] {
        for value in [deviation.mean_mm, deviation.rms_mm, deviation.p95_mm, deviation.max_mm] {
            close(value, 3.0, 0.04);
        }
        close(deviation.mean_pct, 100.0 * deviation.mean_mm / e.truth_diagonal_mm, 1e-9);
    }
    close(e.truth_diagonal_mm, 120.0 * 3.0_f64.sqrt(), 0.1);
    close(e.volume_ratio.expect("closed"), 1.05_f64.powi(3), 1e-9);
    close(e.volume_iou.expect("closed"), 1.05_f64.powi(-3), 2e-3);
    for row in &e.sections.rows {
        let height: f64 = 60.0 * (2.0 * (row.section as f64 - 0.5) / 8.0 - 1.0);
        let gap = (63.0 * 63.0 - height * height).sqrt() - (60.0 * 60.0 - height * height).sqrt();
        close(row.model_to_truth_mm.expect("cuts both"), gap, 0.05);
        close(row.truth_to_model_mm.expect("cuts both"), gap, 0.05);
    }
}

/// A cube of 100 mm against itself 2 mm to the right. Integrals over the faces of the shifted cube:
/// outer face 2 * 100^2; inner face the same less 789.3 along its rim, where other faces are nearer;
/// four strips of 2 mm beyond the truth's edge, 4 * 100 * 2. Together 40,010.7 over 60,000 mm^2.
#[test]
fn a_shifted_cube_has_the_mean_distance_of_the_integral() {
    let truth = cube(100.0);
    let e = measure(&shifted(&truth, Vector3::new(2.0, 0.0, 0.0)), &truth);
    let d = e.distance.expect("both have area");
    for deviation in [d.model_to_truth, d.truth_to_model, d.symmetric] {
        close(deviation.mean_mm, 0.66684, 2e-3);
        close(deviation.max_mm, 2.0, 1e-9);
        close(deviation.p95_mm, 2.0, 1e-9);
    }
    close(e.volume_iou.expect("closed"), 98.0 / 102.0, 2.0 / 96.0);
    assert_eq!(e.volume_ratio, Some(1.0));
}

#[test]
fn a_small_model_misses_sections() {
    let truth = cube(100.0);
    let e = measure(&cube(30.0), &truth);
    // Sections lie 6.25, 18.75, .. from the middle; the small cube reaches 15.
    assert_eq!(e.sections.missing, 6);
    assert_eq!(e.sections.axis, [1.0, 0.0, 0.0]);
    close(e.sections.rows[3].model_to_truth_mm.expect("cuts both"), 35.0, 0.01);
}

#[test]
fn an_open_mesh_has_no_volume_and_two_cubes_are_two_bodies() {
    let truth = cube(100.0);
    let mut open = truth.clone();
    open.faces.pop();
    let e = measure(&open, &truth);
    assert_eq!((e.closed, e.volume_iou, e.volume_ratio, e.bodies), (false, None, None, 1));

    let mut two = cube(20.0);
    let other = shifted(&cube(20.0), Vector3::new(30.0, 0.0, 0.0));
    two.faces.extend(other.faces.iter().map(|face| face.map(|v| v + 8)));
    two.vertices.extend(other.vertices);
    let e = measure(&two, &truth);
    assert_eq!((e.closed, e.bodies), (true, 2));
    close(e.volume_ratio.expect("closed"), 2.0 * 0.008, 1e-12);
}

#[test]
fn loose_triangles_and_a_mesh_turned_inside_out_count_as_the_solid() {
    let truth = cube(100.0);
    let vertices: Vec<_> = truth.faces.iter().flatten().map(|&v| truth.vertices[v as usize]).collect();
    let faces = (0..12).map(|face| [3 * face + 1, 3 * face, 3 * face + 2]).collect();
    let e = measure(&Mesh { vertices, faces }, &truth);
    assert_eq!((e.closed, e.bodies, e.volume_ratio, e.volume_iou), (true, 1, Some(1.0), Some(1.0)));
}

#[test]
fn an_empty_model_is_measured_without_a_distance() {
    let e = measure(&Mesh::default(), &cube(100.0));
    assert_eq!((e.closed, e.bodies, e.distance, e.volume_iou), (false, 0, None, None));
    assert_eq!((e.sections.missing, e.sections.mean_mm), (8, None));
    assert_eq!(e.silhouette_iou, [0.0, 0.0]);
}

#[test]
fn an_evaluation_is_the_same_for_any_number_of_threads() {
    let truth = Shape::Torus.mesh(5.0);
    let model = scaled(&truth, 1.02);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
        pool.install(|| measure(&model, &truth))
    };
    assert_eq!(run(1), run(2));
}
