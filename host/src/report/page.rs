//! One page that shows a run: the model turning in space, both views with every stage as a layer, the
//! threshold, the invariants, gates, times and numbers; of a refused pair, how far it came and why no further.
//!
//! * **In**: a finished run, or a refusal; layers that need rasters are there if the record kept them.
//! * **Out**: [`Content`], which the script's one function `show` draws in place; and around it one HTML file that
//!   asks for nothing beyond itself, and says so to the browser (a content security policy without any source).
//!
//! Plotly, which the crate `plotly` carries, draws what turns and what is plotted
//! (`docs/decisions/0017-report-page.md`); the views are SVG.

pub(crate) mod picture;
mod space;
mod views;

use super::layers::frame::Frame;
use super::layers::pair::Pair;
use super::numbers::Gate;
use super::record::Record;
use super::times::{self, Part, Stage};
use super::{Refused, Run, words};
use crate::reconstruct::Refusal;
use serde::Serialize;
use serde_json::Value;
use shared::pipeline::{Finding, Side};
use space::Space;
use views::Views;

const TEMPLATE: &str = include_str!("page/page.html");
const STYLE: &str = include_str!("page/page.css");
const SCRIPT: &str = include_str!("page/page.js");

/// What stands in the head of a page, and says whose it is.
pub(crate) const MARK: &str = "<meta name=\"generator\" content=\"Ossature\">";

/// Layers that are shown at first.
const SHOWN: [&str; 3] = ["grey", "contour", "skeleton"];

/// What the script draws.
#[derive(Serialize)]
pub struct Content {
    title: String,
    gates: Vec<Gate>,
    /// How far a refused pair came; nothing if there is a model.
    reached: Option<String>,
    space: Option<Space>,
    views: Views,
    /// Of both eyes, with their levels; empty where pictures were not seen here.
    histograms: Vec<(Vec<u32>, u8)>,
    invariants: Option<Invariants>,
    /// What it works on, its name, and ms.
    times: Vec<(&'static str, &'static str, f64)>,
    /// `report.json`.
    report: Value,
}

/// e_omega of each way in which the hulls might be matched.
#[derive(Serialize)]
struct Invariants {
    values: Vec<f64>,
    chosen: usize,
    ways: &'static str,
}

impl Content {
    /// Of a run with its report ([`numbers::json`](super::numbers::json)), called `title`.
    #[must_use]
    pub fn of(run: &Run<'_>, report: &[u8], title: &str) -> Self {
        let outcome = &run.reconstruction.outcome;
        let pair = Pair::of(run.record, run.options.mode, outcome.vertical_offset);
        let views = Views::of(&pair, Frame::of(&pair.views, pair.offset), &SHOWN);
        Self {
            gates: Gate::all(run.reconstruction),
            space: Some(Space::of(run)),
            report: serde_json::from_slice(report).unwrap_or_default(),
            ..Self::before(title, &pair, views, (run.record, times::stages(run)))
        }
    }

    /// Of a refused pair: whole images, with the layers on show that tell why.
    #[must_use]
    pub fn refused(refused: &Refused<'_>, title: &str) -> Self {
        let Refused { options, record, refusal } = refused;
        let pair = Pair::of(record, options.mode, 0);
        let (gate, shown) = match refusal {
            Refusal::Gate(finding) => (Gate::of(finding), evidence(finding)),
            other => (Gate::refusal(other), &SHOWN[..]),
        };
        let stages = times::of_core(record);
        let mut reached = stages.last().map_or_else(
            || "No stage was reached.".to_owned(),
            |last| format!("The last stage was {} ({}).", last.name, last.part.name()),
        );
        for side in [Side::Left, Side::Right] {
            if !stages.iter().any(|stage| stage.part == Part::Eye(side)) {
                reached += &format!(" The {} image is shown as it came.", words::view(&side));
            }
        }
        let views = Views::of(&pair, pair.views.iter().map(Frame::whole).collect(), shown);
        Self {
            gates: vec![gate],
            reached: Some(reached),
            ..Self::before(title, &pair, views, (record, stages))
        }
    }

