//! Light that changes is followed, in simulated eyes and through the real driver.

use super::*;

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
