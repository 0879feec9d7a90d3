//! A payload as every message that it could be: what is read can be used, and written to bytes that give it again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use oracle::wire::{Lists, check};
use shared::wire::{Frame, PairReport, ToDevice, ToHost};
use std::cell::RefCell;

thread_local! {
    /// Lists as they were left, and room for two frames.
    static DESK: RefCell<(Lists, [Vec<u8>; 2])> =
        RefCell::new((Lists::default(), [vec![0; 1 << 20], vec![0; 1 << 20]]));
}

fn frame(kind: u8, payload: &[u8]) -> Frame<'_> {
    Frame { kind, sequence: 1, repeated: false, payload }
}

/// Write what a payload says; the frame's length, if the payload says anything.
fn rewrite(kind: u8, payload: &[u8], lists: &mut Lists, out: &mut [u8]) -> Option<usize> {
    let (frame, mut lists) = (frame(kind, payload), lists.lend());
    let message = ToHost::decode(&frame, &mut lists).ok()?;
    if let ToHost::Pair(PairReport { result: Ok(shape), .. }) = message {
        check(shape);
    }
    Some(message.encode(1, out).expect("there is room for every message that was read"))
}

fuzz_target!(|input: &[u8]| {
    let Some((&kind, payload)) = input.split_first() else { return };
    if let Ok(command) = ToDevice::decode(&frame(kind, payload)) {
        let mut out = [0; 1024];
        let len = command.encode(1, &mut out).expect("a command fits");
        let again = oracle::link::frames(&out[..len]).pop().expect("a frame");
        assert_eq!(ToDevice::decode(&frame(again.0, &again.2)), Ok(command));
    }
    DESK.with_borrow_mut(|(lists, [first, second])| {
        let Some(len) = rewrite(kind, payload, lists, first) else { return };
        let (kind, _, payload) = oracle::link::frames(&first[..len]).pop().expect("a frame");
        let again = rewrite(kind, &payload, lists, second).expect("a message");
        assert_eq!(first[..len], second[..again], "what was read is written to the same bytes again");
    });
});
