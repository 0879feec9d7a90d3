//! What the measured front brings, and where it does not: every built-in shape, looking every way, by balls, by grey
//! levels and by both as they are trusted; and whether the confidence of a vertex says how far it is off.
//!
//! `cargo run --release -p system-tests --example front` prints the tables.

use host::bvh::Bvh;
use host::evaluate::{Options as Ruler, evaluate};
use host::mesh::Mesh;
use host::reconstruct::{Front, Options, Reconstruction};
use host::shape::Shape;
use host::view::Pinhole;
use nalgebra::Point3;
use oracle::looks::Look;
use oracle::scene::model;
use rayon::prelude::*;

/// Symmetric mean distance, % of the diagonal.
fn error(model: &Mesh, truth: &Mesh) -> f64 {
    let ruler = Ruler { samples: 20_000, grid: 2, sections: 1, seed: 0 };
    evaluate::<Pinhole>(model, truth, &[], &ruler).distance.map_or(f64::NAN, |d| d.symmetric.mean_pct)
}

/// Confidence and distance to the truth, mm, of each vertex, and whether the left eye sees it.
fn vertices(made: &Reconstruction, truth: &Mesh) -> Vec<(f64, f64, bool)> {
    let Some(front) = &made.front else { return Vec::new() };
    let (itself, truth) = (Bvh::new(&made.mesh), Bvh::new(truth));
    let vertex = |(point, &confidence): (&Point3<f64>, &f64)| {
        let hit = itself.first_hit(&Point3::origin(), &point.coords);
        (confidence, truth.distance(point), hit.is_none_or(|hit| hit.parameter > 1.0 - 1e-3))
    };
    made.mesh.vertices.par_iter().zip(&front.confidence).map(vertex).collect()
}

/// The mean error of the least confident fifth over that of the most confident one.
fn ratio(mut vertices: Vec<(f64, f64, bool)>) -> f64 {
    vertices.sort_by(|a, b| a.0.total_cmp(&b.0));
    let fifth = vertices.len() / 5;
    let mean = |part: &[(f64, f64, bool)]| part.iter().map(|v| v.1).sum::<f64>() / part.len() as f64;
    mean(&vertices[..fifth]) / mean(&vertices[vertices.len() - fifth..])
}

fn main() {
    let only: Vec<String> = std::env::args().skip(1).collect();
    let looks: Vec<Look> = Look::all()
        .into_iter()
        .filter(|look| only.is_empty() || only.iter().any(|o| o == look.name))
        .collect();
    let (mut all, mut worst, mut gains) = (Vec::new(), 0.0_f64, [0.0; 2]);
    println!("| look | {} | mean |", Shape::ALL.map(Shape::name).join(" | "));
    println!("|---|{}---|", "---|".repeat(Shape::ALL.len()));
    for look in looks {
        let (mut cells, mut sums) = (Vec::new(), [0.0; 3]);
        for shape in Shape::ALL {
            let (pair, truth) = (look.pair(shape), shape.mesh(shape.cell()));
            let by = |front| model(&pair, &Options { front, ..Options::default() });
            let made = [Front::Balls, Front::Grey, Front::Auto].map(by);
            let errors =
                made.each_ref().map(|made| made.as_ref().map_or(f64::NAN, |made| error(&made.mesh, &truth)));
            for (sum, error) in sums.iter_mut().zip(errors) {
                *sum += error / Shape::ALL.len() as f64;
            }
            worst = worst.max(errors[2] - errors[0]);
            if errors[1] < errors[0] {
                gains[0] += errors[0] - errors[1];
                gains[1] += errors[0] - errors[2];
            }
            if let Ok(made) = &made[2] {
                all.push((look.name, shape, vertices(made, &truth)));
            }
            cells.push(errors.map(|error| format!("{error:.2}")).join(" / "));
        }
        println!(
            "| {} | {} | {} |",
            look.name,
            cells.join(" | "),
            sums.map(|sum| format!("{sum:.2}")).join(" / ")
        );
    }
    println!("\nworst loss of auto {worst:.3}, {:.0} % of the gain of grey", 100.0 * gains[1] / gains[0]);
    let visible = |list: &[(f64, f64, bool)]| list.iter().copied().filter(|v| v.2).collect::<Vec<_>>();
    println!("\n| least over most confident fifth | all vertices | visible ones |\n|---|---|---|");
    for shape in Shape::ALL {
        let of: Vec<_> = all.iter().filter(|(_, s, _)| *s == shape).flat_map(|(.., v)| v.clone()).collect();
        println!("| {shape} | {:.1} | {:.1} |", ratio(of.clone()), ratio(visible(&of)));
    }
    let of: Vec<_> = all.into_iter().flat_map(|(.., v)| v).collect();
    println!("| together | {:.1} | {:.1} |", ratio(of.clone()), ratio(visible(&of)));
}
