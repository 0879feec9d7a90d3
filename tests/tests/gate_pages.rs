//! The pages about gates: one for each finding, with the sentence that the program says now and the picture of a
//! pair that trips it.

use host::report::words::sentence;
use image::RgbImage;
use oracle::gates::{all, picture, quoted};
use shared::pipeline::Finding;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// The one that no picture is known to trip; its page says so.
const WITHOUT_PICTURE: (&str, Finding) = ("flat-hull", Finding::FlatHull);

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

fn folder() -> PathBuf {
    root().join("docs/gates")
}

fn page(name: &str) -> String {
    let path = folder().join(name).with_extension("md");
    let page = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    assert!(page.starts_with(&format!("# `{name}`\n")) && page.contains("## What to do"), "{name}");
    page
}

/// The names of all findings, from the source of those words.
fn names() -> BTreeSet<String> {
    let words = fs::read_to_string(root().join("host/src/report/words.rs")).unwrap();
    let body = words.split("pub const fn name(").nth(1).unwrap().split("\n}").next().unwrap();
    body.split('"').skip(1).step_by(2).map(str::to_owned).collect()
}

#[test]
fn every_finding_has_a_page_and_every_page_a_finding() {
    let shown = all().into_iter().map(|gate| gate.name).chain([WITHOUT_PICTURE.0]);
    assert_eq!(shown.map(str::to_owned).collect::<BTreeSet<_>>(), names());
    let files = fs::read_dir(folder()).unwrap().map(|entry| entry.unwrap().path());
    let pages = files.filter(|path| path.extension().is_some_and(|extension| extension == "md"));
    let pages = pages.map(|path| path.file_stem().unwrap().to_string_lossy().into_owned());
    assert_eq!(pages.filter(|name| name != "README").collect::<BTreeSet<_>>(), names());
    let index = fs::read_to_string(folder().join("README.md")).unwrap();
    assert!(names().iter().all(|name| index.contains(&format!("[`{name}`]({name}.md)"))));
}

#[test]
fn every_pair_trips_its_gate_and_every_page_quotes_it() {
    for gate in all() {
        let tripped = gate.trip().unwrap_or_else(|said| panic!("{said}"));
        assert_eq!(tripped.finding.refuses(), gate.refuses, "{}", gate.name);
        let page = page(gate.name);
        let begins = if gate.refuses {
            ["**Refuses.**", "**Warns, or refuses.**"]
        } else {
            ["**Warns.**", "**Warns;**"]
        };
        assert!(begins.iter().any(|word| page.contains(word)), "{}", gate.name);
        assert_eq!(quoted(&page), sentence(&tripped.finding), "{}", gate.name);
        let path = folder().join(gate.name).with_extension("png");
        assert!(page.contains(&format!("]({}.png)", gate.name)), "{}", gate.name);
        assert!(fs::metadata(&path).unwrap().len() < 40_000, "{}", path.display());
        let kept = image::open(&path).unwrap().to_rgb8();
        assert!(
            changed(&picture(&gate, &tripped), &kept) < kept.len() / 3000,
            "{} is another picture",
            gate.name
        );
    }
}

#[test]
fn the_page_without_a_picture_says_so() {
    let (name, finding) = WITHOUT_PICTURE;
    let page = page(name);
    assert_eq!(quoted(&page), sentence(&finding));
    assert!(page.contains("No picture is known"));
}

/// How many pixels differ by more than a shade.
fn changed(a: &RgbImage, b: &RgbImage) -> usize {
    assert_eq!(a.dimensions(), b.dimensions());
    a.pixels().zip(b.pixels()).filter(|(a, b)| a.0.iter().zip(b.0).any(|(a, b)| a.abs_diff(b) > 24)).count()
}
