//! The last look at a complete hypothesis: no name makes things worse.
//!
//! What it is: each effect of what the search has come to is held against all the others. One that acts before its cause, lies on a bound,
//! takes away no error, makes another channel worse, cancels another one, is lost in what is left, or could as well be nothing, goes; what is left
//! is fitted again and asked again.
//! What can go wrong: of two that do harm together one goes, the one that helps least; which of them was right is not asked.
//! Units: errors in the channel's unit, shares of them.
//! Reference: specification `closing-the-loop.md`, step 6; `formats.md`, "Verdict" ("no name may make things worse").

use crate::attribution::choose::NEEDED_REDUCTION;
use crate::attribution::unexplained::wanders;
use crate::channel::{Context, Target};
use crate::effects::placed::Placed;
use crate::effects::placed::is_named;
use crate::effects::{Effect, Estimate, Instance, NEEDED_EVIDENCE, Shape};
use crate::fit::heldout::{self, Held};
use crate::fit::{Fit, is_plausible, part_of};
use crate::model::Declared;
use crate::signal::colour::{Colour, effective_share};

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
    // the error of a channel to which an effect adds nothing changes with the fit of all else alone; where other sensors show it, what is no
    // worse is the same
    let same = match placed.effect.shows_beside_others_alone() {
        true => f64::INFINITY,
        false if is_shown_by_others(context, placed, after, without) => WORSE,
        false => EQUAL,
    };
    let of_channel = |(i, t): (usize, &Target)| {
        let of_news = 1.0 - after[i].rms / without[i].rms;
        let reduction = if t.trust.is_empty() { of_news } else { 1.0 - after[i].claimed / without[i].claimed };
        let reduction = if (-same..EQUAL).contains(&reduction) { 0.0 } else { reduction };
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

/// Evidence, nats, that a random walk gives the best straight line or the best step by chance, in 98 walks of 100: what no more speaks for says
/// nothing of why something wanders.
const OF_A_WALK: f64 = 25.0;
/// Share of its size that the best straight line takes off a random walk, in 19 walks of 20; the best step takes 0.6.
const OFF_A_WALK: f64 = 2.0 / 3.0;

/// The position of a name that is lost in what is left: that wanders as slowly as the name itself, the name takes no more away than a line takes off a
/// random walk, and so few samples are independent along it that such a walk would speak for it as loudly. Of several the one for which least
/// speaks; another channel that it clears, or what one sensor reads beyond the others, is witness enough.
pub(crate) fn drowned(context: &Context, declared: Declared<'_>, fit: &Fit, errors: &Errors<'_>) -> Option<usize> {
    if context.against_model {
        return None;
    }
    let left = heldout::residuals(context, declared, fit);
    let slow: Vec<bool> = context.targets.iter().zip(&left).map(|(target, left)| wanders(target, left)).collect();
    let asked = |k: &usize| {
        let placed = &fit.placed[*k];
        // that a rotor takes time, and a supply gives way, needs no witness
        let of_every = placed.effect.is_of_every_rig() || placed.instance.touches("voltage_v");
        let chosen = is_named(placed) && !placed.is_tare() && !of_every && !placed.effect.scatters();
        let on_slow = touched(context, placed).any(|(i, _)| slow[i]);
        chosen && on_slow && placed.effect.seen(context, &placed.instance) <= NEEDED_EVIDENCE
    };
    let speaks = |k: usize| {
        let (mut most, mut lost, mut cleared) = (0.0_f64, false, false);
        for (i, _) in touched(context, &fit.placed[k]) {
            let taken = 1.0 - errors.after[i].claimed / errors.without[k][i].claimed;
            let change = contribution(context, declared, fit, k, i);
            // a quick change shows through something slow
            let hidden = slow[i] && effective_share(&change) <= effective_share(&left[i]);
            let independent = left[i].len() as f64 * Colour::of(&left[i]).share_along(&change);
            most = most.max(-independent * (1.0 - taken).ln());
            lost |= hidden;
            cleared |= taken > if hidden { OFF_A_WALK } else { NEEDED_REDUCTION };
        }
        (lost && !cleared && most < OF_A_WALK).then_some((k, most))
    };
    (0..fit.placed.len()).filter(asked).filter_map(speaks).min_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| k)
}

