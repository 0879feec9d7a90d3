//! The driver of the two camera modules against a model that is stricter than they are.

use embedded_hal::delay::DelayNs;
use embedded_hal::i2c::I2c;
use embedded_hal::spi::{MODE_1, MODE_3, Operation, SpiDevice};
use firmware::camera::arducam::{SPI_FIRST_HZ, SPI_MAX_HZ};
use firmware::camera::pair::{CAPTURE_LIMIT_US, Module, Pair};
use firmware::ports::{CameraError, CameraFault, CameraPair, Clock, Exposure, Side};
use host::shape::Shape;
use image::GrayImage;
use oracle::camera::{Bench, ControlBus, Dummy, PictureBus, SIZE, Scene, Time, Wiring};
use oracle::cases;
use oracle::scene::{drawn_pair, pair};
use std::panic::{AssertUnwindSafe, catch_unwind};

type Eyes = Pair<PictureBus, ControlBus, Time, Time>;

const SIDES: [Side; 2] = [Side::Left, Side::Right];

/// A pair of pictures that use all grey values and differ in every row.
fn ramps() -> [Scene; 2] {
    let ramp = |step: usize| (0..SIZE.0 * SIZE.1).map(|i| (i * step + i / 313) as u8).collect();
    [ramp(7), ramp(11)]
}

fn eyes(bench: &Bench) -> Eyes {
    let module = |eye| Module::new(bench.picture_bus(eye), bench.control_bus(eye));
    Pair::new(module(0), module(1), bench.time.clone(), bench.time.clone())
}

/// A bench with one thing wrong, and its eyes.
fn bench(wiring: Wiring, wrong: impl FnOnce(&Bench)) -> (Bench, Eyes) {
    let bench = Bench::new(wiring, ramps());
    wrong(&bench);
    let eyes = eyes(&bench);
    (bench, eyes)
}

fn read(eyes: &mut Eyes, side: Side) -> Result<Scene, CameraError> {
    let mut luma = Vec::new();
    eyes.read(side, &mut |row, line| {
        assert_eq!((row * SIZE.0, line.len()), (luma.len(), SIZE.0), "rows come whole and in order");
        luma.extend_from_slice(line);
    })?;
    Ok(luma)
}

/// Both pictures of one capture.
fn shoot(eyes: &mut Eyes) -> Result<[Scene; 2], CameraError> {
    eyes.capture()?;
    Ok([read(eyes, Side::Left)?, read(eyes, Side::Right)?])
}

#[track_caller]
fn assert_same(seen: &[Scene; 2], fed: &[Scene; 2]) {
    for (side, (seen, fed)) in SIDES.iter().zip(seen.iter().zip(fed)) {
        assert_eq!(seen.len(), fed.len(), "{side:?}");
        let differ = seen.iter().zip(fed).position(|(a, b)| a != b);
        assert_eq!(differ, None, "{side:?} eye differs from there on");
    }
}

/// Both eyes see what was fed, to the byte, however they are wired.
#[test]
fn what_is_fed_is_read() {
    for (hz, shared_control) in [(SPI_FIRST_HZ, false), (SPI_MAX_HZ, true)] {
        let (bench, mut eyes) = bench(Wiring { hz, shared_control, ..Wiring::default() }, |_| ());
        let identities = eyes.start(Exposure::default()).unwrap();
        println!("start: {} ms", bench.time.micros() / 1000);
        assert!(bench.time.micros() < 1_500_000, "a start takes a second");
        for identity in identities {
            assert_eq!((identity.sensor, identity.controller), (0x2642, 0x73));
            assert!(!identity.sends_dummy);
        }
        for _ in 0..3 {
            assert_same(&shoot(&mut eyes).unwrap(), &ramps());
        }
    }
}

