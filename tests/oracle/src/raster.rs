//! Naive twins of the raster stages, on plain vectors: written to be checked by eye, not to be fast.

use shared::bitmap::{Bitmap, Size, Word};

/// `image[v][u]`: whether the pixel is set.
pub type Image = Vec<Vec<bool>>;

/// A pixel as (u, v).
pub type At = (i32, i32);

/// Neighbours from north clockwise.
pub const AROUND: [At; 8] = [(0, -1), (1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1)];

/// Pseudo-random numbers: the same ones for the same seed, everywhere (SplitMix64).
pub struct Random(pub u64);

impl Random {
    /// A number below `n`.
    pub fn below(&mut self, n: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.0;
        x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        (x ^ x >> 31) % n
    }
}

/// An image in which each pixel is set with a chance of `percent`.
pub fn noise(width: usize, height: usize, percent: u64, seed: u64) -> Image {
    let mut random = Random(seed);
    (0..height).map(|_| (0..width).map(|_| random.below(100) < percent).collect()).collect()
}

/// An image of overlapping discs and boxes.
pub fn blobs(width: usize, height: usize, seed: u64) -> Image {
    let mut random = Random(seed);
    let mut image = vec![vec![false; width]; height];
    for _ in 0..4 {
        let (cu, cv) = (random.below(width as u64 + 1) as i32, random.below(height as u64 + 1) as i32);
        let (a, b) = (random.below(9) as i32 + 1, random.below(9) as i32 + 1);
        let (round, on) = (random.below(2) == 0, random.below(5) != 0);
        for (v, row) in image.iter_mut().enumerate() {
            for (u, pixel) in row.iter_mut().enumerate() {
                let (du, dv) = (u as i32 - cu, v as i32 - cv);
                let inside = if round { du * du + dv * dv <= a * b } else { du.abs() <= a && dv.abs() <= b };
                if inside {
                    *pixel = on;
                }
            }
        }
    }
    image
}

/// Width and height.
pub fn size(image: &Image) -> Size {
    Size::new(image.first().map_or(0, Vec::len), image.len()).unwrap()
}

/// The pixel, clear outside.
pub fn get(image: &Image, (u, v): At) -> bool {
    size(image).contains(u, v) && image[v as usize][u as usize]
}

/// The image as a bitmap; with words to spare that hold rubbish.
pub fn words(image: &Image) -> Vec<Word> {
    vec![Word::MAX / 3; size(image).words() + 2]
}

/// A bitmap with the pixels of the image.
pub fn bitmap<'w>(image: &Image, words: &'w mut [Word]) -> Bitmap<'w> {
    let mut bitmap = Bitmap::new(size(image), words).unwrap();
    for (u, v) in all(image) {
        bitmap.put(u as usize, v as usize, get(image, (u, v)));
    }
    bitmap
}

/// The pixels of a bitmap; panics if a bit beyond the width is set.
pub fn image(bitmap: &Bitmap<'_>) -> Image {
    let Size { width, height } = bitmap.size();
    for v in 0..height {
        for (i, word) in bitmap.row(v as i32).iter().enumerate() {
            assert_eq!(word & !bitmap.valid(i), 0, "bits beyond the width, row {v}");
        }
    }
    (0..height).map(|v| (0..width).map(|u| bitmap.get(u as i32, v as i32)).collect()).collect()
}

/// All positions in raster order.
pub fn all(image: &Image) -> Vec<At> {
    let Size { width, height } = size(image);
    (0..height as i32).flat_map(|v| (0..width as i32).map(move |u| (u, v))).collect()
}

/// Set positions in raster order.
pub fn set(image: &Image) -> Vec<At> {
    all(image).into_iter().filter(|&p| get(image, p)).collect()
}

fn step((u, v): At, (du, dv): At) -> At {
    (u + du, v + dv)
}

/// The neighbours as 0 or 1, from north clockwise: p2 .. p9 of the thinning papers.
pub fn neighbours(image: &Image, at: At) -> [u8; 8] {
    AROUND.map(|d| u8::from(get(image, step(at, d))))
}

