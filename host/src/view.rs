//! What a renderer and a ruler need to know of a camera.

mod calibrated;

pub use calibrated::Calibrated;

use nalgebra::{Point3, Vector3};

/// A camera as rays: which ray a pixel looks along, and which pixel a point falls on.
///
/// Points and directions are in the left camera's frame, mm (x right, y down, z forward); pixel
/// centres are at integer coordinates, `u` to the right and `v` down.
pub trait View: Sync {
    /// Width and height of the image, px.
    fn size(&self) -> [u32; 2];

    /// The point through which all rays pass, mm.
    fn centre(&self) -> Point3<f64>;

    /// Direction of the ray through pixel `(u, v)`, of any length.
    fn ray(&self, u: f64, v: f64) -> Vector3<f64>;

    /// Pixel on which a point falls, inside the image or not; `None` behind the camera.
    fn project(&self, point: &Point3<f64>) -> Option<(f64, f64)>;
}

/// A camera without distortion whose axes are those of the left camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pinhole {
    /// Width and height of the image, px.
    pub size: [u32; 2],
    /// Focal length, px.
    pub focal: f64,
    /// Where the optical axis meets the image, px.
    pub principal: [f64; 2],
    /// Centre of projection, mm.
    pub centre: Point3<f64>,
}

impl Pinhole {
    /// The pair that looks at the built-in shapes: 640 x 480 px, focal length 750 px, 60 mm apart.
    #[must_use]
    pub fn pair() -> [Self; 2] {
        [0.0, 60.0].map(|x| Self {
            size: [640, 480],
            focal: 750.0,
            principal: [319.5, 239.5],
            centre: Point3::new(x, 0.0, 0.0),
        })
    }
}

impl View for Pinhole {
    fn size(&self) -> [u32; 2] {
        self.size
    }

    fn centre(&self) -> Point3<f64> {
        self.centre
    }

    fn ray(&self, u: f64, v: f64) -> Vector3<f64> {
        Vector3::new((u - self.principal[0]) / self.focal, (v - self.principal[1]) / self.focal, 1.0)
    }

    fn project(&self, point: &Point3<f64>) -> Option<(f64, f64)> {
        let d = point - self.centre;
        (d.z > 0.0).then(|| {
            let scale = self.focal / d.z;
            (self.principal[0] + scale * d.x, self.principal[1] + scale * d.y)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_on_the_ray_of_a_pixel_falls_on_that_pixel() {
        for view in Pinhole::pair() {
            let point = view.centre() + 450.0 * view.ray(12.25, 470.5);
            let (u, v) = view.project(&point).expect("the point is in front");
            assert!((u - 12.25).abs() < 1e-10 && (v - 470.5).abs() < 1e-10);
            assert_eq!(view.project(&Point3::new(0.0, 0.0, -1.0)), None);
        }
    }
}
