//! A line chart as SVG text.
//!
//! What it is: axes with round ticks, lines, dots and a legend; colours come from the page's style sheet, so that the
//! same figure is right in light, in dark and in print. (A plotting crate would write fixed colours into the file.)
//! What can go wrong: series without finite points are left out.
//! Units: whatever the caller's labels say.
//! Reference: SVG 1.1; round ticks after Heckbert, Graphics Gems, 1990.

use std::fmt::Write;

/// One line or cloud of dots.
#[derive(Debug, Clone)]
pub struct Series<'a> {
    /// Name in the legend.
    pub name: &'a str,
    /// Class of the style sheet: `a`, `b`, `c`, `d`.
    pub class: &'static str,
    /// Abscissa.
    pub x: &'a [f64],
    /// Ordinate; a value that is not finite breaks the line.
    pub y: &'a [f64],
    /// Dots instead of a line.
    pub dots: bool,
}

/// A chart.
#[derive(Debug, Clone)]
pub struct Chart<'a> {
    /// Heading.
    pub title: String,
    /// Label of the abscissa.
    pub x_label: String,
    /// Label of the ordinate.
    pub y_label: String,
    /// What is drawn, first at the bottom.
    pub series: Vec<Series<'a>>,
    /// Height in the drawing's units; the width is 760.
    pub height: f64,
}

const WIDTH: f64 = 760.0;
const LEFT: f64 = 66.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 30.0;
const BOTTOM: f64 = 40.0;
/// Columns into which a long line is thinned, keeping the extremes of each.
const BUCKETS: usize = 700;

impl Chart<'_> {
    /// The chart as an `<svg>` element.
    #[must_use]
    pub fn svg(&self) -> String {
        let finite = |v: &&f64| v.is_finite();
        let (x0, x1) = span(self.series.iter().flat_map(|s| s.x.iter()).filter(finite));
        let (y0, y1) = span(self.series.iter().flat_map(|s| s.y.iter()).filter(finite));
        let (y0, y1) = (y0 - 0.04 * (y1 - y0), y1 + 0.04 * (y1 - y0));
        let px = |x: f64| LEFT + (x - x0) / (x1 - x0) * (WIDTH - LEFT - RIGHT);
        let py = |y: f64| self.height - BOTTOM - (y - y0) / (y1 - y0) * (self.height - TOP - BOTTOM);
        let mut out = format!(
            "<svg viewBox=\"0 0 {WIDTH} {h}\" role=\"img\" aria-label=\"{t}\"><text class=\"title\" x=\"{LEFT}\" y=\"16\">{t}</text>",
            h = self.height,
            t = escape(&self.title)
        );
        for v in ticks(x0, x1, 8) {
            let x = px(v);
            let _ =
                write!(out, "<line class=\"grid\" x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{TOP}\" y2=\"{:.1}\"/>", self.height - BOTTOM);
            let _ = write!(
                out,
                "<text class=\"tick\" text-anchor=\"middle\" x=\"{x:.1}\" y=\"{:.1}\">{}</text>",
                self.height - BOTTOM + 14.0,
                label(v, x1 - x0)
            );
        }
        for v in ticks(y0, y1, 5) {
            let y = py(v);
            let _ = write!(out, "<line class=\"grid\" x1=\"{LEFT}\" x2=\"{:.1}\" y1=\"{y:.1}\" y2=\"{y:.1}\"/>", WIDTH - RIGHT);
            let _ = write!(
                out,
                "<text class=\"tick\" text-anchor=\"end\" x=\"{:.1}\" y=\"{:.1}\">{}</text>",
                LEFT - 5.0,
                y + 4.0,
                label(v, y1 - y0)
            );
        }
        let _ = write!(
            out,
            "<text class=\"axis\" text-anchor=\"middle\" x=\"{:.1}\" y=\"{:.1}\">{}</text>",
            (LEFT + WIDTH - RIGHT) / 2.0,
            self.height - 6.0,
            escape(&self.x_label)
        );
        let _ = write!(
            out,
            "<text class=\"axis\" text-anchor=\"middle\" transform=\"translate(13 {:.1}) rotate(-90)\">{}</text>",
            (TOP + self.height - BOTTOM) / 2.0,
            escape(&self.y_label)
        );
        for s in &self.series {
            if s.dots { dots(&mut out, s, &px, &py) } else { line(&mut out, s, (x0, x1), &px, &py) }
        }
        let mut at = WIDTH - RIGHT;
        for s in self.series.iter().rev().filter(|s| !s.name.is_empty()) {
            at -= 7.0 * s.name.chars().count() as f64 + 24.0;
            let _ = write!(
                out,
                "<line class=\"{} key\" x1=\"{at:.1}\" x2=\"{:.1}\" y1=\"12\" y2=\"12\"/><text class=\"tick\" x=\"{:.1}\" y=\"16\">{}</text>",
                s.class,
                at + 16.0,
                at + 20.0,
                escape(s.name)
            );
        }
        out + "</svg>"
    }
}

