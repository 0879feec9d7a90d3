//! Why the board has started.

use embassy_stm32::pac::RCC;

/// Why the board has started.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub enum Reset {
    /// Power came.
    Power,
    /// The black button, or a debugger.
    Button,
    /// The program asked for it.
    Software,
    /// The program hung, or panicked with no debugger there.
    Watchdog,
}

/// The reason, which is forgotten with this.
pub(super) fn reason() -> Reset {
    let flags = RCC.rsr().read();
    RCC.rsr().modify(|register| register.set_rmvf(true));
    // Every reset also pulls the reset pin: the particular reasons come first.
    if flags.iwdg1rstf() {
        Reset::Watchdog
    } else if flags.sftrstf() {
        Reset::Software
    } else if flags.porrstf() || flags.borrstf() {
        Reset::Power
    } else {
        Reset::Button
    }
}
