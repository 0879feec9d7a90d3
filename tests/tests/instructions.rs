//! What the core costs on an emulated Cortex-M7, in instructions: for the built-in shapes at 320x240 and, in
//! the memory of the smallest profile, at 160x120, held to `frozen/instructions.txt`; for the cases with known
//! truth near 320x240 a table. Two runs count the same.
//!
//! Growth by more than 3 % of a pair, or of a stage above 100,000 instructions, fails. What has become cheaper
//! by that much is said, so that the bound can follow: `REGENERATE=1` freezes what is found. Counts belong to
//! a compiler, which the file names. With another one the bound is not applied, which is said loudly; in CI
//! (`CI=true`) it is, as there nothing may be skipped: the sentence then names both compilers, and what to do
//! is to freeze the counts of the change before. Goals are printed beside the figures.

use oracle::board;
use oracle::emulated::{self, Case, Raw, sizes};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::Command;
use std::sync::LazyLock;

const FROZEN: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/frozen/instructions.txt");
/// Growth that fails, per cent.
const BOUND: u64 = 3;
/// Stages below this are counted within their pair alone, instructions.
const SMALL_STAGE: u64 = 100_000;
/// Instructions of a pair at 320x240: the median over the pairs, and the worst.
const GOALS: [u64; 2] = [20_000_000, 35_000_000];
/// The worst pair of the smallest profile.
const SMALL_GOAL: u64 = 8_000_000;

/// Instructions by pair and stage; the stage `all` is their sum.
type Counts = BTreeMap<(String, String), u64>;

/// The image; nothing where the target is missing.
fn image() -> Option<&'static PathBuf> {
    static IMAGE: LazyLock<Option<PathBuf>> = LazyLock::new(|| board::build("stages", "mps2"));
    IMAGE.as_ref()
}

/// Name, size and settings.
fn named(case: &Case) -> String {
    format!("{} {}", case.name, case.way())
}

/// Whether the smallest of the boards' memories takes it.
fn is_small(case: &Case) -> bool {
    case.pair[0].width() <= 160
}

fn counted(cases: &[Case]) -> Option<Counts> {
    let lines = emulated::run(board::MACHINES[1], image()?, cases)?;
    let mut counts = Counts::new();
    for (case, lines) in cases.iter().zip(lines) {
        let name = named(case);
        for (line, cost) in lines {
            let stage = line.rsplit_once(' ').unwrap().0.replace(' ', "-");
            counts.insert((name.clone(), stage), cost);
            *counts.entry((name.clone(), "all".to_owned())).or_default() += cost;
        }
    }
    Some(counts)
}

/// The compiler, as it names itself.
fn compiler() -> String {
    let rustc = std::env::var_os("RUSTC").unwrap_or("rustc".into());
    let output = Command::new(rustc).arg("--version").output().unwrap();
    String::from_utf8(output.stdout).unwrap().trim().to_owned()
}

/// The frozen file: the compiler, then pair and stage and count.
fn written(counts: &Counts) -> String {
    let mut text = format!("{}\n", compiler());
    for ((case, stage), count) in counts {
        writeln!(text, "{case} {stage} {count}").unwrap();
    }
    text
}

fn read(text: &str) -> (String, Counts) {
    let (compiler, rest) = text.split_once('\n').unwrap_or_default();
    let entry = |line: &str| {
        let (name, count) = line.rsplit_once(' ').unwrap();
        let (case, stage) = name.rsplit_once(' ').unwrap();
        ((case.to_owned(), stage.to_owned()), count.parse().unwrap())
    };
    (compiler.to_owned(), rest.lines().map(entry).collect())
}

/// Totals of the pairs, and by their settings the median and the worst beside the goals.
fn print_totals(cases: &[Case], counts: &Counts) {
    let mut ways: BTreeMap<&str, Vec<(String, u64)>> = BTreeMap::new();
    for case in cases {
        let total = counts[&(named(case), "all".to_owned())];
        let way = match (is_small(case), case.as_device) {
            (true, _) => "small",
            (false, true) => "device",
            (false, false) => "full",
        };
        ways.entry(way).or_default().push((named(case), total));
    }
    println!("| pair | thousands of instructions | goal |\n|---|---|---|");
    for (way, mut pairs) in ways {
        pairs.sort_by_key(|(_, count)| *count);
        let goals = if way == "small" { [None, Some(SMALL_GOAL)] } else { GOALS.map(Some) };
        let goal = |found: u64, goal: Option<u64>| {
            let said = |goal| format!("{} {}", if found <= goal { "met," } else { "MISSED," }, goal / 1000);
            goal.map_or(String::new(), said)
        };
        for (name, count) in &pairs {
            let described = counts.contains_key(&(name.clone(), "pair-curves".to_owned()));
            println!("| {name}{} | {} | |", if described { "" } else { " (refused)" }, count / 1000);
        }
        let (median, worst) = (pairs[pairs.len() / 2].1, pairs[pairs.len() - 1].1);
        println!("| {way}: median | {} | {} |", median / 1000, goal(median, goals[0]));
        println!("| {way}: worst | {} | {} |", worst / 1000, goal(worst, goals[1]));
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
    print_totals(&cases, &found);

    if std::env::var_os("REGENERATE").is_some() {
        std::fs::write(FROZEN, written(&found)).unwrap();
    }
    let (frozen_by, frozen) = read(&std::fs::read_to_string(FROZEN).unwrap_or_default());
    let in_ci = std::env::var_os("CI").is_some_and(|ci| ci == "true");
    let compilers = if compiler() == frozen_by {
        String::new()
    } else {
        format!("counted by {}, frozen by {frozen_by}. ", compiler())
    };
    if !compilers.is_empty() {
        eprintln!("\n!!!! ANOTHER COMPILER: {compilers}Its counts are its own !!!!\n");
        if !in_ci {
            eprintln!("\n!!!! SKIPPED: the bound on instructions is NOT applied !!!!\n");
            return;
        }
    }
    let names = |counts: &Counts| counts.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&found), names(&frozen), "other pairs or stages: REGENERATE=1 freezes what is found");
    let mut grown = String::new();
    for (((case, stage), &now), &before) in found.iter().zip(frozen.values()) {
        let of_weight = stage == "all" || now.max(before) > SMALL_STAGE;
        if of_weight && now * 100 > before * (100 + BOUND) {
            writeln!(grown, "{case}, {stage}: {now}, frozen {before}").unwrap();
        } else if of_weight && now * 100 < before * (100 - BOUND) {
            println!("cheaper: {case}, {stage}: {now}, frozen {before}; REGENERATE=1 lets the bound follow");
        }
    }
    assert!(
        grown.is_empty(),
        "{compilers}more than {BOUND} % above what is frozen (on purpose? REGENERATE=1):\n{grown}"
    );
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
    print_totals(&cases, &found);
}
