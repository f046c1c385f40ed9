//! From the residual to its cause.
//!
//! What it is: every effect of the library is fitted to the log, alone and added to what was found already (`round`); the winner must
//! pay for its parameters, predict held-out rows better, and make physical sense (`choose`); a flexible opponent without a name stands
//! against it. Then every name is asked again beside all others (`revise`, `standing`), and how sure it is (`sure`).
//! What can go wrong: on a schedule that cannot tell two effects apart the verdict is `ambiguous`; where only the opponent
//! explains the residual it is `unattributed`.
//! Units: evidence in nats.
//! Reference: specification `closing-the-loop.md`; forward selection with exchange, Miller 2002, Subset Selection in Regression, chapter 3.

use crate::attribution::choose::choose;
use crate::attribution::evidence::{Candidate, evidence_over};
use crate::attribution::places::{MOST_EFFECTS, of_this_rig};
use crate::attribution::revise::{Round, revise};
use crate::attribution::rivals::{RIVAL, Rival};
use crate::attribution::round::{REFINED, Scanned, offers, round_of};
use crate::attribution::standing::{Settled, Standing};
use crate::attribution::sure::{Sureness, sureness};
use crate::attribution::together::{Ground, choose_together};
use crate::channel::{Context, Target};
use crate::effects::acquisition::sample_hold::{self, SampleHold};
use crate::effects::placed::Placed;
use crate::effects::{Estimate, NEEDED_EVIDENCE};
use crate::fit::heldout::{self, Held};
use crate::fit::{Fit, Rows, fit};
use crate::model::Declared;

/// Share of the work that the rounds of the search are told to be at the most.
const LATE: f64 = 0.95;
/// Candidates of a round that are kept for those who want to look.
const SHOWN: usize = 10;
/// Share of the winner's probability from which on a rival of an ambiguous verdict must be considered.
const CONSIDERED: f64 = 0.1;

/// Probability below which a verdict is ambiguous although no single rival comes close.
const UNSURE: f64 = 0.6;

/// What the search found.
#[derive(Debug, Clone)]
pub struct Diagnosis {
    /// The declared model's fit.
    pub declared: Fit,
    /// The winner; its `placed` is empty when nothing is there.
    pub best: Candidate,
    /// Its probability.
    pub probability: f64,
    /// For each effect of the winner the probability of its being there: that of all hypotheses together that hold it.
    pub inclusion: Vec<f64>,
    /// Other hypotheses, most probable first.
    pub rivals: Vec<Rival>,
    /// Something is there, and nothing of it has a name.
    pub unknown: bool,
    /// Held-out errors of the declared model, by target.
    pub heldout_before: Vec<Held>,
    /// Held-out errors of the winner, by target.
    pub heldout_after: Vec<Held>,
    /// For each effect of the winner the held-out errors without it, by target.
    pub heldout_without: Vec<Vec<Held>>,
    /// For each effect of the winner its parameters, as they are reported.
    pub estimates: Vec<Vec<Estimate>>,
    /// The folds.
    pub folds: Vec<Vec<bool>>,
    /// For each round of the search its best candidates, each what was found before and one effect more, best first.
    pub candidates: Vec<Vec<Candidate>>,
}

impl Diagnosis {
    /// Whether the verdict stands for an effect of the winner: where two hypotheses explain the residual about equally well, it stands for what
    /// they share. A rival that is a tenth as probable as the winner is one of them.
    #[must_use]
    pub fn claims(&self, position: usize) -> bool {
        let ids = self.best.names();
        let Some(id) = ids.get(position) else { return false };
        let count = |of: &[String]| of.iter().filter(|i| *i == id).count();
        let shares = |rival: &Rival| {
            if rival.ids.len() == ids.len() { rival.ids[position] == *id } else { count(&rival.ids) >= count(&ids) }
        };
        !self.ambiguous() || self.rivals.iter().filter(|r| r.probability > CONSIDERED * self.probability).all(shares)
    }

    /// Whether two hypotheses explain the residual about equally well.
    #[must_use]
    pub fn ambiguous(&self) -> bool {
        !self.unknown
            && !self.best.fit.placed.is_empty()
            && self
                .rivals
                .first()
                .is_some_and(|r| r.probability >= RIVAL * self.probability || self.probability < UNSURE && r.probability > 0.05)
    }
}

/// Runs the search. `progress` hears a share of the work done, 0 to 1.
#[must_use]
pub fn diagnose(context: &Context, declared: Declared<'_>, progress: &mut dyn FnMut(f64)) -> Option<Diagnosis> {
    let start = fit(context, declared, &[], None, Rows::All)?;
    let folds = heldout::folds(context);
    let heldout_before = heldout::errors(context, declared, &start, &folds);
    let ground = Ground { context, declared, start: &start, folds: &folds };
    let mut all = offers(context);
    let mut offers: Vec<&mut Scanned> = all.iter_mut().collect();
    let mut found = begun(ground, &heldout_before);
    found.search(ground, &mut offers, progress);
    found.look_again(ground, &mut offers);
    let singles = found.candidates.first().map_or(&[][..], Vec::as_slice);
    let mut standing = Standing::of(found.best, found.errors, found.rounds);
    let contested = standing.take_back(ground, &heldout_before)?;
    let Settled { without: heldout_without, estimates } = standing.settle(ground, &heldout_before, &contested)?;
    let Sureness { probability, unknown } = sureness(ground, &mut standing, &estimates, singles);
    progress(1.0);
    let Standing { best, errors: heldout_after, inclusion, rivals } = standing;
    Some(Diagnosis {
        best,
        probability,
        inclusion,
        rivals,
        unknown,
        heldout_before,
        heldout_after,
        heldout_without,
        estimates,
        candidates: found.candidates,
        declared: start,
        folds,
    })
}

