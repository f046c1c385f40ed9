//! `cargo xtask ahrs-bench --scan`: what both sets of recordings say of every constant.
//!
//! What it is: each number of the default is replaced by round values around it, one at a time. Six errors count alike: total and
//! inclination of BROAD, of the phones, and of the phones with the gyro's bias left in. The page that is printed is `docs/ahrs-constants.md`.
//! What can go wrong: a value that both sets hold for better by more than the band: the command fails and names it.
//! Units: changes of errors in percent.
//! Reference: `docs/ahrs.md`, "What was chosen on what".

use super::constants::{ALL, Constant};
use super::sets::{Errors, Sets};
use crate::run::Failure;
use dcm::Config;

/// A constant stays as it is unless the mean of the six errors falls by more than this share with another of its values, and none of the
/// six rises by more.
const BAND: f64 = 0.01;

/// What the recordings say of a constant.
struct Choice {
    constant: &'static Constant,
    /// Values with the changes of the six errors.
    tried: Vec<(f32, [f64; 6])>,
    /// The value that the rule takes.
    picked: f32,
}

/// Prints the page.
pub(super) fn scan(sets: &Sets) -> Result<(), Failure> {
    let shipped = sets.errors(Config::DEFAULT);
    println!("{}", head(&shipped));
    let mut moved = Vec::new();
    for constant in ALL {
        eprintln!("{}", constant.name);
        let choice = choose(constant, |config| sets.errors(config).against(&shipped));
        println!("{}", row(&choice));
        if !same(choice.picked, constant.shipped()) {
            moved.push(format!("{} {}", constant.name, choice.picked));
        }
    }
    if moved.is_empty() {
        println!("\nBy the rule every constant is the one that is shipped.");
        return Ok(());
    }
    Err(Failure(format!("both sets pick other values: {}", moved.join(", "))))
}

fn choose(constant: &'static Constant, changes: impl Fn(Config) -> [f64; 6]) -> Choice {
    let now = constant.shipped();
    let others = constant.tried.iter().filter(|v| !same(**v, now));
    let tried: Vec<(f32, [f64; 6])> = others.map(|v| (*v, changes(constant.set(*v)))).collect();
    let better = tried.iter().filter(|(_, c)| mean(c) < -BAND && largest(c) <= BAND);
    let picked = better.min_by(|a, b| mean(&a.1).total_cmp(&mean(&b.1))).map_or(now, |(v, _)| *v);
    Choice { constant, tried, picked }
}

fn mean(changes: &[f64; 6]) -> f64 {
    changes.iter().sum::<f64>() / 6.0
}

fn largest(changes: &[f64; 6]) -> f64 {
    changes.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

fn same(a: f32, b: f32) -> bool {
    (a - b).abs() <= 1e-5 * b.abs()
}

fn percent(share: f64) -> String {
    // no minus before a zero
    format!("{:+.1}", (share * 1e3).round() / 10.0 + 0.0)
}

fn head(shipped: &Errors) -> String {
    format!(
        "# The filter's constants, and what both sets of recordings say of each

Written by `cargo xtask ahrs-bench --scan > docs/ahrs-constants.md`, which fails when the rule picks another value.

**The rule.** Six errors count alike: total and inclination of three sets. The first are the shared BROAD trials in the eight variants of which
VQF's figures are published. The second are the shared trials of the phones, the gyro's bias of the day taken off beforehand; the third
are the same with it left in. Each constant is replaced by round values around it while the others stay. It stays as it is unless the mean of the six errors falls by more than {:.0} % with another value, and none
of the six rises by more than that.

With the default: BROAD {:.3} degrees in total and {:.3} of inclination, phones {:.3} and {:.3}, with the bias {:.3} and {:.3}.
For each other value: change of the mean of the six, and in brackets the largest of the six, in percent.
Where the default comes from: `VQF` its published defaults, `recordings` chosen on the shared trials, `chip` ranges of the sensors, `cost` what the
instruction budget asks for, `gap` what counts as one. `declination` is an input and not chosen.

| constant | default | from | with other values | taken |
| --- | --- | --- | --- | --- |",
        BAND * 100.0,
        shipped.broad.total,
        shipped.broad.inclination,
        shipped.own.total,
        shipped.own.inclination,
        shipped.raw.total,
        shipped.raw.inclination
    )
}

fn row(choice: &Choice) -> String {
    let Constant { name, unit, origin, .. } = choice.constant;
    let now = choice.constant.shipped();
    let others = choice.tried.iter().map(|(v, c)| format!("{v}: {} ({})", percent(mean(c)), percent(largest(c))));
    let shown = (f64::from(now) * 1e4).round() / 1e4;
    format!(
        "| `{name}` | {} | {origin} | {} | {} |",
        format!("{shown} {unit}").trim_end(),
        others.collect::<Vec<_>>().join(", "),
        if same(choice.picked, now) { "default".to_owned() } else { format!("**{}**", choice.picked) }
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A gain beyond the band moves a constant, unless one of the four errors pays for it.
    #[test]
    fn a_constant_moves_only_for_more_than_the_band_and_at_nobodys_cost() {
        let constant = &ALL[0];
        let other = constant.tried[0];
        for (changes, moves) in [([-0.02; 6], true), ([-0.005; 6], false), ([-0.05, -0.05, -0.05, 0.02, 0.0, 0.0], false)] {
            let of = |config: Config| if same(config.tilt_tau, other) { changes } else { [0.0; 6] };
            let choice = choose(constant, of);
            assert_eq!(!same(choice.picked, constant.shipped()), moves, "{changes:?}");
        }
    }
}
