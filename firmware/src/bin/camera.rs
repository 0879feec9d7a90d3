//! The camera: NUCLEO-H743ZI2 with two ArduCAM Mini 2MP Plus. Tests the core on drawn pictures, then is the
//! device of docs/device.md, shows by its lamps how it is, and logs over the debug probe.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod board {
    use cortex_m::asm::wfi;
    use defmt::{error, info};
    use embassy_time::{Duration, block_for};
    use firmware::board::h743::Board;
    use firmware::device::{Condition, Desk, Device};
    use firmware::drive::{Pace, step};
    use firmware::memory::{Qvga, Storage};
    use firmware::selftest;
    use shared::stage::warp::knots;
    use shared::wire::finding_code;
    use static_cell::ConstStaticCell;

    const KNOTS: usize = knots(Qvga::CAPACITIES.size);

    static STORAGE: ConstStaticCell<Qvga> = ConstStaticCell::new(Qvga::new());
    static DESK: ConstStaticCell<Desk<KNOTS>> = ConstStaticCell::new(Desk::new());

    const fn name(condition: Condition) -> &'static str {
        match condition {
            Condition::Starting => "starting",
            Condition::Ready => "ready",
            Condition::Working => "working",
            Condition::Faulty => "faulty",
        }
    }

    /// Wait for the watchdog: what a reset mends is well then, and hello tells of it; what it does not is told again.
    fn stop() -> ! {
        loop {
            wfi();
        }
    }

    #[cortex_m_rt::entry]
    fn main() -> ! {
        let Some(Board { mut ports, mut lamps, birth }) = Board::take() else {
            error!("a driver refuses its settings");
            stop()
        };
        // By the codes of docs/wire-format.md: text of core's, made at run time, would call itself.
        info!("started: reset {=u8}, {=u32} by the watchdog", birth.reset as u8, birth.watchdog_resets);
        let storage = STORAGE.take();
        match selftest::run(storage) {
            Ok(disparity) => info!("self-test: the ring's disparity is {} / 256 px", disparity),
            Err(finding) => {
                lamps.show(Condition::Faulty);
                error!("the self-test failed: finding {=u8}", finding_code(&finding));
                stop()
            }
        }
        let mut device = Device::new(storage, DESK.take(), birth);
        let mut shown = Condition::Starting;
        loop {
            let pace = step(&mut device, &mut ports);
            let condition = device.condition();
            if condition != shown {
                info!("{=str}", name(condition));
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
