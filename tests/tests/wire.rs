//! The wire format: what a device writes is what a host reads, whatever the link does to it, and any bytes
//! give a message that is safe to use or an error.
//!
//! `REGENERATE=1 cargo test -p system-tests --test wire` writes the frozen bytes anew. That is right only
//! together with a new version of the format: devices in the field do not change with the host.

use heapless::Vec as List;
use host::calibration::StereoCamera;
use host::shape::Shape as Solid;
use host::stage::rectify::Rectification;
use image::{GrayImage, Luma};
use oracle::core::{Core, Picture};
use oracle::link::{self, Fault};
use oracle::raster::Random;
use oracle::scene::{Pair, drawn_pair, pair};
use proptest::prelude::*;
use shared::bitmap::{Bitmap, Size};
use shared::camera::{EyeModel, Lens, PairModel};
use shared::fixed::{ONE, PX};
use shared::limits::CapacityError;
use shared::pipeline::{Branch, Finding, Outcome, Settings, Side};
use shared::point::{Direction, PixelPoint};
use shared::stage::binarise::{Polarity, Threshold};
use shared::stage::branch::Ball;
use shared::stage::contour::{ContourLoop, ContourPoint};
use shared::stage::correspond::CutMatch;
use shared::stage::depth::Optics;
use shared::stage::nurbs::Control;
use shared::stage::plane::ImagePlane;
use shared::stage::rows::{ContourMatch, RowStatistics};
use shared::wire::{
    Answer, Capacities, Counters, DISPARITY_STEP, Decoder, ErrorCode, Exposure, ExposureSetting, Frame,
    Health, Hello, MAX_FRAME, POSITION_STEP, PairReport, PictureKind, PicturePart, ResetReason, Sequence,
    Shape, ShapeLists, TURN_STEP, ToDevice, ToHost, VERSION, WireError,
};
use std::path::{Path, PathBuf};

/// Lists that a shape is read into.
#[derive(Default)]
struct Lists {
    contour: Box<List<ContourPoint, 8192>>,
    loops: List<ContourLoop, 64>,
    matches: Box<List<ContourMatch, 8192>>,
    hulls: [Box<List<PixelPoint, 1024>>; 2],
    branches: List<Branch, 256>,
    controls: Box<List<Control, 4096>>,
    outcome: Outcome,
}

impl Lists {
    fn lend(&mut self) -> ShapeLists<'_> {
        let [left, right] = &mut self.hulls;
        ShapeLists {
            contour: &mut *self.contour,
            loops: &mut self.loops,
            matches: &mut *self.matches,
            hulls: [&mut **left, &mut **right],
            branches: &mut self.branches,
            controls: &mut *self.controls,
            outcome: &mut self.outcome,
        }
    }
}

