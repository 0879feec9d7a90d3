//! Which of its modes a camera is set to.
//!
//! In: what the camera offers and what the user asks for. Out: a [`Choice`], or a sentence that lists the
//! offers. What was asked for must be met; among what meets it the first of these decides: at least
//! ten frames a second, the larger view, the cheaper pixel format ([`FORMATS`]), the higher rate.
//! A calibration asks for the size of its views, so that a layout and a size follow from it.

use std::path::PathBuf;

use super::errors::CameraError;
use super::format::{FORMATS, FourCc, PixelFormat};
use super::layout::Layout;

/// Frames a second below which a picture is late.
const SWIFT: f64 = 10.0;
/// Rates this near to each other, relatively, are the same: 30 and 29.97.
const SAME_RATE: f64 = 0.02;
/// Offers that a sentence lists.
const LISTED: usize = 12;

/// Width and height, px.
pub type Size = (u32, u32);

/// A camera as it describes itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Its device.
    pub path: PathBuf,
    /// Its name.
    pub name: String,
    /// The kernel's driver.
    pub driver: String,
    /// Where it is plugged in.
    pub bus: String,
    /// Its pixel formats.
    pub offers: Vec<Offer>,
    /// The format and size that it is set to.
    pub current: (FourCc, Size),
}

/// A pixel format and its sizes.
#[derive(Clone, Debug, PartialEq)]
pub struct Offer {
    /// Pixel format.
    pub code: FourCc,
    /// What its driver calls it.
    pub name: String,
    /// Sizes; empty if the driver does not list them.
    pub sizes: Vec<Sizes>,
}

impl Offer {
    /// Whether its frames become grey values.
    #[must_use]
    pub fn is_read(&self) -> bool {
        PixelFormat::of(self.code).is_some()
    }
}

/// Sizes, and how many frames a second they can be had at; no rates if the driver does not list them.
#[derive(Clone, Debug, PartialEq)]
pub enum Sizes {
    /// One size.
    One(Size, Vec<f64>),
    /// All in steps from a least to a largest one.
    Range {
        /// The least.
        least: Size,
        /// The largest.
        most: Size,
        /// From one to the next.
        step: Size,
    },
}

/// What the user asks for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Request {
    /// Pixel format.
    pub code: Option<FourCc>,
    /// Size of a frame, px.
    pub size: Option<Size>,
    /// Frames a second.
    pub rate: Option<f64>,
    /// Where the eyes are.
    pub layout: Option<Layout>,
    /// Size of a view, px, as a calibration has it.
    pub view: Option<Size>,
}

/// What a camera is to be set to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// Pixel format.
    pub code: FourCc,
    /// Size of a frame, px.
    pub size: Size,
    /// Frames a second; the driver's own if nothing is known of rates.
    pub rate: Option<f64>,
    /// Where the eyes are.
    pub layout: Layout,
}

/// A mode that a camera has.
#[derive(Clone, Copy)]
struct Mode {
    code: FourCc,
    size: Size,
    rate: Option<f64>,
}

