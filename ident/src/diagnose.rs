//! From the residual to its cause.
//!
//! What it is: every effect of the library is fitted to the log, alone and added to what was found already; the winner must
//! pay for its parameters, predict held-out rows better, and make physical sense; a flexible opponent without a name stands
//! against it.
//! What can go wrong: on a schedule that cannot tell two effects apart the verdict is `ambiguous`; where only the opponent
//! explains the residual it is `unattributed`.
//! Units: evidence in nats.
//! Reference: Schwarz 1978 (penalty); Davies 1987 (shape parameters that do not exist under the null).

use crate::context::{Context, Relation};
use crate::effects::unknown::{Unknown, variables};
use crate::effects::{self, Effect, Instance};
use crate::heldout;
use crate::hypothesis::{Declared, Fit, Placed, Rows, fit, refine, scan};

/// Most effects in one hypothesis.
const MOST_EFFECTS: usize = 3;
/// Net evidence, nats, that an effect must bring beyond its penalty: a library of about fifty instances then raises a false
/// alarm in about one clean run of a hundred.
const NEEDED_EVIDENCE: f64 = 7.0;
/// Share of the held-out error on its first channel that an effect must remove to be worth a name.
const NEEDED_REDUCTION: f64 = 0.03;
/// Candidates whose shapes are refined after the scan of their grids.
const REFINED: usize = 7;
/// Softmax temperature from evidence to probability.
const TEMPERATURE: f64 = 4.0;
/// Probability at which a second hypothesis makes the verdict ambiguous.
const RIVAL: f64 = 0.25;

/// A candidate hypothesis with its evidence.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Its fit.
    pub fit: Fit,
    /// Net evidence over the declared model, nats.
    pub evidence: f64,
}

impl Candidate {
    /// Identifiers of its effects.
    #[must_use]
    pub fn ids(&self) -> Vec<String> {
        self.fit.placed.iter().map(|p| p.effect.id().to_owned()).collect()
    }
}

/// What the search found.
#[derive(Debug, Clone)]
pub struct Diagnosis {
    /// The declared model's fit.
    pub declared: Fit,
    /// The winner; its `placed` is empty when nothing is there.
    pub best: Candidate,
    /// Its probability.
    pub probability: f64,
    /// The others with their probabilities, best first.
    pub rivals: Vec<(Candidate, f64)>,
    /// The winner is the empirical correction.
    pub unknown: bool,
    /// Held-out errors of the declared model, by target.
    pub heldout_before: Vec<f64>,
    /// Held-out errors of the winner, by target.
    pub heldout_after: Vec<f64>,
    /// For each effect of the winner the held-out errors without it, by target.
    pub heldout_without: Vec<Vec<f64>>,
    /// The folds.
    pub folds: Vec<Vec<bool>>,
}

impl Diagnosis {
    /// Whether two hypotheses explain the residual about equally well.
    #[must_use]
    pub fn ambiguous(&self) -> bool {
        !self.unknown && !self.best.fit.placed.is_empty() && self.rivals.first().is_some_and(|r| r.1 >= RIVAL && !r.0.fit.placed.is_empty())
    }
}

/// Runs the search. `progress` hears a share of the work done, 0 to 1.
#[must_use]
pub fn diagnose(context: &Context, declared: Declared<'_>, progress: &mut dyn FnMut(f64)) -> Option<Diagnosis> {
    let start = fit(context, declared, &[], None, Rows::All)?;
    let folds = heldout::folds(context);
    let heldout_before = heldout::errors(context, declared, &start, &folds);
    let mut best = Candidate { fit: start.clone(), evidence: 0.0 };
    let mut rivals: Vec<Candidate> = Vec::new();
    let mut rounds: Vec<Vec<Candidate>> = Vec::new();
    let mut errors = heldout_before.clone();
    for round in 0..MOST_EFFECTS {
        let ranked = round_of(context, declared, &best, &start, &mut |p| progress((round as f64 + p) / (MOST_EFFECTS as f64 + 1.0)));
        let Some((winner, held)) = ranked.iter().find_map(|c| {
            (c.evidence > best.evidence + NEEDED_EVIDENCE).then(|| heldout::errors(context, declared, &c.fit, &folds)).filter(|held| worth_a_name(context, c, held, &errors)).map(|held| (c.clone(), held))
        }) else {
            break;
        };
        best = winner;
        errors = held;
        rounds.push(ranked);
    }
    if let Some(last) = rounds.pop() {
        let ids = best.ids();
        rivals.extend(last.into_iter().filter(|c| c.ids() != ids));
    }
    let unknown = opponent(context, declared, &start, &folds, &heldout_before, &best, &errors);
    let is_unknown = unknown.is_some();
    if let Some((candidate, held)) = unknown {
        rivals.insert(0, std::mem::replace(&mut best, candidate));
        errors = held;
    }
    let heldout_without = (0..best.fit.placed.len())
        .map(|k| without(context, declared, &best.fit, k, &start).map_or_else(|| heldout_before.clone(), |f| heldout::errors(context, declared, &f, &folds)))
        .collect();
    progress(1.0);
    let (probability, rivals) = probabilities(&best, rivals);
    Some(Diagnosis { declared: start, best, probability, rivals, unknown: is_unknown, heldout_before, heldout_after: errors, heldout_without, folds })
}

