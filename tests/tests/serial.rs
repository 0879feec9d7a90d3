//! The host's end of a link, with the boards' own loop at the other: over sockets and a pseudo-terminal, through
//! damage and loss, what comes out is what the pictures give, or nothing.
#![cfg(unix)]

use host::shape::Shape;
use host::source::serial::link::frames;
use host::source::serial::port::{Address, Port, PortError};
use host::source::serial::recording::Recording;
use host::source::serial::session::{CAMERAS, Session};
use image::GrayImage;
use oracle::camera::Time;
use oracle::device::{Bench, Eyes, Page};
use oracle::link;
use oracle::program::{host, model, within};
use oracle::scene::{Pair, bent_camera, camera, pair};
use oracle::socket::{Fault, carry, device, intact, prepare, serve};
use serialport::SerialPort;
use shared::wire::{Counters, Decoder, MAX_FRAME};
use std::cell::RefCell;
use std::fs;
use std::io::{ErrorKind, Read, Write};
use std::os::unix::fs::symlink;
use std::os::unix::net::UnixListener;
use std::path::Path;
use std::rc::Rc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::{Duration, Instant};
use tempfile::TempDir;

const SHAPE: Shape = Shape::Screwdriver;

/// A folder with a calibration whose cameras bend and turn a little, and the raw pictures of a device.
fn scene() -> (TempDir, Pair) {
    let folder = TempDir::new().unwrap();
    bent_camera(2).write_opencv_yaml(folder.path().join("calib.yaml")).unwrap();
    let pictures = pair(SHAPE, 2);
    for (name, picture) in ["left.png", "right.png"].iter().zip(&pictures) {
        picture.save(folder.path().join(name)).unwrap();
    }
    (folder, pictures)
}

/// A line on which a frame takes some time, as half of one does on a board's.
fn slow(_: usize, bytes: Vec<u8>) -> Vec<u8> {
    if !bytes.is_empty() {
        thread::sleep(Duration::from_millis(40));
    }
    bytes
}

/// The report, but for its times.
fn report(folder: &Path) -> serde_json::Value {
    let mut report: serde_json::Value =
        serde_json::from_slice(&fs::read(folder.join("report.json")).unwrap()).unwrap();
    report["times_ms"].take();
    report
}

/// Make the model of the pictures, without a device.
fn direct(folder: &Path) -> [Vec<u8>; 3] {
    let file = |name: &str| within(folder, name);
    let (left, right, calib, out) = (file("left.png"), file("right.png"), file("calib.yaml"), file("direct"));
    host(&["replay", &left, &right, "--calib", &calib, "--as-device", "--out", &out]).unwrap();
    model(&folder.join("direct"))
}

/// What was recorded, read again.
fn counters(recording: &Path) -> Vec<Counters> {
    let recording = Recording::read(recording).unwrap();
    let count = |bytes: &Vec<u8>| {
        let mut buffer = vec![0; MAX_FRAME];
        let mut decoder = Decoder::new(&mut buffer);
        frames(&mut decoder, bytes, |_| ());
        *decoder.counters()
    };
    recording.connections.iter().map(count).collect()
}

