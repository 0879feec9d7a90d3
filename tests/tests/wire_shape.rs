//! Shapes over the wire: to their resolution, the same bits when written again, whole or refused; spoilt ones
//! are answered.

use heapless::Vec as List;
use host::reconstruct::{Options, Workspace};
use host::shape::Shape as Solid;
use host::source::serial::inbox::{Inbox, Message};
use host::stage::rectify::Rectification;
use oracle::cases;
use oracle::link;
use oracle::raster::Random;
use oracle::scene::pair;
use oracle::wire::{Lists, OPTICS, bytes, check, describe, model, read, report, small, survive, wrench};
use shared::limits::CapacityError;
use shared::pipeline::{Finding, Outcome};
use shared::point::{Direction, PixelPoint};
use shared::stage::contour::ContourPoint;
use shared::stage::depth::Optics;
use shared::stage::nurbs::Control;
use shared::wire::{
    DISPARITY_STEP, Frame, MAX_FRAME, POSITION_STEP, PairReport, Shape, ShapeLists, TURN_STEP, ToHost,
    WireError,
};

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

/// Whether a host makes a model of a pair's payload.
fn has_model(workspace: &mut Workspace, inbox: &mut Inbox, (kind, payload): (u8, &[u8])) -> bool {
    let frame = Frame { kind, sequence: 1, repeated: false, payload };
    let Ok(Message::Pair(heard)) = inbox.read(&frame) else { return false };
    let Ok(outcome) = heard.result else { return false };
    let (mut memory, options) = (inbox.memory(), Options::default());
    let made = workspace.reconstruct_shape((&mut memory, outcome), None, &model(None), &options, &mut ());
    made.map(|made| workspace.recycle(made)).is_ok()
}

#[test]
fn a_host_answers_whatever_shape_it_reads() {
    let (mut workspace, mut inbox) = (Workspace::default(), Inbox::new().unwrap());
    let frame = |shape: Shape<'_>| link::frames(&bytes(&report(Ok(shape)))).remove(0);
    let mut models = |kind, payload: &[u8]| has_model(&mut workspace, &mut inbox, (kind, payload));
    small(|whole| {
        let uncut = [&[][..]; 2];
        let parts = [
            Shape { contour: &[], loops: &[], matches: &[], ..whole },
            Shape { branches: &[], controls: &[], ..whole },
            Shape { contour: &[], loops: &[], matches: &[], branches: &[], controls: &[], ..whole },
            Shape { hulls: uncut, ..whole },
        ];
        for shape in parts {
            let (kind, _, payload) = frame(shape);
            models(kind, &payload);
        }
    });
    let (kind, _, sound) = describe(&wrench(), OPTICS, frame).unwrap();
    assert!(models(kind, &sound));
    let mut random = Random(29);
    let made = (0..200).filter(|_| {
        let mut spoilt = sound.clone();
        for _ in 0..=random.below(3) {
            let at = random.below(spoilt.len() as u64) as usize;
            spoilt[at] ^= 1 << random.below(8);
        }
        models(kind, &spoilt)
    });
    assert!(made.count() > 10, "most damage is refused before it is a shape");
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

#[test]
fn every_case_fits_a_frame() {
    let Some(folder) = cases::folder() else { return };
    for case in cases::cases(&folder) {
        let name = cases::name(&case);
        let ([left, right], camera) = cases::halved(&cases::open(&case));
        let rectification = Rectification::same_size(&camera).unwrap();
        let model = rectification.model();
        let pair = rectification.device_images(left, right).unwrap();
        let optics = Optics::from(&model);
        let figures = |s: Shape<'_>| (bytes(&report(Ok(s))).len(), s.contour.len(), s.branches.len());
        let (len, points, branches) = describe(&pair, optics, figures).unwrap();
        println!("{name:12} {points:4} contour points, {branches:2} branches: {len} bytes");
        assert!(len <= MAX_FRAME, "{name}: {len} bytes");
    }
}

/// What the method is wrong by, where the truth is known: on a flat disc.
#[test]
fn the_resolution_is_far_below_the_error_of_the_method() {
    let (centre, radius) = ((160.3, 119.6), 60.2);
    let pair = oracle::scene::drawn_pair(40.37, 0.0, |u, v| (u - centre.0).hypot(v - centre.1) < radius);
    let px = |x: i32| f64::from(x) / 256.0;
    describe(&pair, OPTICS, |shape| {
        let rms = |errors: &mut dyn Iterator<Item = f64>| {
            let squares: Vec<f64> = errors.map(|e| e * e).collect();
            (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
        };
        let angle = |p: &ContourPoint| (px(p.at.v) - centre.1).atan2(px(p.at.u) - centre.0);
        let position = rms(&mut shape
            .contour
            .iter()
            .map(|p| (px(p.at.u) - centre.0).hypot(px(p.at.v) - centre.1) - radius));
        let disparity = rms(&mut shape.matches.iter().map(|m| px(m.disparity) - 40.37));
        let normal = rms(&mut shape.contour.iter().zip(shape.matches).map(|(p, m)| {
            let (sine, cosine) = angle(p).sin_cos();
            (f64::from(m.normal_right.v) * cosine - f64::from(m.normal_right.u) * sine) / 16384.0
        }));
        println!(
            "method: {position:.3} px, disparity {disparity:.3} px, right normal {:.2} degrees",
            normal.to_degrees()
        );
        // Rounding is wrong by a step over the root of 12, rms.
        let rounding = |step: i32, one: f64| f64::from(step) / one / 12f64.sqrt();
        assert!(5.0 * rounding(POSITION_STEP, 256.0) < position);
        assert!(5.0 * rounding(DISPARITY_STEP, 256.0) < disparity);
        assert!(3.0 * rounding(TURN_STEP, 16384.0) < normal);
    })
    .unwrap();
}
