//! Our side of the comparison with other programs: kernels on images, served over a pipe. `peers.py` asks.
//!
//! Each line on standard input is a question, each answer a line of JSON and the bytes that it announces:
//!
//! | question | answer | bytes |
//! |---|---|---|
//! | `kernels` | `names` | |
//! | `images` | `names` | |
//! | `image NAME` | `width`, `height`, `bytes` | left picture, right picture, mask |
//! | `time KERNEL MICROSECONDS NAME` | `ns`, the best of at least one run and of as many as fit; `bytes` | what it made |

use fast_surface_nets::{SurfaceNetsBuffer, surface_nets};
use ndshape::{ConstShape, ConstShape3u32};
use oracle::images::{self, Image};
use oracle::kernels::{self, Entry, Kernel};
use serde_json::{Value, json};
use std::io::{self, Write};
use std::time::{Duration, Instant};

/// The one kernel here that is not ours.
const SURFACE_NETS: &str = "surface_nets";

/// A grid of 128 cells along the unit cube.
type Grid = ConstShape3u32<128, 128, 128>;

/// What others do in this language: a signed distance at every point of a grid, each ball in its own box,
/// and the surface nets of it.
struct SurfaceNets {
    balls: Vec<([f64; 3], f64)>,
    distances: Vec<f32>,
    mesh: SurfaceNetsBuffer,
}

impl SurfaceNets {
    fn new() -> Self {
        let distances = vec![0.0; Grid::USIZE];
        Self { balls: kernels::balls(), distances, mesh: SurfaceNetsBuffer::default() }
    }
}

impl Kernel for SurfaceNets {
    fn run(&mut self) {
        const CELLS: f32 = 128.0;
        /// Cells beyond the surface that have a distance.
        const BAND: f32 = 2.0;
        self.distances.fill(BAND);
        for (centre, radius) in &self.balls {
            let centre = centre.map(|x| x as f32 * CELLS);
            let radius = *radius as f32 * CELLS;
            let from = centre.map(|x| (x - radius - BAND).max(0.0) as u32);
            let to = centre.map(|x| (x + radius + BAND).min(CELLS - 1.0) as u32);
            for z in from[2]..=to[2] {
                for y in from[1]..=to[1] {
                    let off = (y as f32 - centre[1]).powi(2) + (z as f32 - centre[2]).powi(2);
                    let start = Grid::linearize([from[0], y, z]) as usize;
                    let row = &mut self.distances[start..=start + (to[0] - from[0]) as usize];
                    for (x, distance) in (from[0]..).zip(row) {
                        *distance = distance.min(((x as f32 - centre[0]).powi(2) + off).sqrt() - radius);
                    }
                }
            }
        }
        surface_nets(&self.distances, &Grid {}, [0; 3], [127; 3], &mut self.mesh);
    }

    fn made(&self) -> Vec<u8> {
        let counts = [self.mesh.positions.len(), self.mesh.indices.len() / 3];
        counts.iter().flat_map(|n| (*n as u64).to_le_bytes()).collect()
    }
}

/// Kernels set up on an image, kept as long as questions are about that image.
#[derive(Default)]
struct Ready {
    image: String,
    kernels: Vec<(String, Box<dyn Kernel>)>,
}

impl Ready {
    fn kernel(&mut self, entries: &[Entry], name: &str, image: &Image) -> &mut dyn Kernel {
        if self.image != image.name {
            self.kernels.clear();
            self.image.clone_from(&image.name);
        }
        let known = self.kernels.iter().position(|(known, _)| known == name);
        let at = known.unwrap_or_else(|| {
            let ours = || entries.iter().find(|entry| entry.name == name).expect("a known kernel");
            let kernel = if name == SURFACE_NETS { Box::new(SurfaceNets::new()) } else { ours().on(image) };
            self.kernels.push((name.to_owned(), kernel));
            self.kernels.len() - 1
        });
        &mut *self.kernels[at].1
    }
}

/// The best time, and what was made.
fn time(kernel: &mut dyn Kernel, budget: Duration) -> (Duration, Vec<u8>) {
    let start = Instant::now();
    let mut best = Duration::MAX;
    loop {
        let begun = Instant::now();
        kernel.run();
        best = best.min(begun.elapsed());
        if start.elapsed() >= budget {
            return (best, kernel.made());
        }
    }
}

fn answer(mut header: Value, bytes: &[u8]) -> io::Result<()> {
    let mut out = io::stdout().lock();
    header["bytes"] = bytes.len().into();
    writeln!(out, "{header}")?;
    out.write_all(bytes)?;
    out.flush()
}

fn main() -> io::Result<()> {
    let (images, entries) = (images::all(), kernels::all());
    let image = |name: &str| images.iter().find(|image| image.name == name).expect("a known image");
    let mut ready = Ready::default();
    for question in io::stdin().lines() {
        let question = question?;
        let words: Vec<_> = question.splitn(2, ' ').collect();
        match words[..] {
            ["kernels"] => {
                let mut names: Vec<_> = entries.iter().map(|entry| &*entry.name).collect();
                names.push(SURFACE_NETS);
                answer(json!({ "names": names }), &[])?;
            }
            ["images"] => {
                let names: Vec<_> = images.iter().map(|image| &*image.name).collect();
                answer(json!({ "names": names }), &[])?;
            }
            ["image", name] => {
                let image = image(name);
                let [left, right] = image.pair.each_ref().map(|picture| picture.as_raw().clone());
                let size = json!({ "width": image.size().width, "height": image.size().height });
                answer(size, &[left, right, image.mask_bytes()].concat())?;
            }
            ["time", rest] => {
                let mut rest = rest.splitn(3, ' ');
                let mut next = || rest.next().expect("kernel, time and image");
                let (kernel, budget, name) = (next(), next(), image(next()));
                let budget = Duration::from_micros(budget.parse().expect("microseconds"));
                let (best, made) = time(ready.kernel(&entries, kernel, name), budget);
                answer(json!({ "ns": best.as_nanos() as u64 }), &made)?;
            }
            _ => panic!("nobody knows the question {question:?}"),
        }
    }
    Ok(())
}
