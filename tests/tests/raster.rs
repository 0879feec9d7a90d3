//! The raster stages against their naive twins: at every width from 1 to 97, so that the end of a row
//! falls on every bit of a word, on noise of several densities and on shapes.

use heapless::Vec as List;
use oracle::raster::{self as naive, Image, Random};
use shared::arena::{Arena, words};
use shared::bitmap::{Bitmap, Grey, Plane, Size, Word};
use shared::limits::CapacityError;
use shared::point::{PixelPoint, orient};
use shared::stage::binarise::{self, MedianRow, Polarity, Threshold, Tone};
use shared::stage::boundary::{self, Element};
use shared::stage::clean::{self, Components};
use shared::stage::distance::{self, Parabola};
use shared::stage::hull::{self, RowExtent};
use shared::stage::parallel_thinning::{self, Parallel, Report};
use shared::stage::sequential_thinning;
use shared::stage::thinning::{self, Rule};

const RULES: [Rule; 4] = [Rule::HitOrMiss, Rule::ZhangSuen, Rule::GuoHall, Rule::EdtOrdered];

/// Empty, full, checkered, noise and blobs at every width; some larger images; no pixels at all.
fn images() -> Vec<Image> {
    let mut images = vec![vec![], vec![vec![]; 3]];
    for width in 1..=97usize {
        let height = 1 + width % 7;
        images.push(vec![vec![width % 2 == 0; width]; height]);
        images.push((0..height).map(|v| (0..width).map(|u| (u + v) % 2 == 0).collect()).collect());
        for percent in [10, 40, 60, 90] {
            images.push(naive::noise(width, height, percent, (width as u64) << 8 | percent));
        }
        images.push(naive::blobs(width, 5 + width % 29, width as u64));
    }
    for seed in 0..20 {
        images.push(naive::blobs(80, 60, 1000 + seed));
        images.push(naive::noise(70, 40, 5 * seed, 2000 + seed));
    }
    images.push(spiral(97));
    images
}

/// A line one pixel wide that winds inwards, one clear pixel between its turns.
fn spiral(side: usize) -> Image {
    let mut image = vec![vec![false; side]; side];
    let (mut at, mut length) = ((0i32, 0i32), side as i32 - 1);
    image[0][0] = true;
    for leg in 0.. {
        if length <= 0 {
            break;
        }
        let (du, dv) = [(1, 0), (0, 1), (-1, 0), (0, -1)][leg % 4];
        for _ in 0..length {
            at = (at.0 + du, at.1 + dv);
            image[at.1 as usize][at.0 as usize] = true;
        }
        if leg > 0 && leg % 2 == 0 {
            length -= 2;
        }
    }
    image
}

