//! What drawings share: lines as paths, round ticks, labels, safe text.
//!
//! What it is: pure functions from numbers to SVG text.
//! What can go wrong: values that are not finite lift the pen.
//! Units: whatever the caller's labels say.
//! Reference: SVG 1.1; round ticks after Heckbert, Graphics Gems, 1990.

use std::fmt::Write;

/// Columns into which a long line is thinned, keeping the extremes of each.
const BUCKETS: usize = 700;

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
    } else if hi - lo < 1e-12 || hi - lo <= f64::EPSILON * hi.abs() {
        let half = 0.5_f64.max(1e-9 * hi.abs());
        (lo - half, hi + half)
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

/// Label of a tick with no more digits than its distance to the next one needs.
pub(crate) fn short_label(v: f64, step: f64) -> String {
    if v.abs() < 1e-6 * step {
        "0".to_owned()
    } else if step < 9e-5 {
        format!("{v:.1e}")
    } else {
        let digits = (-step.log10() - 1e-9).ceil().clamp(0.0, 5.0) as usize;
        format!("{v:.digits$}")
    }
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

    /// Values so large that the next number is more than one away have an end of ticks, too.
    #[test]
    fn a_value_without_measure_has_ticks_with_an_end() {
        for value in [12.0, 1e16, -1e30, 1e200] {
            let (lo, hi) = span([value].iter());
            assert!(lo < value && value < hi && (2..20).contains(&ticks(lo, hi, 5).len()), "{value}");
        }
    }

    #[test]
    fn short_labels_have_the_digits_of_their_step() {
        let said = [(0.02, 0.01), (-0.5, 0.5), (150.0, 50.0), (-5e-6, 5e-6), (1e-12, 0.1)].map(|(v, step)| short_label(v, step));
        assert_eq!(said, ["0.02", "-0.5", "150", "-5.0e-6", "0"]);
    }

    #[test]
    fn a_missing_value_lifts_the_pen_and_text_is_safe() {
        let d = line_path(&[0.0, 1.0, 2.0], &[1.0, f64::NAN, 3.0], (0.0, 2.0), &|x| x, &|y| y);
        assert_eq!(d.matches('M').count(), 2, "{d}");
        assert_eq!(escape("a<b"), "a&lt;b");
    }
}
