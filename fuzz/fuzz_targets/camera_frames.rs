//! Any bytes as a frame of a camera that is set to any format and a size of at most 255 px: images have that size, and
//! grey values that stand by themselves are copied.
#![no_main]

use host::source::v4l::format::{FORMATS, Format, decode};
use libfuzzer_sys::fuzz_target;

/// Bytes of a pixel, and where among them the grey value of each eye stands; nothing where it must be reckoned.
fn plain(code: [u8; 4], interleaved: bool) -> Option<(usize, &'static [usize])> {
    match &code {
        b"GREY" | b"NV12" => Some((1, &[0])),
        b"Y8I " => Some((2, &[0, 1])),
        b"YUYV" if interleaved => Some((2, &[0, 1])),
        b"YUYV" => Some((2, &[0])),
        b"UYVY" => Some((2, &[1])),
        _ => None,
    }
}

fuzz_target!(|bytes: &[u8]| {
    let Some((&[choice, width, height, stride], frame)) = bytes.split_first_chunk() else { return };
    let (code, pixels) = FORMATS[usize::from(choice) % FORMATS.len()];
    let interleaved = choice >= 128;
    let (width, height, stride) = (u32::from(width), u32::from(height), 4 * u32::from(stride));
    let decoded = match decode(frame, &Format { code, width, height, stride }, interleaved) {
        Ok(decoded) => decoded,
        Err(error) => return assert!(!error.to_string().is_empty()),
    };
    let plain = plain(code.0, interleaved);
    let eyes = plain.map_or(1 + usize::from(pixels.interleaves()), |(_, places)| places.len());
    assert_eq!(decoded.images.len(), eyes);
    assert!(decoded.images.iter().all(|image| image.dimensions() == (width, height)));
    let Some((step, places)) = plain else { return };
    let stride = if stride == 0 { step * width as usize } else { stride as usize };
    for (image, place) in decoded.images.iter().zip(places) {
        for (u, v, grey) in image.enumerate_pixels() {
            assert_eq!(grey.0[0], frame[v as usize * stride + u as usize * step + place]);
        }
    }
});
