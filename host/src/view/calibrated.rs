//! A calibrated camera as a [`View`]: lens, and any place beside the left camera.

use nalgebra::{Matrix3, Point2, Point3, Vector3};

use super::View;
use crate::calibration::{Camera, StereoCamera};

/// One camera of a calibrated pair.
///
/// A pixel where the lens model has no inverse looks backwards, where a scene has nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibrated {
    camera: Camera,
    /// From the left camera's axes to this one's.
    turn: Matrix3<f64>,
    shift: Vector3<f64>,
}

impl Calibrated {
    /// Both cameras of a pair, left and right.
    #[must_use]
    pub fn pair(pair: &StereoCamera) -> [Self; 2] {
        [
            Self { camera: pair.left, turn: Matrix3::identity(), shift: Vector3::zeros() },
            Self { camera: pair.right, turn: pair.rotation, shift: pair.translation },
        ]
    }
}

impl View for Calibrated {
    fn size(&self) -> [u32; 2] {
        [self.camera.width, self.camera.height]
    }

    fn centre(&self) -> Point3<f64> {
        Point3::from(-self.turn.tr_mul(&self.shift))
    }

    fn ray(&self, u: f64, v: f64) -> Vector3<f64> {
        let ray = self.camera.ray_of(Point2::new(u, v));
        self.turn.tr_mul(&ray.map_or(-Vector3::z(), |ray| Vector3::new(ray.x, ray.y, 1.0)))
    }

    fn project(&self, point: &Point3<f64>) -> Option<(f64, f64)> {
        let p = self.turn * point.coords + self.shift;
        (p.z > 0.0).then(|| {
            let pixel = self.camera.pixel_of(Point2::new(p.x / p.z, p.y / p.z));
            (pixel.x, pixel.y)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::Lens;
    use crate::view::Pinhole;
    use nalgebra::Rotation3;

    #[test]
    fn an_ideal_pair_is_the_pinhole_pair() {
        let pinholes = Pinhole::pair();
        let point = Point3::new(10.0, -20.0, 450.0);
        for (view, pinhole) in
            Calibrated::pair(&StereoCamera::rectified(640, 480, 750.0, 60.0)).iter().zip(pinholes)
        {
            assert_eq!(view.size(), pinhole.size());
            assert_eq!(view.centre(), pinhole.centre());
            assert_eq!(view.ray(5.0, 7.5), pinhole.ray(5.0, 7.5));
            let [(u, v), (x, y)] = [view.project(&point), pinhole.project(&point)].map(Option::unwrap);
            assert!((u - x).abs() < 1e-10 && (v - y).abs() < 1e-10);
        }
    }

    #[test]
    fn a_point_on_the_ray_of_a_pixel_falls_on_that_pixel() {
        let mut pair = StereoCamera::rectified(640, 480, 750.0, 60.0);
        pair.rotation = Rotation3::from_euler_angles(0.01, 0.12, -0.02).into_inner();
        pair.translation = Vector3::new(-60.0, 2.0, 5.0);
        pair.right.lens = Lens::Polynomial([-0.2, 0.05, 1e-3, -5e-4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        for view in Calibrated::pair(&pair) {
            let point = view.centre() + 400.0 * view.ray(100.25, 400.5);
            let (u, v) = view.project(&point).expect("the point is in front");
            assert!((u - 100.25).abs() < 1e-8 && (v - 400.5).abs() < 1e-8, "{u} {v}");
        }
    }
}
