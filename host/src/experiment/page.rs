//! The results as a page of Markdown: a table or a picture for each of the paper's, and what is seen.

use std::fmt::Write;

use super::Experiments;
use super::study::{Study, Way, section_mm};
use crate::reconstruct::Front;
use crate::report::pictures::NAMES;

/// What stands where there is nothing.
const DASH: &str = "-";

/// The page.
pub(super) fn page(found: &Experiments) -> String {
    let mut page = String::from(
        "# Experiments\n\nThe experiments of the paper's section 5 on built-in shapes, 450 mm from a pair of \
         640 x 480 px, f = 750 px, 60 mm apart. Errors are mean distances between the surfaces, both \
         directions alike; percentages refer to the diagonal of the truth's box. Nothing is moved to fit.\n",
    );
    if found.front != Front::Balls {
        let text = "The visible side of the default's models, and of those along its curves, is measured in the grey \
                    levels of both images.";
        say(&mut page, text);
    }
    stages(&mut page, found);
    models(&mut page, found);
    all_shapes(&mut page, found);
    torus_sections(&mut page, found);
    animal_parts(&mut page, found);
    branches(&mut page, found);
    page
}

/// Adds a paragraph.
fn say(page: &mut String, text: &str) {
    // Writing to a string does not fail.
    let _ = writeln!(page, "\n{text}");
}

/// Adds a table under its caption.
fn table(page: &mut String, caption: &str, head: &[&str], rows: &[Vec<String>]) {
    say(page, &format!("**{caption}**"));
    let rule: Vec<&str> = head.iter().enumerate().map(|(i, _)| if i == 0 { "---" } else { "---:" }).collect();
    say(page, &format!("| {} |\n| {} |", head.join(" | "), rule.join(" | ")));
    for row in rows {
        let _ = writeln!(page, "| {} |", row.join(" | "));
    }
}

fn study<'a>(found: &'a Experiments, name: &str) -> Option<&'a Study> {
    found.shapes.iter().find(|study| study.name == name)
}

fn mm(value: Option<f64>) -> String {
    value.map_or(DASH.to_owned(), |value| format!("{value:.2}"))
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    (count > 0.0).then(|| sum / count)
}

/// Figure 7.
fn stages(page: &mut String, found: &Experiments) {
    let Some(torus) = study(found, "torus").filter(|torus| torus.found(Way::Full).is_some()) else { return };
    say(page, "## Figure 7: the stages of the torus");
    say(
        page,
        "From the binary images over skeletons, boundaries and hulls to the matched curves; the model follows in Figure 8.",
    );
    for name in NAMES.iter().filter(|name| **name != "model.png") {
        say(page, &format!("![{}: {name}]({}/pictures/{name})", torus.name, torus.name));
    }
}

/// Figures 8 to 12.
fn models(page: &mut String, found: &Experiments) {
    say(page, "## Figures 8 to 12: originals and their reconstructions");
    let figures = [
        ("torus", "8"),
        ("screwdriver", "10"),
        ("teapot", "11"),
        ("animal", "11"),
        ("block", "11"),
        ("mouse", "12"),
    ];
    for (name, number) in figures {
        let Some(error) = study(found, name).and_then(|study| study.error(Way::Full)) else { continue };
        say(page, &format!("**Figure {number}: {name}.** The model is {:.2} mm off on average.", error[0]));
        say(page, &format!("![{name}]({name}/pictures/model.png)"));
        let noisy = study(found, &format!("{name}_noise")).and_then(|study| study.error(Way::Full));
        if let Some(noisy) = noisy {
            say(
                page,
                &format!(
                    "**Figure 9: the {name} in noise** of 20 grey levels with 2 % salt and pepper. The model is {:.2} mm off, against {:.2} mm without noise.",
                    noisy[0], error[0]
                ),
            );
            say(page, "![noise](figures/fig-09-noise.png)");
        }
    }
}

/// Every shape in every way.
fn all_shapes(page: &mut String, found: &Experiments) {
    say(page, "## All shapes in all ways");
    let head: Vec<&str> = ["shape"].into_iter().chain(Way::ALL.map(Way::name)).collect();
    let mut reasons = Vec::new();
    let mut row = |study: &Study| {
        let mut cells = vec![format!("[{}](figures/ways-{}.png)", study.name, study.name)];
        for (way, result) in &study.ways {
            cells.push(match (study.error(*way), result) {
                (Some([mm, percent]), _) => format!("{percent:.2} % ({mm:.2} mm)"),
                (None, Err(reason)) => {
                    reasons.push(format!("{}, {}: {reason}", study.name, way.name()));
                    format!("{DASH} ({})", reasons.len())
                }
                (None, Ok(_)) => DASH.to_owned(),
            });
        }
        cells
    };
    let rows: Vec<_> = found.shapes.iter().map(&mut row).collect();
    table(page, "Symmetric mean error", &head, &rows);
    if !reasons.is_empty() {
        say(page, "Refused:\n");
        for (number, reason) in (1..).zip(&reasons) {
            let _ = writeln!(page, "{number}. {reason}");
        }
    }
    let best = |study: &&Study| {
        let own = study.error(Way::Full);
        [Way::Hull, Way::Inflation].iter().all(|way| match (own, study.error(*way)) {
            (Some(own), Some(other)) => own[0] < other[0],
            (own, _) => own.is_some(),
        })
    };
    let count = found.shapes.iter().filter(best).count();
    say(
        page,
        &format!(
            "The default is nearer to the truth than both baselines for {count} of {} pairs. The visual hull of two eyes side by side stays open in depth and is cut to be no deeper than it is wide and high; inflation has one depth for all of the object.",
            found.shapes.len()
        ),
    );
    for study in found.shapes.iter().filter(|study| ["torus", "animal"].contains(&study.name.as_str())) {
        say(page, &format!("![{} in all ways](figures/ways-{}.png)", study.name, study.name));
    }
}

