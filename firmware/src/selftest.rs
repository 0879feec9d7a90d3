//! A self-test that needs no camera: two drawn pictures of a ring through the whole pipeline.

use crate::memory::{HEIGHT, Storage, WIDTH};
use shared::bitmap::Grey;
use shared::fixed::PX;
use shared::pipeline::{self, Finding, Settings};
use shared::stage::depth::Optics;

/// Disparity of the drawn ring, px.
pub const DISPARITY: i32 = 20;

/// A bright ring of radius 30 and width 20 px on a dark ground, its centre in column `u`.
pub fn draw_ring(u: i32, picture: &mut [u8; WIDTH * HEIGHT]) {
    for (i, pixel) in picture.iter_mut().enumerate() {
        let (du, dv) = ((i % WIDTH) as i32 - u, (i / WIDTH) as i32 - HEIGHT as i32 / 2);
        let squared = du * du + dv * dv;
        *pixel = if (20 * 20..=40 * 40).contains(&squared) { 200 } else { 20 };
    }
}

/// Run the pipeline on both pictures; the disparity of the ring's first ball, 1/256 px.
///
/// # Errors
/// What the core refuses, which would be a fault of this program.
pub fn run(storage: &mut Storage, left: &[u8], right: &[u8]) -> Result<i32, Finding> {
    let mut memory = storage.lend();
    let optics = Optics { focal: 400 * PX, disparity_offset: 0 };
    let picture = |data| Grey::new(Storage::size(), WIDTH, data);
    pipeline::run(&mut memory, picture(left)?, picture(right)?, &Settings::new(optics), &mut ())?;
    memory.depths.first().map(|d| d.disparity).ok_or(Finding::NoMap)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ring_is_where_it_was_drawn() {
        extern crate std;
        let mut pictures = [[0; WIDTH * HEIGHT]; 2];
        draw_ring(90, &mut pictures[0]);
        draw_ring(90 - DISPARITY, &mut pictures[1]);
        // On a PC words are twice as long, so is the memory: too much for a test's stack.
        let storage = std::thread::Builder::new().stack_size(16 << 20);
        let seen = storage.spawn(move || run(&mut Storage::new(), &pictures[0], &pictures[1])).unwrap();
        let disparity = seen.join().unwrap().unwrap();
        // The contact lies in front of the centre by rho^2 / f^2 of the disparity: 10^2 / 400^2.
        assert!((disparity - DISPARITY * PX).abs() < PX / 8, "{disparity}");
    }
}
