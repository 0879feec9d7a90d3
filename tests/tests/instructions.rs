//! What the core costs on an emulated Cortex-M7, in instructions: for the built-in shapes at 320x240 and, in
//! the memory of the smallest profile, at 160x120, held to `frozen/instructions.txt`; for the cases with known
//! truth near 320x240 a table. Two runs count the same.
//!
//! Growth by more than 3 % of a pair, or of a stage above 100,000 instructions, fails. What has become cheaper
//! by that much is said, so that the bound can follow: `REGENERATE=1` freezes what is found. Counts belong to
//! a compiler, which the file names. With another one the bound is not applied, which is said loudly; in CI
//! (`CI=true`) it is, as there nothing may be skipped: the sentence then names both compilers, and what to do
//! is to freeze the counts of the commit before. Goals are printed beside the figures.

use oracle::board;
use oracle::emulated::{self, Case, Raw, sizes};
use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::Command;
use std::sync::LazyLock;

const FROZEN: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/frozen/instructions.txt");
/// Growth that fails, per cent.
const BOUND: u64 = 3;
/// Stages below this are counted within their pair alone, instructions.
const SMALL_STAGE: u64 = 100_000;
/// Width of the pictures that the smallest of the boards' memories takes, px.
const SMALL: u32 = 160;

