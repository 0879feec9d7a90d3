//! A device behind a socket, as an emulator has one, and the host's other end of it.

use crate::camera::Time;
use crate::device::{Bench, Eyes, Page};
use crate::program::{host, within};
use crate::scene::Pair;
use host::source::serial::port::Port;
use image::GrayImage;
use std::cell::RefCell;
use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::UnixListener;
use std::path::Path;
use std::rc::Rc;
use std::thread;
use std::time::Duration;

/// What a link does to bytes on their way to the host; how many went before.
pub type Fault = fn(usize, Vec<u8>) -> Vec<u8>;

/// Nothing.
pub fn intact(_: usize, bytes: Vec<u8>) -> Vec<u8> {
    bytes
}

/// Carry bytes between a device and a port until the port or `limit` bytes end.
pub fn carry(bench: &mut Bench<Eyes>, port: &mut Port, fault: Fault, limit: usize) {
    let (mut sent, mut buffer) = (0, [0; 512]);
    while sent < limit {
        match port.reader.read(&mut buffer) {
            Ok(0) => return,
            Ok(count) => bench.cable.borrow_mut().to_device.extend(&buffer[..count]),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(_) => return,
        }
        for _ in 0..50 {
            let (_, bytes) = bench.carry();
            let count = bytes.len();
            if port.writer.write_all(&fault(sent, bytes)).is_err() {
                return;
            }
            sent += count;
        }
    }
}

/// A device that sees these pictures.
pub fn device(scenes: Pair) -> Bench<Eyes> {
    let time = Time::default();
    let (eyes, _) = Eyes::new(scenes.map(GrayImage::into_raw), time.clone());
    Bench::new(eyes, time, &Rc::new(RefCell::new(Page::default())))
}

/// A device in its own thread behind a socket in a folder, which hangs up once after so many bytes of its first
/// connection; the socket's path.
///
/// # Panics
/// When there can be no socket.
pub fn serve(folder: &Path, pictures: &Pair, fault: Fault, hang_up: usize) -> String {
    let path = folder.join("device.socket");
    let listener = UnixListener::bind(&path).unwrap();
    let pictures = pictures.clone();
    thread::spawn(move || {
        let (mut bench, mut limit) = (device(pictures), hang_up);
        for stream in listener.incoming() {
            let stream = stream.unwrap();
            stream.set_read_timeout(Some(Duration::from_millis(1))).unwrap();
            let reader = Box::new(stream.try_clone().unwrap());
            carry(&mut bench, &mut Port { reader, writer: Box::new(stream) }, fault, limit);
            limit = usize::MAX;
        }
    });
    path.display().to_string()
}

/// Give the device the calibration in a folder and an exposure at which it sees the pictures as they are.
///
/// # Panics
/// When it does not take them.
pub fn prepare(folder: &Path, port: &str) {
    host(&["device", "calibrate", &within(folder, "calib.yaml"), "--port", port]).unwrap();
    host(&["device", "expose", "300,1", "--port", port]).unwrap();
}
