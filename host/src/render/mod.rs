//! A mesh as a camera would see it: a smooth grey object on a dark background, without texture.
//!
//! In: a closed mesh and [`View`]s. Out: 8-bit images, or exact silhouettes. Each pixel is the mean of
//! rays spread evenly over its square (a box filter), 4 x 4 unless told otherwise. A ray that misses counts as background;
//! one that hits is lit from above and left by Lambert's law. Rows are rendered in parallel, with the
//! same bits for any number of threads.
//!
//! Not modelled: cast shadows, gloss, blur. Noise is added by [`Noise`].

use image::GrayImage;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use crate::bvh::Bvh;
use crate::mesh::Mesh;
use crate::view::View;

mod noise;
mod normals;
mod silhouette;
mod window;

pub use noise::Noise;
pub use silhouette::Silhouette;

use normals::corner_normals;
use window::Window;

/// Rays a pixel along each axis that an image needs to be measured in.
const RAYS: u32 = 4;
/// Grey value of the background.
const BACKGROUND: f64 = 12.0;
/// Grey value of the object where it is turned away from the light.
const DARKEST: f64 = 140.0;
/// Grey value of the object where it faces the light.
const BRIGHTEST: f64 = 245.0;
/// Direction towards the light, of about unit length.
const LIGHT: Vector3<f64> = Vector3::new(-0.35, -0.55, -0.76);

/// An image of the mesh for each view.
pub fn render<V: View>(mesh: &Mesh, views: &[V]) -> Vec<GrayImage> {
    render_with(mesh, views, RAYS)
}

/// As [`render`], with `rays` x `rays` rays a pixel: 2 are enough to look at.
pub fn render_with<V: View>(mesh: &Mesh, views: &[V], rays: u32) -> Vec<GrayImage> {
    let bvh = Bvh::new(mesh);
    let normals = corner_normals(mesh);
    views.iter().map(|view| image(mesh, &bvh, &normals, view, rays)).collect()
}

fn image(mesh: &Mesh, bvh: &Bvh, normals: &[[Vector3<f64>; 3]], view: &impl View, rays: u32) -> GrayImage {
    let [width, height] = view.size();
    let mut pixels = vec![BACKGROUND as u8; width as usize * height as usize];
    let window = Window::of(mesh, view);
    window.par_rows(&mut pixels, width).for_each(|(v, row)| {
        for (u, pixel) in window.columns().zip(row) {
            *pixel = grey(bvh, normals, view, [u, v], rays);
        }
    });
    GrayImage::from_raw(width, height, pixels).unwrap_or_default()
}

/// Mean over the rays of one pixel.
fn grey(bvh: &Bvh, normals: &[[Vector3<f64>; 3]], view: &impl View, [u, v]: [u32; 2], rays: u32) -> u8 {
    let centre = view.centre();
    let offset = |ray: u32| (f64::from(ray) + 0.5) / f64::from(rays) - 0.5;
    let mut sum = 0.0;
    for y in 0..rays {
        for x in 0..rays {
            let direction = view.ray(f64::from(u) + offset(x), f64::from(v) + offset(y));
            sum += radiance(bvh, normals, &centre, &direction);
        }
    }
    (sum / f64::from(rays * rays)).round() as u8
}

/// Grey value along one ray.
fn radiance(bvh: &Bvh, normals: &[[Vector3<f64>; 3]], origin: &Point3<f64>, direction: &Vector3<f64>) -> f64 {
    let Some(hit) = bvh.first_hit(origin, direction) else { return BACKGROUND };
    let [a, b, c] = &normals[hit.face as usize];
    let normal = a * hit.weights[0] + b * hit.weights[1] + c * hit.weights[2];
    let cosine = normal.dot(&LIGHT) / normal.norm().max(f64::MIN_POSITIVE);
    DARKEST + (BRIGHTEST - DARKEST) * cosine.clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests;