/// The position of an effect that makes left-out rows of a channel worse, if there is one.
pub(crate) fn harmful(context: &Context, fit: &Fit, errors: &Errors<'_>) -> Option<usize> {
    useless(context, fit, errors).or_else(|| spoils(context, fit, errors))
}

/// Whether readings beside those of other sensors show an effect.
fn is_shown_by_others(context: &Context, placed: &Placed, after: &[Held], without: &[Held]) -> bool {
    let mut witnesses = touched(context, placed).filter(|(_, t)| t.relation.is_evidence());
    witnesses.any(|(i, _)| 1.0 - after[i].claimed / without[i].claimed > NEEDED_REDUCTION)
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
        let [low, high] = crate::effects::reported::parameter(e, &shapes, "").ci95;
        low <= 0.0 && high >= 0.0
    };
    is_named(placed) && !estimates.is_empty() && sizes.peek().is_some() && sizes.all(held)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The figure of [`OF_A_WALK`]: of random walks hardly any speaks as loudly for the best line or the best step.
    #[test]
    fn a_random_walk_speaks_for_no_name() {
        const N: usize = 600;
        let mut state = 1_u64;
        let mut chance = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / f64::from(1_u32 << 30) - 1.0
        };
        let centred = |mut v: Vec<f64>| {
            let mean = v.iter().sum::<f64>() / v.len() as f64;
            v.iter_mut().for_each(|v| *v -= mean);
            v
        };
        let square = |v: &[f64]| v.iter().map(|v| v * v).sum::<f64>();
        let line = centred((0..N).map(|i| i as f64).collect());
        let steps: Vec<Vec<f64>> =
            (12..N - 12).map(|at| centred((0..N).map(|i| if i < at { 0.0 } else { 1.0 }).collect())).collect();
        let spoken = |walk: &[f64], name: &[f64]| {
            let size = walk.iter().zip(name).map(|(w, c)| w * c).sum::<f64>() / square(name);
            let left: Vec<f64> = walk.iter().zip(name).map(|(w, c)| w - size * c).collect();
            (square(&left), -0.5 * N as f64 * Colour::of(&left).share_along(name) * (square(&left) / square(walk)).ln())
        };
        let mut loud = 0;
        for _ in 0..200 {
            let mut at = 0.0;
            let walk = centred(
                (0..N)
                    .map(|_| {
                        at += chance();
                        at
                    })
                    .collect(),
            );
            let best_step = steps.iter().min_by(|a, b| {
                let taken = |c: &[f64]| walk.iter().zip(c).map(|(w, c)| w * c).sum::<f64>().powi(2) / square(c);
                taken(b).total_cmp(&taken(a))
            });
            loud += usize::from(spoken(&walk, &line).1 > OF_A_WALK);
            loud += usize::from(best_step.is_some_and(|step| spoken(&walk, step).1 > OF_A_WALK));
        }
        assert!(loud <= 12, "{loud} of 400");
        // what is there speaks louder: a step of three times the noise
        let stepped: Vec<f64> = steps[280].iter().map(|c| 3.0 * c + chance()).collect();
        assert!(spoken(&centred(stepped), &steps[280]).1 > 4.0 * OF_A_WALK);
    }

    #[test]
    fn two_that_are_large_and_together_small_cancel() {
        let wave = |k: f64| (0..200).map(|i| k * (0.1 * f64::from(i)).sin()).collect::<Vec<f64>>();
        assert!(cancel(&wave(10.0), &wave(-9.5), 0.1));
        assert!(!cancel(&wave(10.0), &wave(-5.0), 0.1), "half of it stays");
        assert!(!cancel(&wave(0.1), &wave(-0.1), 0.1), "both are noise");
        assert!(!cancel(&wave(10.0), &wave(9.5), 0.1));
    }
}
