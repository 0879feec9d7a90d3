//! A plot of one or more lines over whole numbers, its values counted from zero.

use super::canvas::{Anchor, Canvas, Letters};
use crate::report::layers::Place;
use crate::report::layers::colour::{APART, FAINT, INK, PAPER, mix};
use image::RgbImage;

/// Size of the picture, px.
const SIZE: [u32; 2] = [960, 600];
/// Paper around the axes: left, top, right, bottom, px.
const EDGES: [f64; 4] = [84.0, 100.0, 36.0, 72.0];
/// About how many lines cross the plot.
const GRID_LINES: f64 = 6.0;

/// A named line.
pub(crate) struct Line<'a> {
    /// Its name in the legend.
    pub(crate) name: &'a str,
    /// Its points.
    pub(crate) points: Vec<[f64; 2]>,
}

/// The plot; `x` and `y` say what runs along the axes.
pub(crate) fn plot(title: &str, x: &str, y: &str, lines: &[Line<'_>]) -> RgbImage {
    let [width, height] = SIZE.map(f64::from);
    let [left, top, right, bottom] = EDGES;
    let all = || lines.iter().flat_map(|line| &line.points);
    let first = all().map(|p| p[0]).fold(f64::INFINITY, f64::min);
    let last = all().map(|p| p[0]).fold(first + 1.0, f64::max);
    let step = round_step(all().map(|p| p[1]).fold(0.0, f64::max) / GRID_LINES);
    let highest = (all().map(|p| p[1]).fold(0.0, f64::max) / step).ceil().max(1.0);
    let place = |[u, v]: [f64; 2]| {
        Place::new(
            left + (u - first + 0.3) / (last - first + 0.6) * (width - left - right),
            height - bottom - v / (highest * step) * (height - top - bottom),
        )
    };
    let mut canvas = Canvas::new(SIZE[0], SIZE[1], PAPER);
    canvas.text(title, Place::new(16.0, 26.0), Anchor::Left, Letters::Large, INK);
    canvas.text(y, Place::new(16.0, 64.0), Anchor::Left, Letters::Small, FAINT);
    canvas.text(
        x,
        Place::new((left + width - right) / 2.0, height - 20.0),
        Anchor::Centre,
        Letters::Small,
        FAINT,
    );
    for tick in 0..=highest as u32 {
        let value = f64::from(tick) * step;
        let at = place([first, value]).y;
        let colour = if tick == 0 { FAINT } else { mix(FAINT, PAPER, 0.7) };
        canvas.line(Place::new(left, at), Place::new(width - right, at), 1.0, colour);
        let decimals = (-step.log10()).ceil().max(0.0) as usize;
        canvas.text(
            &format!("{value:.decimals$}"),
            Place::new(left - 32.0, at),
            Anchor::Centre,
            Letters::Small,
            INK,
        );
    }
    for number in first.ceil() as i64..=last.floor() as i64 {
        let at = place([number as f64, 0.0]);
        canvas.line(at, at + Place::new(0.0, 6.0), 1.0, FAINT);
        canvas.text(&number.to_string(), at + Place::new(0.0, 20.0), Anchor::Centre, Letters::Small, INK);
    }
    let mut legend = Place::new(width - right - 190.0, 64.0);
    for (line, colour) in lines.iter().rev().zip([APART[5], APART[6], APART[2]]) {
        let points: Vec<Place> = line.points.iter().map(|p| place(*p)).collect();
        canvas.lines(&points, false, 3.0, colour);
        for point in points {
            canvas.dot(point, 4.5, colour, PAPER);
        }
        canvas.dot(legend, 4.5, colour, PAPER);
        canvas.text(line.name, legend + Place::new(14.0, 0.0), Anchor::Left, Letters::Small, INK);
        legend.x -= 200.0;
    }
    canvas.finish()
}

/// The least of 1, 2, 5, 10, .. times a power of ten that is not below a value.
fn round_step(value: f64) -> f64 {
    let power = 10_f64.powf(value.max(1e-9).log10().floor());
    let steps = [1.0, 2.0, 5.0].map(|step| step * power);
    steps.into_iter().find(|step| *step >= value).unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_round() {
        for (value, step) in [(0.13, 0.2), (1.0, 1.0), (3.0, 5.0), (70.0, 100.0)] {
            assert!((round_step(value) - step).abs() < 1e-9, "{value}");
        }
    }

    #[test]
    fn lines_are_drawn_and_an_empty_plot_is_one() {
        let drawn = |lines: &[Line<'_>]| plot("t", "x", "y", lines);
        let empty = drawn(&[]);
        let full = drawn(&[Line { name: "a", points: vec![[1.0, 2.0], [2.0, 0.5], [9.0, 0.1]] }]);
        assert_eq!((empty.dimensions(), full.dimensions()), ((960, 600), (960, 600)));
        let coloured = |picture: &RgbImage| picture.pixels().filter(|p| p.0 == APART[5]).count();
        assert!(coloured(&empty) == 0 && coloured(&full) > 500);
    }
}
