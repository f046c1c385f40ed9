//! One set of values for all runs, and what it is worth on the run that had no part in it.
//!
//! What it is: the equations of all runs added up and solved, channel by channel; for each run the same without it.
//! What can go wrong: a coefficient that only the run left out could tell is zero there; a channel that only it has is not predicted.
//! Units: log-likelihood in nats; errors as the channels.
//! Reference: leave-one-group-out cross-validation; profile likelihood of the shapes, Barndorff-Nielsen & Cox 1994, section 3.4.

use super::equations::{left_on, of_run, residual_on, rms, shared, solved};
use super::{FEWEST, Member, is_judged};
use crate::channel::Relation;
use crate::effects::Shape;
use crate::effects::design::{Label, covariance};
use crate::effects::placed::Placed;
use crate::fit::search::connected;
use crate::numeric::simplex::nelder_mead;
use crate::numeric::solve::Normal;
use nalgebra::DMatrix;

/// Share of the noise floor below which a smaller residual counts no further.
const FINEST: f64 = 0.3;

/// The shared coefficients of one channel.
#[derive(Debug, Clone)]
pub(super) struct Shared {
    /// Channel.
    pub(super) channel: &'static str,
    /// Their meaning: effects by their position among those of the rig.
    pub(super) labels: Vec<Label>,
    /// Their values.
    pub(super) coefficients: Vec<f64>,
    /// Their covariance, from all runs together.
    pub(super) covariance: DMatrix<f64>,
}

/// Error of a channel of one run, predicted by a fit to the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Across {
    /// Run, by position.
    pub(super) run: usize,
    /// Channel.
    pub(super) channel: &'static str,
    /// Root mean square, one constant apart.
    pub(super) rms: f64,
    /// Noise floor of the channel on that run.
    pub(super) floor: f64,
    /// Independent samples, times the channel's share in a joint likelihood.
    pub(super) samples: f64,
}

impl Across {
    /// Logarithm of how well the run is predicted, nats.
    pub(super) fn score(&self) -> f64 {
        let floor = FINEST * self.floor;
        -self.samples * (self.rms.max(floor) / floor).ln()
    }
}

/// A channel of one run, both times predicted by a fit to the others.
#[derive(Debug, Clone, Copy)]
pub(super) struct Compared {
    /// Error with fewer effects.
    pub(super) before: Across,
    /// Error with more.
    pub(super) after: Across,
}

impl Compared {
    /// How many times smaller the error has become; what lies below the noise floor counts as the floor.
    pub(super) fn times(&self) -> f64 {
        self.before.rms.max(self.before.floor) / self.after.rms.max(self.after.floor)
    }
}

/// Each channel of each run that stands in both lists.
pub(super) fn compared(before: &[Across], after: &[Across]) -> Vec<Compared> {
    let same = |b: &Across| after.iter().find(|a| a.run == b.run && a.channel == b.channel).copied();
    before.iter().filter_map(|b| Some(Compared { before: *b, after: same(b)? })).collect()
}

/// Effects of a rig, with shapes, on a set of runs.
#[derive(Debug)]
pub(super) struct Joint<'m, 'a> {
    /// The runs.
    pub(super) members: &'m [Member<'a>],
    /// Which of them teach.
    teaches: Vec<bool>,
}

