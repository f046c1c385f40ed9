//! The fits without one run each, and the names that hold on all of them.
//!
//! What it is: each run predicted whole by a fit to the others, shapes too; a name goes where it makes a channel of any run worse. What leaving
//! out one run after the other moves a parameter by is part of its error.
//! What can go wrong: of two runs each is predicted by one: their errors are wide.
//! Units: as the channels.
//! Reference: leave-one-group-out cross-validation, Roberts et al. 2017, Ecography 40:913; jackknife, Efron & Stein 1981, Annals of
//! Statistics 9:586.

use super::Member;
use super::choose::{self, Named};
use super::joint::{Across, Compared, Joint, Shared, compared};
use super::own::{self, Worth};
use crate::effects::Estimate;
use crate::effects::placed::Placed;
use crate::fit::allow_for_the_form;
use crate::numeric::parallel::in_parallel;

/// The fit without one run.
#[derive(Debug)]
pub(super) struct Fold {
    /// Which effects of the rig it holds.
    known: Vec<usize>,
    /// Those effects, shapes as the other runs have them.
    pub(super) rig: Vec<Placed>,
    /// The shared coefficients of the other runs.
    pub(super) shared: Vec<Shared>,
}

/// The fits without one run each.
#[derive(Debug)]
pub(super) struct Folds(pub(super) Vec<Fold>);

/// The names that hold on every run, and what goes with them.
#[derive(Debug)]
pub(super) struct Tenable<'a> {
    /// The names.
    pub(super) named: Vec<Named>,
    /// The runs, with the drifts and events that each has beside them.
    pub(super) members: Vec<Member<'a>>,
    /// What those are worth, run by run.
    pub(super) worths: Vec<Vec<Worth>>,
    /// The fits without one run each.
    pub(super) folds: Folds,
    /// Each run predicted by its fold: declared model, and with the names.
    pub(super) compared: Vec<Compared>,
}

/// Each run predicted by a fit to the others, shapes too. Names that make a run's channel worse go, and those that help none, the
/// weakest first.
pub(super) fn tenable<'a>(members: &[Member<'a>], mut named: Vec<Named>) -> Tenable<'a> {
    loop {
        let rig: Vec<Placed> = named.iter().map(|n| n.placed.clone()).collect();
        let mut members = members.to_vec();
        let worths = own::settle(&mut members, &rig);
        let joint = Joint::of(&members);
        let (folds, after) = left_out(&joint, &rig);
        let compared = compared(&joint.across(&[], None), &after);
        let weakest = choose::harms(&compared).and_then(|worse| {
            let touching = (0..named.len()).filter(|k| named[*k].placed.instance.touches(worse));
            touching.min_by(|a, b| named[*a].score.total_cmp(&named[*b].score))
        });
        match weakest.or_else(|| needless(&joint, &named, &after)) {
            Some(k) => drop(named.remove(k)),
            None => return Tenable { named, members, worths, folds, compared },
        }
    }
}

/// The weakest of the names that take no more off the error of any channel than what has no name.
fn needless(joint: &Joint<'_, '_>, named: &[Named], after: &[Across]) -> Option<usize> {
    let is_needless = |k: &usize| {
        let without = joint.across(&choose::without(named, *k), None);
        !choose::is_worth(&compared(&without, after))
    };
    (0..named.len()).filter(is_needless).min_by(|a, b| named[*a].score.total_cmp(&named[*b].score))
}

/// The fits without one run each, on all cores, and what they predict of it.
fn left_out(joint: &Joint<'_, '_>, rig: &[Placed]) -> (Folds, Vec<Across>) {
    let of = |run: usize| {
        let others = joint.without(run);
        // of what the others cannot tell nothing is known
        let known: Vec<usize> = (0..rig.len()).filter(|k| others.tellers(&rig[*k]) > 0).collect();
        let rig: Vec<Placed> = known.iter().map(|k| rig[*k].clone()).collect();
        let refined = others.refined_whole(&rig, choose::SOUGHT, choose::EVALUATIONS);
        let shared = others.shared(&refined);
        (others.on(run, &refined, &shared), Fold { known, rig: refined, shared })
    };
    let all = in_parallel(joint.members.len(), &of);
    let mut out = (Folds(Vec::new()), Vec::new());
    for (across, fold) in all {
        out.1.extend(across);
        out.0.0.push(fold);
    }
    // in the order in which a joint fit lists them: by channel, then by run
    let channels: Vec<&str> = joint.channels();
    out.1.sort_by_key(|a| (channels.iter().position(|c| *c == a.channel), a.run));
    out
}

impl Folds {
    /// Parameters of an effect of the rig. Its error is what all runs together leave, and what leaving out one run after the other moves it by
    /// (jackknife over runs, Efron & Stein 1981, Annals of Statistics 9:586).
    pub(super) fn estimates(&self, joint: &Joint<'_, '_>, rig: &[Placed], k: usize, shared: &[Shared]) -> Vec<Estimate> {
        let mut out = choose::estimates(joint, rig, k, shared);
        let of_fold = |f: &Fold| Some(choose::estimates(joint, &f.rig, f.known.iter().position(|j| *j == k)?, &f.shared));
        let folds: Vec<Vec<Estimate>> = self.0.iter().filter_map(of_fold).collect();
        let n = folds.len().max(1) as f64;
        for (i, e) in out.iter_mut().enumerate() {
            let values: Vec<f64> = folds.iter().filter_map(|f| f.get(i)).map(|f| f.value).collect();
            let mean = values.iter().sum::<f64>() / n;
            let moved = ((n - 1.0) / n * values.iter().map(|v| (v - mean).powi(2)).sum::<f64>()).sqrt();
            e.se = if e.se.is_finite() { e.se.hypot(moved) } else { moved };
        }
        if let Some(member) = joint.members.first() {
            allow_for_the_form(member.context, &mut out);
        }
        out
    }
}
