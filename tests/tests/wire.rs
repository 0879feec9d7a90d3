//! The wire format: what a device writes is what a host reads, and nothing else ever is.

use heapless::Vec as List;
use host::calibration::StereoCamera;
use host::shape::Shape as Solid;
use host::stage::rectify::Rectification;
use image::GrayImage;
use oracle::core::{Core, Picture};
use oracle::scene::{Pair, drawn_pair, pair};
use shared::fixed::{ONE, PX, UNIT};
use shared::pipeline::{Branch, Finding, Outcome, Settings};
use shared::point::PixelPoint;
use shared::stage::contour::{ContourLoop, ContourPoint};
use shared::stage::depth::Optics;
use shared::stage::nurbs::Control;
use shared::stage::rows::ContourMatch;
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

#[test]
fn probe() {
    let cases = Path::new("/work/shared/eval/cases");
    let mut names: Vec<PathBuf> = std::fs::read_dir(cases).unwrap().map(|e| e.unwrap().path()).collect();
    names.sort();
    for case in names {
        let open = |name: &str| image::open(case.join(name)).unwrap().to_luma8();
        let calibration = StereoCamera::read(case.join("calib.yaml")).unwrap();
        let rectification = Rectification::whole(&calibration).unwrap();
        let camera = rectification.camera();
        let pair = rectification.images(open("left.png"), open("right.png")).unwrap();
        let optics = Optics {
            focal: (camera.f * 128.0) as i32,
            disparity_offset: (camera.disparity_offset() * 128.0) as i32,
        };
        let pair = pair.map(|p| halved(&p));
        let r = describe(&pair, optics, |shape| {
            let b = bytes(&report(Ok(shape)));
            (
                b.len(),
                shape.contour.len(),
                shape.hulls.map(<[_]>::len),
                shape.branches.len(),
                shape.controls.len(),
            )
        });
        println!("{} {:?} {r:?}", case.display(), pair[0].dimensions());
    }
}

fn halved(image: &GrayImage) -> GrayImage {
    GrayImage::from_fn(image.width() / 2, image.height() / 2, |u, v| {
        let at = |k: u32| u32::from(image.get_pixel(2 * u + k % 2, 2 * v + k / 2)[0]);
        image::Luma([(((0..4).map(at).sum::<u32>() + 2) / 4) as u8])
    })
}
