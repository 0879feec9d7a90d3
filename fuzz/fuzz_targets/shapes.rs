//! A payload as a pair that a device describes, and the model that the host makes of its shape.
#![no_main]

use host::reconstruct::{Options, Workspace};
use host::source::serial::inbox::{Inbox, Message};
use libfuzzer_sys::fuzz_target;
use oracle::wire::model;
use shared::wire::Frame;
use std::cell::RefCell;

/// What a pair is called on the wire.
const PAIR: u8 = 2;

thread_local! {
    static DESK: RefCell<(Inbox, Workspace)> =
        RefCell::new((Inbox::new().expect("memory for shapes"), Workspace::default()));
}

fuzz_target!(|payload: &[u8]| {
    DESK.with_borrow_mut(|(inbox, workspace)| {
        let frame = Frame { kind: PAIR, sequence: 1, repeated: false, payload };
        let Ok(Message::Pair(pair)) = inbox.read(&frame) else { return };
        let Ok(outcome) = pair.result else { return };
        let options = Options::default();
        let made = workspace.reconstruct_shape(
            (&mut inbox.memory(), outcome),
            None,
            &model(None),
            &options,
            &mut (),
        );
        match made {
            Ok(made) => {
                assert!(made.mesh.vertices.iter().all(|v| v.iter().all(|x| x.is_finite())));
                workspace.recycle(made);
            }
            Err(refusal) => assert!(!refusal.to_string().is_empty()),
        }
    });
});
