//! Looking on while the core runs, and lending it a loop of one's own.
//!
//!     cargo run -p shared --example watch
//!
//! An [`Observer`] sees what each stage makes while it is in memory: for a log, a display, a measurement of one's
//! own. This one wants to see the right eye's skeleton too, at the price of a second thinning. [`Kernels`] are the loops
//! that most of the time goes into; a processor with better instructions runs them its own way, as long as the bits stay
//! the same (`firmware/src/board/dsp.rs`, `host/src/wide.rs`).

mod common;

use common::{SIZE, Storage, draw};
use shared::bitmap::Grey;
use shared::fixed::PX;
use shared::pipeline::{Kernels, Observer, Product, Settings, Side, run};
use shared::stage::binarise::median_row;
use shared::stage::depth::Optics;
use static_cell::ConstStaticCell;
use std::sync::atomic::{AtomicUsize, Ordering};

static STORAGE: ConstStaticCell<Storage> = ConstStaticCell::new(Storage::new());
static ROWS: AtomicUsize = AtomicUsize::new(0);

/// Prints a line a product.
struct Log;

impl Observer for Log {
    fn saw(&mut self, side: Option<Side>, product: Product<'_>) {
        let whose = side.map_or("both".into(), |side| format!("{side:?}"));
        let what = match product {
            Product::Threshold(_, _, level, tone) => format!("the object is {tone:?}, level {level}"),
            Product::Mask(mask, components) => {
                format!("{} of {} px, {} components", mask.count(), SIZE.pixels(), components.count)
            }
            Product::Contour(points, loops) => {
                format!("{} contour points in {} loops", points.len(), loops.len())
            }
            Product::Skeleton(skeleton, _) => format!("{} px of skeleton", skeleton.count()),
            Product::Graph(_, graph, report) => {
                format!("{} of {} edges stay", graph.edges.len(), report.edges_before)
            }
            Product::Hull(vertices) => format!("a hull of {} vertices", vertices.len()),
            Product::Cuts(cuts) => format!("the hulls match at shift {}", cuts.shift),
            Product::Rows(_, rows) => {
                format!("{} of {} crossings have no partner", rows.unmatched, rows.crossings)
            }
            Product::Balls(balls, _) => format!("{} balls with their depths", balls.len()),
            Product::Curves(branches, controls) => {
                format!("{} curves of {} control points", branches.len(), controls.len())
            }
            Product::Boundary(_) | Product::Distance(_) | Product::Vertices(_) | Product::Pairs(..) => return,
        };
        println!("{whose:>5}: {what}");
    }

    fn wants_both_skeletons(&self) -> bool {
        true
    }
}

fn main() -> Result<(), String> {
    let mut pictures = [[0; SIZE.pixels()]; 2];
    draw(&mut pictures);

    let mut kernels = Kernels::PORTABLE;
    kernels.median_row = |above, here, below, out| {
        ROWS.fetch_add(1, Ordering::Relaxed);
        median_row(above, here, below, out);
    };
    let settings = Settings::device(Optics { focal: 200 * PX, disparity_offset: 0 });
    let mut memory = STORAGE.take().lend(kernels);
    let grey = |picture| Grey::new(SIZE, SIZE.width, picture).map_err(|error| error.to_string());
    let [left, right] = pictures.each_ref();
    run(&mut memory, grey(left)?, grey(right)?, &settings, &mut Log)
        .map_err(|finding| format!("{finding:?}"))?;
    println!("the median ran on {} rows", ROWS.load(Ordering::Relaxed));
    Ok(())
}
