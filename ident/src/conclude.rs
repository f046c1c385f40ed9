//! The last look at a complete hypothesis: no name makes things worse.
//!
//! What it is: each effect of what the search has come to is held against all the others. One that acts before its cause, lies on a bound,
//! takes away no error, makes another channel worse, cancels another one, or could as well be nothing, goes; what is left is fitted again and
//! asked again.
//! What can go wrong: of two that do harm together one goes, the one that helps least; which of them was right is not asked.
//! Units: errors in the channel's unit, shares of them.
//! Reference: specification `closing-the-loop.md`, step 6; `formats.md`, "Verdict" ("no name may make things worse").

use crate::beside::is_named;
use crate::context::{Context, Target};
use crate::effects::{Effect, Estimate, Instance, Shape};
use crate::heldout::Held;
use crate::hypothesis::{Declared, Fit, Placed, is_plausible, part_of};

/// Share by which the error of a channel may be larger with the names than before.
const WORSE: f64 = 0.02;
/// Share below which two errors are the same figure.
const EQUAL: f64 = 1e-9;
/// Two contributions cancel where their sum is no larger than this share of the smaller one.
const CANCELLED: f64 = 0.2;
/// Noise floors from which on a contribution is large.
const LARGE: f64 = 3.0;

/// What an effect takes away of the held-out error of the channel that it helps most.
pub(crate) struct Quoted {
    pub(crate) channel: String,
    /// Share of the error in the measure in which it is news (see [`Target::news`]): what effects are ordered by.
    pub(crate) of_news: f64,
    /// Share of the error as it stands.
    pub(crate) reduction: f64,
}

/// The figure that is quoted for an effect: `after` with all effects, `without` without this one.
pub(crate) fn quoted(context: &Context, placed: &Placed, after: &[Held], without: &[Held]) -> Quoted {
    let of_channel = |(i, t): (usize, &Target)| {
        let of_news = 1.0 - after[i].rms / without[i].rms;
        let reduction = if t.trust.is_empty() { of_news } else { 1.0 - after[i].claimed / without[i].claimed };
        // what another sensor shows of it may leave the channel's own error as it is, to the last digits of a sum
        let reduction = if reduction.abs() < EQUAL { 0.0 } else { reduction };
        Quoted { channel: t.name.to_owned(), of_news, reduction }
    };
    let touched = touched(context, placed).filter(|(_, t)| !t.relation.is_evidence());
    let figures = touched.map(of_channel).filter(|q| q.of_news.is_finite() && q.reduction.is_finite());
    figures.max_by(|a, b| a.of_news.total_cmp(&b.of_news)).unwrap_or_else(|| Quoted {
        channel: placed.instance.channels.first().cloned().unwrap_or_default(),
        of_news: 0.0,
        reduction: 0.0,
    })
}

fn touched<'c>(context: &'c Context, placed: &'c Placed) -> impl Iterator<Item = (usize, &'c Target)> {
    context.targets.iter().enumerate().filter(|(_, t)| placed.instance.touches(t.name))
}

/// What a hypothesis did to the held-out errors.
pub(crate) struct Errors<'e> {
    pub(crate) before: &'e [Held],
    pub(crate) after: &'e [Held],
    /// For each effect those without it.
    pub(crate) without: &'e [Vec<Held>],
}

/// The position of an effect that cannot stay, if there is one: the one that does most harm.
pub(crate) fn untenable(context: &Context, declared: Declared<'_>, fit: &Fit, errors: &Errors<'_>) -> Option<usize> {
    let all = 0..fit.placed.len();
    let senseless = |k: &usize| is_named(&fit.placed[*k]) && !is_plausible(context, declared, fit, *k);
    all.clone().find(senseless).or_else(|| harmful(context, fit, errors)).or_else(|| cancelled(context, declared, fit, errors))
}

/// The position of an effect that makes left-out rows of a channel worse, if there is one.
pub(crate) fn harmful(context: &Context, fit: &Fit, errors: &Errors<'_>) -> Option<usize> {
    useless(context, fit, errors).or_else(|| spoils(context, fit, errors))
}

/// An effect without which left-out rows are predicted better: the one that does most harm.
fn useless(context: &Context, fit: &Fit, errors: &Errors<'_>) -> Option<usize> {
    let reduction = |k: usize| quoted(context, &fit.placed[k], errors.after, &errors.without[k]).reduction;
    let harmful = (0..fit.placed.len()).map(|k| (k, reduction(k))).filter(|(_, r)| *r < 0.0);
    harmful.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| k)
}

