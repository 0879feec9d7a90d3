//! Any bytes as an image file. Images of 257 to 8192 px on a side are left out: they take their time, and no other path
//! than smaller ones. Longer sides are refused by their headers, which is tried.
#![no_main]

use host::source::picture::parse;
use image::ImageReader;
use libfuzzer_sys::fuzz_target;
use std::io::Cursor;
use std::path::Path;

/// Sides that are worth the time; beyond what is read at all, they are refused at once again.
const SLOW: std::ops::RangeInclusive<u32> = 257..=8192;

fuzz_target!(|bytes: &[u8]| {
    let header = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map(ImageReader::into_dimensions);
    let sides = header.ok().and_then(Result::ok);
    if sides.is_some_and(|(width, height)| SLOW.contains(&width.max(height))) {
        return;
    }
    match parse(Path::new("image"), bytes) {
        Ok(loaded) => assert_eq!(Some(loaded.image.dimensions()), sides),
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});
