//! Why a chip of the STM32H7 has started, from the flags that its resets raise.

use shared::wire::ResetReason;

/// Flags of RCC_RSR.
const BROWN_OUT: u32 = 1 << 21;
const PIN: u32 = 1 << 22;
const POWER: u32 = 1 << 23;
const SOFTWARE: u32 = 1 << 24;
const WATCHDOG: u32 = 1 << 26;

/// The reason that these flags tell. Every reset also pulls the reset pin, and power raises both flags of the
/// supply: the particular first.
pub const fn reason(flags: u32) -> ResetReason {
    if flags & WATCHDOG != 0 {
        ResetReason::Watchdog
    } else if flags & SOFTWARE != 0 {
        ResetReason::Software
    } else if flags & POWER != 0 {
        ResetReason::Power
    } else if flags & BROWN_OUT != 0 {
        ResetReason::BrownOut
    } else if flags & PIN != 0 {
        ResetReason::Pin
    } else {
        ResetReason::Unknown
    }
}

/// How often the watchdog has reset the chip since it was switched on, by what was counted before this reset.
pub const fn watchdog_resets(reason: ResetReason, before: u32) -> u32 {
    match reason {
        ResetReason::Power | ResetReason::BrownOut => 0,
        ResetReason::Watchdog => before.saturating_add(1),
        _ => before,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What each reset raises, by the reference manual's table (RM0433, reset source identification).
    #[test]
    fn every_reset_is_told_by_its_flags() {
        const CPU: u32 = 1 << 17;
        const DOMAINS: u32 = 1 << 19 | 1 << 20;
        for (flags, expected) in [
            (POWER | PIN | BROWN_OUT | DOMAINS | CPU, ResetReason::Power),
            (PIN | CPU, ResetReason::Pin),
            (PIN | BROWN_OUT | CPU, ResetReason::BrownOut),
            (SOFTWARE | PIN | CPU, ResetReason::Software),
            (WATCHDOG | PIN | CPU, ResetReason::Watchdog),
            // The domain wakes from standby, of which nothing is told.
            (1 << 19, ResetReason::Unknown),
            (0, ResetReason::Unknown),
        ] {
            assert_eq!(reason(flags), expected, "{flags:#x}");
        }
    }

    #[test]
    fn the_watchdog_is_counted_until_the_supply_goes() {
        assert_eq!(watchdog_resets(ResetReason::Watchdog, 2), 3);
        assert_eq!(watchdog_resets(ResetReason::Watchdog, u32::MAX), u32::MAX);
        for reason in [ResetReason::Pin, ResetReason::Software, ResetReason::Unknown] {
            assert_eq!(watchdog_resets(reason, 2), 2);
        }
        for reason in [ResetReason::Power, ResetReason::BrownOut] {
            assert_eq!(watchdog_resets(reason, 0xDEAD_BEEF), 0);
        }
    }
}
