//! A mesh as a camera would see it: a smooth grey object on a dark background.
//!
//! In: a closed mesh and [`View`]s. Out: 8-bit images, or exact silhouettes. Each pixel is the mean of
//! rays spread evenly over its square (a box filter), 4 x 4 unless told otherwise. A ray that misses counts as background;
//! one that hits is lit from above and left, and its [`Material`] decides what it sends back: dull and
//! without texture unless told otherwise. A [`Sensor`] turns that into grey levels. Rows are rendered in
//! parallel, with the same bits for any number of threads.
//!
//! Not modelled: cast shadows, light from one part of the object on another. Noise is added by [`Noise`].

use image::GrayImage;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use crate::bvh::Bvh;
use crate::mesh::Mesh;
use crate::view::View;

mod material;
mod noise;
mod normals;
mod sensor;
mod silhouette;
mod window;

pub use material::{Material, Pattern, Texture, UnknownPattern};
pub use noise::Noise;
pub use sensor::Sensor;
pub use silhouette::Silhouette;

use normals::corner_normals;
use window::Window;

/// Rays a pixel along each axis that an image needs to be measured in.
const RAYS: u32 = 4;
/// Grey value of the background.
const BACKGROUND: f64 = 12.0;

/// An image of the mesh for each view.
pub fn render<V: View>(mesh: &Mesh, views: &[V]) -> Vec<GrayImage> {
    render_with(mesh, views, RAYS)
}

/// As [`render`], with `rays` x `rays` rays a pixel: 2 are enough to look at.
pub fn render_with<V: View>(mesh: &Mesh, views: &[V], rays: u32) -> Vec<GrayImage> {
    let solid = Solid::new(mesh, Material::default());
    let image = |view: &V| Sensor::default().develop(view.size(), solid.light(view, rays));
    views.iter().map(image).collect()
}

/// An image of a mesh of some material for each view, as its sensor takes it.
pub fn photograph<V: View>(mesh: &Mesh, material: Material, cameras: &[(V, Sensor)]) -> Vec<GrayImage> {
    let solid = Solid::new(mesh, material);
    let image = |(view, sensor): &(V, Sensor)| sensor.develop(view.size(), solid.light(view, RAYS));
    cameras.iter().map(image).collect()
}

/// A mesh made ready to be looked at.
struct Solid<'a> {
    mesh: &'a Mesh,
    bvh: Bvh,
    normals: Vec<[Vector3<f64>; 3]>,
    material: Material,
}

impl<'a> Solid<'a> {
    fn new(mesh: &'a Mesh, material: Material) -> Self {
        Self { mesh, bvh: Bvh::new(mesh), normals: corner_normals(mesh), material }
    }

    /// Brightness of every pixel, row by row, grey levels.
    fn light(&self, view: &impl View, rays: u32) -> Vec<f64> {
        let [width, height] = view.size();
        let mut pixels = vec![BACKGROUND; width as usize * height as usize];
        let window = Window::of(self.mesh, view);
        window.par_rows(&mut pixels, width).for_each(|(v, row)| {
            for (u, pixel) in window.columns().zip(row) {
                *pixel = self.mean(view, [u, v], rays);
            }
        });
        pixels
    }

    /// Mean over the rays of one pixel.
    fn mean(&self, view: &impl View, [u, v]: [u32; 2], rays: u32) -> f64 {
        let centre = view.centre();
        let offset = |ray: u32| (f64::from(ray) + 0.5) / f64::from(rays) - 0.5;
        let mut sum = 0.0;
        for y in 0..rays {
            for x in 0..rays {
                let direction = view.ray(f64::from(u) + offset(x), f64::from(v) + offset(y));
                sum += self.along(&centre, &direction);
            }
        }
        sum / f64::from(rays * rays)
    }

    /// Brightness along one ray.
    fn along(&self, origin: &Point3<f64>, direction: &Vector3<f64>) -> f64 {
        let Some(hit) = self.bvh.first_hit(origin, direction) else { return BACKGROUND };
        let [a, b, c] = &self.normals[hit.face as usize];
        let normal = a * hit.weights[0] + b * hit.weights[1] + c * hit.weights[2];
        self.material.grey(&(origin + direction * hit.parameter), &normal, &-direction)
    }
}

#[cfg(test)]
mod tests;
