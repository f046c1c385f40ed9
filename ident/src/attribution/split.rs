//! One effect on several channels, or one of its own on each.
//!
//! What it is: two meters that are both slow may be named as one slow amplifier before them. Where each with a time of its own explains clearly
//! more, each has its own: what is left of the wrong time would need another name.
//! What can go wrong: an effect that the library has on all of its channels only stays as it is.
//! Units: evidence in nats.
//! Reference: Schwarz 1978 (penalty).

use crate::attribution::evidence::{Candidate, evidence_counted, shares};
use crate::attribution::places::may_join;
use crate::attribution::revise::{CLEARLY_BETTER, Round, predicts_as_well};
use crate::attribution::round::Scanned;
use crate::channel::Context;
use crate::effects::placed::Placed;
use crate::fit::search::{base, refine, scan};
use crate::fit::{Fit, Rows, fit, plausible};
use crate::model::Declared;

/// Gives each channel of a shared effect one of its own, wherever that is clearly better. What was named beside it on these channels may have stood
/// for the difference, and goes where it is better without. `rounds` follows.
pub(crate) fn split(
    (context, declared, start): (&Context, Declared<'_>, &Fit),
    folds: &[Vec<bool>],
    best: &mut Candidate,
    rounds: &mut Vec<Round>,
    offers: &[Scanned],
) {
    for k in (0..best.fit.placed.len()).rev() {
        // what every rig has is one thing, seen on all that it acts on
        let is_shared = |p: &&Placed| p.instance.channels.len() > 1 && !p.effect.is_of_every_rig();
        let Some(shared) = best.fit.placed.get(k).filter(is_shared) else { continue };
        let parts = shared.instance.channels.len();
        let beside = |p: &Placed| p.instance.channels.iter().all(|c| shared.instance.touches(c));
        let one = (0..best.fit.placed.len()).filter(|j| *j != k && beside(&best.fit.placed[*j])).map(Some);
        let tried = std::iter::once(None).chain(one).filter_map(|goes| {
            let fitted = one_on_each((context, declared, start), &best.fit, (k, goes), offers)?;
            let shares = shares(context, [&fitted, &best.fit].into_iter());
            let evidence = |of: &Fit| evidence_counted(context, of, start, &shares);
            Some((goes, evidence(&fitted) - evidence(&best.fit), fitted))
        });
        let Some((goes, gain, fitted)) = tried.max_by(|a, b| a.1.total_cmp(&b.1)) else { continue };
        if gain > CLEARLY_BETTER && predicts_as_well(context, declared, folds, &fitted, &best.fit) {
            *best = Candidate { evidence: best.evidence + gain, fit: fitted };
            let round = rounds[k].clone();
            rounds.splice(k..=k, std::iter::repeat_n(round, parts));
            if let Some(goes) = goes {
                rounds.remove(if goes > k { goes + parts - 1 } else { goes });
            }
        }
    }
}

/// The hypothesis with its `k`-th effect once for each of its channels, and without another one.
fn one_on_each(
    (context, declared, start): (&Context, Declared<'_>, &Fit),
    whole: &Fit,
    (k, goes): (usize, Option<usize>),
    offers: &[Scanned],
) -> Option<Fit> {
    let (shared, loud) = (&whole.placed[k], vec![true; context.targets.len()]);
    let stays = |j: &usize| *j != k && Some(*j) != goes;
    let mut placed: Vec<Placed> = (0..whole.placed.len()).filter(stays).map(|j| whole.placed[j].clone()).collect();
    let from = k - usize::from(goes.is_some_and(|j| j < k));
    for (part, channel) in shared.instance.channels.iter().enumerate() {
        let is_own = |o: &&Scanned| o.effect.id() == shared.effect.id() && o.instance.channels == [channel.clone()];
        let own = offers.iter().filter(is_own).filter(|o| may_join(context, &placed, o.effect, &o.instance));
        let base = base(context, declared, &placed);
        let scanned = own.filter_map(|o| Some((o, scan(context, &base, o.effect, &o.instance, &loud)?)));
        let (offer, (shape, _)) = scanned.max_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
        let own = Placed { effect: offer.effect, instance: offer.instance.clone(), shape };
        placed.insert(from + part, own);
    }
    let placed = refine(context, declared, &placed, Rows::All, 120);
    let fitted = fit(context, declared, &placed, Some(start), Rows::All)?;
    plausible(context, declared, &fitted).then_some(fitted)
}