/// Halves of a picture, whatever its size: its middle, with its border repeated.
fn fit(picture: &GrayImage) -> Scene {
    let (width, height) = (i64::from(picture.width()), i64::from(picture.height()));
    let at = |u: i64, v: i64| {
        let (u, v) = (u.clamp(0, width - 1), v.clamp(0, height - 1));
        u32::from(picture.get_pixel(u as u32, v as u32).0[0])
    };
    let (left, top) = ((width / 2 - SIZE.0 as i64) & !1, (height / 2 - SIZE.1 as i64) & !1);
    let pixels = (0..(SIZE.0 * SIZE.1) as i64).map(|i| {
        let (u, v) = (left + i % SIZE.0 as i64 * 2, top + i / SIZE.0 as i64 * 2);
        ((at(u, v) + at(u + 1, v) + at(u, v + 1) + at(u + 1, v + 1) + 2) / 4) as u8
    });
    pixels.collect()
}

#[track_caller]
fn assert_seen(scenes: &[Scene; 2]) {
    let bench = Bench::new(Wiring::default(), scenes.clone());
    let mut eyes = eyes(&bench);
    eyes.start(Exposure::default()).unwrap();
    assert_same(&shoot(&mut eyes).unwrap(), scenes);
}

#[test]
fn rendered_and_drawn_pairs_are_read() {
    assert_seen(&pair(Shape::Torus, 2).map(GrayImage::into_raw));
    let disc = drawn_pair(20.0, 0.0, |u, v| (u - 170.0).hypot(v - 119.5) < 60.0);
    assert_seen(&disc.map(GrayImage::into_raw));
}

#[test]
fn the_evaluation_cases_are_read() {
    let Some(folder) = cases::folder() else { return };
    for case in cases::cases(&folder) {
        println!("{}", cases::name(&case));
        assert_seen(&cases::open(&case).0.each_ref().map(fit));
    }
}

/// 153,600 bytes and 240 commands take what the bus needs for them, and hardly more.
#[test]
fn reading_takes_as_long_as_the_bus() {
    for (hz, least) in [(4_000_000, 307_200), (8_000_000, 153_600)] {
        let (bench, mut eyes) = bench(Wiring { hz, ..Wiring::default() }, |_| ());
        eyes.start(Exposure::default()).unwrap();
        eyes.capture().unwrap();
        let before = (bench.time.micros(), bench.chips[0].borrow().fetched);
        read(&mut eyes, Side::Left).unwrap();
        let (took, fetched) = (bench.time.micros() - before.0, bench.chips[0].borrow().fetched);
        println!("{hz} Hz: {took} us");
        assert!((least..least + 1000).contains(&took), "{hz} Hz: {took} us");
        assert_eq!((fetched.0 - before.1.0, fetched.1 - before.1.1), (240, 153_600));
    }
}

/// The model's sensors are 7.3 ms apart; looks are 0.1 ms apart, and a look takes some 60 us.
#[test]
fn skew_is_measured() {
    let (bench, mut eyes) = bench(Wiring::default(), |_| ());
    eyes.start(Exposure::default()).unwrap();
    for wait in [0, 3, 11, 27] {
        bench.time.clone().delay_ms(wait);
        let stamps = eyes.capture().unwrap();
        // Either the right frame follows the left one, or it was the first to come by.
        let skew = stamps.skew();
        let known = [7_300, 33_320 - 7_300];
        assert!(known.iter().any(|k| skew.abs_diff(*k) < 250), "{stamps:?}: {skew} us");
        assert!(skew <= 33_320, "more than a frame");
    }
}

/// Pictures are as bright as exposed lines times gain, and dark ones are not clipped.
#[test]
fn exposure_scales_both_eyes() {
    let (_, mut eyes) = bench(Wiring::default(), |_| ());
    eyes.start(Exposure::default()).unwrap();
    for (lines, gain) in [(300, 16), (600, 16), (75, 16), (3, 496), (670, 31), (300, 62), (1, 16), (257, 17)]
    {
        let exposure = Exposure::new(lines, gain);
        eyes.expose(exposure).unwrap();
        let seen = shoot(&mut eyes).unwrap();
        let bright = f64::from(exposure.lines()) * f64::from(exposure.gain()) / (300.0 * 16.0);
        let expected = ramps().map(|scene| {
            scene.iter().map(|&p| (f64::from(p) * bright + 0.5).floor().min(255.0) as u8).collect()
        });
        assert_same(&seen, &expected);
    }
}

