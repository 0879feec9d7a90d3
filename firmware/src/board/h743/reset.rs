//! Why the board has started, and how often it hung since it was switched on.

use embassy_stm32::pac::{PWR, RCC, RTC};
use shared::wire::ResetReason;

/// What the board remembers of the time before it started.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reset {
    /// Why it started.
    pub reason: ResetReason,
    /// Times that the watchdog bit since it was switched on.
    pub watchdog_resets: u32,
}

/// The register that outlives a reset.
const COUNT: usize = 0;

impl Reset {
    /// What there is to remember; the reason is forgotten with this.
    pub(super) fn recall() -> Self {
        let flags = RCC.rsr().read();
        RCC.rsr().modify(|register| register.set_rmvf(true));
        // Every reset also pulls the reset pin, and power raises both flags of the supply: the particular first.
        let reason = if flags.iwdg1rstf() {
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
        let watchdog_resets = match reason {
            ResetReason::Power | ResetReason::BrownOut => 0,
            ResetReason::Watchdog => count.read().bkp().saturating_add(1),
            _ => count.read().bkp(),
        };
        count.write(|register| register.set_bkp(watchdog_resets));
        Self { reason, watchdog_resets }
    }
}