/// An effect of a channel that is predicted worse than before: the one without which it is predicted best.
fn spoils(context: &Context, fit: &Fit, errors: &Errors<'_>) -> Option<usize> {
    let judged = context.targets.iter().enumerate().filter(|(_, t)| !t.relation.is_evidence());
    let worse = judged.filter(|(i, _)| errors.after[*i].claimed > (1.0 + WORSE) * errors.before[*i].claimed);
    worse
        .filter_map(|(i, target)| {
            let there = (0..fit.placed.len()).filter(|k| fit.placed[*k].instance.touches(target.name));
            there.min_by(|a, b| errors.without[*a][i].claimed.total_cmp(&errors.without[*b][i].claimed))
        })
        .next()
}

/// Of two effects that cancel on a channel the one that helps less; the one without a name beside one with a name, whose size would not be its
/// own.
fn cancelled(context: &Context, declared: Declared<'_>, fit: &Fit, errors: &Errors<'_>) -> Option<usize> {
    let help = |k: usize| quoted(context, &fit.placed[k], errors.after, &errors.without[k]).of_news;
    for (i, target) in context.targets.iter().enumerate().filter(|(_, t)| !t.relation.is_evidence()) {
        let there: Vec<usize> = (0..fit.placed.len()).filter(|k| fit.placed[*k].instance.touches(target.name)).collect();
        if there.len() < 2 || !there.iter().any(|k| is_named(&fit.placed[*k])) {
            continue;
        }
        let parts: Vec<Vec<f64>> = there.iter().map(|k| contribution(context, declared, fit, *k, i)).collect();
        for a in 0..there.len() {
            for b in 0..a {
                let pair = [there[a], there[b]];
                if cancel(&parts[a], &parts[b], target.noise.rms) {
                    let without_name = pair.into_iter().find(|k| !is_named(&fit.placed[*k]));
                    return without_name.or_else(|| pair.into_iter().min_by(|x, y| help(*x).total_cmp(&help(*y))));
                }
            }
        }
    }
    None
}

/// Whether two contributions are large and together small.
fn cancel(a: &[f64], b: &[f64], floor: f64) -> bool {
    let rms = |of: &dyn Fn(usize) -> f64| ((0..a.len()).map(|j| of(j).powi(2)).sum::<f64>() / a.len().max(1) as f64).sqrt();
    let smaller = rms(&|j| a[j]).min(rms(&|j| b[j]));
    smaller > LARGE * floor && rms(&|j| a[j] + b[j]) < CANCELLED * smaller
}

/// What an effect adds to the prediction of a target, about its mean.
fn contribution(context: &Context, declared: Declared<'_>, fit: &Fit, k: usize, target: usize) -> Vec<f64> {
    let part = part_of(context, declared, fit, k, target);
    let mean = part.iter().sum::<f64>() / part.len().max(1) as f64;
    part.into_iter().map(|v| v - mean).collect()
}

/// Whether an effect could as well be nothing: all its fitted sizes have intervals that hold zero. Sizes are amplitudes, and shapes that may
/// have either sign alike; an instant, an onset or a time constant is none.
pub(crate) fn is_nothing(context: &Context, placed: &Placed, estimates: &[Estimate]) -> bool {
    let (effect, instance): (&dyn Effect, &Instance) = (placed.effect, &placed.instance);
    let shapes = effect.shapes(context, instance);
    let is_size = |e: &Estimate| shapes.iter().find(|s| s.name == e.name).is_none_or(Shape::is_size);
    let reported = effect.report(context, instance, estimates.to_vec());
    let mut sizes = reported.iter().filter(|e| is_size(e)).peekable();
    let held = |e: &Estimate| {
        let [low, high] = crate::close::parameter(e, &shapes, "").ci95;
        low <= 0.0 && high >= 0.0
    };
    is_named(placed) && !estimates.is_empty() && sizes.peek().is_some() && sizes.all(held)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_that_are_large_and_together_small_cancel() {
        let wave = |k: f64| (0..200).map(|i| k * (0.1 * f64::from(i)).sin()).collect::<Vec<f64>>();
        assert!(cancel(&wave(10.0), &wave(-9.5), 0.1));
        assert!(!cancel(&wave(10.0), &wave(-5.0), 0.1), "half of it stays");
        assert!(!cancel(&wave(0.1), &wave(-0.1), 0.1), "both are noise");
        assert!(!cancel(&wave(10.0), &wave(9.5), 0.1));
    }
}
