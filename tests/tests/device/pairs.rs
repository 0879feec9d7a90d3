//! What a pair becomes: the shape that arrives, its refusal, its pictures.

use super::*;

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
