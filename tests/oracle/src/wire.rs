//! Messages of the wire format to try: one of each, shapes of scenes, lists to read them into, and what must
//! hold of whatever is read.

use crate::core::{Core, Picture};
use crate::scene::{Pair, drawn_pair};
use heapless::Vec as List;
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
    Answer, Capacities, Counters, Decoder, ErrorCode, Exposure, ExposureSetting, Frame, Health, Hello,
    MAX_FRAME, PairReport, PictureKind, PicturePart, ResetReason, Shape, ShapeLists, ToDevice, ToHost,
    WireError,
};

/// Lists that a shape is read into.
#[derive(Default)]
pub struct Lists {
    contour: Box<List<ContourPoint, 8192>>,
    loops: List<ContourLoop, 64>,
    matches: Box<List<ContourMatch, 8192>>,
    hulls: [Box<List<PixelPoint, 1024>>; 2],
    branches: List<Branch, 256>,
    controls: Box<List<Control, 4096>>,
    outcome: Outcome,
}

impl Lists {
    /// Lend them to be read into.
    pub fn lend(&mut self) -> ShapeLists<'_> {
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
pub fn describe<R>(pair: &Pair, optics: Optics, look: impl FnOnce(Shape<'_>) -> R) -> Result<R, Finding> {
    let pictures: [Picture; 2] = pair
        .each_ref()
        .map(|image| image.as_raw().chunks(image.width() as usize).map(<[u8]>::to_vec).collect());
    let settings = Settings::device(optics);
    let mut seen = None;
    Core::default().run([&pictures[0], &pictures[1]], &settings, "", &mut (), |memory, outcome| {
        seen = Some(look(Shape::of(memory, outcome)));
    })?;
    Ok(seen.unwrap())
}

/// A report of a pair.
pub fn report(result: Result<Shape<'_>, Finding>) -> ToHost<'_> {
    ToHost::Pair(PairReport {
        number: 7,
        stamps: [1_000_000, 1_000_012],
        levels: [96, 101],
        exposures: [Exposure { lines: 400, gain: 256 }, Exposure { lines: 380, gain: 300 }],
        result,
    })
}

/// The frame of a message.
pub fn bytes(message: &ToHost<'_>) -> Vec<u8> {
    let mut out = vec![0; 1 << 16];
    let len = message.encode(1, &mut out).unwrap();
    out.truncate(len);
    out
}

/// The frame of a command.
pub fn command_bytes(command: &ToDevice) -> Vec<u8> {
    let mut out = vec![0; 1024];
    let len = command.encode(1, &mut out).unwrap();
    out.truncate(len);
    out
}

/// Hand every frame of a stream to `take`.
pub fn receive(stream: &[u8], mut take: impl FnMut(Frame<'_>)) -> Counters {
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
pub fn read<R>(stream: &[u8], look: impl FnOnce(Result<ToHost<'_>, WireError>) -> R) -> R {
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
pub fn decode<R>(kind: u8, payload: &[u8], look: impl FnOnce(Result<ToHost<'_>, WireError>) -> R) -> R {
    let frame = Frame { kind, sequence: 1, repeated: false, payload };
    look(ToHost::decode(&frame, &mut Lists::default().lend()))
}

/// A payload as a command.
pub fn command(kind: u8, payload: &[u8]) -> Result<ToDevice, WireError> {
    ToDevice::decode(&Frame { kind, sequence: 1, repeated: false, payload })
}

/// Reads a payload as everything that it could be; what is read can be used and written.
pub fn survive(kind: u8, payload: &[u8]) {
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

/// What a shape must hold to be used.
pub fn check(shape: Shape<'_>) {
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

/// A calibration, of rectified pictures or of raw ones.
pub fn model(lens: Option<Lens>) -> PairModel {
    let turn = [[0.96, 0.0, -0.28], [0.0, 1.0, 0.0], [0.28, 0.0, 0.96]];
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

/// A device.
pub fn hello() -> Hello<'static> {
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

/// How it fares.
pub const HEALTH: Health = Health {
    uptime: 86_400_000,
    pairs: 1000,
    refused: 3,
    dropped: 5,
    timeouts: 1,
    restarts: 1,
    rejected_bytes: 300,
    rejected_frames: 2,
    watchdog_resets: 0,
    storage_faults: 1,
};

/// Rows of the right picture, from the third on.
pub fn part(kind: PictureKind, width: u16, height: u16, rows: &[u8]) -> PicturePart<'_> {
    PicturePart { pair: 7, eye: Side::Right, kind, width, height, first_row: 2, rows }
}

/// A loop of eight points, a branch, and one of everything else.
pub fn small(look: impl FnOnce(Shape<'_>)) {
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
pub fn each_message(mut take: impl FnMut(&'static str, ToHost<'_>)) {
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
pub fn each_command() -> Vec<(&'static str, ToDevice)> {
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

/// A wrench that is cut off below, with a ring: two loops, border, five ends.
pub fn wrench() -> Pair {
    drawn_pair(40.0, 0.05, |u, v| {
        let (ring, fork) = ((u - 170.0).hypot(v - 80.0), (u - 170.0).hypot(v - 225.0));
        (10.0..22.0).contains(&ring)
            || ((u - 170.0).abs() < 7.0 && (98.0..210.0).contains(&v))
            || (fork < 30.0 && ((u - 170.0).abs() > 8.0 || v < 222.0))
    })
}

/// The cameras of the rendered scenes at 320x240.
pub const OPTICS: Optics = Optics { focal: 375 * PX, disparity_offset: 0 };
