//! Pictures as plain grids: naive thinning, an independent count of components and holes, random blobs.

/// A picture: `grid[v][u]`.
pub type Grid = Vec<Vec<bool>>;

/// Neighbours from north clockwise.
const AROUND: [(i32, i32); 8] = [(0, -1), (1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1)];

/// Whether a pixel is set; false outside.
pub fn get(grid: &Grid, u: i32, v: i32) -> bool {
    u >= 0 && v >= 0 && grid.get(v as usize).and_then(|row| row.get(u as usize)).copied().unwrap_or(false)
}

/// A drawing, `#` set.
pub fn from_art(art: &str) -> Grid {
    let rows: Vec<&str> = art.lines().map(str::trim).filter(|l| !l.is_empty()).collect();
    let width = rows.iter().map(|r| r.chars().count()).max().unwrap_or(0);
    rows.iter().map(|r| (0..width).map(|u| r.chars().nth(u) == Some('#')).collect()).collect()
}

/// The drawing of a picture.
pub fn to_art(grid: &Grid) -> String {
    let row = |r: &Vec<bool>| r.iter().map(|&b| if b { '#' } else { '.' }).collect::<String>() + "\n";
    grid.iter().map(row).collect()
}

/// Components, over corners or over sides only, of the pixels that are set or clear; clear pixels
/// include a frame around the picture.
fn components(grid: &Grid, set: bool, corners: bool) -> usize {
    let (height, width) = (grid.len() as i32, grid.first().map_or(0, Vec::len) as i32);
    let mut seen = std::collections::HashSet::new();
    let mut count = 0;
    for v in -1..=height {
        for u in -1..=width {
            let inside = |u: i32, v: i32| (-1..=width).contains(&u) && (-1..=height).contains(&v);
            if get(grid, u, v) != set || !seen.insert((u, v)) {
                continue;
            }
            count += 1;
            let mut stack = vec![(u, v)];
            while let Some((u, v)) = stack.pop() {
                for (k, (du, dv)) in AROUND.into_iter().enumerate() {
                    let (u, v) = (u + du, v + dv);
                    let touching = corners || k % 2 == 0;
                    if touching && inside(u, v) && get(grid, u, v) == set && seen.insert((u, v)) {
                        stack.push((u, v));
                    }
                }
            }
        }
    }
    count
}

/// Components over sides and corners, and holes (clear components over sides, but the outer one).
pub fn topology(grid: &Grid) -> (usize, usize) {
    (components(grid, true, true), components(grid, false, false) - 1)
}

/// Thinning by the book: in raster order take off every pixel whose removal changes neither components
/// nor holes of its 3x3 neighbourhood, ends kept, until nothing changes.
pub fn thin(grid: &mut Grid) {
    loop {
        let mut changed = false;
        for v in 0..grid.len() {
            for u in 0..grid[v].len() {
                let around = AROUND.map(|(du, dv)| get(grid, u as i32 + du, v as i32 + dv));
                let set = around.iter().filter(|&&b| b).count();
                let crossings = (0..8)
                    .step_by(2)
                    .filter(|&k| !around[k] && (around[k + 1] || around[(k + 2) % 8]))
                    .count();
                if grid[v][u] && set >= 2 && crossings == 1 {
                    grid[v][u] = false;
                    changed = true;
                }
            }
        }
        if !changed {
            return;
        }
    }
}

/// A random picture: discs and bars, then a share of `noise` in 256 flipped pixels.
pub fn random(width: usize, height: usize, shapes: usize, noise: u32, seed: u64) -> Grid {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut next = |n: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 33) as usize % n.max(1)
    };
    let mut grid = vec![vec![false; width]; height];
    for _ in 0..shapes {
        let (cu, cv, r) = (next(width) as i32, next(height) as i32, 2 + next(width.min(height) / 3) as i32);
        let (a, hole) = (1 + next(r as usize * 2) as i32, next(5) == 0);
        for v in 0..height as i32 {
            for u in 0..width as i32 {
                let (du, dv) = (u - cu, v - cv);
                if if r % 2 == 0 { du * du + dv * dv <= r * r } else { du.abs() <= r && dv.abs() <= a } {
                    grid[v as usize][u as usize] = !hole;
                }
            }
        }
    }
    for row in &mut grid {
        for pixel in row {
            if (next(256) as u32) < noise {
                *pixel = !*pixel;
            }
        }
    }
    grid
}

/// Exact distance to the nearest clear pixel centre, in 1/16 px rounded down, by looking at all of them
/// within the largest possible circle; outside the picture is clear.
pub fn distance(grid: &Grid) -> Vec<u16> {
    let (height, width) = (grid.len() as i32, grid.first().map_or(0, Vec::len) as i32);
    let mut plane = Vec::new();
    for v in 0..height {
        for u in 0..width {
            let mut least = i32::MAX;
            let mut r = 0;
            while get(grid, u, v) && r * r < least {
                r += 1;
                for k in -r..=r {
                    for (a, b) in [(k, -r), (k, r), (-r, k), (r, k)] {
                        if !get(grid, u + a, v + b) {
                            least = least.min(a * a + b * b);
                        }
                    }
                }
            }
            plane.push(if least == i32::MAX { 0 } else { (256 * least as u32).isqrt() as u16 });
        }
    }
    plane
}
