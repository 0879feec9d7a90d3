//! Naive twins of the stages that match, in floats or fractions and by brute force.

/// A point, px.
pub type At = [f64; 2];

/// The largest disc that touches `points[i]` on the inner side of its normal and holds no other point,
/// by bisection of the radius over the definition; points seen at more than 60 degrees from the normal
/// do not count.
pub fn medial_radius(points: &[(At, At)], i: usize, most: f64) -> f64 {
    let ([u, v], [nu, nv]) = points[i];
    let empty = |rho: f64| {
        let centre = [u - rho * nu, v - rho * nv];
        points.iter().enumerate().filter(|(j, _)| *j != i).all(|(_, (q, _))| {
            let (du, dv) = (q[0] - u, q[1] - v);
            let ahead = -(du * nu + dv * nv);
            ahead < 0.5 * du.hypot(dv) || (q[0] - centre[0]).hypot(q[1] - centre[1]) >= rho
        })
    };
    let (mut low, mut high) = (0.0, most);
    for _ in 0..60 {
        let middle = (low + high) / 2.0;
        if empty(middle) { low = middle } else { high = middle }
    }
    low
}

/// A contour point: where, 1/256 px, and its outward normal, 1/16384.
pub type Rim = ([i64; 2], [i64; 2]);

/// The ball that grows from `points[i]` in whole numbers, by trying every point in turn: centre, radius and contact.
/// Nothing where no point stops it, or one lies more than `slack` deep in it.
pub fn medial_ball(points: &[Rim], i: usize, slack: i64) -> Option<([i64; 2], i64, usize)> {
    let (p, n) = points[i];
    let (mut rho, mut contact) = ((1i64 << 27) - 1, None);
    for (j, (q, _)) in points.iter().enumerate() {
        let (du, dv) = (q[0] - p[0], q[1] - p[1]);
        let height = (-du * n[0] - dv * n[1]).div_euclid(1 << 14);
        let squared = du * du + dv * dv;
        let is_ahead = height > 0 && 4 * height * height >= squared;
        if is_ahead && height < 2 * rho && squared < 2 * rho * height {
            (rho, contact) = (squared / (2 * height), Some(j));
        }
    }
    let contact = contact.filter(|_| rho > 0)?;
    let centre = [0, 1].map(|k| p[k] + (-rho * n[k] + (1 << 13)).div_euclid(1 << 14));
    let least = (rho - slack).max(0);
    let is_deep = |q: &[i64; 2]| (q[0] - centre[0]).pow(2) + (q[1] - centre[1]).pow(2) < least * least;
    (!points.iter().any(|(q, _)| is_deep(q))).then_some((centre, rho, contact))
}

/// An edge of a row: where, and whether the object lies to its left.
pub type Edge = (i32, bool);

/// The cheapest monotone alignment of two rows, by trying all of them: its cost and its pairs.
pub fn cheapest(
    a: &[Edge],
    b: &[Edge],
    cost: &dyn Fn(Edge, Edge) -> i32,
    skip: i32,
) -> (i32, Vec<(usize, usize)>) {
    let (Some((x, rest_a)), Some((y, rest_b))) = (a.split_last(), b.split_last()) else {
        return (skip * (a.len() + b.len()) as i32, Vec::new());
    };
    let apart = [cheapest(rest_a, b, cost, skip), cheapest(a, rest_b, cost, skip)]
        .map(|(spent, pairs)| (spent + skip, pairs));
    let together = (x.1 == y.1).then(|| {
        let (spent, mut pairs) = cheapest(rest_a, rest_b, cost, skip);
        pairs.push((rest_a.len(), rest_b.len()));
        (spent + cost(*x, *y), pairs)
    });
    together.into_iter().chain(apart).min_by_key(|(spent, _)| *spent).unwrap_or_default()
}

/// Value, slope along u and slope along v at the centre of gravity: Cauchy weights of scale 1 px, six
/// rounds after plain least squares, a ridge of 1 px^2 on both slopes. Gives the plane as a function.
pub fn robust_plane(seen: &[(At, f64, f64)]) -> impl Fn(At) -> f64 {
    let fit = |weights: &[f64]| {
        let total: f64 = weights.iter().sum();
        let mean = |f: &dyn Fn(&(At, f64, f64)) -> f64| {
            seen.iter().zip(weights).map(|(s, w)| w * f(s)).sum::<f64>() / total
        };
        let (u0, v0, d0) = (mean(&|s| s.0[0]), mean(&|s| s.0[1]), mean(&|s| s.1));
        let uu = mean(&|s| (s.0[0] - u0).powi(2)) + 1.0;
        let vv = mean(&|s| (s.0[1] - v0).powi(2)) + 1.0;
        let uv = mean(&|s| (s.0[0] - u0) * (s.0[1] - v0));
        let ud = mean(&|s| (s.0[0] - u0) * (s.1 - d0));
        let vd = mean(&|s| (s.0[1] - v0) * (s.1 - d0));
        let determinant = uu * vv - uv * uv;
        let (a, b) = ((ud * vv - vd * uv) / determinant, (vd * uu - ud * uv) / determinant);
        move |p: At| d0 + a * (p[0] - u0) + b * (p[1] - v0)
    };
    let mut plane = fit(&seen.iter().map(|s| s.2).collect::<Vec<_>>());
    for _ in 0..6 {
        plane = fit(&seen.iter().map(|s| s.2 / (1.0 + (s.1 - plane(s.0)).powi(2))).collect::<Vec<_>>());
    }
    plane
}

/// The six ratios of a quadruplet as fractions (numerator, denominator).
pub fn ratios([a, b, c, d]: [(i64, i64); 4]) -> [(i128, i128); 6] {
    let area = |p: (i64, i64), q: (i64, i64), r: (i64, i64)| {
        i128::from((q.0 - p.0) * (r.1 - p.1) - (q.1 - p.1) * (r.0 - p.0)).abs()
    };
    let s = [area(a, b, c), area(a, b, d), area(a, c, d), area(b, c, d)];
    [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)].map(|(k, l)| (s[k], s[l]))
}

/// Least squares affine map from `a` to `b`: gives the largest distance of an image from its partner, and
/// the map as rows (for u' and v') of [coefficient of u, of v, constant].
pub fn affine(pairs: &[(At, At)]) -> (f64, [[f64; 3]; 2]) {
    let n = pairs.len() as f64;
    let mean = |f: &dyn Fn(&(At, At)) -> f64| pairs.iter().map(f).sum::<f64>() / n;
    let (u0, v0) = (mean(&|p| p.0[0]), mean(&|p| p.0[1]));
    let uu = mean(&|p| (p.0[0] - u0).powi(2));
    let vv = mean(&|p| (p.0[1] - v0).powi(2));
    let uv = mean(&|p| (p.0[0] - u0) * (p.0[1] - v0));
    let map = [0, 1].map(|k| {
        let (ud, vd) = (mean(&|p| (p.0[0] - u0) * p.1[k]), mean(&|p| (p.0[1] - v0) * p.1[k]));
        let determinant = uu * vv - uv * uv;
        let (x, y) = ((ud * vv - vd * uv) / determinant, (vd * uu - ud * uv) / determinant);
        [x, y, mean(&|p| p.1[k]) - x * u0 - y * v0]
    });
    let off = |p: &(At, At)| {
        let at = map.map(|[x, y, c]| x * p.0[0] + y * p.0[1] + c);
        (at[0] - p.1[0]).hypot(at[1] - p.1[1])
    };
    (pairs.iter().map(off).fold(0.0, f64::max), map)
}
