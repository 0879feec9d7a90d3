//! Boots the board, runs the core on drawn pictures and stops: at a breakpoint with the disparity of the
//! ring in the first argument register when all is well, in the panic handler when not.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod board {
    use cortex_m::singleton;
    use firmware::memory::{HEIGHT, Storage, WIDTH};
    use firmware::selftest::{DISPARITY, draw_ring, run};
    use panic_halt as _;

    #[cortex_m_rt::entry]
    fn main() -> ! {
        let left = singleton!(: [u8; WIDTH * HEIGHT] = [0; WIDTH * HEIGHT]).expect("taken once");
        let right = singleton!(: [u8; WIDTH * HEIGHT] = [0; WIDTH * HEIGHT]).expect("taken once");
        let storage = singleton!(: Storage = Storage::new()).expect("taken once");
        draw_ring(90, left);
        draw_ring(90 - DISPARITY, right);
        let disparity = run(storage, left, right).expect("the ring is found");
        core::hint::black_box(disparity);
        loop {
            cortex_m::asm::bkpt();
        }
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    println!("build me for the board: cargo build -p firmware --release --target thumbv7em-none-eabihf");
}
