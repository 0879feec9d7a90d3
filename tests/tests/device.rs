//! The device's loop on a PC: what it says is what the PC makes of the same pictures, commands are answered,
//! light that changes is followed, and whatever breaks is counted and gone on from.
//!
//! `-- --nocapture` prints the figures.

use firmware::camera::pair::{Module, Pair as Modules};
use firmware::device::{Condition, Event, HEALTH_US};
use firmware::ports::{CameraError, CameraFault, CameraPair, Clock, FlashError, LinkError, Side, Stamps};
use host::calibration::{Camera, Distortion, StereoCamera};
use host::shape::Shape as Solid;
use host::stage::rectify::{Eye, Rectification};
use image::{GrayImage, Luma};
use nalgebra::{Point2, Rotation3, Vector3};
use oracle::camera::{Bench as CameraBench, ControlBus, PictureBus, SIZE, Scene, Time, Wiring};
use oracle::core::Core;
use oracle::device::{Bench, Description, Ears, Eyes, Heard, Page, Report, Shared, World};
use oracle::link::{frame, frames};
use oracle::scene::{camera, pair};
use proptest::prelude::*;
use shared::camera::PairModel;
use shared::fixed::PX;
use shared::pipeline::{Finding, Observer, Product, Settings};
use shared::stage::binarise::{Polarity, Threshold};
use shared::stage::depth::Optics;
use shared::wire::{
    self, ErrorCode, ExposureSetting, PairReport, PictureKind, ResetReason, Shape, ToDevice, ToHost,
    calibration_crc,
};

/// The calibration of pictures that are rectified as they are.
fn plain() -> PairModel {
    Rectification::same_size(&camera(2)).unwrap().model()
}

/// What both eyes see of a solid when nothing has to be rectified.
fn scenes(solid: Solid) -> [Scene; 2] {
    pair(solid, 2).map(GrayImage::into_raw)
}

