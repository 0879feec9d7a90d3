//! Any text, or two with a NUL between, as a calibration: what is read can be used, and, where OpenCV's keys can
//! say it, is written to text that gives the same bits again.
#![no_main]

use host::calibration::{CalibrationError, StereoCamera};
use libfuzzer_sys::fuzz_target;
use nalgebra::Point2;

fuzz_target!(|text: &str| {
    let read = match text.split_once('\0') {
        Some((first, second)) => StereoCamera::parse_two(first, second),
        None => StereoCamera::parse(text),
    };
    match read {
        Ok(pair) => {
            assert!(pair.check().is_ok());
            let numbers = pair.rotation.iter().chain(pair.translation.iter());
            assert!(numbers.copied().all(f64::is_finite));
            for eye in [&pair.left, &pair.right] {
                let _ = eye.pixel_of(Point2::new(0.1, -0.2));
                let _ = eye.ray_of(Point2::new(0.0, f64::from(eye.height)));
            }
            match pair.opencv_yaml() {
                Ok(text) => assert_eq!(StereoCamera::parse(&text).expect("what was written"), pair),
                Err(error) => assert!(matches!(error, CalibrationError::Inexpressible { .. })),
            }
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});