/// Components of the pixels with the value `on`, each in the order it was found, the components by their
/// first pixel in raster order.
pub fn components(image: &Image, on: bool, eight: bool) -> Vec<Vec<At>> {
    let mut seen = vec![vec![false; size(image).width]; size(image).height];
    let mut found = Vec::new();
    for start in all(image) {
        if get(image, start) != on || seen[start.1 as usize][start.0 as usize] {
            continue;
        }
        seen[start.1 as usize][start.0 as usize] = true;
        let mut component = vec![start];
        let mut k = 0;
        while k < component.len() {
            for d in AROUND.iter().step_by(if eight { 1 } else { 2 }) {
                let next = step(component[k], *d);
                if size(image).contains(next.0, next.1)
                    && get(image, next) == on
                    && !seen[next.1 as usize][next.0 as usize]
                {
                    seen[next.1 as usize][next.0 as usize] = true;
                    component.push(next);
                }
            }
            k += 1;
        }
        found.push(component);
    }
    found
}

/// The image within a clear frame one pixel wide.
pub fn framed(image: &Image) -> Image {
    let Size { width, height } = size(image);
    let mut out = vec![vec![false; width + 2]; height + 2];
    for (u, v) in set(image) {
        out[v as usize + 1][u as usize + 1] = true;
    }
    out
}

/// Number of 8-connected components of the object, and of its holes.
pub fn topology(image: &Image) -> (usize, usize) {
    (components(image, true, true).len(), components(&framed(image), false, false).len() - 1)
}

/// Only the largest 8-connected component, the first of equals, and the two largest areas.
pub fn largest(image: &Image) -> (Image, usize, usize) {
    let mut found = components(image, true, true);
    found.sort_by_key(|c| std::cmp::Reverse(c.len()));
    let mut out = vec![vec![false; size(image).width]; size(image).height];
    for &(u, v) in found.first().into_iter().flatten() {
        out[v as usize][u as usize] = true;
    }
    (out, found.first().map_or(0, Vec::len), found.get(1).map_or(0, Vec::len))
}

/// Small holes filled, and how many.
pub fn fill_holes(image: &Image, below: usize) -> (Image, usize) {
    let mut out = image.clone();
    let mut filled = 0;
    for hole in components(&framed(image), false, false) {
        if !hole.contains(&(0, 0)) && hole.len() < below {
            filled += 1;
            for (u, v) in hole {
                out[v as usize - 1][u as usize - 1] = true;
            }
        }
    }
    (out, filled)
}

/// A pixel for which `decide` holds over those of the 3x3 square around it that lie inside the image.
fn square(image: &Image, decide: impl Fn(&[bool]) -> bool) -> Image {
    let mut out = image.clone();
    for (u, v) in all(image) {
        let inside: Vec<bool> = AROUND
            .iter()
            .chain(&[(0, 0)])
            .map(|&d| step((u, v), d))
            .filter(|p| size(image).contains(p.0, p.1))
            .map(|p| get(image, p))
            .collect();
        out[v as usize][u as usize] = decide(&inside);
    }
    out
}

/// Closing and opening by a 3x3 square, the outside neutral.
pub fn close_open(image: &Image) -> Image {
    let dilate = |i: &Image| square(i, |p| p.contains(&true));
    let erode = |i: &Image| square(i, |p| !p.contains(&false));
    dilate(&erode(&erode(&dilate(image))))
}

/// Set pixels with a clear one among all, or among the four edge neighbours.
pub fn boundary(image: &Image, cross: bool) -> Image {
    let mut out = image.clone();
    for at in set(image) {
        let around = neighbours(image, at);
        let open = around.iter().step_by(if cross { 2 } else { 1 }).any(|&n| n == 0);
        out[at.1 as usize][at.0 as usize] = open;
    }
    out
}

/// Squared distance of each pixel to the nearest clear one; there are clear ones just outside.
pub fn squared_distances(image: &Image) -> Vec<Vec<u32>> {
    let Size { width, height } = size(image);
    let clear: Vec<At> = (-1..=height as i32)
        .flat_map(|v| (-1..=width as i32).map(move |u| (u, v)))
        .filter(|&p| !get(image, p))
        .collect();
    let nearest = |u: i32, v: i32| clear.iter().map(|c| (c.0 - u).pow(2) + (c.1 - v).pow(2)).min().unwrap();
    (0..height as i32).map(|v| (0..width as i32).map(|u| nearest(u, v) as u32).collect()).collect()
}

