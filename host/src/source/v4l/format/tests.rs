//! Frames of two by two or four by two pixels, written by hand as the kernel's documentation draws them.

use super::*;
use image::{ImageFormat, Luma};
use std::io::Cursor;

fn format(code: &str, width: u32, height: u32, stride: u32) -> Format {
    Format { code: code.parse().unwrap(), width, height, stride }
}

/// The grey values of each image.
fn greys(bytes: &[u8], format: &Format, interleaved: bool) -> Vec<Vec<u8>> {
    let images = decode(bytes, format, interleaved).unwrap().images;
    assert!(images.iter().all(|image| image.dimensions() == (format.width, format.height)));
    images.into_iter().map(GrayImage::into_raw).collect()
}

#[test]
fn grey_planes_are_taken_as_they_are() {
    assert_eq!(greys(&[1, 2, 3, 4], &format("GREY", 2, 2, 2), false), [[1, 2, 3, 4]]);
    // A row of colours after the plane.
    assert_eq!(greys(&[1, 2, 3, 4, 128, 128], &format("NV12", 2, 2, 2), false), [[1, 2, 3, 4]]);
}

#[test]
fn deep_values_keep_their_upper_eight_bits() {
    // 0x3ff, 0x200, 0x0ff, 0: of 10 bits.
    let ten = [0xff, 0x03, 0x00, 0x02, 0xff, 0x00, 0x00, 0x00];
    assert_eq!(greys(&ten, &format("Y10", 2, 2, 4), false), [[0xff, 0x80, 0x3f, 0]]);
    // 0xfff, 0x123, 0x00f, 0x010: of 12.
    let twelve = [0xff, 0x0f, 0x23, 0x01, 0x0f, 0x00, 0x10, 0x00];
    assert_eq!(greys(&twelve, &format("Y12", 2, 2, 4), false), [[0xff, 0x12, 0, 1]]);
    // 0xffff, 0x1234, 0x00ff, 0x0100: of 16.
    let sixteen = [0xff, 0xff, 0x34, 0x12, 0xff, 0x00, 0x00, 0x01];
    assert_eq!(greys(&sixteen, &format("Y16", 2, 2, 4), false), [[0xff, 0x12, 0, 1]]);
    // A value with more bits than it should have is white, not dark.
    assert_eq!(greys(&[0, 4, 0, 0, 0, 0, 0, 0], &format("Y10", 2, 2, 4), false), [[0xff, 0, 0, 0]]);
}

#[test]
fn colours_between_grey_bytes_are_passed_over() {
    // Y0 U Y1 V
    let yuyv = [1, 99, 2, 98, 3, 97, 4, 96];
    assert_eq!(greys(&yuyv, &format("YUYV", 2, 2, 4), false), [[1, 2, 3, 4]]);
    // U Y0 V Y1
    let uyvy = [99, 1, 98, 2, 97, 3, 96, 4];
    assert_eq!(greys(&uyvy, &format("UYVY", 2, 2, 4), false), [[1, 2, 3, 4]]);
}

#[test]
fn interleaved_eyes_are_parted() {
    let bytes = [1, 11, 2, 12, 3, 13, 4, 14];
    let eyes = [[1, 2, 3, 4], [11, 12, 13, 14]];
    assert_eq!(greys(&bytes, &format("Y8I", 2, 2, 4), true), eyes);
    assert_eq!(greys(&bytes, &format("Y8I", 2, 2, 4), false), eyes);
    // A camera that calls the same bytes YUYV.
    assert_eq!(greys(&bytes, &format("YUYV", 2, 2, 4), true), eyes);
    // Left 0x123 and right 0xabc: low byte of the left; its high bits below the low bits of the right; high byte
    // of the right.
    let packed = [0x23, 0xc1, 0xab, 0xff, 0x0f, 0x00];
    assert_eq!(greys(&packed, &format("Y12I", 2, 1, 6), true), [[0x12, 0xff], [0xab, 0x00]]);
}

#[test]
fn a_mosaic_of_one_grey_is_that_grey_in_any_order() {
    for code in ["BA81", "GBRG", "GRBG", "RGGB"] {
        assert_eq!(greys(&[77; 8], &format(code, 4, 2, 4), false), [[77; 8]]);
    }
}

#[test]
fn a_mosaic_weighs_red_green_and_blue_as_one_two_one() {
    // Blue 0, green 100, red 200: (0 + 2 * 100 + 200) / 4 at every pixel, whatever colour stands there.
    let bggr = [0, 100, 0, 100, 100, 200, 100, 200, 0, 100, 0, 100, 100, 200, 100, 200];
    assert_eq!(greys(&bggr, &format("BA81", 4, 4, 4), false), [[100; 16]]);
    let rggb = [200, 40, 200, 40, 40, 0, 40, 0, 200, 40, 200, 40, 40, 0, 40, 0];
    assert_eq!(greys(&rggb, &format("RGGB", 4, 4, 4), false), [[70; 16]]);
}

