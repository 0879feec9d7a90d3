//! What outlives a reset: why the board has started, and how often it hung since it was switched on.

use crate::device::Birth;
use crate::reset::{reason, watchdog_resets};
use embassy_stm32::pac::{PWR, RCC, RTC};

/// The register that outlives a reset.
const COUNT: usize = 0;

/// What is remembered of the time before the start; the reason is forgotten with this.
pub(super) fn recall(board: &'static str) -> Birth {
    let reset = reason(RCC.rsr().read().0);
    RCC.rsr().modify(|register| register.set_rmvf(true));

    RCC.apb4enr().modify(|register| register.set_rtcapben(true));
    PWR.cr1().modify(|register| register.set_dbp(true));
    let count = RTC.bkpr(COUNT);
    let watchdog_resets = watchdog_resets(reset, count.read().bkp());
    count.write(|register| register.set_bkp(watchdog_resets));
    Birth { board, reset, watchdog_resets }
}