impl<'m, 'a> Joint<'m, 'a> {
    /// All runs teach.
    pub(super) fn of(members: &'m [Member<'a>]) -> Self {
        Self { members, teaches: vec![true; members.len()] }
    }

    /// All but one.
    pub(super) fn without(&self, run: usize) -> Self {
        let teaches = self.teaches.iter().enumerate().map(|(i, t)| *t && i != run).collect();
        Self { members: self.members, teaches }
    }

    /// One alone.
    pub(super) fn only(&self, run: usize) -> Self {
        Self { members: self.members, teaches: (0..self.members.len()).map(|i| i == run).collect() }
    }

    /// Every channel that a run has, in the order of the first run that has it.
    pub(super) fn channels(&self) -> Vec<&'static str> {
        let mut out: Vec<&'static str> = Vec::new();
        for target in self.members.iter().flat_map(|m| &m.context.targets) {
            if !out.contains(&target.name) {
                out.push(target.name);
            }
        }
        out
    }

    /// For each run the equations of a channel; nothing where it does not teach or lacks the channel.
    fn equations(&self, channel: &str, rig: &[Placed], most: usize) -> (Vec<Label>, Vec<Option<(Normal, f64)>>) {
        // a run without a command says nothing of what a speed makes of one
        let relation = |m: &Member<'_>| m.context.target(channel).map(|k| m.context.targets[k].relation);
        let commanded = self.members.iter().any(|m| relation(m) == Some(Relation::SpeedFromPulse));
        let place =
            |m: &Member<'_>| m.context.target(channel).filter(|_| !commanded || relation(m) != Some(Relation::SpeedAlone));
        let of = |m: &Member<'_>| place(m).map(|k| shared(rig, &m.context.targets[k]));
        let labels = self.members.iter().find_map(of).unwrap_or_default();
        let each = |(m, teaches): (&Member<'_>, &bool)| {
            let k = place(m).filter(|_| *teaches)?;
            let stride = m.context.targets[k].rows.len().div_ceil(most).max(1);
            Some((of_run(m, k, rig, &labels, stride)?, m.independent[k]))
        };
        let normals = self.members.iter().zip(&self.teaches).map(each).collect();
        (labels, normals)
    }

    /// Log-likelihood of the shapes, nats: the noise of each run has a scale of its own.
    fn loglik(&self, rig: &[Placed], channels: &[&str], most: usize) -> f64 {
        let of_channel = |channel: &&str| {
            let (labels, normals) = self.equations(channel, rig, most);
            let Some((coefficients, _)) = joint(channel, &labels, &normals).and_then(|n| solved(&n)) else {
                return 0.0;
            };
            let weight = self.weight(channel);
            let of_run = |(n, samples): &(Normal, f64)| -0.5 * samples * (n.left_by(&coefficients) / samples).max(1e-3).ln();
            weight * normals.iter().flatten().map(of_run).sum::<f64>()
        };
        channels.iter().map(of_channel).sum()
    }

    fn weight(&self, channel: &str) -> f64 {
        let of = |m: &Member<'_>| m.context.target(channel).map(|k| m.context.targets[k].weight);
        self.members.iter().find_map(of).unwrap_or(1.0)
    }

    /// Plausible ranges of an effect's shapes: those that all runs on which it acts agree on, or all together where they do not; those of no
    /// width are known.
    pub(super) fn ranges(&self, p: &Placed) -> Vec<(f64, f64)> {
        let of = |m: &Member<'_>| p.effect.shapes(m.context, &p.instance).iter().map(known_or_range).collect::<Vec<_>>();
        let all: Vec<Vec<(f64, f64)>> = self.members.iter().filter(|m| m.tells(p)).map(of).collect();
        let joined = |i: usize| {
            let own = all.iter().filter_map(|ranges| ranges.get(i).copied());
            let narrow = own.clone().reduce(|a, b| (a.0.max(b.0), a.1.min(b.1)));
            narrow.filter(|r| r.1 > r.0).or_else(|| own.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))))
        };
        (0..p.shape.len()).map(|i| joined(i).unwrap_or((f64::INFINITY, f64::NEG_INFINITY))).collect()
    }

    /// The shapes of the effects at the positions of `moved` that the runs together find most likely, from those given.
    pub(super) fn refined(&self, rig: &[Placed], moved: &[usize], most: usize, evaluations: usize) -> Vec<Placed> {
        let free: Vec<(usize, usize, (f64, f64))> = moved
            .iter()
            .flat_map(|k| self.ranges(&rig[*k]).into_iter().enumerate().map(move |(i, range)| (*k, i, range)))
            .filter(|(_, _, range)| range.1 > range.0)
            .collect();
        if free.is_empty() {
            return rig.to_vec();
        }
        let with = |x: &[f64]| {
            let mut placed = rig.to_vec();
            free.iter().zip(x).for_each(|((k, i, range), v)| placed[*k].shape[*i] = v.clamp(range.0, range.1));
            placed
        };
        let mut channels: Vec<&str> = moved.iter().flat_map(|k| rig[*k].instance.channels.iter().map(String::as_str)).collect();
        channels.sort_unstable();
        channels.dedup();
        let cost = |x: &[f64]| {
            let beyond = |((_, _, range), v): (&(usize, usize, (f64, f64)), &f64)| {
                ((v - v.clamp(range.0, range.1)) / (range.1 - range.0)).abs()
            };
            let wall: f64 = free.iter().zip(x).map(beyond).sum();
            let placed = with(x);
            let of_first = self.members.first().map(|m| m.context);
            let known: f64 = of_first.map_or(0.0, |context| placed.iter().map(|p| p.prior(context)).sum());
            1e3 * wall - known - self.loglik(&placed, &channels, most)
        };
        let x0: Vec<f64> = free.iter().map(|(k, i, _)| rig[*k].shape[*i]).collect();
        let step = |((_, _, range), v): (&(usize, usize, (f64, f64)), &f64)| {
            let width = range.1 - range.0;
            (0.15 * v.abs()).max(0.01 * width).min(0.2 * width)
        };
        let steps: Vec<f64> = free.iter().zip(&x0).map(step).collect();
        with(&nelder_mead(&cost, &x0, &steps, evaluations))
    }

    /// The same for all effects, each group that shares channels on its own.
    pub(super) fn refined_whole(&self, rig: &[Placed], most: usize, evaluations: usize) -> Vec<Placed> {
        let mut out = rig.to_vec();
        let mut done = vec![false; rig.len()];
        for k in 0..rig.len() {
            if !done[k] {
                let group = connected(rig, k);
                out = self.refined(&out, &group, most, evaluations);
                group.iter().for_each(|g| done[*g] = true);
            }
        }
        out
    }

    /// The shared coefficients of every channel, from the runs that teach.
    pub(super) fn shared(&self, rig: &[Placed]) -> Vec<Shared> {
        let of_channel = |channel: &'static str| {
            let (labels, normals) = self.equations(channel, rig, usize::MAX);
            let whole = joint(channel, &labels, &normals)?;
            let (coefficients, inverse) = solved(&whole)?;
            let samples: f64 = normals.iter().flatten().map(|n| n.1).sum();
            let times = (whole.left_by(&coefficients) / samples).max(1.0);
            let covariance = covariance(Relation::of(channel, true)?, labels.iter().copied(), inverse, (1.0, times));
            Some(Shared { channel, labels, coefficients, covariance })
        };
        self.channels().into_iter().filter_map(of_channel).collect()
    }

    /// Each run predicted by a fit of these effects, shapes as they are, to the others, on the channels named; on all without a list. A
    /// channel that no other run has is not predicted.
    pub(super) fn across(&self, rig: &[Placed], channels: Option<&[&'static str]>) -> Vec<Across> {
        let mut out = Vec::new();
        for channel in channels.map_or_else(|| self.channels(), <[_]>::to_vec) {
            let (labels, normals) = self.equations(channel, rig, usize::MAX);
            let Some(whole) = joint(channel, &labels, &normals) else { continue };
            if normals.iter().flatten().count() < FEWEST {
                continue;
            }
            for (run, (member, own)) in self.members.iter().zip(&normals).enumerate() {
                let Some((own, _)) = own else { continue };
                let Some((coefficients, _)) = solved(&whole.less(own, 1.0)) else { continue };
                out.extend(of_run_on(member, run, channel, rig, &labels, &coefficients));
            }
        }
        out
    }

    /// What a fit to the other runs leaves over of a channel of one run, on every sample.
    pub(super) fn left(&self, run: usize, rig: &[Placed], channel: &'static str) -> Option<Vec<f64>> {
        let (labels, normals) = self.equations(channel, rig, usize::MAX);
        let (own, _) = normals.get(run)?.as_ref()?;
        let (coefficients, _) = solved(&joint(channel, &labels, &normals)?.less(own, 1.0))?;
        let member = &self.members[run];
        residual_on(member, member.context.target(channel)?, rig, &labels, &coefficients)
    }

    /// One run by shared coefficients.
    pub(super) fn on(&self, run: usize, rig: &[Placed], shared: &[Shared]) -> Vec<Across> {
        let of = |s: &Shared| of_run_on(&self.members[run], run, s.channel, rig, &s.labels, &s.coefficients);
        shared.iter().filter_map(of).collect()
    }

    /// Whether a run can tell of an effect.
    pub(super) fn tells(&self, run: usize, p: &Placed) -> bool {
        self.members[run].tells(p)
    }

    /// Runs that teach and can tell of an effect.
    pub(super) fn tellers(&self, p: &Placed) -> usize {
        (0..self.members.len()).filter(|run| self.teaches[*run] && self.tells(*run, p)).count()
    }
}

