//! The device on an emulated board: the loop of the camera, its host on the serial line, its eyes on a file.
//!
//! `device PICTURES`: raw luma of 320x240 px, left and right in turn, played over and over
//! (`firmware/src/board/mps2/eyes.rs`). It runs until the emulator is ended.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod board {
    use cortex_m::asm::delay;
    use firmware::board::mps2::{Board, Eyes, argument, refuse};
    use firmware::device::{Desk, Device};
    use firmware::drive::{Pace, Ports, step};
    use firmware::memory::{Qvga, Storage};
    use shared::stage::warp::knots;
    use static_cell::ConstStaticCell;

    const KNOTS: usize = knots(Qvga::CAPACITIES.size);
    /// Instructions of a nap: the emulator is left in peace, and no byte waits long.
    const NAP: u32 = 20_000;

    static STORAGE: ConstStaticCell<Qvga> = ConstStaticCell::new(Qvga::new());
    static DESK: ConstStaticCell<Desk<KNOTS>> = ConstStaticCell::new(Desk::new());

    #[cortex_m_rt::entry]
    fn main() -> ! {
        let Some(Board { uart, clock, flash, watchdog, birth, .. }) = Board::take() else {
            refuse("this runs twice")
        };
        let cameras = Eyes::new(argument(), &clock);
        let mut ports = Ports { cameras, link: uart, clock: &clock, flash, watchdog };
        let mut device = Device::new(STORAGE.take(), DESK.take(), birth);
        loop {
            if step(&mut device, &mut ports) == Pace::Idle {
                delay(NAP);
            }
        }
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    println!("this runs on an emulated board: see firmware/README.md");
}
