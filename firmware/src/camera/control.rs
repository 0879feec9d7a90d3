//! The wires of a control bus, and how they are freed.
//!
//! A device that is reset in the middle of a reading leaves a sensor that waits for the clock and holds SDA low:
//! no transfer can begin then, and the sensor, which keeps its supply, would hold on for ever.

use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{InputPin, OutputPin};
use embedded_hal::i2c::I2c;

/// Half a period of the clock while wires are freed, us: that of 100 kHz.
const HALF_US: u32 = 5;
/// Clocks after which any sensor lets SDA go: an acknowledgement and eight bits.
const CLOCKS: u32 = 9;

/// A control bus whose wires can be freed.
pub trait ControlBus: I2c {
    /// Free the wires from a sensor that holds them, if it lets them go, and be ready for a transfer.
    fn clear(&mut self);
}

/// Clock a sensor, by hand, until it lets SDA go, and then end its transfer; whether the wires are free. Both are
/// open drains, which their bus does not use meanwhile.
///
/// # Errors
/// A pin that fails.
pub fn clear<L, A>(scl: &mut L, sda: &mut A, delay: &mut impl DelayNs) -> Result<bool, L::Error>
where
    L: OutputPin,
    A: OutputPin<Error = L::Error> + InputPin,
{
    sda.set_high()?;
    scl.set_high()?;
    delay.delay_us(HALF_US);
    for _ in 0..=CLOCKS {
        // A sensor that sends a one may send a zero next, and then hears no stop.
        let stops = sda.is_high()?;
        scl.set_low()?;
        delay.delay_us(HALF_US);
        if stops {
            sda.set_low()?;
        }
        delay.delay_us(HALF_US);
        scl.set_high()?;
        delay.delay_us(HALF_US);
        sda.set_high()?;
        delay.delay_us(HALF_US);
        if stops && sda.is_high()? {
            return Ok(true);
        }
    }
    Ok(false)
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::cell::RefCell;
    use core::convert::Infallible;
    use embedded_hal::digital::ErrorType;

    /// A sensor in the middle of a reading, and what the master does to the wires.
    #[derive(Clone, Copy, Debug)]
    struct Wires {
        scl: bool,
        sda: bool,
        /// Bits still to be sent, the next one highest, and how many; none when it has let go.
        bits: u32,
        left: u32,
        /// Whether it is in a transfer.
        busy: bool,
        /// Whether it never lets go.
        stuck: bool,
        clocks: u32,
    }

    impl Wires {
        /// Sending `left` bits, the lowest of `bits`, the first of them now.
        fn sending(bits: u32, left: u32) -> Self {
            let bits = bits << (16 - left);
            Self { scl: true, sda: true, bits, left, busy: true, stuck: false, clocks: 0 }
        }

        fn pulls(&self) -> bool {
            self.stuck || (self.busy && self.left > 0 && self.bits >> 15 & 1 == 0)
        }

        fn level(&self) -> bool {
            self.sda && !self.pulls()
        }

        fn clock(&mut self, high: bool) {
            let falls = self.scl && !high;
            let rises = !self.scl && high;
            self.scl = high;
            if falls {
                self.clocks += 1;
                (self.bits, self.left) = (self.bits << 1, self.left.saturating_sub(1));
            }
            // Nobody acknowledges.
            if rises && self.left == 0 && self.level() {
                self.busy = false;
            }
        }

        fn data(&mut self, high: bool) {
            let before = self.level();
            self.sda = high;
            if self.scl && !before && self.level() {
                self.busy = false;
            }
        }
    }

    struct Scl<'a>(&'a RefCell<Wires>);
    struct Sda<'a>(&'a RefCell<Wires>);
    struct NoTime;

    impl ErrorType for Scl<'_> {
        type Error = Infallible;
    }

    impl ErrorType for Sda<'_> {
        type Error = Infallible;
    }

    impl OutputPin for Scl<'_> {
        fn set_low(&mut self) -> Result<(), Infallible> {
            self.0.borrow_mut().clock(false);
            Ok(())
        }
        fn set_high(&mut self) -> Result<(), Infallible> {
            self.0.borrow_mut().clock(true);
            Ok(())
        }
    }

    impl OutputPin for Sda<'_> {
        fn set_low(&mut self) -> Result<(), Infallible> {
            self.0.borrow_mut().data(false);
            Ok(())
        }
        fn set_high(&mut self) -> Result<(), Infallible> {
            self.0.borrow_mut().data(true);
            Ok(())
        }
    }

    impl InputPin for Sda<'_> {
        fn is_high(&mut self) -> Result<bool, Infallible> {
            Ok(self.0.borrow().level())
        }
        fn is_low(&mut self) -> Result<bool, Infallible> {
            Ok(!self.0.borrow().level())
        }
    }

    impl DelayNs for NoTime {
        fn delay_ns(&mut self, _: u32) {}
    }

    fn cleared(wires: Wires) -> (bool, Wires) {
        let wires = RefCell::new(wires);
        let Ok(free) = clear(&mut Scl(&wires), &mut Sda(&wires), &mut NoTime);
        (free, wires.into_inner())
    }

    #[test]
    fn a_sensor_that_lets_go_after_so_many_clocks_is_ended_by_the_next() {
        for held in 0..=9 {
            let (free, after) = cleared(Wires::sending(0, held));
            assert!(free && !after.busy && after.level() && after.scl, "{held}: {after:?}");
            assert_eq!(after.clocks, held + 1);
        }
    }

    /// Any byte, from any of its bits on, its own acknowledgement before it among them.
    #[test]
    fn whatever_a_sensor_sends_it_is_ended() {
        for left in 0..=9 {
            for bits in 0..1 << left.min(8) {
                let (free, after) = cleared(Wires::sending(bits, left));
                assert!(free && !after.busy && after.level(), "{bits:#b} of {left}: {after:?}");
                assert!(after.clocks <= CLOCKS + 1, "{after:?}");
            }
        }
    }

    #[test]
    fn a_wire_that_nobody_lets_go_is_told_and_soon() {
        let (free, after) = cleared(Wires { stuck: true, ..Wires::sending(0, 0) });
        assert!(!free && after.scl && after.sda, "{after:?}");
        assert_eq!(after.clocks, CLOCKS + 1);
    }
}
