//! The fixed-point formats of the core, each with its range.
//!
//! | what | format | range | unit |
//! |---|---|---|---|
//! | coordinates, lengths, radii, disparity | [`PX`] = 256 in `i32` | +-2^20 (4096 px) | 1/256 px |
//! | distance to the background | `u16` | 0..=65535 (4095 px) | 1/16 px |
//! | directions and cosines | [`UNIT`] = 2^14 in `i32` | +-2^14 | 1 |
//! | ratios, logarithms, slopes | [`ONE`] = 2^16 in `i32` | +-2^15 | 1 |

/// One pixel, in the unit of every coordinate and length: 1/256 px.
pub const PX: i32 = 256;
/// Bits below the point of a coordinate.
pub const PX_BITS: u32 = 8;
/// One, in the unit of directions and cosines.
pub const UNIT: i32 = 1 << 14;
/// One, in the unit of ratios, logarithms and slopes.
pub const ONE: i32 = 1 << 16;

/// `n / d` rounded to the nearest integer, halves away from zero; 0 when `d` is 0.
pub const fn div_round(n: i64, d: i64) -> i64 {
    if d == 0 {
        return 0;
    }
    // Quotients of i64::MIN would overflow; no stage comes near it.
    let half = d.unsigned_abs() / 2;
    let q = div_floor(n.unsigned_abs().saturating_add(half), d.unsigned_abs());
    let q = if q > i64::MAX as u64 { i64::MAX } else { q as i64 };
    if (n < 0) != (d < 0) { -q } else { q }
}

/// `n / d` rounded down; 0 when `d` is 0. One instruction where both have 32 bits, as they nearly always have: a
/// microcontroller divides longer ones in software.
pub const fn div_floor(n: u64, d: u64) -> u64 {
    if (n | d) >> 32 != 0 {
        return if cfg!(target_pointer_width = "64") { quotient(n, d) } else { div_long(n, d) };
    }
    match (n as u32).checked_div(d as u32) {
        Some(q) => q as u64,
        None => 0,
    }
}

const fn quotient(n: u64, d: u64) -> u64 {
    match n.checked_div(d) {
        Some(q) => q,
        None => 0,
    }
}

/// `n / d` rounded down; where divisor and quotient have 32 bits by two divisions for 16 bits each (Knuth, The Art of
/// Computer Programming, 4.3.1 D).
#[inline(never)]
const fn div_long(n: u64, d: u64) -> u64 {
    if d >> 32 != 0 || n >> 32 >= d {
        return quotient(n, d);
    }
    // The divisor below 2^32, and n below 2^32 times it: so is n << bits below 2^64.
    let bits = (d as u32).leading_zeros();
    let (n, d) = (n << bits, (d as u32) << bits);
    let (high, rest) = digit((n >> 32) as u32, n as u32 >> 16, d);
    let (low, _) = digit(rest, n as u32 & 0xFFFF, d);
    (high << 16 | low) as u64
}

/// Quotient and rest of `high << 16 | next` and `d`, of which `high` is the smaller and `d` has its highest bit.
const fn digit(high: u32, next: u32, d: u32) -> (u32, u32) {
    // The highest bit said once more: then the compiler knows that this is no division by 0.
    let (d1, d0) = (d >> 16 | 1 << 15, d & 0xFFFF);
    let (mut q, mut rest) = (high / d1, high % d1);
    // At most two too large. Once both have 16 bits, product and rest << 16 | next stay below 2^32.
    while rest >> 16 == 0 && (q >> 16 != 0 || q * d0 > (rest << 16 | next)) {
        q -= 1;
        rest += d1;
    }
    // Modulo 2^32, which the rest is below.
    (q, (high << 16 | next).wrapping_sub(q.wrapping_mul(d)))
}

/// `v` brought to `least..=greatest`; to `least` where the bounds cross, where `clamp` panics.
pub const fn confined(v: i32, least: i32, greatest: i32) -> i32 {
    let v = if v > greatest { greatest } else { v };
    if v < least { least } else { v }
}

/// `v` saturated to `i32`.
pub const fn saturate(v: i64) -> i32 {
    if v > i32::MAX as i64 {
        i32::MAX
    } else if v < i32::MIN as i64 {
        i32::MIN
    } else {
        v as i32
    }
}

/// The square root of `x`, rounded down; short where `x` has 32 bits.
pub const fn isqrt(x: u64) -> u64 {
    if x >> 32 == 0 { (x as u32).isqrt() as u64 } else { x.isqrt() }
}

/// Length of the vector `(a, b)`, in its own unit, rounded down. |a|, |b| < 2^31.
pub const fn hypot(a: i32, b: i32) -> i32 {
    // Squares of at most 2^62 each, less than 2^63 together.
    let (a, b) = (a as i64, b as i64);
    saturate(isqrt((a * a + b * b) as u64) as i64)
}

/// Base-two logarithm of `x`, in 1/65536; 0 for `x` = 0. Error below 3/65536.
///
/// The whole part is the position of the leading one; the fraction comes bit by bit from repeated
/// squaring of the mantissa (Q2.30), each squaring that passes 2 giving a one.
pub const fn log2(x: u64) -> i32 {
    if x == 0 {
        return 0;
    }
    let whole = x.ilog2();
    let mut m = if whole >= 30 { x >> (whole - 30) } else { x << (30 - whole) } as u32;
    let mut log = (whole as i32) << 16;
    let mut bit = 1 << 15;
    while bit > 0 {
        // 2^30 <= m < 2^31: the square is below 2^62, and below 2^32 when shifted.
        m = ((m as u64 * m as u64) >> 30) as u32;
        if m >= 2 << 30 {
            m >>= 1;
            log += bit;
        }
        bit >>= 1;
    }
    log
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples;

    #[test]
    fn rounding_division_is_symmetric() {
        assert_eq!([div_round(7, 2), div_round(-7, 2), div_round(7, -2), div_round(6, 4)], [4, -4, -4, 2]);
        assert_eq!(div_round(5, 0), 0);
        assert_eq!(div_round(i64::MIN, 1), -i64::MAX);
    }

    #[test]
    fn long_division_is_division() {
        let mut seed = 1u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 32) as u32
        };
        for _ in 0..samples(100_000, 1000) {
            let d = (random() >> (random() % 32)).max(1);
            let d = if random() % 4 == 0 { d | 0xFFFF_0000 } else { d };
            let high = random() % d;
            for low in [0, 0xFFFF, 0xFFFF_0000, u32::MAX, random()] {
                let n = u64::from(high) << 32 | u64::from(low);
                assert_eq!(div_long(n, d.into()), n / u64::from(d), "{n} / {d}");
            }
        }
    }

    #[test]
    fn logarithm_of_powers_is_exact_and_monotone() {
        for k in 0..64 {
            assert_eq!(log2(1 << k), k << 16);
        }
        assert!((1..5000u64).all(|x| log2(x) <= log2(x + 1)));
        assert!((log2(3) - 103_872).abs() <= 3, "log2 3 = 1.5849625");
    }
}
