use crate::reconstruct::Mode;
use crate::report::fixture::Capsule;
use crate::report::record::Record;
use serde_json::Value;

fn report(mode: Mode) -> Value {
    let capsule = Capsule::new(mode, Record::figures_only());
    serde_json::from_slice(&super::json(&capsule.run())).expect("the report is JSON")
}

fn names(value: &Value) -> Vec<&str> {
    value.as_object().map_or_else(Vec::new, |object| object.keys().map(String::as_str).collect())
}

#[test]
fn the_fields_are_these() {
    let report = report(Mode::Default);
    let top = ["format", "format_version", "version", "options", "images", "calibration", "eyes", "matching"];
    assert_eq!(
        names(&report),
        [&top[..], &["gates", "model", "front", "curves", "curves_mm", "times_ms"]].concat()
    );
    let matching = ["right_area_over_left", "vertical_offset", "invariants", "disparity", "rows", "paper"];
    assert_eq!(names(&report["matching"]), matching);
    assert_eq!(report["options"]["mode"], "default");
    assert_eq!(report["options"]["thinning"], "edt");
    assert_eq!(report["options"]["front"], "balls");
    assert!(report["front"]["grey"].is_null() && report["front"]["measured"] == "the outline, by both eyes");
    assert_eq!(report["matching"]["invariants"]["e_omega"].as_array().map(Vec::len), Some(12));
    assert_eq!(report["calibration"]["baseline_mm"], 60.0);
    assert_eq!(report["eyes"]["left"]["contour_loops"], 1);
    let stages = ["threshold", "mask", "boundary", "contour", "distance", "thinning", "graph", "hull"];
    assert_eq!(names(&report["times_ms"]["right"]), stages);
    assert_eq!(names(&report["times_ms"]["pair"]), ["correspondence", "rows", "balls", "curves"]);
}

/// The capsule is 450 mm away; an axis of a straight body is one open curve.
#[test]
fn the_figures_are_those_of_the_object() {
    let report = report(Mode::Default);
    let depth = report["matching"]["disparity"]["depth_mm"].as_f64().expect("a depth");
    assert!((depth - 450.0).abs() < 25.0, "{depth}");
    for curve in report["curves"]["left"].as_array().expect("curves") {
        let count = |name: &str| curve[name].as_array().map_or(0, Vec::len);
        assert_eq!(count("knots"), count("controls") + 4);
        assert_eq!(curve["closed"], false);
    }
}

#[test]
fn only_times_differ_between_runs() {
    let [mut first, mut second] = [report(Mode::Default), report(Mode::Default)];
    for report in [&mut first, &mut second] {
        assert!(report.as_object_mut().and_then(|fields| fields.remove("times_ms")).is_some());
    }
    assert_eq!(first, second);
}

#[test]
fn the_papers_mode_has_its_own_figures() {
    let report = report(Mode::Paper { omega: 3 });
    assert_eq!(report["options"]["omega"], 3);
    assert!(report["matching"]["rows"].is_null() && report["curves_mm"].is_null());
    assert!(report["matching"]["paper"]["boundary_pairs"].as_u64() > Some(0));
}
