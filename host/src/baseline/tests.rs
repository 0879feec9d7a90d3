//! A ball as the oracle: its image is a disc up to perspective, so every measure has a formula.

use nalgebra::{Point2, Point3};

use super::*;
use crate::calibration::StereoCamera;
use crate::evaluate::{Options, evaluate};
use crate::shape::Shape;
use crate::stage::rectify::{Rectification, RectifiedCamera};
use crate::view::Pinhole;

fn camera() -> RectifiedCamera {
    Rectification::whole(&StereoCamera::rectified(640, 480, 750.0, 60.0)).expect("rectified already").camera()
}

/// The exact outlines of the built-in ball in both eyes: the ring of points whose rays touch it.
fn ball() -> [Outline; 2] {
    let camera = camera();
    let (centre, radius) = (Point3::new(30.0, 0.0, 450.0), 60.0);
    [0, 1].map(|eye| {
        let middle = centre.coords - nalgebra::Vector3::x() * (60.0 * eye as f64);
        let away = middle.normalize();
        let across = away.cross(&nalgebra::Vector3::y()).normalize();
        let up = away.cross(&across);
        let sine = radius / middle.norm();
        let (ring, reach) = (1.0 - sine * sine, radius * (1.0 - sine * sine).sqrt());
        let point = |i: u32| {
            let (s, c) = (f64::from(i) * std::f64::consts::TAU / 720.0).sin_cos();
            let touch = middle * ring + (across * c + up * s) * reach;
            let seen = camera.project(&Point3::from(touch)).expect("in front");
            Point2::new(seen[0].x, seen[0].y)
        };
        Outline::new(&[(0..720).map(point).collect()]).expect("a disc has pixels")
    })
}

#[test]
fn an_outline_is_its_distance() {
    let square = [[10.0, 10.0], [30.0, 10.0], [30.0, 30.0], [10.0, 30.0]].map(Point2::from);
    let outline = Outline::new(&[square.to_vec()]).expect("a square has pixels");
    for (at, expected) in
        [([20.0, 20.0], -10.0), ([12.5, 20.0], -2.5), ([20.0, 33.0], 3.0), ([50.0, 20.0], 20.0)]
    {
        assert!(
            (outline.at(&Point2::from(at)) - expected).abs() < 1e-9,
            "{at:?}: {}",
            outline.at(&at.into())
        );
    }
    assert!((outline.centroid() - Point2::new(20.0, 20.0)).norm() < 0.51);
    assert!(Outline::new(&[]).is_none() && Outline::new(&[vec![Point2::new(3.2, 4.4); 3]]).is_none());
}

#[test]
fn the_hull_of_a_ball_holds_it_and_has_its_silhouettes() {
    let outlines = ball();
    let hull = visual_hull([&outlines[0], &outlines[1]], &camera(), 4.0);
    let truth = Shape::Sphere.mesh(3.0);
    let found = evaluate(&hull, &truth, &Pinhole::pair(), &Options { samples: 500, ..Options::default() });
    assert_eq!((found.closed, found.bodies), (true, 1));
    assert!(found.silhouette_iou.iter().all(|&iou| iou > 0.985), "{:?}", found.silhouette_iou);
    // Every point of the ball falls inside both outlines and between the depths.
    let camera = camera();
    for vertex in &truth.vertices {
        let seen = camera.project(vertex).expect("in front");
        assert!(outlines.iter().zip(seen).all(|(outline, at)| outline.at(&at) < 0.1));
    }
    let [low, high] = hull.bounds().expect("not empty");
    // The outline lies r^2 / Z = 8 mm in front of the centre, and with it the cut.
    assert!(low.z < 392.0 && high.z > 500.0, "{} to {}", low.z, high.z);
    assert!(found.volume_ratio.expect("closed") > 1.2);
}

/// A disc inflated is a ball: seen a hundredth larger than it is, and less the twentieth of a pixel and the
/// cells of 2 mm in which it is made.
#[test]
fn an_inflated_disc_is_a_ball() {
    let outlines = ball();
    let inflated = inflation([&outlines[0], &outlines[1]], &camera(), 2.0);
    let found = evaluate(
        &inflated,
        &Shape::Sphere.mesh(3.0),
        &Pinhole::pair(),
        &Options { samples: 500, ..Options::default() },
    );
    assert_eq!((found.closed, found.bodies), (true, 1));
    let ratio = found.volume_ratio.expect("closed");
    assert!((0.95..1.05).contains(&ratio), "{ratio}");
}
