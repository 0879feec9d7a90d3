//! A recording, whole or cut or with a byte changed, and every frame in it as a message.
#![no_main]

use arbitrary::Arbitrary;
use host::source::serial::inbox::Inbox;
use host::source::serial::link;
use host::source::serial::recording::Recording;
use libfuzzer_sys::fuzz_target;
use oracle::wire::{command_bytes, model};
use shared::wire::{Decoder, MAX_FRAME, ToDevice};
use std::cell::RefCell;
use std::path::Path;

#[derive(Arbitrary, Debug)]
enum Entry<'a> {
    Connection,
    Bytes(&'a [u8]),
    Frame(u8, u16, &'a [u8]),
    Calibration,
    /// Kind, time, the length that it says, and the bytes that there are.
    Other(u8, u64, u32, &'a [u8]),
}

fn entry(kind: u8, time: u64, length: usize, bytes: &[u8]) -> Vec<u8> {
    [&[kind], time.to_le_bytes().as_slice(), &(length as u32).to_le_bytes(), bytes].concat()
}

impl Entry<'_> {
    fn bytes(&self, time: u64) -> Vec<u8> {
        let whole = |kind, bytes: &[u8]| entry(kind, time, bytes.len(), bytes);
        match *self {
            Self::Connection => whole(0, &[]),
            Self::Bytes(bytes) => whole(1, bytes),
            Self::Frame(kind, number, payload) => whole(1, &oracle::link::frame(kind, number, payload)),
            Self::Calibration => whole(2, &command_bytes(&ToDevice::Calibration(model(None)))),
            Self::Other(kind, time, length, bytes) => entry(kind, time, length as usize, bytes),
        }
    }
}

thread_local! {
    static INBOX: RefCell<Inbox> = RefCell::new(Inbox::new().expect("memory for shapes"));
}

fuzz_target!(|input: (Vec<Entry<'_>>, Option<u16>, Option<(u16, u8)>)| {
    let (entries, cut, change) = input;
    let mut file = b"ossature-link-1\n".to_vec();
    file.extend(entries.iter().enumerate().flat_map(|(k, entry)| entry.bytes(k as u64)));
    if let Some((at, mask)) = change {
        let at = usize::from(at) % file.len();
        file[at] ^= mask;
    }
    if let Some(cut) = cut {
        file.truncate(cut.into());
    }
    let recording = match Recording::parse(Path::new("recording"), &file) {
        Ok(recording) => recording,
        Err(error) => return assert!(!error.to_string().is_empty()),
    };
    let kept: usize = recording.connections.iter().map(Vec::len).sum();
    assert!(kept <= file.len(), "nothing is added");
    let mut sound = file.clone();
    sound.truncate(file.len() - recording.cut);
    recording.damaged.iter().rev().for_each(|lost| drop(sound.drain(lost.clone())));
    let again = Recording::parse(Path::new("recording"), &sound).expect("what was read");
    let whole = Recording { damaged: Vec::new(), cut: 0, ..recording.clone() };
    assert!(again == whole, "each byte is read or told as lost");
    INBOX.with_borrow_mut(|inbox| {
        for bytes in &recording.connections {
            let mut buffer = [0; MAX_FRAME];
            link::frames(&mut Decoder::new(&mut buffer), bytes, |arrived| {
                let _ = inbox.read(&arrived.frame());
                let _ = inbox.memory();
            });
        }
    });
});
