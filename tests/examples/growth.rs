//! How the stages that match and describe grow with a picture's size:
//! `cargo run --release -p system-tests --example growth`.
//!
//! For each drawn shape a line a size: points of the left contour, branches, and microseconds a stage, the least
//! of several runs; then by which power of the points each stage grows from the smallest to the largest size.
//! The comb has the more teeth, the larger it is; other shapes are what they are at any size.

use oracle::core::{Core, picture};
use oracle::scene::draw;
use shared::pipeline::{Observer, Product, Settings, Side};
use shared::stage::depth::Optics;
use std::collections::BTreeMap;
use std::time::Instant;

/// Runs of which the shortest time counts.
const RUNS: usize = 7;

/// Shortest time of each stage, us.
type Times = BTreeMap<&'static str, f64>;

/// A clock that is read after each stage of the pair.
struct Clock<'a> {
    since: Instant,
    times: &'a mut Times,
}

impl Observer for Clock<'_> {
    fn saw(&mut self, _: Option<Side>, product: Product<'_>) {
        let stage = match product {
            Product::Cuts(_) => "cuts",
            Product::Rows(..) => "rows",
            Product::Balls(..) => "balls",
            Product::Curves(..) => "curves",
            _ => "",
        };
        if !stage.is_empty() {
            let time = self.since.elapsed().as_secs_f64() * 1e6;
            let least = self.times.entry(stage).or_insert(time);
            *least = least.min(time);
        }
        self.since = Instant::now();
    }
}

/// A shape: whether a place, in px of 320x240, is inside, given how much larger the picture is.
type Inside = fn(f64, f64, f64) -> bool;

fn ring(u: f64, v: f64, _: f64) -> bool {
    (40.0..90.0).contains(&(u - 180.0).hypot(1.07 * (v - 120.0)))
}

fn blob(u: f64, v: f64, _: f64) -> bool {
    let t = (v - 120.0).atan2(u - 180.0);
    let waves = 0.3 * (3.0 * t).cos() + 0.12 * (7.0 * t).sin() + 0.1 * (11.0 * t).cos();
    (u - 180.0).hypot(v - 120.0) < 60.0 * (1.0 + waves)
}

fn disc(u: f64, v: f64, _: f64) -> bool {
    (u - 180.0).hypot(v - 120.0) < 70.0
}

fn comb(u: f64, v: f64, scale: f64) -> bool {
    let pitch = 24.0 / scale;
    let is_tooth = (u - 70.0).rem_euclid(pitch) < pitch / 2.0 && (60.0..200.0).contains(&v);
    (70.0..290.0).contains(&u) && (is_tooth || (46.0..74.0).contains(&v))
}

/// Times of one shape at one size, with its points and branches.
fn measured(core: &mut Core, inside: Inside, scale: u32) -> (usize, usize, Times) {
    let k = f64::from(scale);
    let see = |shift: f64| {
        let image = draw(320 * scale, 240 * scale, |u, v| inside(u / k + shift, v / k, k));
        picture(320 * scale as usize, 240 * scale as usize, |u, v| image.get_pixel(u as u32, v as u32)[0])
    };
    let (left, right) = (see(0.0), see(40.0));
    let settings = Settings::new(Optics { focal: 375 * 256 * scale as i32, disparity_offset: 0 });
    let (mut times, mut points, mut branches) = (Times::new(), 0, 0);
    for _ in 0..RUNS {
        let mut clock = Clock { since: Instant::now(), times: &mut times };
        let outcome = core.run([&left, &right], &settings, "", &mut clock, |memory, _| {
            (points, branches) = (memory.eyes[0].contour.len(), memory.eyes[0].branches.len());
        });
        if let Err(finding) = outcome {
            println!("refused: {finding:?}");
        }
    }
    (points, branches, times)
}

fn main() {
    let mut core = Core::default();
    let shapes: [(&str, Inside, &[u32]); 4] = [
        ("ring", ring, &[1, 2, 4, 8]),
        ("blob", blob, &[1, 2, 4, 8]),
        ("disc", disc, &[1, 2, 4, 8]),
        ("comb", comb, &[1, 2]),
    ];
    for (name, inside, scales) in shapes {
        let measured: Vec<_> = scales.iter().map(|&scale| measured(&mut core, inside, scale)).collect();
        for (scale, (points, branches, times)) in scales.iter().zip(&measured) {
            let size = format!("{}x{}", 320 * scale, 240 * scale);
            println!("{name:5} {size:>9} {points:>6} points {branches:>3} branches, us: {times:.0?}");
        }
        if let [(few, _, short), .., (many, _, long)] = &measured[..] {
            let power = |stage| (long[stage] / short[stage]).ln() / (*many as f64 / *few as f64).ln();
            let powers: Times = short.keys().map(|&stage| (stage, power(stage))).collect();
            println!("{name:5} grows by the power of points: {powers:.2?}");
        }
    }
}
