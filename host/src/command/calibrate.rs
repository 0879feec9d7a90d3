//! Whether a calibration is right: do rows match after rectification?
//!
//! PAIR is whatever `host replay` takes, of one object or several that stand out from the background, best
//! at places all over the view. Each pair is rectified, and the rows in which the object begins and ends are
//! compared: the highest and the lowest point of an outline are the same point of the object for both eyes. Told is
//! the difference, and the column of the rectified left view in which the point lies. Fails if the root mean square
//! of the differences is above 1 px, or if nothing could be measured.
//!
//! To make a calibration, see docs/calibration.md: OpenCV's own functions, in a script of ours.
//!
//! Examples:
//!   host calibrate --check recording/ --calib calib.yaml
//!   host calibrate --check left.png right.png --calib calib.yaml --json

use serde_json::{Value, json};
use shared::pipeline::{Finding, Observer, Product, Side};
use shared::stage::binarise::{Polarity, Threshold};
use shared::stage::contour::ContourPoint;

use super::options::CameraArgs;
use super::table::Table;
use super::{Failure, crew, say, say_json, told, words_of};
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
    json: bool,
}

/// The highest and the lowest point of an outline.
struct Rows {
    /// Right less left row, px.
    off: [f64; 2],
    /// Column in the rectified left view, px.
    column: [f64; 2],
}

/// Measures, tells, judges. What was measured is told of a refused calibration too: where rows differ says why.
///
/// # Errors
///
/// If there are no pairs, none can be measured, or rows do not match.
pub fn run(args: &Args) -> Result<(), Failure> {
    let measured = find(&args.check, args.layout).map_err(Failure::from).and_then(|found| {
        let pairs = found.pairs;
        let rows = crew::run(pairs.len(), None, &|(): &mut (), index| measure(args, &pairs[index]))?;
        if rows.iter().any(Result::is_ok) {
            return Ok((pairs, rows));
        }
        let why = rows.iter().find_map(|row| row.as_ref().err()).map(|failure| words_of(&**failure));
        Err(format!("no pair could be measured; the first: {}", why.unwrap_or_default()).into())
    });
    let (pairs, rows) = told(args.json, measured)?;
    let measured: Vec<f64> = rows.iter().flatten().flat_map(|rows| rows.off).collect();
    let worst = measured.iter().copied().fold(0.0, |worst: f64, off| worst.max(off.abs()));
    let count = measured.len() as f64;
    let mean = measured.iter().sum::<f64>() / count;
    let rms = (measured.iter().map(|off| off * off).sum::<f64>() / count).sqrt();
    let refusal = (rms > REFUSED).then(|| {
        format!(
            "rows differ by {rms:.2} px (root mean square of {} pairs; mean {mean:+.2}, worst {worst:.2}): the \
             calibration is not that of these images, or the cameras have moved; calibrate again \
             (docs/calibration.md)",
            measured.len() / 2
        )
    });
    if args.json {
        let pair = |(pair, rows): (&Pair, &Result<Rows, Failure>)| match rows {
            Ok(Rows { off: [top, bottom], column }) => {
                json!({ "name": pair.name, "top_px": top, "bottom_px": bottom, "columns_px": column })
            }
            Err(failure) => json!({ "name": pair.name, "error": words_of(&**failure) }),
        };
        let pairs: Vec<Value> = pairs.iter().zip(&rows).map(pair).collect();
        say_json(&json!({
            "rms_px": rms,
            "mean_px": mean,
            "worst_px": worst,
            "pairs": pairs,
            "error": refusal,
        }))?;
        return refusal.map_or(Ok(()), |refusal| Err(refusal.into()));
    }
    let mut table = Table::new("rows, right less left, px");
    for (pair, rows) in pairs.iter().zip(&rows) {
        match rows {
            Ok(Rows { off: [top, bottom], column: [u, w] }) => {
                let words = format!("top {top:+.2} in column {u:.0}, bottom {bottom:+.2} in column {w:.0}");
                table.row(&pair.name, &words);
            }
            Err(failure) => table.row(&pair.name, &format!("not measured: {}", words_of(&**failure))),
        }
    }
    let verdict = match rms {
        _ if rms <= GOOD => "good",
        _ if rms <= REFUSED => "usable; calibrate again for the last percent of depth",
        _ => "refused",
    };
    table.row("all", &format!("{rms:.2} root mean square, mean {mean:+.2}, worst {worst:.2}: {verdict}"));
    say(table.text())?;
    refusal.map_or(Ok(()), |refusal| Err(refusal.into()))
}

/// Columns of the highest and of the lowest point of the left outline, px.
#[derive(Default)]
struct Columns([f64; 2]);

impl Observer for Columns {
    fn saw(&mut self, side: Option<Side>, product: Product<'_>) {
        if let (Some(Side::Left), Product::Contour(points, _)) = (side, product) {
            let row = |point: &&ContourPoint| point.at.v;
            let ends = [points.iter().min_by_key(row), points.iter().max_by_key(row)];
            self.0 = ends.map(|end| end.map_or(0.0, |point| px(point.at.u)));
        }
    }
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
    let mut columns = Columns::default();
    let off = match reconstruct(left, right, &calibration, &options, &mut columns) {
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
    Ok(Rows { off: off.map(px), column: columns.0 })
}
