//! A self-test that needs no camera: two drawn pictures of a ring through the whole pipeline, the way a
//! device goes it, one picture at a time.

use crate::memory::Storage;
use shared::arena::Arena;
use shared::bitmap::{Grey, Size};
use shared::fixed::PX;
use shared::pipeline::{Finding, Run, Settings, Side};
use shared::stage::depth::Optics;

/// Disparity of the drawn ring, px.
pub const DISPARITY: i32 = 20;

/// A bright ring of radius 30 and width 20 px on a dark ground, its centre in column `u` and mid-height.
fn draw_ring(size: Size, u: i32, picture: &mut [u8]) {
    for (i, pixel) in picture.iter_mut().enumerate() {
        let (du, dv) = ((i % size.width) as i32 - u, (i / size.width) as i32 - size.height as i32 / 2);
        let squared = du * du + dv * dv;
        *pixel = if (20 * 20..=40 * 40).contains(&squared) { 200 } else { 20 };
    }
}

/// Run the pipeline on both pictures; the disparity of the ring's first ball, 1/256 px.
///
/// # Errors
/// What the core refuses, which would be a fault of this program.
pub fn run<S: Storage>(storage: &mut S) -> Result<i32, Finding> {
    let size = S::CAPACITIES.size;
    let optics = Optics { focal: 400 * PX, disparity_offset: 0 };
    let settings = Settings::device(optics);
    let mut memory = storage.lend();
    let mut run = Run::new(&mut memory, &settings);
    for (side, u) in [(Side::Left, 90), (Side::Right, 90 - DISPARITY)] {
        let eye = &mut memory.eyes[side as usize];
        let mut scratch = Arena::new(memory.scratch);
        let picture = scratch.take(size.pixels(), "pixels in a picture")?;
        draw_ring(size, u, picture);
        run.outline(side, Grey::new(size, size.width, picture)?, eye, scratch, &mut ())?;
    }
    run.skeleton(Side::Left, &mut memory.eyes[0], Arena::new(memory.scratch), &mut ())?;
    run.pair(&mut memory, &mut ())?;
    memory.depths.first().map(|d| d.disparity).ok_or(Finding::NoMap)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::{Qvga, Small, Vga};
    extern crate std;

    fn disparity<S: Storage + Send + 'static>(storage: fn() -> S) -> i32 {
        // On a PC words are twice as long, so is the memory: too much for a test's stack.
        let deep = std::thread::Builder::new().stack_size(64 << 20);
        deep.spawn(move || run(&mut storage())).unwrap().join().unwrap().unwrap()
    }

    #[test]
    fn the_ring_is_where_it_was_drawn() {
        for disparity in [disparity(Small::new), disparity(Qvga::new), disparity(Vga::new)] {
            // The contact lies in front of the centre by rho^2 / f^2 of the disparity: 10^2 / 400^2.
            assert!((disparity - DISPARITY * PX).abs() < PX / 8, "{disparity}");
        }
    }
}
