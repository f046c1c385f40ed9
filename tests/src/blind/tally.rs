//! The published tables: rates with Wilson intervals against effect size.
//!
//! What it is: lines of results in, Markdown out.
//! What can go wrong: an empty bin has no rate and says so.
//! Units: sizes in noise floors; rates in percent.
//! Reference: Wilson 1927; expected calibration error over ten bins (Naeini, Cooper and Hauskrecht 2015).

use super::score::Line;
use std::collections::BTreeMap;
use std::fmt::Write;

/// A count of successes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Rate {
    /// Successes.
    pub hits: usize,
    /// Trials.
    pub of: usize,
}

impl Rate {
    /// Counts.
    pub fn over<T>(items: impl Iterator<Item = T>, mut hit: impl FnMut(&T) -> bool) -> Self {
        items.fold(Self::default(), |r, i| Self { hits: r.hits + usize::from(hit(&i)), of: r.of + 1 })
    }

    /// The rate itself; NaN without trials.
    #[must_use]
    pub fn value(self) -> f64 {
        self.hits as f64 / self.of as f64
    }

    /// Wilson's 95 % interval.
    #[must_use]
    pub fn wilson(self) -> (f64, f64) {
        let (n, p, z) = (self.of as f64, self.value(), 1.959_964);
        let centre = (p + z * z / (2.0 * n)) / (1.0 + z * z / n);
        let half = z / (1.0 + z * z / n) * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
        ((centre - half).max(0.0), (centre + half).min(1.0))
    }

    /// `91.2 % (88.0-93.6, n = 400)`.
    #[must_use]
    pub fn text(self) -> String {
        if self.of == 0 {
            return "none".into();
        }
        let (lo, hi) = self.wilson();
        format!("{:.1} % ({:.1}-{:.1}, n = {})", 100.0 * self.value(), 100.0 * lo, 100.0 * hi, self.of)
    }
}

/// Bounds of the size bins.
pub const BINS: [(f64, f64); 6] = [(0.0, 1.5), (1.5, 3.0), (3.0, 5.0), (5.0, 10.0), (10.0, 20.0), (3.0, f64::INFINITY)];

fn bin_name((lo, hi): (f64, f64)) -> String {
    if hi.is_finite() { format!("{lo}-{hi}") } else { format!("**{lo} and above**") }
}

/// Share of shared parameters whose interval covers the truth.
#[must_use]
pub fn coverage<'a>(lines: impl Iterator<Item = &'a Line>) -> Rate {
    lines
        .flat_map(|l| l.coverage.split('+'))
        .filter_map(|c| c.split(':').nth(1))
        .fold(Rate::default(), |r, h| Rate { hits: r.hits + usize::from(h == "1"), of: r.of + 1 })
}

/// Expected calibration error of the probability of the first effect over ten bins.
#[must_use]
pub fn calibration<'a>(lines: impl Iterator<Item = &'a Line>) -> f64 {
    let mut bins = [(0.0, 0.0, 0.0); 10];
    for l in lines.filter(|l| l.probability.is_finite()) {
        let b = &mut bins[((l.probability * 10.0) as usize).min(9)];
        b.0 += 1.0;
        b.1 += l.probability;
        b.2 += f64::from(u8::from(l.first));
    }
    let n: f64 = bins.iter().map(|b| b.0).sum();
    bins.iter().map(|b| (b.1 - b.2).abs()).sum::<f64>() / n
}

