//! Several recorded runs of one rig in one fit, and what that is worth on a run that took no part.
//!
//! What it is: of every rig with three runs or more, names and values are found on all runs but one, and predict that one; of every rig with
//! two or more, names found on all runs are fitted to all but one.
//! What can go wrong: names that were chosen with the run that they predict flatter themselves; the two tables say which is which.
//! Units: errors in the channel's unit; factors 1.
//! Reference: nested cross-validation, Varma & Simon 2006, BMC Bioinformatics 7:91; specification `closing-the-loop.md`, "Real measurements".

use super::Recorded;
use super::transfer::{Prediction, Transfer, predicted_by};
use ident::channel::Context;
use ident::several::{FEWEST, Outcome, Run, close_together};

/// What several runs together are worth.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Together {
    /// Names and values from all runs but the one that is predicted.
    pub(crate) blind: Transfer,
    /// Names from all runs, values from all but the one that is predicted.
    pub(crate) fitted: Transfer,
}

/// Every rig of a set.
pub(crate) fn of(runs: &[Recorded], progress: &mut dyn FnMut(f64)) -> Together {
    let mut out = Together::default();
    let mut rigs: Vec<&str> = runs.iter().map(|r| r.rig.as_str()).collect();
    rigs.sort_unstable();
    rigs.dedup();
    for (done, rig) in rigs.iter().enumerate() {
        progress(done as f64 / rigs.len() as f64);
        let of_rig: Vec<Run> = runs.iter().filter(|r| r.rig == *rig).filter_map(run).collect();
        if of_rig.len() >= FEWEST {
            out.fitted = out.fitted.and(&fitted(&of_rig));
        }
        if of_rig.len() > FEWEST {
            out.blind = out.blind.and(&blind(&of_rig));
        }
    }
    out
}

fn run(recorded: &Recorded) -> Option<Run> {
    Some(Run { log: recorded.log.clone()?, closed: recorded.closed.as_ref().ok()?.clone() })
}

/// Names from all runs; the errors are the outcome's own.
fn fitted(runs: &[Run]) -> Transfer {
    let outcome = close_together(runs, &mut |_| {});
    let of_run = |(v, context): (&ident::verdict::Validation, &Context)| {
        let prediction = |(name, b): (&String, &ident::verdict::BeforeAfter)| {
            let target = &context.targets[context.target(name)?];
            let (channel, floor) = (target.name, target.noise.rms);
            Some(Prediction { from: "the others".into(), on: v.run.clone(), channel, floor, before: b.before, after: b.after })
        };
        v.channels.iter().filter_map(prediction).collect::<Vec<_>>()
    };
    let predictions = outcome.verdict.runs.iter().zip(&outcome.contexts).flat_map(of_run).collect();
    Transfer { rigs: 1, predictions, names: (0, 0) }
}

/// Names and values from all runs but one each.
fn blind(runs: &[Run]) -> Transfer {
    let mut out = Transfer { rigs: 1, ..Transfer::default() };
    let mut sets: Vec<Vec<String>> = Vec::new();
    for (k, left_out) in runs.iter().enumerate() {
        let others: Vec<Run> = runs.iter().enumerate().filter(|(j, _)| *j != k).map(|(_, r)| r.clone()).collect();
        let outcome = close_together(&others, &mut |_| {});
        let predicted = predicted_by([&outcome.declared, &outcome.model], &left_out.log);
        out.predictions.extend(predicted.into_iter().map(|p| Prediction {
            from: "all but it".into(),
            on: left_out.closed.verdict.run.trim_end_matches(".csv").to_owned(),
            ..p
        }));
        sets.push(names(&outcome));
    }
    for (k, own) in sets.iter().enumerate() {
        for other in sets.iter().enumerate().filter(|(j, _)| *j != k).map(|(_, o)| o) {
            out.names.0 += own.iter().filter(|n| other.contains(n)).count();
            out.names.1 += own.len();
        }
    }
    out
}

/// Effects of the rig, with the channel that each is quoted for.
fn names(outcome: &Outcome) -> Vec<String> {
    outcome.model.effects.iter().map(|e| format!("{} {}", e.placed.effect.id(), e.placed.instance.channels.join(" "))).collect()
}
