//! The report page in a real browser: it draws, says nothing to the console, and every switch changes what is
//! to be seen. It asks for nothing beyond itself by its own policy, which `host/src/report/page.rs` tests.
//!
//! Says loudly when there is no Chromium, and fails then if `CI=true`. `OSSATURE_SHOTS` names a folder for the
//! screenshots, at desktop and at phone width.

use host::shape::Shape;
use image::RgbImage;
use oracle::cases;
use oracle::program::{host, within};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Layers of the views and traces of the model.
const SWITCHES: [&str; 13] = [
    "grey", "mask", "distance", "pruned", "contour", "skeleton", "curves", "hull", "matches", "model",
    "error", "truth", "boundary",
];
const DESKTOP: (u32, u32) = (1280, 1400);
const PHONE: (u32, u32) = (390, 1400);

fn browser() -> Option<PathBuf> {
    let paths = std::env::var_os("PATH").unwrap_or_default();
    let mut places = std::env::split_paths(&paths)
        .flat_map(|folder| ["chromium", "chromium-browser", "google-chrome"].map(|name| folder.join(name)));
    let found = places.find(|path| path.is_file());
    if found.is_none() {
        assert_ne!(
            std::env::var("CI").as_deref(),
            Ok("true"),
            "in CI the page must be looked at: install chromium"
        );
        eprintln!("SKIPPED: there is no chromium, so NO page is looked at; ./ci.sh test installs it");
    }
    found
}

/// A screenshot of a page, of which only `show` is switched on if that is given; nothing may be said.
fn shot(browser: &Path, page: &Path, show: Option<&str>, (width, height): (u32, u32)) -> RgbImage {
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("shot.png");
    let fragment = show.map_or(String::new(), |show| format!("#show={show}"));
    let run = Command::new(browser)
        .args([
            "--headless=new",
            "--no-sandbox",
            "--no-first-run",
            "--hide-scrollbars",
            "--enable-logging=stderr",
        ])
        .args(["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"])
        .args([
            "--disable-background-networking",
            "--disable-component-update",
            "--virtual-time-budget=10000",
        ])
        .arg(format!("--user-data-dir={}", folder.path().join("profile").display()))
        .arg(format!("--window-size={width},{height}"))
        .arg(format!("--screenshot={}", picture.display()))
        .arg(format!("file://{}{fragment}", page.display()))
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&run.stderr);
    // The library's own remark on how it reads pixels back is no error.
    let console =
        said.lines().filter(|line| line.contains("CONSOLE") && !line.contains("willReadFrequently"));
    assert_eq!(console.collect::<Vec<_>>(), Vec::<&str>::new(), "{}", page.display());
    image::open(&picture).unwrap_or_else(|error| panic!("{error}: {said}")).to_rgb8()
}

/// How many pixels differ by more than a shade.
fn changed(a: &RgbImage, b: &RgbImage) -> usize {
    a.pixels().zip(b.pixels()).filter(|(a, b)| a.0.iter().zip(b.0).any(|(a, b)| a.abs_diff(b) > 24)).count()
}

fn keep(name: &str, picture: &RgbImage) {
    if let Some(folder) = std::env::var_os("OSSATURE_SHOTS") {
        std::fs::create_dir_all(&folder).unwrap();
        picture.save(Path::new(&folder).join(format!("{name}.png"))).unwrap();
    }
}

/// The page of a demo, which knows the truth.
fn demo(folder: &Path, shape: &str) -> PathBuf {
    let out = within(folder, shape);
    host(&["demo", shape, "--out", &out]).unwrap();
    Path::new(&out).join("report.html")
}

#[test]
fn every_switch_changes_the_picture() {
    let Some(browser) = browser() else { return };
    let folder = tempfile::tempdir().unwrap();
    let page = demo(folder.path(), "teapot");
    let nothing = shot(&browser, &page, Some(""), DESKTOP);
    for switch in SWITCHES {
        let picture = shot(&browser, &page, Some(switch), DESKTOP);
        let changed = changed(&picture, &nothing);
        // Its box alone, checked, is some 150 pixels.
        assert!(changed > if switch == "pruned" { 150 } else { 600 }, "{switch}: {changed} pixels");
    }
    let model = shot(&browser, &page, Some("model"), DESKTOP);
    assert!(changed(&model, &nothing) > 20_000, "the model is drawn");
}

#[test]
fn every_shape_and_case_is_shown_at_any_width() {
    let Some(browser) = browser() else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut pages: Vec<(String, PathBuf)> =
        Shape::ALL.iter().map(|shape| (shape.name().to_owned(), demo(folder.path(), shape.name()))).collect();
    let cases = cases::folder().map(|folder| cases::cases(&folder)).unwrap_or_default();
    for case in cases {
        let name = format!("case_{}", cases::name(&case));
        let out = within(folder.path(), &name);
        let file = |file: &str| case.join(file).display().to_string();
        let calib = file("calib.yaml");
        host(&[
            "replay",
            &file("left.png"),
            &file("right.png"),
            "--calib",
            &calib,
            "--report",
            "--out",
            &out,
        ])
        .unwrap();
        pages.push((name, Path::new(&out).join("report.html")));
    }
    for (name, page) in &pages {
        for (width, size) in [("desktop", DESKTOP), ("phone", PHONE)] {
            let picture = shot(&browser, page, None, size);
            keep(&format!("{name}-{width}"), &picture);
            let first = *picture.get_pixel(0, 0);
            let drawn = picture.pixels().filter(|pixel| **pixel != first).count();
            assert!(drawn * 5 > picture.len() / 3, "{name}, {width}: {drawn} pixels are drawn");
        }
    }
}
