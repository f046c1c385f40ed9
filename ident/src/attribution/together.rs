//! Two or three effects that show only together.
//!
//! What it is: where one effect alone leaves most of the residual as coloured as it was, few of its samples count as independent and no
//! single name brings enough evidence. A battery's resistance, its lag and its charge are such. Here the most promising ones each get a second
//! effect beside them on the same channels, and a third, and the group is judged as one.
//! What can go wrong: a group has many parameters and fits much; it must predict held-out rows clearly better, each of its effects must
//! be needed, and the nameless function still stands against it.
//! Units: evidence in nats.
//! Reference: forward selection misses jointly significant sets, Miller 2002, Subset Selection in Regression, section 3.2.

use crate::attribution::evidence::{Candidate, evidence_over};
use crate::attribution::round::{Scanned, loud, round_of};
use crate::channel::{Context, Relation};
use crate::effects::NEEDED_EVIDENCE;
use crate::fit::heldout::{self, Held};
use crate::fit::search::refine;
use crate::fit::{Fit, Rows, fit, scatters};
use crate::model::Declared;

/// Firsts of a group that are tried.
const FIRSTS: usize = 3;
/// Seconds and thirds whose shapes are refined: twice those that are kept.
const OF_A_FIRST: usize = 4;
/// Share of the held-out error on one of its channels that each of a group must remove.
const NEEDED_OF_EACH: f64 = 0.2;
/// Held-out error over the noise floor, root mean square and typical, below which no group can take so much away: bare noise leaves
/// 1.00 and 0.84, which would have to be four fifths of what there is; a tenth is allowed for a floor that was estimated too high.
const ROOM: (f64, f64) = (1.12, 0.94);

/// What a search stands on.
#[derive(Clone, Copy)]
pub(crate) struct Ground<'g> {
    pub context: &'g Context,
    pub declared: Declared<'g>,
    /// The declared model as it fits.
    pub start: &'g Fit,
    /// Rows that are left out together.
    pub folds: &'g [Vec<bool>],
}

/// The best group of at most `most` effects that stands up beside what was found already (with its held-out errors), and its own held-out
/// errors.
pub(crate) fn choose_together(
    ground: Ground<'_>,
    (best, before): (&Candidate, &[Held]),
    singles: &[Candidate],
    offers: &mut [&mut Scanned],
    most: usize,
    progress: &mut dyn FnMut(f64),
) -> Option<(Candidate, Vec<Held>)> {
    let Ground { context, declared, start, .. } = ground;
    let left = loud(context, declared, &best.fit);
    let has_room: Vec<bool> = context
        .targets
        .iter()
        .zip(left.iter().zip(before))
        .map(|(t, (loud, held))| {
            let bare = held.rms <= ROOM.0 * t.noise.rms && held.typical <= ROOM.1 * t.noise.rms;
            *loud && !bare && !t.relation.is_evidence()
        })
        .collect();
    let could_help = |c: &Candidate| {
        let newest = c.fit.placed.last();
        context.targets.iter().zip(&has_room).any(|(t, room)| *room && newest.is_some_and(|n| n.instance.touches(t.name)))
    };
    let mut firsts: Vec<&Candidate> = singles.iter().filter(|c| could_help(c)).collect();
    let taken = |c: &Candidate| most_taken(context, &has_room, &c.fit, &best.fit);
    firsts.sort_by(|a, b| taken(b).total_cmp(&taken(a)));
    let mut seen: Vec<&str> = Vec::new();
    firsts.retain(|c| {
        let id = c.fit.placed.last().map_or("", |p| p.effect.id());
        let new = !seen.contains(&id);
        seen.push(id);
        new
    });
    let mut groups: Vec<Candidate> = Vec::new();
    let whole = |c: Candidate| Candidate { evidence: evidence_over(context, &c.fit, start), ..c };
    let rounds = (FIRSTS + 1) as f64;
    for (k, first) in firsts.into_iter().take(FIRSTS).enumerate() {
        let pairs = beside(context, declared, first, offers, &mut |p| progress((k as f64 + p) / rounds));
        groups.extend(pairs.into_iter().take(2).map(whole));
    }
    // a third effect stands beside the most promising pair
    let third = groups.iter().max_by(|a, b| a.evidence.total_cmp(&b.evidence)).filter(|_| most > 2).cloned();
    let thirds = third.map(|pair| beside(context, declared, &pair, offers, &mut |p| progress((FIRSTS as f64 + p) / rounds)));
    groups.extend(thirds.into_iter().flatten().take(1).map(whole));
    offers.iter_mut().for_each(|o| o.found = None);
    let known = if best.fit.placed.is_empty() { 0.0 } else { evidence_over(context, &best.fit, start) };
    let beyond = |c: &Candidate| c.evidence - known - NEEDED_EVIDENCE * (c.fit.placed.len() - best.fit.placed.len()) as f64;
    groups.retain(|g| beyond(g) > 0.0);
    groups.sort_by(|a, b| beyond(b).total_cmp(&beyond(a)));
    // one that has an effect too many leaves the place to the next
    groups.into_iter().find_map(|group| stands(ground, (best, before), &group).map(|held| (group, held)))
}