impl Shared {
    /// Places of the polynomial's coefficients.
    pub(super) fn base(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.labels.len()).filter(|j| matches!(self.labels[*j], Label::Base(_)))
    }

    /// Amplitudes of an effect of the rig.
    pub(super) fn amplitudes(&self, effect: usize, p: &Placed) -> Vec<f64> {
        let of = |amplitude| self.labels.iter().position(|l| *l == Label::Effect { effect, amplitude });
        (0..p.effect.amplitudes(&p.instance).len()).map(|i| of(i).map_or(0.0, |j| self.coefficients[j])).collect()
    }
}

/// A range; nothing to seek where it has no width, or only places something within a row.
fn known_or_range(shape: &Shape) -> (f64, f64) {
    if shape.range.1 > shape.range.0 && !shape.is_nuisance() { shape.range } else { (f64::INFINITY, f64::NEG_INFINITY) }
}

fn of_run_on(
    member: &Member<'_>,
    run: usize,
    channel: &'static str,
    rig: &[Placed],
    labels: &[Label],
    coefficients: &[f64],
) -> Option<Across> {
    let k = member.context.target(channel)?;
    let target = &member.context.targets[k];
    if !is_judged(target.relation) {
        return None;
    }
    let left = left_on(member, k, rig, labels, coefficients)?;
    let samples = member.independent[k] * target.weight;
    Some(Across { run, channel, rms: rms(&left), floor: target.noise.rms, samples })
}

/// The equations of a channel from all runs together, with what is known of its coefficients before any run.
fn joint(channel: &str, labels: &[Label], normals: &[Option<(Normal, f64)>]) -> Option<Normal> {
    let mut of_runs = normals.iter().flatten().map(|n| &n.0);
    let mut out = of_runs.next()?.clone();
    of_runs.for_each(|n| out.absorb(n));
    let relation = Relation::of(channel, true)?;
    for (k, label) in labels.iter().enumerate() {
        if let Label::Base(power) = label
            && let Some((sd, most)) = relation.known(*power)
        {
            out.expect(k, sd, most, 1.0);
        }
    }
    Some(out)
}
