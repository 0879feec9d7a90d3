//! Bytes to a host that takes them in pieces, when it likes.

use crate::ports::{Clock, LinkError};

/// Send all of `bytes` by `take`, which does not wait and says how many of them have gone. A host that has not taken
/// all of them within `limit` us is gone, however many it took: a device waits for no frame longer than that.
///
/// # Errors
/// Those of `take`; the limit.
pub fn send_within(
    limit: u32,
    clock: &impl Clock,
    mut bytes: &[u8],
    mut take: impl FnMut(&[u8]) -> Result<usize, LinkError>,
) -> Result<(), LinkError> {
    let since = clock.micros();
    loop {
        bytes = bytes.get(take(bytes)?..).unwrap_or_default();
        if bytes.is_empty() {
            return Ok(());
        }
        if clock.micros().saturating_sub(since) > u64::from(limit) {
            return Err(LinkError::TimeLimit(limit));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::cell::Cell;

    /// A host that takes `piece` bytes every `every` us, and what of 4096 bytes it got until when.
    fn send_to(piece: usize, every: u64) -> (Result<(), LinkError>, usize, u64) {
        struct Time(Cell<u64>);
        impl Clock for Time {
            fn micros(&self) -> u64 {
                self.0.get()
            }
        }
        let (time, mut taken, mut bytes) = (Time(Cell::new(77)), 0, [0; 4096]);
        for (at, byte) in bytes.iter_mut().enumerate() {
            *byte = (at % 251) as u8;
        }
        let result = send_within(1_000_000, &time, &bytes, |rest| {
            assert_eq!(rest, &bytes[taken..]);
            time.0.set(time.0.get() + 10);
            let due = (time.0.get() - 77) / every * piece as u64;
            let count = rest.len().min((due as usize).saturating_sub(taken));
            taken += count;
            Ok(count)
        });
        (result, taken, time.0.get() - 77)
    }

    #[test]
    fn a_host_that_takes_slowly_holds_nobody_longer_than_one_that_takes_nothing() {
        assert_eq!(send_to(64, 1000).0, Ok(()));
        for (piece, every) in [(0, 1), (1, 2500), (1, 900_000), (63, 20_000)] {
            let (result, taken, time) = send_to(piece, every);
            assert_eq!(result, Err(LinkError::TimeLimit(1_000_000)), "{piece} bytes every {every} us");
            assert!(taken < 4096 && time < 1_000_100, "{taken} bytes in {time} us");
        }
    }

    #[test]
    fn what_is_wrong_with_the_link_ends_it() {
        struct Still;
        impl Clock for Still {
            fn micros(&self) -> u64 {
                0
            }
        }
        assert_eq!(send_within(1, &Still, &[1], |_| Err(LinkError::Closed)), Err(LinkError::Closed));
        assert_eq!(send_within(1, &Still, &[], |_| Ok(0)), Ok(()));
    }
}
