//! A camera's bytes to 8-bit grey values.
//!
//! In: the bytes of one frame, as many as the driver filled, and its [`Format`]: pixel format, size, and the
//! bytes from row to row, which drivers pad. Out: one grey image, or two where the format interleaves the
//! eyes. Cost: one pass; MJPG as much as its decoder.
//!
//! | four characters | what | grey value |
//! |---|---|---|
//! | `GREY`, `NV12` | 8 bits a pixel; what follows the grey plane is colour | itself |
//! | `Y10 `, `Y12 `, `Y16 ` | 16 bits a pixel, little-endian, values right-aligned | the upper 8 of its 10, 12 or 16 bits |
//! | `YUYV`, `UYVY` | grey and colour bytes in turn | the grey byte |
//! | `MJPG` | a JPEG a frame, often without its Huffman tables | that of the JPEG |
//! | `BA81`, `GBRG`, `GRBG`, `RGGB` | one colour a pixel, in squares of four | red, green twice and blue, averaged around it |
//! | `Y8I ` | a byte of the left eye, one of the right | itself |
//! | `Y12I` | three bytes hold 12 bits of the left eye, then 12 of the right | the upper 8 |
//!
//! Deep values lose their lowest bits, as they do in a 16-bit image file: the core works on 8.

use std::fmt;
use std::str::FromStr;

use crate::source::codes::{self, Fault};
use image::GrayImage;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// The four characters by which Video4Linux calls a pixel format.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct FourCc(pub [u8; 4]);

impl fmt::Display for FourCc {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        // The kernel marks big-endian values by the highest bit of the last character.
        let [a, b, c, d] = self.0;
        let plain = [a, b, c, d & 0x7f];
        write!(out, "{}", String::from_utf8_lossy(&plain).trim_end())?;
        if d == d & 0x7f { Ok(()) } else { out.write_str("-BE") }
    }
}

impl fmt::Debug for FourCc {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, out)
    }
}

impl FromStr for FourCc {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut code = *b"    ";
        if text.is_empty() || text.len() > code.len() || !text.is_ascii() {
            return Err("give the four characters of a pixel format, such as MJPG or YUYV".into());
        }
        code[..text.len()].copy_from_slice(text.to_ascii_uppercase().as_bytes());
        Ok(Self(code))
    }
}

/// A pixel format that is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PixelFormat {
    /// A plane of bytes, colours behind it or none.
    Plane,
    /// So many bits in 16, right-aligned.
    Deep(u32),
    /// Grey at the first byte of two.
    Yuyv,
    /// Grey at the second byte of two.
    Uyvy,
    /// JPEG.
    Mjpg,
    /// One colour a pixel.
    Bayer,
    /// Left and right bytes in turn.
    Y8i,
    /// Left and right 12 bits in turn.
    Y12i,
}

/// The formats that are read, the one that costs least first.
pub const FORMATS: [(FourCc, PixelFormat); 15] = [
    (FourCc(*b"GREY"), PixelFormat::Plane),
    (FourCc(*b"Y8I "), PixelFormat::Y8i),
    (FourCc(*b"NV12"), PixelFormat::Plane),
    (FourCc(*b"YUYV"), PixelFormat::Yuyv),
    (FourCc(*b"UYVY"), PixelFormat::Uyvy),
    (FourCc(*b"Y10 "), PixelFormat::Deep(10)),
    (FourCc(*b"Y12 "), PixelFormat::Deep(12)),
    (FourCc(*b"Y16 "), PixelFormat::Deep(16)),
    (FourCc(*b"Y12I"), PixelFormat::Y12i),
    (FourCc(*b"MJPG"), PixelFormat::Mjpg),
    (FourCc(*b"JPEG"), PixelFormat::Mjpg),
    (FourCc(*b"BA81"), PixelFormat::Bayer),
    (FourCc(*b"GBRG"), PixelFormat::Bayer),
    (FourCc(*b"GRBG"), PixelFormat::Bayer),
    (FourCc(*b"RGGB"), PixelFormat::Bayer),
];

impl PixelFormat {
    /// The format of this name, if it is read.
    #[must_use]
    pub fn of(code: FourCc) -> Option<Self> {
        FORMATS.iter().find(|(name, _)| *name == code).map(|(_, format)| *format)
    }

