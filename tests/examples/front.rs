//! What the measured front brings, and where it does not: every built-in shape, looking every way, by balls, by grey
//! levels and by both as they are trusted; and whether the confidence of a vertex says how far it is off.
//!
//! `cargo run --release -p system-tests --example front [LOOK|SEED..]` prints the tables, for some looks or for other
//! noise if that is asked for, and fails unless they hold what is promised of them.

use host::evaluate::{Options as Ruler, evaluate};
use host::mesh::Mesh;
use host::reconstruct::{Front, Options};
use host::shape::Shape;
use host::view::Pinhole;
use oracle::confidence::{Vertex, ratios, shares, vertices};
use oracle::looks::Look;
use oracle::scene::model;
use std::process::ExitCode;

/// Most that `auto` may lose against balls, % of the diagonal.
const LOSS: f64 = 0.05;
/// So much nearer than balls grey levels must be for a gain, and the part of a look's gains that `auto` must have.
const GAIN: f64 = 0.02;
const SHARE: f64 = 0.7;
/// Least error of the least confident fifth of a model's vertices over that of the most confident one.
const RATIO: f64 = 3.0;
/// Least and most that the mean error may be in the expected one.
const SHARES: [f64; 2] = [0.5, 1.2];

/// Symmetric mean distance, % of the diagonal; none if there is nothing to measure.
fn error(model: &Mesh, truth: &Mesh) -> Option<f64> {
    let ruler = Ruler { samples: 20_000, grid: 2, sections: 1, seed: 0 };
    evaluate::<Pinhole>(model, truth, &[], &ruler).distance.map(|d| d.symmetric.mean_pct)
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
    let (seeds, only): (Vec<_>, Vec<_>) =
        std::env::args().skip(1).partition(|word| word.parse::<u64>().is_ok());
    let seed = seeds.last().map_or(1, |seed| seed.parse().unwrap());
    let asked = |look: &Look| only.is_empty() || only.iter().any(|name| name == look.name);
    let (mut worst, mut least, mut gains) = (0.0_f64, f64::INFINITY, Gain::default());
    let mut all: Vec<(Shape, Vec<Vertex>)> = Vec::new();
    println!("| balls / grey / auto | {} | mean | of the gain |", Shape::ALL.map(Shape::name).join(" | "));
    println!("|---|{}---|---|", "---|".repeat(Shape::ALL.len()));
    for mut look in Look::all().into_iter().filter(asked) {
        look.seed = seed;
        let (mut cells, mut sums, mut gain) = (Vec::new(), [0.0; 3], Gain::default());
        for shape in Shape::ALL {
            let (pair, truth) = (look.pair(shape), shape.mesh(shape.cell()));
            let by = |front| {
                let options = Options { front, ..Options::default() };
                let made = model(&pair, &options)
                    .unwrap_or_else(|refusal| panic!("{}, {shape}, {front:?}: {refusal}", look.name));
                let error = error(&made.mesh, &truth)
                    .unwrap_or_else(|| panic!("{}, {shape}, {front:?}: no distance", look.name));
                (made, error)
            };
            let [balls, grey, auto] = [Front::Balls, Front::Grey, Front::Auto].map(by);
            let errors = [balls.1, grey.1, auto.1];
            for (sum, error) in sums.iter_mut().zip(errors) {
                *sum += error / Shape::ALL.len() as f64;
            }
            worst = worst.max(errors[2] - errors[0]);
            gain.add(errors);
            gains.add(errors);
            all.push((shape, vertices(&auto.0, &truth)));
            cells.push(errors.map(|error| format!("{error:.2}")).join(" / "));
        }
        least = least.min(gain.share());
        let means = sums.map(|sum| format!("{sum:.2}")).join(" / ");
        println!("| {} | {} | {means} | {} |", look.name, cells.join(" | "), gain.words());
    }
    println!("\nworst loss of auto {worst:.3}, {} of the gain of grey", gains.words());

    println!(
        "\n| least over most confident fifth | error, mm | all | visible | error in the expected: all | visible |"
    );
    println!("|---|---|---|---|---|---|");
    let row = |name: &str, models: &[&[Vertex]]| {
        let (ratios, shares) = (ratios(models), shares(models));
        let errors = || models.iter().copied().flatten().map(|vertex| vertex.error);
        let mean = errors().sum::<f64>() / errors().count() as f64;
        let words = ratios.map(|ratio| format!("{ratio:.1}")).join(" | ");
        println!(
            "| {name} | {mean:.2} | {words} | {} |",
            shares.map(|share| format!("{share:.2}")).join(" | ")
        );
        ratios.iter().all(|ratio| *ratio >= RATIO)
            && shares.iter().all(|s| (SHARES[0]..=SHARES[1]).contains(s))
    };
    let models = |asked: &dyn Fn(Shape) -> bool| -> Vec<&[Vertex]> {
        all.iter().filter(|(shape, _)| asked(*shape)).map(|(_, list)| &list[..]).collect()
    };
    for shape in Shape::ALL {
        row(shape.name(), &models(&|s| s == shape));
    }
    let told = row("within each model", &models(&|_| true));
    // This one also tells thick objects from thin ones.
    row("across objects", &[&models(&|_| true).concat()]);
    if worst <= LOSS && least >= SHARE && told { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
