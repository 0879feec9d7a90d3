//! One image file to grey values.
//!
//! In: PNG, JPEG, PGM/PPM, BMP or TIFF, told apart by content. Out: 8-bit grey values: colours become luma
//! (BT.709), 16-bit values are scaled, and what is transparent lies on black, as the background is unless the
//! user says otherwise. Sizes are held against a limit before any pixel gets memory.
//!
//! Decoders of JPEG go on where bytes are damaged, and half a silhouette looks like an object. So a JPEG is
//! first read strictly, and its codes are held against its header (`codes.rs`); one that fails is refused if it ends too
//! early, and flagged otherwise.

use std::fs;
use std::io::{self, Cursor};
use std::path::{Path, PathBuf};

use super::codes::{self, Fault};
use image::{DynamicImage, GrayImage, ImageError, ImageFormat, ImageReader, Limits, Luma};
use shared::limits::MAX_SIDE;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::options::DecoderOptions;

/// Longest side of a file that holds both views, px.
const MAX_PX: u32 = 2 * MAX_SIDE as u32;
/// Most memory that a decoder may take, bytes: the largest image with four 16-bit channels.
const MAX_ALLOC: u64 = 8 * (MAX_PX as u64) * (MAX_SIDE as u64);
/// Largest file, bytes: an uncompressed image of that size.
const MAX_FILE: u64 = MAX_ALLOC + (1 << 20);
/// What ends a JPEG.
const END_OF_IMAGE: [u8; 2] = [0xff, 0xd9];

/// Why there is no image.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// The system refused.
    #[error("cannot read the image {}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The file is no image of a known kind.
    #[error("{} is no image that can be read; give PNG, JPEG, PGM, BMP or TIFF", path.display())]
    Unknown {
        /// The file.
        path: PathBuf,
    },
    /// The bytes are damaged or end too early.
    #[error("{} is damaged or cut short; copy or record it again", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What the decoder said.
        source: ImageError,
    },
    /// A JPEG without its end.
    #[error("{} is cut short: its end is missing; copy or record it again", path.display())]
    CutShort {
        /// The file.
        path: PathBuf,
    },
    /// The image is larger than is read.
    #[error(
        "{} says that it is larger than is read, which is {MAX_PX} px a side; give smaller images", path.display()
    )]
    TooLarge {
        /// The file.
        path: PathBuf,
    },
    /// A view is larger than the method works on.
    #[error(
        "{} has a view of {width}x{height} px, but at most {MAX_SIDE} px a side are worked on; reduce the image, and \
         the focal lengths and principal points of its calibration by the same factor", path.display()
    )]
    TooLong {
        /// The file.
        path: PathBuf,
        /// Width of the view, px.
        width: u32,
        /// Height of the view, px.
        height: u32,
    },
    /// Both views in one image, but its halves differ.
    #[error(
        "{} has {length} rows or columns, which cannot be halved; check --layout", path.display()
    )]
    OddHalves {
        /// The file.
        path: PathBuf,
        /// The length to be halved, px.
        length: u32,
    },
}

/// An image, and what is suspicious about its file.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// Grey values.
    pub image: GrayImage,
    /// Sentences for the user.
    pub warnings: Vec<String>,
}

/// Reads the image of one view in the file `path`.
///
/// # Errors
///
/// See [`PictureError`].
pub fn load_view(path: &Path) -> Result<Loaded, PictureError> {
    let loaded = load(path)?;
    check_side(path, &loaded.image)?;
    Ok(loaded)
}

/// Whether a view is small enough to be worked on.
pub(super) fn check_side(path: &Path, view: &GrayImage) -> Result<(), PictureError> {
    let (width, height) = view.dimensions();
    if width.max(height) as usize > MAX_SIDE {
        return Err(PictureError::TooLong { path: path.into(), width, height });
    }
    Ok(())
}

/// Reads the image in the file `path`, which may hold both views.
///
/// # Errors
///
/// See [`PictureError`].
pub fn load(path: &Path) -> Result<Loaded, PictureError> {
    let io_error = |source| PictureError::Io { path: path.into(), source };
    if fs::metadata(path).map_err(io_error)?.len() > MAX_FILE {
        return Err(PictureError::TooLarge { path: path.into() });
    }
    parse(path, &fs::read(path).map_err(io_error)?)
}