    /// Whether a frame interleaves both eyes.
    #[must_use]
    pub fn interleaves(self) -> bool {
        matches!(self, Self::Y8i | Self::Y12i)
    }

    /// Bytes of a row without padding; nothing for what is compressed.
    fn row(self, width: usize) -> Option<usize> {
        match self {
            Self::Plane | Self::Bayer => Some(width),
            Self::Deep(_) | Self::Yuyv | Self::Uyvy | Self::Y8i => Some(2 * width),
            Self::Y12i => Some(3 * width),
            Self::Mjpg => None,
        }
    }
}

/// How the frames of a device look.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Format {
    /// Pixel format.
    pub code: FourCc,
    /// Width, px.
    pub width: u32,
    /// Height, px.
    pub height: u32,
    /// Bytes from one row to the next; 0 if they are not padded.
    pub stride: u32,
}

/// Why a frame gives no image.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FormatError {
    /// Not a format of the table.
    #[error("the pixel format {0} is not read")]
    Unknown(FourCc),
    /// Fewer bytes than rows need.
    #[error("the frame ended after {got} of {wanted} bytes")]
    Short {
        /// Bytes that came.
        got: usize,
        /// Bytes that the size needs.
        wanted: usize,
    },
    /// Rows overlap.
    #[error("rows of {wanted} bytes cannot follow each other every {stride}")]
    Stride {
        /// Bytes from row to row.
        stride: usize,
        /// Bytes of a row.
        wanted: usize,
    },
    /// No JPEG.
    #[error("the frame is no JPEG that can be read ({0})")]
    Jpeg(String),
    /// A JPEG of another size.
    #[error("the frame holds {0}x{1} px, which is not what the camera was set to")]
    Size(u32, u32),
}

/// What a frame shows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Decoded {
    /// One image, or left and right where the format interleaves them.
    pub images: Vec<GrayImage>,
    /// What a strict decoder stumbled over.
    pub damage: Option<String>,
}

/// The grey values of a frame. `interleaved` takes the two bytes of a `YUYV` pixel for the two eyes, as
/// cameras have it that hide behind this name.
///
/// # Errors
///
/// See [`FormatError`].
pub fn decode(bytes: &[u8], format: &Format, interleaved: bool) -> Result<Decoded, FormatError> {
    let pixels = PixelFormat::of(format.code).ok_or(FormatError::Unknown(format.code))?;
    let pixels = if interleaved && pixels == PixelFormat::Yuyv { PixelFormat::Y8i } else { pixels };
    let Some(wanted) = pixels.row(format.width as usize) else { return jpeg(bytes, format) };
    let rows = rows(bytes, format, wanted)?;
    let each = |pick: &dyn Fn(&[u8]) -> Vec<u8>| {
        let values = rows.iter().flat_map(|row| pick(row)).collect();
        // As many values as pixels, by construction.
        GrayImage::from_raw(format.width, format.height, values).unwrap_or_default()
    };
    let every = |step: usize, at: usize| each(&|row| row.iter().skip(at).step_by(step).copied().collect());
    let images = match pixels {
        PixelFormat::Plane => vec![every(1, 0)],
        PixelFormat::Yuyv => vec![every(2, 0)],
        PixelFormat::Uyvy => vec![every(2, 1)],
        PixelFormat::Y8i => vec![every(2, 0), every(2, 1)],
        PixelFormat::Deep(bits) => {
            vec![each(&|row| row.as_chunks().0.iter().map(|v| upper(*v, bits)).collect())]
        }
        // Twelve bits: the first byte has the lower eight of the left value, the third the upper of the right.
        PixelFormat::Y12i => {
            vec![each(&|row| row.chunks_exact(3).map(|c| (c[1] << 4) | (c[0] >> 4)).collect()), every(3, 2)]
        }
        PixelFormat::Bayer => vec![bayer(&every(1, 0))],
        PixelFormat::Mjpg => Vec::new(),
    };
    Ok(Decoded { images, damage: None })
}

/// The upper eight of the lowest `bits` bits.
fn upper(bytes: [u8; 2], bits: u32) -> u8 {
    u8::try_from(u16::from_le_bytes(bytes) >> (bits - 8)).unwrap_or(u8::MAX)
}

