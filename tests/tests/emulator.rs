//! The core on emulated Cortex-M4F and Cortex-M7 boards makes what it makes on a PC: every stage of every
//! built-in shape, and of the cases with known truth where there are any, at 640x480 and at half that, with
//! the settings of a device and with all that the core can do.
//!
//! The PC goes through both pictures at once, with words of 64 bits and memory without bounds; the boards
//! take one picture after the other in the memory that the firmware has. Says loudly when QEMU is not there,
//! and fails then if `CI=true`. With `-- --nocapture` it also says what each stage costs.

use firmware::stages::Stages;
use host::calibration::StereoCamera;
use host::shape::Shape;
use host::stage::rectify::Rectification;
use image::GrayImage;
use oracle::board;
use oracle::cases;
use oracle::core::{Core, Picture};
use oracle::scene::{self, Pair};
use rayon::prelude::*;
use shared::pipeline::{Settings, Side};
use shared::stage::depth::Optics;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::LazyLock;
use std::time::Duration;

/// Largest pictures that the boards have room for, px.
const LARGEST: (u32, u32) = (640, 480);
/// An image that runs longer hangs.
const LIMIT: Duration = Duration::from_secs(400);

/// One run of the core.
struct Case {
    name: String,
    pair: Pair,
    optics: Optics,
    as_device: bool,
}

/// Raw pairs with their calibrations.
fn pairs() -> Vec<(String, (Pair, StereoCamera))> {
    let shape = |shape: Shape| (shape.name().to_owned(), (scene::pair(shape, 1), scene::camera(1)));
    let mut pairs: Vec<_> = Shape::ALL.into_par_iter().map(shape).collect();
    for case in cases::folder().map(|folder| cases::cases(&folder)).unwrap_or_default() {
        pairs.push((format!("case {}", cases::name(&case)), cases::open(&case)));
    }
    pairs
}

/// Every pair, rectified as a device does it, at the two largest sizes that the boards have room for.
fn all_cases() -> Vec<Case> {
    let mut all = Vec::new();
    for (name, raw) in pairs() {
        let fits = |(pair, _): &(Pair, StereoCamera)| {
            let (width, height) = pair[0].dimensions();
            width <= LARGEST.0 && height <= LARGEST.1
        };
        let sizes = std::iter::successors(Some(raw), |larger| Some(cases::halved(larger)));
        for ([left, right], camera) in sizes.filter(fits).take(2) {
            let rectification = Rectification::same_size(&camera).unwrap();
            let model = rectification.model();
            let pair = rectification.device_images(left, right).unwrap();
            let optics =
                Optics { focal: model.fixed_focal(), disparity_offset: model.fixed_disparity_offset() };
            for as_device in [false, true] {
                let way = if as_device { "device" } else { "full" };
                let name = format!("{name} {}x{} {way}", model.width, model.height);
                all.push(Case { name, pair: pair.clone(), optics, as_device });
            }
        }
    }
    all
}

/// What the PC makes of a case: a line a stage.
fn on_the_pc(case: &Case) -> Vec<String> {
    let settings = if case.as_device { Settings::device(case.optics) } else { Settings::new(case.optics) };
    let rows = |image: &GrayImage| -> Picture {
        image.as_raw().chunks(image.width() as usize).map(<[u8]>::to_vec).collect()
    };
    let [left, right] = case.pair.each_ref().map(rows);
    let mut lines = Vec::new();
    let mut samples = Vec::new();
    // A device does not look at the right eye's skeleton.
    let skeleton =
        |side, stage| side == Some(Side::Right) && ["distance", "skeleton", "graph"].contains(&stage);
    let mut stages = Stages::new((), |record| {
        if !skeleton(record.side, record.stage) {
            lines.push(record.to_string());
        }
    });
    let outcome = Core::default().run([&left, &right], &settings, "", &mut stages, |memory, _| {
        samples.extend_from_slice(memory.eyes[0].samples);
    });
    stages.ended(&outcome, &samples);
    lines
}

/// The file that the boards read.
fn written(cases: &[Case]) -> (tempfile::TempDir, PathBuf) {
    let mut bytes = Vec::new();
    for case in cases {
        let (width, height) = case.pair[0].dimensions();
        let Optics { focal, disparity_offset } = case.optics;
        let numbers = [width as i32, height as i32, focal, disparity_offset, i32::from(case.as_device), 0];
        bytes.extend(numbers.iter().flat_map(|n| n.to_le_bytes()));
        case.pair.iter().for_each(|image| bytes.extend_from_slice(image.as_raw()));
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pairs");
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

/// Lines of a machine's stages by case, and what each stage cost.
type Lines = Vec<Vec<(String, u64)>>;

fn on_a_board(machine: &str, image: &std::path::Path, cases: &[Case]) -> Option<Lines> {
    let (_folder, path) = written(cases);
    let said = board::run(machine, image, &[&path], LIMIT)?;
    assert!(said.ends_with("done\n"), "{machine} stopped early: {said}");
    let mut lines = vec![Vec::new(); cases.len()];
    for line in said.lines().filter(|line| *line != "done") {
        let parsed = line.split_once(' ').and_then(|(number, rest)| {
            let (line, cost) = rest.rsplit_once(' ')?;
            Some((number.parse::<usize>().ok()?, line.to_owned(), cost.parse().ok()?))
        });
        let (number, line, cost) = parsed.unwrap_or_else(|| panic!("{machine} said {line:?}"));
        lines[number].push((line, cost));
    }
    Some(lines)
}

/// Mean cost of each stage, in thousands of instructions, over the shapes.
fn print_costs(cases: &[Case], lines: &Lines) {
    let mut columns: BTreeMap<String, BTreeMap<String, (u64, u64)>> = BTreeMap::new();
    let mut order = Vec::new();
    for (case, lines) in cases.iter().zip(lines).filter(|(case, _)| !case.name.starts_with("case")) {
        let column = case.name.split_once(' ').unwrap().1;
        for (line, cost) in lines {
            let stage = line.rsplit_once(' ').unwrap().0.to_owned();
            if !order.contains(&stage) {
                order.push(stage.clone());
            }
            let (sum, count) = columns.entry(column.to_owned()).or_default().entry(stage).or_default();
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
        let expected = cases.par_iter().map(on_the_pc).collect();
        Some((image, cases, expected))
    });
    let Some((image, cases, expected)) = &*BENCH else { return };
    let Some(found) = on_a_board(machine, image, cases) else { return };
    for ((case, found), expected) in cases.iter().zip(&found).zip(expected) {
        let found: Vec<_> = found.iter().map(|(line, _)| line).collect();
        assert!(
            found.iter().copied().eq(expected),
            "{machine}, {}: {found:#?} is not {expected:#?}",
            case.name
        );
        assert!(found.len() > 15 || case.name.starts_with("case"), "{}: {found:?}", case.name);
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