/// What the search has found so far.
struct Found {
    /// The best hypothesis.
    best: Candidate,
    /// Its held-out errors, by target.
    errors: Vec<Held>,
    /// For each of its effects how it stands, and what came close to it.
    rounds: Vec<Round>,
    /// For each round its best candidates.
    candidates: Vec<Vec<Candidate>>,
}

/// What stands before the search: what the readings show by themselves.
fn begun(ground: Ground<'_>, before: &[Held]) -> Found {
    let Ground { context, declared, start, folds } = ground;
    let mut best = Candidate { fit: start.clone(), evidence: 0.0 };
    tare(context, declared, start, &mut best);
    hold(context, declared, start, &mut best);
    let rounds: Vec<Round> = best.fit.placed.iter().map(|_| (1.0, Vec::new())).collect();
    let errors = if rounds.is_empty() { before.to_vec() } else { heldout::errors(context, declared, &best.fit, folds) };
    Found { best, errors, rounds, candidates: Vec::new() }
}

impl Found {
    /// Lets names join one at a time, and once several together, until none deserves a place.
    fn search(&mut self, ground: Ground<'_>, offers: &mut [&mut Scanned], progress: &mut dyn FnMut(f64)) {
        let Ground { context, declared, folds, .. } = ground;
        let share = |round: usize| (round as f64 / (MOST_EFFECTS as f64 + 1.0)).min(LATE);
        let (mut round, mut together) = (0, false);
        while of_this_rig(context, &self.best.fit.placed) < MOST_EFFECTS {
            let (begun, done) = (share(round), share(round + 1));
            round += 1;
            let mut heard = |p: f64| progress(begun + p * (done - begun));
            let ranked = round_of(context, declared, &self.best, (&mut *offers, REFINED), &mut heard);
            self.candidates.push(ranked.iter().take(SHOWN).cloned().collect());
            if let Some(chosen) = choose(context, declared, &ranked, &self.best, &self.errors, folds) {
                (self.best, self.errors) = (chosen.winner, chosen.held);
                self.rounds.push((chosen.probability, chosen.rivals));
                continue;
            }
            let room = MOST_EFFECTS - of_this_rig(context, &self.best.fit.placed);
            if together || room < 2 {
                return;
            }
            let mut heard = |p: f64| progress(done + 0.9 * p * (1.0 - done));
            let group = choose_together(ground, (&self.best, &self.errors), &ranked, offers, room, &mut heard);
            let Some((group, held)) = group else { return };
            self.rounds.resize(self.rounds.len() + group.fit.placed.len() - self.best.fit.placed.len(), (1.0, Vec::new()));
            (self.best, self.errors, together) = (group, held, true);
        }
    }

    /// Asks every name again beside all others. Where some go, names may join once more: what had no place beside one that went may have it beside
    /// those that stayed.
    fn look_again(&mut self, ground: Ground<'_>, offers: &mut [&mut Scanned]) {
        let Ground { context, declared, start, folds } = ground;
        let names = self.rounds.len();
        if names < 2 {
            return;
        }
        revise(context, declared, start, folds, &mut self.best, &mut self.rounds);
        self.errors = heldout::errors(context, declared, &self.best.fit, folds);
        if self.rounds.len() == names {
            return;
        }
        offers.iter_mut().for_each(|o| o.found = None);
        while of_this_rig(context, &self.best.fit.placed) < MOST_EFFECTS {
            let ranked = round_of(context, declared, &self.best, (&mut *offers, REFINED), &mut |_| {});
            let Some(chosen) = choose(context, declared, &ranked, &self.best, &self.errors, folds) else { return };
            (self.best, self.errors) = (chosen.winner, chosen.held);
            self.rounds.push((chosen.probability, chosen.rivals));
        }
    }
}

/// Against a declared model the zeros of the load cell are asked first: it is tared anew before every run, and a zero that is off looks
/// like a change of whatever acts on thrust or torque.
fn tare(context: &Context, declared: Declared<'_>, start: &Fit, best: &mut Candidate) {
    for offer in offers(context) {
        let mut placed = best.fit.placed.clone();
        placed.push(Placed { effect: offer.effect, instance: offer.instance, shape: Vec::new() });
        if !placed.last().is_some_and(Placed::is_tare) {
            continue;
        }
        if let Some(fit) = fit(context, declared, &placed, Some(start), Rows::All) {
            let evidence = evidence_over(context, &fit, start);
            if evidence > best.evidence + NEEDED_EVIDENCE {
                *best = Candidate { fit, evidence };
            }
        }
    }
}

/// A channel whose readings repeat at even intervals holds them, whatever else its meter does: what it holds is sought beneath. A filter that is as
/// wide as the hold would be taken for both.
fn hold(context: &Context, declared: Declared<'_>, start: &Fit, best: &mut Candidate) {
    if context.against_model || context.time_is_row || context.is_table() {
        return;
    }
    let shown = |target: &Target| {
        let (instance, estimates) = sample_hold::by_readings(context, target)?;
        Some(Placed { effect: &SampleHold, instance, shape: estimates.iter().map(|e| e.value).collect() })
    };
    let shown: Vec<Placed> = context.targets.iter().filter(|t| !t.relation.is_evidence()).filter_map(shown).collect();
    let placed: Vec<Placed> = best.fit.placed.iter().cloned().chain(shown).collect();
    if placed.len() > best.fit.placed.len()
        && let Some(fit) = fit(context, declared, &placed, Some(start), Rows::All)
    {
        *best = Candidate { evidence: evidence_over(context, &fit, start), fit };
    }
}