/// Median of the 3x3 square, the border repeated.
pub fn median(grey: &[Vec<u8>]) -> Vec<Vec<u8>> {
    let (width, height) = (grey.first().map_or(0, Vec::len) as i32, grey.len() as i32);
    let value = |u: i32, v: i32| grey[v.clamp(0, height - 1) as usize][u.clamp(0, width - 1) as usize];
    let middle = |u: i32, v: i32| {
        let mut nine: Vec<u8> =
            (-1..=1).flat_map(|dv| (-1..=1).map(move |du| value(u + du, v + dv))).collect();
        nine.sort_unstable();
        nine[4]
    };
    (0..height).map(|v| (0..width).map(|u| middle(u, v)).collect()).collect()
}

/// Variance between the classes of a histogram at every level, n0 n1 (mean0 - mean1)^2, as an exact
/// fraction (numerator, denominator).
pub fn variances(histogram: &[u32; 256]) -> Vec<Option<(u128, u128)>> {
    let class = |from: usize, to: usize| {
        (from..to).fold((0u128, 0u128), |(n, s), g| {
            (n + u128::from(histogram[g]), s + g as u128 * u128::from(histogram[g]))
        })
    };
    (0..256)
        .map(|level| {
            let ((n0, s0), (n1, s1)) = (class(0, level + 1), class(level + 1, 256));
            (n0 > 0 && n1 > 0).then(|| ((s0 * n1).abs_diff(s1 * n0).pow(2), n0 * n1))
        })
        .collect()
}

/// Whether one fraction is greater than another, by the Euclidean algorithm: no product can overflow.
pub fn is_greater(a: (u128, u128), b: (u128, u128)) -> bool {
    let (whole_a, whole_b) = (a.0 / a.1, b.0 / b.1);
    if whole_a != whole_b {
        return whole_a > whole_b;
    }
    match (a.0 % a.1, b.0 % b.1) {
        (0, _) => false,
        (_, 0) => true,
        // The remainders compare as the reciprocals do, the other way round.
        (rest_a, rest_b) => is_greater((b.1, rest_b), (a.1, rest_a)),
    }
}

/// Delete in parallel the pixels that `finds` names, for one step after the other, until nothing changes.
fn cycle(image: &Image, steps: usize, finds: impl Fn(usize, [u8; 8]) -> bool) -> Image {
    let mut image = image.clone();
    loop {
        let before = image.clone();
        for k in 0..steps {
            let was = image.clone();
            for at in set(&was) {
                if finds(k, neighbours(&was, at)) {
                    image[at.1 as usize][at.0 as usize] = false;
                }
            }
        }
        if image == before {
            return image;
        }
    }
}

/// Zhang and Suen 1984, as printed.
pub fn zhang_suen(image: &Image) -> Image {
    cycle(image, 2, |k, p| {
        let [p2, _, p4, _, p6, _, p8, _] = p;
        let a = (0..8).filter(|&i| p[i] == 0 && p[(i + 1) % 8] == 1).count();
        let b: u8 = p.iter().sum();
        let open = if k == 0 {
            p2 * p4 * p6 == 0 && p4 * p6 * p8 == 0
        } else {
            p2 * p4 * p8 == 0 && p2 * p6 * p8 == 0
        };
        (2..=6).contains(&b) && a == 1 && open
    })
}

/// Guo and Hall 1989, algorithm A1, as printed.
pub fn guo_hall(image: &Image) -> Image {
    cycle(image, 2, |k, p| {
        let [p2, p3, p4, p5, p6, p7, p8, p9] = p.map(|x| x == 1);
        let count = |terms: [bool; 4]| terms.iter().filter(|&&t| t).count();
        let c = count([!p2 && (p3 || p4), !p4 && (p5 || p6), !p6 && (p7 || p8), !p8 && (p9 || p2)]);
        let n1 = count([p9 || p2, p3 || p4, p5 || p6, p7 || p8]);
        let n2 = count([p2 || p3, p4 || p5, p6 || p7, p8 || p9]);
        let m = if k == 0 { (p6 || p7 || !p9) && p8 } else { (p2 || p3 || !p5) && p4 };
        c == 1 && (2..=3).contains(&n1.min(n2)) && !m
    })
}

