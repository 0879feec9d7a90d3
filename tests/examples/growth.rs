//! How cost grows: `cargo run --release -p system-tests --example growth [-- docs/growth.svg]`.
//!
//! Prints, in milliseconds, what each stage takes by the size of the picture, by the length of the contour
//! and by the number of branches in a picture of one size, and whole pairs by their number and by threads;
//! beside each row the exponent: 1 is proportional. Writes the plot of the first two where it is told to.

use firmware::stages::{Counter, Stages};
use host::memory::Storage;
use host::reconstruct::{Options, reconstruct};
use oracle::images::{Image, grey};
use oracle::kernels;
use plotters::prelude::*;
use shared::bitmap::Bitmap;
use shared::pipeline::{EyeMemory, Settings, run};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// Sizes of the picture, px.
const SIZES: [(u32, u32); 5] = [(320, 240), (640, 480), (1280, 960), (1920, 1440), (3840, 2160)];
/// The size at which contours grow longer, px.
const ONE_SIZE: (u32, u32) = (1280, 960);
/// Waves around a disc, which make its contour longer and leave its box as it is.
const WAVES: [u32; 5] = [6, 12, 24, 48, 96];
/// Teeth of a comb.
const TEETH: [u32; 5] = [2, 4, 8, 16, 32];
/// Pairs one after the other.
const PAIRS: [usize; 4] = [1, 4, 16, 64];
/// Rounds take at least this long together.
const ENOUGH: Duration = Duration::from_millis(400);

/// Nanoseconds, for stages of less than four seconds.
struct Clock(Instant);

impl Counter for Clock {
    fn count(&self) -> u32 {
        self.0.elapsed().as_nanos() as u32
    }
}

/// Best times of the stages, ms, in their order.
#[derive(Default)]
struct Times(Vec<(String, f64)>);

impl Times {
    fn add(&mut self, stage: &str, ms: f64) {
        match self.0.iter_mut().find(|(name, _)| name == stage) {
            Some((_, sum)) => *sum += ms,
            None => self.0.push((stage.to_owned(), ms)),
        }
    }

    fn keep_best(&mut self, other: Self) {
        if self.0.is_empty() {
            *self = other;
        } else {
            for ((_, best), (_, ms)) in self.0.iter_mut().zip(other.0) {
                *best = best.min(ms);
            }
        }
    }
}

/// The stages of the core, both eyes together, as a device runs them.
fn core_times(image: &Image, storage: &mut Storage) -> Times {
    let mut times = Times::default();
    let mut stages = Stages::new(Clock(Instant::now()), |record| {
        times.add(record.stage, f64::from(record.cost) / 1e6);
    });
    let [left, right] = image.pair.each_ref().map(grey);
    run(&mut storage.lend(), left, right, &Settings::new(image.optics), &mut stages).unwrap();
    times
}

/// The stages of the host.
fn host_times(image: &Image) -> Times {
    let [left, right] = image.raw.clone();
    let model = reconstruct(left, right, &image.camera, &Options::default(), &mut ()).unwrap();
    let mut times = Times::default();
    for (stage, time) in model.times.iter().filter(|(stage, _)| !["rectify", "core"].contains(stage)) {
        times.add(&format!("host {stage}"), time.as_secs_f64() * 1e3);
    }
    times
}

/// The best of at least so many rounds.
fn best(rounds: usize, mut round: impl FnMut() -> Times) -> Times {
    let mut best = Times::default();
    let (start, mut done) = (Instant::now(), 0);
    while done < rounds || start.elapsed() < ENOUGH {
        best.keep_best(round());
        done += 1;
    }
    best
}

/// All stages.
fn best_times(image: &Image) -> Times {
    let mut storage = Storage::new(image.size().width, image.size().height).unwrap();
    let mut times = best(5, || core_times(image, &mut storage));
    times.0.extend(best(2, || host_times(image)).0);
    times
}

