//! The report page in a real browser: the model is drawn, every switch changes what is seen, nothing is said to the
//! console and nothing asked for beyond the page, on a desk, in the dark and on a phone.
//!
//! `OSSATURE_SHOTS` names a folder for the screenshots.

use host::shape::Shape;
use image::RgbImage;
use oracle::browser::{Browser, Page, Sight};
use oracle::cases;
use oracle::program::{host, within};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::mpsc::{Sender, channel};

const DESK: Sight = Sight { window: [1000, 1000], dark: false, phone: false };
const NIGHT: Sight = Sight { dark: true, ..DESK };
const PHONE: Sight = Sight { window: [390, 844], dark: true, phone: true };

/// The model is compared at this scale; views, for their thin lines, enlarged.
const SCALE: f64 = 0.5;
/// So many pixels at least are another colour where a switch was used.
const SEEN: usize = 12;
/// So many on edges may be, where the same is drawn again.
const ON_EDGES: usize = 120;

/// A page to be looked at, and what it shows.
struct Report {
    name: String,
    page: PathBuf,
    /// Switches that it must have, beside any others.
    switches: &'static [&'static str],
}

/// Of a pair whose pictures and truth are known.
const ALL: [&str; 12] = [
    "model", "error", "truth", "skeleton", "boundary", "grey", "mask", "distance", "contour", "curves",
    "hull", "matches",
];
/// Of a pair without truth.
const UNKNOWN: [&str; 10] =
    ["model", "skeleton", "boundary", "grey", "mask", "distance", "contour", "curves", "hull", "matches"];
/// Of what a device sends.
const SENT: [&str; 7] = ["model", "skeleton", "boundary", "contour", "curves", "hull", "matches"];

/// Makes the pages, one after the other.
fn make(folder: &Path, made: &Sender<Report>) {
    let report = |name: &str, out: &str, switches| {
        let page = Path::new(out).join("report.html");
        made.send(Report { name: name.to_owned(), page, switches }).unwrap();
    };
    for shape in Shape::ALL {
        let out = within(folder, shape.name());
        host(&["demo", shape.name(), "--out", &out]).unwrap();
        report(shape.name(), &out, &ALL);
    }
    let replay = |name: &str, pair: &Path, more: &[&str]| {
        let out = within(folder, name);
        let [left, right, calib] = ["left.png", "right.png", "calib.yaml"].map(|file| within(pair, file));
        let words = ["replay", "--report", "--out", &out, &left, &right, "--calib", &calib];
        let made = host(&[&words, more].concat());
        (out, made)
    };
    let pair = folder.join("teapot");
    for (name, more, switches) in [
        ("device", &["--as-device"][..], &SENT[..]),
        ("paper", &["--mode", "paper"], &["model", "grey", "hull", "matches"]),
    ] {
        let (out, made) = replay(name, &pair, more);
        made.unwrap();
        report(name, &out, switches);
    }
    for (name, more, switches) in [
        ("refused-dark", &["--polarity", "dark"][..], &["grey", "mask"][..]),
        ("refused-swapped", &["--swap"], &["grey", "contour", "hull"]),
    ] {
        let (out, made) = replay(name, &pair, more);
        assert!(made.unwrap_err().contains("report.html shows it"), "{name}");
        report(name, &out, switches);
    }
    for case in cases::folder().map(|folder| cases::cases(&folder)).unwrap_or_default() {
        let name = format!("case-{}", cases::name(&case));
        let (out, made) = replay(&name, &case, &[]);
        made.unwrap();
        report(&name, &out, &UNKNOWN);
    }
}

/// How many pixels differ by more than a shade.
fn changed(a: &RgbImage, b: &RgbImage) -> usize {
    a.pixels().zip(b.pixels()).filter(|(a, b)| a.0.iter().zip(b.0).any(|(a, b)| a.abs_diff(b) > 24)).count()
}

fn keep(browser: &mut Browser, page: &Page, name: &str) {
    if let Some(folder) = std::env::var_os("OSSATURE_SHOTS") {
        std::fs::create_dir_all(&folder).unwrap();
        let picture = browser.picture(page, "html", 1.0);
        picture.save(Path::new(&folder).join(format!("{name}.png"))).unwrap();
    }
}

/// The names of a page's switches.
fn switches(browser: &mut Browser, page: &Page) -> Vec<String> {
    let names = "[...document.querySelectorAll('.switches input')].filter((box) => box.checkVisibility()).map((box) => box.name)";
    let names = browser.evaluate(page, names);
    names.as_array().unwrap().iter().map(|name| name.as_str().unwrap().to_owned()).collect()
}

