//! How far a closed mesh is along the rays of one eye: where each first enters it, and where it leaves it again.
//!
//! * **In**: a closed mesh that looks outward, and the image of each of its vertices (column, row, 1 / depth).
//! * **Out**: for each pixel of a frame the depth of the nearest face that looks at the eye, its number, and the depth
//!   of the first face behind it that looks away. Pixel centres are whole numbers.
//! * **Meaning**: 1 / depth is linear over the image of a face, so depths are exact.
//! * **Cost**: the pixels in the boxes around all faces, twice.

use super::pool::{Lent, Pool};
use crate::mesh::Mesh;

/// A box of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Frame {
    /// First column and row.
    pub(super) corner: [i32; 2],
    pub(super) width: usize,
    pub(super) height: usize,
}

impl Frame {
    /// The place of a pixel in lists row by row, if it is inside.
    pub(super) fn place(&self, u: i32, v: i32) -> Option<usize> {
        let (x, y) = (u.saturating_sub(self.corner[0]), v.saturating_sub(self.corner[1]));
        let inside = x >= 0 && y >= 0 && (x as usize) < self.width && (y as usize) < self.height;
        inside.then(|| y as usize * self.width + x as usize)
    }

    /// Its pixels row by row.
    pub(super) fn pixels(&self) -> impl Iterator<Item = [i32; 2]> + use<> {
        let Self { corner: [u, v], width, height } = *self;
        (0..width * height).map(move |place| [u + (place % width) as i32, v + (place / width) as i32])
    }
}

/// No face.
pub(super) const NOTHING: u32 = u32::MAX;

/// The first stretch of each ray inside a mesh.
#[derive(Debug)]
pub(super) struct Depths<'p> {
    pub(super) frame: Frame,
    /// Where it begins, mm; infinite where the mesh is not met.
    pub(super) near: Lent<'p, f64>,
    /// Where it ends, mm.
    pub(super) far: Lent<'p, f64>,
    /// The face where it begins, or [`NOTHING`].
    pub(super) face: Lent<'p, u32>,
}

impl<'p> Depths<'p> {
    /// The depths of a mesh whose vertices are seen at `images`.
    pub(super) fn of(pool: &'p Pool, mesh: &Mesh, images: &[[f64; 3]], frame: Frame) -> Self {
        let count = frame.width * frame.height;
        let [mut near, mut far] = [(); 2].map(|()| pool.numbers.filled(0.0, count));
        let mut face = pool.faces.filled(NOTHING, count);
        let corners = |k: usize| mesh.faces[k].map(|vertex| images[vertex as usize]);
        let faces = || (0..mesh.faces.len()).map(|k| (k, corners(k)));
        // Rows run downwards, so a face that looks at the eye turns the other way in the image.
        for (k, corners) in faces().filter(|(_, corners)| turn(corners) < 0.0) {
            cover(frame, &corners, |place, inverse| {
                if inverse > near[place] {
                    (near[place], face[place]) = (inverse, k as u32);
                }
            });
        }
        for (_, corners) in faces().filter(|(_, corners)| turn(corners) > 0.0) {
            cover(frame, &corners, |place, inverse| {
                if inverse > far[place] && inverse <= near[place] {
                    far[place] = inverse;
                }
            });
        }
        for (near, far) in near.iter_mut().zip(far.iter_mut()) {
            *near = near.recip();
            *far = if *far > 0.0 { far.recip() } else { *near };
        }
        Self { frame, near, far, face }
    }
}

/// Twice the area of a triangle in the image.
fn turn([a, b, c]: &[[f64; 3]; 3]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Calls `found` with the place and the value of each pixel of a triangle.
fn cover(frame: Frame, triangle: &[[f64; 3]; 3], mut found: impl FnMut(usize, f64)) {
    let [a, b, c] = triangle;
    let area = turn(triangle);
    let range = |axis: usize, length: usize| {
        let low = a[axis].min(b[axis]).min(c[axis]).ceil().max(f64::from(frame.corner[axis]));
        let end = f64::from(frame.corner[axis]) + length as f64 - 1.0;
        let high = a[axis].max(b[axis]).max(c[axis]).floor().min(end);
        low as i32..=high as i32
    };
    let edge = |p: &[f64; 3], q: &[f64; 3], u: f64, v: f64| {
        ((p[0] - u) * (q[1] - v) - (p[1] - v) * (q[0] - u)) / area
    };
    for v in range(1, frame.height) {
        for u in range(0, frame.width) {
            let (x, y) = (f64::from(u), f64::from(v));
            let weights = [edge(b, c, x, y), edge(c, a, x, y), edge(a, b, x, y)];
            if weights.iter().all(|&weight| weight >= -1e-9)
                && let Some(place) = frame.place(u, v)
            {
                found(place, weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2]);
            }
        }
    }
}
