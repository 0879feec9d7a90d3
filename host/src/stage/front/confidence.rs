//! How well each vertex is known.
//!
//! * **In**: the moved mesh, the displacements with what grey levels say of each node, and how far behind the front each
//!   vertex lies. **Out**: a confidence a vertex, 0 to 1: 1 / (1 + s), where s is the standard deviation of its distance
//!   to the true surface that is to be expected, mm.
//! * **How round** the object is it tells itself: where grey levels cannot tell, and on the back, balls are expected to
//!   be off by that part of the half thickness by which they were off where grey levels could, around a node first.
//! * **Along the ray** a vertex is off by the disparity's error, and in front by what stereo and balls leave open
//!   together, on the back by what balls do. Near the outline displacements end with the thickness, but what is not
//!   round may turn away elsewhere: there as much is open again as balls are off by inside.
//! * **Across the surface** this is less, by the cosine of the slant, which is itself not known where balls are off; the
//!   error of the outline comes on top.
//! * **Cost**: a few passes over nodes, faces and vertices; sums around a node read 30 others.

use super::field::Field;
use super::lattice::RIM;
use super::pool::{Lent, Pool};
use crate::mesh::Mesh;
use crate::stage::rectify::RectifiedCamera;
use nalgebra::{Point3, Vector3};

/// Nodes around one, on each side: those that share what stereo says of it, and those that are as round.
const NEAR: usize = 3;
const FAR: usize = 7;
/// What the outline and the disparity may be off by where many pixels are fitted together, px.
const OUTLINE: f64 = 0.05;
const DISPARITY: f64 = 0.03;
/// What a node's surroundings say of it, in what they say of themselves: residuals are smaller than what they are
/// weighed by, and the surface bends less than those nodes are wide.
const SHARED: f64 = 2.0;
/// What balls are off by before anything was measured, in half thicknesses, and the nodes that it takes to say so.
const ODD: f64 = 0.3;
const FIRM: f64 = 20.0;
/// The error of the slant in what balls are off by, in half thicknesses: that changes over half of one.
const BUMPY: f64 = 2.0;

/// The confidence of the vertices of `mesh`, whose images are `images`, and which lie `behind` the front.
pub(super) fn of_vertices<'p>(
    pool: &'p Pool,
    mesh: &Mesh,
    (field, camera): (&Field<'p>, &RectifiedCamera),
    images: &[[f64; 3]],
    behind: &[f64],
) -> Lent<'p, f64> {
    let lattice = &field.lattice;
    let odd = out_of_round(pool, field);
    let known = lattice.sums_around(&field.known, NEAR);
    let around = |value: &dyn Fn(usize) -> f64| {
        let on = (0..odd.len()).map(|node| if lattice.on[node] { value(node) } else { 0.0 });
        lattice.sums_around(&pool.numbers.of(on), FAR)
    };
    let [half, nodes] = [around(&|node| lattice.half[node]), around(&|_| 1.0)];
    let [mut front, mut back] = [(); 2].map(|()| pool.numbers.filled(0.0, odd.len()));
    for node in lattice.nodes() {
        let disparity = DISPARITY * lattice.depth[node].powi(2) / (camera.f * camera.baseline_mm);
        // 7 % are left deep inside: stereo is drawn towards the balls a little everywhere.
        let outline = half[node] / nodes[node] * libm::exp(-lattice.rim[node] / RIM);
        let both = disparity * disparity + odd[node] * outline * outline;
        // Thin as the object is at the rim, unlike the displacements' own unit: there the outline's part counts.
        let balls = odd[node] * lattice.half[node].powi(2);
        let mm = lattice.unit[node] * lattice.depth[node];
        front[node] = both + 1.0 / (1.0 / balls + SHARED * known[node] / (mm * mm));
        back[node] = both + balls;
    }
    // Away from all nodes nothing is known: no better than the worst of them.
    let worst =
        |squares: &[f64]| lattice.nodes().map(|node| squares[node]).reduce(f64::max).unwrap_or(f64::MAX);
    let squares = [&front, &back, &odd].map(|squares| (squares, worst(squares)));
    let facing = facing(pool, mesh);
    let confidence = |vertex: usize| {
        let [u, v, _] = images[vertex];
        let at = |(squares, worst): (&Lent<'_, f64>, f64)| lattice.look_up(squares, [u, v]).unwrap_or(worst);
        let [front, back, odd] = squares.map(at);
        let along = front * (1.0 - behind[vertex]) + back * behind[vertex];
        let outline = OUTLINE * mesh.vertices[vertex].z / camera.f;
        let square = outline * outline + along * (facing[vertex] + BUMPY * BUMPY * odd).min(1.0);
        1.0 / (1.0 + square.sqrt())
    };
    pool.numbers.of((0..images.len()).map(confidence))
}

/// The square of what balls are off by around each node, in half thicknesses.
fn out_of_round<'p>(pool: &'p Pool, field: &Field<'p>) -> Lent<'p, f64> {
    // Each node counts by what it tells beyond what was expected of it.
    let told = |(known, moved): (&f64, &f64)| {
        let weight = known / (known + 1.0 / (ODD * ODD));
        [weight, weight * moved * moved]
    };
    let told = || field.known.iter().zip(field.moved.iter()).map(told);
    let mean = |before: f64, [weight, sum]: [f64; 2]| (FIRM * before + sum) / (FIRM + weight);
    let everywhere =
        mean(ODD * ODD, told().fold([0.0; 2], |sums, told| [sums[0] + told[0], sums[1] + told[1]]));
    let around = |of: usize| field.lattice.sums_around(&pool.numbers.of(told().map(|told| told[of])), FAR);
    let [weights, sums] = [around(0), around(1)];
    pool.numbers.of(weights.iter().zip(sums.iter()).map(|(&weight, &sum)| mean(everywhere, [weight, sum])))
}

/// The squared cosine between the ray of each vertex and the normal there.
fn facing<'p>(pool: &'p Pool, mesh: &Mesh) -> Lent<'p, f64> {
    let mut normals = pool.images.filled([0.0; 3], mesh.vertices.len());
    for (face, corners) in mesh.faces.iter().enumerate() {
        let normal = mesh.area_normal(face);
        for &corner in corners {
            let sum = &mut normals[corner as usize];
            *sum = (Vector3::from(*sum) + normal).into();
        }
    }
    let square = |(normal, vertex): (&[f64; 3], &Point3<f64>)| {
        let (normal, ray) = (Vector3::from(*normal), vertex.coords);
        let size = normal.norm_squared() * ray.norm_squared();
        // A vertex without area around it may look anywhere.
        if size > 0.0 { normal.dot(&ray).powi(2) / size } else { 1.0 }
    };
    pool.numbers.of(normals.iter().zip(&mesh.vertices).map(square))
}
