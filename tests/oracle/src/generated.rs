//! Pairs by number, the same on every machine: figures with their disparity, and what no object looks like.

use crate::emulated::Case;
use crate::raster::Random;
use crate::scene::Pair;
use image::{GrayImage, Luma};
use shared::fixed::PX;
use shared::stage::depth::Optics;

const BRIGHT: u8 = 200;
const DARK: u8 = 12;
/// Bits of a word on the two kinds of machine.
const WORDS: [u32; 2] = [32, 64];

/// Steps of a place in a picture within a pixel.
const STEPS: i64 = 4;

/// Everywhere at most a radius from the line between two points, and not so if it is less than another.
#[derive(Clone, Copy, Debug)]
struct Bar {
    ends: [[i64; 2]; 2],
    radius: i64,
    hollow: i64,
}

impl Bar {
    fn draw(random: &mut Random, [width, height]: [u32; 2]) -> Self {
        let mut below = |n: u32| random.below(u64::from(n).max(1)) as i64;
        let steps = STEPS as u32;
        // Most are within the picture, and all of its middle may be seen by both eyes.
        let margin = [width / 5, height / 6];
        let mut end = || {
            let [u, v] = [0, 1].map(|k| {
                let side = [width, height][k];
                i64::from(margin[k]) * STEPS + below((side - 2 * margin[k]) * steps)
            });
            [u, v]
        };
        let ends = [end(), end()];
        let radius = 3 * STEPS + below(height * steps / 10);
        let hollow = if below(5) == 0 { radius / 2 } else { 0 };
        Self { ends, radius, hollow }
    }

    fn has(&self, point: [i64; 2]) -> bool {
        let [from, to] = self.ends;
        let along = [to[0] - from[0], to[1] - from[1]];
        let off = [point[0] - from[0], point[1] - from[1]];
        let length = (along[0] * along[0] + along[1] * along[1]).max(1);
        let foot = (off[0] * along[0] + off[1] * along[1]).clamp(0, length);
        let square: i64 = [0, 1].map(|k| (off[k] - along[k] * foot / length).pow(2)).iter().sum();
        square <= self.radius * self.radius && square >= self.hollow * self.hollow
    }
}

/// What an eye sees.
#[derive(Clone, Debug)]
enum Scene {
    /// Bright figures, some with noise on them.
    Bars(Vec<Bar>, u8),
    Noise(u64),
    /// The side of a field, px.
    Checkerboard(i64),
    /// Columns at both sides of each edge of words.
    WordEdges(i64),
    /// So wide, px.
    Border(i64),
    Pixel([i64; 2]),
    Gradient,
    Blots(u64, i64),
}

impl Scene {
    fn draw(random: &mut Random, size: [u32; 2]) -> Self {
        let [width, height] = size;
        let mut below = |n: u64| random.below(n);
        match below(16) {
            0 => Self::Noise(below(1 << 32)),
            1 => Self::Checkerboard(1 + below(20) as i64),
            2 => Self::WordEdges(i64::from(WORDS[below(2) as usize])),
            3 => Self::Border(1 + below(9) as i64),
            4 => Self::Pixel([below(width.into()) as i64, below(height.into()) as i64]),
            5 => Self::Gradient,
            6 => Self::Blots(below(1 << 32), 3 + below(20) as i64),
            kind => {
                let count = 1 + below(4);
                let noise = if kind == 7 { 40 } else { 0 };
                Self::Bars((0..count).map(|_| Bar::draw(random, size)).collect(), noise)
            }
        }
    }

    /// The grey value of a pixel that shows what is so far to the right of it, in steps.
    fn grey(&self, [u, v]: [i64; 2], by: i64, [width, height]: [i64; 2]) -> u8 {
        let lit = |on: bool| if on { BRIGHT } else { DARK };
        let (right, hash) = (u + by / STEPS, |cell: i64, seed: u64| {
            let place = ((v / cell) as u64) << 32 | ((u + by / STEPS) / cell) as u64;
            Random(seed ^ place.wrapping_mul(0x9e37_79b9_7f4a_7c15)).below(256) as u8
        });
        match self {
            Self::Bars(bars, noise) => {
                // Four points of a pixel.
                let points =
                    [[1, 1], [3, 1], [1, 3], [3, 3]].map(|[a, b]| [u * STEPS + a + by, v * STEPS + b]);
                let hit = points.iter().filter(|point| bars.iter().any(|bar| bar.has(**point))).count();
                let plain = DARK + (usize::from(BRIGHT - DARK) * hit / points.len()) as u8;
                plain.saturating_add(if *noise > 0 { hash(1, 1) % noise } else { 0 })
            }
            Self::Noise(seed) => hash(1, *seed),
            Self::Checkerboard(side) => lit((right / side + v / side) % 2 == 1),
            Self::WordEdges(bits) => lit(right % bits == 0 || right % bits == bits - 1),
            Self::Border(wide) => lit(u < *wide || v < *wide || u + wide >= width || v + wide >= height),
            Self::Pixel(place) => lit([right, v] == *place),
            Self::Gradient => (right * 255 / width.max(1)) as u8,
            Self::Blots(seed, cell) => lit(hash(*cell, *seed) > 140),
        }
    }

    fn see(&self, [width, height]: [u32; 2], by: impl Fn(i64) -> i64) -> GrayImage {
        let size = [i64::from(width), i64::from(height)];
        GrayImage::from_fn(width, height, |u, v| Luma([self.grey([u.into(), v.into()], by(v.into()), size)]))
    }

    /// Both eyes' pictures: nearer or further, and tilted.
    fn pair(&self, random: &mut Random, size: [u32; 2]) -> Pair {
        let disparity = STEPS + random.below(u64::from(size[0]) * STEPS as u64 / 6) as i64;
        let tilt = random.below(9) as i64 - 4;
        [self.see(size, |_| 0), self.see(size, |v| disparity + tilt * v / 16)]
    }
}

/// A pair of an object of this size, px, drawn at random.
pub fn object(random: &mut Random, size: [u32; 2]) -> Pair {
    let bars = (0..1 + random.below(3)).map(|_| Bar::draw(random, size)).collect();
    Scene::Bars(bars, 0).pair(random, size)
}

/// The pair of a number: most fit the smallest of the emulated boards' memories, the rest the next one.
pub fn case(number: u64) -> Case {
    let mut random = Random(number.wrapping_mul(0x2545_f491_4f6c_dd1d));
    let mut side = |most: u64| {
        let near_word = 32 * (1 + random.below(most / 32)) as u32 + random.below(3) as u32 - 1;
        if random.below(3) == 0 { near_word.min(most as u32) } else { 8 + random.below(most - 7) as u32 }
    };
    let size = [side(208), side(120)];
    let pair = Scene::draw(&mut random, size).pair(&mut random, size);
    let focal = (size[0] as i32 + random.below(400) as i32) * PX;
    let optics = Optics { focal, disparity_offset: random.below(20) as i32 * PX - 8 * PX };
    Case { name: format!("pair {number}"), pair, optics, as_device: random.below(2) == 0 }
}