/// thin(A, B) = A - hit-or-miss(A, B) for the eight patterns L, each written out: p2 .. p9, 2 for either.
pub fn hit_or_miss(image: &Image) -> Image {
    const L: [[u8; 8]; 8] = [
        [0, 0, 2, 1, 1, 1, 2, 0],
        [0, 0, 0, 2, 1, 2, 1, 2],
        [2, 0, 0, 0, 2, 1, 1, 1],
        [1, 2, 0, 0, 0, 2, 1, 2],
        [1, 1, 2, 0, 0, 0, 2, 1],
        [1, 2, 1, 2, 0, 0, 0, 2],
        [2, 1, 1, 1, 2, 0, 0, 0],
        [0, 2, 1, 2, 1, 2, 0, 0],
    ];
    cycle(image, 8, |k, p| (0..8).all(|i| L[k][i] == 2 || L[k][i] == p[i]))
}

/// Whether deleting the centre keeps the topology of the 3x3 neighbourhood, by counting what there is:
/// object components, 8-connected, that touch the centre, and background ones, 4-connected, that share an
/// edge with it.
pub fn is_simple(p: [u8; 8]) -> bool {
    let mut hood = vec![vec![false; 3]; 3];
    for (d, on) in AROUND.iter().zip(p) {
        hood[(1 + d.1) as usize][(1 + d.0) as usize] = on == 1;
    }
    let object = components(&hood, true, true).len();
    // The centre must not join the background: mark it as object for that count.
    hood[1][1] = true;
    let edge = [(1, 0), (2, 1), (1, 2), (0, 1)];
    let background =
        components(&hood, false, false).iter().filter(|c| edge.iter().any(|e| c.contains(e))).count();
    object == 1 && background == 1
}

/// Thinning in increasing distance, by its definition: `d16` are distances in 1/16 px.
pub fn edt_ordered(image: &Image, d16: &[Vec<u32>]) -> Image {
    let d =
        |(u, v): At| if size(image).contains(u, v) { f64::from(d16[v as usize][u as usize]) } else { 0.0 };
    let anchor = |at: At| {
        let sum = |weights: [(i32, i32, f64); 3]| -> f64 {
            weights.iter().map(|&(du, dv, w)| w * (d(step(at, (du, dv))) - d(step(at, (-du, -dv))))).sum()
        };
        let gx = sum([(1, -1, 1.0), (1, 0, 2.0), (1, 1, 1.0)]) / 128.0;
        let gy = sum([(-1, 1, 1.0), (0, 1, 2.0), (1, 1, 1.0)]) / 128.0;
        d(at) > 24.0 && gx * gx + gy * gy < 0.49
    };
    let mut image = image.clone();
    let mut order = set(&image);
    order.sort_by_key(|&(u, v)| (d16[v as usize][u as usize], v, u));
    let anchors: Vec<bool> = order.iter().map(|&at| anchor(at)).collect();
    loop {
        let before = image.clone();
        for (at, anchor) in order.iter().zip(&anchors) {
            if get(&image, *at) && !anchor && is_simple(neighbours(&image, *at)) {
                image[at.1 as usize][at.0 as usize] = false;
            }
        }
        if image == before {
            break;
        }
    }
    thin_once(&mut image, &order);
    image
}

fn thin_once(image: &mut Image, order: &[At]) {
    for &at in order {
        let around = neighbours(image, at);
        if get(image, at) && is_simple(around) && around.iter().sum::<u8>() >= 2 {
            image[at.1 as usize][at.0 as usize] = false;
        }
    }
}

/// One sweep in raster order over simple pixels that are no end points.
pub fn minimal(image: &Image) -> Image {
    let mut out = image.clone();
    thin_once(&mut out, &set(image));
    out
}

/// Convex hull by gift wrapping, clockwise on the screen, from the upper left point on.
pub fn hull(points: &[(i64, i64)]) -> Vec<(i64, i64)> {
    let Some(&start) = points.iter().min_by_key(|p| (p.1, p.0)) else { return Vec::new() };
    let mut hull = vec![start];
    loop {
        let here = *hull.last().unwrap();
        let mut best = here;
        for &p in points {
            let (a, b) = ((best.0 - here.0, best.1 - here.1), (p.0 - here.0, p.1 - here.1));
            let turn = a.0 * b.1 - a.1 * b.0;
            let further = b.0 * b.0 + b.1 * b.1 > a.0 * a.0 + a.1 * a.1;
            if best == here || turn < 0 || turn == 0 && further {
                best = p;
            }
        }
        if best == start || best == here {
            return hull;
        }
        hull.push(best);
    }
}