/// What joins a candidate on the channels of its newest effect, best first: what shows only together shares a channel, and a round
/// scans that anew.
fn beside(
    context: &Context,
    declared: Declared<'_>,
    first: &Candidate,
    offers: &mut [&mut Scanned],
    progress: &mut dyn FnMut(f64),
) -> Vec<Candidate> {
    let newest = first.fit.placed.last();
    let shares = |o: &Scanned| newest.is_some_and(|n| o.instance.channels.iter().any(|c| n.instance.touches(c)));
    let mut near: Vec<&mut Scanned> = offers.iter_mut().map(|o| &mut **o).filter(|o| shares(o)).collect();
    round_of(context, declared, first, (&mut near, OF_A_FIRST), progress)
}

/// The held-out errors of a group beside what was found already; nothing where one of its effects is not needed.
fn stands(ground: Ground<'_>, (best, before): (&Candidate, &[Held]), group: &Candidate) -> Option<Vec<Held>> {
    let Ground { context, declared, start, folds } = ground;
    let held = heldout::errors(context, declared, &group.fit, folds);
    let helps = |less: &[Held], position: usize| {
        let touched = context.targets.iter().enumerate().filter(|(_, t)| group.fit.placed[position].instance.touches(t.name));
        touched.map(|(i, _)| held[i].share_gone(&less[i])).fold(0.0, f64::max) > NEEDED_OF_EACH
    };
    let mut new = best.fit.placed.len()..group.fit.placed.len();
    let needed = |k: usize| {
        without(context, declared, &group.fit, k, start)
            .is_some_and(|f| helps(&heldout::errors(context, declared, &f, folds), k) && helps(before, k))
    };
    new.all(needed).then_some(held)
}

/// The largest gain in likelihood a reading of one of the channels that have room: the logarithm of the factor by which a fit makes its error
/// smaller, whatever the colour and the number of its readings.
fn most_taken(context: &Context, has_room: &[bool], fit: &Fit, before: &Fit) -> f64 {
    let targets = context.targets.iter().zip(has_room).zip(fit.targets.iter().zip(&before.targets));
    targets
        .filter(|((_, room), _)| **room)
        .map(|((t, _), (new, old))| {
            let scattering = t.relation == Relation::Thrust && scatters(&fit.placed, t.name);
            (new.loglik.of(scattering) - old.loglik.of(scattering)) / (t.weight * t.rows.len() as f64)
        })
        .fold(0.0, f64::max)
}

/// A hypothesis without its `k`-th effect, its shapes refined again.
pub(crate) fn without(context: &Context, declared: Declared<'_>, fit_all: &Fit, k: usize, start: &Fit) -> Option<Fit> {
    let mut placed = fit_all.placed.clone();
    placed.remove(k);
    let placed = refine(context, declared, &placed, Rows::All, 60);
    fit(context, declared, &placed, Some(start), Rows::All)
}