    /// What there is whether or not a model came of it.
    fn before(title: &str, pair: &Pair<'_>, views: Views, (record, stages): (&Record, Vec<Stage>)) -> Self {
        let seen = record.eyes.iter().filter(|eye| !eye.parts.histogram.is_empty());
        let ms = |stage: Stage| (stage.part.name(), stage.name, stage.time.as_secs_f64() * 1e3);
        Self {
            title: title.to_owned(),
            gates: Vec::new(),
            reached: None,
            space: None,
            views,
            histograms: seen.map(|eye| (eye.parts.histogram.clone(), eye.parts.level)).collect(),
            invariants: pair.invariants().map(|found| Invariants {
                values: found.values,
                chosen: found.chosen,
                ways: found.ways,
            }),
            times: stages.into_iter().map(ms).collect(),
            report: Value::Null,
        }
    }

    /// As the script takes it.
    #[must_use]
    pub fn json(&self) -> String {
        // Names are strings and numbers finite or null: nothing here can fail to be JSON.
        serde_json::to_string(self).unwrap_or_default()
    }

    /// As a page.
    #[must_use]
    pub fn html(&self) -> String {
        filled(&self.title, &self.json(), &Live::default())
    }
}

/// What a live page has beyond a report.
#[derive(Default)]
pub(crate) struct Live<'a> {
    /// What it may ask for, as a directive of its content security policy.
    pub(crate) policy: &'a str,
    pub(crate) style: &'a str,
    /// What stands above the gates, HTML.
    pub(crate) controls: &'a str,
    pub(crate) script: &'a str,
}

/// A page called `title` that waits for its first content.
pub(crate) fn live(title: &str, live: &Live<'_>) -> String {
    filled(title, "null", live)
}

fn filled(title: &str, data: &str, live: &Live<'_>) -> String {
    fill(
        TEMPLATE,
        &[
            ("title", &escaped(title)),
            ("policy", live.policy),
            ("style", &[STYLE, live.style].concat()),
            ("live", live.controls),
            ("data", &within_script(data)),
            ("plotly", plotly()),
            ("script", &[SCRIPT, live.script].concat()),
        ],
    )
}

/// The layers that show why a finding refuses.
const fn evidence(finding: &Finding) -> &'static [&'static str] {
    match finding {
        Finding::SizesDiffer { .. } => &["grey"],
        Finding::NoObject(..)
        | Finding::FillsImage(..)
        | Finding::SecondObject(..)
        | Finding::AreasDiffer(_) => &["grey", "mask"],
        Finding::FlatHull | Finding::Ambiguous(_) | Finding::NotAffine(_) | Finding::NoMap => {
            &["grey", "hull"]
        }
        Finding::SwappedEyes(_) | Finding::Unmatched(_) => &["grey", "contour", "matches"],
        Finding::SkeletonErased(_) => &["mask", "skeleton"],
        Finding::TouchesBorder(_)
        | Finding::TooLow(..)
        | Finding::NotRectified { .. }
        | Finding::VerticalOffset(_)
        | Finding::Capacity(_) => &["grey", "contour"],
    }
}

/// The template with its `{{names}}` filled in, in one pass: what is filled in is not looked into.
fn fill(template: &str, values: &[(&str, &str)]) -> String {
    let mut page = String::with_capacity(template.len() + values.iter().map(|(_, v)| v.len()).sum::<usize>());
    let mut parts = template.split("{{");
    page.push_str(parts.next().unwrap_or_default());
    for part in parts {
        let (name, rest) = part.split_once("}}").unwrap_or(("", part));
        page.push_str(values.iter().find(|(known, _)| *known == name).map_or("", |(_, value)| value));
        page.push_str(rest);
    }
    page
}

/// The library's script element, the first of those that the crate carries: the other sets formulas.
fn plotly() -> &'static str {
    static SCRIPT: std::sync::LazyLock<String> = std::sync::LazyLock::new(plotly::Plot::offline_js_sources);
    const END: &str = "</script>";
    SCRIPT.find(END).map_or("", |end| &SCRIPT[..end + END.len()])
}

