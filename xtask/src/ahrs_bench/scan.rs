//! `cargo xtask ahrs-bench --scan`: what half of the trials alone says of every constant.
//!
//! What it is: each number of the default is replaced by round values around it, one at a time; the error is the total one, mean
//! over half A's trials and the eight published variants. Half A alone decides; half B is run after all is decided, and printed
//! beside it. The page that is printed is `docs/ahrs-constants.md`.
//! What can go wrong: a value that half A holds for better by more than the band: the command fails and names it.
//! Units: degrees; shares in percent.
//! Reference: `docs/ahrs.md`, "What was chosen on what".

use super::constants::{ALL, Constant};
use super::joined;
use super::score::{Score, run};
use super::trial::Trial;
use super::variant::Variant;
use crate::run::Failure;
use dcm::{Config, Dcm};

/// A constant stays as it is unless half A holds another of its values for better by more than this share.
const BAND: f64 = 0.01;

/// What half A says of a constant.
struct Choice {
    constant: &'static Constant,
    /// Values with their errors, degrees.
    tried: Vec<(f32, f64)>,
    /// The value with the least error.
    best: f32,
    /// The value that the rule takes.
    picked: f32,
}

/// Prints the page.
pub(super) fn scan(trials: &[Trial]) -> Result<(), Failure> {
    let (half_a, half_b) = halves(trials);
    let shipped = error(&half_a, Config::DEFAULT);
    let choices: Vec<Choice> = ALL
        .iter()
        .map(|constant| {
            eprintln!("half A: {}", constant.name);
            choose(constant, shipped, |config| error(&half_a, config))
        })
        .collect();
    // all is decided: from here on half B may be seen
    eprintln!("half B");
    let beside = error(&half_b, Config::DEFAULT);
    println!("{}", head(&half_a, &half_b, shipped, beside));
    for choice in &choices {
        let b = error(&half_b, choice.constant.set(choice.best));
        println!("{}", row(choice, shipped, b / beside - 1.0));
    }
    let mut all = Config::DEFAULT;
    for choice in &choices {
        *(choice.constant.of)(&mut all) = choice.best * choice.constant.scale;
    }
    let (a, b) = (error(&half_a, all) / shipped - 1.0, error(&half_b, all) / beside - 1.0);
    println!("\nAll the least ones at once: half A {}, half B {}.", percent(a), percent(b));
    let moved: Vec<String> = choices
        .iter()
        .filter(|c| !same(c.picked, c.constant.shipped()))
        .map(|c| format!("{} {}", c.constant.name, c.picked))
        .collect();
    if moved.is_empty() {
        println!("\nBy the rule every constant is the one that half A picks.");
        return Ok(());
    }
    Err(Failure(format!("half A picks other values: {}", moved.join(", "))))
}

/// Every second trial, from the first, and the others.
fn halves(trials: &[Trial]) -> (Vec<&Trial>, Vec<&Trial>) {
    (trials.iter().step_by(2).collect(), trials.iter().skip(1).step_by(2).collect())
}

/// Mean total error over trials and published variants, degrees.
fn error(trials: &[&Trial], config: Config) -> f64 {
    let published = Variant::ALL.into_iter().filter(|v| *v != Variant::Worst);
    let of = |trial: &Trial| -> f64 {
        let totals = published.clone().map(|variant| run(&mut Dcm::new(config), &variant.of(trial), |_| {}));
        Score::mean(totals.collect::<Vec<_>>().iter()).total
    };
    std::thread::scope(|scope| {
        let handles: Vec<_> = trials.iter().map(|t| scope.spawn(|| of(t))).collect();
        handles.into_iter().map(joined).sum::<f64>() / trials.len() as f64
    })
}

fn choose(constant: &'static Constant, shipped: f64, error: impl Fn(Config) -> f64) -> Choice {
    let now = constant.shipped();
    let tried: Vec<(f32, f64)> =
        constant.tried.iter().map(|v| (*v, if same(*v, now) { shipped } else { error(constant.set(*v)) })).collect();
    let (best, least) = tried.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((now, shipped));
    let picked = if least < shipped * (1.0 - BAND) { best } else { now };
    Choice { constant, tried, best, picked }
}

fn same(a: f32, b: f32) -> bool {
    (a - b).abs() <= 1e-5 * b.abs()
}

fn percent(share: f64) -> String {
    // no minus before a zero
    format!("{:+.2} %", (share * 1e4).round() / 1e2 + 0.0)
}

fn head(half_a: &[&Trial], half_b: &[&Trial], a: f64, b: f64) -> String {
    let numbers =
        |half: &[&Trial]| half.iter().map(|t| t.name.chars().take(2).collect::<String>()).collect::<Vec<_>>().join(", ");
    format!(
        "# The filter's constants, and what half of the trials says of each

Written by `cargo xtask ahrs-bench --scan > docs/ahrs-constants.md`, which fails when half A picks another value.

**The rule.** Half A is every second of the shared BROAD trials, from the first ({}); half B is the others ({}).
The error is the total one, mean over a half's trials and over the eight variants of which VQF's figures are published. Each constant is replaced
by round values around it while the others stay. A constant stays as it is unless half A holds another of its values for better by more
than {:.0} %; then the best one is taken. Half B is run when all of half A is decided, and decides nothing.

With the default: half A {a:.3} degrees, half B {b:.3}. Columns: values tried, each with the change of half A's error against the default; the value with the
least; what the rule takes; and, not used, the change of half B's error with the least one. Where the default comes from: `VQF` its published
defaults, `prototype` a study of all shared trials, `both sets` one of all shared trials of BROAD and the phones, `chip` ranges of the sensors, `half A` chosen on it (`B seen`: with half B's figure in view), `cost` what the instruction budget asks for,
`gap` what counts as one. `declination` is an input and not chosen.

| constant | default | from | half A with other values | least | taken | half B with the least |
| --- | --- | --- | --- | --- | --- | --- |",
        numbers(half_a),
        numbers(half_b),
        BAND * 100.0
    )
}

fn row(choice: &Choice, shipped: f64, beside: f64) -> String {
    let Constant { name, unit, origin, .. } = choice.constant;
    let now = choice.constant.shipped();
    let others = choice.tried.iter().filter(|(v, _)| !same(*v, now));
    let others: Vec<String> = others.map(|(v, e)| format!("{v}: {}", percent(e / shipped - 1.0))).collect();
    let last = if same(choice.best, now) { "-".to_owned() } else { percent(beside) };
    let value = |v: f32| if same(v, now) { "default".to_owned() } else { v.to_string() };
    let shown = (f64::from(now) * 1e4).round() / 1e4;
    format!(
        "| `{name}` | {} | {origin} | {} | {} | {} | {last} |",
        format!("{shown} {unit}").trim_end(),
        others.join(", "),
        value(choice.best),
        if same(choice.picked, now) { "default".to_owned() } else { format!("**{}**", choice.picked) }
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The band: half a percent moves nothing, two percent do.
    #[test]
    fn a_constant_moves_only_for_more_than_the_band() {
        let constant = &ALL[0];
        let other = constant.tried[0];
        for (gain, moves) in [(0.995, false), (0.98, true)] {
            let error = |config: Config| if same(config.tilt_tau, other) { 2.0 * gain } else { 3.0 };
            let choice = choose(constant, 2.0, error);
            assert!(same(choice.best, other));
            assert_eq!(same(choice.picked, other), moves, "{gain}");
        }
    }
}