/// Settings, which pairs, and goals for their median and their worst, instructions.
type Group = (&'static str, fn(&Case) -> bool, [Option<u64>; 2]);
const GROUPS: [Group; 3] = [
    ("full", |case| !case.as_device, [Some(20_000_000), Some(35_000_000)]),
    ("device", |case| case.as_device && !is_small(case), [Some(20_000_000), Some(35_000_000)]),
    ("small", is_small, [None, Some(8_000_000)]),
];

fn is_small(case: &Case) -> bool {
    case.pair[0].width() <= SMALL
}

/// Instructions of each stage, in order; the last, `all`, is their sum.
type Stages = Vec<(String, u64)>;
/// Those of each case.
type Counts = Vec<(String, Stages)>;

fn counted(cases: &[Case]) -> Option<Counts> {
    static IMAGE: LazyLock<Option<PathBuf>> = LazyLock::new(|| board::build("stages", "mps2"));
    let lines = emulated::run(board::MACHINES[1], IMAGE.as_ref()?, cases)?;
    let stages = |lines: &Vec<emulated::Line>| {
        let stage = |line: &str| line.rsplit_once(' ').unwrap().0.replace(' ', "-");
        let mut stages: Stages = lines.iter().map(|(line, cost)| (stage(line), *cost)).collect();
        stages.push(("all".to_owned(), lines.iter().map(|(_, cost)| cost).sum()));
        stages
    };
    let named = |case: &Case| format!("{} {}", case.name, case.way());
    Some(cases.iter().zip(&lines).map(|(case, lines)| (named(case), stages(lines))).collect())
}

/// The compiler, as it names itself.
fn compiler() -> String {
    let rustc = std::env::var_os("RUSTC").unwrap_or("rustc".into());
    let output = Command::new(rustc).arg("--version").output().unwrap();
    String::from_utf8(output.stdout).unwrap().trim().to_owned()
}

/// The frozen file: the compiler, then a line a case, its stages and their counts.
fn written(counts: &Counts) -> String {
    let mut text = format!("{}\n", compiler());
    for (case, stages) in counts {
        let stages: Vec<_> = stages.iter().map(|(stage, count)| format!("{stage} {count}")).collect();
        writeln!(text, "{case}: {}", stages.join(", ")).unwrap();
    }
    text
}

fn read(text: &str) -> (String, Counts) {
    let (compiler, rest) = text.split_once('\n').unwrap_or_default();
    let stage = |text: &str| {
        let (stage, count) = text.split_once(' ').unwrap();
        (stage.to_owned(), count.parse().unwrap())
    };
    let case = |line: &str| {
        let (case, stages) = line.split_once(": ").unwrap();
        (case.to_owned(), stages.split(", ").map(stage).collect())
    };
    (compiler.to_owned(), rest.lines().map(case).collect())
}

/// A table of thousands a group, its median and its worst beside the goals.
fn print_tables(cases: &[Case], counts: &Counts) {
    for (group, belongs, goals) in GROUPS {
        let chosen: Vec<_> = cases.iter().zip(counts).filter(|(case, _)| belongs(case)).collect();
        let Some((_, (_, longest))) = chosen.iter().max_by_key(|(_, (_, stages))| stages.len()) else {
            continue;
        };
        let names: Vec<_> = chosen.iter().map(|(case, _)| &*case.name).collect();
        println!("\n| {group} | {} |\n|---|{}", names.join(" | "), "---|".repeat(names.len()));
        for (stage, _) in longest {
            // A pair that is refused has fewer stages.
            let count = |stages: &Stages| {
                let found = stages.iter().find(|(name, _)| name == stage);
                found.map_or(String::new(), |(_, count)| (count / 1000).to_string())
            };
            let cells: Vec<_> = chosen.iter().map(|(_, (_, stages))| count(stages)).collect();
            println!("| {stage} | {} |", cells.join(" | "));
        }
        let mut totals: Vec<_> = chosen.iter().map(|(_, (_, stages))| stages.last().unwrap().1).collect();
        totals.sort_unstable();
        let figures = [("median", totals[totals.len() / 2]), ("worst", totals[totals.len() - 1])];
        for ((what, found), goal) in figures.into_iter().zip(goals) {
            let verdict = goal.map(|goal| if found <= goal { "met" } else { "MISSED" });
            let goal = goal.map_or("none".to_owned(), |goal| (goal / 1000).to_string());
            println!("{group}, {what}: {}; goal: {goal} {}", found / 1000, verdict.unwrap_or_default());
        }
    }
}

#[test]
fn the_shapes_cost_no_more_than_is_frozen() {
    let mut cases = Vec::new();
    for (name, raw) in emulated::shapes() {
        let [half, quarter] = [1, 2].map(|k| sizes(raw.clone()).nth(k).unwrap());
        cases.extend(Case::both_ways(&name, &half));
        cases.extend(Case::both_ways(&name, &quarter).into_iter().filter(|case| case.as_device));
    }
    let Some(found) = counted(&cases) else { return };
    assert_eq!(counted(&cases).unwrap(), found, "two runs count the same");
    print_tables(&cases, &found);

    if std::env::var_os("REGENERATE").is_some() {
        std::fs::write(FROZEN, written(&found)).unwrap();
    }
    let (frozen_by, frozen) = read(&std::fs::read_to_string(FROZEN).unwrap_or_default());
    let mut compilers = String::new();
    if compiler() != frozen_by {
        compilers = format!("counted by {}, frozen by {frozen_by}: ", compiler());
        eprintln!("\n!!!! ANOTHER COMPILER: {compilers}its counts are its own !!!!\n");
        if std::env::var_os("CI").is_none_or(|ci| ci != "true") {
            eprintln!("\n!!!! SKIPPED: the bound on instructions is NOT applied !!!!\n");
            return;
        }
    }
    held_to(&frozen, &found).unwrap_or_else(|grown| panic!("{compilers}{grown}"));
}

/// Says what has become cheaper.
///
/// # Errors
/// What costs more than the bound allows, or is not among what is frozen.
fn held_to(frozen: &Counts, found: &Counts) -> Result<(), String> {
    let names = |counts: &Counts| -> Vec<_> {
        let stages = |(case, stages): &(String, Stages)| {
            stages.iter().map(|(stage, _)| format!("{case}, {stage}")).collect::<Vec<_>>()
        };
        counts.iter().flat_map(stages).collect()
    };
    if names(frozen) != names(found) {
        return Err("other pairs or stages than are frozen: REGENERATE=1 freezes what is found".to_owned());
    }
    let all = |counts: &Counts| -> Vec<u64> {
        counts.iter().flat_map(|(_, stages)| stages.iter().map(|(_, count)| *count)).collect()
    };
    let mut grown = String::new();
    for ((name, before), now) in names(found).into_iter().zip(all(frozen)).zip(all(found)) {
        let of_weight = now.max(before) > SMALL_STAGE;
        if of_weight && now * 100 > before * (100 + BOUND) {
            let _ = write!(grown, "\n{name}: {now}, frozen {before}");
        } else if of_weight && now * 100 < before * (100 - BOUND) {
            println!("cheaper: {name}: {now}, frozen {before}; REGENERATE=1 lets the bound follow");
        }
    }
    let sentence = format!("more than {BOUND} % above what is frozen (on purpose? REGENERATE=1):{grown}");
    if grown.is_empty() { Ok(()) } else { Err(sentence) }
}

#[test]
fn the_bound_is_three_per_cent_of_what_has_weight() {
    let counts = |all: u64, hull: u64| -> Counts {
        vec![("a pair".to_owned(), vec![("left-hull".to_owned(), hull), ("all".to_owned(), all)])]
    };
    let frozen = counts(1_000_000, 90_000);
    assert_eq!(held_to(&frozen, &counts(1_030_000, 99_000)), Ok(()));
    assert!(held_to(&frozen, &counts(1_030_001, 90_000)).is_err_and(|grown| grown.contains("a pair, all")));
    assert!(held_to(&frozen, &counts(1_000_000, 101_000)).is_err_and(|grown| grown.contains("left-hull")));
    assert_eq!(held_to(&frozen, &counts(500_000, 40_000)), Ok(()));
    assert!(held_to(&Counts::new(), &frozen).is_err());
    assert_eq!(read(&written(&frozen)), (compiler(), frozen));
}

#[test]
fn the_public_cases_cost_what_the_table_says() {
    const PIXELS: f64 = 320.0 * 240.0;
    let off = |(pair, _): &Raw| (f64::from(pair[0].width() * pair[0].height()) / PIXELS).ln().abs();
    let near = |raw: Raw| sizes(raw).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap();
    let cases: Vec<_> = emulated::public_cases()
        .into_iter()
        .flat_map(|(name, raw)| Case::both_ways(&name, &near(raw)))
        .collect();
    let Some(found) = (!cases.is_empty()).then(|| counted(&cases)).flatten() else { return };
    assert_eq!(counted(&cases).unwrap(), found, "two runs count the same");
    print_tables(&cases, &found);
}