#[test]
fn exposures_out_of_range_are_brought_into_it() {
    let (least, most) = (Exposure::new(0, 0), Exposure::new(u16::MAX, u16::MAX));
    assert_eq!((least.lines(), least.gain(), most.lines(), most.gain()), (1, 16, 670, 496));
}

/// An old chip sends a byte too many before a frame: found by the colour bars, and no pixel moves.
#[test]
fn a_dummy_byte_is_found() {
    let (_, mut eyes) = bench(Wiring::default(), |b| b.chips[1].borrow_mut().dummy = Dummy::Frame);
    let [left, right] = eyes.start(Exposure::default()).unwrap();
    assert!(!left.sends_dummy && right.sends_dummy);
    assert_same(&shoot(&mut eyes).unwrap(), &ramps());
}

/// What `start` says of one thing wrong with the right eye.
#[track_caller]
fn refused(wiring: Wiring, wrong: impl FnOnce(&Bench)) -> CameraFault {
    let (_, mut eyes) = bench(wiring, wrong);
    let error = eyes.start(Exposure::default()).unwrap_err();
    let later = eyes.capture().unwrap_err();
    assert_eq!(later.fault, CameraFault::NotStarted, "eyes that are refused take no pictures");
    for side in SIDES {
        let later = read(&mut eyes, side).unwrap_err();
        assert_eq!(later.fault, CameraFault::NoPicture, "eyes that are refused have none");
    }
    error.fault
}

#[test]
fn a_wrong_bus_is_told() {
    let echo = |wiring| match refused(wiring, |_| ()) {
        CameraFault::Echo { sent, read } => assert_ne!(sent, read),
        other => panic!("{other:?}"),
    };
    for mode in [MODE_1, MODE_3] {
        echo(Wiring { mode, ..Wiring::default() });
    }
    echo(Wiring { hz: 2 * SPI_MAX_HZ, ..Wiring::default() });
}

#[test]
fn a_line_that_is_stuck_or_noisy_is_told() {
    for high in [false, true] {
        let fault = refused(Wiring::default(), |b| b.chips[1].borrow_mut().stuck = Some(high));
        assert_eq!(fault, CameraFault::Echo { sent: 0x55, read: if high { 0xFF } else { 0 } });
    }
    let noisy = |noise| refused(Wiring::default(), |b| b.chips[1].borrow_mut().noise = noise);
    // Bits of a million: many show in 16 test bytes, few in 153,600 bytes of colour bars.
    assert!(matches!(noisy(50_000), CameraFault::Echo { .. }), "{:?}", noisy(50_000));
    assert!(matches!(noisy(500), CameraFault::TestPicture(_)), "{:?}", noisy(500));
}

/// Noise that comes later is told before the next picture.
#[test]
fn noise_that_comes_later_is_told() {
    let (bench, mut eyes) = bench(Wiring::default(), |_| ());
    eyes.start(Exposure::default()).unwrap();
    bench.chips[0].borrow_mut().noise = 50_000;
    let error = eyes.capture().unwrap_err();
    assert!(matches!(error, CameraError { side: Side::Left, fault: CameraFault::Echo { .. } }), "{error:?}");
    bench.chips[0].borrow_mut().noise = 500;
    let error = eyes.self_test().unwrap_err();
    assert!(matches!(error.fault, CameraFault::TestPicture(_)), "{error:?}");
}

#[test]
fn another_sensor_is_told_and_not_written_to() {
    let wiring = Wiring::default();
    let fault = refused(wiring, |b| b.sensors[1].borrow_mut().product = 0x5642);
    assert_eq!(fault, CameraFault::Identity(0x5642));
    // On a shared bus both answer at once.
    let fault =
        refused(Wiring { shared_control: true, ..wiring }, |b| b.sensors[1].borrow_mut().product = 0x1600);
    assert_eq!(fault, CameraFault::Identity(0x2642 & 0x1600));
}