/// The rows of a frame without their padding; the last row may come without it.
fn rows<'a>(bytes: &'a [u8], format: &Format, wanted: usize) -> Result<Vec<&'a [u8]>, FormatError> {
    let stride = if format.stride == 0 { wanted } else { format.stride as usize };
    if stride < wanted {
        return Err(FormatError::Stride { stride, wanted });
    }
    let all = (format.height as usize).saturating_sub(1) * stride + wanted;
    let row = |v: usize| bytes.get(v * stride..v * stride + wanted);
    let rows: Option<Vec<_>> = (0..format.height as usize).map(row).collect();
    rows.ok_or(FormatError::Short { got: bytes.len(), wanted: all })
}

/// Grey of a mosaic: weights 1 2 1 along rows and columns hold red : green : blue as 1 : 2 : 1 wherever they
/// stand, so the order of the colours does not matter. At the border the mosaic is mirrored, which keeps it.
fn bayer(mosaic: &GrayImage) -> GrayImage {
    let (width, height) = mosaic.dimensions();
    let (values, stride) = (mosaic.as_raw(), width as usize);
    let mirrored = |at: u32, off: i64, side: u32| {
        let last = i64::from(side) - 1;
        let place = (i64::from(at) + off).abs();
        (if place > last { 2 * last - place } else { place }).max(0) as usize
    };
    GrayImage::from_fn(width, height, |u, v| {
        let mut sum = 8;
        for (dv, down) in [(-1, 1), (0, 2), (1, 1)] {
            let row = mirrored(v, dv, height) * stride;
            for (du, across) in [(-1, 1), (0, 2), (1, 1)] {
                sum += down * across * u32::from(values[row + mirrored(u, du, width)]);
            }
        }
        image::Luma([(sum / 16) as u8])
    })
}

/// Segments of a JPEG: where its tables of codes start, its scan, and an empty segment by which the decoder
/// takes the usual tables for those that are missing.
const TABLES: [u8; 2] = [0xff, 0xc4];
const SCAN: [u8; 2] = [0xff, 0xda];
const USUAL_TABLES: [u8; 9] = *b"\xff\xe0\x00\x07AVI1\0";

/// What ends a JPEG; cameras pad behind it.
const END: [u8; 2] = [0xff, 0xd9];

fn jpeg(bytes: &[u8], format: &Format) -> Result<Decoded, FormatError> {
    // Decoders fill what is missing, and half a silhouette looks like an object.
    if !bytes.windows(2).any(|pair| pair == END) {
        return Err(FormatError::Jpeg("its end is missing".into()));
    }
    let head = bytes.windows(2).position(|pair| pair == SCAN).map_or(bytes, |scan| &bytes[..scan]);
    let completed;
    let bytes = if head.windows(2).any(|pair| pair == TABLES) || bytes.len() < 2 {
        bytes
    } else {
        completed = [&bytes[..2], &USUAL_TABLES, &bytes[2..]].concat();
        &completed
    };
    let (values, damage) = match decoder(bytes, format, true).decode() {
        // What follows the last block may be a camera's filling.
        Ok(values) => {
            let fault = codes::fault(bytes).filter(|fault| *fault != Fault::LeftOver);
            (values, fault.map(|fault| fault.to_string()))
        }
        Err(damage) => {
            let values = decoder(bytes, format, false).decode();
            (values.map_err(|error| FormatError::Jpeg(error.to_string()))?, Some(damage.to_string()))
        }
    };
    let mut headers = decoder(bytes, format, false);
    headers.decode_headers().map_err(|error| FormatError::Jpeg(error.to_string()))?;
    let (width, height) =
        headers.info().map_or((0, 0), |info| (u32::from(info.width), u32::from(info.height)));
    if (width, height) != (format.width, format.height) {
        return Err(FormatError::Size(width, height));
    }
    let wanted = width as usize * height as usize;
    let got = values.len();
    let image = GrayImage::from_raw(width, height, values).ok_or(FormatError::Short { got, wanted })?;
    Ok(Decoded { images: vec![image], damage })
}

fn decoder<'a>(bytes: &'a [u8], format: &Format, strict: bool) -> JpegDecoder<ZCursor<&'a [u8]>> {
    let options = DecoderOptions::default()
        .set_strict_mode(strict)
        .set_max_width(format.width as usize)
        .set_max_height(format.height as usize)
        .jpeg_set_out_colorspace(ColorSpace::Luma);
    JpegDecoder::new_with_options(ZCursor::new(bytes), options)
}

#[cfg(test)]
mod tests;
