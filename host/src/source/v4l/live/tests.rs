use super::super::errors::errno;
use super::super::format::FourCc;
use super::super::simulated::{Event, Simulated};
use super::super::watch::Wait;
use super::*;
use std::path::Path;
use std::time::{Duration, Instant};

const PACE: Duration = Duration::from_millis(5);

fn camera(script: Vec<Event>) -> Simulated {
    let mut camera = Simulated::grey("/dev/video0", script);
    camera.pace = PACE;
    camera
}

fn optics(layout: Layout) -> Optics {
    let format = Format { code: FourCc(*b"GREY"), width: 4, height: 2, stride: 4 };
    Optics { formats: vec![format; 2], layout, swap: false }
}

fn frames(count: u64) -> Vec<Event> {
    (0..count).map(|number| Event::frame(40 * number, number as u8)).collect()
}

/// The first value of each pair that was fetched, the tally, and the error.
fn fetched(script: Vec<Event>, each: Duration, most: usize) -> (Vec<u8>, Tally, Option<String>) {
    let mut pairs = Pairs::of(camera(script), None);
    let mut seen = Vec::new();
    let stop = AtomicBool::new(false);
    let (tally, result) = run(&mut pairs, &optics(Layout::SideBySide), &stop, |live, _| {
        seen.push(live.views.images[0].as_raw()[0]);
        thread::sleep(each);
        if seen.len() < most { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    });
    assert!(stop.load(Ordering::Relaxed));
    (seen, tally, result.err().map(|error| error.to_string()))
}

#[test]
fn a_slow_consumer_gets_the_newest_and_the_rest_is_counted() {
    let (seen, tally, error) = fetched(frames(1000), 10 * PACE, 5);
    assert_eq!((seen.len(), error, tally.fetched), (5, None, 5));
    assert!(tally.dropped >= 10, "{tally:?}");
    // No queue: the last one was taken when the others had long been dropped.
    assert!(seen.windows(2).all(|pair| pair[1] >= pair[0] + 3), "{seen:?}");
}

#[test]
fn a_camera_pulled_out_ends_with_a_sentence_and_soon() {
    let begun = Instant::now();
    let script = [frames(20), vec![Event::Error(errno::ENODEV)]].concat();
    let (seen, tally, error) = fetched(script, Duration::ZERO, 1000);
    assert!(error.is_some_and(|error| error.contains("unplugged")));
    assert!(
        !seen.is_empty() && tally.fetched == seen.len() as u64 && begun.elapsed() < Duration::from_secs(2)
    );
}

#[test]
fn a_camera_that_comes_back_is_gone_on_with() {
    let script = [frames(20), vec![Event::Unplugged(1, "/dev/video4")], frames(200)].concat();
    let mut pairs =
        Pairs::of(camera(script), None).waiting(Wait { most: Duration::from_secs(60), tell: |_| () });
    let mut after = 0;
    let (tally, result) =
        run(&mut pairs, &optics(Layout::SideBySide), &AtomicBool::new(false), |_, tally| {
            after += u32::from(tally.losses.returns == 1);
            if after < 3 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
    assert!(result.is_ok() && tally.fetched > 3, "{tally:?}");
    assert_eq!(pairs.path(), Path::new("/dev/video4"));
}

#[test]
fn stalls_are_survived_and_counted() {
    let script = [frames(3), vec![Event::Stall, Event::Broken], frames(200)].concat();
    let (seen, tally, error) = fetched(script, Duration::ZERO, 10);
    assert_eq!((seen.len(), error), (10, None));
    assert_eq!((tally.losses.stalls, tally.losses.broken), (1, 1));
}

#[test]
fn frames_that_cannot_be_read_are_counted_and_at_last_too_many() {
    let bad = |count| vec![Event::Frame(0, vec![1, 2, 3]); count];
    let (seen, tally, error) = fetched([bad(5), frames(200)].concat(), Duration::ZERO, 3);
    assert_eq!((seen.len(), error), (3, None));
    assert!((1..=5).contains(&tally.unreadable), "{tally:?}");
    let mut pairs = Pairs::of(camera(bad(400)), None);
    let stop = AtomicBool::new(false);
    let take = |_: Live, _: &Tally| ControlFlow::Continue(());
    let (tally, result) = run(&mut pairs, &optics(Layout::SideBySide), &stop, take);
    let error = result.unwrap_err().to_string();
    assert!(error.contains("30 frames in a row") && error.contains("3 of 8 bytes"), "{error}");
    assert_eq!(tally.unreadable, u64::from(MOST_UNREADABLE));
}

#[test]
fn the_eyes_of_two_cameras_are_left_and_right_unless_swapped() {
    for swap in [false, true] {
        let right = vec![Event::frame(3, 9); 50];
        let mut pairs = Pairs::of(camera(vec![Event::frame(0, 1); 50]), Some(camera(right)));
        let mut seen = Vec::new();
        let optics = Optics { swap, ..optics(Layout::Two) };
        let (_, result) = run(&mut pairs, &optics, &AtomicBool::new(false), |live, _| {
            seen.push((live.views.images.map(|image| image.as_raw()[0]), live.gap));
            ControlFlow::Break(())
        });
        assert!(result.is_ok());
        assert_eq!(seen, [(if swap { [9, 1] } else { [1, 9] }, Some(0.003))]);
    }
}

#[test]
fn a_stop_ends_without_error() {
    let stop = AtomicBool::new(false);
    let mut pairs = Pairs::of(camera(frames(1000)), None);
    let (tally, result) = run(&mut pairs, &optics(Layout::SideBySide), &stop, |_, _| {
        stop.store(true, Ordering::Relaxed);
        ControlFlow::Continue(())
    });
    assert!(result.is_ok() && tally.fetched == 1);
}