#[test]
fn a_sensor_that_is_deaf_or_forgets_is_told() {
    let fault = refused(Wiring::default(), |b| b.sensors[1].borrow_mut().deaf = true);
    assert_eq!(fault, CameraFault::ControlBus);
    // A shared bus hears the other one; this one's frames tell.
    let shared = Wiring { shared_control: true, ..Wiring::default() };
    let fault = refused(shared, |b| b.sensors[1].borrow_mut().deaf = true);
    assert!(matches!(fault, CameraFault::Length(_) | CameraFault::TimeLimit(_)), "{fault:?}");
    let fault = refused(Wiring::default(), |b| b.sensors[1].borrow_mut().forgets = Some((0, 0x5A)));
    assert_eq!(fault, CameraFault::Register { address: 0x5A, read: 0x58 });
    let fault = refused(Wiring::default(), |b| b.sensors[1].borrow_mut().forgets = Some((1, 0x13)));
    assert_eq!(fault, CameraFault::Register { address: 0x13, read: 0xC7 });
}

/// Every register that is written, lost one at a time: told, or a reset gave it what it was to have.
#[test]
fn any_register_that_is_lost_is_told_or_does_not_matter() {
    let (mut told, exposure) = (0, Exposure::new(513, 24));
    let (whole, mut eyes) = bench(Wiring::default(), |_| ());
    eyes.start(exposure).unwrap();
    let seen = shoot(&mut eyes).unwrap();
    for &lost in &whole.sensors[0].borrow().written {
        let (_, mut eyes) = bench(Wiring::default(), |b| b.sensors[0].borrow_mut().forgets = Some(lost));
        match eyes.start(exposure) {
            Ok(_) => assert_same(&shoot(&mut eyes).unwrap(), &seen),
            Err(CameraError { side: Side::Left, fault: CameraFault::Register { address, read } }) => {
                assert!(address == lost.1, "{lost:x?}: {address:#x} reads {read:#x}");
                told += 1;
            }
            Err(error) => panic!("{lost:x?}: {error:?}"),
        }
    }
    println!("{told} registers are told");
    assert!(told >= 20, "{told}");
}

/// A frame of another length is discarded; the next one is as good as ever.
#[test]
fn a_frame_of_another_length_is_discarded() {
    let (bench, mut eyes) = bench(Wiring::default(), |_| ());
    eyes.start(Exposure::default()).unwrap();
    for excess in [-1, -640, -153_600, 65, 153_600] {
        bench.chips[1].borrow_mut().excess = excess;
        let error = eyes.capture().unwrap_err();
        let length = (153_600 + excess) as u32;
        assert_eq!(error, CameraError { side: Side::Right, fault: CameraFault::Length(length) });
        for side in SIDES {
            let error = read(&mut eyes, side).unwrap_err();
            assert_eq!(error.fault, CameraFault::NoPicture, "of neither eye");
        }
        bench.chips[1].borrow_mut().excess = 8;
        assert_same(&shoot(&mut eyes).unwrap(), &ramps());
    }
}

/// A capture that hangs ends after its time, and a start helps.
#[test]
fn a_hang_ends_and_a_start_helps() {
    let (bench, mut eyes) = bench(Wiring::default(), |_| ());
    eyes.start(Exposure::default()).unwrap();
    bench.chips[1].borrow_mut().hangs = 1;
    let before = bench.time.micros();
    let error = eyes.capture().unwrap_err();
    let took = bench.time.micros() - before;
    let fault = CameraFault::TimeLimit(CAPTURE_LIMIT_US);
    assert_eq!(error, CameraError { side: Side::Right, fault });
    assert!(took < 2 * u64::from(CAPTURE_LIMIT_US), "{took} us");
    assert_eq!(eyes.capture().unwrap_err().fault, CameraFault::NotStarted);
    assert_eq!(eyes.expose(Exposure::default()).unwrap_err().fault, CameraFault::NotStarted);
    eyes.start(Exposure::default()).unwrap();
    assert_same(&shoot(&mut eyes).unwrap(), &ramps());
}

