//! The measured front, held against formulas, against the promises of the mesh, and against the cases with known truth
//! (`oracle/src/cases.rs` says where: without them their test says so and passes).

use host::bvh::Bvh;
use host::evaluate::{Options as Ruler, evaluate};
use host::mesh::Mesh;
use host::reconstruct::{Front, Options, Reconstruction, reconstruct};
use host::shape::Shape;
use host::view::Pinhole;
use nalgebra::{Point3, Vector3};
use oracle::cases::{cases, folder, name, open};
use oracle::confidence::{ratios, shares, vertices};
use oracle::looks::Look;
use oracle::mesh_checker::check;
use oracle::scene::{Pair, model};

/// Where the shapes stand, mm.
const PLACE: Point3<f64> = Point3::new(30.0, 0.0, 450.0);
/// Half axes of an ellipsoid, mm: half as deep as it is high, and no wider than its depth allows.
const AXES: Vector3<f64> = Vector3::new(55.0, 60.0, 30.0);

fn with(front: Front) -> Options {
    Options { front, ..Options::default() }
}

fn made(pair: &Pair, front: Front) -> Reconstruction {
    model(pair, &with(front)).unwrap()
}

/// An ellipsoid, from the mesh of a ball.
fn ellipsoid() -> Mesh {
    let mut mesh = Shape::Sphere.mesh(Shape::Sphere.cell());
    for vertex in &mut mesh.vertices {
        *vertex = PLACE + (*vertex - PLACE).component_mul(&AXES) / 60.0;
    }
    mesh
}

/// Depth at which a ray of the left eye meets the ellipsoid first, mm.
fn depth(ray: &Vector3<f64>) -> Option<f64> {
    let (ray, centre) = (ray.component_div(&AXES), PLACE.coords.component_div(&AXES));
    let (a, b, c) = (ray.norm_squared(), ray.dot(&centre), centre.norm_squared() - 1.0);
    let square = b * b - a * c;
    (square >= 0.0).then(|| (b - square.sqrt()) / a)
}

/// Mean distance along their rays of the vertices in front from the ellipsoid, mm, the outermost tenth left out.
fn off_in_depth(mesh: &Mesh) -> f64 {
    let off = |vertex: &Point3<f64>| {
        let across = (vertex - PLACE).component_div(&AXES).xy().norm();
        let ray = vertex.coords / vertex.z;
        (across < 0.9 && vertex.z < PLACE.z).then(|| depth(&ray).map(|z| (vertex.z - z).abs())).flatten()
    };
    let all: Vec<f64> = mesh.vertices.iter().filter_map(off).collect();
    all.iter().sum::<f64>() / all.len() as f64
}

/// Symmetric mean distance, % of the diagonal.
fn error(model: &Mesh, truth: &Mesh) -> f64 {
    let ruler = Ruler { samples: 5000, grid: 2, sections: 1, seed: 0 };
    evaluate::<Pinhole>(model, truth, &[], &ruler).distance.unwrap().symmetric.mean_pct
}

/// The pair, with other grey levels in the right image.
fn right_by([left, mut right]: Pair, level: impl Fn(u8) -> u8) -> Pair {
    right.iter_mut().for_each(|grey| *grey = level(*grey));
    [left, right]
}

/// The look of this name.
fn look(name: &str) -> Look {
    Look::all().into_iter().find(|look| look.name == name).unwrap()
}

#[test]
fn an_elliptical_cross_section_is_recovered_from_shading_and_from_marks() {
    for (name, part) in [("matte", 0.25), ("clouds", 0.1), ("checks", 0.1)] {
        let pair = look(name).see(&ellipsoid());
        let [balls, grey, auto] =
            [Front::Balls, Front::Grey, Front::Auto].map(|front| off_in_depth(&made(&pair, front).mesh));
        println!("{name}: balls {balls:.2} mm, grey {grey:.2} mm, auto {auto:.2} mm");
        assert!(balls > 5.0, "{name}: balls are off by {balls:.2} mm");
        assert!(grey < part * balls, "{name}: {grey:.2} of {balls:.2} mm");
        assert!(auto < 1.2 * part * balls, "{name}: {auto:.2} of {balls:.2} mm");
    }
}

#[test]
fn a_right_eye_that_sees_half_as_bright_is_no_hindrance() {
    let pair = right_by(look("clouds").see(&ellipsoid()), |grey| grey / 2);
    let [balls, auto] = [Front::Balls, Front::Auto].map(|front| made(&pair, front));
    let gain = auto.front.unwrap().gain;
    let [balls, auto] = [balls.mesh, auto.mesh].map(|mesh| off_in_depth(&mesh));
    println!("gain {gain:.3}: balls {balls:.2} mm, auto {auto:.2} mm");
    assert!((gain - 2.0).abs() < 0.1, "{gain}");
    assert!(auto < 0.2 * balls, "{auto:.2} of {balls:.2} mm");
}

