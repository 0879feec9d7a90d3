//! Whether a calibration is right: do rows match after rectification?
//!
//! PAIR is whatever `host replay` takes, of one object or several that stand out from the background, best
//! at places all over the view. Each pair is rectified, and the rows in which the object begins and ends are
//! compared: the highest and the lowest point of an outline are the same point of the object for both eyes. Fails
//! if the root mean square of the differences is above 1 px, or if nothing could be measured.
//!
//! To make a calibration, see docs/calibration.md: OpenCV's own functions, in a script of ours.
//!
//! Examples:
//!   host calibrate --check recording/ --calib calib.yaml
//!   host calibrate --check left.png right.png --calib calib.yaml --json

use serde_json::{Value, json};
use shared::pipeline::Finding;
use shared::stage::binarise::{Polarity, Threshold};

use super::options::CameraArgs;
use super::table::Table;
use super::{Failure, batch, say, say_json, words_of};
use crate::reconstruct::{Options, Refusal, reconstruct};
use crate::report::words::{parse_polarity, parse_threshold, sentence};
use crate::source::find::find;
use crate::source::{Layout, Pair};
use crate::stage::balls::px;

/// Root mean square difference of rows from which a calibration is refused, px.
const REFUSED: f64 = 1.0;
/// And up to which it is as good as the outlines.
const GOOD: f64 = 0.3;

/// Arguments of `calibrate`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Check the calibration on these pairs: LEFT RIGHT, one image with both views, folders or patterns
    #[arg(long, value_name = "PAIR", num_args = 1.., required = true)]
    check: Vec<String>,
    /// How views lie in files [default: as the number of files says]
    #[arg(long, value_enum)]
    layout: Option<Layout>,
    /// Exchange left and right
    #[arg(long)]
    swap: bool,
    #[command(flatten)]
    cameras: CameraArgs,
    /// Grey level between object and background
    #[arg(long, value_parser = parse_threshold, default_value = "otsu", value_name = "otsu|N")]
    threshold: Threshold,
    /// Whether the object is brighter or darker than the background
    #[arg(long, value_parser = parse_polarity, default_value = "bright", value_name = "bright|dark|auto")]
    polarity: Polarity,
    /// Print one JSON document instead of text
    #[arg(long)]
    pub(super) json: bool,
}

/// Right less left row of the highest and of the lowest point, px.
type Rows = [f64; 2];

/// Measures, tells, judges.
///
/// # Errors
///
/// If there are no pairs, none can be measured, or rows do not match.
pub fn run(args: &Args) -> Result<(), Failure> {
    let pairs = find(&args.check, args.layout)?.pairs;
    let rows = batch::run(pairs.len(), None, &|index| measure(args, &pairs[index]))?;
    let measured: Vec<f64> = rows.iter().flatten().flatten().copied().collect();
    let worst = measured.iter().copied().fold(0.0, |worst: f64, off| worst.max(off.abs()));
    let count = measured.len().max(1) as f64;
    let mean = measured.iter().sum::<f64>() / count;
    let rms = (measured.iter().map(|off| off * off).sum::<f64>() / count).sqrt();
    if measured.is_empty() {
        let why = rows.iter().find_map(|row| row.as_ref().err()).map(|failure| words_of(&**failure));
        return Err(format!("no pair could be measured; the first: {}", why.unwrap_or_default()).into());
    }
    if rms > REFUSED {
        return Err(format!(
            "rows differ by {rms:.2} px (root mean square of {} pairs; mean {mean:+.2}, worst {worst:.2}): the \
             calibration is not that of these images, or the cameras have moved; calibrate again \
             (docs/calibration.md)",
            measured.len() / 2
        )
        .into());
    }
    if args.json {
        let pair = |(pair, rows): (&Pair, &Result<Rows, Failure>)| match rows {
            Ok([top, bottom]) => json!({ "name": pair.name, "top_px": top, "bottom_px": bottom }),
            Err(failure) => json!({ "name": pair.name, "error": words_of(&**failure) }),
        };
        let pairs: Vec<Value> = pairs.iter().zip(&rows).map(pair).collect();
        return say_json(&json!({ "rms_px": rms, "mean_px": mean, "worst_px": worst, "pairs": pairs }));
    }
    let mut table = Table::new("rows, right less left, px");
    for (pair, rows) in pairs.iter().zip(&rows) {
        match rows {
            Ok([top, bottom]) => table.row(&pair.name, &format!("top {top:+.2}, bottom {bottom:+.2}")),
            Err(failure) => table.row(&pair.name, &format!("not measured: {}", words_of(&**failure))),
        }
    }
    let verdict = if rms <= GOOD { "good" } else { "usable; calibrate again for the last percent of depth" };
    table.row("all", &format!("{rms:.2} root mean square, mean {mean:+.2}, worst {worst:.2}: {verdict}"));
    say(table.text())
}

/// The rows of a pair, whether it gives a model or not.
fn measure(args: &Args, pair: &Pair) -> Result<Rows, Failure> {
    let mut images = pair.load()?.images;
    if args.swap {
        images.reverse();
    }
    let (calibration, _) = args.cameras.of(pair, &images[0])?;
    let [left, right] = images;
    let options = Options { threshold: args.threshold, polarity: args.polarity, ..Options::default() };
    let [top, bottom] = match reconstruct(left, right, &calibration, &options, &mut ()) {
        Ok(made) => {
            let cut_off = |finding: &&Finding| matches!(finding, Finding::TouchesBorder(_));
            if let Some(finding) = made.outcome.findings.iter().find(cut_off) {
                return Err(sentence(finding).into());
            }
            made.outcome.frontier_offsets
        }
        Err(Refusal::Gate(Finding::NotRectified { top, bottom })) => [top, bottom],
        Err(refusal) => return Err(refusal.into()),
    };
    Ok([px(top), px(bottom)])
}
