//! What the core made on its way, kept for reports and pictures.
//!
//! * **In**: the products that the pipeline shows to an [`Observer`].
//! * **Out**: owned copies for each eye and for the pair, and how long each took to make.
//! * **Cost**: a copy of each list, and with [`Record::new`] of six rasters an eye; [`Record::figures_only`]
//!   leaves the rasters out. Copying is not timed.

use crate::reconstruct::Options;
use image::{GrayImage, ImageBuffer, Luma};
use shared::bitmap::{Bitmap, Grey, PixelBox, Plane, Size};
use shared::pipeline::{Branch, Observer, Product, Side};
use shared::point::{Pixel, PixelPoint};
use shared::stage::binarise::{self, Tone};
use shared::stage::clean::Components;
use shared::stage::contour::{ContourLoop, ContourPoint};
use shared::stage::correspond::{CutMatch, VertexMatch};
use shared::stage::depth::BallDepth;
use shared::stage::graph::{Edge, Graph, Node};
use shared::stage::medial::MedialBall;
use shared::stage::nearest::Pair;
use shared::stage::nurbs::Control;
use shared::stage::rows::{ContourMatch, RowStatistics};
use shared::stage::{parallel_thinning, prune};
use std::time::{Duration, Instant};

/// Distances to the background, 1/16 px.
pub type DistanceImage = ImageBuffer<Luma<u16>, Vec<u16>>;

/// What one eye's picture gave.
#[derive(Clone, Debug, Default)]
pub struct Eye {
    /// The figures and lists.
    pub parts: Parts,
    /// The rasters, if they were wanted.
    pub rasters: Option<Rasters>,
}

/// The rasters of an eye; masks are 0 and 255.
#[derive(Clone, Debug, Default)]
pub struct Rasters {
    /// The rectified image as it was thresholded.
    pub grey: GrayImage,
    /// The object.
    pub mask: GrayImage,
    /// Its boundary pixels.
    pub boundary: GrayImage,
    /// Distance of each of its pixels to the background.
    pub distance: DistanceImage,
    /// Its skeleton before pruning.
    pub skeleton: GrayImage,
    /// Its skeleton after pruning.
    pub pruned: GrayImage,
}

/// The figures and lists of an eye.
#[derive(Clone, Debug, Default)]
pub struct Parts {
    /// How many pixels have each grey value, 0 to 255.
    pub histogram: Vec<u32>,
    /// Grey level between object and background.
    pub level: u8,
    /// The object's side of it.
    pub tone: Option<Tone>,
    /// What was cleaned away.
    pub components: Components,
    /// Pixels of the object.
    pub area: usize,
    /// The box around the object.
    pub bounds: Option<PixelBox>,
    /// Boundary pixels.
    pub boundary: usize,
    /// Sub-pixel contour.
    pub contour: Vec<ContourPoint>,
    /// Its loops.
    pub loops: Vec<ContourLoop>,
    /// Largest distance to the background, 1/16 px.
    pub widest: u16,
    /// What thinning did.
    pub thinning: parallel_thinning::Report,
    /// What pruning did.
    pub pruning: prune::Report,
    /// Nodes of the pruned graph.
    pub nodes: Vec<Node>,
    /// Its edges, each with its pixels in order.
    pub edges: Vec<(Edge, Vec<Pixel>)>,
    /// Vertices of the hull: right rows moved by the vertical offset.
    pub hull: Vec<PixelPoint>,
    /// Fitted branches.
    pub branches: Vec<Branch>,
    /// Control points of their curves.
    pub controls: Vec<Control>,
}

/// What was made of both views together.
#[derive(Clone, Debug, Default)]
pub struct Matches {
    /// The hulls, cut and matched.
    pub cuts: Option<CutMatch>,
    /// The hulls' vertices, matched the paper's way.
    pub vertices: Option<VertexMatch>,
    /// The partner of each left contour point.
    pub rows: Vec<ContourMatch>,
    /// How row matching went.
    pub statistics: RowStatistics,
    /// Balls of the left view.
    pub balls: Vec<MedialBall>,
    /// Their depths.
    pub depths: Vec<BallDepth>,
    /// The paper's pairs of boundary pixels.
    pub boundary_pairs: Vec<Pair>,
    /// The paper's pairs of skeleton points.
    pub skeleton_pairs: Vec<Pair>,
}

