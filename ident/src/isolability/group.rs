//! Causes that stay alike.
//!
//! What it is: two causes are alike where one of them is named and yet not told from the other at any size that was tried; groups are what that connects.
//! What can go wrong: a chain of likenesses makes a group whose ends may well be told apart; the matrix has the pairs.
//! Units: none.
//! Reference: equivalence classes of faults, Krysander & Frisk 2008, IEEE Trans. SMC-A 38:1183.

use super::climb::Climbed;
use super::{Apart, Cause};
use crate::channel::Context;
use crate::experiment::{between, model_of};
use crate::model::Declared;
use crate::verdict::NextExperiment;

/// Causes that stay alike on this schedule.
#[derive(Debug, Clone)]
pub struct Group {
    /// Positions in the list of causes.
    pub members: Vec<usize>,
    /// The run that would tell the first pair of them apart.
    pub next: Option<NextExperiment>,
}

impl Group {
    /// The same for a list in another order: `order` names the old position at each new one.
    pub(crate) fn in_order(mut self, order: &[usize]) -> Self {
        let at = |old: usize| order.iter().position(|k| *k == old).unwrap_or(old);
        self.members = self.members.into_iter().map(at).collect();
        self.members.sort_unstable();
        self
    }
}

/// The groups, largest first.
pub(crate) fn groups(context: &Context, causes: &[Cause], climbed: &[Climbed]) -> Vec<Group> {
    let alike = |a: usize, b: usize| stay_alike(causes, climbed, a, b) || stay_alike(causes, climbed, b, a);
    let mut free: Vec<bool> = vec![true; causes.len()];
    let mut out: Vec<Group> = Vec::new();
    for first in 0..causes.len() {
        if !std::mem::take(&mut free[first]) {
            continue;
        }
        let mut members = vec![first];
        let mut at = 0;
        while at < members.len() {
            for (k, free) in free.iter_mut().enumerate() {
                if *free && alike(members[at], k) {
                    *free = false;
                    members.push(k);
                }
            }
            at += 1;
        }
        if members.len() > 1 {
            out.push(Group { next: next(context, causes, climbed, &members), members });
        }
    }
    out.sort_by_key(|g| std::cmp::Reverse(g.members.len()));
    out
}

/// Whether one cause that is named is not told from another one at any size. What is never named shows too little to be like anything.
fn stay_alike(causes: &[Cause], climbed: &[Climbed], a: usize, b: usize) -> bool {
    causes[a].seen.is_some() && causes[a].apart[b] == Apart::Never && climbed[a].stays_alike(&causes[b].name)
}

/// The run on which two members of a group differ most: the first pair that stood side by side.
fn next(context: &Context, causes: &[Cause], climbed: &[Climbed], members: &[usize]) -> Option<NextExperiment> {
    let pairs = members.iter().flat_map(|a| members.iter().map(move |b| (*a, *b)));
    let alike = pairs.filter(|(a, b)| stay_alike(causes, climbed, *a, *b));
    alike.into_iter().find_map(|(a, b)| {
        let (own, other) = climbed[a].side_by_side(&causes[b].name)?;
        let models = [own, other].map(|c| model_of(context, Declared::default(), &c.fit));
        between(context, &models[0], &models[1], &[causes[a].name.clone(), causes[b].name.clone()])
    })
}
