use std::collections::HashMap;
use std::f64::consts::PI;

use super::*;
use crate::random::Random;
use crate::view::{Pinhole, View};

/// Volume by the divergence theorem, mm^3.
fn volume(mesh: &Mesh) -> f64 {
    let signed = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|v| mesh.vertices[v as usize] - PLACE);
        a.cross(&b).dot(&c) / 6.0
    };
    mesh.faces.iter().map(signed).sum()
}

fn area(mesh: &Mesh) -> f64 {
    let part = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|v| mesh.vertices[v as usize]);
        (b - a).cross(&(c - a)).norm() / 2.0
    };
    mesh.faces.iter().map(part).sum()
}

/// Vertices minus edges plus faces, after checking that every directed edge occurs once and its
/// reverse once, and that the faces around each vertex are one fan.
fn euler_characteristic(mesh: &Mesh, name: Shape) -> i64 {
    let mut next: HashMap<(u32, u32), u32> = HashMap::new();
    let mut corners = vec![0usize; mesh.vertices.len()];
    for &[a, b, c] in &mesh.faces {
        for (from, to, opposite) in [(a, b, c), (b, c, a), (c, a, b)] {
            assert_eq!(next.insert((from, to), opposite), None, "{name}: edge used twice");
            corners[from as usize] += 1;
        }
    }
    for &(from, to) in next.keys() {
        assert!(next.contains_key(&(to, from)), "{name}: edge without a partner");
    }
    for &[a, b, _] in &mesh.faces {
        let (mut spoke, mut fan) = (b, 0);
        loop {
            spoke = next[&(a, spoke)];
            fan += 1;
            if spoke == b {
                break;
            }
        }
        assert_eq!(fan, corners[a as usize], "{name}: two fans at one vertex");
    }
    mesh.vertices.len() as i64 - next.len() as i64 / 2 + mesh.faces.len() as i64
}

#[test]
fn every_mesh_is_closed_manifold_and_outward_at_any_cell() {
    for shape in Shape::ALL {
        let handles = match shape {
            Shape::Torus | Shape::TorusTilt | Shape::Teapot => 1,
            _ => 0,
        };
        for cell in [shape.cell(), 1.7 * shape.cell()] {
            let mesh = shape.mesh(cell);
            assert_eq!(euler_characteristic(&mesh, shape), 2 - 2 * handles, "{shape}");
            assert!(volume(&mesh) > 0.0, "{shape}");
        }
    }
}

/// A chord of a cell's diagonal, 1.7 times its side, misses a circle of 20 mm by 0.15 mm at most; the
/// mean loss of volume over area is a fraction of that.
#[test]
fn volumes_and_areas_are_those_of_the_formulas() {
    let (r, ring) = (20.0_f64, 40.0);
    let torus = [2.0 * PI * PI * ring * r * r, 4.0 * PI * PI * ring * r];
    let cases = [
        (Shape::Sphere, [PI * 4.0 / 3.0 * 60.0_f64.powi(3), 4.0 * PI * 3600.0]),
        (Shape::Torus, torus),
        (Shape::TorusTilt, torus),
        (Shape::Capsule, [PI * 900.0 * (90.0 + 40.0), 2.0 * PI * 30.0 * 150.0]),
        (Shape::Block, [64.0 * (104.0 * 72.0 - 48.0 * 38.0), 2.0 * 5664.0 + 64.0 * 2.0 * (104.0 + 72.0)]),
    ];
    for (shape, [expected_volume, expected_area]) in cases {
        let mesh = shape.mesh(shape.cell());
        assert!((volume(&mesh) / expected_volume - 1.0).abs() < 5e-3, "{shape}: {}", volume(&mesh));
        assert!((area(&mesh) / expected_area - 1.0).abs() < 5e-3, "{shape}: {}", area(&mesh));
    }
}

#[test]
fn vertices_lie_on_the_surface_and_in_both_images() {
    for shape in Shape::ALL {
        let (field, [low, high]) = (shape.field(), shape.bounds());
        let mesh = shape.mesh(shape.cell());
        for vertex in &mesh.vertices {
            assert!(field(vertex).abs() < 1e-3 * 2.0 * shape.cell(), "{shape}: {}", field(vertex));
            assert!(low <= *vertex && *vertex <= high, "{shape}: {vertex} outside {low} {high}");
            for view in Pinhole::pair() {
                let (u, v) = view.project(vertex).expect("in front of the camera");
                assert!((20.0..620.0).contains(&u) && (20.0..460.0).contains(&v), "{shape}: {u} {v}");
            }
        }
    }
}

/// Marching skips blocks by this promise.
#[test]
fn fields_have_slope_at_most_one() {
    let mut random = Random::new(7);
    for shape in Shape::ALL {
        let (field, [low, high]) = (shape.field(), shape.bounds());
        for _ in 0..20_000 {
            let p = low + (high - low).map(|side| side * random.uniform());
            let q = p + Vector3::from_fn(|_, _| 8.0 * random.uniform() - 4.0);
            let rise = (field(&p) - field(&q)).abs();
            assert!(rise <= (p - q).norm() + 1e-9, "{shape}: {rise} over {}", (p - q).norm());
        }
    }
}

#[test]
fn a_mesh_is_the_same_for_any_number_of_threads() {
    let mesh = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
        pool.install(|| Shape::Teapot.mesh(5.0))
    };
    assert_eq!(mesh(1), mesh(2));
}

#[test]
fn names_are_parsed_and_a_wrong_one_lists_the_right_ones() {
    for shape in Shape::ALL {
        assert_eq!(shape.to_string().parse(), Ok(shape));
    }
    let error = "kettle".parse::<Shape>().expect_err("no such shape");
    let expected = "there is no shape `kettle`; the shapes are \
                    sphere, torus, torus_tilt, capsule, screwdriver, block, teapot, mouse, animal";
    assert_eq!(error.to_string(), expected);
}
