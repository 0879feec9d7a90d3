//! What every stage makes of a pair, as numbers that do not depend on the machine, and what each costs: so
//! that a board is held against a PC stage by stage.
//!
//! A raster counts pixel by pixel, everything else by what it shows of itself (`Debug`), so that neither the
//! width of a word nor the layout of a struct changes the number, and no field can be forgotten.

use core::fmt::{self, Write as _};
use crc::{CRC_32_ISO_HDLC, Crc};
use shared::bitmap::Bitmap;
use shared::pipeline::{Finding, Observer, Outcome, Product, Side};
use shared::stage::branch::Sample;

/// Counts instructions or cycles.
pub trait Counter {
    /// The count since some start; wraps around.
    fn count(&self) -> u32;
}

/// Nothing is counted.
impl Counter for () {
    fn count(&self) -> u32 {
        0
    }
}

/// What one stage made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record {
    /// The eye, unless it is of the pair.
    pub side: Option<Side>,
    /// The stage.
    pub stage: &'static str,
    /// CRC-32 (ISO-HDLC) of what it made.
    pub sum: u32,
    /// What was counted since the record before.
    pub cost: u32,
}

/// Eye, stage and sum; without the cost, which is the machine's.
impl fmt::Display for Record {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let side = match self.side {
            Some(Side::Left) => "left",
            Some(Side::Right) => "right",
            None => "pair",
        };
        write!(f, "{side} {} {:08x}", self.stage, self.sum)
    }
}

/// Looks on at a run, and reports every stage.
pub struct Stages<C, F> {
    counter: C,
    since: u32,
    report: F,
}

impl<C: Counter, F: FnMut(Record)> Stages<C, F> {
    /// A run begins. Neither the sums nor `report` count as anybody's cost.
    pub fn new(counter: C, report: F) -> Self {
        let since = counter.count();
        Self { counter, since, report }
    }

    /// The run has ended with these samples of the left eye's curves, which are of another run if it was refused.
    pub fn ended(&mut self, outcome: &Result<Outcome, Finding>, samples: &[Sample]) {
        let samples = if outcome.is_ok() { samples } else { &[] };
        self.report(None, "outcome", |sum| write!(sum, "{outcome:?}{samples:?}"));
    }

    fn report(&mut self, side: Option<Side>, stage: &'static str, add: impl FnOnce(&mut Sum) -> fmt::Result) {
        let cost = self.counter.count().wrapping_sub(self.since);
        let mut sum = Sum(CRC.digest());
        // A sum takes every text.
        let _ = add(&mut sum);
        (self.report)(Record { side, stage, sum: sum.0.finalize(), cost });
        self.since = self.counter.count();
    }
}

impl<C: Counter, F: FnMut(Record)> Observer for Stages<C, F> {
    fn saw(&mut self, side: Option<Side>, product: Product<'_>) {
        match product {
            Product::Threshold(grey, histogram, level, tone) => self.report(side, "threshold", |sum| {
                (0..grey.size().height).for_each(|v| sum.0.update(grey.row(v)));
                write!(sum, "{histogram:?}{level}{tone:?}")
            }),
            Product::Mask(mask, components) => self.report(side, "mask", |sum| {
                sum.bitmap(mask);
                write!(sum, "{components:?}")
            }),
            Product::Boundary(boundary) => self.report(side, "boundary", |sum| {
                sum.bitmap(boundary);
                Ok(())
            }),
            Product::Contour(points, loops) => {
                self.report(side, "contour", |sum| write!(sum, "{points:?}{loops:?}"));
            }
            Product::Distance(plane) => self.report(side, "distance", |sum| {
                let rows = (0..plane.size().height).flat_map(|v| plane.row(v));
                rows.for_each(|distance| sum.0.update(&distance.to_le_bytes()));
                Ok(())
            }),
            Product::Skeleton(skeleton, report) => self.report(side, "skeleton", |sum| {
                sum.bitmap(skeleton);
                write!(sum, "{report:?}")
            }),
            Product::Graph(skeleton, graph, report) => self.report(side, "graph", |sum| {
                sum.bitmap(skeleton);
                write!(sum, "{:?}{:?}{:?}{:?}", graph.nodes, graph.edges, graph.path, graph.members)?;
                write!(sum, "{report:?}")
            }),
            Product::Hull(points) => self.report(side, "hull", |sum| write!(sum, "{points:?}")),
            Product::Cuts(cuts) => self.report(side, "cuts", |sum| write!(sum, "{cuts:?}")),
            Product::Vertices(vertices) => self.report(side, "vertices", |sum| write!(sum, "{vertices:?}")),
            Product::Rows(matches, statistics) => {
                self.report(side, "rows", |sum| write!(sum, "{matches:?}{statistics:?}"));
            }
            Product::Balls(balls, depths) => {
                self.report(side, "balls", |sum| write!(sum, "{balls:?}{depths:?}"));
            }
            Product::Pairs(boundary, skeleton) => {
                self.report(side, "pairs", |sum| write!(sum, "{boundary:?}{skeleton:?}"));
            }
            Product::Curves(branches, controls) => {
                self.report(side, "curves", |sum| write!(sum, "{branches:?}{controls:?}"));
            }
        }
    }
}

static CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// A CRC-32 that can be written to.
struct Sum(crc::Digest<'static, u32>);

impl Sum {
    /// Row by row, eight pixels a byte.
    fn bitmap(&mut self, bitmap: &Bitmap<'_>) {
        let bytes = bitmap.size().width.div_ceil(8);
        for v in 0..bitmap.size().height {
            for byte in bitmap.row(v as i32).iter().flat_map(|word| word.to_le_bytes()).take(bytes) {
                self.0.update(&[byte]);
            }
        }
    }
}

impl fmt::Write for Sum {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.update(text.as_bytes());
        Ok(())
    }
}
