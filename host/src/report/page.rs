//! One page that shows a run: the model turning in space, both views with every stage as a layer, the
//! threshold, the invariants, gates, times and numbers.
//!
//! * **In**: a finished run; layers that need rasters are there if the record kept them.
//! * **Out**: one HTML file that asks for nothing beyond itself, and says so to the browser (a content
//!   security policy without any source). It reads on a phone and in the dark.
//!
//! Plotly, which the crate `plotly` carries, draws what turns and what is plotted
//! (`docs/decisions/0017-report-page.md`); the views are SVG.

mod space;
mod views;

use super::{Run, words};
use serde::Serialize;
use serde_json::{Value, json};
use shared::fixed::ONE;
use shared::pipeline::Finding;
use space::Space;

const TEMPLATE: &str = include_str!("page/page.html");
const STYLE: &str = include_str!("page/page.css");
const SCRIPT: &str = include_str!("page/page.js");

/// What the script draws.
#[derive(Serialize)]
struct Data {
    space: Space,
    /// Of both eyes, with their levels; empty where pictures were not seen here.
    histograms: Vec<(Vec<u32>, u8)>,
    /// e_omega of each shift of the right hull, and the shift picked.
    shifts: Option<(Vec<f64>, usize)>,
    report: Value,
}

/// The page of a run with its report ([`numbers::json`](super::numbers::json)), called `title`.
#[must_use]
pub fn html(run: &Run<'_>, report: &[u8], title: &str) -> String {
    let report = serde_json::from_slice(report).unwrap_or_default();
    let eyes = &run.record.eyes;
    let seen = eyes.iter().filter(|eye| !eye.parts.histogram.is_empty());
    let data =
        Data {
            space: Space::of(run),
            histograms: seen.map(|eye| (eye.parts.histogram.clone(), eye.parts.level)).collect(),
            shifts: run.record.pair.cuts.as_ref().map(|cuts| {
                (cuts.errors.iter().map(|&e| f64::from(e) / f64::from(ONE)).collect(), cuts.shift)
            }),
            report,
        };
    let (switches, views) = views::both(run);
    fill(
        TEMPLATE,
        &[
            ("title", &escaped(title)),
            ("style", STYLE),
            ("gates", &gates(run)),
            ("switches", &switches),
            ("views", &views),
            ("data", &within_script(&json!(data).to_string())),
            ("plotly", plotly()),
            ("script", SCRIPT),
        ],
    )
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

/// Everything the user should know, in sentences.
fn gates(run: &Run<'_>) -> String {
    let item = |finding: &Finding| {
        let class = if finding.refuses() { "refusal" } else { "warning" };
        format!(
            "<li class=\"{class}\"><b>{}</b> {}</li>",
            words::name(finding),
            escaped(&words::sentence(finding))
        )
    };
    let items: String = run.reconstruction.outcome.findings.iter().map(item).collect();
    if items.is_empty() { "<li class=\"good\">No gate has anything to say.</li>".to_owned() } else { items }
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
    use crate::report::record::Record;

    #[test]
    fn a_page_names_no_address_and_keeps_its_policy() {
        let capsule = Capsule::new(Mode::Default, Record::new());
        let page = html(&capsule.run(), &numbers::json(&capsule.run()), "a <b> \"cup\"");
        assert!(page.contains("<title>a &lt;b&gt; &quot;cup&quot;</title>"));
        assert!(page.contains("default-src 'none'"));
        let own = page.replace(plotly(), "");
        for address in ["http:", "https:", "src=\"/", "//cdn"] {
            let known = own.replace("http://www.w3.org/", "");
            assert!(!known.contains(address), "{address}");
        }
        assert!(!own.contains("{{"), "every place is filled");
        for layer in ["grey", "mask", "distance", "skeleton", "pruned", "contour", "hull", "matches"] {
            assert_eq!(own.matches(&format!("class=\"layer {layer}\"")).count(), 2, "{layer}");
        }
    }

    #[test]
    fn what_was_not_seen_has_no_layer() {
        let capsule = Capsule::new(Mode::Paper { omega: 3 }, Record::figures_only());
        let page = html(&capsule.run(), &numbers::json(&capsule.run()), "paper");
        assert!(!page.contains("class=\"layer grey\""));
        assert!(page.contains("class=\"layer contour\""));
    }

    #[test]
    fn what_is_filled_in_is_left_alone() {
        assert_eq!(fill("a {{x}} {{y}}{{z}}.", &[("x", "{{y}}"), ("y", "2")]), "a {{y}} 2.");
    }
}