/// How long a product took.
#[derive(Clone, Copy, Debug)]
pub struct Lap {
    /// Whose it is, or the pair's.
    pub side: Option<Side>,
    /// What was made.
    pub stage: &'static str,
    /// Since the product before; the first one since the record was made.
    pub time: Duration,
}

/// An observer that remembers.
#[derive(Clone, Debug)]
pub struct Record {
    /// Left and right.
    pub eyes: [Eye; 2],
    /// The pair.
    pub pair: Matches,
    /// The products in their order.
    pub laps: Vec<Lap>,
    last: Instant,
}

impl Record {
    /// An empty record that keeps everything that pictures need.
    #[must_use]
    pub fn new() -> Self {
        let mut record = Self::figures_only();
        for eye in &mut record.eyes {
            eye.rasters = Some(Rasters::default());
        }
        record
    }

    /// An empty record that keeps no rasters.
    #[must_use]
    pub fn figures_only() -> Self {
        Self { eyes: Default::default(), pair: Matches::default(), laps: Vec::new(), last: Instant::now() }
    }

    /// Adds to the record of a refused pair the views that the core did not come to, as they came, and what would be
    /// taken for the object in them.
    pub fn complete(&mut self, images: [&GrayImage; 2], options: &Options) {
        for (eye, image) in self.eyes.iter_mut().zip(images) {
            let (Some(rasters), None) = (&mut eye.rasters, eye.parts.tone) else { continue };
            rasters.grey = image.clone();
            let (width, height) = (image.width() as usize, image.height() as usize);
            let grey = Size::new(width, height).and_then(|size| Grey::new(size, width, image.as_raw()));
            // What is larger than the core takes is shown as it is.
            let Ok(grey) = grey else { continue };
            let histogram = binarise::histogram(grey);
            let level = options.threshold.level(&histogram);
            let tone = options.polarity.tone(grey, level);
            let object = |x: u8| u8::MAX * u8::from((x > level) == (tone == Tone::Bright));
            rasters.mask = GrayImage::from_fn(image.width(), image.height(), |u, v| {
                Luma([object(image.get_pixel(u, v).0[0])])
            });
            (eye.parts.histogram, eye.parts.level, eye.parts.tone) = (histogram.to_vec(), level, Some(tone));
        }
    }

    /// A copy without rasters.
    #[must_use]
    pub fn figures(&self) -> Self {
        let eyes = self.eyes.each_ref().map(|eye| Eye { parts: eye.parts.clone(), rasters: None });
        Self { eyes, pair: self.pair.clone(), laps: self.laps.clone(), last: self.last }
    }
}

impl Default for Record {
    fn default() -> Self {
        Self::new()
    }
}

impl Observer for Record {
    fn saw(&mut self, side: Option<Side>, product: Product<'_>) {
        self.laps.push(Lap { side, stage: stage(&product), time: self.last.elapsed() });
        let eye = match side {
            Some(Side::Right) => &mut self.eyes[1],
            _ => &mut self.eyes[0],
        };
        if let Some(rasters) = &mut eye.rasters {
            rasters.keep(&product);
        }
        eye.parts.keep(&product);
        self.pair.keep(&product);
        self.last = Instant::now();
    }

    /// Reports and pictures show both views.
    fn wants_both_skeletons(&self) -> bool {
        true
    }
}