/// Reads the image in the bytes of a file, which errors call `path`.
///
/// # Errors
///
/// See [`PictureError`].
pub fn parse(path: &Path, bytes: &[u8]) -> Result<Loaded, PictureError> {
    let io_error = |source| PictureError::Io { path: path.into(), source };
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(io_error)?;
    let warning = match reader.format() {
        None => return Err(PictureError::Unknown { path: path.into() }),
        Some(ImageFormat::Jpeg) => jpeg_damage(path, bytes)?,
        Some(_) => None,
    };
    let picture = decode(path, reader)?;
    let mut warnings: Vec<String> = warning.into_iter().chain(dark(path, &picture)).collect();
    let image = if picture.color().has_alpha() {
        let (image, transparent) = on_black(&picture);
        warnings.extend(transparent.then(|| {
            format!("{} is transparent in places, which are taken for black; save it without", path.display())
        }));
        image
    } else {
        picture.into_luma8()
    };
    Ok(Loaded { image, warnings })
}

fn decode(path: &Path, mut reader: ImageReader<Cursor<&[u8]>>) -> Result<DynamicImage, PictureError> {
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_PX);
    limits.max_image_height = Some(MAX_PX);
    limits.max_alloc = Some(MAX_ALLOC);
    reader.limits(limits);
    let path = path.to_path_buf();
    match reader.decode() {
        Ok(image) => Ok(image),
        Err(ImageError::Limits(_)) => Err(PictureError::TooLarge { path }),
        Err(ImageError::Unsupported(_)) => Err(PictureError::Unknown { path }),
        Err(source) => Err(PictureError::Damaged { path, source }),
    }
}

/// Grey values on a black ground, and whether any of it is seen through the image.
fn on_black(picture: &DynamicImage) -> (GrayImage, bool) {
    let picture = picture.to_luma_alpha8();
    let image = GrayImage::from_fn(picture.width(), picture.height(), |u, v| {
        let [grey, alpha] = picture[(u, v)].0.map(u16::from);
        Luma([((grey * alpha + 127) / 255) as u8])
    });
    (image, picture.pixels().any(|pixel| pixel.0[1] < u8::MAX))
}

/// A warning if 16 bits hold the values of 8.
fn dark(path: &Path, picture: &DynamicImage) -> Option<String> {
    let deep = matches!(
        picture,
        DynamicImage::ImageLuma16(_)
            | DynamicImage::ImageLumaA16(_)
            | DynamicImage::ImageRgb16(_)
            | DynamicImage::ImageRgba16(_)
    );
    let brightest = if deep { picture.to_luma16().iter().copied().max()? } else { 0 };
    (1..256).contains(&brightest).then(|| {
        format!(
            "{} has 16 bits a pixel but no value above {brightest}, so that it is black; save its values in 8 bits",
            path.display()
        )
    })
}