/// A supply that sags resets a sensor: its frame has another size, and a start helps.
#[test]
fn a_sagging_supply_is_told() {
    let (bench, mut eyes) = bench(Wiring::default(), |_| ());
    eyes.start(Exposure::default()).unwrap();
    bench.chips[0].borrow_mut().sags = true;
    for _ in 0..2 {
        let error = eyes.capture().unwrap_err();
        assert_eq!(error.side, Side::Left);
        assert!(matches!(error.fault, CameraFault::Length(_) | CameraFault::TimeLimit(_)), "{error:?}");
    }
    eyes.start(Exposure::default()).unwrap();
    assert_same(&shoot(&mut eyes).unwrap(), &ramps());
}

/// A bus that breaks between rows: the rows before it were given, the picture is lost, the other is not.
#[test]
fn a_bus_that_breaks_is_told() {
    let (bench, mut eyes) = bench(Wiring::default(), |_| ());
    eyes.start(Exposure::default()).unwrap();
    eyes.capture().unwrap();
    bench.chips[0].borrow_mut().breaks_in = Some(100);
    let mut rows = 0;
    let error = eyes.read(Side::Left, &mut |_, _| rows += 1).unwrap_err();
    assert_eq!((error, rows), (CameraError { side: Side::Left, fault: CameraFault::PictureBus }, 100));
    assert_eq!(read(&mut eyes, Side::Left).unwrap_err().fault, CameraFault::NoPicture);
    assert_eq!(read(&mut eyes, Side::Right).unwrap(), ramps()[1]);
    bench.chips[0].borrow_mut().breaks_in = None;
    assert_same(&shoot(&mut eyes).unwrap(), &ramps());
}

/// A sensor that holds its bus, as one does whose board was reset in the middle of a reading, lets go of it at a start,
/// or at the next one.
#[test]
fn a_control_bus_that_is_held_is_told_and_freed() {
    let (bench, mut eyes) = bench(Wiring::default(), |b| b.sensors[1].borrow_mut().holds = 1);
    eyes.start(Exposure::default()).unwrap();
    assert_same(&shoot(&mut eyes).unwrap(), &ramps());
    bench.sensors[1].borrow_mut().holds = 3;
    let held = CameraError { side: Side::Right, fault: CameraFault::ControlBus };
    assert_eq!(eyes.expose(Exposure::new(200, 16)), Err(held));
    assert_eq!(eyes.capture().unwrap_err().fault, CameraFault::NotStarted);
    for _ in 0..2 {
        assert_eq!(eyes.start(Exposure::default()), Err(held));
    }
    eyes.start(Exposure::default()).unwrap();
    assert_same(&shoot(&mut eyes).unwrap(), &ramps());
}

/// The order of calls: nothing before a start, a picture is read once, or not at all.
#[test]
fn pictures_are_read_once() {
    let (_, mut eyes) = bench(Wiring::default(), |_| ());
    assert_eq!(eyes.capture().unwrap_err().fault, CameraFault::NotStarted);
    assert_eq!(eyes.self_test().unwrap_err().fault, CameraFault::NotStarted);
    eyes.start(Exposure::default()).unwrap();
    assert_eq!(read(&mut eyes, Side::Left).unwrap_err().fault, CameraFault::NoPicture);
    eyes.capture().unwrap();
    eyes.capture().unwrap();
    assert_eq!(read(&mut eyes, Side::Right).unwrap(), ramps()[1]);
    assert_eq!(read(&mut eyes, Side::Right).unwrap_err().fault, CameraFault::NoPicture);
    eyes.self_test().unwrap();
    assert_eq!(read(&mut eyes, Side::Left).unwrap_err().fault, CameraFault::NoPicture);
    assert_same(&shoot(&mut eyes).unwrap(), &ramps());
}

/// An old chip that sends a byte too many in every burst loses one a row; no way of reading it is known.
#[test]
fn a_dummy_in_every_burst_is_told() {
    let fault = refused(Wiring::default(), |b| b.chips[1].borrow_mut().dummy = Dummy::Burst);
    assert_eq!(fault, CameraFault::TestPicture(1));
}

