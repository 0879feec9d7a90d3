//! How the two eyes lie in what a camera sends.
//!
//! In: decoded frames. Out: left and right view. A guess is made from the format and the shape of a frame
//! alone: no single camera is wider than 2.3 or narrower than 1.1 times its height.

use image::GrayImage;

use super::super::halves;
use super::format::{FourCc, PixelFormat};

/// Shapes (width over height) of frames that hold one view.
const ONE_VIEW: std::ops::Range<f64> = 1.1..2.3;

/// Where the eyes are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// Left view in the left half of a frame.
    SideBySide,
    /// Left view in the upper half.
    TopBottom,
    /// Bytes of the left and the right view in turn.
    Interleaved,
    /// Each eye is a camera of its own.
    Two,
}

impl Layout {
    /// The layout of one camera's frames, as far as format and shape tell; nothing for what looks like one
    /// view.
    #[must_use]
    pub fn guess(code: FourCc, width: u32, height: u32) -> Option<Self> {
        if PixelFormat::of(code).is_some_and(PixelFormat::interleaves) {
            return Some(Self::Interleaved);
        }
        let shape = f64::from(width) / f64::from(height.max(1));
        (!ONE_VIEW.contains(&shape)).then_some(if shape > 1.0 { Self::SideBySide } else { Self::TopBottom })
    }

    /// Whether frames of this format can lie so.
    #[must_use]
    pub fn fits(self, code: FourCc) -> bool {
        let pixels = PixelFormat::of(code);
        let interleaves = pixels.is_some_and(PixelFormat::interleaves);
        if self == Self::Interleaved {
            interleaves || pixels == Some(PixelFormat::Yuyv)
        } else {
            !interleaves
        }
    }

    /// Size of a view, px, in a frame of this size.
    #[must_use]
    pub fn view(self, (width, height): (u32, u32)) -> (u32, u32) {
        match self {
            Self::SideBySide => (width / 2, height),
            Self::TopBottom => (width, height / 2),
            Self::Interleaved | Self::Two => (width, height),
        }
    }

    /// Size of a frame, px, that holds views of this size.
    #[must_use]
    pub fn frame(self, (width, height): (u32, u32)) -> (u32, u32) {
        match self {
            Self::SideBySide => (2 * width, height),
            Self::TopBottom => (width, 2 * height),
            Self::Interleaved | Self::Two => (width, height),
        }
    }

    /// What it is called.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::SideBySide => "side-by-side",
            Self::TopBottom => "top-bottom",
            Self::Interleaved => "interleaved",
            Self::Two => "two",
        }
    }

    /// The views in what was decoded: of one frame, or of two. Nothing if they cannot lie so.
    #[must_use]
    pub fn views(self, images: Vec<GrayImage>) -> Option<[GrayImage; 2]> {
        match (self, images.as_slice()) {
            (Self::SideBySide | Self::TopBottom, [image]) => halves(image, self == Self::SideBySide).ok(),
            (Self::Interleaved | Self::Two, [_, _]) => images.try_into().ok(),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn code(text: &str) -> FourCc {
        text.parse().unwrap()
    }

    #[test]
    fn known_cameras_are_guessed_right() {
        use Layout::{Interleaved, SideBySide, TopBottom};
        for (format, width, height, layout) in [
            // ZED
            ("YUYV", 1344, 376, Some(SideBySide)),
            ("YUYV", 2560, 720, Some(SideBySide)),
            ("YUYV", 3840, 1080, Some(SideBySide)),
            ("YUYV", 4416, 1242, Some(SideBySide)),
            // Cameras on a USB board
            ("MJPG", 1280, 480, Some(SideBySide)),
            ("MJPG", 2560, 960, Some(SideBySide)),
            // RealSense, infrared
            ("Y8I", 848, 480, Some(Interleaved)),
            ("Y12I", 1280, 800, Some(Interleaved)),
            // On top of each other
            ("YUYV", 640, 960, Some(TopBottom)),
            ("NV12", 1280, 1440, Some(TopBottom)),
            // One eye
            ("MJPG", 640, 480, None),
            ("MJPG", 1280, 720, None),
            ("GREY", 1280, 800, None),
        ] {
            assert_eq!(Layout::guess(code(format), width, height), layout, "{format} {width}x{height}");
        }
    }

    #[test]
    fn views_and_frames_are_inverse() {
        for layout in [Layout::SideBySide, Layout::TopBottom, Layout::Interleaved, Layout::Two] {
            assert_eq!(layout.view(layout.frame((640, 480))), (640, 480));
        }
    }

    #[test]
    fn frames_are_cut_as_they_lie() {
        let image = GrayImage::from_raw(4, 2, vec![1, 2, 3, 4, 5, 6, 7, 8]).unwrap();
        let views = |layout: Layout, images: &[&GrayImage]| {
            let images = images.iter().map(|image| (*image).clone()).collect();
            layout.views(images).map(|views| views.map(GrayImage::into_raw))
        };
        assert_eq!(views(Layout::SideBySide, &[&image]).unwrap(), [[1, 2, 5, 6], [3, 4, 7, 8]]);
        assert_eq!(views(Layout::TopBottom, &[&image]).unwrap(), [[1, 2, 3, 4], [5, 6, 7, 8]]);
        assert_eq!(views(Layout::Two, &[&image, &image]).unwrap()[0].len(), 8);
        assert_eq!(views(Layout::Interleaved, &[&image]), None);
        assert_eq!(views(Layout::SideBySide, &[&GrayImage::new(3, 2)]), None);
    }
}
