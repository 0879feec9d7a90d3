//! Where stereo pairs come from: image files, one or two a pair, and cameras ([`v4l`]).
//!
//! In: what a user names, files, folders or patterns. Out: [`Pair`]s in a fixed order ([`find`]), and the
//! grey images of each ([`Pair::load`]). A pair is two files, or one that holds both views ([`Layout`]).
//! What a user knows about the scene is applied to both views before anything else ([`scene`]).

mod codes;
pub mod exposure;
pub mod find;
mod names;
pub mod picture;
pub mod recording;
pub mod scene;
pub mod v4l;
pub mod serial;

use std::path::{Path, PathBuf};

use image::GrayImage;

use picture::{Loaded, PictureError, check_side, load, load_view};

/// How the views of a pair lie in files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Layout {
    /// Each view in a file of its own.
    Two,
    /// One file: left view in the left half.
    SideBySide,
    /// One file: left view in the upper half.
    TopBottom,
}

impl Layout {
    /// The layout of one file that gives views nearer to 4:3.
    #[must_use]
    pub fn guess(width: u32, height: u32) -> Self {
        let (width, height) = (f64::from(width), f64::from(height));
        let off = |w: f64, h: f64| (w / h / (4.0 / 3.0)).ln().abs();
        if off(width / 2.0, height) <= off(width, height / 2.0) { Self::SideBySide } else { Self::TopBottom }
    }
}

/// The files of a pair.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Files {
    /// Left and right.
    Two([PathBuf; 2]),
    /// Both views in one; without a layout it is guessed from the size.
    One(PathBuf, Option<Layout>),
}

impl Files {
    /// Whether the names say right, then left.
    #[must_use]
    pub fn are_named_in_reverse(&self) -> bool {
        match self {
            Self::Two(files) => files.each_ref().map(|file| names::eye(file)) == [Some(1), Some(0)],
            Self::One(..) => false,
        }
    }
}

/// A pair to be reconstructed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pair {
    /// What results are called after: a relative path whose parts are plain names.
    pub name: String,
    /// Its images.
    pub files: Files,
    /// A calibration that lies beside the images.
    pub calibration: Option<PathBuf>,
}

/// The images of a pair.
#[derive(Clone, Debug)]
pub struct Views {
    /// Left and right, as they stand in the files.
    pub images: [GrayImage; 2],
    /// What the user should know about the files.
    pub warnings: Vec<String>,
}

impl Pair {
    /// Reads the images.
    ///
    /// # Errors
    ///
    /// See [`PictureError`].
    pub fn load(&self) -> Result<Views, PictureError> {
        match &self.files {
            Files::Two([left, right]) => {
                let (left, right) = (load_view(left)?, load_view(right)?);
                let warnings = [left.warnings, right.warnings].concat();
                Ok(Views { images: [left.image, right.image], warnings })
            }
            Files::One(path, layout) => split(path, load(path)?, *layout),
        }
    }
}

/// Cuts an image with both views in two.
fn split(path: &Path, whole: Loaded, layout: Option<Layout>) -> Result<Views, PictureError> {
    let Loaded { image, warnings } = whole;
    let (width, height) = image.dimensions();
    let side_by_side = layout.unwrap_or_else(|| Layout::guess(width, height)) == Layout::SideBySide;
    let images = halves(&image, side_by_side)
        .map_err(|length| PictureError::OddHalves { path: path.into(), length })?;
    check_side(path, &images[0])?;
    Ok(Views { images, warnings })
}

/// The left and the right half of an image, or the upper and the lower one. A side that cannot be halved is
/// an error, px.
fn halves(image: &GrayImage, side_by_side: bool) -> Result<[GrayImage; 2], u32> {
    let (width, height) = image.dimensions();
    let length = if side_by_side { width } else { height };
    if length < 2 || length % 2 != 0 {
        return Err(length);
    }
    let half = length / 2;
    let part = |second: u32| {
        let (x, y, w, h) =
            if side_by_side { (second * half, 0, half, height) } else { (0, second * half, width, half) };
        image::imageops::crop_imm(image, x, y, w, h).to_image()
    };
    Ok([part(0), part(1)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Luma;

    #[test]
    fn halves_are_told_by_their_shape() {
        assert_eq!(Layout::guess(1280, 480), Layout::SideBySide);
        assert_eq!(Layout::guess(640, 960), Layout::TopBottom);
        assert_eq!(Layout::guess(3840, 1080), Layout::SideBySide);
        assert_eq!(Layout::guess(1920, 2160), Layout::TopBottom);
    }

    #[test]
    fn cuts_in_the_middle() {
        let image = GrayImage::from_fn(6, 2, |u, v| Luma([(10 * v + u) as u8]));
        let whole = || Loaded { image: image.clone(), warnings: Vec::new() };
        let views = split(Path::new("a"), whole(), Some(Layout::SideBySide)).unwrap();
        assert_eq!(views.images[1].as_raw(), &[3, 4, 5, 13, 14, 15]);
        let views = split(Path::new("a"), whole(), Some(Layout::TopBottom)).unwrap();
        assert_eq!(views.images[1].as_raw(), &[10, 11, 12, 13, 14, 15]);
        let odd = Loaded { image: GrayImage::new(5, 2), warnings: Vec::new() };
        assert!(split(Path::new("a"), odd, Some(Layout::SideBySide)).is_err());
    }

    #[test]
    fn a_half_may_be_as_long_as_a_view() {
        let side = shared::limits::MAX_SIDE as u32;
        let halves = |side: u32| {
            let whole = Loaded { image: GrayImage::new(2 * side, 1), warnings: Vec::new() };
            split(Path::new("a"), whole, Some(Layout::SideBySide))
        };
        assert!(halves(side).is_ok());
        assert!(matches!(halves(side + 1), Err(PictureError::TooLong { .. })));
    }

    #[test]
    fn order_is_told_by_names() {
        let reverse =
            |left: &str, right: &str| Files::Two([left.into(), right.into()]).are_named_in_reverse();
        assert!(reverse("a/right.png", "a/left.png") && reverse("im1.png", "im0.png"));
        assert!(!reverse("a/left.png", "a/right.png") && !reverse("a.png", "b.png"));
    }
}