#[test]
fn live_recorded_and_from_pictures_are_the_same_model() {
    let (folder, pictures) = scene();
    let folder = folder.path();
    let file = |name: &str| within(folder, name);
    let port = &serve(folder, &pictures, intact, usize::MAX);
    let (calib, live, tape) = (file("calib.yaml"), file("live"), file("tape"));
    let listen = ["listen", "--port", port, "--calib", &calib, "--frames", "2", "--out", &live];

    let uncalibrated = host(&listen).unwrap_err();
    assert!(uncalibrated.contains("keeps no calibration"), "{uncalibrated}");
    prepare(folder, port);
    host(&["device", "info", "--port", port, "--json"]).unwrap();
    host(&["device", "threshold", "otsu", "--port", port]).unwrap();
    host(&["device", "grab", "grey", "--out", &file("grey"), "--port", port]).unwrap();
    host(&["device", "grab", "mask", "--out", &file("mask"), "--port", port]).unwrap();
    for (name, picture) in ["left.png", "right.png"].iter().zip(&pictures) {
        let grabbed = image::open(folder.join("grey").join(name)).unwrap().to_luma8();
        assert!(grabbed == *picture, "{name} is what the eye sees");
        let mask = image::open(folder.join("mask").join(name)).unwrap().to_luma8();
        let lit = mask.pixels().filter(|p| p[0] == 255).count();
        let bright = picture.pixels().filter(|p| p[0] > 100).count();
        assert!(lit.abs_diff(bright) * 10 < bright, "{lit} of about {bright} px");
    }

    host(&[&listen[..], &["--record", &tape]].concat()).unwrap();
    host(&["replay", &tape, "--out", &file("again")]).unwrap();
    let truth = direct(folder);
    for pair in ["000001", "000002"] {
        let (live, again) = (folder.join("live").join(pair), folder.join("again").join(pair));
        assert!(model(&live) == truth, "live {pair}");
        assert!(model(&again) == truth, "recorded {pair}");
        assert_eq!(report(&live), report(&again));
        assert_eq!(report(&live), report(&folder.join("direct")));
    }
    assert!(host(&[&listen[..], &["--record", &tape]].concat()).unwrap_err().contains("exists already"));

    let other = file("other.yaml");
    camera(2).write_opencv_yaml(&other).unwrap();
    let refused = host(&["listen", "--port", port, "--calib", &other, "--out", &live]).unwrap_err();
    assert!(refused.contains("another calibration"), "{refused}");
}

/// Which of six pairs that a device sends over such a line have their visible side measured, live and of the recording;
/// the others must be as balls have them, and say so.
fn measured(fault: Fault) -> Vec<bool> {
    let (folder, pictures) = scene();
    let folder = folder.path();
    let file = |name: &str| within(folder, name);
    let port = &serve(folder, &pictures, fault, usize::MAX);
    prepare(folder, port);
    let (calib, live, tape) = (file("calib.yaml"), file("live"), file("tape"));
    let front = ["--front", "auto"];
    let listen =
        ["listen", "--port", port, "--calib", &calib, "--frames", "6", "--out", &live, "--record", &tape];
    host(&[&listen[..], &front].concat()).unwrap();
    host(&[&["replay", &tape, "--out", &file("again")], &front[..]].concat()).unwrap();
    let balls = direct(folder);
    let (left, right, out) = (file("left.png"), file("right.png"), file("seen"));
    host(&[&["replay", &left, &right, "--calib", &calib, "--as-device", "--out", &out], &front[..]].concat())
        .unwrap();
    let truth = model(&folder.join("seen"));
    assert!(truth != balls, "the visible side moves");
    let is_measured = |pair: usize| {
        let [live, again] = ["live", "again"].map(|place| folder.join(place).join(format!("{pair:06}")));
        let measured = model(&live) == truth;
        assert!(measured || model(&live) == balls, "pair {pair}");
        assert!(model(&live) == model(&again), "pair {pair}");
        let gates = report(&live)["gates"].as_array().unwrap().clone();
        assert_eq!(
            gates.iter().any(|gate| gate["name"] == "unmeasured"),
            !measured,
            "pair {pair}: {gates:?}"
        );
        measured
    };
    (1..=6).map(is_measured).collect()
}

#[test]
fn the_visible_side_of_a_devices_pairs_is_measured_in_the_pictures_beside_them() {
    let pairs = measured(slow);
    // Pairs without pictures are short, so some of them may be there before the first order is.
    let begun = pairs.iter().position(|measured| *measured).expect("pairs with pictures");
    assert!(pairs[begun..].iter().all(|measured| *measured), "{pairs:?}");
}

#[test]
fn a_device_that_is_faster_than_its_host_has_pictures_beside_some_pairs() {
    let pairs = measured(intact);
    println!("{pairs:?}");
    assert!(pairs.contains(&true), "{pairs:?}");
}

/// Bits flip, 300 bytes vanish, a connection begins within a frame and then says nothing of use for long.
fn bad_cable(sent: usize, bytes: Vec<u8>) -> Vec<u8> {
    const EVERY: usize = 9001;
    let mut out = Vec::new();
    if sent == 0 && !bytes.is_empty() {
        out.extend([0x55; 3 * MAX_FRAME]);
        out.push(0);
    }
    for (k, byte) in (sent..).zip(bytes) {
        match k % EVERY {
            2000..2300 => {}
            6000 => out.push(byte ^ 0x10),
            _ => out.push(byte),
        }
    }
    out
}