/// The calibration curve: of all effects that stood first with about this probability, how many were there. For an effect that the library
/// does not know, that none was given.
fn calibration_curve(lines: &[Line]) -> String {
    let mut out = "\n### Calibration: probability of the first effect against how often it is right, effects of three noise floors and above\n\n| claimed | mean of the claims | right: one effect | two effects | unknown | all |\n| --- | --- | --- | --- | --- | --- |\n".to_owned();
    let right = |l: &&Line| l.first;
    for k in 0..10 {
        let (low, high) = (f64::from(k) / 10.0, f64::from(k + 1) / 10.0);
        let claims = |l: &&Line| l.size >= 3.0 && l.probability >= low && (l.probability < high || k == 9);
        let of = |kind: &str| Rate::over(lines.iter().filter(claims).filter(|l| l.kind == kind), right).text();
        let all: Vec<&Line> = lines.iter().filter(claims).filter(|l| l.kind != "clean").collect();
        let mean = all.iter().map(|l| l.probability).sum::<f64>() / all.len() as f64;
        if !all.is_empty() {
            let rate = Rate::over(all.iter().copied(), right).text();
            let row = [format!("{low:.1}-{high:.1}"), format!("{mean:.3}"), of("one"), of("two"), of("unknown"), rate];
            let _ = writeln!(out, "| {} |", row.join(" | "));
        }
    }
    out
}

fn median(mut v: Vec<f64>) -> f64 {
    v.retain(|x| x.is_finite());
    v.sort_by(f64::total_cmp);
    if v.is_empty() { f64::NAN } else { v[v.len() / 2] }
}

/// All tables.
#[must_use]
pub fn markdown(lines: &[Line]) -> String {
    let mut out = String::new();
    let of =
        |kind: &'static str, (lo, hi): (f64, f64)| lines.iter().filter(move |l| l.kind == kind && l.size >= lo && l.size < hi);
    let clean = || lines.iter().filter(|l| l.kind == "clean");
    let _ = writeln!(out, "### Clean runs\n\nFalse alarms: {}\n", Rate::over(clean(), |l| !l.first).text());
    let _ = writeln!(
        out,
        "### One effect, against its size in noise floors\n\n| size | first | exact set | among three | after/told at most 1.15 | after/noise at most 1.15 | median after/noise | intervals that cover | calibration error |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- |"
    );
    for bin in BINS {
        let ratio = || of("one", bin).filter(|l| l.after_ratio.is_finite());
        let _ = writeln!(
            out,
            "| {} | {} | {} | {} | {} | {} | {:.3} | {} | {:.3} |",
            bin_name(bin),
            Rate::over(of("one", bin), |l| l.first).text(),
            Rate::over(of("one", bin), |l| l.exact).text(),
            Rate::over(of("one", bin), |l| l.top3).text(),
            Rate::over(of("one", bin).filter(|l| l.told_ratio.is_finite()), |l| l.told_ratio <= 1.15).text(),
            Rate::over(ratio(), |l| l.after_ratio <= 1.15).text(),
            median(ratio().map(|l| l.after_ratio).collect()),
            coverage(of("one", bin).filter(|l| l.exact)).text(),
            calibration(of("one", bin)),
        );
    }
    let _ = writeln!(
        out,
        "\n### Two effects and unknown ones\n\n| size of the smaller | pair exact | a true one first | pair among three | unknown recognised |\n| --- | --- | --- | --- | --- |"
    );
    for bin in BINS {
        let two = |hit: fn(&Line) -> bool| Rate::over(of("two", bin), |l| hit(l)).text();
        let _ = writeln!(
            out,
            "| {} | {} | {} | {} | {} |",
            bin_name(bin),
            two(|l| l.exact),
            two(|l| l.first),
            two(|l| l.top3),
            Rate::over(of("unknown", bin), |l| l.first).text()
        );
    }
    out.push_str(&calibration_curve(lines));
    let _ = writeln!(
        out,
        "\n### Each effect alone at three noise floors and above\n\n| true | first | exact | among three | cover | after/noise | after/told | named instead |\n| --- | --- | --- | --- | --- | --- | --- | --- |"
    );
    let mut truths: BTreeMap<&str, Vec<&Line>> = BTreeMap::new();
    for l in lines.iter().filter(|l| (l.kind == "one" || l.kind == "unknown") && l.size >= 3.0) {
        truths.entry(&l.truth).or_default().push(l);
    }
    for (truth, runs) in &truths {
        let share = |hit: fn(&Line) -> bool| format!("{}/{}", runs.iter().filter(|l| hit(l)).count(), runs.len());
        let mut instead: BTreeMap<String, usize> = BTreeMap::new();
        for l in runs.iter().filter(|l| if l.kind == "one" { !l.exact } else { !l.first }) {
            *instead.entry(if l.named.is_empty() { l.verdict.clone() } else { l.named.clone() }).or_default() += 1;
        }
        let c = coverage(runs.iter().copied().filter(|l| l.exact));
        let _ = writeln!(
            out,
            "| {truth} | {} | {} | {} | {}/{} | {:.2} | {:.2} | {} |",
            share(|l| l.first),
            share(|l| l.exact),
            share(|l| l.top3),
            c.hits,
            c.of,
            median(runs.iter().map(|l| l.after_ratio).collect()),
            median(runs.iter().map(|l| l.told_ratio).collect()),
            instead.iter().map(|(k, n)| format!("{k} {n}")).collect::<Vec<_>>().join(", ")
        );
    }
    let _ = writeln!(
        out,
        "\nTime of the tool: median {:.2} s, longest {:.2} s; panics {}, refused {}",
        median(lines.iter().map(|l| l.seconds).collect()),
        lines.iter().map(|l| l.seconds).fold(0.0, f64::max),
        lines.iter().filter(|l| l.verdict == "panic").count(),
        lines.iter().filter(|l| l.verdict == "refused").count()
    );
    out
}

