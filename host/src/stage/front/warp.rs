//! The measured front, carried over to the mesh.
//!
//! * **In**: a mesh in rectified axes, the depths of its first stretch along the left rays, and the change of ln depth
//!   there. **Out**: its vertices, moved along their rays so that the stretch [near, far] becomes [near', far]: its
//!   beginning as measured, its end, and whatever lies behind, as it was.
//! * **Promise**: along each ray the map keeps the order of points, and inside the outline it is continuous. Faces stay
//!   as they are, so that a closed manifold mesh remains one; but where limbs hide one another, or the thickness
//!   shrinks, faces may cross, and vertices of the back move a little.

use super::lattice::mean_near;
use super::pool::{Lent, Shelf};
use super::raster::Depths;
use crate::mesh::Mesh;
use nalgebra::Point3;

/// Least part of the thickness that is left of a stretch.
const LEFT: f64 = 0.05;

/// Move the vertices, whose images are `images`, by `change` of ln depth at a place of the left image. Returns how
/// far behind the front each lies: 0 there, 1 where the stretch ends and beyond.
pub(super) fn warp<'p>(
    shelf: &'p Shelf<f64>,
    mesh: &mut Mesh,
    images: &[[f64; 3]],
    depths: &Depths<'_>,
    change: impl Fn([f64; 2]) -> f64,
) -> Lent<'p, f64> {
    let size = [depths.frame.width, depths.frame.height];
    let mut moved = |(vertex, &[u, v, _]): (&mut Point3<f64>, &[f64; 3])| {
        let place = [u - f64::from(depths.frame.corner[0]), v - f64::from(depths.frame.corner[1])];
        let met = |place: usize| depths.near[place].is_finite();
        let at = |list: &[f64]| mean_near(place, size, |place| met(place).then(|| list[place]));
        let (Some(near), Some(far)) = (at(&depths.near), at(&depths.far)) else { return 1.0 };
        let thickness = (far - near).max(1e-6);
        let front = (near * libm::expm1(change([u, v]))).min((1.0 - LEFT) * thickness);
        let behind = ((vertex.z - near) / thickness).clamp(0.0, 1.0);
        *vertex *= 1.0 + front * (1.0 - behind) / vertex.z;
        behind
    };
    shelf.of(mesh.vertices.iter_mut().zip(images).map(&mut moved))
}
