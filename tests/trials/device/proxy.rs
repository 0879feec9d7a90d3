//! A bad cable between a device and its host, which knows what it did to which pair.

use oracle::link::{Fault, frames};
use oracle::raster::Random;
use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::net::Shutdown;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

/// Types of messages: a hello, a pair, a part of a picture.
const HELLO: u8 = 1;
const PAIR: u8 = 2;
const PICTURE: u8 = 3;
/// A frame is hit once in so many, commands once in so many reads, and the connection ends once in so many frames.
const HIT: u64 = 12;
const HIT_COMMAND: u64 = 6;
const HANG_UP: u64 = 150;

/// What became of the frame of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fate {
    /// It was passed on as it was, to a host that had been greeted.
    Whole,
    /// Something happened to it.
    Hit,
    /// Nobody was there, or nobody who was greeted.
    Unheard,
}

#[derive(Default)]
struct State {
    bad: AtomicBool,
    host: Mutex<Host>,
    fates: Mutex<BTreeMap<u64, Fate>>,
    newest: AtomicU64,
}

/// The host's end.
#[derive(Default)]
struct Host {
    stream: Option<UnixStream>,
    greeted: bool,
}

/// The cable.
pub(crate) struct Proxy(Arc<State>);

impl Proxy {
    /// A good cable from a device's socket, once it is there, to one that is made.
    pub(crate) fn start(device: &Path, port: &Path) -> Self {
        let end = Instant::now() + Duration::from_secs(30);
        let device = loop {
            match UnixStream::connect(device) {
                Ok(stream) => break stream,
                Err(error) => assert!(Instant::now() < end, "QEMU offers no socket: {error}"),
            }
            thread::sleep(Duration::from_millis(20));
        };
        let state = Arc::<State>::default();
        let listener = UnixListener::bind(port).expect("a socket");
        let (up, down) = (Arc::clone(&state), Arc::clone(&state));
        let commands = device.try_clone().expect("a second end");
        thread::spawn(move || up.to_host(device));
        thread::spawn(move || down.to_device(&listener, commands));
        Self(state)
    }

    /// Make it bad, or good again.
    pub(crate) fn fail(&self, bad: bool) {
        self.0.bad.store(bad, Ordering::Relaxed);
    }

    /// What became of each pair that the device sent.
    pub(crate) fn fates(&self) -> BTreeMap<u64, Fate> {
        self.0.fates.lock().expect("whole").clone()
    }

    /// Number of the newest pair of which the device sent anything.
    pub(crate) fn newest(&self) -> u64 {
        self.0.newest.load(Ordering::Relaxed)
    }
}

fn strike(bytes: &mut Vec<u8>, random: &mut Random) {
    let fault = match random.below(4) {
        0 => Fault::Flips(1 + random.below(5)),
        1 => Fault::Drops(1 + random.below(300) as usize),
        2 => Fault::Doubles(1 + random.below(300) as usize),
        _ => Fault::Noise(1 + random.below(200) as usize),
    };
    fault.strike(bytes, random);
}

impl State {
    fn to_host(&self, mut device: UnixStream) {
        let (mut random, mut buffer, mut begun) = (Random(41), [0; 4096], Vec::new());
        while let Ok(count @ 1..) = device.read(&mut buffer) {
            begun.extend_from_slice(&buffer[..count]);
            while let Some(end) = frame_end(&begun) {
                let rest = begun.split_off(end);
                self.pass(std::mem::replace(&mut begun, rest), &mut random);
            }
        }
    }

    /// Passes a frame on to whoever listens.
    fn pass(&self, mut frame: Vec<u8>, random: &mut Random) {
        let message = frames(&frame).pop();
        let kind = message.as_ref().map(|(kind, ..)| *kind);
        let bad = self.bad.load(Ordering::Relaxed);
        let mut host = self.host.lock().expect("whole");
        if bad && random.below(HANG_UP) == 0 {
            host.hang_up();
        }
        let hit = bad && random.below(HIT) == 0;
        if hit {
            strike(&mut frame, random);
        }
        let heard = host.stream.as_mut().is_some_and(|stream| stream.write_all(&frame).is_ok());
        host.greeted |= heard && !hit && kind == Some(HELLO);
        let fate = match (hit, heard && host.greeted) {
            (true, _) => Fate::Hit,
            (false, true) => Fate::Whole,
            (false, false) => Fate::Unheard,
        };
        if let Some((kind @ (PAIR | PICTURE), _, payload)) = &message {
            let number = payload.first_chunk().map_or(0, |bytes| u32::from_le_bytes(*bytes).into());
            self.newest.fetch_max(number, Ordering::Relaxed);
            if *kind == PAIR {
                let before = self.fates.lock().expect("whole").insert(number, fate);
                assert_eq!(before, None, "pair {number} is sent twice");
            }
        }
    }

    fn to_device(&self, listener: &UnixListener, mut device: UnixStream) {
        let (mut random, mut buffer) = (Random(42), [0; 4096]);
        for stream in listener.incoming() {
            let mut stream = stream.expect("a host");
            let other = stream.try_clone().expect("a second end");
            *self.host.lock().expect("whole") = Host { stream: Some(other), greeted: false };
            while let Ok(count @ 1..) = stream.read(&mut buffer) {
                let mut bytes = buffer[..count].to_vec();
                if self.bad.load(Ordering::Relaxed) && random.below(HIT_COMMAND) == 0 {
                    strike(&mut bytes, &mut random);
                }
                if device.write_all(&bytes).is_err() {
                    return;
                }
            }
            self.host.lock().expect("whole").hang_up();
        }
    }
}

impl Host {
    fn hang_up(&mut self) {
        if let Some(stream) = self.stream.take() {
            // It may have ended itself.
            let _ = stream.shutdown(Shutdown::Both);
        }
        self.greeted = false;
    }
}

/// Where the first frame ends: bytes, and a zero behind them.
fn frame_end(bytes: &[u8]) -> Option<usize> {
    let first = bytes.iter().position(|byte| *byte != 0)?;
    let length = bytes[first..].iter().position(|byte| *byte == 0)?;
    Some(first + length + 1)
}
