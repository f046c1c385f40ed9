//! What the rig has on its runs, but of another size on each: a lead that was exchanged.
//!
//! What it is: an effect of the rig that stands on two runs and more is the rig's where its sizes agree. Where on most of these runs its own size
//! is off from the mean of the others' by more than half of itself, and the run alone left the channel quiet, the size belongs to the run.
//! What can go wrong: a run that is loud for other reasons tells nothing; the effect stays the rig's.
//! Units: those of the effect's parameters.
//! Reference: random effects against fixed ones, Laird & Ware 1982, Biometrics 38:963; specification `formats.md`, "Scope".

use super::FEWEST;
use crate::attribution::unexplained::LOUD;
use crate::close::Closed;
use crate::effects::Estimate;
use crate::effects::placed::Placed;
use crate::effects::placed::is_named;
use crate::verdict::Scope;

/// Share of its own size by which a run's may be off from the others' before theirs is nearer to none than to its own.
const HALF: f64 = 0.5;

/// An effect of the rig as one run has it.
struct Own {
    placed: Placed,
    /// Its parameters.
    sizes: Vec<Estimate>,
    /// Whether the run alone left its first channel quiet.
    quiet: bool,
}

/// The effects whose size differs from run to run, as each run has them.
pub(super) fn found(runs: &[&Closed]) -> Vec<Vec<Placed>> {
    let mut out: Vec<Vec<Placed>> = vec![Vec::new(); runs.len()];
    let all: Vec<Vec<Own>> = runs.iter().map(|run| of_run(run)).collect();
    let mut asked: Vec<&Placed> = Vec::new();
    for p in all.iter().flatten().map(|own| &own.placed) {
        if asked.iter().any(|a| a.is_like(p)) {
            continue;
        }
        asked.push(p);
        let each: Vec<Option<&Own>> = all.iter().map(|run| run.iter().find(|own| own.placed.is_like(p))).collect();
        let has: Vec<&Own> = each.iter().flatten().copied().collect();
        if has.len() >= FEWEST && differs(&has) {
            out.iter_mut().zip(each).for_each(|(list, own)| list.extend(own.map(|own| own.placed.clone())));
        }
    }
    out
}

fn of_run(run: &Closed) -> Vec<Own> {
    let of_rig = |p: &Placed| is_named(p) && !p.effect.is_of_every_rig() && p.effect.scope(&p.instance) == Scope::Rig;
    let quiet = |p: &Placed| {
        let first = p.instance.channels.first().and_then(|c| run.verdict.channels.get(c));
        first.is_some_and(|c| c.after.heldout_rms <= LOUD * c.noise_floor_rms)
    };
    let placed = run.diagnosis.best.fit.placed.iter().zip(&run.diagnosis.estimates).filter(|(p, _)| of_rig(p));
    placed
        .map(|(p, found)| Own {
            sizes: p.effect.report(&run.context, &p.instance, found.clone()),
            quiet: quiet(p),
            placed: p.clone(),
        })
        .collect()
}

/// Whether on most runs the size that is known best differs from the others' by more than half of itself.
fn differs(has: &[&Own]) -> bool {
    let known = |e: &Estimate| if e.se > 0.0 { e.value.abs() / e.se } else { 0.0 };
    let best = has[0].sizes.iter().max_by(|a, b| known(a).total_cmp(&known(b)));
    let Some(name) = best.map(|e| e.name.as_str()) else { return false };
    let sizes: Vec<Option<f64>> = has.iter().map(|own| own.sizes.iter().find(|e| e.name == name).map(|e| e.value)).collect();
    let far = |k: usize| {
        let others: Vec<f64> = (0..sizes.len()).filter(|i| *i != k).filter_map(|i| sizes[i]).collect();
        let mean = others.iter().sum::<f64>() / others.len().max(1) as f64;
        has[k].quiet && sizes[k].is_some_and(|own| !others.is_empty() && (own - mean).abs() > HALF * own.abs())
    };
    2 * (0..has.len()).filter(|k| far(*k)).count() > has.len()
}
