//! The camera: NUCLEO-H743ZI2 with two ArduCAM Mini 2MP Plus. Tests the core on drawn pictures, then is the
//! device of docs/device.md, shows by its lamps how it is, and logs over the debug probe.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod board {
    use defmt::{Debug2Format, info, panic};
    use embassy_time::{Duration, block_for};
    use firmware::board::h743::Board;
    use firmware::device::{Condition, Desk, Device};
    use firmware::drive::{Pace, step};
    use firmware::memory::{Qvga, Storage};
    use firmware::selftest;
    use shared::stage::warp::knots;
    use static_cell::ConstStaticCell;

    const KNOTS: usize = knots(Qvga::CAPACITIES.size);

    static STORAGE: ConstStaticCell<Qvga> = ConstStaticCell::new(Qvga::new());
    static DESK: ConstStaticCell<Desk<KNOTS>> = ConstStaticCell::new(Desk::new());

    #[cortex_m_rt::entry]
    fn main() -> ! {
        let Board { mut ports, mut lamps, birth } = Board::take().expect("taken once");
        info!("started: {}", Debug2Format(&birth));
        let storage = STORAGE.take();
        match selftest::run(storage) {
            Ok(disparity) => info!("self-test: the ring's disparity is {} / 256 px", disparity),
            Err(finding) => {
                lamps.show(Condition::Faulty);
                panic!("self-test: {}", Debug2Format(&finding));
            }
        }
        let mut device = Device::new(storage, DESK.take(), birth);
        let mut shown = Condition::Starting;
        loop {
            let pace = step(&mut device, &mut ports);
            let condition = device.condition();
            if condition != shown {
                info!("{}", Debug2Format(&condition));
                lamps.show(condition);
                shown = condition;
            }
            if pace == Pace::Idle {
                block_for(Duration::from_millis(1));
            }
        }
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    println!("this runs on a board: cargo camera (firmware/README.md)");
}
