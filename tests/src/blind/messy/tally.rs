//! The figures of messy rigs with their aims.
//!
//! What it is: lines of results in, one table out, with Wilson intervals, and how often each effect was named.
//! What can go wrong: a figure without trials says so.
//! Units: rates in per cent; errors over those of the truth.
//! Reference: specification `closing-the-loop.md`, "What counts as proof".

use super::score::Line;
use crate::blind::tally::Rate;
use std::collections::BTreeMap;
use std::fmt::Write;

/// Geometric mean; not a number without values.
fn geometric(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0.0), |(s, n), v| (s + v.ln(), n + 1.0));
    f64::exp(sum / n)
}

fn rate(lines: &[Line], of: impl Fn(&Line) -> [usize; 2]) -> String {
    let sum = lines.iter().map(of).fold(Rate::default(), |r, [all, hit]| Rate { hits: r.hits + hit, of: r.of + all });
    sum.text()
}

/// The table.
#[must_use]
pub fn markdown(lines: &[Line]) -> String {
    let mut out = String::from("| messy rigs, sizes of three noise floors and above | reached | aim |\n| --- | --- | --- |\n");
    let mut row = |name: &str, value: String, aim: &str| {
        let _ = writeln!(out, "| {name} | {value} | {aim} |");
    };
    row("the rig's own effects named", rate(lines, |l| l.own_named), "90 %");
    row("names that are true", rate(lines, |l| l.names), "97 %");
    row("the effect on top first of the names that are not the rig's", rate(lines, |l| l.top_first), "90 %");
    row("unknown noticed", rate(lines, |l| l.noticed), "95 %");
    row("verdicts that collapse", rate(lines, |l| [usize::from(l.own_named[0] > 0), usize::from(l.collapsed)]), "0");
    let wrong: usize = lines.iter().map(|l| l.names[0] - l.names[1]).sum();
    row("false names a run", format!("{:.2} ({wrong} in {})", wrong as f64 / lines.len().max(1) as f64, lines.len()), "");
    let mut by_channel: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for (channel, ratio) in lines.iter().flat_map(Line::errors) {
        by_channel.entry(if channel.starts_with("rpm") { "speed" } else { channel }).or_default().push(ratio);
    }
    let all: Vec<f64> = by_channel.values().flatten().copied().collect();
    row(
        "error on a second run over that of the truth, geometric mean",
        format!("{:.2} ({} channels)", geometric(all.iter().copied()), all.len()),
        "1.3",
    );
    for (channel, ratios) in &by_channel {
        let worst = ratios.iter().copied().fold(0.0, f64::max);
        row(
            &format!("the same, {channel}"),
            format!("{:.2}, worst {worst:.1} ({} channels)", geometric(ratios.iter().copied()), ratios.len()),
            "",
        );
    }
    let failed = lines.iter().filter(|l| ["panic", "refused"].contains(&l.verdict.as_str())).count();
    row("refused, or a panic", failed.to_string(), "0");
    out + &by_effect(lines)
}

/// How often each effect that a run shows was named, and each name that was not true.
fn by_effect(lines: &[Line]) -> String {
    let id = |word: &str| word.split('@').next().unwrap_or_default().to_owned();
    let mut own: BTreeMap<String, Rate> = BTreeMap::new();
    let mut wrong: BTreeMap<String, usize> = BTreeMap::new();
    for line in lines {
        for name in line.named.split('+').filter_map(|n| n.strip_prefix('!')) {
            *wrong.entry(id(name)).or_default() += 1;
        }
        for (list, sizes) in [(&line.own[0], &line.own[1]), (&line.on_top[0], &line.on_top[1])] {
            for (effect, size) in list.split('+').zip(sizes.split('+')) {
                if effect.is_empty() || effect.starts_with("unknown_") || size.parse::<f64>().is_ok_and(|s| s < 3.0) {
                    continue;
                }
                let told = line.named.split('+').any(|n| id(n) == id(effect));
                let r = own.entry(id(effect)).or_default();
                *r = Rate { hits: r.hits + usize::from(told), of: r.of + 1 };
            }
        }
    }
    let mut out = String::from("\n| effect | its identifier named where it shows |\n| --- | --- |\n");
    for (effect, rate) in own {
        let _ = writeln!(out, "| {effect} | {} of {} |", rate.hits, rate.of);
    }
    let list: Vec<String> = wrong.into_iter().map(|(name, n)| format!("{name} {n}")).collect();
    let _ = writeln!(out, "\nNames that are not true: {}.", if list.is_empty() { "none".into() } else { list.join(", ") });
    out
}

/// One line a run that failed somewhere.
#[must_use]
pub fn failures(lines: &[Line]) -> String {
    let short = |p: [usize; 2]| p[1] < p[0];
    let bad = |l: &&Line| l.collapsed || [l.own_named, l.names, l.top_first, l.noticed].into_iter().any(short);
    let mut out = String::new();
    for l in lines.iter().filter(bad) {
        let _ = writeln!(
            out,
            "{} {}: {} ({}) | {} ({}) -> {} {}",
            l.seed, l.top, l.own[0], l.own[1], l.on_top[0], l.on_top[1], l.verdict, l.named
        );
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_geometric_mean_over_channels_and_counts_over_names() {
        let line = |named: &str, names, ratios: &str| Line {
            own: ["supply_sag@voltage_v".into(), "9.00".into()],
            own_named: [1, names],
            names: [2, names],
            named: named.into(),
            ratios: ratios.into(),
            ..Line::default()
        };
        let lines =
            [line("supply_sag@voltage_v+!creep@thrust_n", 1, "thrust_n:4.000"), line("!creep@a+!creep@b", 0, "rpm_hall:1.000")];
        let text = markdown(&lines);
        for told in ["25.0 % (4.6-69.9, n = 4)", "2.00 (2 channels)", "1.50 (3 in 2)", "supply_sag | 1 of 2", "creep 3."] {
            assert!(text.contains(told), "{told}: {text}");
        }
    }
}
