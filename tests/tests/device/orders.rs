//! What is ordered of a device is answered and kept.

use super::*;

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
