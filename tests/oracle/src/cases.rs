//! Cases with known truth: in `../shared/eval/cases` beside the project, or wherever `OSSATURE_EVAL` points
//! (a folder with `cases/` and `baselines.json`). They are no part of the project.

use crate::scene::Pair;
use host::calibration::StereoCamera;
use image::{GrayImage, Luma};
use std::path::{Path, PathBuf};

/// The folder, or nothing, said loudly.
pub fn folder() -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/eval");
    let folder = std::env::var_os("OSSATURE_EVAL").map_or_else(beside, PathBuf::from);
    if folder.join("cases").is_dir() {
        return Some(folder);
    }
    eprintln!("\n!!!! SKIPPED: no evaluation cases in {}; set OSSATURE_EVAL !!!!\n", folder.display());
    None
}

/// The folders of the cases, by name.
pub fn cases(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder.join("cases")).unwrap();
    let mut cases: Vec<_> =
        entries.map(|e| e.unwrap().path()).filter(|p| p.join("truth.ply").is_file()).collect();
    cases.sort();
    cases
}

/// A case's name.
pub fn name(case: &Path) -> String {
    case.file_name().unwrap().to_string_lossy().into_owned()
}

/// A case's raw pictures and their calibration.
pub fn open(case: &Path) -> (Pair, StereoCamera) {
    let open = |name: &str| image::open(case.join(name)).unwrap().to_luma8();
    (["left.png", "right.png"].map(open), StereoCamera::read(case.join("calib.yaml")).unwrap())
}

/// The same at half the size: each pixel the mean of four.
pub fn halved((pair, camera): &(Pair, StereoCamera)) -> (Pair, StereoCamera) {
    let half = |image: &GrayImage| {
        GrayImage::from_fn(image.width() / 2, image.height() / 2, |u, v| {
            let at = |k: u32| u32::from(image.get_pixel(2 * u + k % 2, 2 * v + k / 2)[0]);
            Luma([(((0..4).map(at).sum::<u32>() + 2) / 4) as u8])
        })
    };
    (pair.each_ref().map(half), camera.halved())
}
