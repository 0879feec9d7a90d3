//! Room for one pair: the newest.
//!
//! Putting one in never waits. A page names the last pair that it has drawn and gets the newest one after it, as
//! soon as there is one; those between were never encoded, and the numbers say how many they were.

use std::sync::Arc;

use tokio::sync::watch;

use super::frame::Frame;

/// The newest pair, and those who wait for it.
#[derive(Debug, Default)]
pub(super) struct Slot(watch::Sender<Option<Arc<Frame>>>);

impl Slot {
    /// Puts a pair in place of the one before, which is returned.
    pub(super) fn put(&self, frame: Frame) -> Option<Arc<Frame>> {
        self.0.send_replace(Some(Arc::new(frame)))
    }

    /// The newest pair, once its number is greater than this.
    pub(super) async fn after(&self, number: u64) -> Arc<Frame> {
        let mut pairs = self.0.subscribe();
        loop {
            let newest = pairs.borrow_and_update().clone().filter(|frame| frame.number() > number);
            if let Some(frame) = newest {
                return frame;
            }
            // The sender is this slot's, so it is there.
            let _ = pairs.changed().await;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::frame::tests::refused;
    use std::future::Future;
    use std::pin::pin;
    use std::task::{Context, Poll, Waker};

    fn poll<T>(future: impl Future<Output = T>) -> Poll<T> {
        pin!(future).poll(&mut Context::from_waker(Waker::noop()))
    }

    fn newest(slot: &Slot, after: u64) -> Option<u64> {
        match poll(slot.after(after)) {
            Poll::Ready(frame) => Some(frame.number()),
            Poll::Pending => None,
        }
    }

    #[test]
    fn the_newest_wins_and_is_there_for_all() {
        let slot = Slot::default();
        assert_eq!(newest(&slot, 0), None);
        for number in 1..=5 {
            slot.put(refused(number));
        }
        // Who comes late, who is slow, and who has drawn the last one already.
        assert_eq!([0, 3, 4, 5].map(|after| newest(&slot, after)), [Some(5), Some(5), Some(5), None]);
    }

    #[test]
    fn who_waits_is_woken() {
        let slot = Slot::default();
        slot.put(refused(1));
        let mut waiting = pin!(slot.after(1));
        let mut context = Context::from_waker(Waker::noop());
        assert!(waiting.as_mut().poll(&mut context).is_pending());
        slot.put(refused(2));
        assert!(matches!(waiting.as_mut().poll(&mut context), Poll::Ready(frame) if frame.number() == 2));
    }

    #[test]
    fn what_nobody_looks_at_comes_back() {
        let slot = Slot::default();
        assert!(slot.put(refused(1)).is_none());
        let Poll::Ready(looked_at) = poll(slot.after(0)) else { panic!("it is there") };
        let first = slot.put(refused(2)).unwrap();
        assert!(Arc::ptr_eq(&first, &looked_at) && Arc::into_inner(first).is_none(), "it is looked at");
        assert_eq!(slot.put(refused(3)).and_then(Arc::into_inner).map(|frame| frame.number()), Some(2));
    }
}