#[test]
fn damage_is_counted_and_never_a_wrong_model() {
    let (folder, pictures) = scene();
    let folder = folder.path();
    let port = &serve(folder, &pictures, bad_cable, 60_000);
    prepare(folder, port);
    let (calib, out, tape) = (within(folder, "calib.yaml"), within(folder, "out"), within(folder, "tape"));
    let args =
        ["listen", "--port", port, "--calib", &calib, "--frames", "12", "--out", &out, "--record", &tape];
    host(&args).unwrap();
    let truth = direct(folder);
    for pair in 1..=12 {
        assert!(model(&folder.join(format!("out/{pair:06}"))) == truth, "pair {pair}");
    }
    let counted = counters(Path::new(&tape));
    for counters in &counted {
        assert_eq!(counters.partial, 1, "{counters:?}");
    }
    let sum = |of: fn(&Counters) -> u32| counted.iter().map(of).sum::<u32>();
    assert!(sum(|c| c.bad_crc) > 0 && sum(|c| c.missing) > 0, "{counted:?}");
}

#[test]
fn a_device_that_hangs_up_is_waited_for() {
    let (folder, pictures) = scene();
    let folder = folder.path();
    let calib = within(folder, "calib.yaml");
    let plain = serve(folder, &pictures, intact, usize::MAX);
    prepare(folder, &plain);
    // The same device behind a relay that hangs up in the middle of the second pair.
    let relay = within(folder, "relay.socket");
    let listener = UnixListener::bind(&relay).unwrap();
    thread::spawn(move || {
        let mut limit = 3000;
        for stream in listener.incoming() {
            let mut host = stream.unwrap();
            let mut device = Address::Socket(plain.clone()).open(0).unwrap();
            let mut commands = host.try_clone().unwrap();
            let up = thread::spawn(move || drop(std::io::copy(&mut commands, &mut device.writer)));
            let (mut passed, mut buffer) = (0, [0; 256]);
            while passed < limit {
                match device.reader.read(&mut buffer) {
                    Ok(count @ 1..) => {
                        passed += count;
                        if host.write_all(&buffer[..count]).is_err() {
                            break;
                        }
                    }
                    Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                    _ => break,
                }
            }
            let _ = host.shutdown(std::net::Shutdown::Both);
            up.join().unwrap();
            limit = usize::MAX;
        }
    });
    let (out, tape) = (within(folder, "out"), within(folder, "tape"));
    host(&["listen", "--port", &relay, "--calib", &calib, "--frames", "4", "--out", &out, "--record", &tape])
        .unwrap();
    let truth = direct(folder);
    for pair in 1..=4 {
        assert!(model(&folder.join(format!("out/{pair:06}"))) == truth, "pair {pair}");
    }
    assert_eq!(Recording::read(Path::new(&tape)).unwrap().connections.len(), 2);
}

/// Longer than cameras may take to start before that is an error of a device that is new.
#[test]
fn a_device_that_comes_back_with_a_dead_eye_is_waited_for() {
    let (folder, pictures) = scene();
    let folder = folder.path();
    let socket = within(folder, "device.socket");
    let listener = UnixListener::bind(&socket).unwrap();
    thread::spawn(move || {
        let page = Rc::new(RefCell::new(Page::default()));
        let boot = |dead| {
            let time = Time::default();
            let (eyes, world) = Eyes::new(pictures.clone().map(GrayImage::into_raw), time.clone());
            world.borrow_mut().dead = dead;
            (Bench::new(eyes, time, &page), world)
        };
        let (mut bench, _) = boot(false);
        for (connection, stream) in listener.incoming().enumerate() {
            let stream = stream.unwrap();
            stream.set_read_timeout(Some(Duration::from_millis(1))).unwrap();
            let reader = Box::new(stream.try_clone().unwrap());
            let port = &mut Port { reader, writer: Box::new(stream) };
            // Whoever calibrates and exposes it comes before.
            let limit = if connection < 2 { usize::MAX } else { 3000 };
            carry(&mut bench, port, intact, limit);
            if limit < usize::MAX {
                let (mut reset, world) = boot(true);
                let end = Instant::now() + CAMERAS + Duration::from_secs(2);
                while Instant::now() < end {
                    // As far as the next answer.
                    carry(&mut reset, port, intact, 1);
                }
                world.borrow_mut().dead = false;
                carry(&mut reset, port, intact, usize::MAX);
            }
        }
    });
    prepare(folder, &socket);
    let (calib, out) = (within(folder, "calib.yaml"), within(folder, "out"));
    let start = Instant::now();
    host(&["listen", "--port", &socket, "--calib", &calib, "--frames", "6", "--out", &out]).unwrap();
    assert!(start.elapsed() > CAMERAS);
    assert!(folder.join("out/000001/model.ply").exists());
}