/// Table 4.
fn torus_sections(page: &mut String, found: &Experiments) {
    let Some(torus) = study(found, "torus") else { return };
    let sections = |way: Way| -> Vec<Option<f64>> {
        torus.found(way).map_or(Vec::new(), |f| f.evaluation.sections.rows.iter().map(section_mm).collect())
    };
    let columns = Way::ALL.map(sections);
    let count = columns.iter().map(Vec::len).max().unwrap_or(0);
    let cell = |column: &Vec<Option<f64>>, i: usize| mm(column.get(i).copied().flatten());
    let mut rows: Vec<Vec<String>> = (0..count)
        .map(|i| [(i + 1).to_string()].into_iter().chain(columns.iter().map(|c| cell(c, i))).collect())
        .collect();
    let means = columns.each_ref().map(|column| mean(column.iter().flatten().copied()));
    rows.push(["mean".to_owned()].into_iter().chain(means.map(mm)).collect());
    say(page, "## Table 4: the torus in eight cross-sections");
    let head: Vec<&str> = ["section"].into_iter().chain(Way::ALL.map(Way::name)).collect();
    table(page, "Mean smallest distance between the outlines, mm", &head, &rows);
    if let [Some(own), .., Some(hull), Some(inflation)] = means {
        say(
            page,
            &format!(
                "The default's sections are {:.0} times nearer to the truth than the visual hull's and {:.0} times nearer than the inflated silhouette's.",
                hull / own,
                inflation / own
            ),
        );
    }
}

/// Table 5.
fn animal_parts(page: &mut String, found: &Experiments) {
    if found.parts.is_empty() {
        return;
    }
    say(page, "## Table 5: the animal by parts");
    let head: Vec<&str> = ["part", "section"].into_iter().chain(Way::ALL.map(Way::name)).collect();
    let rows: Vec<Vec<String>> = found
        .parts
        .iter()
        .map(|row| {
            let cells = row.mean_mm.iter().map(|(_, value)| mm(*value));
            [row.part.name().to_owned(), row.section.to_string()].into_iter().chain(cells).collect()
        })
        .collect();
    table(page, "Mean smallest distance between the outlines of each part, mm", &head, &rows);
    let by_part = crate::shape::animal::Part::ALL.map(|part| {
        let own = found.parts.iter().filter(|row| row.part == part);
        let default =
            |row: &super::Row| row.mean_mm.iter().find(|(way, _)| *way == Way::Full).and_then(|v| v.1);
        format!("{} {}", part.name(), mm(mean(own.filter_map(default))))
    });
    say(
        page,
        &format!(
            "Means of the default: {} mm. Where the outline runs along the rows, as at back and belly, the pair says little about depth: there it is farthest off. A dash: the plane does not meet the part.",
            by_part.join(", ")
        ),
    );
}

/// Figures 13 and 14.
fn branches(page: &mut String, found: &Experiments) {
    let (Some(first), Some(last)) = (found.branches.first(), found.branches.last()) else { return };
    say(page, "## Figures 13 and 14: the animal against the number of branches");
    say(page, "![models](figures/fig-13-branches.png)");
    say(page, "![error](figures/fig-14-accuracy.png)");
    let head = ["asked for", "found", "mean error, mm", "%", "truth to model, mm", "volume in common"];
    let row = |point: &super::Point| {
        let share = point.volume_iou.map_or(DASH.to_owned(), |iou| format!("{:.1} %", 100.0 * iou));
        let (error, percent, missing) = (mm(point.mean_mm), mm(point.mean_pct), mm(point.missing_mm));
        let error = point.refused.as_ref().map_or(error, |reason| format!("{DASH} ({reason})"));
        vec![point.branches.to_string(), point.found.to_string(), error, percent, missing, share]
    };
    let rows: Vec<_> = found.branches.iter().map(row).collect();
    table(page, "Balls along the curves of pruned skeletons", &head, &rows);
    say(
        page,
        &format!(
            "From {} to {} branches the mean error goes from {} to {} mm: a limb without a branch is missing, and once every limb has its own there is nothing left to gain.",
            first.branches,
            last.branches,
            mm(first.mean_mm),
            mm(last.mean_mm)
        ),
    );
}
