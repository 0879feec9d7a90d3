//! Whatever breaks is gone on from.

use super::*;

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