/// Every instance of every effect added to `best`, refined where promising, best first.
fn round_of(context: &Context, declared: Declared<'_>, best: &Candidate, start: &Fit, progress: &mut dyn FnMut(f64)) -> Vec<Candidate> {
    let used: Vec<&str> = best.fit.placed.iter().map(|p| p.effect.id()).collect();
    let offers: Vec<(&'static dyn Effect, Instance)> = effects::library()
        .iter()
        .filter(|e| !used.contains(&e.id()))
        .flat_map(|e| e.instances(context).into_iter().map(|i| (*e, i)))
        .collect();
    let mut scanned: Vec<(f64, Vec<Placed>)> = Vec::new();
    for (k, (effect, instance)) in offers.iter().enumerate() {
        progress(0.7 * k as f64 / offers.len() as f64);
        if let Some((shape, gain)) = scan(context, declared, &best.fit.placed, *effect, instance) {
            let mut placed = best.fit.placed.clone();
            placed.push(Placed { effect: *effect, instance: instance.clone(), shape });
            scanned.push((gain - penalty(context, placed.last().unwrap_or(&best.fit.placed[0])), placed));
        }
    }
    scanned.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut out: Vec<Candidate> = Vec::new();
    let mut refined = 0;
    for (k, (gain, placed)) in scanned.into_iter().enumerate() {
        progress(0.7 + 0.3 * (k as f64 / offers.len() as f64).min(1.0));
        if gain < -20.0 {
            continue;
        }
        let placed = if refined < REFINED {
            refined += 1;
            refine(context, declared, &placed, Rows::All, 60 + 60 * placed.len())
        } else {
            placed
        };
        let Some(candidate) = candidate(context, declared, start, placed) else { continue };
        if plausible(context, declared, &candidate.fit) {
            out.push(candidate);
        }
    }
    out.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
    out
}

fn candidate(context: &Context, declared: Declared<'_>, start: &Fit, placed: Vec<Placed>) -> Option<Candidate> {
    let fitted = fit(context, declared, &placed, Some(start), Rows::All)?;
    let price: f64 = placed.iter().map(|p| penalty(context, p)).sum();
    Some(Candidate { evidence: fitted.loglik - start.loglik - price, fit: fitted })
}

/// Price of an effect: half a log of the sample for each parameter, and the log of the grid that was searched.
fn penalty(context: &Context, placed: &Placed) -> f64 {
    let n: f64 = context.targets.iter().filter(|t| placed.instance.touches(t.name)).map(|t| t.rows.len() as f64 * t.noise.effective_share() * t.weight).sum();
    let shapes = placed.effect.shapes(context, &placed.instance);
    let grid: usize = shapes.iter().map(|s| s.starts.len()).product();
    let amplitudes = placed.effect.amplitudes(&placed.instance).len().min(placed.instance.channels.len().max(1));
    0.5 * (shapes.len() + amplitudes) as f64 * n.max(2.0).ln() + (grid as f64).ln().max(0.0) * 0.5
}

fn plausible(context: &Context, declared: Declared<'_>, fit: &Fit) -> bool {
    fit.placed.iter().enumerate().all(|(k, p)| {
        let inside = p.effect.shapes(context, &p.instance).iter().zip(&p.shape).all(|(s, v)| {
            let margin = 1e-3 * (s.range.1 - s.range.0);
            s.range.1 <= s.range.0 || (*v > s.range.0 - margin && *v < s.range.1 - margin)
        });
        inside && p.effect.plausible(&p.instance, &fit.estimates(context, declared, k))
    })
}

/// The newest effect must remove some of the held-out error on one of its channels, and spoil none.
fn worth_a_name(context: &Context, candidate: &Candidate, held: &[f64], before: &[f64]) -> bool {
    let Some(newest) = candidate.fit.placed.last() else { return false };
    let mut helps = false;
    for (i, target) in context.targets.iter().enumerate() {
        if !newest.instance.touches(target.name) {
            continue;
        }
        let share = 1.0 - held[i] / before[i];
        helps |= share > NEEDED_REDUCTION;
        if share < -NEEDED_REDUCTION && target.relation != Relation::ThrustRms {
            return false;
        }
    }
    // extra scatter has no mean to predict: the evidence alone must carry it
    helps || (newest.effect.id() == "beam_resonance" && candidate.evidence > 4.0 * NEEDED_EVIDENCE)
}

fn without(context: &Context, declared: Declared<'_>, fit_all: &Fit, k: usize, start: &Fit) -> Option<Fit> {
    let mut placed = fit_all.placed.clone();
    placed.remove(k);
    let placed = refine(context, declared, &placed, Rows::All, 60);
    fit(context, declared, &placed, Some(start), Rows::All)
}

/// The opponent without a name: a smooth function of one variable on one channel. It wins where it predicts held-out rows
/// clearly better than whatever was named there, and significantly.
fn opponent(
    context: &Context,
    declared: Declared<'_>,
    start: &Fit,
    folds: &[Vec<bool>],
    before: &[f64],
    best: &Candidate,
    named: &[f64],
) -> Option<(Candidate, Vec<f64>)> {
    let mut champion: Option<(f64, Candidate, Vec<f64>)> = None;
    for (i, target) in context.targets.iter().enumerate() {
        if target.relation == Relation::ThrustRms {
            continue;
        }
        for variable in variables(context) {
            let own = match target.relation {
                Relation::SpeedFromPulse => variable == "pulse_us" || variable == "rpm" || variable == "current_a",
                Relation::Voltage => variable == "voltage_v",
                Relation::Current => variable == "current_a",
                _ => false,
            };
            if own {
                continue;
            }
            let instance = Instance::new(&[target.name], &variable);
            let shape = Unknown.shapes(context, &instance).iter().map(|s| s.range.0).collect();
            let Some(candidate) = candidate(context, declared, start, vec![Placed { effect: &Unknown, instance, shape }]) else { continue };
            if candidate.evidence < 2.0 * NEEDED_EVIDENCE {
                continue;
            }
            let held = heldout::errors(context, declared, &candidate.fit, folds);
            let gain = (before[i] / held[i]).ln();
            let rival = (before[i] / named[i]).ln();
            let clearly = gain > (1.0 / (1.0 - NEEDED_REDUCTION)).ln() && (best.fit.placed.is_empty() || gain > rival + 0.15);
            if clearly && champion.as_ref().is_none_or(|c| gain > c.0) {
                champion = Some((gain, candidate, held));
            }
        }
    }
    // a name that explains another channel much better than the opponent explains its own stays
    champion.filter(|(gain, ..)| best.fit.placed.is_empty() || before.iter().zip(named).all(|(b, n)| (b / n).ln() < *gain)).map(|(_, c, h)| (c, h))
}

/// Softmax over hypotheses with different sets of effects.
fn probabilities(best: &Candidate, rivals: Vec<Candidate>) -> (f64, Vec<(Candidate, f64)>) {
    let mut seen = vec![best.ids()];
    let mut kept: Vec<Candidate> = Vec::new();
    for r in rivals {
        let ids = r.ids();
        if !seen.contains(&ids) {
            seen.push(ids);
            kept.push(r);
        }
    }
    let top = best.evidence.max(kept.iter().map(|c| c.evidence).fold(f64::NEG_INFINITY, f64::max));
    let weight = |e: f64| ((e - top) / TEMPERATURE).exp();
    // "nothing is there" is a hypothesis like the others, with evidence zero plus what a name must bring
    let none = if best.fit.placed.is_empty() { 0.0 } else { weight(NEEDED_EVIDENCE) };
    let total: f64 = weight(best.evidence) + kept.iter().map(|c| weight(c.evidence)).sum::<f64>() + none;
    let share = |e: f64| weight(e) / total;
    let probability = share(best.evidence);
    let mut rivals: Vec<(Candidate, f64)> = kept.into_iter().map(|c| { let p = share(c.evidence); (c, p) }).filter(|(_, p)| *p > 1e-4).collect();
    rivals.sort_by(|a, b| b.1.total_cmp(&a.1));
    rivals.truncate(6);
    (probability, rivals)
}