/// Decides.
///
/// # Errors
///
/// [`CameraError::NotOffered`].
pub fn choose(camera: &Camera, request: &Request) -> Result<Choice, CameraError> {
    let refused =
        |what: String| CameraError::NotOffered { path: camera.path.clone(), what, offers: offers(camera) };
    let mut offers: Vec<&Offer> = camera.offers.iter().filter(|offer| offer.is_read()).collect();
    if offers.is_empty() {
        return Err(refused("has no pixel format that is read".into()));
    }
    if let Some(code) = request.code {
        offers.retain(|offer| offer.code == code);
        if offers.is_empty() {
            let read = FORMATS.iter().any(|(name, _)| *name == code);
            return Err(refused(format!(
                "{} {code}",
                if read { "does not offer" } else { "has no readable format" }
            )));
        }
    }
    let mut modes: Vec<Mode> = offers.iter().flat_map(|offer| modes(camera, offer, request)).collect();
    if let Some((width, height)) = request.size {
        modes.retain(|mode| mode.size == (width, height));
        if modes.is_empty() {
            let code = request.code.map_or_else(String::new, |code| format!(" as {code}"));
            return Err(refused(format!("does not offer {width}x{height} px{code}")));
        }
    }
    if let Some(rate) = request.rate {
        modes.retain(|mode| mode.rate.is_none_or(|own| (own - rate).abs() <= SAME_RATE * rate));
        if modes.is_empty() {
            return Err(refused(format!("does not offer {rate} frames a second there")));
        }
    }
    let laid: Vec<Choice> = modes.iter().filter_map(|mode| laid_out(*mode, request)).collect();
    laid.into_iter().reduce(|best, next| if worth(&next) > worth(&best) { next } else { best }).ok_or_else(|| {
        refused(match (request.layout, request.view) {
            (_, Some((width, height))) => format!(
                "has no mode with two views of the calibration's {width}x{height} px; calibrate at a size that it \
                 has, or say --layout if it is a size of one camera"
            ),
            (Some(layout), None) => format!("has no mode whose eyes can lie {}", layout.name()),
            (None, None) => "shows one view in a frame, as far as its shape tells; give the second camera by another \
                             --device, or say by --layout where the eyes are"
                .into(),
        })
    })
}

/// The modes of an offer that may be asked for.
fn modes(camera: &Camera, offer: &Offer, request: &Request) -> Vec<Mode> {
    let wanted = || {
        let layouts = [Layout::SideBySide, Layout::TopBottom, Layout::Two];
        let views = request.view.into_iter().flat_map(move |view| layouts.map(|layout| layout.frame(view)));
        request.size.into_iter().chain(views).chain([camera.current.1])
    };
    let mode = |size: Size, rate: Option<f64>| Mode { code: offer.code, size, rate };
    let of_sizes = |sizes: &Sizes| match sizes {
        Sizes::One(size, rates) if rates.is_empty() => vec![mode(*size, None)],
        Sizes::One(size, rates) => rates.iter().map(|rate| mode(*size, Some(*rate))).collect(),
        Sizes::Range { least, most, step } => {
            let on = |side: u32, least: u32, most: u32, step: u32| {
                (least..=most).contains(&side) && (side - least).is_multiple_of(step.max(1))
            };
            let within =
                |size: &Size| on(size.0, least.0, most.0, step.0) && on(size.1, least.1, most.1, step.1);
            wanted().filter(within).map(|size| mode(size, None)).collect()
        }
    };
    // A driver that lists no sizes says what it can do only when it is set.
    if offer.sizes.is_empty() {
        return vec![mode(request.size.unwrap_or(camera.current.1), None)];
    }
    offer.sizes.iter().flat_map(of_sizes).collect()
}

/// A mode with the layout that it was asked for with, or is guessed to have.
fn laid_out(mode: Mode, request: &Request) -> Option<Choice> {
    let Mode { code, size, rate } = mode;
    let matches = |layout: &Layout| request.view.is_none_or(|view| layout.view(size) == view);
    let layout = match request.layout {
        Some(layout) => Some(layout).filter(|layout| layout.fits(code)),
        None if PixelFormat::of(code)?.interleaves() => Some(Layout::Interleaved),
        None if request.view.is_some() => [Layout::SideBySide, Layout::TopBottom].into_iter().find(matches),
        None => Layout::guess(code, size.0, size.1),
    };
    layout.filter(matches).map(|layout| Choice { code, size, rate, layout })
}

/// What makes one mode better than another.
fn worth(choice: &Choice) -> impl PartialOrd {
    let (width, height) = choice.layout.view(choice.size);
    let cost = FORMATS.iter().position(|(code, _)| *code == choice.code).unwrap_or(FORMATS.len());
    let rate = choice.rate.unwrap_or(SWIFT);
    (rate >= SWIFT, u64::from(width) * u64::from(height), std::cmp::Reverse(cost), rate)
}

