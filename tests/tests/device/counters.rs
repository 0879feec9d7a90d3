//! What is lost is counted.

use super::*;

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
