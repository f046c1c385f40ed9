//! What the rig has on its runs, but of another size on each: a lead that was exchanged.
//!
//! What it is: an effect of the rig that stands on two runs and more is tried with one size for all and with a size of its own on each. Where that of
//! the others leaves most runs off by more than half, and their own leaves them quiet, the size belongs to the run.
//! What can go wrong: a run that is loud for other reasons tells nothing; the effect stays the rig's.
//! Units: noise floors.
//! Reference: random effects against fixed ones, Laird & Ware 1982, Biometrics 38:963; specification `formats.md`, "Scope".

use super::joint::{Across, Joint};
use super::{FEWEST, Member};
use crate::beside::is_named;
use crate::close::Closed;
use crate::context::is_contrast;
use crate::effects::Scope;
use crate::hypothesis::Placed;
use crate::unexplained::LOUD;

/// The effects whose size differs from run to run, as each run has them.
pub(super) fn found(runs: &[&Closed], members: &[Member<'_>]) -> Vec<Vec<Placed>> {
    let mut out: Vec<Vec<Placed>> = vec![Vec::new(); runs.len()];
    let of_run =
        |run: &&Closed| -> Vec<Placed> { run.diagnosis.best.fit.placed.iter().filter(|p| is_of_rig(p)).cloned().collect() };
    let all: Vec<Vec<Placed>> = runs.iter().map(of_run).collect();
    let mut asked: Vec<Placed> = Vec::new();
    for p in all.iter().flatten() {
        if asked.iter().any(|a| is_same(a, p)) {
            continue;
        }
        asked.push(p.clone());
        let each: Vec<Option<Placed>> = all.iter().map(|run| run.iter().find(|q| is_same(q, p)).cloned()).collect();
        if each.iter().flatten().count() >= FEWEST && differs(runs, members, p, &each) {
            out.iter_mut().zip(each).for_each(|(own, p)| own.extend(p));
        }
    }
    out
}

/// Whether an effect has one name and one form on two runs.
pub(super) fn is_same(a: &Placed, b: &Placed) -> bool {
    a.effect.id() == b.effect.id() && a.instance == b.instance
}

fn is_of_rig(p: &Placed) -> bool {
    is_named(p) && !p.effect.is_of_every_rig() && p.effect.scope(&p.instance) == Scope::Rig
}

/// Share of what a run is off by without the effect that the others' size leaves, from which on theirs is nearer to none than to its own.
const HALF: f64 = 0.5;

/// Whether, on most of the runs that have it, the run alone left a channel quiet that the size of the other runs leaves loud, and off by more
/// than half.
fn differs(runs: &[&Closed], members: &[Member<'_>], p: &Placed, each: &[Option<Placed>]) -> bool {
    let joint = Joint::of(members);
    let channels: Vec<&'static str> = joint.channels().into_iter().filter(|c| p.instance.touches(c) && !is_contrast(c)).collect();
    let was_quiet = |a: &Across| {
        let alone = runs[a.run].verdict.channels.get(a.channel);
        alone.is_some_and(|c| c.after.heldout_rms <= LOUD * c.noise_floor_rms)
    };
    let none = joint.across(&[], Some(&channels));
    let is_far = |a: &Across| {
        let without = none.iter().find(|n| n.run == a.run && n.channel == a.channel);
        a.rms > LOUD * a.floor && without.is_none_or(|n| a.rms > HALF * n.rms)
    };
    let theirs = joint.across(std::slice::from_ref(p), Some(&channels));
    let far = |run: usize| theirs.iter().any(|a| a.run == run && is_far(a) && was_quiet(a));
    let has: Vec<usize> = (0..each.len()).filter(|run| each[*run].is_some()).collect();
    2 * has.iter().filter(|run| far(**run)).count() > has.len()
}
