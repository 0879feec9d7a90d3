//! The block with a step: a polygon drawn out along z. Its mesh is exact, with sharp edges, which
//! marching would bevel.

use nalgebra::{Point3, Vector2};

use super::{Solid, turn};
use crate::mesh::Mesh;

/// The stepped outline in x and y (y points down), counter-clockwise as seen from +z.
const OUTLINE: [[f64; 2]; 6] =
    [[-52.0, -36.0], [4.0, -36.0], [4.0, 2.0], [52.0, 2.0], [52.0, 36.0], [-52.0, 36.0]];
/// Triangles of the outline.
const CAP: [[u32; 3]; 4] = [[0, 1, 2], [0, 2, 5], [2, 3, 4], [2, 4, 5]];
/// Half the depth, mm.
const HALF_DEPTH: f64 = 32.0;

pub(super) fn solid() -> Solid {
    Solid {
        field: Box::new(|p| outline_distance(&p.coords.xy()).max(p.z.abs() - HALF_DEPTH)),
        low: Point3::new(-52.0, -36.0, -HALF_DEPTH),
        high: Point3::new(52.0, 36.0, HALF_DEPTH),
        turn: turn([0.0, 0.0, 1.0], 6.0) * turn([1.0, 0.0, 0.0], 22.0) * turn([0.0, 1.0, 0.0], 35.0),
    }
}

/// The block's faces before it is turned.
pub(super) fn mesh() -> Mesh {
    let n = OUTLINE.len() as u32;
    let vertices =
        [HALF_DEPTH, -HALF_DEPTH].iter().flat_map(|&z| OUTLINE.map(|[x, y]| Point3::new(x, y, z))).collect();
    let mut faces = Vec::from(CAP);
    faces.extend(CAP.map(|[a, b, c]| [a + n, c + n, b + n]));
    for a in 0..n {
        let b = (a + 1) % n;
        faces.extend([[a, a + n, b], [b, a + n, b + n]]);
    }
    Mesh { vertices, faces }
}

/// Signed distance to the outline in its plane.
fn outline_distance(p: &Vector2<f64>) -> f64 {
    let mut nearest = f64::INFINITY;
    let mut inside = false;
    for (i, &from) in OUTLINE.iter().enumerate() {
        let from = Vector2::from(from);
        let side = Vector2::from(OUTLINE[(i + 1) % OUTLINE.len()]) - from;
        let offset = p - from;
        let t = (offset.dot(&side) / side.norm_squared()).clamp(0.0, 1.0);
        nearest = nearest.min((offset - t * side).norm_squared());
        let spans = (offset.y < 0.0) != (offset.y < side.y);
        inside ^= spans && side.x * (offset.y / side.y) > offset.x;
    }
    if inside { -nearest.sqrt() } else { nearest.sqrt() }
}