/// What a camera offers that is read, in a few words.
#[must_use]
pub fn offers(camera: &Camera) -> String {
    let read: Vec<&Offer> = camera.offers.iter().filter(|offer| offer.is_read()).collect();
    let mut words: Vec<String> = Vec::new();
    // Formats that come in the same sizes are told together.
    for alike in read.chunk_by(|a, b| a.sizes == b.sizes) {
        let codes = alike.iter().map(|offer| offer.code.to_string()).collect::<Vec<_>>().join(" or ");
        let sizes = &alike[0].sizes;
        if sizes.is_empty() {
            words.push(format!("{codes} (now {}x{})", camera.current.1.0, camera.current.1.1));
        }
        words.extend(sizes.iter().map(|sizes| format!("{codes} {}", sizes_in_words(sizes))));
    }
    let more = words.len().saturating_sub(LISTED);
    words.truncate(LISTED);
    match (words.is_empty(), more) {
        (true, _) => "nothing that is read".into(),
        (false, 0) => words.join(", "),
        (false, _) => format!("{} and {more} more", words.join(", ")),
    }
}

/// Sizes and rates in words: `1280x480 at 30, 15/s`.
#[must_use]
pub fn sizes_in_words(sizes: &Sizes) -> String {
    match sizes {
        Sizes::One((width, height), rates) if rates.is_empty() => format!("{width}x{height}"),
        Sizes::One((width, height), rates) => {
            // Three decimals at most, and none that are 0.
            let rates = rates.iter().map(|rate| ((rate * 1e3).round() / 1e3).to_string());
            format!("{width}x{height} at {}/s", rates.collect::<Vec<_>>().join(", "))
        }
        Sizes::Range { least, most, step } => {
            format!("{}x{} to {}x{} in steps of {}x{}", least.0, least.1, most.0, most.1, step.0, step.1)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn offer(code: &str, sizes: Vec<Sizes>) -> Offer {
        Offer { code: code.parse().unwrap(), name: String::new(), sizes }
    }

    fn one(width: u32, height: u32, rates: &[f64]) -> Sizes {
        Sizes::One((width, height), rates.to_vec())
    }

    fn camera(offers: Vec<Offer>) -> Camera {
        let code = offers[0].code;
        Camera {
            path: "/dev/video0".into(),
            name: "3D camera".into(),
            driver: "uvcvideo".into(),
            bus: "usb-1".into(),
            offers,
            current: (code, (640, 480)),
        }
    }

    /// What most boards with two sensors on one USB plug offer.
    fn board() -> Camera {
        camera(vec![
            offer("YUYV", vec![one(640, 480, &[30.0]), one(1280, 480, &[15.0, 5.0]), one(2560, 720, &[2.0])]),
            offer(
                "MJPG",
                vec![one(1280, 480, &[60.0, 30.0]), one(2560, 720, &[30.0]), one(2560, 960, &[30.0])],
            ),
            offer("H264", vec![one(2560, 960, &[30.0])]),
        ])
    }

    fn chosen(camera: &Camera, request: Request) -> Result<String, String> {
        let chosen = choose(camera, &request).map_err(|error| error.to_string())?;
        let rate = chosen.rate.map_or("?".into(), |rate| rate.to_string());
        Ok(format!("{} {}x{} {rate} {}", chosen.code, chosen.size.0, chosen.size.1, chosen.layout.name()))
    }

    #[test]
    fn the_largest_swift_mode_with_two_views_is_taken() {
        let all = Request::default();
        assert_eq!(chosen(&board(), all).unwrap(), "MJPG 2560x960 30 side-by-side");
        let small = Request { size: Some((1280, 480)), ..all };
        // The decoder costs more than a lower rate.
        assert_eq!(chosen(&board(), small).unwrap(), "YUYV 1280x480 15 side-by-side");
        let fast = Request { rate: Some(60.0), ..small };
        assert_eq!(chosen(&board(), fast).unwrap(), "MJPG 1280x480 60 side-by-side");
    }

    #[test]
    fn a_calibration_decides_size_and_layout() {
        let of = |width: u32, height: u32| Request { view: Some((width, height)), ..Request::default() };
        assert_eq!(chosen(&board(), of(640, 480)).unwrap(), "YUYV 1280x480 15 side-by-side");
        // One view as wide as it is high is no guess any more.
        assert_eq!(chosen(&board(), of(320, 480)).unwrap(), "YUYV 640x480 30 side-by-side");
        let stacked = camera(vec![offer("NV12", vec![one(640, 480, &[]), one(640, 960, &[])])]);
        assert_eq!(chosen(&stacked, of(640, 480)).unwrap(), "NV12 640x960 ? top-bottom");
        let infrared = camera(vec![
            offer("GREY", vec![one(848, 480, &[90.0])]),
            offer("Y8I", vec![one(848, 480, &[90.0])]),
        ]);
        assert_eq!(chosen(&infrared, of(848, 480)).unwrap(), "Y8I 848x480 90 interleaved");
        let error = chosen(&board(), of(800, 600)).unwrap_err();
        assert!(
            error.contains("calibration's 800x600") && error.contains("MJPG 2560x960 at 30/s"),
            "{error}"
        );
    }

    #[test]
    fn what_is_not_offered_is_told_with_what_is() {
        let all = Request::default();
        let bgr3 = Request { code: Some("BGR3".parse().unwrap()), ..all };
        for (request, words) in [
            (Request { code: Some("GREY".parse().unwrap()), ..all }, "does not offer GREY"),
            (bgr3, "no readable format BGR3"),
            (Request { size: Some((800, 600)), ..all }, "does not offer 800x600"),
            (Request { rate: Some(120.0), ..all }, "does not offer 120 frames"),
            (
                Request { layout: Some(Layout::Interleaved), code: Some("MJPG".parse().unwrap()), ..all },
                "interleaved",
            ),
        ] {
            let error = chosen(&board(), request).unwrap_err();
            assert!(error.contains(words) && error.contains("YUYV 1280x480 at 15, 5/s"), "{error}");
        }
        let mono = camera(vec![offer("MJPG", vec![one(1280, 720, &[30.0])])]);
        let error = chosen(&mono, all).unwrap_err();
        assert!(error.contains("another --device"), "{error}");
        let two = Request { layout: Some(Layout::Two), ..all };
        assert_eq!(chosen(&mono, two).unwrap(), "MJPG 1280x720 30 two");
        let film = camera(vec![offer("H264", vec![one(1280, 720, &[30.0])])]);
        assert!(chosen(&film, all).unwrap_err().contains("no pixel format that is read"));
    }

    #[test]
    fn two_bytes_of_a_pixel_can_be_forced_to_be_the_eyes() {
        let leap = camera(vec![offer("YUYV", vec![one(640, 240, &[60.0])])]);
        let forced = Request { layout: Some(Layout::Interleaved), ..Request::default() };
        assert_eq!(chosen(&leap, forced).unwrap(), "YUYV 640x240 60 interleaved");
    }

    #[test]
    fn ranges_and_silence_about_sizes_are_taken_at_their_word() {
        let range = Sizes::Range { least: (320, 240), most: (2560, 1440), step: (2, 2) };
        let scaler = camera(vec![offer("GREY", vec![range])]);
        let view = |width: u32| Request { view: Some((width, 480)), ..Request::default() };
        assert_eq!(chosen(&scaler, view(640)).unwrap(), "GREY 1280x480 ? side-by-side");
        assert!(chosen(&scaler, view(2600)).is_err());
        let silent = camera(vec![offer("GREY", Vec::new())]);
        assert_eq!(chosen(&silent, view(320)).unwrap(), "GREY 640x480 ? side-by-side");
        let asked = Request { size: Some((1280, 480)), ..Request::default() };
        assert_eq!(chosen(&silent, asked).unwrap(), "GREY 1280x480 ? side-by-side");
    }
}
