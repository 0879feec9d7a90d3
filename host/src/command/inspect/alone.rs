//! Stages that can be set beside another program: from the bytes of a mask to those of the result.
//!
//! All memory is set aside before the clock starts; packing bytes to bits and back is timed.

use super::{Args, Made, Stage};
use crate::report::record::{DistanceImage, mask_image};
use crate::wide;
use image::GrayImage;
use shared::arena::{Arena, words};
use shared::bitmap::{Grey, Plane, Size, Word};
use shared::limits::{CapacityError, MAX_SIDE};
use shared::pack::unpack;
use shared::point::PixelPoint;
use shared::stage::binarise::{self, Tone};
use shared::stage::boundary::{Element, boundary};
use shared::stage::distance::{self, Parabola, distance};
use shared::stage::hull::{bitmap_extents, convex_hull};
use shared::stage::parallel_thinning::Report;
use shared::stage::sequential_thinning::scratch_order;
use shared::stage::thinning::{Rule, thin};
use std::time::Instant;

/// Vertices of a hull: two a row and two more.
const VERTICES: usize = 2 * MAX_SIDE + 2;

/// Memory of all the stages here.
struct Memory {
    size: Size,
    words: Vec<Word>,
    more_words: Vec<Word>,
    plane: Vec<u16>,
    parabolas: Vec<Parabola>,
    scratch: Vec<u64>,
    hull: Box<heapless::Vec<PixelPoint, VERTICES>>,
    bytes: Vec<u8>,
    thinned: Report,
}

impl Memory {
    fn new(size: Size) -> Self {
        Self {
            size,
            words: vec![0; size.words()],
            more_words: vec![0; size.words()],
            plane: vec![0; size.pixels()],
            parabolas: vec![Parabola::default(); distance::scratch_parabolas(size.width)],
            scratch: vec![0; words::<u32>(scratch_order(size.pixels(), u16::MAX))],
            hull: Box::default(),
            bytes: vec![0; size.pixels()],
            thinned: Report::default(),
        }
    }

    /// The stage itself, from an image and what is object in it; its result stays in `bytes`, `plane` or
    /// `hull`.
    fn run(
        &mut self,
        (stage, rule): (Stage, Rule),
        (grey, level, tone): (Grey<'_>, u8, Tone),
    ) -> Result<(), CapacityError> {
        let mut bitmap = binarise::binarise(grey, level, tone, &mut self.words)?;
        match stage {
            Stage::Boundary => {
                unpack(&boundary(&bitmap, Element::Square, &mut self.more_words)?, &mut self.bytes)?;
            }
            Stage::Thinning => {
                let plane = match rule {
                    Rule::EdtOrdered => distance(&bitmap, &mut self.plane, &mut self.parabolas)?,
                    _ => Plane::over(self.size, &mut self.plane)?,
                };
                self.thinned =
                    thin(&mut bitmap, (rule, wide::kernels().thin), &plane, Arena::new(&mut self.scratch))?;
                unpack(&bitmap, &mut self.bytes)?;
            }
            Stage::Distance => {
                distance(&bitmap, &mut self.plane, &mut self.parabolas)?;
            }
            Stage::Binarise => unpack(&bitmap, &mut self.bytes)?,
            _ => convex_hull(bitmap_extents(&bitmap), &mut *self.hull)?,
        }
        Ok(())
    }

    fn mask(&self, bytes: &[u8]) -> GrayImage {
        let (width, height) = (self.size.width as u32, self.size.height as u32);
        GrayImage::from_raw(width, height, bytes.to_vec()).unwrap_or_default()
    }
}

/// Threshold the image and run the stage on the mask, as often as is asked for.
pub(super) fn make(args: &Args, image: &GrayImage) -> Result<Made, CapacityError> {
    let size = Size::new(image.width() as usize, image.height() as usize)?;
    let grey = Grey::new(size, size.width, image.as_raw())?;
    let mut memory = Memory::new(size);
    let level = args.threshold.level(&binarise::histogram(grey));
    let tone = args.polarity.tone(grey, level);
    let mut made = Made::default();
    let bitmap = binarise::binarise(grey, level, tone, &mut memory.words)?;
    (made.parts.level, made.parts.tone) = (level, Some(tone));
    (made.parts.area, made.parts.bounds) = (bitmap.count(), bitmap.bounds());
    made.rasters.mask = mask_image(&bitmap);
    let mask = Grey::new(size, size.width, made.rasters.mask.as_raw())?;
    for _ in 0..args.repeat {
        let start = Instant::now();
        let input = match args.stage {
            Stage::Binarise => (grey, args.threshold.level(&binarise::histogram(grey)), tone),
            _ => (mask, 0, Tone::Bright),
        };
        memory.run((args.stage, args.rule), input)?;
        made.times.push(start.elapsed());
    }
    match args.stage {
        Stage::Boundary => {
            made.rasters.boundary = memory.mask(&memory.bytes);
            made.parts.boundary = memory.bytes.iter().filter(|byte| **byte != 0).count();
        }
        Stage::Thinning => {
            made.rasters.skeleton = memory.mask(&memory.bytes);
            made.parts.thinning = memory.thinned;
        }
        Stage::Distance => {
            made.parts.widest = memory.plane.iter().copied().max().unwrap_or(0);
            made.rasters.distance =
                DistanceImage::from_raw(image.width(), image.height(), memory.plane).unwrap_or_default();
        }
        Stage::Binarise => {}
        _ => made.parts.hull = memory.hull.to_vec(),
    }
    Ok(made)
}
