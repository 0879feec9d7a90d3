//! The core on emulated Cortex-M4F and Cortex-M7 boards makes what it makes on a PC: every stage of every
//! built-in shape, and of the cases with known truth where there are any, at 640x480 and at half that, with
//! the settings of a device and with all that the core can do; and of the shapes at 160x120 in the memory of
//! the smallest profile.
//!
//! The PC has words of 64 bits and memory without bounds, the boards words of 32 and the memory that the firmware
//! has. Says loudly when QEMU is not there, and fails then if `CI=true`. With `-- --nocapture` it also says what
//! each stage costs.

use oracle::board;
use oracle::core::Core;
use oracle::emulated::{self, Case, LARGEST, Line, Raw, sizes};
use oracle::sums::on_the_pc;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::LazyLock;

/// Every pair at the two largest sizes that the boards have room for, and the shapes at half of these.
fn all_cases() -> Vec<Case> {
    let fits = |(pair, _): &Raw| {
        let (width, height) = pair[0].dimensions();
        width <= LARGEST.0 && height <= LARGEST.1
    };
    let mut all = Vec::new();
    for (name, raw) in emulated::shapes() {
        let smaller: Vec<_> = sizes(raw).filter(fits).take(3).collect();
        all.extend(smaller[..2].iter().flat_map(|raw| Case::both_ways(&name, raw)));
        all.extend(Case::both_ways(&name, &smaller[2]).into_iter().filter(|case| case.as_device));
    }
    for (name, raw) in emulated::public_cases() {
        let two = sizes(raw).filter(fits).take(2);
        all.extend(two.flat_map(|raw| Case::both_ways(&format!("case {name}"), &raw)));
    }
    all
}

/// Mean cost of each stage, in thousands of instructions, over the shapes.
fn print_costs(cases: &[Case], lines: &[Vec<Line>]) {
    let mut columns: BTreeMap<String, BTreeMap<String, (u64, u64)>> = BTreeMap::new();
    let mut order = Vec::new();
    for (case, lines) in cases.iter().zip(lines).filter(|(case, _)| !case.name.starts_with("case")) {
        for (line, cost) in lines {
            let stage = line.rsplit_once(' ').unwrap().0.to_owned();
            if !order.contains(&stage) {
                order.push(stage.clone());
            }
            let (sum, count) = columns.entry(case.way()).or_default().entry(stage).or_default();
            *sum += cost;
            *count += 1;
        }
    }
    let mean = |stages: &BTreeMap<String, (u64, u64)>, stage: &str| {
        stages.get(stage).map_or(0.0, |(sum, count)| *sum as f64 / *count as f64 / 1e3)
    };
    println!("| stage | {} |", columns.keys().cloned().collect::<Vec<_>>().join(" | "));
    for stage in &order {
        let cells: Vec<_> = columns.values().map(|c| format!("{:.0}", mean(c, stage))).collect();
        println!("| {stage} | {} |", cells.join(" | "));
    }
    let total = |c| order.iter().map(|stage| mean(c, stage)).sum::<f64>();
    println!(
        "| all | {} |",
        columns.values().map(|c| format!("{:.0}", total(c))).collect::<Vec<_>>().join(" | ")
    );
}

/// The image, the cases, and what the PC makes of them.
type Bench = (PathBuf, Vec<Case>, Vec<Vec<String>>);

fn held_against_the_pc(machine: &str) {
    static BENCH: LazyLock<Option<Bench>> = LazyLock::new(|| {
        let image = board::build("stages", "mps2")?;
        let cases = all_cases();
        let expected = cases.par_iter().map(|case| on_the_pc(&mut Core::default(), case)).collect();
        Some((image, cases, expected))
    });
    let Some((image, cases, expected)) = &*BENCH else { return };
    let Some(found) = emulated::run(machine, image, cases) else { return };
    for ((case, found), expected) in cases.iter().zip(&found).zip(expected) {
        let found: Vec<_> = found.iter().map(|(line, _)| line).collect();
        let name = format!("{} {}", case.name, case.way());
        assert!(found.iter().copied().eq(expected), "{machine}, {name}: {found:#?} is not {expected:#?}");
        let may_refuse = case.name.starts_with("case") || case.pair[0].width() < 320;
        assert!(found.len() > 15 || may_refuse, "{name}: {found:?}");
    }
    println!("{machine}: {} cases", cases.len());
    print_costs(cases, &found);
}

#[test]
fn a_cortex_m4_makes_what_a_pc_makes() {
    held_against_the_pc(board::MACHINES[0]);
}

#[test]
fn a_cortex_m7_makes_what_a_pc_makes() {
    held_against_the_pc(board::MACHINES[1]);
}
