//! What the measured front brings, and where it does not: every built-in shape, looking every way, by balls, by grey
//! levels and by both as they are trusted; and whether the confidence of a vertex says how far it is off.
//!
//! `cargo run --release -p system-tests --example front [LOOK..]` prints the tables, and fails unless they hold what
//! is promised of them.

use host::evaluate::{Options as Ruler, evaluate};
use host::mesh::Mesh;
use host::reconstruct::{Front, Options, Reconstruction};
use host::shape::Shape;
use host::view::Pinhole;
use oracle::confidence::{Vertex, ratios, vertices};
use oracle::looks::Look;
use oracle::scene::model;
use std::process::ExitCode;

/// Most that `auto` may lose against balls, % of the diagonal.
const LOSS: f64 = 0.05;
/// So much nearer than balls grey levels must be for a gain, and the part of all gains that `auto` must have.
const GAIN: f64 = 0.02;
const SHARE: f64 = 0.7;
/// Least error of the least confident fifth over that of the most confident one.
const RATIO: f64 = 3.0;

/// Symmetric mean distance, % of the diagonal.
fn error(model: &Mesh, truth: &Mesh) -> f64 {
    let ruler = Ruler { samples: 20_000, grid: 2, sections: 1, seed: 0 };
    evaluate::<Pinhole>(model, truth, &[], &ruler).distance.map_or(f64::NAN, |d| d.symmetric.mean_pct)
}

/// What grey levels gain over balls where they do, and how much of it `auto` has, no more than grey levels.
#[derive(Clone, Copy, Default)]
struct Gain {
    grey: f64,
    auto: f64,
}

impl Gain {
    fn add(&mut self, [balls, grey, auto]: [f64; 3]) {
        if balls - grey > GAIN {
            self.grey += balls - grey;
            self.auto += (balls - auto).min(balls - grey);
        }
    }

    fn share(self) -> f64 {
        self.auto / self.grey
    }

    fn words(self) -> String {
        if self.grey > 0.0 { format!("{:.0} %", 100.0 * self.share()) } else { "-".into() }
    }
}

fn main() -> ExitCode {
    let only: Vec<String> = std::env::args().skip(1).collect();
    let asked = |look: &Look| only.is_empty() || only.iter().any(|name| name == look.name);
    let (mut worst, mut gains) = (0.0_f64, Gain::default());
    let mut all: Vec<(Shape, Vec<Vertex>)> = Vec::new();
    println!("| balls / grey / auto | {} | mean | of the gain |", Shape::ALL.map(Shape::name).join(" | "));
    println!("|---|{}---|---|", "---|".repeat(Shape::ALL.len()));
    for look in Look::all().into_iter().filter(asked) {
        let (mut cells, mut sums, mut gain) = (Vec::new(), [0.0; 3], Gain::default());
        for shape in Shape::ALL {
            let (pair, truth) = (look.pair(shape), shape.mesh(shape.cell()));
            let by = |front| model(&pair, &Options { front, ..Options::default() }).ok();
            let made: [Option<Reconstruction>; 3] = [Front::Balls, Front::Grey, Front::Auto].map(by);
            let errors =
                made.each_ref().map(|made| made.as_ref().map_or(f64::NAN, |made| error(&made.mesh, &truth)));
            for (sum, error) in sums.iter_mut().zip(errors) {
                *sum += error / Shape::ALL.len() as f64;
            }
            worst = worst.max(errors[2] - errors[0]);
            gain.add(errors);
            gains.add(errors);
            all.extend(made[2].as_ref().map(|made| (shape, vertices(made, &truth))));
            cells.push(errors.map(|error| format!("{error:.2}")).join(" / "));
        }
        let means = sums.map(|sum| format!("{sum:.2}")).join(" / ");
        println!("| {} | {} | {means} | {} |", look.name, cells.join(" | "), gain.words());
    }
    println!("\nworst loss of auto {worst:.3}, {} of the gain of grey", gains.words());

    println!(
        "\n| least over most confident fifth | error, mm | all vertices | visible ones |\n|---|---|---|---|"
    );
    let row = |name: &str, list: &[Vertex]| {
        let [everywhere, visible] = ratios(list);
        let mean = list.iter().map(|vertex| vertex.error).sum::<f64>() / list.len() as f64;
        println!("| {name} | {mean:.2} | {everywhere:.1} | {visible:.1} |");
        everywhere.min(visible)
    };
    for shape in Shape::ALL {
        let of: Vec<_> = all.iter().filter(|(s, _)| *s == shape).flat_map(|(_, v)| v.clone()).collect();
        row(shape.name(), &of);
    }
    let together: Vec<_> = all.into_iter().flat_map(|(_, v)| v).collect();
    let told = row("together", &together) >= RATIO;
    if worst <= LOSS && gains.share() >= SHARE && told { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
