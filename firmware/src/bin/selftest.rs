//! Boots the board, runs the core on drawn pictures and stops: at a breakpoint with the disparity of the
//! ring in the first argument register when all is well, in the panic handler when not.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod board {
    use cortex_m::singleton;
    use firmware::memory::Qvga;
    use firmware::selftest::run;
    use panic_halt as _;

    #[cortex_m_rt::entry]
    fn main() -> ! {
        let storage = singleton!(: Qvga = Qvga::new()).expect("taken once");
        let disparity = run(storage).expect("the ring is found");
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