#[test]
fn eyes_that_contradict_each_other_everywhere_leave_the_balls_as_they_are() {
    // What is bright to the left eye is dark to the right one.
    let turned = |grey: u8| if grey < 60 { grey } else { 255 - grey / 2 };
    let pair = right_by(look("matte").pair(Shape::Teapot), turned);
    let [balls, auto] = [Front::Balls, Front::Auto].map(|front| made(&pair, front));
    let front = auto.front.unwrap();
    assert_eq!((front.distrusted, front.share), (1.0, 0.0));
    assert!(auto.mesh.vertices == balls.mesh.vertices);
}

#[test]
fn highlights_do_not_mislead_what_is_trusted() {
    for shape in [Shape::Sphere, Shape::Torus] {
        let (pair, truth) = (look("glossy").pair(shape), shape.mesh(shape.cell()));
        let [balls, auto] = [Front::Balls, Front::Auto].map(|front| error(&made(&pair, front).mesh, &truth));
        println!("{shape}: balls {balls:.3}, auto {auto:.3} %");
        assert!(auto <= balls + 0.03, "{shape}: {auto:.3} against {balls:.3} %");
    }
}

#[test]
fn the_mesh_keeps_its_promises_and_every_vertex_has_a_confidence() {
    for shape in [Shape::Teapot, Shape::Animal, Shape::TorusTilt] {
        let pair = look("clouds").pair(shape);
        let balls = made(&pair, Front::Balls);
        assert!(balls.front.is_none());
        for front in [Front::Grey, Front::Auto] {
            let grey = made(&pair, front);
            let vertices: Vec<[f64; 3]> = grey.mesh.vertices.iter().map(|&p| p.into()).collect();
            let report =
                check(&vertices, &grey.mesh.faces).unwrap_or_else(|fault| panic!("{shape}: {fault:?}"));
            assert_eq!(report.bodies, 1, "{shape}");
            assert_eq!(grey.mesh.faces, balls.mesh.faces, "{shape}: vertices move, faces stay");
            let measured = grey.front.unwrap();
            assert_eq!(measured.confidence.len(), vertices.len());
            assert!(measured.confidence.iter().all(|c| (0.0..=1.0).contains(c)), "{shape}");
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let pair = look("noise 2").pair(Shape::Teapot);
    let bits = |threads: usize, front| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let made = pool.install(|| made(&pair, front));
        let confidence = made.front.map(|front| front.confidence).unwrap_or_default();
        let places = made.mesh.vertices.iter().flat_map(|p| [p.x, p.y, p.z]);
        places.chain(confidence).map(f64::to_bits).collect::<Vec<_>>()
    };
    for front in [Front::Grey, Front::Auto] {
        let one = bits(1, front);
        assert!(one == bits(2, front) && one == bits(5, front), "{front:?}");
    }
}

/// What each case may have by grey levels, % of the diagonal, with room for the ruler's sampling.
const LIMITS: [(&str, f64); 4] = [("teapot", 1.3), ("mouse", 2.9), ("block", 2.45), ("real_dino1", 2.3)];

#[test]
fn the_visible_side_of_the_cases_is_nearer_to_the_truth() {
    let Some(folder) = folder() else { return };
    let mut sums = [0.0; 3];
    let cases = cases(&folder);
    for case in &cases {
        let ([left, right], camera) = open(case);
        let truth = host::mesh::read::read(&case.join("truth.ply")).unwrap();
        let ruler = Ruler { samples: 5000, grid: 2, sections: 1, seed: 0 };
        let made = [Front::Balls, Front::Grey, Front::Auto]
            .map(|front| reconstruct(left.clone(), right.clone(), &camera, &with(front), &mut ()).unwrap());
        let errors = made.each_ref().map(|made| {
            let measured = evaluate::<Pinhole>(&made.mesh, &truth, &[], &ruler);
            assert!(measured.closed && measured.bodies == 1, "{}", name(case));
            measured.distance.unwrap().symmetric.mean_pct
        });
        println!("{:12} balls {:.2}, grey {:.2}, auto {:.2} %", name(case), errors[0], errors[1], errors[2]);
        let limit =
            LIMITS.iter().find(|(known, _)| *known == name(case)).map_or(f64::INFINITY, |known| known.1);
        assert!(errors[1] <= limit.min(errors[0] + 0.06), "{}: {errors:?}", name(case));
        assert!(errors[2] <= errors[0] + 0.06, "{}: {errors:?}", name(case));
        for (sum, error) in sums.iter_mut().zip(errors) {
            *sum += error / cases.len() as f64;
        }
    }
    println!("means {sums:.3?} %");
    assert!(sums[1] <= sums[0] - 0.14, "{sums:.3?}");
}

/// The vertices of a model that look at the left eye, but for those near the outline, each with its normal.
fn inner(mesh: &Mesh) -> Vec<(usize, Vector3<f64>)> {
    let mut normals = vec![Vector3::zeros(); mesh.vertices.len()];
    for (face, corners) in mesh.faces.iter().enumerate() {
        corners.iter().for_each(|&corner| normals[corner as usize] += mesh.area_normal(face));
    }
    let inner = |(vertex, point): (usize, &Point3<f64>)| {
        let across = (point - PLACE).component_div(&AXES).xy().norm();
        (across < 0.8 && point.z < PLACE.z).then(|| (vertex, normals[vertex].normalize()))
    };
    mesh.vertices.iter().enumerate().filter_map(inner).collect()
}

/// Mean of what the confidence expects of the inner vertices of an ellipsoid's model by grey levels, and the spread of
/// their surfaces under other noise, mm: along the normal, where rays through the vertices of the first model meet
/// those of the others.
fn expected_and_spread(mut look: Look) -> [f64; 2] {
    let models: Vec<_> = (1..=8)
        .map(|k| {
            look.seed = 10 * k;
            made(&look.see(&ellipsoid()), Front::Grey)
        })
        .collect();
    let others: Vec<_> = models.iter().map(|model| Bvh::new(&model.mesh)).collect();
    let (mesh, front) = (&models[0].mesh, models[0].front.as_ref().unwrap());
    let all = inner(mesh);
    let [mut expected, mut spread] = [0.0; 2];
    for (vertex, normal) in &all {
        let ray = mesh.vertices[*vertex].coords;
        let off = |other: &Bvh| {
            (other.first_hit(&Point3::origin(), &ray).unwrap().parameter - 1.0) * ray.dot(normal)
        };
        let off: Vec<f64> = others.iter().map(off).collect();
        let mean = off.iter().sum::<f64>() / off.len() as f64;
        spread += (off.iter().map(|o| (o - mean).powi(2)).sum::<f64>() / (off.len() - 1) as f64).sqrt();
        expected += 1.0 / front.confidence[*vertex] - 1.0;
    }
    [expected, spread].map(|sum| sum / all.len() as f64)
}

#[test]
fn what_is_expected_grows_with_noise_as_the_spread_of_surfaces_does() {
    let [weak, strong] = ["noise 2", "noise 5"].map(|name| expected_and_spread(look(name)));
    println!("expected and spread, mm: {weak:.3?} at noise 2, {strong:.3?} at noise 5");
    for [expected, spread] in [weak, strong] {
        assert!((0.4..1.0).contains(&(spread / expected)), "{spread:.3} of {expected:.3} mm");
    }
    let [expected, spread] = [0, 1].map(|of| strong[of] / weak[of]);
    assert!(
        expected > 1.25 && (expected / spread).ln().abs() < 0.4,
        "{expected:.2} times, where the spread is {spread:.2} times"
    );
}

#[test]
fn an_ellipsoid_is_off_by_about_what_is_expected_or_less() {
    let truth = ellipsoid();
    for name in ["matte", "clouds", "checks", "noise 2"] {
        let found = vertices(&made(&look(name).see(&truth), Front::Auto), &truth);
        let [all, visible] = shares(&[&found]);
        let within = found.iter().filter(|vertex| vertex.error < 2.0 * vertex.expected).count();
        let within = within as f64 / found.len() as f64;
        println!("{name}: {all:.2} and {visible:.2} of what is expected, {within:.3} within twice that");
        // Where much was measured of what is far from round, more is expected of the visible side than is wrong; in
        // noise, what the gates return to the balls seems rounder than it is.
        assert!(
            (0.5..2.0).contains(&all) && (0.06..2.0).contains(&visible),
            "{name}: {all:.2}, {visible:.2}"
        );
        assert!(within > 0.65, "{name}: {within:.3}");
    }
}

/// Below this error, % of the diagonal, nothing is promised of the confidence.
const NOISE: f64 = 0.2;
/// Least error of the least confident fifth of vertices over that of the most confident one.
const RATIO: f64 = 3.0;
/// Where it does not tell so much, of all vertices and of the visible ones: what was measured, less a tenth.
const EXCEPTIONS: [(&str, [f64; 2]); 2] = [("block", [1.9, RATIO]), ("real_dino1", [RATIO, 1.6])];
/// Least and most that the mean error may be in the expected one.
const SHARE: [f64; 2] = [0.4, 2.4];

#[test]
fn confidence_says_how_far_the_vertices_of_the_cases_are_off() {
    let Some(folder) = folder() else { return };
    let mut all = Vec::new();
    for case in cases(&folder) {
        let ([left, right], camera) = open(&case);
        let truth = host::mesh::read::read(&case.join("truth.ply")).unwrap();
        let made = reconstruct(left, right, &camera, &with(Front::Auto), &mut ()).unwrap();
        let found = vertices(&made, &truth);
        let (told, share) = (ratios(&[&found]), shares(&[&found]));
        println!("{:12} {told:.2?}, error in the expected {share:.2?}", name(&case));
        if error(&made.mesh, &truth) >= NOISE {
            all.push((name(&case), told, share));
        }
    }
    for (name, told, share) in all {
        let least = EXCEPTIONS.iter().find(|(known, _)| *known == name).map_or([RATIO; 2], |known| known.1);
        assert!(told[0] >= least[0] && told[1] >= least[1], "{name}: {told:?} of {least:?}");
        assert!(share.iter().all(|s| (SHARE[0]..=SHARE[1]).contains(s)), "{name}: {share:?}");
    }
}
