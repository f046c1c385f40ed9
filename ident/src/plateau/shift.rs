//! The binary shift algorithm of the thesis: as published, and mended.
//!
//! What it is: six filters over one channel, each of which can be looked at, and the stretches that they isolate; threshold and
//! offset by hand or automatic.
//! What can go wrong: the published form cuts three notches a step where the offset is wider than the ramp, sees erratic noise as
//! ramps, and loses a plateau to a single missing sample; `docs/plateaus/README.md` shows each.
//! Units: Filter 1 and the threshold in the channel's unit per sample; the offset in samples.
//! Reference: Beharie 2013, Eq. 5.60 to 5.62 (5.61 with the absolute difference, errata) and section 5.7.4.

use crate::numeric::order::median;

/// Which Filter 5.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Form {
    /// Filter 2 AND its two copies shifted by the offset: a notch at three places.
    Published,
    /// Filter 2 eroded by everything within the offset (minimum over +-k): one gap a step.
    #[default]
    Mended,
}

/// What a shifted copy holds beyond the ends of the run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Padding {
    /// Nothing: the first and the last plateau have both edges; 21 levels give 21 plateaus.
    #[default]
    Zero,
    /// The value at the end: the first and the last plateau lack one edge; 21 levels give the thesis' 19.
    Edge,
}

/// What the filters are told.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Settings {
    /// Which Filter 5.
    pub form: Form,
    /// What lies beyond the ends.
    pub padding: Padding,
    /// Threshold of Filter 2, in the channel's unit per sample; `None` finds it.
    pub threshold: Option<f64>,
    /// Offset of Filters 3 and 4, samples; `None` finds it.
    pub offset: Option<usize>,
}

/// The filters of one run.
#[derive(Debug, Clone, PartialEq)]
pub struct Filters {
    /// Threshold in force.
    pub threshold: f64,
    /// Offset in force.
    pub offset: usize,
    /// `|x[n+1] - x[n]|`, one less than the samples; NaN beside a missing sample.
    pub one: Vec<f64>,
    /// Filter 1 at or below the threshold.
    pub two: Vec<bool>,
    /// Filter 2 shifted later by the offset.
    pub three: Vec<bool>,
    /// Filter 2 shifted earlier by the offset.
    pub four: Vec<bool>,
    /// What all three, or all within the offset, agree on.
    pub five: Vec<bool>,
    /// Difference of Filter 5: +1 before a plateau's first sample, -1 at its last.
    pub six: Vec<i8>,
}

/// Runs the filters over a channel.
#[must_use]
pub fn filters(x: &[f64], settings: &Settings) -> Filters {
    let one: Vec<f64> = x.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    let threshold = settings.threshold.unwrap_or_else(|| automatic_threshold(&one));
    // Eq. 5.61 asks whether the difference exceeds the threshold; beside a missing sample it does not, whatever lies there
    let two: Vec<bool> = match settings.form {
        Form::Published => one.iter().map(|d| d.is_nan() || *d <= threshold).collect(),
        Form::Mended => across_gaps(x).iter().map(|d| *d <= threshold).collect(),
    };
    let offset = settings.offset.unwrap_or_else(|| automatic_offset(&two));
    let (three, four) = (shifted(&two, offset as isize, settings.padding), shifted(&two, -(offset as isize), settings.padding));
    let five = match settings.form {
        Form::Published => two.iter().zip(&three).zip(&four).map(|((a, b), c)| *a && *b && *c).collect(),
        Form::Mended => eroded(&two, offset, settings.padding),
    };
    let six = differences(&five, settings.padding);
    Filters { threshold, offset, one, two, three, four, five, six }
}

impl Filters {
    /// The plateaus: rows `[from, to)` from the sample after +1 to the sample of -1 (Eq. 5.62).
    #[must_use]
    pub fn stretches(&self) -> Vec<(usize, usize)> {
        let mut out = Vec::new();
        let mut start = None;
        for (i, d) in self.six.iter().enumerate() {
            match d {
                1 => start = Some(i),
                -1 => out.extend(start.take().map(|from| (from, i)).filter(|(a, b)| b > a)),
                _ => {}
            }
        }
        out
    }
}

/// Mean of a channel over each stretch. As the thesis averages, missing samples spoil the published mean; the mended one leaves them out.
#[must_use]
pub fn means(x: &[f64], stretches: &[(usize, usize)], form: Form) -> Vec<f64> {
    let mean = |z: &[f64]| match form {
        Form::Published => z.iter().sum::<f64>() / z.len() as f64,
        Form::Mended => {
            let (sum, n) = z.iter().filter(|v| v.is_finite()).fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
            sum / n
        }
    };
    stretches.iter().map(|(a, b)| mean(&x[*a..*b])).collect()
}

/// Differences from the last sample that is there: a gap neither hides a step nor makes one.
fn across_gaps(x: &[f64]) -> Vec<f64> {
    let mut last = f64::NAN;
    let mut out = Vec::with_capacity(x.len().saturating_sub(1));
    for (i, v) in x.iter().enumerate() {
        let d = if v.is_finite() && last.is_finite() { (v - last).abs() } else { 0.0 };
        if v.is_finite() {
            last = *v;
        }
        if i > 0 {
            out.push(d);
        }
    }
    out
}