/// The model itself: what the driver must not do, done by hand.
#[test]
fn the_model_refuses_what_the_chips_would_get_wrong() {
    let ready = || {
        let (bench, mut eyes) = bench(Wiring::default(), |_| ());
        eyes.start(Exposure::default()).unwrap();
        bench
    };
    let panics = |what: &str, reason: &str, act: &dyn Fn(&Bench)| {
        let bench = ready();
        let caught = catch_unwind(AssertUnwindSafe(|| act(&bench))).expect_err(what);
        let text = caught.downcast_ref::<String>().cloned();
        let text =
            text.or_else(|| caught.downcast_ref::<&str>().map(|s| (*s).to_owned())).unwrap_or_default();
        assert!(text.contains(reason), "{what}: {text}");
    };
    let spi = |b: &Bench, bytes: &[u8]| b.picture_bus(0).write(bytes).unwrap();
    let i2c = |b: &Bench, bytes: &[u8]| b.control_bus(0).write(0x30, bytes).unwrap();
    panics("chip select before data", "released early", &|b| spi(b, &[0x00]));
    panics("a read over two transactions", "released early", &|b| {
        spi(b, &[0x41]);
        b.picture_bus(0).read(&mut [0; 1]).unwrap();
    });
    panics("a burst without its command", "begins with its command", &|b| {
        b.picture_bus(0).read(&mut [0; 640]).unwrap();
    });
    panics("a burst before a frame", "before a frame", &|b| {
        spi(b, &[0x84, 0x01]);
        b.picture_bus(0).transaction(&mut [Operation::Write(&[0x3C]), Operation::Read(&mut [0; 4])]).unwrap();
    });
    panics("a length before a frame", "not kept yet", &|b| {
        spi(b, &[0x84, 0x01]);
        b.picture_bus(0).transfer_in_place(&mut [0x42, 0]).unwrap();
    });
    panics("a capture twice", "a capture begins", &|b| {
        spi(b, &[0x84, 0x01]);
        spi(b, &[0x84, 0x02]);
        spi(b, &[0x84, 0x02]);
    });
    panics("an unknown command", "not to be written", &|b| spi(b, &[0x85, 0]));
    panics("no wait after a reset", "being reset", &|b| {
        spi(b, &[0x87, 0x80]);
        spi(b, &[0x80, 0x55]);
    });
    panics("the wrong bank", "does not exist", &|b| {
        i2c(b, &[0xFF, 0]);
        i2c(b, &[0x12, 0x40]);
    });
    panics("a change in use", "in use", &|b| {
        i2c(b, &[0xFF, 0]);
        i2c(b, &[0x5A, 0x50]);
    });
    panics("a read-only register", "read only", &|b| {
        i2c(b, &[0xFF, 1]);
        i2c(b, &[0x0A, 0x26]);
    });
    panics("no wait after the sensor's reset", "still being reset", &|b| {
        i2c(b, &[0xFF, 1]);
        i2c(b, &[0x12, 0x80]);
        i2c(b, &[0x12, 0x40]);
    });
    panics("a repeated start", "repeated start", &|b| {
        b.control_bus(0).write_read(0x30, &[0x0A], &mut [0; 1]).unwrap();
    });
    panics("a table without a reset", "without a reset", &|_| {
        let bench = Bench::new(Wiring::default(), ramps());
        i2c(&bench, &[0xFF, 1]);
        i2c(&bench, &[0x12, 0x40]);
    });
    panics("bytes past the end", "to its end", &|b| {
        spi(b, &[0x84, 0x01]);
        spi(b, &[0x84, 0x02]);
        b.time.clone().delay_ms(100);
        b.picture_bus(0)
            .transaction(&mut [Operation::Write(&[0x3C]), Operation::Read(&mut [0; 153_601])])
            .unwrap();
    });
}

/// The pitfall of the pointer resets: the driver never orders them, as the frame that follows is short.
#[test]
fn the_model_cuts_a_frame_after_a_pointer_reset() {
    let (bench, mut eyes) = bench(Wiring::default(), |_| ());
    eyes.start(Exposure::default()).unwrap();
    bench.picture_bus(0).write(&[0x84, 0x30]).unwrap();
    let error = eyes.capture().unwrap_err();
    assert_eq!(error, CameraError { side: Side::Left, fault: CameraFault::Length(51_200) });
    assert_same(&shoot(&mut eyes).unwrap(), &ramps());
}