/// A number of what the core leaves of a pair.
fn described(image: &Image, count: fn(&EyeMemory<'_>) -> usize) -> f64 {
    let mut storage = Storage::new(image.size().width, image.size().height).unwrap();
    let mut memory = storage.lend();
    let [left, right] = image.pair.each_ref().map(grey);
    run(&mut memory, left, right, &Settings::new(image.optics), &mut ()).unwrap();
    count(&memory.eyes[0]) as f64
}

/// Length of the left object's contour, in points of about a pixel.
fn contour_length(image: &Image) -> f64 {
    described(image, |eye| eye.contour.len())
}

/// Branches of its skeleton.
fn branches(image: &Image) -> f64 {
    described(image, |eye| eye.branches.len())
}

/// Pixels of the box of the left object.
fn box_pixels(image: &Image) -> f64 {
    let mut words = image.mask.clone();
    let bounds = Bitmap::over(image.size(), &mut words).unwrap().bounds().unwrap();
    f64::from(bounds.max.u - bounds.min.u + 1) * f64::from(bounds.max.v - bounds.min.v + 1)
}

/// The slope of logarithms, by least squares.
fn exponent(points: &[(f64, f64)]) -> f64 {
    let logs: Vec<_> = points.iter().map(|(x, y)| (x.ln(), y.max(1e-6).ln())).collect();
    let mean = |of: fn(&(f64, f64)) -> f64| logs.iter().map(of).sum::<f64>() / logs.len() as f64;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let (above, below) = logs
        .iter()
        .fold((0.0, 0.0), |(above, below), p| (above + (p.0 - x) * (p.1 - y), below + (p.0 - x).powi(2)));
    above / below
}

/// What an experiment found: what it went along, and times by stage.
struct Curves {
    along: &'static str,
    stages: Vec<(String, Vec<(f64, f64)>)>,
}

/// Time the stages on images, print them, and say how they grow with `measure`.
fn experiment(
    along: &'static str,
    images: impl Iterator<Item = Image>,
    measure: fn(&Image) -> f64,
) -> Curves {
    let (mut head, mut xs, mut order) = (Vec::new(), Vec::new(), Vec::new());
    let mut stages: BTreeMap<String, Vec<(f64, f64)>> = BTreeMap::new();
    for image in images {
        let x = measure(&image);
        head.push(format!("{} ({x:.0})", image.name));
        xs.push(x);
        for (stage, ms) in best_times(&image).0 {
            if !order.contains(&stage) {
                order.push(stage.clone());
            }
            stages.entry(stage).or_default().push((x, ms));
        }
    }
    println!("\n| ms | {} | exponent of {along} |", head.join(" | "));
    println!("|---|{}", "---|".repeat(head.len() + 1));
    for stage in &order {
        let cells: Vec<_> = stages[stage].iter().map(|(_, ms)| format!("{ms:.2}")).collect();
        println!("| {stage} | {} | {:.2} |", cells.join(" | "), exponent(&stages[stage]));
    }
    let stages = order.into_iter().map(|stage| (stage.clone(), stages.remove(&stage).unwrap())).collect();
    Curves { along, stages }
}

/// A disc with waves around it.
fn waves(count: u32) -> Image {
    let outline = move |x: f64, y: f64| {
        let wave = 30.0 * (f64::from(count) * y.atan2(x)).cos();
        // Steep waves are nearer than they look along the radius.
        let steep = (1.0 + (30.0 * f64::from(count) / 160.0).powi(2)).sqrt();
        (x.hypot(y) - 160.0 - wave) / steep
    };
    Image::of(&format!("{count} waves"), ONE_SIZE, &outline, None)
}

/// A comb: a spine and teeth to its right, which together are as long whatever their number.
fn comb(teeth: u32) -> Image {
    let outline = move |x: f64, y: f64| {
        let bar = |x0: f64, x1: f64, y0: f64, y1: f64| (x0 - x).max(x - x1).max(y0 - y).max(y - y1);
        let pitch = 400.0 / f64::from(teeth);
        let tooth = ((y + 200.0) / pitch).floor().clamp(0.0, f64::from(teeth) - 1.0);
        let middle = (tooth + 0.5) * pitch - 200.0;
        // Uneven ends, lest the hull be a box.
        let end = 60.0 + 10.0 * (tooth % 3.0);
        bar(-80.0, -40.0, -200.0, 200.0).min(bar(-60.0, end, middle - pitch / 4.0, middle + pitch / 4.0))
    };
    Image::of(&format!("{teeth} teeth"), ONE_SIZE, &outline, None)
}

/// Whole pairs one after the other, by their number and by threads.
fn pairs() {
    let image = Image::drawn("limbs", 320, 240);
    println!(
        "\n| pairs of 320x240 to meshes on disk, ms | {} | exponent |",
        PAIRS.map(|n| n.to_string()).join(" | ")
    );
    println!("|---|{}", "---|".repeat(PAIRS.len() + 1));
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let found = pool.install(|| {
            let entries = kernels::all();
            let mut kernel = entries.iter().find(|entry| entry.name == "mesh").unwrap().on(&image);
            let (start, mut done) = (Instant::now(), 0);
            PAIRS.map(|count| {
                while done < count {
                    kernel.run();
                    done += 1;
                }
                (count as f64, start.elapsed().as_secs_f64() * 1e3)
            })
        });
        let cells: Vec<_> = found.iter().map(|(_, ms)| format!("{ms:.0}")).collect();
        let name = if threads == 1 { "1 thread".to_owned() } else { format!("{threads} threads") };
        println!("| {name} | {} | {:.2} |", cells.join(" | "), exponent(&found));
    }
}