/// Text that stays text in HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// JSON that cannot end the script element in which it stands.
fn within_script(json: &str) -> String {
    json.replace('<', "\\u003c")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reconstruct::Mode;
    use crate::report::fixture::Capsule;
    use crate::report::numbers;

    /// A page's own part, without the library.
    fn own(content: &Content) -> String {
        content.html().replace(plotly(), "")
    }

    fn page(capsule: &Capsule, title: &str) -> Content {
        Content::of(&capsule.run(), &numbers::json(&capsule.run()), title)
    }

    /// Names of the layers of both views.
    fn layers(content: &Content) -> [Vec<String>; 2] {
        let views = serde_json::to_value(&content.views).unwrap();
        let name = |layer: &Value| layer[0].as_str().unwrap().to_owned();
        [0, 1].map(|k| views["figures"][k]["layers"].as_array().unwrap().iter().map(name).collect())
    }

    #[test]
    fn a_page_names_no_address_and_keeps_its_policy() {
        let own = own(&page(&Capsule::new(Mode::Default, Record::new()), "a <b> \"cup\""));
        assert!(own.contains("<title>a &lt;b&gt; &quot;cup&quot;</title>"));
        assert!(own.contains("default-src 'none'") && own.contains(MARK));
        for address in ["http:", "https:", "src=\"/", "//cdn"] {
            let known = own.replace("http://www.w3.org/", "");
            assert!(!known.contains(address), "{address}");
        }
        assert!(!own.contains("{{"), "every place is filled");
    }

    #[test]
    fn every_stage_is_a_layer_of_both_views() {
        let found = layers(&page(&Capsule::new(Mode::Default, Record::new()), "capsule"));
        let both = ["grey", "mask", "distance", "contour", "skeleton", "hull", "matches"];
        for name in both {
            assert!(found.iter().all(|layers| layers.iter().any(|layer| layer == name)), "{name}");
        }
        assert!(found[0].contains(&"curves".to_owned()), "the left view is described by curves");
    }

    #[test]
    fn what_was_not_seen_has_no_layer_and_the_papers_match_has_letters() {
        let content = page(&Capsule::new(Mode::Paper { omega: 3 }, Record::figures_only()), "paper");
        let [left, right] = layers(&content);
        for layers in [&left, &right] {
            assert!(!layers.contains(&"grey".to_owned()) && layers.contains(&"contour".to_owned()));
        }
        let letters = content.json().matches("<text").count();
        assert!(letters >= 6 && letters.is_multiple_of(2), "{letters}");
        assert!(content.invariants.is_some_and(|found| found.values.len() > 3));
    }

    #[test]
    fn a_refused_pair_shows_how_far_it_came_and_why_no_further() {
        let bright = image::GrayImage::from_pixel(64, 48, image::Luma([200]));
        let options = crate::reconstruct::Options::default();
        let camera = crate::calibration::StereoCamera::rectified(64, 48, 75.0, 60.0);
        let mut record = Record::new();
        let views = [bright.clone(), bright.clone()];
        let [left, right] = views.clone();
        let refusal =
            crate::reconstruct::reconstruct(left, right, &camera, &options, &mut record).unwrap_err();
        record.complete(views.each_ref(), &options);
        let content =
            Content::refused(&Refused { options: &options, record: &record, refusal: &refusal }, "bright");
        assert!(own(&content).contains("no object in the left image"));
        assert_eq!(
            content.reached.as_deref(),
            Some("The last stage was threshold (left). The right image is shown as it came.")
        );
        assert_eq!(content.histograms.len(), 2, "the right view was looked at for the page");
        assert!(layers(&content).iter().all(|layers| layers.contains(&"grey".to_owned())));
    }

    #[test]
    fn what_is_filled_in_is_left_alone() {
        assert_eq!(fill("a {{x}} {{y}}{{z}}.", &[("x", "{{y}}"), ("y", "2")]), "a {{y}} 2.");
    }
}
