//! What turns: mesh, skeleton, boundary and truth, as the script's plotting library takes them.

use crate::bvh::Bvh;
use crate::curves::Curves;
use crate::mesh::Mesh;
use crate::report::Run;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use nalgebra::Point3;
use rayon::prelude::*;
use serde::Serialize;

/// Everything in space, mm, left camera's axes.
#[derive(Serialize)]
pub(super) struct Space {
    model: Surface,
    truth: Option<Surface>,
    skeleton: Lines,
    boundary: Lines,
}

/// Numbers as the library takes them in bulk: a type, and little-endian bytes in base64.
#[derive(Serialize)]
struct Bulk {
    dtype: &'static str,
    bdata: String,
}

impl Bulk {
    fn floats(values: impl Iterator<Item = f64>) -> Self {
        let bytes: Vec<u8> = values.flat_map(|value| (value as f32).to_le_bytes()).collect();
        Self { dtype: "f4", bdata: STANDARD.encode(bytes) }
    }

    fn indices(values: impl Iterator<Item = u32>) -> Self {
        let bytes: Vec<u8> = values.flat_map(u32::to_le_bytes).collect();
        Self { dtype: "u4", bdata: STANDARD.encode(bytes) }
    }
}

#[derive(Serialize)]
struct Surface {
    x: Bulk,
    y: Bulk,
    z: Bulk,
    i: Bulk,
    j: Bulk,
    k: Bulk,
    /// Distance of each vertex from the truth, mm, where that is known, and what all but one in a hundred keep below.
    error: Option<(Bulk, f64)>,
    /// How well each vertex is known, 0 to 1, where its front was measured.
    confidence: Option<Bulk>,
}

impl Surface {
    fn of(mesh: &Mesh, truth: Option<&Mesh>, confidence: Option<&[f64]>) -> Self {
        let axis = |axis: usize| Bulk::floats(mesh.vertices.iter().map(move |p| p[axis]));
        let corner = |corner: usize| Bulk::indices(mesh.faces.iter().map(move |face| face[corner]));
        let error = truth.map(|truth| {
            let truth = Bvh::new(truth);
            let errors: Vec<f64> = mesh.vertices.par_iter().map(|p| truth.distance(p)).collect();
            let mut order = errors.clone();
            let rank = order.len() * 99 / 100;
            let most =
                order.get_mut(rank).is_some().then(|| *order.select_nth_unstable_by(rank, f64::total_cmp).1);
            (Bulk::floats(errors.into_iter()), most.unwrap_or_default())
        });
        let confidence = confidence.map(|values| Bulk::floats(values.iter().copied()));
        Self {
            x: axis(0),
            y: axis(1),
            z: axis(2),
            i: corner(0),
            j: corner(1),
            k: corner(2),
            error,
            confidence,
        }
    }
}

/// Lines, with nothing between one and the next; points where there are no edges.
#[derive(Serialize)]
struct Lines {
    points: bool,
    x: Vec<Option<f32>>,
    y: Vec<Option<f32>>,
    z: Vec<Option<f32>>,
}

impl Lines {
    fn of(curves: &Curves) -> Self {
        let points = curves.edges.is_empty();
        let mut order: Vec<Option<usize>> = Vec::new();
        if points {
            order.extend((0..curves.points.len()).map(Some));
        }
        for [a, b] in curves.edges.iter().map(|edge| edge.map(|end| end as usize)) {
            if order.last() != Some(&Some(a)) {
                order.extend([None, Some(a)]);
            }
            order.push(Some(b));
        }
        let of =
            |value: &dyn Fn(usize) -> f64| order.iter().map(|at| at.map(|at| value(at) as f32)).collect();
        let at = |axis: usize| {
            of(&|i| {
                let p: &Point3<f64> = &curves.points[i];
                p[axis]
            })
        };
        Self { points, x: at(0), y: at(1), z: at(2) }
    }
}

impl Space {
    pub(super) fn of(run: &Run<'_>) -> Self {
        let made = run.reconstruction;
        Self {
            model: Surface::of(&made.mesh, run.truth, made.front.as_ref().map(|front| &front.confidence[..])),
            truth: run.truth.map(|truth| Surface::of(truth, None, None)),
            skeleton: Lines::of(&made.skeleton),
            boundary: Lines::of(&made.boundary),
        }
    }
}
