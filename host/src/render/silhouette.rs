//! The exact silhouette of a mesh: which pixel centres' rays meet it.

use rayon::prelude::*;

use super::window::Window;
use crate::bvh::Bvh;
use crate::mesh::Mesh;
use crate::view::View;

/// The pixels that an object covers, row by row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Silhouette(Vec<bool>);

impl Silhouette {
    /// The silhouette of `mesh`, of which `bvh` is the tree.
    #[must_use]
    pub fn of(mesh: &Mesh, bvh: &Bvh, view: &impl View) -> Self {
        let [width, height] = view.size();
        let mut covered = vec![false; width as usize * height as usize];
        let window = Window::of(mesh, view);
        let centre = view.centre();
        window.par_rows(&mut covered, width).for_each(|(v, row)| {
            for (u, pixel) in window.columns().zip(row) {
                *pixel = bvh.first_hit(&centre, &view.ray(f64::from(u), f64::from(v))).is_some();
            }
        });
        Self(covered)
    }

    /// Number of pixels covered.
    #[must_use]
    pub fn area(&self) -> usize {
        self.0.iter().filter(|&&covered| covered).count()
    }

    /// Pixels that both cover over pixels that either covers; 0 if neither covers any.
    #[must_use]
    pub fn iou(&self, other: &Self) -> f64 {
        let count =
            |test: fn(bool, bool) -> bool| self.0.iter().zip(&other.0).filter(|&(&a, &b)| test(a, b)).count();
        count(|a, b| a && b) as f64 / count(|a, b| a || b).max(1) as f64
    }
}