/// The failures with their seeds: what one dumps and looks at.
#[must_use]
pub fn failures(lines: &[Line]) -> String {
    let mut out = String::new();
    let failed = |l: &&Line| match l.kind.as_str() {
        "one" | "two" => !l.exact && l.size >= 3.0,
        "unknown" => !l.first && l.size >= 3.0,
        _ => !l.first,
    };
    for l in lines.iter().filter(failed) {
        let _ = writeln!(
            out,
            "seed {} {} ({}, sizes {}, by {}, {}) -> {} {} p={:.2}; others {}",
            l.seed, l.truth, l.kind, l.sizes, l.shown, l.schedule, l.verdict, l.named, l.probability, l.alternatives
        );
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilson_as_in_print() {
        // 45 of 50: 0.786 to 0.957
        let (lo, hi) = Rate { hits: 45, of: 50 }.wilson();
        assert!((lo - 0.786).abs() < 1e-3 && (hi - 0.9565).abs() < 1e-3, "{lo} {hi}");
        assert_eq!(Rate::default().text(), "none");
    }

    #[test]
    fn the_calibration_curve_holds_each_claim_once() {
        let line = |kind: &str, probability: f64, right: bool| Line {
            kind: kind.into(),
            size: 5.0,
            probability,
            first: right,
            exact: right && kind != "unknown",
            ..Line::empty()
        };
        let lines = [line("one", 1.0, true), line("one", 0.95, false), line("unknown", 0.9, true), line("two", 0.55, true)];
        let text = calibration_curve(&lines);
        let rows: Vec<&str> = text.lines().filter(|l| l.starts_with("| 0")).collect();
        assert_eq!(rows.len(), 2, "{text}");
        assert!(rows[0].starts_with("| 0.5-0.6 | 0.550 | none | 100.0 %"), "{text}");
        assert!(
            rows[1].starts_with("| 0.9-1.0 | 0.950 | 50.0 %") && rows[1].ends_with("| 66.7 % (20.8-93.9, n = 3) |"),
            "{text}"
        );
    }

    #[test]
    fn names_that_the_healthy_rig_has_too_are_no_false_alarm() {
        let clean = |first: bool| Line { kind: "clean".into(), verdict: "attributed".into(), first, ..Line::empty() };
        let text = markdown(&[clean(true), clean(true), clean(false)]);
        assert!(text.contains("False alarms: 33.3 %"), "{text}");
    }
}