#[test]
fn rows_are_found_by_the_stride() {
    let padded = [1, 2, 0, 0, 3, 4, 0, 0];
    assert_eq!(greys(&padded, &format("GREY", 2, 2, 4), false), [[1, 2, 3, 4]]);
    // The last row may lack its padding; a stride of 0 means none.
    assert_eq!(greys(&padded[..6], &format("GREY", 2, 2, 4), false), [[1, 2, 3, 4]]);
    assert_eq!(greys(&[1, 2, 3, 4], &format("GREY", 2, 2, 0), false), [[1, 2, 3, 4]]);
    let yuyv = [1, 0, 2, 0, 9, 9, 3, 0, 4, 0, 9, 9];
    assert_eq!(greys(&yuyv, &format("YUYV", 2, 2, 6), false), [[1, 2, 3, 4]]);
}

#[test]
fn what_is_too_short_or_too_narrow_or_unknown_is_refused() {
    let short = decode(&[1, 2, 3], &format("GREY", 2, 2, 2), false);
    assert_eq!(short, Err(FormatError::Short { got: 3, wanted: 4 }));
    let narrow = decode(&[1; 8], &format("YUYV", 2, 2, 3), false);
    assert_eq!(narrow, Err(FormatError::Stride { stride: 3, wanted: 4 }));
    assert!(matches!(decode(&[], &format("H264", 2, 2, 0), false), Err(FormatError::Unknown(_))));
    for (code, _) in FORMATS {
        let format = Format { code, width: 4, height: 2, stride: 0 };
        for length in 0..8 {
            assert!(decode(&vec![0xff; length], &format, false).is_err(), "{code} of {length} bytes");
        }
    }
}

fn disc() -> GrayImage {
    GrayImage::from_fn(64, 48, |u, v| {
        let inside = (u as i32 - 30).pow(2) + (v as i32 - 20).pow(2) < 200;
        Luma([if inside { 200 } else { 20 }])
    })
}

fn jpeg_of(image: &GrayImage) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    // In colour, as cameras have it.
    let colour = image::DynamicImage::from(image.clone()).into_rgb8();
    colour.write_to(&mut bytes, ImageFormat::Jpeg).unwrap();
    bytes.into_inner()
}

/// Without the segments that define codes.
fn without_tables(bytes: &[u8]) -> Vec<u8> {
    let (mut left, mut at) = (bytes[..2].to_vec(), 2);
    while bytes[at + 1] != SCAN[1] {
        let length = 2 + usize::from(u16::from_be_bytes([bytes[at + 2], bytes[at + 3]]));
        if bytes[at + 1] != TABLES[1] {
            left.extend(&bytes[at..at + length]);
        }
        at += length;
    }
    left.extend(&bytes[at..]);
    left
}

#[test]
fn a_jpeg_is_read_with_tables_and_without_and_with_padding() {
    let bytes = jpeg_of(&disc());
    let format = format("MJPG", 64, 48, 0);
    let whole = decode(&bytes, &format, false).unwrap();
    assert_eq!(whole.damage, None);
    let off = whole.images[0].iter().zip(disc().iter()).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    assert!(off < 60, "{off}");
    let bare = without_tables(&bytes);
    assert!(bare.len() < bytes.len() - 100);
    assert_eq!(decode(&bare, &format, false).unwrap(), whole);
    let padded = [bytes.as_slice(), &[0; 500]].concat();
    assert_eq!(decode(&padded, &format, false).unwrap(), whole);
}

#[test]
fn a_jpeg_that_is_cut_or_has_no_sense_is_refused() {
    let bytes = jpeg_of(&disc());
    let format = format("MJPG", 64, 48, 0);
    for part in [0, 1, 2, 10, 50, 90, 99] {
        assert!(decode(&bytes[..bytes.len() * part / 100], &format, false).is_err(), "{part} %");
    }
    let mut marked = bytes.clone();
    let middle = bytes.len() - 120;
    marked[middle..middle + 2].copy_from_slice(&TABLES);
    assert!(matches!(decode(&marked, &format, false), Err(FormatError::Jpeg(_))));
    assert!(decode(&jpeg_of(&GrayImage::new(32, 48)), &format, false).is_err());
}

#[test]
fn a_jpeg_of_which_something_is_missing_is_flagged_and_one_that_is_filled_up_is_not() {
    let whole = jpeg_of(&disc());
    let format = format("MJPG", 64, 48, 0);
    let end = whole.len() - END.len();
    let mut missing = whole.clone();
    missing.drain(end - 140..end);
    let mut ended = whole.clone();
    ended[end - 140..end - 138].copy_from_slice(&END);
    let mut restarted = whole.clone();
    restarted[end - 140..end - 138].copy_from_slice(&[0xff, 0xd3]);
    for (what, bytes) in [("missing", missing), ("ended", ended), ("restarted", restarted)] {
        for bytes in [&bytes, &without_tables(&bytes)] {
            let decoded = decode(bytes, &format, false).unwrap();
            assert_eq!(decoded.damage.as_deref(), Some("its codes end too early or mean nothing"), "{what}");
        }
    }
    let mut filled = whole;
    filled.splice(end..end, [0; 8]);
    assert_eq!(decode(&filled, &format, false).unwrap().damage, None);
}

#[test]
fn four_characters_are_padded_and_shown_without() {
    let code: FourCc = "y10".parse().unwrap();
    assert_eq!((code, code.to_string().as_str()), (FourCc(*b"Y10 "), "Y10"));
    assert!(
        "".parse::<FourCc>().is_err() && "MJPEG".parse::<FourCc>().is_err() && "é".parse::<FourCc>().is_err()
    );
}
