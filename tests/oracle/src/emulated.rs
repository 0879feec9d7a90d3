//! Pairs for the image `stages` of the emulated boards, and what it says of them.

use crate::board;
use crate::cases;
use crate::images::rectified;
use crate::scene::{self, Pair};
use host::calibration::StereoCamera;
use host::shape::Shape;
use shared::pipeline::Settings;
use shared::stage::depth::Optics;
use std::path::Path;
use std::time::Duration;

/// Largest pictures that the boards have room for, px.
pub const LARGEST: (u32, u32) = (640, 480);
/// An image that runs longer hangs.
const LIMIT: Duration = Duration::from_secs(400);

/// A pair with its calibration.
pub type Raw = (Pair, StereoCamera);

/// One run of the core.
pub struct Case {
    /// Name of the object.
    pub name: String,
    /// The pair, rectified as a device does it.
    pub pair: Pair,
    /// Its cameras.
    pub optics: Optics,
    /// Whether with a device's settings or with all that the core can do.
    pub as_device: bool,
}

impl Case {
    /// A raw pair both ways.
    pub fn both_ways(name: &str, (pair, camera): &Raw) -> [Self; 2] {
        [false, true].map(|as_device| {
            let (pair, optics) = rectified(pair, camera);
            Self { name: name.to_owned(), pair, optics, as_device }
        })
    }

    /// Size and settings, such as `320x240 full`.
    pub fn way(&self) -> String {
        let (width, height) = self.pair[0].dimensions();
        format!("{width}x{height} {}", if self.as_device { "device" } else { "full" })
    }

    /// The core's settings.
    pub fn settings(&self) -> Settings {
        if self.as_device { Settings::device(self.optics) } else { Settings::new(self.optics) }
    }
}

/// The built-in shapes at 640x480.
pub fn shapes() -> Vec<(String, Raw)> {
    Shape::ALL.map(|shape| (shape.name().to_owned(), (scene::pair(shape, 1), scene::camera(1)))).to_vec()
}

/// The cases with known truth, where there are any.
pub fn public_cases() -> Vec<(String, Raw)> {
    let folders = cases::folder().map(|folder| cases::cases(&folder)).unwrap_or_default();
    folders.iter().map(|case| (cases::name(case), cases::open(case))).collect()
}

/// A raw pair at its own size, at half that, and so on.
pub fn sizes(raw: Raw) -> impl Iterator<Item = Raw> {
    let large = |(pair, _): &Raw| pair[0].width() > 1 && pair[0].height() > 1;
    std::iter::successors(Some(raw), |larger| Some(cases::halved(larger))).take_while(large)
}

/// What a stage made, as `eye stage sum`, and its cost in instructions.
pub type Line = (String, u64);

/// What an image says of each case on one of [`board::MACHINES`]; nothing where QEMU is missing.
///
/// # Panics
/// When it stops early, or says something else.
pub fn run(machine: &str, image: &Path, cases: &[Case]) -> Option<Vec<Vec<Line>>> {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), written(cases)).unwrap();
    let said = board::run(machine, image, &[file.path()], LIMIT)?;
    assert!(said.ends_with("done\n"), "{machine} stopped early: {said}");
    let mut lines = vec![Vec::new(); cases.len()];
    for line in said.lines().filter(|line| *line != "done") {
        let parsed = line.split_once(' ').and_then(|(number, rest)| {
            let (line, cost) = rest.rsplit_once(' ')?;
            Some((number.parse::<usize>().ok()?, line.to_owned(), cost.parse().ok()?))
        });
        let (number, line, cost) = parsed.unwrap_or_else(|| panic!("{machine} said {line:?}"));
        lines[number].push((line, cost));
    }
    Some(lines)
}

/// The file that the boards read.
fn written(cases: &[Case]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for case in cases {
        let (width, height) = case.pair[0].dimensions();
        let Optics { focal, disparity_offset } = case.optics;
        let numbers = [width as i32, height as i32, focal, disparity_offset, i32::from(case.as_device), 0];
        bytes.extend(numbers.iter().flat_map(|n| n.to_le_bytes()));
        case.pair.iter().for_each(|image| bytes.extend_from_slice(image.as_raw()));
    }
    bytes
}
