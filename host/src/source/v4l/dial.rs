//! How long a camera exposes: the controls that drivers have for it.
//!
//! Webcams count in 0.1 ms and mostly have an automatic; bare sensors count lines. Drivers bring a time into their own
//! range, so what they took is read back.

use std::fmt;
use std::io;

use super::super::exposure::{Exposure, Range};

/// The kernel's numbers of controls (`linux/v4l2-controls.h`).
const AUTO: u32 = 0x009a_0901;
/// Each control of a time, and the longest that is offered: 0.1 s, which is 10 pairs a second, or so many lines.
const TIMES: [(u32, u32, &str); 2] = [(0x009a_0902, 1000, "× 0.1 ms"), (0x0098_0911, 10_000, "lines")];
/// Modes of the automatic: the time by hand; by the camera, or all of it by the camera.
const MANUAL: i64 = 1;
const AUTOMATIC: [i64; 2] = [3, 0];

/// The controls of a driver, by their numbers.
pub trait Controls {
    /// What one is set to.
    ///
    /// # Errors
    /// The system's; a driver without it, among others.
    fn get(&self, id: u32) -> io::Result<i64>;

    /// Sets it.
    ///
    /// # Errors
    /// The system's.
    fn set(&mut self, id: u32, value: i64) -> io::Result<()>;
}

/// A camera's exposure.
pub struct Dial {
    controls: Box<dyn Controls + Send>,
    time: u32,
    range: Range,
}

impl fmt::Debug for Dial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Dial").field("range", &self.range).finish_non_exhaustive()
    }
}

impl Dial {
    /// The exposure of a driver that has controls for it.
    pub fn find(controls: impl Controls + Send + 'static) -> Option<Self> {
        let (time, most, unit) = TIMES.into_iter().find(|(id, ..)| controls.get(*id).is_ok())?;
        let range = Range { least: 1, most, unit, auto: controls.get(AUTO).is_ok() };
        Some(Self { controls: Box::new(controls), time, range })
    }

    /// What it can be set to.
    #[must_use]
    pub fn range(&self) -> &Range {
        &self.range
    }

    /// Sets it; returns the time that the driver took, if one was given.
    ///
    /// # Errors
    /// The system's.
    pub fn set(&mut self, exposure: Exposure) -> io::Result<Option<i64>> {
        match exposure {
            Exposure::Auto => {
                let [first, second] = AUTOMATIC;
                self.controls.set(AUTO, first).or_else(|_| self.controls.set(AUTO, second))?;
                Ok(None)
            }
            Exposure::Fixed(time) => {
                if self.range.auto {
                    self.controls.set(AUTO, MANUAL)?;
                }
                self.controls.set(self.time, time.into())?;
                self.controls.get(self.time).map(Some)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::{Arc, Mutex};

    /// A driver with some controls, which takes some modes alone and no longer time than its own.
    #[derive(Clone)]
    struct Driver {
        values: Arc<Mutex<Vec<(u32, i64)>>>,
        modes: &'static [i64],
    }

    impl Driver {
        fn new(ids: &[u32], modes: &'static [i64]) -> Self {
            Self { values: Arc::new(Mutex::new(ids.iter().map(|id| (*id, 3)).collect())), modes }
        }

        fn values(&self) -> Vec<i64> {
            self.values.lock().unwrap().iter().map(|(_, value)| *value).collect()
        }
    }

    impl Controls for Driver {
        fn get(&self, id: u32) -> io::Result<i64> {
            let values = self.values.lock().unwrap();
            values
                .iter()
                .find(|(known, _)| *known == id)
                .map(|(_, value)| *value)
                .ok_or(io::ErrorKind::InvalidInput.into())
        }

        fn set(&mut self, id: u32, value: i64) -> io::Result<()> {
            let manual = self.get(AUTO).map_or(MANUAL, |mode| mode);
            let refused = if id == AUTO { !self.modes.contains(&value) } else { manual != MANUAL };
            let mut values = self.values.lock().unwrap();
            match values.iter_mut().find(|(known, _)| *known == id) {
                Some((_, old)) if !refused => *old = value.min(500),
                _ => return Err(io::ErrorKind::InvalidInput.into()),
            }
            Ok(())
        }
    }

    #[test]
    fn a_webcam_is_taken_from_its_automatic_and_given_back() {
        let driver = Driver::new(&[AUTO, TIMES[0].0], &[1, 3]);
        let mut dial = Dial::find(driver.clone()).unwrap();
        assert_eq!((dial.range().unit, dial.range().auto), ("× 0.1 ms", true));
        assert_eq!(dial.set(Exposure::Fixed(40)).unwrap(), Some(40));
        assert_eq!(driver.values(), [MANUAL, 40]);
        assert_eq!(dial.set(Exposure::Fixed(900)).unwrap(), Some(500), "the driver's own limit");
        assert_eq!(dial.set(Exposure::Auto).unwrap(), None);
        assert_eq!(driver.values()[0], 3);
    }

    #[test]
    fn the_other_automatic_is_found_too() {
        let driver = Driver::new(&[AUTO, TIMES[0].0], &[1, 0]);
        Dial::find(driver.clone()).unwrap().set(Exposure::Auto).unwrap();
        assert_eq!(driver.values()[0], 0);
    }

    #[test]
    fn a_sensor_counts_lines_and_a_driver_may_have_nothing() {
        let mut dial = Dial::find(Driver::new(&[TIMES[1].0], &[])).unwrap();
        assert_eq!((dial.range().unit, dial.range().auto), ("lines", false));
        assert_eq!(dial.set(Exposure::Fixed(7)).unwrap(), Some(7));
        assert!(dial.set(Exposure::Auto).is_err());
        assert!(Dial::find(Driver::new(&[AUTO], &[])).is_none());
    }
}
