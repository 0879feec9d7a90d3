//! The core in a firmware of one's own, as small as it gets: two grey pictures in, the skeleton's curves with
//! their depth out. No allocation, no operating system; all memory is one `static`.
//!
//! On a PC:
//!
//!     cargo run -p shared --example sketch
//!
//! On an emulated Cortex-M, in whose place a board comes with its own memory map:
//!
//!     cargo rustc -p shared --example sketch --release --target thumbv7em-none-eabihf -- \
//!         -C link-arg=-Tfirmware/src/board/mps2/megabytes.x -C link-arg=-Tlink.x
//!     qemu-system-arm -M mps2-an386 -nographic -semihosting-config enable=on,target=native \
//!         -kernel target/thumbv7em-none-eabihf/release/examples/sketch
#![cfg_attr(target_os = "none", no_std, no_main)]

mod common;

use common::{Pictures, SIZE, Storage, draw};
#[cfg(target_os = "none")]
use semihosting::println;
use shared::bitmap::Grey;
use shared::fixed::PX;
use shared::pipeline::{Finding, Kernels, Settings, run};
use shared::stage::depth::Optics;
use static_cell::ConstStaticCell;

/// Focal length, px, and distance between the eyes, mm: what a calibration gives.
const FOCAL: i32 = 200;
const BASELINE: i32 = 60;

static STORAGE: ConstStaticCell<Storage> = ConstStaticCell::new(Storage::new());
static PICTURES: ConstStaticCell<Pictures> = ConstStaticCell::new([[0; SIZE.pixels()]; 2]);

fn sketch() -> Result<(), Finding> {
    let pictures = PICTURES.take();
    draw(pictures);
    let [left, right] = pictures.each_ref();

    let settings = Settings::device(Optics { focal: FOCAL * PX, disparity_offset: 0 });
    let mut memory = STORAGE.take().lend(Kernels::PORTABLE);
    let grey = |picture| Grey::new(SIZE, SIZE.width, picture);
    let outcome = run(&mut memory, grey(left)?, grey(right)?, &settings, &mut ())?;

    println!("{} px of object, {} balls", outcome.areas[0], memory.balls.len());
    let [left, _] = &memory.eyes;
    for branch in left.branches.iter() {
        let Some(curve) = branch.curve(left.controls) else { continue };
        println!("a curve of {} control points", curve.controls().len());
        for end in [0, curve.end()].map(|t| curve.evaluate(t)) {
            let depth = FOCAL * BASELINE * PX / end.d.max(1);
            println!(
                "  from or to ({}, {}) px, radius {} px, {depth} mm away",
                end.u / PX,
                end.v / PX,
                end.rho / PX
            );
        }
    }
    Ok(())
}

#[cfg(target_os = "none")]
#[cortex_m_rt::entry]
fn main() -> ! {
    semihosting::process::exit(i32::from(sketch().is_err()))
}

#[cfg(not(target_os = "none"))]
fn main() -> Result<(), String> {
    sketch().map_err(|finding| format!("{finding:?}"))
}