/// A device behind a pseudo-terminal, which stays when nobody has it open.
fn terminal(pictures: Pair) -> String {
    let (mut master, slave) = serialport::TTYPort::pair().unwrap();
    let name = slave.name().unwrap();
    master.set_timeout(Duration::from_millis(1)).unwrap();
    thread::spawn(move || {
        let writer = master.try_clone_native().unwrap();
        let mut port = Port { reader: Box::new(master), writer: Box::new(writer) };
        let mut bench = device(pictures);
        loop {
            // Between two openings of the other end nobody is there.
            carry(&mut bench, &mut port, intact, usize::MAX);
            thread::sleep(Duration::from_millis(5));
        }
    });
    drop(slave);
    name
}

#[test]
fn a_pseudo_terminal_is_a_port() {
    let (folder, pictures) = scene();
    let name = terminal(pictures);
    let folder = folder.path();
    prepare(folder, &name);
    let (calib, out) = (within(folder, "calib.yaml"), within(folder, "out"));
    host(&["listen", "--port", &name, "--calib", &calib, "--frames", "1", "--out", &out]).unwrap();
    assert!(model(&folder.join("out/000001")) == direct(folder));
}

#[test]
fn a_terminal_that_hangs_up_is_waited_for() {
    let (folder, pictures) = scene();
    let folder = folder.path();
    let plain = serve(folder, &pictures, intact, usize::MAX);
    prepare(folder, &plain);
    let port = within(folder, "port");
    let ((there, wait), name) = (mpsc::channel(), port.clone());
    thread::spawn(move || {
        // The first end goes in the middle of the second pair, as that of an adapter which is pulled out.
        for limit in [3000, usize::MAX] {
            let (mut master, slave) = serialport::TTYPort::pair().unwrap();
            let mut to_host = master.try_clone_native().unwrap();
            master.set_timeout(Duration::from_millis(1)).unwrap();
            to_host.set_timeout(Duration::from_secs(60)).unwrap();
            let mut device = Address::Socket(plain.clone()).open(0).unwrap();
            symlink(slave.name().unwrap(), &name).unwrap();
            let _ = there.send(());
            let (mut passed, mut buffer) = (0, [0; 256]);
            while passed < limit {
                if let Ok(count) = master.read(&mut buffer) {
                    device.writer.write_all(&buffer[..count]).unwrap();
                }
                match device.reader.read(&mut buffer) {
                    Ok(count) => {
                        passed += count;
                        to_host.write_all(&buffer[..count]).unwrap();
                    }
                    Err(error) => {
                        assert!(matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut));
                    }
                }
            }
            fs::remove_file(&name).unwrap();
        }
    });
    wait.recv().unwrap();
    let (calib, out, tape) = (within(folder, "calib.yaml"), within(folder, "out"), within(folder, "tape"));
    host(&["listen", "--port", &port, "--calib", &calib, "--frames", "4", "--out", &out, "--record", &tape])
        .unwrap();
    let truth = direct(folder);
    for pair in 1..=4 {
        assert!(model(&folder.join(format!("out/{pair:06}"))) == truth, "pair {pair}");
    }
    assert_eq!(Recording::read(Path::new(&tape)).unwrap().connections.len(), 2);
}

/// A reader that is counted while it is open.
struct Counted {
    port: Box<dyn Read + Send>,
    _open: Arc<()>,
}