/// The name under which a product's time is reported.
const fn stage(product: &Product<'_>) -> &'static str {
    match product {
        Product::Threshold(..) => "threshold",
        Product::Mask(..) => "mask",
        Product::Boundary(_) => "boundary",
        Product::Contour(..) => "contour",
        Product::Distance(_) => "distance",
        Product::Skeleton(..) => "thinning",
        Product::Graph(..) => "graph",
        Product::Hull(_) => "hull",
        Product::Cuts(_) | Product::Vertices(_) => "correspondence",
        Product::Rows(..) => "rows",
        Product::Balls(..) => "balls",
        Product::Pairs(..) => "pairs",
        Product::Curves(..) => "curves",
    }
}

impl Rasters {
    fn keep(&mut self, product: &Product<'_>) {
        match product {
            Product::Threshold(grey, ..) => self.grey = grey_image(*grey),
            Product::Mask(mask, _) => self.mask = mask_image(mask),
            Product::Boundary(boundary) => self.boundary = mask_image(boundary),
            Product::Distance(plane) => self.distance = distance_image(plane),
            Product::Skeleton(skeleton, _) => self.skeleton = mask_image(skeleton),
            Product::Graph(skeleton, ..) => self.pruned = mask_image(skeleton),
            _ => {}
        }
    }
}

impl Parts {
    fn keep(&mut self, product: &Product<'_>) {
        match product {
            Product::Threshold(_, histogram, level, tone) => {
                (self.level, self.tone) = (*level, Some(*tone));
                self.histogram = histogram.to_vec();
            }
            Product::Mask(mask, components) => {
                (self.area, self.bounds, self.components) = (mask.count(), mask.bounds(), *components);
            }
            Product::Boundary(boundary) => self.boundary = boundary.count(),
            Product::Contour(points, loops) => {
                (self.contour, self.loops) = (points.to_vec(), loops.to_vec());
            }
            Product::Distance(plane) => {
                let rows = (0..plane.size().height).flat_map(|v| plane.row(v));
                self.widest = rows.copied().max().unwrap_or(0);
            }
            Product::Skeleton(_, report) => self.thinning = *report,
            Product::Graph(_, graph, report) => {
                (self.nodes, self.edges, self.pruning) = (graph.nodes.to_vec(), edges(graph), *report);
            }
            Product::Hull(vertices) => self.hull = vertices.to_vec(),
            Product::Curves(branches, controls) => {
                (self.branches, self.controls) = (branches.to_vec(), controls.to_vec());
            }
            _ => {}
        }
    }
}

impl Matches {
    fn keep(&mut self, product: &Product<'_>) {
        match product {
            Product::Cuts(cuts) => self.cuts = Some(**cuts),
            Product::Vertices(vertices) => self.vertices = Some(**vertices),
            Product::Rows(rows, statistics) => (self.rows, self.statistics) = (rows.to_vec(), *statistics),
            Product::Balls(balls, depths) => (self.balls, self.depths) = (balls.to_vec(), depths.to_vec()),
            Product::Pairs(boundary, skeleton) => {
                (self.boundary_pairs, self.skeleton_pairs) = (boundary.to_vec(), skeleton.to_vec());
            }
            _ => {}
        }
    }
}

/// The edges of a graph with their pixels.
pub(crate) fn edges(graph: &Graph<'_>) -> Vec<(Edge, Vec<Pixel>)> {
    graph.edges.iter().map(|edge| (*edge, graph.pixels(edge).to_vec())).collect()
}

/// A copy of a grey image.
pub(crate) fn grey_image(grey: Grey<'_>) -> GrayImage {
    let size = grey.size();
    GrayImage::from_fn(size.width as u32, size.height as u32, |u, v| Luma([grey.row(v as usize)[u as usize]]))
}

/// A bitmap as 0 and 255.
pub(crate) fn mask_image(bitmap: &Bitmap<'_>) -> GrayImage {
    let mut image = GrayImage::new(bitmap.size().width as u32, bitmap.size().height as u32);
    for pixel in bitmap.pixels() {
        image.put_pixel(pixel.u.into(), pixel.v.into(), Luma([u8::MAX]));
    }
    image
}

/// A copy of a plane of distances.
pub(crate) fn distance_image(plane: &Plane<'_, u16>) -> DistanceImage {
    let size = plane.size();
    DistanceImage::from_fn(size.width as u32, size.height as u32, |u, v| {
        Luma([plane.row(v as usize)[u as usize]])
    })
}