/// The universal threshold of the differences' own scatter: what the largest of n normal differences reaches, and no ramp stays under.
fn automatic_threshold(one: &[f64]) -> f64 {
    let mut finite: Vec<f64> = one.iter().copied().filter(|v| v.is_finite()).collect();
    let n = finite.len().max(2) as f64;
    let spread = 1.4826 * median(&mut finite);
    if spread > 0.0 {
        return spread * (2.0 * n.ln()).sqrt();
    }
    // more than half of the differences are zero: a coarse channel, whose smallest step is its noise
    finite.iter().copied().filter(|v| *v > 0.0).fold(f64::INFINITY, f64::min).min(1e300)
}

/// The longest ramp but for the odd one (90th percentile of the lengths), and one sample more.
fn automatic_offset(two: &[bool]) -> usize {
    let mut lengths: Vec<usize> = two.split(|on| *on).map(<[bool]>::len).filter(|n| *n > 0).collect();
    lengths.sort_unstable();
    lengths.get(lengths.len() * 9 / 10).or(lengths.last()).map_or(1, |n| n + 1)
}

fn shifted(two: &[bool], by: isize, padding: Padding) -> Vec<bool> {
    let n = two.len() as isize;
    (0..n)
        .map(|i| match (i - by, padding) {
            (k, _) if (0..n).contains(&k) => two[k as usize],
            (_, Padding::Zero) => false,
            (k, Padding::Edge) => two[k.clamp(0, n - 1) as usize],
        })
        .collect()
}

/// Minimum over +-k, by counting the zeros within reach.
fn eroded(two: &[bool], k: usize, padding: Padding) -> Vec<bool> {
    let mut zeros = vec![0usize];
    for on in two {
        zeros.push(zeros.last().copied().unwrap_or(0) + usize::from(!on));
    }
    (0..two.len())
        .map(|i| {
            let (a, b) = (i.saturating_sub(k), (i + k + 1).min(two.len()));
            let beyond = padding == Padding::Zero && (i < k || i + k >= two.len());
            !beyond && zeros[b] == zeros[a]
        })
        .collect()
}

/// Filter 6. With nothing beyond the ends the run starts and ends at 0.
fn differences(five: &[bool], padding: Padding) -> Vec<i8> {
    let value = |b: bool| i8::from(b);
    let (first, last) = match (padding, five.first(), five.last()) {
        (Padding::Edge, Some(a), Some(b)) => (value(*a), value(*b)),
        _ => (0, 0),
    };
    let mut out = Vec::with_capacity(five.len() + 1);
    let mut before = first;
    for v in five {
        out.push(value(*v) - before);
        before = value(*v);
    }
    out.push(last - before);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The thesis' schedule: 21 levels of 30 s at 10 Hz, each step a ramp of `ramp` samples.
    fn thesis(ramp: usize) -> Vec<f64> {
        let mut out: Vec<f64> = Vec::new();
        for level in 0..21 {
            for k in 0..300 {
                let share = if level == 0 { 1.0 } else { ((k + 1) as f64 / ramp as f64).min(1.0) };
                out.push(200.0 * (f64::from(level) - 1.0 + share) + 0.05 * (f64::from(k as u32) * 2.39).sin());
            }
        }
        out
    }

    fn count(x: &[f64], form: Form, padding: Padding, offset: usize) -> usize {
        filters(x, &Settings { form, padding, threshold: Some(0.7), offset: Some(offset) }).stretches().len()
    }

    #[test]
    fn edge_padding_gives_the_thesis_19_and_zero_padding_all_21() {
        let x = thesis(10);
        for form in [Form::Published, Form::Mended] {
            assert_eq!(count(&x, form, Padding::Edge, 5), 19);
            assert_eq!(count(&x, form, Padding::Zero, 5), 21);
        }
    }

    /// The defect: an offset wider than the ramp leaves slivers between the three notches.
    #[test]
    fn the_published_form_cuts_three_notches_and_the_mended_one_does_not() {
        let x = thesis(4);
        assert_eq!(count(&x, Form::Published, Padding::Zero, 12), 21 + 2 * 20);
        assert_eq!(count(&x, Form::Mended, Padding::Zero, 12), 21);
    }

    /// 6300 rows become 21 points; the means are the levels.
    #[test]
    fn means_are_the_levels() {
        let x = thesis(10);
        let f = filters(&x, &Settings::default());
        assert_eq!(f.stretches().len(), 21);
        for (k, m) in means(&x, &f.stretches(), Form::Mended).iter().enumerate() {
            assert!((m - 200.0 * k as f64).abs() < 0.01, "{k}: {m}");
        }
    }

    #[test]
    fn stepping_down_counts_as_a_ramp() {
        let mut x = thesis(10);
        x.reverse();
        assert_eq!(count(&x, Form::Mended, Padding::Zero, 5), 21, "the printed one-sided difference would find one");
        let one_sided: Vec<bool> = x.windows(2).map(|w| w[1] - w[0] <= 0.7).collect();
        assert!(one_sided.iter().all(|on| *on), "Eq. 5.61 as printed sees no ramp at all on the way down");
    }

    #[test]
    fn a_missing_sample_spoils_the_published_mean_only() {
        let mut x = thesis(10);
        x[1000] = f64::NAN;
        let at = |form| {
            let f = filters(&x, &Settings { form, threshold: Some(0.7), offset: Some(5), ..Settings::default() });
            means(&x, &f.stretches(), form).iter().filter(|m| m.is_nan()).count()
        };
        assert_eq!((at(Form::Published), at(Form::Mended)), (1, 0));
    }
}
