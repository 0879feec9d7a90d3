use super::*;
use crate::random::Random;
use crate::shape::Shape;

fn vector(random: &mut Random, size: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| size * (2.0 * random.uniform() - 1.0))
}

/// Small triangles anywhere in a cube of 200 mm.
fn triangles(random: &mut Random, count: usize) -> Vec<[Point3<f64>; 3]> {
    let mut triangle = || {
        let middle = Point3::from(vector(random, 100.0));
        std::array::from_fn(|_| middle + vector(random, 15.0))
    };
    (0..count).map(|_| triangle()).collect()
}

/// The naive twin: every triangle, its plane met first and the point's weights solved for.
fn naive_hit(triangles: &[[Point3<f64>; 3]], origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<f64> {
    let parameter = |[a, b, c]: &[Point3<f64>; 3]| {
        let system = nalgebra::Matrix3::from_columns(&[b - a, c - a, -direction]);
        let solution = system.lu().solve(&(origin - a))?;
        let inside = solution.x >= 0.0 && solution.y >= 0.0 && solution.x + solution.y <= 1.0;
        (inside && solution.z > 0.0).then_some(solution.z)
    };
    triangles.iter().filter_map(parameter).min_by(f64::total_cmp)
}

#[test]
fn first_hits_are_those_of_the_naive_twin() {
    let mut random = Random::new(1);
    for count in [0, 1, 5, 300] {
        let triangles = triangles(&mut random, count);
        let bvh = Bvh::of_triangles(&triangles);
        for _ in 0..2000 {
            let (origin, direction) = (vector(&mut random, 120.0).into(), vector(&mut random, 3.0));
            let hit = bvh.first_hit(&origin, &direction);
            let expected = naive_hit(&triangles, &origin, &direction);
            assert_eq!(hit.is_some(), expected.is_some());
            let (Some(hit), Some(expected)) = (hit, expected) else { continue };
            assert!((hit.parameter - expected).abs() < 1e-9 * expected.max(1.0));
            let corners = triangles[hit.face as usize];
            let point: Vector3<f64> = (0..3).map(|i| corners[i].coords * hit.weights[i]).sum();
            assert!((origin + direction * hit.parameter - Point3::from(point)).norm() < 1e-9);
        }
    }
}

/// The twin tries points all over the triangles: never nearer than the answer, and as near to within
/// the spacing of the points, 30 mm of a side over 60 steps.
#[test]
fn distances_are_those_of_dense_points() {
    let mut random = Random::new(2);
    let triangles = triangles(&mut random, 40);
    let bvh = Bvh::of_triangles(&triangles);
    let steps = 60;
    for _ in 0..100 {
        let point = Point3::from(vector(&mut random, 120.0));
        let mut least = f64::INFINITY;
        for [a, b, c] in &triangles {
            for i in 0..=steps {
                for j in 0..=steps - i {
                    let [s, t] = [i, j].map(|n| f64::from(n) / f64::from(steps));
                    least = least.min((a + (b - a) * s + (c - a) * t - point).norm());
                }
            }
        }
        let distance = bvh.distance(&point);
        assert!(distance <= least + 1e-9 && distance > least - 0.9, "{distance} against {least}");
    }
}

#[test]
fn segments_and_points_have_distances_too() {
    let (a, b) = (Point3::new(1.0, 0.0, 0.0), Point3::new(3.0, 0.0, 0.0));
    assert_eq!(Bvh::of_triangles(&[[a, b, b]]).distance(&Point3::new(2.0, 2.0, 0.0)), 2.0);
    assert_eq!(Bvh::of_triangles(&[[a, a, a]]).distance(&Point3::new(1.0, 0.0, -3.0)), 3.0);
    assert_eq!(Bvh::of_triangles(&[]).distance(&a), f64::INFINITY);
}

/// From the middle of a closed mesh every ray hits, even those aimed at edges.
#[test]
fn no_ray_slips_through_an_edge() {
    let mesh = Shape::Sphere.mesh(8.0);
    let bvh = Bvh::new(&mesh);
    let middle = Point3::new(30.0, 0.0, 450.0);
    for face in &mesh.faces {
        let [a, b, c] = face.map(|v| mesh.vertices[v as usize] - middle);
        for aim in [(a + b) / 2.0, a * 0.3 + c * 0.7] {
            assert!(bvh.first_hit(&middle, &aim).is_some());
        }
    }
}