/// Every switch, used, changes the picture of its part; all used again give the first picture back.
fn use_switches(browser: &mut Browser, page: &Page, report: &Report) {
    let names = switches(browser, page);
    for name in report.switches {
        assert!(names.iter().any(|other| other == name), "{}: no {name} among {names:?}", report.name);
    }
    for (part, shown, hidden, scale) in
        [("traces", "#space", "views-part", SCALE), ("layers", "#views", "space-part", 2.0)]
    {
        // From the lowest up, so that none is hidden by what was switched before it. Of a skeleton of one point only
        // this is seen: the model lets it through.
        let own = format!("[...document.querySelectorAll('#{part} input')].map((box) => box.name)");
        let own = browser.evaluate(page, &own);
        let mut own: Vec<_> = own.as_array().unwrap().iter().filter_map(|name| name.as_str()).collect();
        own.sort_by_key(|name| *name != "skeleton");
        if own.is_empty() {
            continue;
        }
        // What is not looked at need not be drawn.
        let hide = |how: &str| format!("document.getElementById('{hidden}').style.visibility = '{how}'");
        let click = |name: &str| format!("document.querySelector('#{part} [name={name}]').click()");
        browser.evaluate(page, &hide("hidden"));
        let first = browser.picture(page, shown, scale);
        let mut before = first.clone();
        for name in &own {
            browser.evaluate(page, &click(name));
            browser.settle(page);
            let after = browser.picture(page, shown, scale);
            let changed = changed(&before, &after);
            assert!(changed >= SEEN, "{}: {name} changes {changed} pixels", report.name);
            before = after;
        }
        let all = own.iter().map(|name| click(name)).collect::<Vec<_>>().join(";");
        browser.evaluate(page, &all);
        browser.settle(page);
        let again = browser.picture(page, shown, scale);
        let changed = changed(&first, &again);
        assert!(changed < ON_EDGES, "{}: {part} are not as they were, {changed} pixels", report.name);
        browser.evaluate(page, &hide(""));
    }
}

/// The model covers part of its canvas, in more shades than one colour without light would have.
fn model_is_drawn(browser: &mut Browser, page: &Page, name: &str) {
    let picture = browser.picture(page, "#space", SCALE);
    let paper = *picture.get_pixel(2, 2);
    let drawn = picture.pixels().filter(|pixel| **pixel != paper);
    let shades: std::collections::HashSet<_> = drawn.clone().map(|pixel| pixel.0[1] / 8).collect();
    let covered = drawn.count() * 100 / (picture.len() / 3);
    assert!(covered >= 5 && shades.len() >= 8, "{name}: {covered} % in {} shades", shades.len());
}

/// Plots have taken the size of their places, and nothing is wider than the window.
fn fits(browser: &mut Browser, page: &Page, name: &str) {
    let sized = "[...document.querySelectorAll('.plot')].every((plot) => !plot._fullLayout || !plot.clientWidth || \
                 Math.abs(plot._fullLayout.width - plot.clientWidth) < 1)";
    let wait =
        "new Promise((done) => { const look = () => SIZED ? done(0) : setTimeout(look, 50); look(); })";
    browser.evaluate(page, &wait.replace("SIZED", sized));
    browser.settle(page);
    let beyond = browser.evaluate(page, "document.documentElement.scrollWidth - innerWidth");
    assert!(beyond.as_f64().unwrap() <= 0.0, "{name}: {beyond} px beyond the window");
}

fn look(browser: &mut Browser, report: &Report) {
    let address = format!("file://{}", report.page.display());
    let page = browser.open(&address, DESK);
    keep(browser, &page, &format!("{}-desk", report.name));
    use_switches(browser, &page, report);
    if switches(browser, &page).iter().any(|name| name == "model") {
        model_is_drawn(browser, &page, &report.name);
    }
    for (name, sight) in [("night", NIGHT), ("phone", PHONE)] {
        browser.see(&page, sight);
        fits(browser, &page, &report.name);
        keep(browser, &page, &format!("{}-{name}", report.name));
    }
    assert_eq!(browser.complaints(), Vec::<String>::new(), "{}", report.name);
    assert_eq!(browser.requests(), [address], "{}", report.name);
    browser.close(&page);
}

#[test]
fn every_page_shows_what_was_made() {
    // A browser that draws in software has one core.
    let browsers: Vec<_> = (0..2).map_while(|_| Browser::start()).collect();
    if browsers.is_empty() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let (made, reports) = channel();
    let reports = Mutex::new(reports);
    let next = || reports.lock().unwrap().recv().ok();
    // Pages are made while those before are looked at.
    std::thread::scope(|scope| {
        let (folder, next) = (folder.path(), &next);
        scope.spawn(move || make(folder, &made));
        for mut browser in browsers {
            scope.spawn(move || std::iter::from_fn(next).for_each(|report| look(&mut browser, &report)));
        }
    });
}