/// A logarithmic plot of some stages.
fn panel<DB: DrawingBackend>(
    area: &DrawingArea<DB, plotters::coord::Shift>,
    curves: &Curves,
    chosen: &[&str],
) -> Result<(), DrawingAreaErrorKind<DB::ErrorType>> {
    let stages = || curves.stages.iter().filter(|(stage, _)| chosen.contains(&&**stage));
    let points = || stages().flat_map(|(_, points)| points);
    let range = |of: fn(&(f64, f64)) -> f64| {
        let least = points().map(of).fold(f64::INFINITY, f64::min);
        least.max(1e-3) * 0.8..points().map(of).fold(0.0, f64::max) * 1.25
    };
    /// Room for the legend at the right, as a factor of x.
    const LEGEND: f64 = 14.0;
    let x = range(|p| p.0);
    let mut chart = ChartBuilder::on(area)
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d((x.start..x.end * LEGEND).log_scale(), range(|p| p.1).log_scale())?;
    chart
        .configure_mesh()
        .x_desc(curves.along)
        .y_desc("ms")
        .x_labels(4)
        .x_label_formatter(&|x| x.to_string())
        .y_label_formatter(&|y| y.to_string())
        .light_line_style(WHITE)
        .draw()?;
    for (k, (stage, points)) in stages().enumerate() {
        let colour = Palette99::pick(k).to_rgba();
        let label = format!("{stage} {:.2}", exponent(points));
        chart
            .draw_series(LineSeries::new(points.iter().copied(), colour.stroke_width(2)).point_size(3))?
            .label(label)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], colour.stroke_width(2)));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::MiddleRight)
        .background_style(WHITE.mix(0.8))
        .border_style(BLACK.mix(0.2))
        .draw()
}

/// The plot of both experiments, side by side.
fn plot(path: &str, by_size: &Curves, by_length: &Curves) -> Result<(), Box<dyn std::error::Error>> {
    let area = SVGBackend::new(path, (1200, 560)).into_drawing_area();
    area.fill(&WHITE)?;
    let (left, right) = area.split_horizontally(600);
    let pixels = ["threshold", "mask", "boundary", "distance", "skeleton", "graph", "host surface"];
    panel(&left, by_size, &pixels)?;
    let contours = ["contour", "hull", "rows", "balls", "curves", "host refine", "host smooth"];
    panel(&right, by_length, &contours)?;
    area.present()?;
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global()?;
    let sizes = SIZES.into_iter().map(|(width, height)| Image::drawn("limbs", width, height));
    let by_size = experiment("pixels of the object's box", sizes, box_pixels);
    let by_length = experiment("points of the contour", WAVES.into_iter().map(waves), contour_length);
    experiment("branches", TEETH.into_iter().map(comb), branches);
    pairs();
    if let Some(path) = std::env::args().nth(1) {
        plot(&path, &by_size, &by_length)?;
    }
    Ok(())
}