/// Two modules with lenses, not quite alike and not quite parallel.
fn modules() -> StereoCamera {
    let lens = Distortion::Polynomial([-0.25, 0.08, 1e-3, -5e-4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let left = Camera {
        width: 320,
        height: 240,
        fx: 340.0,
        fy: 341.0,
        cx: 162.0,
        cy: 118.0,
        skew: 0.0,
        distortion: lens,
    };
    let right = Camera { fx: 338.0, cx: 157.0, cy: 121.0, ..left };
    let turn = Rotation3::from_euler_angles(0.01, 0.04, -0.012);
    StereoCamera {
        left,
        right,
        rotation: turn.into_inner(),
        translation: turn * Vector3::new(-60.0, 0.5, 1.0),
    }
}

/// What the modules see of a solid: each raw pixel shows what the ray through it meets in the rendered pair.
fn raw_scenes(solid: Solid, rectification: &Rectification) -> [Scene; 2] {
    let (f, [cx, cx_right], cy) = {
        let camera = rectification.camera();
        (camera.f, [camera.cx, camera.cx_right], camera.cy)
    };
    let rendered = pair(solid, 2);
    [(Eye::Left, cx, &rendered[0]), (Eye::Right, cx_right, &rendered[1])].map(|(eye, cx, picture)| {
        let at = |x: f64, y: f64| {
            let inside = |x: f64, side: u32| (x.max(0.0) as u32).min(side - 1);
            f64::from(picture.get_pixel(inside(x, 320), inside(y, 240)).0[0])
        };
        let seen = GrayImage::from_fn(320, 240, |u, v| {
            let raw = Point2::new(f64::from(u), f64::from(v));
            let there = rectification.rectified_pixel(eye, raw).unwrap();
            let (x, y) = ((there.x - cx) / f * 375.0 + 159.5, (there.y - cy) / f * 375.0 + 119.5);
            let (s, t) = (x - x.floor(), y - y.floor());
            let mix = |a: f64, b: f64, s: f64| a + (b - a) * s;
            let grey = mix(mix(at(x, y), at(x + 1.0, y), s), mix(at(x, y + 1.0), at(x + 1.0, y + 1.0), s), t);
            Luma([grey.round() as u8])
        });
        seen.into_raw()
    })
}

fn bench(scenes: [Scene; 2]) -> (Bench<Eyes>, Shared<World>) {
    let time = Time::default();
    let (eyes, world) = Eyes::new(scenes, time.clone());
    (Bench::new(eyes, time, &Shared::default()), world)
}

/// A device that describes pairs.
fn running(scenes: [Scene; 2], model: PairModel) -> (Bench<Eyes>, Shared<World>) {
    let (mut bench, world) = bench(scenes);
    assert_eq!(bench.ask(&ToDevice::Calibration(model)), Ok(()));
    assert_eq!(bench.ask(&ToDevice::Start), Ok(()));
    (bench, world)
}

/// Levels and masks of a run.
#[derive(Default)]
struct Seen {
    levels: [u8; 2],
    masks: [Vec<u8>; 2],
}

impl Observer for Seen {
    fn saw(&mut self, side: Option<Side>, product: Product<'_>) {
        let Some(side) = side else { return };
        match product {
            Product::Threshold(_, _, level, _) => self.levels[side as usize] = level,
            Product::Mask(mask, _) => {
                let pixel = |i: i32| u8::from(mask.get(i % 320, i / 320));
                let pixels: Vec<u8> = (0..320 * 240).map(pixel).collect();
                let byte = |bits: &[u8]| bits.iter().rev().fold(0, |byte, bit| byte << 1 | bit);
                self.masks[side as usize] = pixels.chunks(8).map(byte).collect();
            }
            _ => (),
        }
    }
}

/// What the PC makes of raw pictures, the whole core at once, as it would arrive.
fn on_pc(
    raw: [&Scene; 2],
    rectification: Option<&Rectification>,
    model: &PairModel,
) -> (Result<Box<Description>, Finding>, Seen) {
    let [left, right] = raw.map(|luma| GrayImage::from_raw(320, 240, luma.clone()).unwrap());
    let images =
        rectification.map_or([left.clone(), right.clone()], |r| r.device_images(left, right).unwrap());
    let rows = images.map(|image| image.as_raw().chunks(320).map(<[u8]>::to_vec).collect());
    let optics = Optics {
        focal: (model.focal * f64::from(PX)).round() as i32,
        disparity_offset: ((model.columns[1] - model.columns[0]) * f64::from(PX)).round() as i32,
    };
    let (mut seen, mut sent) = (Seen::default(), vec![0; 1 << 16]);
    let result = Core::default().run(
        [&rows[0], &rows[1]],
        &Settings::device(optics),
        "",
        &mut seen,
        |memory, outcome| {
            let report = ToHost::Pair(PairReport {
                number: 0,
                stamps: [0; 2],
                levels: [0; 2],
                exposures: [wire::Exposure::default(); 2],
                result: Ok(Shape::of(memory, outcome)),
            });
            let len = report.encode(0, &mut sent).unwrap();
            sent.truncate(len);
        },
    );
    let arrived = result.map(|_| match Ears::default().hear(sent).pop() {
        Some(Heard::Pair(Report { result: Ok(description), .. })) => description,
        other => panic!("{other:?}"),
    });
    (arrived, seen)
}

#[test]
fn it_says_hello_when_it_boots_and_when_it_is_asked() {
    let (mut bench, world) = bench(scenes(Solid::Sphere));
    let first = bench.next_hello();
    assert_eq!(bench.heard.len(), 1, "nothing comes before hello");
    assert_eq!(bench.device().condition(), Condition::Ready);
    assert_eq!((first.board, first.reset, first.sensors), ("bench", ResetReason::Watchdog, [0x2642; 2]));
    assert_eq!((first.picture, first.calibration), ([320, 240], None));
    assert_eq!((first.capacities.contour, first.capacities.controls), (1536, 256));
    assert_eq!(bench.hello(), first);
    assert_eq!(world.borrow().starts, 1);
    assert_eq!(bench.ask(&ToDevice::Start), Err(ErrorCode::Uncalibrated));
    assert!(bench.steps(2000).is_empty(), "nothing is said unasked");
}

/// The shape that arrives is, in every field, what a PC makes of the same pictures.
#[test]
fn what_arrives_is_what_a_pc_makes_of_the_same_pictures() {
    let raw = Rectification::same_size(&modules()).unwrap();
    for solid in [Solid::Torus, Solid::Capsule, Solid::Teapot, Solid::Animal] {
        for (rectification, model) in [(None, plain()), (Some(&raw), raw.model())] {
            let scenes = rectification.map_or_else(|| scenes(solid), |r| raw_scenes(solid, r));
            let (mut bench, world) = running(scenes, model);
            for _ in 0..2 {
                let report = bench.report();
                let read = world.borrow().read.clone();
                let [.., left, right] = &read[..] else { panic!("both eyes are read") };
                let (expected, seen) = on_pc([left, right], rectification, &model);
                assert!(expected.is_ok(), "{solid:?} {expected:?}");
                assert!(report.result == expected, "{solid:?}, warped: {}", rectification.is_some());
                assert_eq!(report.levels, seen.levels);
                assert_eq!(report.stamps[0] - report.stamps[1], 7300);
            }
            assert_eq!(bench.ears.counters().rejected_frames(), 0);
        }
    }
}

#[test]
fn pictures_that_are_asked_for_arrive_whole() {
    let raw = Rectification::same_size(&modules()).unwrap();
    let (mut bench, world) = bench(raw_scenes(Solid::Teapot, &raw));
    bench.next_hello();
    let read = || -> [Scene; 2] {
        let read = world.borrow().read.clone();
        let [.., left, right] = &read[..] else { panic!("both eyes are read") };
        [left.clone(), right.clone()]
    };
    // Without a calibration: raw pictures, and masks of raw pictures.
    assert_eq!(bench.ask(&ToDevice::Grab(PictureKind::Grey)), Ok(()));
    assert_eq!(bench.pictures(PictureKind::Grey), read());
    assert_eq!(bench.ask(&ToDevice::Grab(PictureKind::Mask)), Ok(()));
    let [left, right] = read_after(&mut bench, &world, PictureKind::Mask, None, &plain());
    assert_eq!(left, right, "masks without a calibration");
    assert!(bench.steps(500).is_empty(), "nothing but the pictures is said");
    // With one: raw pictures and rectified masks, beside the reports of a device that runs.
    assert_eq!(bench.ask(&ToDevice::Calibration(raw.model())), Ok(()));
    assert_eq!(bench.ask(&ToDevice::Start), Ok(()));
    assert_eq!(bench.ask(&ToDevice::Grab(PictureKind::Grey)), Ok(()));
    assert_eq!(bench.ask(&ToDevice::Grab(PictureKind::Mask)), Err(ErrorCode::Busy));
    assert_eq!(bench.pictures(PictureKind::Grey), read());
    assert!(bench.report().result.is_ok());
    assert_eq!(bench.ask(&ToDevice::Grab(PictureKind::Mask)), Ok(()));
    let [sent, expected] = read_after(&mut bench, &world, PictureKind::Mask, Some(&raw), &raw.model());
    assert_eq!(sent, expected, "rectified masks");
}

/// The masks that come, and those of a PC.
fn read_after(
    bench: &mut Bench<Eyes>,
    world: &Shared<World>,
    kind: PictureKind,
    rectification: Option<&Rectification>,
    model: &PairModel,
) -> [[Vec<u8>; 2]; 2] {
    let sent = bench.pictures(kind);
    let read = world.borrow().read.clone();
    let [.., left, right] = &read[..] else { panic!("both eyes are read") };
    [sent, on_pc([left, right], rectification, model).1.masks]
}

/// A host that speaks while pictures are sent is heard at once.
#[test]
fn a_picture_does_not_keep_the_host_waiting() {
    let (mut bench, _) = bench(scenes(Solid::Capsule));
    bench.next_hello();
    assert_eq!(bench.ask(&ToDevice::Grab(PictureKind::Grey)), Ok(()));
    bench.until(|heard| matches!(heard, Heard::Rows(..)).then_some(()));
    let before = bench.heard.len();
    bench.health();
    let rows = bench.heard[before..].iter().filter(|h| matches!(h, Heard::Rows(..))).count();
    assert!(rows <= 1, "{rows} parts came first");
    assert_eq!(bench.ask(&ToDevice::Stop), Ok(()));
    assert!(bench.steps(500).is_empty(), "stop ends pictures too");
}

#[test]
fn it_starts_and_stops() {
    let (mut bench, _) = running(scenes(Solid::Capsule), plain());
    let numbers: Vec<u32> = (0..3).map(|_| bench.report().number).collect();
    assert_eq!(numbers, [1, 2, 3]);
    assert_eq!(bench.device().condition(), Condition::Working);
    assert_eq!(bench.ask(&ToDevice::Stop), Ok(()));
    assert!(bench.steps(500).is_empty(), "nothing comes behind the answer to stop");
    assert_eq!(bench.ask(&ToDevice::Start), Ok(()));
    assert!(bench.report().number > 3);
}

#[test]
fn orders_about_light_and_object_are_kept() {
    let (mut bench, world) = running(scenes(Solid::Capsule), plain());
    let fixed = |lines, gain| ToDevice::Exposure(ExposureSetting::Fixed([wire::Exposure { lines, gain }; 2]));
    assert_eq!(bench.ask(&fixed(200, 2 * 256)), Ok(()));
    bench.report();
    assert_eq!(bench.report().exposures, [wire::Exposure { lines: 200, gain: 512 }; 2]);
    world.borrow_mut().light = 0.4;
    for _ in 0..3 {
        assert_eq!(bench.report().exposures, [wire::Exposure { lines: 200, gain: 512 }; 2]);
    }
    world.borrow_mut().light = 1.0;
    for impossible in [fixed(0, 256), fixed(671, 256), fixed(100, 0), fixed(100, u16::MAX)] {
        assert_eq!(bench.ask(&impossible), Err(ErrorCode::OutOfRange));
    }
    let uneven = [wire::Exposure { lines: 100, gain: 256 }, wire::Exposure { lines: 101, gain: 256 }];
    let uneven = ToDevice::Exposure(ExposureSetting::Fixed(uneven));
    assert_eq!(bench.ask(&uneven), Err(ErrorCode::OutOfRange));

    assert_eq!(bench.ask(&ToDevice::Threshold(Threshold::Fixed(77))), Ok(()));
    bench.report();
    assert_eq!(bench.report().levels, [77; 2]);
    assert_eq!(bench.ask(&ToDevice::Threshold(Threshold::Otsu)), Ok(()));
    assert_eq!(bench.ask(&ToDevice::Polarity(Polarity::DarkObject)), Ok(()));
    bench.report();
    assert!(matches!(bench.report().result, Err(Finding::FillsImage(Side::Left, _))));
    assert_eq!(bench.ask(&ToDevice::Polarity(Polarity::Auto)), Ok(()));
    bench.report();
    assert!(bench.report().result.is_ok());
    assert_eq!(bench.ask(&ToDevice::Exposure(ExposureSetting::Auto)), Ok(()));
    bench.report();
    assert_ne!(bench.report().exposures, [wire::Exposure { lines: 200, gain: 512 }; 2]);
}

/// Light that changes by any factor of this list: within five frames the object's area is what it was.
#[test]
fn light_that_changes_is_followed_within_five_frames() {
    for solid in [Solid::Capsule, Solid::Teapot] {
        let (mut bench, world) = running(scenes(solid), plain());
        let settled = |bench: &mut Bench<Eyes>| (0..6).map(|_| bench.report()).last().unwrap();
        let areas =
            |report: &Report| report.result.as_ref().map(|d| d.outcome.areas.map(f64::from)).map_err(|f| *f);
        let before = settled(&mut bench);
        for light in [0.5, 1.0, 2.0, 1.0, 4.0, 0.25, 1.0] {
            world.borrow_mut().light = light;
            let reports: Vec<Report> = (0..10).map(|_| bench.report()).collect();
            let exposures: Vec<_> =
                reports.iter().map(|r| (r.exposures[0].lines, r.exposures[0].gain)).collect();
            println!("{solid:?}, light {light}: {exposures:?}");
            assert!(exposures[5..].iter().all(|e| *e == exposures[9]), "it rests");
            let [left, right] = areas(&before).unwrap();
            for report in &reports[5..] {
                let [l, r] = areas(report).unwrap();
                assert!((l / left - 1.0).abs() < 0.02 && (r / right - 1.0).abs() < 0.02, "{l} for {left}");
            }
        }
    }
}

#[test]
fn a_scene_without_an_object_is_refused_in_words() {
    let (mut bench, world) = running(scenes(Solid::Capsule), plain());
    assert!(bench.report().result.is_ok());
    world.borrow_mut().scenes = [vec![40; 320 * 240], vec![40; 320 * 240]];
    bench.report();
    assert_eq!(bench.report().result, Err(Finding::NoObject(Side::Left, 0)));
    // What is refused is not shown either, but told.
    assert_eq!(bench.ask(&ToDevice::Stop), Ok(()));
    assert_eq!(bench.ask(&ToDevice::Grab(PictureKind::Mask)), Ok(()));
    let report = bench.report();
    assert_eq!(report.result, Err(Finding::NoObject(Side::Left, 0)));
    let health = bench.health();
    assert!(health.refused >= 2 && health.pairs > health.refused, "{health:?}");
}

/// A calibration is in use when its upload is answered, outlives the power, and goes when it is told to.
#[test]
fn a_calibration_outlives_the_power() {
    let page = Shared::<Page>::default();
    let boot = |page: &Shared<Page>| {
        let time = Time::default();
        Bench::new(Eyes::new(scenes(Solid::Capsule), time.clone()).0, time, page)
    };
    let model = Rectification::same_size(&modules()).unwrap().model();
    let mut bench = boot(&page);
    assert_eq!(bench.next_hello().calibration, None);
    assert_eq!(bench.ask(&ToDevice::Calibration(model)), Ok(()));
    assert_eq!(bench.hello().calibration, Some(calibration_crc(&model)));
    // The record is the upload itself, by a reader that shares no code with its writer.
    let mut upload = [0; 1024];
    let len = ToDevice::Calibration(model).encode(0, &mut upload).unwrap();
    assert_eq!(frames(&page.borrow().record), frames(&upload[..len]));
    assert_eq!(frames(&page.borrow().record).len(), 1);

    let mut again = boot(&page);
    assert_eq!(again.next_hello().calibration, Some(calibration_crc(&model)));
    assert_eq!(again.ask(&ToDevice::Start), Ok(()));

    // Pictures of another size, or no camera at all: the old one stays.
    for bad in [
        PairModel { width: 160, ..model },
        PairModel { baseline: -1.0, ..model },
        PairModel { to_left: [[0.0; 3]; 3], ..model },
    ] {
        assert_eq!(again.ask(&ToDevice::Calibration(bad)), Err(ErrorCode::OutOfRange));
    }
    page.borrow_mut().fault = Some(FlashError::Failing);
    assert_eq!(again.ask(&ToDevice::Calibration(plain())), Err(ErrorCode::Storage));
    assert_eq!(again.ask(&ToDevice::ForgetCalibration), Err(ErrorCode::Storage));
    assert_eq!(again.hello().calibration, Some(calibration_crc(&model)));
    assert_eq!(again.health().storage_faults, 2);

    page.borrow_mut().fault = None;
    assert_eq!(again.ask(&ToDevice::ForgetCalibration), Ok(()));
    assert_eq!(again.hello().calibration, None);
    again.steps(50);
    assert!(again.steps(500).is_empty(), "it describes nothing without a calibration");
    assert_eq!(boot(&page).next_hello().calibration, None);
}

/// Any byte of the record that changes, and any that is missing, costs the calibration and nothing else.
#[test]
fn a_damaged_record_is_none() {
    let mut record = vec![0; 1024];
    let len = ToDevice::Calibration(plain()).encode(0, &mut record).unwrap();
    record.truncate(len);
    let other = {
        let model = PairModel { width: 160, ..plain() };
        let mut record = vec![0; 1024];
        let len = ToDevice::Calibration(model).encode(0, &mut record).unwrap();
        record.truncate(len);
        record
    };
    let flipped = |at: usize| {
        let mut record = record.clone();
        record[at] ^= 0x10;
        record
    };
    let mut damaged = vec![record[..len / 2].to_vec(), vec![0xFF; 600], vec![0; 1024], other];
    damaged.extend((1..len - 1).step_by(29).map(flipped));
    for record in damaged {
        let page = Shared::<Page>::default();
        page.borrow_mut().record = record;
        let time = Time::default();
        let mut bench = Bench::new(Eyes::new(scenes(Solid::Capsule), time.clone()).0, time, &page);
        assert_eq!(bench.next_hello().calibration, None);
        assert_eq!(bench.health().storage_faults, 1);
        assert_eq!(bench.ask(&ToDevice::Start), Err(ErrorCode::Uncalibrated));
        assert_eq!(bench.ask(&ToDevice::Calibration(plain())), Ok(()));
    }
}

#[test]
fn eyes_that_hang_are_started_again() {
    let (mut bench, world) = running(scenes(Solid::Capsule), plain());
    bench.report();
    world.borrow_mut().faults.push_back(CameraFault::TimeLimit(500_000));
    for _ in 0..2 {
        assert!(bench.report().result.is_ok());
    }
    let health = bench.health();
    assert_eq!((health.timeouts, health.restarts, health.dropped), (1, 1, 1));
    // A bad frame is but dropped; several in a row are more than bad luck.
    world.borrow_mut().faults.push_back(CameraFault::Length(3));
    bench.report();
    bench.report();
    assert_eq!((bench.health().restarts, bench.health().dropped), (1, 2));
    world.borrow_mut().faults.extend([CameraFault::PictureBus; 3]);
    bench.report();
    bench.report();
    assert_eq!((bench.health().restarts, bench.health().dropped), (2, 5));
    // A picture that breaks off is no picture.
    world.borrow_mut().read_breaks = Some(100);
    bench.report();
    bench.report();
    assert_eq!((bench.health().restarts, bench.health().dropped), (2, 6));
    assert_eq!(world.borrow().starts, 3);
    assert_eq!(dropped(&mut bench), 6);
}

/// How many pairs were dropped, by a device that is stopped: with those that came to their end they are all that were
/// begun, of which the pictures that are asked for at last have the number.
#[track_caller]
fn dropped(bench: &mut Bench<Eyes>) -> u32 {
    assert_eq!(bench.ask(&ToDevice::Stop), Ok(()));
    assert_eq!(bench.ask(&ToDevice::Grab(PictureKind::Grey)), Ok(()));
    bench.pictures(PictureKind::Grey);
    let pair = |heard: &Heard| if let Heard::Rows(pair, ..) = heard { Some(*pair) } else { None };
    let begun = bench.heard.iter().rev().find_map(pair).unwrap();
    let health = bench.health();
    assert_eq!(health.pairs + health.dropped, begun, "{health:?}");
    health.dropped
}

/// A device in the middle of a pair, after one that it described.
fn under_way() -> (Bench<Eyes>, Shared<World>) {
    let (mut bench, world) = running(scenes(Solid::Capsule), plain());
    bench.report();
    while world.borrow().read.len() % 2 == 0 {
        let _ = bench.step();
    }
    (bench, world)
}

#[test]
fn a_pair_that_a_stop_ends_is_dropped() {
    let (mut bench, _) = under_way();
    assert_eq!(dropped(&mut bench), 1);
}

#[test]
fn a_pair_that_a_new_calibration_ends_is_dropped() {
    for command in [ToDevice::Calibration(plain()), ToDevice::ForgetCalibration] {
        let (mut bench, _) = under_way();
        assert_eq!(bench.ask(&command), Ok(()));
        assert_eq!(bench.health().dropped, 1);
        assert!((1..=2).contains(&dropped(&mut bench)), "one more by the stop, if one was under way");
    }
}

#[test]
fn a_pair_that_a_lost_part_of_its_pictures_ends_is_dropped() {
    let (mut bench, _) = under_way();
    assert_eq!(bench.ask(&ToDevice::Grab(PictureKind::Grey)), Ok(()));
    bench.until(|heard| matches!(heard, Heard::Rows(..)).then_some(()));
    bench.cable.borrow_mut().jam = Some(LinkError::Closed);
    while bench.cable.borrow().lost == 0 {
        let _ = bench.step();
    }
    bench.cable.borrow_mut().jam = None;
    assert_eq!(bench.health().dropped, 1);
    assert!((1..=2).contains(&dropped(&mut bench)), "one more by the stop, if one was under way");
}

#[test]
fn pictures_asked_for_survive_a_fault() {
    let (mut bench, world) = bench(scenes(Solid::Capsule));
    bench.next_hello();
    world.borrow_mut().faults.push_back(CameraFault::TimeLimit(500_000));
    world.borrow_mut().read_breaks = Some(100);
    assert_eq!(bench.ask(&ToDevice::Grab(PictureKind::Grey)), Ok(()));
    let [left, _] = bench.pictures(PictureKind::Grey);
    assert_eq!(left, world.borrow().read[0]);
}

#[test]
fn dead_eyes_are_told_and_awaited() {
    let time = Time::default();
    let (eyes, world) = Eyes::new(scenes(Solid::Capsule), time.clone());
    world.borrow_mut().dead = true;
    let mut bench = Bench::new(eyes, time.clone(), &Shared::default());
    assert_eq!(bench.device().condition(), Condition::Starting);
    assert_eq!(bench.next_hello().sensors, [0; 2]);
    assert_eq!(bench.device().condition(), Condition::Faulty);
    assert_eq!(bench.ask(&ToDevice::Calibration(plain())), Ok(()));
    assert_eq!(bench.ask(&ToDevice::Start), Err(ErrorCode::Camera));
    assert_eq!(bench.ask(&ToDevice::Grab(PictureKind::Grey)), Err(ErrorCode::Camera));
    bench.steps(8000);
    let starts = world.borrow().starts;
    let waited = time.micros() / 2_000_000;
    assert!(u64::from(starts) <= waited + 1 && starts >= 3, "{starts} starts in {} s", 2 * waited);
    world.borrow_mut().dead = false;
    bench.steps(6000);
    assert_eq!(bench.hello().sensors, [0x2642; 2]);
    assert_eq!(bench.ask(&ToDevice::Start), Ok(()));
    assert!(bench.report().result.is_ok());
    assert_eq!(u64::from(bench.health().restarts), u64::from(world.borrow().starts) - 1);
}

/// Bytes in any chunks, noise between frames, frames that are no commands: each is answered or counted.
#[test]
fn bad_bytes_are_counted_and_bad_frames_are_answered() {
    let (mut bench, _) = bench(scenes(Solid::Capsule));
    bench.next_hello();
    for chunk in [1, 2, 7, 63, 64, 1000] {
        bench.cable.borrow_mut().chunk = chunk;
        assert_eq!(bench.ask(&ToDevice::Calibration(plain())), Ok(()), "in chunks of {chunk}");
    }
    let before = bench.health();
    assert_eq!((before.rejected_bytes, before.rejected_frames), (0, 0));
    let noise: Vec<u8> = (0..3000).map(|i| (i % 255 + 1) as u8).collect();
    bench.cable.borrow_mut().to_device.extend(noise.into_iter().chain([0]));
    let after = bench.health();
    assert_eq!((after.rejected_bytes, after.rejected_frames), (3000, 1));

    let says = |bench: &mut Bench<Eyes>, kind: u8, payload: &[u8]| {
        bench.cable.borrow_mut().to_device.extend(frame(kind, 999, payload));
        bench.until(|heard| match heard {
            Heard::Answer(answer) if answer.command == 999 => Some(answer.result),
            _ => None,
        })
    };
    assert_eq!(says(&mut bench, 0x7F, &[]), Err(ErrorCode::UnknownCommand));
    assert_eq!(says(&mut bench, 0xFF, &[1; 300]), Err(ErrorCode::UnknownCommand));
    assert_eq!(says(&mut bench, 0x81, &[99, 0]), Err(ErrorCode::Version));
    assert_eq!(says(&mut bench, 0x87, &[1, 2, 3]), Err(ErrorCode::Malformed));
    assert_eq!(says(&mut bench, 0x89, &[9]), Err(ErrorCode::OutOfRange));
    assert_eq!(says(&mut bench, 0x83, &[]), Ok(()));
}

#[test]
fn health_comes_unasked_and_nothing_is_missing() {
    let time = Time::default();
    let mut bench =
        Bench::new(Eyes::new(scenes(Solid::Capsule), time.clone()).0, time.clone(), &Shared::default());
    let next = |bench: &mut Bench<Eyes>| {
        bench.until(|heard| match heard {
            Heard::Health(health) => Some(*health),
            _ => None,
        })
    };
    let (first, second) = (next(&mut bench), next(&mut bench));
    assert!((second.uptime - first.uptime).abs_diff(HEALTH_US / 1000) < 10, "{first:?} {second:?}");
    assert!(time.micros() / 1000 - second.uptime < 10);
    assert_eq!(second.watchdog_resets, 3);
    assert_eq!((bench.ears.counters().missing, bench.ears.counters().repeated), (0, 0));
    println!("longest without a meal: {} us", bench.hungriest());
}

/// A host that does not listen costs the frames that it missed, and a picture of which it missed a part.
#[test]
fn a_host_that_is_gone_keeps_nobody_waiting() {
    let (mut bench, world) = running(scenes(Solid::Capsule), plain());
    bench.report();
    bench.cable.borrow_mut().jam = Some(LinkError::Closed);
    bench.steps(200);
    assert!(world.borrow().read.len() > 10, "it goes on");
    bench.cable.borrow_mut().jam = None;
    bench.report();
    let counters = *bench.ears.counters();
    assert_eq!(counters.missing as usize, bench.cable.borrow().lost);
    assert_eq!(bench.ask(&ToDevice::Stop), Ok(()));

    assert_eq!(bench.ask(&ToDevice::Grab(PictureKind::Grey)), Ok(()));
    bench.until(|heard| matches!(heard, Heard::Rows(..)).then_some(()));
    let lost = bench.cable.borrow().lost;
    bench.cable.borrow_mut().jam = Some(LinkError::TimeLimit(1_000_000));
    bench.steps(200);
    assert_eq!(bench.cable.borrow().lost - lost, 1, "one part is tried in vain");
}

/// The driver of the real modules in the loop, against the model of the modules.
#[test]
fn the_real_driver_in_the_loop() {
    let world = CameraBench::new(Wiring::default(), scenes(Solid::Capsule));
    let module = |eye| Module::new(world.picture_bus(eye), world.control_bus(eye));
    type Real = Modules<PictureBus, ControlBus, Time, Time>;
    let eyes: Real = Modules::new(module(0), module(1), world.time.clone(), world.time.clone());
    assert_eq!((Real::WIDTH, Real::HEIGHT), SIZE);
    let mut bench = Bench::new(eyes, world.time.clone(), &Shared::default());
    assert_eq!(bench.next_hello().sensors, [0x2642; 2]);
    let grab = |bench: &mut Bench<Real>| {
        assert_eq!(bench.ask(&ToDevice::Grab(PictureKind::Grey)), Ok(()));
        bench.pictures(PictureKind::Grey)
    };
    // Exposed as the scene was made, the eyes see the scene.
    let as_made = [wire::Exposure { lines: 300, gain: 256 }; 2];
    assert_eq!(bench.ask(&ToDevice::Exposure(ExposureSetting::Fixed(as_made))), Ok(()));
    let seen = grab(&mut bench);
    assert!(seen == scenes(Solid::Capsule), "grey values go through untouched");
    assert_eq!(bench.ask(&ToDevice::Exposure(ExposureSetting::Auto)), Ok(()));
    assert_eq!(bench.ask(&ToDevice::Calibration(plain())), Ok(()));
    assert_eq!(bench.ask(&ToDevice::Start), Ok(()));
    let areas = |report: &Report| report.result.as_ref().map(|d| d.outcome.areas).map_err(|f| *f);
    let before = (0..5).map(|_| bench.report()).last().unwrap();
    assert!(before.result.is_ok(), "{:?}", before.result);
    for halves in [true, false] {
        for sensor in &world.sensors {
            let change = |luma: &mut u8| *luma = if halves { *luma / 2 } else { *luma * 2 };
            sensor.borrow_mut().scene.iter_mut().for_each(change);
        }
        let reports: Vec<Report> = (0..6).map(|_| bench.report()).collect();
        let ([l, r], [left, right]) = (areas(&reports[5]).unwrap(), areas(&before).unwrap());
        println!("areas {left} {right} before, {l} {r} after; exposure {:?}", reports[5].exposures[0]);
        assert!(l.abs_diff(left) * 50 < left && r.abs_diff(right) * 50 < right);
    }
    // A module that hangs.
    world.chips[1].borrow_mut().hangs = 1;
    assert!(bench.report().result.is_ok());
    bench.report();
    let health = bench.health();
    assert_eq!((health.timeouts, health.restarts), (1, 1));
    println!("longest without a meal: {} ms", bench.hungriest() / 1000);
    assert!(bench.hungriest() < 3_000_000, "a watchdog of 4 s does not bite");
}

/// A control bus that dies while the device runs, and stays dead for some seconds, is told and counted, and nobody is
/// needed for its eyes to come back.
#[test]
fn a_control_bus_that_dies_comes_back_by_itself() {
    let world = CameraBench::new(Wiring::default(), scenes(Solid::Capsule));
    let module = |eye| Module::new(world.picture_bus(eye), world.control_bus(eye));
    let eyes = Modules::new(module(0), module(1), world.time.clone(), world.time.clone());
    let mut bench = Bench::new(eyes, world.time.clone(), &Shared::default());
    bench.next_hello();
    assert_eq!(bench.ask(&ToDevice::Calibration(plain())), Ok(()));
    assert_eq!(bench.ask(&ToDevice::Start), Ok(()));
    (0..5).for_each(|_| drop(bench.report()));
    let before = bench.health();
    world.sensors[0].borrow_mut().holds = 3;
    // Pictures go on without the bus until something is ordered of the eyes.
    let ordered = [wire::Exposure { lines: 100, gain: 256 }; 2];
    assert_eq!(bench.ask(&ToDevice::Exposure(ExposureSetting::Fixed(ordered))), Ok(()));
    while bench.device().condition() != Condition::Faulty {
        let _ = bench.step();
    }
    assert_eq!(bench.hello().sensors, [0; 2]);
    assert_eq!(bench.report().exposures, ordered);
    assert_eq!(bench.hello().sensors, [0x2642; 2]);
    assert_eq!(bench.health().restarts - before.restarts, 3, "two in vain");
    assert!(bench.hungriest() < 3_000_000, "a watchdog of 4 s does not bite");
}

fn any_event() -> impl Strategy<Value = Event> {
    let side = prop_oneof![Just(Side::Left), Just(Side::Right)];
    let fault = prop_oneof![
        Just(CameraFault::NotStarted),
        Just(CameraFault::PictureBus),
        any::<u32>().prop_map(CameraFault::TimeLimit),
    ];
    let error = (side, fault).prop_map(|(side, fault)| CameraError { side, fault });
    let flash = prop_oneof![Just(FlashError::Damaged), Just(FlashError::Failing)];
    let link = prop_oneof![Just(LinkError::Closed), Just(LinkError::Overrun)];
    prop_oneof![
        prop::result::maybe_err(any::<usize>(), flash.clone()).prop_map(Event::Loaded),
        prop::result::maybe_err(Just(()), flash).prop_map(Event::Saved),
        prop::result::maybe_err(any::<usize>(), link.clone()).prop_map(Event::Received),
        prop::result::maybe_err(Just(()), link).prop_map(Event::Sent),
        prop::result::maybe_err(Just(()), error.clone()).prop_map(Event::Exposed),
        prop::result::maybe_err(any::<[u64; 2]>().prop_map(|done| Stamps { done }), error.clone())
            .prop_map(Event::Captured),
        prop::result::maybe_err(Just(()), error).prop_map(Event::Read),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Bytes and frames of any content: nothing panics, and the device still says who it is.
    #[test]
    fn any_bytes_leave_it_alive(
        chunks in prop::collection::vec(
            prop_oneof![
                prop::collection::vec(any::<u8>(), 0..400),
                (any::<u8>(), any::<u16>(), prop::collection::vec(any::<u8>(), 0..600))
                    .prop_map(|(kind, number, payload)| frame(kind, number, &payload)),
                (0x80..0x90_u8, any::<u16>(), prop::collection::vec(0..3_u8, 0..10))
                    .prop_map(|(kind, number, payload)| frame(kind, number, &payload)),
            ],
            1..12,
        ),
    ) {
        let (mut bench, _) = bench(scenes(Solid::Capsule));
        for chunk in chunks {
            bench.cable.borrow_mut().to_device.extend(chunk);
            bench.steps(20);
        }
        bench.cable.borrow_mut().to_device.push_back(0);
        prop_assert_eq!(bench.hello().board, "bench");
    }

    /// Reports that nobody asked for: nothing panics, whatever they say and whenever they come.
    #[test]
    fn any_reports_leave_it_alive(
        events in prop::collection::vec((any_event(), 0..6_usize, any::<u64>(), any::<u16>()), 1..60),
    ) {
        let (mut bench, _) = running(scenes(Solid::Capsule), plain());
        for (event, calls, now, row) in events {
            bench.device().report(event, now);
            for _ in 0..calls {
                let _ = bench.device().next(now);
                bench.device().line(row.into(), &[200; 320]);
            }
        }
    }
}
