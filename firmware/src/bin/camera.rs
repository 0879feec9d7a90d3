//! The camera: NUCLEO-H743ZI2 with two ArduCAM Mini 2MP Plus. Boots, tests the core on drawn pictures, shows
//! by its lamps what came of it, and logs over the debug probe.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod board {
    use defmt::{error, info};
    use embassy_time::{Duration, block_for};
    use firmware::board::h743::{Board, State};
    use firmware::memory::Qvga;
    use firmware::selftest;
    use static_cell::ConstStaticCell;

    static STORAGE: ConstStaticCell<Qvga> = ConstStaticCell::new(Qvga::new());

    #[cortex_m_rt::entry]
    fn main() -> ! {
        let mut board = Board::take().expect("taken once");
        info!("started: {}", defmt::Debug2Format(&board.reset));
        match selftest::run(STORAGE.take()) {
            Ok(disparity) => {
                info!("self-test: the ring's disparity is {} / 256 px", disparity);
                board.lamps.show(State::Ready);
            }
            Err(finding) => {
                error!("self-test: {}", defmt::Debug2Format(&finding));
                board.lamps.show(State::Faulty);
            }
        }
        loop {
            board.watchdog.feed();
            block_for(Duration::from_millis(100));
        }
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    println!("this runs on a board: cargo camera (firmware/README.md)");
}