/// Run a stage on a bitmap of the image; gives the pixels back, and what the stage returned.
fn on_bitmap<R>(image: &Image, stage: impl FnOnce(&mut Bitmap<'_>) -> R) -> (Image, R) {
    let mut words = naive::words(image);
    let mut bitmap = naive::bitmap(image, &mut words);
    let result = stage(&mut bitmap);
    (naive::image(&bitmap), result)
}

fn thin(image: &Image, rule: Rule) -> (Image, Report) {
    let size = naive::size(image);
    let mut data = vec![u16::MAX; size.pixels()];
    let mut parabolas = vec![Parabola::default(); distance::scratch_parabolas(size.width)];
    on_bitmap(image, |bitmap| {
        let plane = distance::distance(bitmap, &mut data, &mut parabolas).unwrap();
        let largest = (0..size.height).flat_map(|v| plane.row(v)).copied().max().unwrap_or(0);
        let mut block = match rule {
            Rule::EdtOrdered => {
                vec![7; words::<u32>(sequential_thinning::scratch_order(bitmap.count(), largest))]
            }
            _ => vec![7; words::<Word>(parallel_thinning::scratch_words(size))],
        };
        thinning::thin(bitmap, (rule, parallel_thinning::thin), &plane, Arena::new(&mut block)).unwrap()
    })
}

#[test]
fn largest_component_and_areas() {
    for image in images() {
        let (expected, largest, second) = naive::largest(&image);
        let count = naive::components(&image, true, true).len() as u32;
        let mut block = vec![0x55; clean::scratch_words(naive::size(&image))];
        let (kept, found) = on_bitmap(&image, |b| clean::keep_largest(b, Arena::new(&mut block)).unwrap());
        assert_eq!(kept, expected);
        assert_eq!(found, Components { count, largest: largest as u32, second: second as u32 });
    }
}

#[test]
fn holes_below_an_area_are_filled() {
    for image in images() {
        for below in [0, 2, clean::HOLE_AREA, u32::MAX] {
            let mut block = vec![0x55; clean::scratch_words(naive::size(&image))];
            let (filled, holes) =
                on_bitmap(&image, |b| clean::fill_holes(b, below, Arena::new(&mut block)).unwrap());
            let expected = naive::fill_holes(&image, below as usize);
            let area = naive::set(&filled).len() - naive::set(&image).len();
            assert_eq!((&filled, holes.count as usize), (&expected.0, expected.1));
            assert_eq!(holes.area as usize, area);
        }
    }
}

#[test]
fn closing_and_opening() {
    for image in images() {
        let (closed_opened, ()) = on_bitmap(&image, clean::close_open);
        assert_eq!(closed_opened, naive::close_open(&image));
    }
}

#[test]
fn boundaries_by_square_and_cross() {
    for image in images() {
        for (element, cross) in [(Element::Square, false), (Element::Cross, true)] {
            let mut words = naive::words(&image);
            let beta =
                |b: &mut Bitmap<'_>| naive::image(&boundary::boundary(b, element, &mut words).unwrap());
            assert_eq!(on_bitmap(&image, beta).1, naive::boundary(&image, cross));
        }
    }
}

#[test]
fn distances_are_exact() {
    for image in images() {
        let size = naive::size(&image);
        let expected = naive::squared_distances(&image);
        let mut parabolas = vec![Parabola::default(); distance::scratch_parabolas(size.width)];
        let mut data = vec![u16::MAX; size.pixels()];
        let mut row = vec![0; size.width];
        let mut rows = 0;
        on_bitmap(&image, |bitmap| {
            distance::squared_distances(bitmap, &mut data, &mut parabolas, &mut row, |v, squares| {
                assert_eq!(squares, expected[v]);
                rows += 1;
            })
            .unwrap();
            assert_eq!(rows, size.height);
            let plane = distance::distance(bitmap, &mut data, &mut parabolas).unwrap();
            for (u, v) in naive::all(&image) {
                let exact = 16.0 * f64::from(expected[v as usize][u as usize]).sqrt();
                assert_eq!(f64::from(plane.get(u, v)), exact.floor());
            }
        });
    }
}

#[test]
fn distances_of_the_largest_raster_keep_within_their_range() {
    let size = Size::new(4096, 4096).unwrap();
    let mut words = vec![0; size.words()];
    let mut bitmap = Bitmap::new(size, &mut words).unwrap();
    bitmap.invert();
    let mut data = vec![0; size.pixels()];
    let mut parabolas = vec![Parabola::default(); distance::scratch_parabolas(size.width)];
    let plane = distance::distance(&bitmap, &mut data, &mut parabolas).unwrap();
    assert_eq!([plane.get(2047, 2048), plane.get(0, 0), plane.get(9, 4000)], [2048 * 16, 16, 160]);
}

fn twin(rule: Rule, image: &Image) -> Image {
    match rule {
        Rule::HitOrMiss => naive::hit_or_miss(image),
        Rule::ZhangSuen => naive::zhang_suen(image),
        Rule::GuoHall => naive::guo_hall(image),
        Rule::EdtOrdered => {
            let squares = naive::squared_distances(image);
            let distances: Vec<Vec<u32>> =
                squares.iter().map(|r| r.iter().map(|d| (256 * d).isqrt()).collect()).collect();
            naive::edt_ordered(image, &distances)
        }
    }
}

#[test]
fn thinning_equals_its_twin() {
    for image in images() {
        for rule in RULES {
            let (skeleton, report) = thin(&image, rule);
            assert_eq!(skeleton, twin(rule, &image), "{rule:?}");
            let deleted = naive::set(&image).len() - naive::set(&skeleton).len();
            assert_eq!(report.deleted as usize, deleted);
        }
    }
}

#[test]
fn every_width_of_register_thins_alike() {
    let widths = host::wide::widths();
    for (name, thin) in widths {
        if thin.is_none() {
            eprintln!("\n!!!! SKIPPED: this machine has no {name}, so NOTHING is thinned in it !!!!\n");
        }
    }
    let mut images: Vec<Image> = (1..=200usize)
        .flat_map(|width| {
            let (height, seed) = (1 + (7 * width) % 61, width as u64);
            [naive::noise(width, height, 50 + seed % 45, seed), naive::blobs(width, 70 - height, seed)]
        })
        .collect();
    // Blocks of more than one group of rows, and a last one that is not whole.
    images.push(naive::noise(90, 2531, 95, 2));
    for image in images {
        for rule in [Parallel::HitOrMiss, Parallel::ZhangSuen, Parallel::GuoHall] {
            let mut block = vec![7; words::<Word>(parallel_thinning::scratch_words(naive::size(&image)))];
            let expected =
                on_bitmap(&image, |b| parallel_thinning::thin(b, rule, Arena::new(&mut block)).unwrap());
            for (name, thin) in widths.iter().filter_map(|(name, thin)| Some((name, (*thin)?))) {
                block.fill(u64::MAX);
                let found = on_bitmap(&image, |b| thin(b, rule, Arena::new(&mut block)).unwrap());
                assert!(found == expected, "{name}, {rule:?}, {:?}", naive::size(&image));
            }
        }
    }
}

#[test]
fn thinning_of_all_neighbourhoods() {
    for code in 0..512 {
        let bit = |k: i32| code >> k & 1 == 1;
        let image: Image = (0..3).map(|v| (0..3).map(|u| bit(3 * v + u)).collect()).collect();
        for rule in RULES {
            assert_eq!(thin(&image, rule).0, twin(rule, &image), "{rule:?} of {image:?}");
        }
    }
}

#[test]
fn simple_pixels_by_table_and_by_counting() {
    for code in 0..256usize {
        let around = std::array::from_fn(|k| (code >> k & 1) as u8);
        assert_eq!(sequential_thinning::SIMPLE[code], naive::is_simple(around), "{code:08b}");
    }
}

#[test]
fn all_rules_but_zhang_suen_keep_components_and_holes() {
    for image in images() {
        for rule in [Rule::HitOrMiss, Rule::GuoHall, Rule::EdtOrdered] {
            let (skeleton, _) = thin(&image, rule);
            assert_eq!(naive::topology(&skeleton), naive::topology(&image), "{rule:?}");
            for component in naive::components(&image, true, true) {
                assert!(component.iter().any(|&p| naive::get(&skeleton, p)), "{rule:?} emptied one");
            }
        }
    }
}

#[test]
fn zhang_suen_erases_a_block_of_four_and_the_other_rules_do_not() {
    let block = vec![vec![true; 2]; 2];
    let left = RULES.map(|rule| naive::set(&thin(&block, rule).0).len());
    assert_eq!(left, [2, 0, 1, 1]);
}

#[test]
fn minimal_skeletons_keep_their_topology() {
    for image in images() {
        for rule in RULES {
            let (skeleton, _) = thin(&image, rule);
            let (thinned, deleted) = on_bitmap(&skeleton, sequential_thinning::minimal);
            assert_eq!(thinned, naive::minimal(&skeleton));
            assert_eq!(naive::set(&skeleton).len() - naive::set(&thinned).len(), deleted as usize);
            assert_eq!(naive::topology(&thinned), naive::topology(&skeleton));
        }
    }
}

fn grey_rows(width: usize, height: usize, seed: u64) -> Vec<Vec<u8>> {
    let mut random = Random(seed);
    (0..height).map(|_| (0..width).map(|_| random.below(256) as u8).collect()).collect()
}

/// The loop that boards run, with bytes taken from bytes one by one.
fn median_row_by_fours(above: &[u8], here: &[u8], below: &[u8], out: &mut [u8]) {
    let excess = |a: u32, b: u32| {
        let (a, b) = (a.to_le_bytes(), b.to_le_bytes());
        u32::from_le_bytes(std::array::from_fn(|k| a[k].saturating_sub(b[k])))
    };
    binarise::median_row_by_fours([above, here, below], out, excess);
}

const MEDIANS: [MedianRow; 2] = [binarise::median_row, median_row_by_fours];

#[test]
fn medians() {
    for width in 1..=97 {
        let rows = grey_rows(width, 1 + width % 6, width as u64);
        let (size, stride) = (Size::new(width, rows.len()).unwrap(), width + 3);
        let data: Vec<u8> = rows.iter().flat_map(|r| r.iter().copied().chain([255; 3])).collect();
        let mut buffer = vec![1; size.pixels()];
        for median_row in MEDIANS {
            let grey = Grey::new(size, stride, &data).unwrap();
            let median = binarise::median(grey, &mut buffer, median_row).unwrap();
            let got: Vec<Vec<u8>> = (0..size.height).map(|v| median.row(v).to_vec()).collect();
            assert_eq!(got, naive::median(&rows));
        }
    }
}

#[test]
fn medians_of_rows_of_any_lengths() {
    let mut random = Random(8);
    for case in 0..20_000 {
        let lengths: [usize; 4] = std::array::from_fn(|_| random.below(15) as usize);
        let rows: [Vec<u8>; 3] =
            std::array::from_fn(|k| (0..lengths[k]).map(|_| random.below(256) as u8).collect());
        let columns = lengths[0].min(lengths[1]).min(lengths[2]);
        let whole = naive::median(&rows.each_ref().map(|row| row[..columns].to_vec()));
        let filled = columns.min(lengths[3]);
        for median_row in MEDIANS {
            let mut out = vec![7; lengths[3]];
            median_row(&rows[0], &rows[1], &rows[2], &mut out);
            assert_eq!(out[..filled], whole[1][..filled], "case {case}");
            assert!(out[filled..].iter().all(|&value| value == 7), "case {case}");
        }
    }
}

#[test]
fn otsu_is_the_first_level_of_greatest_variance() {
    let mut random = Random(5);
    for case in 0..2000 {
        let mut histogram = [0u32; 256];
        for _ in 0..random.below(12) {
            let bin = random.below(256) as usize;
            histogram[bin] = random.below([3, 1000, 1 << 20][case % 3]) as u32;
        }
        if case % 5 == 0 {
            histogram.fill_with(|| random.below(100) as u32);
        }
        let variances = naive::variances(&histogram);
        let mut best = (0, (0, 1));
        for (level, variance) in variances.iter().enumerate() {
            if let Some((n, d)) = variance
                && naive::is_greater((*n, *d), best.1)
            {
                best = (level, (*n, *d));
            }
        }
        assert_eq!(usize::from(binarise::otsu(&histogram)), best.0, "case {case}");
    }
}

#[test]
fn otsu_of_extreme_histograms() {
    assert_eq!(binarise::otsu(&[0; 256]), 0);
    assert_eq!(binarise::otsu(&[u32::MAX; 256]), 127);
    let mut ends = [0; 256];
    (ends[0], ends[255]) = (1 << 23, 1 << 23);
    assert_eq!(binarise::otsu(&ends), 0);
    let mut single = [0; 256];
    single[200] = 9;
    assert_eq!(binarise::otsu(&single), 0);
}

#[test]
fn binarising_and_polarity() {
    for width in 1..=97 {
        let rows = grey_rows(width, 4, 77 + width as u64);
        let size = Size::new(width, 4).unwrap();
        let data = rows.concat();
        let grey = Grey::new(size, width, &data).unwrap();
        let histogram = binarise::histogram(grey);
        assert_eq!(histogram.iter().sum::<u32>() as usize, size.pixels());
        let level = Threshold::Fixed(100).level(&histogram);
        for (tone, bright) in [(Tone::Bright, true), (Tone::Dark, false)] {
            let mut words = vec![0x55; size.words()];
            let bitmap = binarise::binarise(grey, level, tone, &mut words).unwrap();
            let expected: Image =
                rows.iter().map(|r| r.iter().map(|&g| (g > 100) == bright).collect()).collect();
            assert_eq!(naive::image(&bitmap), expected);
        }
        let (mut bright, mut all) = (0, 0);
        for (v, row) in rows.iter().enumerate() {
            for (u, &value) in row.iter().enumerate() {
                if v == 0 || v == 3 || u == 0 || u + 1 == width {
                    bright += usize::from(value > level);
                    all += 1;
                }
            }
        }
        let expected = if 2 * bright > all { Tone::Dark } else { Tone::Bright };
        assert_eq!(Polarity::Auto.tone(grey, level), expected);
    }
}

fn hull_of(extents: &[RowExtent]) -> Vec<(i64, i64)> {
    let mut list = List::<PixelPoint, 400>::new();
    hull::convex_hull(extents.iter().copied(), &mut list).unwrap();
    list.iter().map(|p| (i64::from(p.u), i64::from(p.v))).collect()
}

#[test]
fn hulls_of_bitmaps() {
    for image in images() {
        let points: Vec<_> =
            naive::set(&image).iter().map(|&(u, v)| (i64::from(u) * 256, i64::from(v) * 256)).collect();
        let (_, hull) = on_bitmap(&image, |b| hull_of(&hull::bitmap_extents(b).collect::<Vec<_>>()));
        assert_eq!(hull, naive::hull(&points));
    }
}

#[test]
fn hulls_of_rows_between_pixels() {
    let mut random = Random(3);
    for case in 0..2000u64 {
        let reach = [2, 40, 2000][case as usize % 3];
        let mut v = -50;
        let extents: Vec<RowExtent> = (0..random.below(30))
            .map(|_| {
                v += 1 + random.below(reach) as i32;
                let left = random.below(reach) as i32 - 20;
                RowExtent { v, left, right: left + random.below(reach / 2) as i32 }
            })
            .collect();
        let ends =
            |e: &RowExtent| [(i64::from(e.left), i64::from(e.v)), (i64::from(e.right), i64::from(e.v))];
        let points: Vec<_> = extents.iter().flat_map(ends).collect();
        assert_eq!(hull_of(&extents), naive::hull(&points), "case {case}");
    }
}

#[test]
fn degenerate_hulls() {
    let row = |v, left, right| RowExtent { v, left, right };
    assert_eq!(hull_of(&[]), []);
    assert_eq!(hull_of(&[row(3, 4, 4)]), [(4, 3)]);
    assert_eq!(hull_of(&[row(3, 4, 9)]), [(4, 3), (9, 3)]);
    assert_eq!(hull_of(&[row(0, 0, 0), row(1, 2, 2), row(2, 4, 4)]), [(0, 0), (4, 2)]);
    assert_eq!(hull_of(&[row(0, 5, 5), row(1, 0, 9)]), [(5, 0), (9, 1), (0, 1)]);
    // Out of order and out of range: some polygon, no panic.
    hull_of(&[row(i32::MAX, i32::MIN, i32::MAX), row(0, 5, -5), row(i32::MIN, i32::MAX, i32::MIN)]);
}

#[test]
fn hull_vertices_turn_right() {
    let extents = (-100i32..=100).map(|v| {
        let half = (10_000 - v * v).isqrt();
        RowExtent { v, left: -half, right: half }
    });
    let mut list = List::<PixelPoint, 400>::new();
    hull::convex_hull(extents, &mut list).unwrap();
    let n = list.len();
    assert!((0..n).all(|k| orient(list[k], list[(k + 1) % n], list[(k + 2) % n]) > 0));
}

#[test]
fn too_little_memory_is_an_error() {
    let image = naive::blobs(80, 60, 4);
    let size = naive::size(&image);
    let refused = |r: Result<(), CapacityError>| assert!(r.is_err());
    let mut data = vec![0; size.pixels()];
    let mut parabolas = vec![Parabola::default(); distance::scratch_parabolas(size.width)];
    on_bitmap(&image, |b| {
        let mut block = vec![0; clean::scratch_words(size) - 1];
        refused(clean::keep_largest(b, Arena::new(&mut block)).map(drop));
        refused(clean::fill_holes(b, 60, Arena::new(&mut block)).map(drop));
        refused(distance::distance(b, &mut data[1..], &mut parabolas).map(drop));
        refused(distance::distance(b, &mut data, &mut parabolas[1..]).map(drop));
        let mut row = vec![0; size.width - 1];
        refused(distance::squared_distances(b, &mut data, &mut parabolas, &mut row, |_, _| ()));
        refused(boundary::boundary(b, Element::Square, &mut [0; 3]).map(drop));
        refused(hull::convex_hull(hull::bitmap_extents(b), &mut List::<_, 5>::new()));
        let plane = distance::distance(b, &mut data, &mut parabolas).unwrap();
        for rule in RULES {
            let enough = match rule {
                Rule::EdtOrdered => words::<u32>(sequential_thinning::scratch_order(b.count(), 16)),
                _ => words::<Word>(parallel_thinning::scratch_words(size)),
            };
            let mut block = vec![0; enough - 1];
            refused(
                thinning::thin(b, (rule, parallel_thinning::thin), &plane, Arena::new(&mut block)).map(drop),
            );
        }
    });
    on_bitmap(&image, |b| {
        // Distances of another size read as 0 outside: a worse order, no panic.
        let plane = Plane::over(Size::new(7, 3).unwrap(), &mut data).unwrap();
        let mut block = vec![0; words::<u32>(sequential_thinning::scratch_order(b.count(), u16::MAX))];
        thinning::thin(b, (Rule::EdtOrdered, parallel_thinning::thin), &plane, Arena::new(&mut block))
            .unwrap();
    });
    let grey = Grey::new(size, size.width, &[0; 4800]).unwrap();
    refused(binarise::median(grey, &mut [0; 4799], binarise::median_row).map(drop));
    refused(binarise::binarise(grey, 0, Tone::Bright, &mut [0; 3]).map(drop));
}

/// Noise, a checkerboard, isolated dots, a comb and a spiral of 1024x1024 pixels: were a speck to cost the
/// whole image, they would take hours.
#[test]
fn specks_cost_only_their_own_rows() {
    let side = 1024;
    let picture = |f: &dyn Fn(usize, usize) -> bool| -> Image {
        (0..side).map(|v| (0..side).map(|u| f(u, v)).collect()).collect()
    };
    for (name, image) in [
        ("noise 20 %", naive::noise(side, side, 20, 1)),
        ("noise 41 %", naive::noise(side, side, 41, 2)),
        ("noise 50 %", naive::noise(side, side, 50, 3)),
        ("checkerboard", picture(&|u, v| (u + v) % 2 == 0)),
        ("dots", picture(&|u, v| u % 2 == 0 && v % 2 == 0)),
        ("comb", picture(&|u, v| u % 2 == 0 || v == if u % 4 == 1 { 0 } else { side - 1 })),
        ("spiral", spiral(side)),
    ] {
        let mut block = vec![0; clean::scratch_words(naive::size(&image))];
        on_bitmap(&image, |b| {
            let start = std::time::Instant::now();
            clean::fill_holes(b, 60, Arena::new(&mut block)).unwrap();
            let holes = start.elapsed();
            let found = clean::keep_largest(b, Arena::new(&mut block)).unwrap();
            let all = start.elapsed();
            println!("{name}: {found:?}, holes {holes:?}, both {all:?}");
            assert!(all.as_secs() < 5, "{name} took {all:?}");
        });
    }
}