/// What the device's core makes of a pair, handed to `look`, or its refusal.
fn describe<R>(pair: &Pair, optics: Optics, look: impl FnOnce(Shape<'_>) -> R) -> Result<R, Finding> {
    let pictures: [Picture; 2] = pair
        .each_ref()
        .map(|image| image.as_raw().chunks(image.width() as usize).map(<[u8]>::to_vec).collect());
    let settings = Settings { sub_pixel: false, ..Settings::new(optics) };
    let mut seen = None;
    Core::default().run([&pictures[0], &pictures[1]], &settings, "", &mut (), |memory, outcome| {
        seen = Some(look(Shape::of(memory, outcome)));
    })?;
    Ok(seen.unwrap())
}

fn report(result: Result<Shape<'_>, Finding>) -> ToHost<'_> {
    ToHost::Pair(PairReport {
        number: 7,
        stamps: [1_000_000, 1_000_012],
        levels: [96, 101],
        exposures: [Exposure { lines: 400, gain: 256 }, Exposure { lines: 380, gain: 300 }],
        result,
    })
}

/// The frame of a message.
fn bytes(message: &ToHost<'_>) -> Vec<u8> {
    let mut out = vec![0; 1 << 16];
    let len = message.encode(1, &mut out).unwrap();
    out.truncate(len);
    out
}

/// Hand every frame of a stream to `take`.
fn receive(stream: &[u8], mut take: impl FnMut(Frame<'_>)) -> Counters {
    let mut buffer = vec![0; MAX_FRAME];
    let mut decoder = Decoder::new(&mut buffer);
    for byte in stream {
        if let Some(frame) = decoder.push(*byte) {
            take(frame);
        }
    }
    *decoder.counters()
}

/// Reads the only frame of a stream as a message to the host.
fn read<R>(stream: &[u8], look: impl FnOnce(Result<ToHost<'_>, WireError>) -> R) -> R {
    let (mut lists, mut buffer) = (Lists::default(), vec![0; stream.len()]);
    let mut decoder = Decoder::new(&mut buffer);
    for byte in stream {
        if let Some(frame) = decoder.push(*byte) {
            return look(ToHost::decode(&frame, &mut lists.lend()));
        }
    }
    panic!("no frame in {} bytes", stream.len())
}

/// A payload as a message to the host.
fn decode<R>(kind: u8, payload: &[u8], look: impl FnOnce(Result<ToHost<'_>, WireError>) -> R) -> R {
    let frame = Frame { kind, sequence: 1, repeated: false, payload };
    look(ToHost::decode(&frame, &mut Lists::default().lend()))
}

/// A payload as a command.
fn command(kind: u8, payload: &[u8]) -> Result<ToDevice, WireError> {
    ToDevice::decode(&Frame { kind, sequence: 1, repeated: false, payload })
}

fn model(lens: Option<Lens>) -> PairModel {
    let turn = [[1.0, 0.0, -0.01], [0.0, 1.0, 0.0], [0.01, 0.0, 1.0]];
    let eye = |lens| EyeModel { focal: [380.5, 381.0], skew: 0.25, centre: [160.0, 118.5], lens, turn };
    PairModel {
        width: 320,
        height: 240,
        focal: 375.0,
        columns: [159.5, 161.25],
        row: 119.5,
        baseline: 60.0,
        to_left: turn,
        eyes: lens.map(|lens| [eye(lens), eye(Lens::Equidistant([0.1, -0.02, 3e-3, -4e-4]))]),
    }
}

fn hello() -> Hello<'static> {
    Hello {
        firmware: [0, 1, 2],
        board: "mps2-an386",
        sensors: [0x7670, 0x7670],
        picture: [320, 240],
        capacities: Capacities { contour: 1536, branches: 64, controls: 512 },
        reset: ResetReason::Power,
        calibration: Some(0xCBF4_3926),
    }
}

const HEALTH: Health = Health {
    uptime: 86_400_000,
    pairs: 1000,
    refused: 3,
    dropped: 5,
    timeouts: 1,
    restarts: 1,
    rejected_bytes: 300,
    rejected_frames: 2,
    watchdog_resets: 0,
};

fn part(kind: PictureKind, width: u16, height: u16, rows: &[u8]) -> PicturePart<'_> {
    PicturePart { pair: 7, eye: Side::Right, kind, width, height, first_row: 2, rows }
}

/// A loop of eight points, a branch, and one of everything else.
fn small(look: impl FnOnce(Shape<'_>)) {
    let point = |u: i32, v: i32| PixelPoint { u: u * PX, v: v * PX };
    let ring = [(10, 10), (11, 10), (12, 10), (12, 11), (12, 12), (11, 12), (10, 12), (10, 11)];
    let normal = Direction { u: 0, v: -16384 };
    let contour = ring.map(|(u, v)| ContourPoint { at: point(u, v), normal, border: v == 12 });
    let matched = ContourMatch { disparity: 40 * PX, weight: 1, normal_right: normal };
    let hull = [point(10, 10), point(12, 10), point(12, 12), point(10, 12)];
    let cuts = CutMatch {
        left: [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11].map(|k| point(10 + k, 10)),
        right: [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11].map(|k| point(-30 + k, 10)),
        errors: [0, 70_000, 80_000, 90_000, 95_000, 96_000, 97_000, 96_000, 95_000, 90_000, 80_000, 70_000],
        least: 0,
        shift: 0,
    };
    let mut outcome = Outcome {
        areas: [9, 8],
        vertical_offset: -32,
        frontier_offsets: [-40, -24],
        plane: ImagePlane { origin: point(11, 11), level: 40 * PX, slope_u: 0, slope_v: ONE / 4 },
        cuts: Some(cuts),
        rows: RowStatistics { crossings: 6, unmatched: 1 },
        ..Outcome::default()
    };
    outcome.findings.extend([Finding::TouchesBorder(Side::Left), Finding::Unmatched(ONE / 6)]);
    let control = |k: i32| Control {
        ball: Ball { u: (10 * 3 + k) * PX / 3, v: 11 * PX, rho: PX, d: 40 * PX },
        weight: if k == 1 { ONE / 2 } else { ONE },
    };
    look(Shape {
        contour: &contour,
        loops: &[ContourLoop { start: 0, len: 8 }],
        matches: &[matched; 8],
        hulls: [&hull, &hull[..3]],
        branches: &[Branch {
            nodes: [0, 1],
            samples: 0,
            sample_count: 0,
            controls: 0,
            control_count: 4,
            closed: false,
        }],
        controls: &[0, 1, 2, 3].map(control),
        outcome: &outcome,
    });
}

/// One of each message to the host, and what a reader of the frozen bytes should know.
fn each_message(mut take: impl FnMut(&'static str, ToHost<'_>)) {
    take("hello", ToHost::Hello(hello()));
    take("hello without a calibration", ToHost::Hello(Hello { calibration: None, ..hello() }));
    take("pair, refused: the object is on the border", report(Err(Finding::NoObject(Side::Right, 12))));
    let full = Finding::Capacity(CapacityError { what: "bytes in a frame", limit: MAX_FRAME });
    take("pair, refused: more than 4096 bytes in a frame", report(Err(full)));
    small(|shape| take("pair with a loop of eight points and a straight branch", report(Ok(shape))));
    let grey = part(PictureKind::Grey, 4, 4, &[0, 50, 100, 150, 200, 250, 0, 255]);
    take("grey, two rows of four pixels", ToHost::Picture(grey));
    let mask = part(PictureKind::Mask, 10, 4, &[0b1111_0000, 0b01, 0b1000_0001, 0b10]);
    take("mask, two rows of ten pixels", ToHost::Picture(mask));
    take("health", ToHost::Health(HEALTH));
    take("answer: done", ToHost::Answer(Answer { command: 513, result: Ok(()) }));
    take("answer: busy", ToHost::Answer(Answer { command: 514, result: Err(ErrorCode::Busy) }));
}

/// One of each command.
fn each_command() -> Vec<(&'static str, ToDevice)> {
    let fixed =
        ExposureSetting::Fixed([Exposure { lines: 400, gain: 256 }, Exposure { lines: 380, gain: 300 }]);
    let polynomial = Lens::Polynomial([0.1, -0.2, 1e-3, -1e-3, 0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    vec![
        ("hello", ToDevice::Hello),
        ("start", ToDevice::Start),
        ("stop", ToDevice::Stop),
        ("threshold by Otsu", ToDevice::Threshold(Threshold::Otsu)),
        ("threshold 90", ToDevice::Threshold(Threshold::Fixed(90))),
        ("dark object", ToDevice::Polarity(Polarity::DarkObject)),
        ("automatic exposure", ToDevice::Exposure(ExposureSetting::Auto)),
        ("fixed exposure", ToDevice::Exposure(fixed)),
        ("calibration of a rectified pair", ToDevice::Calibration(model(None))),
        ("calibration of two lenses", ToDevice::Calibration(model(Some(polynomial)))),
        ("forget the calibration", ToDevice::ForgetCalibration),
        ("grab a mask", ToDevice::Grab(PictureKind::Mask)),
        ("health", ToDevice::Health),
    ]
}

fn command_bytes(command: &ToDevice) -> Vec<u8> {
    let mut out = vec![0; 1024];
    let len = command.encode(1, &mut out).unwrap();
    out.truncate(len);
    out
}

#[test]
fn the_bytes_of_every_message_are_frozen() {
    let hex = |bytes: &[u8]| bytes.iter().map(|b| format!("{b:02x}")).collect::<String>();
    let mut found =
        String::from("# Frames of version 1, as tests/tests/wire.rs names them.\n\n# to the host\n");
    each_message(|name, message| found += &format!("{name}: {}\n", hex(&bytes(&message))));
    found += "\n# to the device\n";
    for (name, command) in each_command() {
        found += &format!("{name}: {}\n", hex(&command_bytes(&command)));
    }
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/frozen/wire.txt");
    if std::env::var_os("REGENERATE").is_some() {
        std::fs::write(file, &found).unwrap();
    }
    assert_eq!(
        found,
        std::fs::read_to_string(file).unwrap_or_default(),
        "devices in the field do not change"
    );
}

#[test]
fn the_worked_bytes_of_the_document_are_right() {
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/wire-format.md");
    let page = std::fs::read_to_string(page).unwrap();
    let byte = |word: &str| u8::from_str_radix(word, 16).ok().filter(|_| word.len() == 2);
    let rows = page.lines().filter(|line| line.starts_with("00 ") && line.ends_with(" 00"));
    let worked: Vec<Vec<u8>> = rows.map(|line| line.split(' ').map_while(byte).collect()).collect();
    let mut all: Vec<Vec<u8>> = each_command().iter().map(|(_, c)| command_bytes(c)).collect();
    each_message(|_, message| all.push(bytes(&message)));
    assert!(worked.len() >= 3 && worked.iter().all(|frame| all.contains(frame)), "{worked:02x?}");
}

#[test]
fn every_message_comes_back() {
    each_message(|name, message| {
        let sent = bytes(&message);
        let [(kind, 1, payload)] = &link::frames(&sent)[..] else {
            panic!("{name} is no frame: {sent:02x?}")
        };
        assert_eq!(link::frame(*kind, 1, payload), sent, "{name}");
        read(&sent, |read| match (read.unwrap(), message) {
            (ToHost::Pair(read), ToHost::Pair(sent)) if sent.result.is_ok() => {
                assert_eq!(PairReport { result: sent.result, ..read }, sent);
                same_shape(read.result.unwrap(), sent.result.unwrap(), name);
            }
            (read, sent) => assert_eq!(read, sent, "{name}"),
        });
        // What a newer device appends does not matter; what is cut off does.
        let longer = [payload.as_slice(), &[1, 2, 3]].concat();
        decode(*kind, &longer, |read| assert!(read.is_ok(), "{name}: {read:?}"));
        for len in 0..payload.len() {
            decode(*kind, &payload[..len], |read| assert_eq!(read, Err(WireError::Short), "{name} of {len}"));
        }
    });
    for (name, sent) in each_command() {
        let frames = link::frames(&command_bytes(&sent));
        let [(kind, 1, payload)] = &frames[..] else { panic!("{name} is no frame") };
        assert_eq!(command(*kind, &[payload.as_slice(), &[9]].concat()), Ok(sent), "{name}");
        for len in 0..payload.len() {
            assert_eq!(command(*kind, &payload[..len]), Err(WireError::Short), "{name} of {len}");
        }
        if let ToDevice::Calibration(model) = sent {
            assert_eq!(shared::wire::calibration_crc(&model), link::crc32(payload));
        }
    }
}

#[test]
fn what_a_capacity_is_about_comes_back_by_name() {
    fn visit(folder: &Path, take: &mut impl FnMut(&str)) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                visit(&path, take);
            } else if !path.parent().unwrap().ends_with("wire") {
                take(std::fs::read_to_string(path).unwrap().split("#[cfg(test)]").next().unwrap());
            }
        }
    }
    let mut names = 0;
    visit(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/src"), &mut |code| {
        let direct = code.split("what: \"").skip(1);
        let pushed = code.split("push(").skip(1).filter_map(|call| call.split(';').next()?.split_once('"'));
        for text in direct.chain(pushed.map(|(_, text)| text)) {
            // The compiler keeps one copy of each text for good; so does the test.
            let what: &'static str = text.split('"').next().unwrap().to_owned().leak();
            let finding = Finding::Capacity(CapacityError { what, limit: 5 });
            read(&bytes(&report(Err(finding))), |read| {
                assert_eq!(read, Ok(report(Err(finding))), "{what} has no code in wire/finding.rs");
            });
            names += 1;
        }
    });
    assert!(names > 30, "{names} lists");
}

#[test]
fn another_version_is_named() {
    let other = (VERSION + 1).to_le_bytes();
    let theirs = VERSION + 1;
    decode(1, &other, |read| assert_eq!(read, Err(WireError::Version { theirs })));
    assert_eq!(command(0x81, &other), Err(WireError::Version { theirs }));
    let sentence = WireError::Version { theirs }.to_string();
    assert!(
        sentence.contains(&format!("version {VERSION}")) && sentence.contains(&format!("version {theirs}"))
    );
    decode(0x60, &[], |read| {
        assert_eq!(read, Err(WireError::Unknown { what: "message type", code: 0x60 }));
    });
    assert_eq!(command(0x60, &[]), Err(WireError::Unknown { what: "command", code: 0x60 }));
}

/// Largest errors of the fields of a shape, 1/256 px, degrees and 1/16384.
#[derive(Clone, Copy, Debug, Default)]
struct Errors {
    position: i32,
    disparity: i32,
    normal: f64,
    normal_right: f64,
    weight: i32,
    control: i32,
    control_disparity: i32,
}

fn degrees(a: Direction, b: Direction) -> f64 {
    f64::from(a.cross(b)).atan2(f64::from(a.dot(b))).to_degrees().abs()
}

fn apart(a: PixelPoint, b: PixelPoint) -> i32 {
    (a.u - b.u).abs().max((a.v - b.v).abs())
}

/// What must be the same exactly is; how much the rest differs.
fn same_shape(read: Shape<'_>, sent: Shape<'_>, name: &str) -> Errors {
    assert_eq!(read.loops, sent.loops, "{name}");
    let exact = |outcome: &Outcome| Outcome { cuts: None, ..outcome.clone() };
    assert_eq!(exact(read.outcome), exact(sent.outcome), "{name}");
    let ends =
        |s: Shape<'_>| s.branches.iter().map(|b| (b.nodes, b.control_count, b.closed)).collect::<Vec<_>>();
    assert_eq!(ends(read), ends(sent), "{name}");
    assert_eq!(read.outcome.cuts.is_some(), sent.outcome.cuts.is_some());
    let mut errors = Errors::default();
    let mut worse = |a: PixelPoint, b: PixelPoint| errors.position = errors.position.max(apart(a, b));
    for (a, b) in read.outcome.cuts.iter().zip(&sent.outcome.cuts) {
        assert_eq!((a.errors, a.least, a.shift), (b.errors, b.least, b.shift));
        a.left.iter().chain(&a.right).zip(b.left.iter().chain(&b.right)).for_each(|(a, b)| worse(*a, *b));
    }
    for (a, b) in read.hulls.into_iter().zip(sent.hulls) {
        assert_eq!(a.len(), b.len());
        a.iter().zip(b).for_each(|(a, b)| worse(*a, *b));
    }
    assert_eq!(read.contour.len(), sent.contour.len());
    for (a, b) in read.contour.iter().zip(sent.contour) {
        assert_eq!(a.border, b.border, "{name}");
        worse(a.at, b.at);
        errors.normal = errors.normal.max(degrees(a.normal, b.normal));
    }
    assert_eq!(read.matches.len(), read.contour.len());
    for (a, b) in read.matches.iter().zip(sent.matches) {
        errors.disparity = errors.disparity.max((a.disparity - b.disparity).abs());
        errors.normal_right = errors.normal_right.max(degrees(a.normal_right, b.normal_right));
        errors.weight = errors.weight.max((i32::from(a.weight) - i32::from(b.weight)).abs());
    }
    assert_eq!(read.controls.len(), sent.controls.len());
    for (a, b) in read.controls.iter().zip(sent.controls) {
        assert_eq!(a.weight, b.weight);
        errors.control =
            errors.control.max(apart(a.ball.at(), b.ball.at())).max((a.ball.rho - b.ball.rho).abs());
        errors.control_disparity = errors.control_disparity.max((a.ball.d - b.ball.d).abs());
    }
    errors
}

/// A wrench that is cut off below, with a ring: two loops, border, five ends.
fn wrench() -> Pair {
    drawn_pair(40.0, 0.05, |u, v| {
        let (ring, fork) = ((u - 170.0).hypot(v - 80.0), (u - 170.0).hypot(v - 225.0));
        (10.0..22.0).contains(&ring)
            || ((u - 170.0).abs() < 7.0 && (98.0..210.0).contains(&v))
            || (fork < 30.0 && ((u - 170.0).abs() > 8.0 || v < 222.0))
    })
}

const OPTICS: Optics = Optics { focal: 375 * PX, disparity_offset: 0 };

#[test]
fn shapes_of_scenes_come_back_to_their_resolution() {
    let solids = [Solid::Block, Solid::Mouse, Solid::Teapot, Solid::Torus, Solid::Screwdriver];
    let scenes = solids.map(|solid| (solid.name(), pair(solid, 2))).into_iter().chain([("wrench", wrench())]);
    for (name, pair) in scenes {
        let (sent, errors) = describe(&pair, OPTICS, |shape| {
            let sent = bytes(&report(Ok(shape)));
            let errors = read(&sent, |read| {
                let Ok(ToHost::Pair(PairReport { result: Ok(read), .. })) = read else { panic!("{read:?}") };
                check(read);
                // What was read is written to the same bytes: a record can be read and written for ever.
                assert!(bytes(&report(Ok(read))) == sent, "{name}");
                same_shape(read, shape, name)
            });
            (sent, errors)
        })
        .unwrap();
        println!("{name:12} {:5} bytes, {errors:?}", sent.len());
        assert!(sent.len() <= MAX_FRAME / 2, "{name}: {} bytes", sent.len());
        assert!(errors.position.max(errors.control) <= POSITION_STEP / 2, "{name}: {errors:?}");
        assert!(errors.disparity.max(errors.control_disparity) <= DISPARITY_STEP / 2, "{name}: {errors:?}");
        let turn = (f64::from(TURN_STEP) / 2.0 / 16384.0).asin().to_degrees();
        assert!(errors.normal < 1.0 && errors.normal_right < 1.2 * turn, "{name}: {errors:?}");
    }
}

#[test]
fn a_shape_that_does_not_fit_is_refused_whole() {
    let pair = wrench();
    let whole = describe(&pair, OPTICS, |shape| bytes(&report(Ok(shape))).len()).unwrap();
    for limit in [whole - 1, whole / 2, 100] {
        let mut out = vec![0; limit];
        let len = describe(&pair, OPTICS, |shape| report(Ok(shape)).encode(1, &mut out)).unwrap().unwrap();
        let refused = report(Err(Finding::Capacity(CapacityError { what: "bytes in a frame", limit })));
        read(&out[..len], |read| assert_eq!(read, Ok(refused)));
    }
    let mut out = [0; 30];
    let error = describe(&pair, OPTICS, |shape| report(Ok(shape)).encode(1, &mut out)).unwrap();
    assert_eq!(error, Err(CapacityError { what: "bytes in a frame", limit: 30 }));
}

#[test]
fn a_mask_is_packed_row_by_row() {
    let mut random = Random(4);
    for width in [1, 7, 8, 31, 32, 33, 64, 65, 100] {
        let size = Size::new(width, 3).unwrap();
        let mut words = vec![0; size.words()];
        let mut mask = Bitmap::new(size, &mut words).unwrap();
        (0..3 * width).for_each(|i| mask.put(i % width, i / width, random.below(2) == 1));
        let mut out = [0; 16];
        for v in 0..3 {
            let packed = shared::wire::pack_mask(&mask, v, &mut out).unwrap();
            assert_eq!(packed.len(), PictureKind::Mask.row_bytes(width as u16));
            for u in 0..8 * packed.len() {
                assert_eq!(
                    packed[u / 8] >> (u % 8) & 1 == 1,
                    mask.get(u as i32, i32::from(v)),
                    "{u} of {width}"
                );
            }
        }
        assert!(shared::wire::pack_mask(&mask, 0, &mut out[..width.div_ceil(8) - 1]).is_err());
    }
}

#[test]
fn stuffing_and_check_sums_agree_with_their_twins() {
    assert_eq!(link::crc32(b"123456789"), 0xCBF4_3926);
    let mut random = Random(8);
    for case in 0..2000u64 {
        let len = if case < 1100 { case / 2 + 1 } else { 1 + random.below(4000) } as usize;
        let zeros = [0, 1, 60, 255][case as usize % 4];
        let rows: Vec<u8> = (0..len).map(|_| (random.below(256).max(zeros) - zeros) as u8).collect();
        let sent = bytes(&ToHost::Picture(PicturePart {
            first_row: 0,
            ..part(PictureKind::Grey, len as u16, 1, &rows)
        }));
        let [(3, 1, payload)] = &link::frames(&sent)[..] else { panic!("{len} bytes") };
        assert_eq!(link::frame(3, 1, payload), sent);
        let mut frames = 0;
        receive(&sent, |frame| {
            assert_eq!((frame.kind, frame.sequence, frame.payload), (3, 1, payload.as_slice()));
            frames += 1;
        });
        assert_eq!(frames, usize::from(payload.len() + 7 <= MAX_FRAME), "{len} bytes");
    }
}

/// A stream of frames whose payloads tell their numbers, and where each begins.
fn numbered(count: u16, random: &mut Random) -> (Vec<u8>, Vec<usize>) {
    let (mut stream, mut starts, mut sequence) = (Vec::new(), Vec::new(), Sequence::default());
    for number in 0..count {
        let mut payload = number.to_le_bytes().to_vec();
        payload.extend((0..random.below(90)).map(|_| random.below(4) as u8 * 80));
        starts.push(stream.len());
        stream.extend(link::frame(5, sequence.take(), &payload));
    }
    starts.push(stream.len());
    (stream, starts)
}

/// What the decoder hands out is exactly what is whole in the stream, and nothing but what was sent.
fn compare(stream: &[u8], sent: &[(u8, u16, Vec<u8>)], what: &str) -> (Vec<u16>, Counters) {
    let mut received = Vec::new();
    let counters = receive(stream, |f| received.push((f.kind, f.sequence, f.payload.to_vec())));
    let whole = stream.iter().position(|b| *b == 0).map_or(&[][..], |first| &stream[first..]);
    let complete = whole.iter().rposition(|b| *b == 0).map_or(&[][..], |last| &whole[..=last]);
    assert_eq!(received, link::frames(complete), "{what}");
    assert!(received.iter().all(|frame| sent.contains(frame)), "{what}: a wrong frame came through");
    assert_eq!(counters.frames as usize, received.len(), "{what}");
    (received.iter().map(|f| f.1).collect(), counters)
}

#[test]
fn no_flipped_frame_passes_as_another() {
    let mut random = Random(15);
    let mut rejected = 0;
    for case in 0..20_000u64 {
        let (mut stream, _) = numbered(1, &mut random);
        let sent = link::frames(&stream);
        Fault::Flips(1 + case % 9).strike(&mut stream, &mut random);
        let (received, counters) = compare(&stream, &sent, "flips");
        rejected += usize::from(received.is_empty());
        let told = counters.rejected_frames() + counters.partial > 0 || counters.rejected_bytes > 0;
        assert!(
            !received.is_empty() || told || stream.iter().all(|b| *b != 0) || *stream.last().unwrap() != 0
        );
    }
    println!("{rejected} of 20000 rejected");
    assert!(rejected > 19_000, "{rejected}");
}

#[test]
fn a_bad_link_loses_what_it_hits_and_no_more() {
    let mut random = Random(16);
    for case in 0..600u64 {
        let (mut stream, starts) = numbered(60, &mut random);
        let sent = link::frames(&stream);
        let faults =
            [Fault::Drops(300), Fault::Doubles(300), Fault::Noise(200), Fault::Drops(1), Fault::Flips(1)];
        let fault = faults[case as usize % faults.len()];
        let hit = fault.strike(&mut stream, &mut random);
        let (received, counters) = compare(&stream, &sent, &format!("{fault:?}"));
        let spoilt = starts.windows(2).filter(|w| w[0] < hit.end && hit.start < w[1]).count();
        let lost = 60 - (0..60).filter(|n| received.contains(n)).count();
        assert!(lost <= spoilt + 1, "{fault:?} hit {spoilt} frames and lost {lost}");
        let behind = received.iter().max().unwrap_or(&0);
        let first = received.first().unwrap_or(&0);
        let unseen = u32::from(*first) + 59 - u32::from(*behind);
        if !matches!(fault, Fault::Doubles(_)) {
            assert_eq!(counters.missing + unseen, lost as u32, "{fault:?}: {counters:?}");
        }
        let raw = stream.iter().filter(|b| **b != 0).count();
        let good: usize =
            stream.split(|b| *b == 0).filter(|f| !link::frames(f).is_empty()).map(<[u8]>::len).sum();
        let tail = stream.rsplit(|b| *b == 0).next().unwrap().len();
        assert_eq!(counters.rejected_bytes as usize + good + tail, raw, "{fault:?}: {counters:?}");
    }
}

#[test]
fn listening_may_begin_anywhere() {
    let mut random = Random(17);
    for _ in 0..300 {
        let (stream, starts) = numbered(12, &mut random);
        let sent = link::frames(&stream);
        let from = random.below(stream.len() as u64 / 2) as usize;
        let (received, counters) = compare(&stream[from..], &sent, "late");
        let whole = starts.iter().filter(|s| **s >= from && **s < stream.len()).count();
        assert_eq!(received.len(), whole);
        let within = stream[from] != 0;
        assert_eq!(
            counters,
            Counters {
                frames: whole as u32,
                partial: u32::from(within),
                rejected_bytes: counters.rejected_bytes,
                ..Counters::default()
            }
        );
    }
}

#[test]
fn bytes_without_end_are_counted_once_and_forgotten() {
    let (stream, _) = numbered(2, &mut Random(1));
    let mut noise = vec![7; 1 << 20];
    noise.insert(0, 0);
    noise.extend(&stream);
    let (received, counters) = compare(&noise, &link::frames(&stream), "noise");
    assert_eq!(received, [0, 1]);
    let expected = Counters { frames: 2, oversize: 1, rejected_bytes: 1 << 20, ..Counters::default() };
    assert_eq!(counters, expected);
    let mut endless = Decoder::new(&mut []);
    assert!((0..10_000).all(|k| endless.push((k % 255) as u8 + 1).is_none()));
    for byte in [0, 1, 2, 0, 3, 9, 0] {
        assert!(endless.push(byte).is_none());
    }
}

#[test]
fn what_is_no_frame_is_counted_by_its_kind() {
    let good = link::frame(4, 9, b"abc");
    let mut bad = good.clone();
    bad[8] ^= 0x40;
    let counters = |stream: &[&[u8]]| receive(&stream.concat(), |_| ());
    let one = Counters { frames: 1, ..Counters::default() };
    let rejected_bytes = good.len() as u32 - 2;
    assert_eq!(counters(&[&good, &bad]), Counters { bad_crc: 1, rejected_bytes, ..one });
    assert_eq!(counters(&[&good, &[5, 1, 1, 0]]), Counters { malformed: 1, rejected_bytes: 3, ..one });
    assert_eq!(
        counters(&[&good, &link::stuff(&[0; 6]), &[0]]),
        Counters { malformed: 1, rejected_bytes: 7, ..one }
    );
    assert_eq!(counters(&[&good, &good]), Counters { frames: 2, repeated: 1, ..one });
    assert_eq!(counters(&[&good, &link::frame(4, 12, b"")]), Counters { frames: 2, missing: 2, ..one });
    assert_eq!(counters(&[&good, &link::frame(4, 0, b"")]), Counters { frames: 2, ..one });
    let wrapped = [link::frame(4, u16::MAX, b""), link::frame(4, 1, b"")].concat();
    assert_eq!(counters(&[&wrapped]), Counters { frames: 2, ..one });
}

/// What a shape must hold to be used.
fn check(shape: Shape<'_>) {
    let within = |p: PixelPoint| p.u.abs() <= 1 << 20 && p.v.abs() <= 1 << 20;
    let mut next = 0;
    for l in shape.loops {
        assert!(l.start == next && l.len >= 8);
        next += l.len;
    }
    assert_eq!((next, next), (shape.contour.len(), shape.matches.len()));
    assert!(shape.contour.iter().all(|p| within(p.at)));
    assert!(shape.matches.iter().all(|m| m.disparity.abs() <= 1 << 20 && m.weight <= 16384));
    assert!(shape.hulls.iter().all(|h| h.iter().all(|p| within(*p))));
    let mut next = 0;
    for branch in shape.branches {
        assert!(branch.controls == next && branch.curve(shape.controls).is_some());
        next += branch.control_count;
        let _ = branch.curve(shape.controls).unwrap().evaluate(12_345);
    }
    assert_eq!(next, shape.controls.len());
    if let Some(cuts) = &shape.outcome.cuts {
        let _ = cuts.margin();
        assert!(cuts.least < 12);
    }
    for point in shape.contour.iter().map(|p| p.at).chain([PixelPoint { u: -1 << 20, v: 1 << 20 }]) {
        let _ = shape.outcome.plane.at(point);
    }
}

/// Reads a payload as everything that it could be; what is read can be used and written.
fn survive(kind: u8, payload: &[u8]) {
    decode(kind, payload, |read| {
        if let Ok(message) = read {
            if let ToHost::Pair(PairReport { result: Ok(shape), .. }) = message {
                check(shape);
            }
            assert!(message.encode(0, &mut vec![0; 1 << 20]).is_ok());
        }
    });
    if let Ok(command) = command(kind, payload) {
        assert!(command.encode(0, &mut [0; 1024]).is_ok());
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_bytes_are_answered(kind in any::<u8>(), payload in proptest::collection::vec(any::<u8>(), 0..600)) {
        survive(kind, &payload);
        survive(kind % 6, &payload);
        survive(0x80 + kind % 12, &payload);
        receive(&payload, |frame| survive(frame.kind, frame.payload));
    }

    #[test]
    fn spoilt_messages_with_right_check_sums_are_answered(
        which in any::<proptest::sample::Index>(),
        changes in proptest::collection::vec((any::<proptest::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let mut all: Vec<(u8, u16, Vec<u8>)> =
            each_command().iter().flat_map(|(_, c)| link::frames(&command_bytes(c))).collect();
        each_message(|_, message| all.extend(link::frames(&bytes(&message))));
        // Most bytes of a shape are bits of its lists.
        let shape = all.iter().max_by_key(|(kind, _, payload)| (*kind == 2, payload.len())).unwrap().clone();
        let (kind, _, mut payload) = if which.index(2) == 0 { shape } else { which.get(&all).clone() };
        for (at, value) in &changes {
            if !payload.is_empty() {
                let at = at.index(payload.len());
                payload[at] = *value;
            }
        }
        survive(kind, &payload);
    }
}

#[test]
fn spoilt_shapes_of_scenes_are_answered() {
    let sent = describe(&wrench(), OPTICS, |shape| bytes(&report(Ok(shape)))).unwrap();
    let [(kind, _, payload)] = &link::frames(&sent)[..] else { panic!("no frame") };
    let mut random = Random(23);
    for _ in 0..3000 {
        let mut spoilt = payload.clone();
        for _ in 0..=random.below(3) {
            let at = random.below(spoilt.len() as u64) as usize;
            spoilt[at] ^= 1 << random.below(8);
        }
        survive(*kind, &spoilt);
    }
}

#[test]
fn lists_that_are_too_short_are_an_error_and_left_empty() {
    let sent = describe(&wrench(), OPTICS, |shape| bytes(&report(Ok(shape)))).unwrap();
    let [(kind, sequence, payload)] = &link::frames(&sent)[..] else { panic!("no frame") };
    let frame = Frame { kind: *kind, sequence: *sequence, repeated: false, payload };
    let mut long = Lists::default();
    let mut contour = List::<ContourPoint, 30>::new();
    let mut controls = List::<Control, 5>::new();
    let lists = &mut ShapeLists { contour: &mut contour, ..long.lend() };
    let error = ToHost::decode(&frame, lists).unwrap_err();
    assert_eq!(error, WireError::Capacity(CapacityError { what: "contour points", limit: 30 }));
    assert!(lists.contour.is_empty() && lists.loops.is_empty() && *lists.outcome == Outcome::default());
    let lists = &mut ShapeLists { controls: &mut controls, ..long.lend() };
    let error = ToHost::decode(&frame, lists).unwrap_err();
    assert_eq!(error, WireError::Capacity(CapacityError { what: "control points", limit: 5 }));
    assert!(lists.controls.is_empty() && lists.branches.is_empty() && lists.contour.is_empty());
}

fn evaluation_cases() -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/eval");
    let folder = std::env::var_os("OSSATURE_EVAL").map_or_else(beside, PathBuf::from).join("cases");
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!("\n!!!! SKIPPED: no evaluation cases in {}; set OSSATURE_EVAL !!!!\n", folder.display());
    None
}

/// Each pixel the mean of four.
fn halved(image: &GrayImage) -> GrayImage {
    GrayImage::from_fn(image.width() / 2, image.height() / 2, |u, v| {
        let at = |k: u32| u32::from(image.get_pixel(2 * u + k % 2, 2 * v + k / 2)[0]);
        Luma([(((0..4).map(at).sum::<u32>() + 2) / 4) as u8])
    })
}

#[test]
fn every_case_fits_a_frame() {
    let Some(folder) = evaluation_cases() else { return };
    let mut cases: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    cases.sort();
    for case in cases.iter().filter(|case| case.join("calib.yaml").is_file()) {
        let open = |name: &str| image::open(case.join(name)).unwrap().to_luma8();
        let rectification =
            Rectification::whole(&StereoCamera::read(case.join("calib.yaml")).unwrap()).unwrap();
        let camera = rectification.camera();
        let pair = rectification.images(open("left.png"), open("right.png")).unwrap().map(|p| halved(&p));
        let half = |x: f64| (x / 2.0 * f64::from(PX)).round() as i32;
        let optics = Optics { focal: half(camera.f), disparity_offset: half(camera.disparity_offset()) };
        let (len, points) =
            describe(&pair, optics, |shape| (bytes(&report(Ok(shape))).len(), shape.contour.len())).unwrap();
        let (width, height) = pair[0].dimensions();
        println!("{:40} {width}x{height}, {points:4} contour points: {len} bytes", case.display());
        assert!(len <= MAX_FRAME, "{}: {len} bytes", case.display());
    }
}
