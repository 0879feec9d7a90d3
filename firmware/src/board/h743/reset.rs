//! Why the board has started, and how often it hung since it was switched on.

use crate::device::Birth;
use embassy_stm32::pac::{PWR, RCC, RTC};
use shared::wire::ResetReason;

/// The register that outlives a reset.
const COUNT: usize = 0;

/// What is remembered of the time before the start; the reason is forgotten with this.
pub(super) fn recall(board: &'static str) -> Birth {
    let flags = RCC.rsr().read();
    RCC.rsr().modify(|register| register.set_rmvf(true));
    // Every reset also pulls the reset pin, and power raises both flags of the supply: the particular first.
    let reset = if flags.iwdg1rstf() {
        ResetReason::Watchdog
    } else if flags.sftrstf() {
        ResetReason::Software
    } else if flags.porrstf() {
        ResetReason::Power
    } else if flags.borrstf() {
        ResetReason::BrownOut
    } else if flags.pinrstf() {
        ResetReason::Pin
    } else {
        ResetReason::Unknown
    };

    RCC.apb4enr().modify(|register| register.set_rtcapben(true));
    PWR.cr1().modify(|register| register.set_dbp(true));
    let count = RTC.bkpr(COUNT);
    let watchdog_resets = match reset {
        ResetReason::Power | ResetReason::BrownOut => 0,
        ResetReason::Watchdog => count.read().bkp().saturating_add(1),
        _ => count.read().bkp(),
    };
    count.write(|register| register.set_bkp(watchdog_resets));
    Birth { board, reset, watchdog_resets }
}