impl Read for Counted {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        self.port.read(bytes)
    }
}

#[test]
fn a_port_is_let_go_before_it_is_opened_again() {
    let address = Address::Path(terminal(pair(SHAPE, 2)));
    let (open, mut tries) = (Arc::new(()), 0);
    let opener = move || {
        assert_eq!(Arc::strong_count(&open), 1, "one at a time");
        tries += 1;
        if matches!(tries, 2 | 3) {
            return Err(PortError::None);
        }
        let Port { reader, writer } = address.open(921_600)?;
        Ok(Port { reader: Box::new(Counted { port: reader, _open: open.clone() }), writer })
    };
    let (mut session, hello) = Session::begin(Box::new(opener), None).unwrap();
    let (end, mut told) = (Instant::now() + Duration::from_secs(20), 0);
    let again = session.resume(|| Instant::now() >= end, |_| told += 1).unwrap();
    assert_eq!(again.map(|hello| hello.board), Some(hello.board));
    assert_eq!((session.tally().reconnections, told), (1, 1));
}

/// Who waits does not look all the time, and says once what it waits for.
#[test]
fn a_device_that_is_gone_is_looked_for_twice_a_second() {
    let (folder, pictures) = scene();
    let address = Address::Socket(serve(folder.path(), &pictures, intact, usize::MAX));
    let tries = Arc::new(AtomicU32::new(0));
    let counted = tries.clone();
    let opener = move || match counted.fetch_add(1, Ordering::Relaxed) {
        0 => address.open(0),
        _ => Err(PortError::None),
    };
    let (mut session, _) = Session::begin(Box::new(opener), None).unwrap();
    let (end, mut told) = (Instant::now() + Duration::from_millis(2300), 0);
    assert_eq!(session.resume(|| Instant::now() >= end, |_| told += 1).unwrap(), None);
    // The first one was to begin with; a machine that is busy looks less often.
    assert!((2..=6).contains(&tries.load(Ordering::Relaxed)), "{tries:?}");
    assert_eq!(told, 1);
}

#[test]
fn a_mask_that_cannot_be_is_told_why() {
    let folder = TempDir::new().unwrap();
    let blank = pair(SHAPE, 2).map(|picture| GrayImage::new(picture.width(), picture.height()));
    let port = serve(folder.path(), &blank, intact, usize::MAX);
    let out = within(folder.path(), "mask");
    let start = Instant::now();
    let refused = host(&["device", "grab", "mask", "--out", &out, "--port", &port]).unwrap_err();
    assert!(!refused.contains("cables") && start.elapsed() < Duration::from_secs(30), "{refused}");
}

/// A peer that sends the same bytes to whoever connects.
fn peer(folder: &Path, bytes: Vec<u8>) -> String {
    let path = folder.join("peer.socket");
    let listener = UnixListener::bind(&path).unwrap();
    thread::spawn(move || {
        let mut kept = Vec::new();
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            stream.write_all(&bytes).unwrap();
            kept.push(stream);
        }
    });
    path.display().to_string()
}

#[test]
fn strangers_are_told_from_devices() {
    let folder = TempDir::new().unwrap();
    let newer = peer(folder.path(), link::frame(1, 0, &[2, 0, 1, 2, 3]));
    let refused = host(&["device", "info", "--port", &newer]).unwrap_err();
    assert!(refused.contains("version 2") && refused.contains("version 1"), "{refused}");

    let folder = TempDir::new().unwrap();
    let chatter = peer(folder.path(), vec![0x41; 100_000]);
    let refused = host(&["device", "info", "--port", &chatter]).unwrap_err();
    assert!(refused.contains("no hello"), "{refused}");

    let gone = within(folder.path(), "nobody");
    assert!(host(&["device", "info", "--port", &gone]).unwrap_err().contains("there is no port"));

    let (calib, tape) = (within(folder.path(), "calib.yaml"), within(folder.path(), "tape"));
    camera(2).write_opencv_yaml(&calib).unwrap();
    let refused = host(&["listen", "--port", &gone, "--calib", &calib, "--record", &tape]).unwrap_err();
    assert!(refused.contains("there is no port") && !Path::new(&tape).exists(), "{refused}");
}