fn dots(out: &mut String, s: &Series<'_>, px: &dyn Fn(f64) -> f64, py: &dyn Fn(f64) -> f64) {
    let stride = s.x.len().div_ceil(3000).max(1);
    let _ = write!(out, "<path class=\"{} dots\" d=\"", s.class);
    for (x, y) in s.x.iter().zip(s.y).step_by(stride).filter(|(x, y)| x.is_finite() && y.is_finite()) {
        let _ = write!(out, "M{:.1} {:.1}h.01", px(*x), py(*y));
    }
    out.push_str("\"/>");
}

fn line(out: &mut String, s: &Series<'_>, range: (f64, f64), px: &dyn Fn(f64) -> f64, py: &dyn Fn(f64) -> f64) {
    let _ = write!(out, "<path class=\"{}\" d=\"{}\"/>", s.class, line_path(s.x, s.y, range, px, py));
}

/// The `d` of a line, thinned to columns of the drawing with the extremes of each kept.
pub(crate) fn line_path(x: &[f64], y: &[f64], (x0, x1): (f64, f64), px: &dyn Fn(f64) -> f64, py: &dyn Fn(f64) -> f64) -> String {
    let mut out = String::new();
    let mut pen_down = false;
    let mut i = 0;
    while i < x.len() {
        let bucket = |k: usize| ((x[k] - x0) / (x1 - x0) * BUCKETS as f64) as i64;
        let mut j = i + 1;
        while j < x.len() && bucket(j) == bucket(i) {
            j += 1;
        }
        // first, extremes in their order, last: nothing that the eye would see is lost
        let mut keep = vec![i, j - 1];
        let inside = (i..j).filter(|k| y[*k].is_finite());
        keep.extend(inside.clone().min_by(|a, b| y[*a].total_cmp(&y[*b])));
        keep.extend(inside.max_by(|a, b| y[*a].total_cmp(&y[*b])));
        keep.sort_unstable();
        keep.dedup();
        for k in keep {
            if y[k].is_finite() {
                let _ = write!(out, "{}{:.1} {:.1}", if pen_down { 'L' } else { 'M' }, px(x[k]), py(y[k]));
                pen_down = true;
            } else {
                pen_down = false;
            }
        }
        i = j;
    }
    out
}

pub(crate) fn span<'v>(values: impl Iterator<Item = &'v f64>) -> (f64, f64) {
    let (lo, hi) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
    if !lo.is_finite() {
        (0.0, 1.0)
    } else if hi - lo < 1e-12 {
        (lo - 0.5, hi + 0.5)
    } else {
        (lo, hi)
    }
}

pub(crate) fn ticks(lo: f64, hi: f64, about: usize) -> Vec<f64> {
    let raw = (hi - lo) / about as f64;
    let power = 10f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|s| *s >= raw).unwrap_or(10.0 * power);
    let first = (lo / step).ceil() as i64;
    (first..).map(|k| k as f64 * step).take_while(|v| *v <= hi + 1e-9 * step).collect()
}

pub(crate) fn label(v: f64, span: f64) -> String {
    let digits = (2.0 - span.log10()).ceil().clamp(0.0, 6.0) as usize;
    format!("{:.digits$}", if v.abs() < 1e-9 * span { 0.0 } else { v })
}

/// Text that is safe inside markup.
#[must_use]
pub(crate) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks(0.0, 10.0, 5), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
        assert!(ticks(-0.013, 0.017, 5).iter().all(|v| (-0.013..=0.017).contains(v)));
    }

    #[test]
    fn a_chart_is_balanced_markup_and_escapes() {
        let (x, y) = ([0.0, 1.0, 2.0], [1.0, f64::NAN, 3.0]);
        let chart = Chart {
            title: "a<b".into(),
            x_label: "x".into(),
            y_label: "y".into(),
            series: vec![Series { name: "s", class: "a", x: &x, y: &y, dots: false }],
            height: 200.0,
        };
        let svg = chart.svg();
        assert!(svg.starts_with("<svg") && svg.ends_with("</svg>") && svg.contains("a&lt;b"));
        assert_eq!(svg.matches('M').count(), 2, "a missing value lifts the pen: {svg}");
    }
}