/// A warning if a strict decoder stumbles over the file, or its codes do not come out even.
fn jpeg_damage(path: &Path, bytes: &[u8]) -> Result<Option<String>, PictureError> {
    let side = MAX_PX as usize;
    let options = DecoderOptions::default().set_strict_mode(true).set_max_width(side).set_max_height(side);
    let mut decoder = zune_jpeg::JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    if decoder.decode_headers().is_err() {
        // Whether the header is too large or broken, the decoder of all formats will say.
        return Ok(None);
    }
    let (damage, has_end) = match decoder.decode() {
        Err(damage) => (damage.to_string(), false),
        Ok(_) => match codes::fault(bytes) {
            Some(fault) => (fault.to_string(), fault == Fault::LeftOver),
            None => return Ok(None),
        },
    };
    if !has_end && !bytes.windows(2).rev().take(64).any(|end| end == END_OF_IMAGE) {
        return Err(PictureError::CutShort { path: path.into() });
    }
    Ok(Some(format!(
        "{} is a damaged JPEG ({damage}); the outline may be wrong, so record it again, as PNG if possible",
        path.display()
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use allocation_counter::measure;
    use image::codecs::jpeg::JpegEncoder;
    use image::{ImageBuffer, Rgba, RgbaImage};

    const FORMATS: [ImageFormat; 5] =
        [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::Pnm, ImageFormat::Bmp, ImageFormat::Tiff];

    fn bytes_of(image: &DynamicImage, format: ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    fn told(name: &str, bytes: &[u8]) -> Result<Loaded, PictureError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        load(&path)
    }

    /// Of some blocks of a JPEG, and no two pixels alike in a row.
    fn small() -> DynamicImage {
        GrayImage::from_fn(24, 16, |u, v| Luma([(u * 9 + v * 3) as u8])).into()
    }

    #[test]
    fn sixteen_bits_are_scaled() {
        let deep: ImageBuffer<Luma<u16>, Vec<u16>> = ImageBuffer::from_pixel(4, 3, Luma([0x80_80]));
        let loaded = told("deep.png", &bytes_of(&deep.into(), ImageFormat::Png)).unwrap();
        assert_eq!(loaded.image, GrayImage::from_pixel(4, 3, Luma([0x80])));
        assert!(loaded.warnings.is_empty());
        let dark: ImageBuffer<Luma<u16>, Vec<u16>> = ImageBuffer::from_pixel(4, 3, Luma([200]));
        let loaded = told("dark.png", &bytes_of(&dark.into(), ImageFormat::Png)).unwrap();
        assert!(loaded.warnings[0].contains("no value above 200"), "{:?}", loaded.warnings);
    }

    #[test]
    fn what_is_transparent_lies_on_black() {
        let mut cut_out = RgbaImage::from_pixel(2, 1, Rgba([255, 255, 255, 0]));
        cut_out.put_pixel(1, 0, Rgba([200, 200, 200, 255]));
        let loaded = told("cut-out.png", &bytes_of(&cut_out.into(), ImageFormat::Png)).unwrap();
        assert_eq!(loaded.image.as_raw(), &[0, 200]);
        assert!(loaded.warnings[0].contains("transparent"), "{:?}", loaded.warnings);
        let opaque = RgbaImage::from_pixel(2, 1, Rgba([90, 90, 90, 255]));
        let loaded = told("opaque.png", &bytes_of(&opaque.into(), ImageFormat::Png)).unwrap();
        assert_eq!((loaded.image.as_raw().as_slice(), loaded.warnings.len()), (&[90, 90][..], 0));
    }

    #[test]
    fn a_view_that_is_too_long_says_so() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("long.png");
        GrayImage::new(MAX_SIDE as u32 + 1, 2).save(&path).unwrap();
        let error = load_view(&path).unwrap_err().to_string();
        assert!(error.contains("4097x2 px") && error.contains("reduce the image"), "{error}");
    }

    #[test]
    fn a_file_cut_short_at_any_length_is_refused_unless_every_pixel_is_there() {
        for format in FORMATS {
            let whole = bytes_of(&small(), format);
            let image = told("whole", &whole).unwrap().image;
            let accepted: Vec<usize> = (0..whole.len())
                .filter(|&length| match told("cut", &whole[..length]) {
                    Ok(cut) => {
                        assert!(cut.image == image, "{format:?}: {length} of {} bytes", whole.len());
                        true
                    }
                    Err(_) => false,
                })
                .map(|length| whole.len() - length)
                .collect();
            // Of a PNG and a TIFF, what comes after the pixels may be missing, and of no other.
            let is_short = |missing: usize| match format {
                ImageFormat::Png | ImageFormat::Tiff => missing < 30,
                _ => false,
            };
            assert!(
                accepted.iter().all(|&missing| is_short(missing)),
                "{format:?}: without {accepted:?} bytes"
            );
        }
    }

    /// A photograph of a disc, as it were: grey levels change everywhere.
    fn photograph() -> Vec<u8> {
        let image = GrayImage::from_fn(320, 240, |u, v| {
            let inside = (u as i32 - 160).pow(2) + (v as i32 - 120).pow(2) < 6000;
            Luma([if inside { 120 + (u * 7 + v * 13) as u8 % 60 } else { 12 + (u * 5 + v * 3) as u8 % 4 }])
        });
        let mut bytes = Vec::new();
        image.write_with_encoder(JpegEncoder::new_with_quality(&mut bytes, 90)).unwrap();
        bytes
    }

    fn scan_of(bytes: &[u8]) -> usize {
        bytes.windows(2).position(|marker| marker == [0xff, 0xda]).unwrap() + 10
    }

    #[test]
    fn a_damaged_jpeg_is_flagged() {
        let whole = photograph();
        assert!(told("whole.jpg", &whole).unwrap().warnings.is_empty());
        let scan = scan_of(&whole);
        let middle = (scan + whole.len()) / 2;
        let mut marked = whole.clone();
        marked[middle..middle + 2].copy_from_slice(&[0xff, 0xd3]);
        let mut missing = whole.clone();
        missing.drain(middle..middle + 40);
        let mut twice = whole.clone();
        twice.splice(middle..middle, whole[middle - 40..middle].iter().copied());
        for (what, bytes) in [("marked", marked), ("missing", missing), ("twice", twice)] {
            let loaded = told("damaged.jpg", &bytes).unwrap();
            assert!(
                loaded.warnings[0].contains("damaged.jpg is a damaged JPEG"),
                "{what}: {:?}",
                loaded.warnings
            );
        }
    }

    #[test]
    fn a_jpeg_without_its_end_or_its_tables_is_refused() {
        let whole = photograph();
        for missing in 1..200 {
            let cut = told("cut.jpg", &whole[..whole.len() - missing]);
            assert!(matches!(cut, Err(PictureError::CutShort { .. })), "{missing}: {cut:?}");
        }
        // Filling before the end, and much behind it, as cameras write it.
        let end = whole.len() - 2;
        let filled = [&whole[..end], &[0; 8], &whole[end..], &[0; 500]].concat();
        assert!(told("filled.jpg", &filled).is_ok());
        let mut untold = whole;
        let table = untold.windows(2).position(|marker| marker == [0xff, 0xc4]).unwrap();
        untold[table + 4] = 0x77;
        assert!(matches!(told("untold.jpg", &untold), Err(PictureError::Damaged { .. })));
    }

    /// The figures of docs/capture.md: `cargo test -p host --lib of_changed_bytes -- --nocapture`.
    #[test]
    fn of_changed_bytes_in_a_jpeg_most_are_noticed() {
        let whole = photograph();
        let (scan, end) = (scan_of(&whole), whole.len() - 2);
        let (mut refused, mut flagged, mut silent) = (0, 0, 0);
        let mut random = Random::new(7);
        for _ in 0..500 {
            let mut bytes = whole.clone();
            let at = scan + random.bits() as usize % (end - scan);
            bytes[at] ^= 1 + (random.bits() % 255) as u8;
            match parse(Path::new("changed.jpg"), &bytes) {
                Err(_) => refused += 1,
                Ok(loaded) if loaded.warnings.is_empty() => silent += 1,
                Ok(_) => flagged += 1,
            }
        }
        println!(
            "{} bytes: of 500 changed {flagged} flagged, {refused} refused, {silent} not noticed",
            whole.len()
        );
        assert!(flagged + refused > silent, "more than half");
    }

    /// The check sum of a PNG's chunk.
    fn crc(bytes: &[u8]) -> u32 {
        let step = |crc: u32, _| (crc >> 1) ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 };
        !bytes.iter().fold(!0, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), step))
    }

    /// A small file whose header says 60000 x 60000.
    fn huge(format: ImageFormat) -> Vec<u8> {
        const SIDE: u32 = 60_000;
        let mut bytes = bytes_of(&small(), format);
        match format {
            ImageFormat::Pnm => return b"P5 60000 60000 255\n".to_vec(),
            ImageFormat::Png => {
                bytes[16..24].copy_from_slice([SIDE; 2].map(u32::to_be_bytes).as_flattened());
                let crc = crc(&bytes[12..29]);
                bytes[29..33].copy_from_slice(&crc.to_be_bytes());
            }
            ImageFormat::Bmp => {
                bytes[18..26].copy_from_slice([SIDE; 2].map(u32::to_le_bytes).as_flattened());
            }
            ImageFormat::Jpeg => {
                let frame = bytes.windows(2).position(|marker| marker == [0xff, 0xc0]).unwrap();
                bytes[frame + 5..frame + 9]
                    .copy_from_slice([SIDE as u16; 2].map(u16::to_be_bytes).as_flattened());
            }
            ImageFormat::Tiff => {
                // Entries of the directory: tag u16, type u16, count u32, value u32. Of width, height, and rows together.
                let entries = u32::from_le_bytes(bytes[4..8].try_into().unwrap()) as usize + 2;
                for entry in bytes[entries..].chunks_mut(12) {
                    if let [0 | 1 | 0x16, 1, kind, 0, 1, 0, 0, 0, ..] = entry {
                        *kind = 4;
                        entry[8..12].copy_from_slice(&SIDE.to_le_bytes());
                    }
                }
            }
            _ => unreachable!(),
        }
        bytes
    }

    #[test]
    fn huge_headers_are_refused_before_memory_is_taken() {
        for format in FORMATS {
            let bytes = huge(format);
            let path = Path::new("huge");
            // What a decoder keeps once for all is not the file's.
            assert!(parse(path, &bytes_of(&small(), format)).is_ok());
            let mut refused = None;
            let memory = measure(|| refused = parse(path, &bytes).err());
            assert!(matches!(refused, Some(PictureError::TooLarge { .. })), "{format:?}: {refused:?}");
            assert!(memory.bytes_max < 1 << 20, "{format:?}: {} bytes", memory.bytes_max);
        }
    }

    #[test]
    fn what_is_no_image_is_named() {
        let error = told("notes.png", b"hello").unwrap_err();
        assert!(error.to_string().contains("notes.png is no image"), "{error}");
    }
}
