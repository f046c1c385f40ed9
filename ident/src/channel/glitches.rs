//! Single rows that hold absurd values.
//!
//! What it is: readings that leave their neighbours by many times the scatter and come back: no prediction makes a claim about them.
//! What can go wrong: rows near a jump of the load are spared, and so are one glitch alone and glitches on more than a twentieth of the rows.
//! Units: the channel's.
//! Reference: Hampel identifier, Pearson 2002.

use super::lattice;
use super::{Context, Relation, Target};
use crate::numeric::chance::gathers;
use crate::numeric::order::median;

/// Departure from the running median, in robust standard deviations, from which a row is absurd.
const FAR: f64 = 15.0;
/// Rows before and after, whose scatter counts too.
const AROUND: usize = 10;
/// The same as a share of the channel's span.
const WIDE: f64 = 0.02;
/// Readings beyond these shares of the speed are absurd: no pulse too few or too many.
pub(crate) const PULSES: std::ops::Range<f64> = 0.3..2.5;

/// Takes out what is near steps of the load, where more is than chance brings there: it belongs to the rotor.
fn without_recurring(context: &Context, target: &Target, glitches: &mut Vec<(usize, f64)>) {
    let there = |g: &(usize, f64)| moving(context, g.0);
    let hits = glitches.iter().filter(|g| there(g)).count();
    if hits < 2 {
        return;
    }
    let share = target.rows.iter().filter(|row| moving(context, **row)).count() as f64 / target.rows.len() as f64;
    if gathers(hits, glitches.len(), share) {
        glitches.retain(|g| !there(g));
    }
}

/// Rows of a channel about which nothing is claimed: its glitches, where they are two at the least and fewer than one in twenty.
/// The log alone decides, so that they are the same before and after, whatever is named.
pub(crate) fn unclaimed(context: &Context, target: &Target) -> Vec<usize> {
    let found = glitches(context, target);
    let few = !target.relation.is_evidence() && found.len() >= 2 && found.len() * 20 < target.rows.len();
    if few { found.into_iter().map(|g| g.0).collect() } else { Vec::new() }
}

/// Whether the load stepped within a second of a row: what stays within the channel's span there may be a transient.
fn moving(context: &Context, row: usize) -> bool {
    let near = |i: &usize| (context.t[*i] - context.t[row]).abs() <= 1.0;
    let (from, to) =
        ((0..row).rev().take_while(near).last().unwrap_or(row), (row..context.len()).take_while(near).last().unwrap_or(row));
    let largest_step = |x: &[f64]| x.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max);
    match &context.pulse {
        Some(pulse) => largest_step(&pulse[from..=to]) > 5.0,
        None if context.rpm.is_empty() => false,
        None => largest_step(&context.rpm[from..=to]) > 0.02 * context.rpm.iter().copied().fold(0.0, f64::max),
    }
}

/// Rows that hold a glitch, with their departure from the running median of five.
pub(crate) fn glitches(context: &Context, target: &Target) -> Vec<(usize, f64)> {
    let y = &target.y;
    if y.len() < 50 {
        return Vec::new();
    }
    let middle = |k: usize| median(&mut y[k - 2..=k + 2].to_vec());
    let departures: Vec<f64> = (2..y.len() - 2).map(|k| y[k] - middle(k)).collect();
    let mut sizes: Vec<f64> = departures.iter().map(|d| d.abs()).collect();
    // a coarse reading toggles between its own steps, most of the time not at all
    let scatter = (1.4826 * median(&mut sizes)).max(lattice::step(target).map_or(0.0, |step| 0.5 * step));
    let mut sorted = y.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let span = sorted[sorted.len() * 99 / 100] - sorted[sorted.len() / 100];
    let least = (FAR * scatter).max(WIDE * span);
    let speed = matches!(target.relation, Relation::SpeedFromPulse | Relation::SpeedAlone);
    // where its neighbours scatter as well, as in a resonance, a reading is not isolated
    let around = |k: usize| &departures[(k - 2).saturating_sub(AROUND)..(k - 1 + AROUND).min(departures.len())];
    let isolated = |k: usize, d: f64| {
        let mut near: Vec<f64> = around(k).iter().map(|d| d.abs()).collect();
        d.abs() > FAR * 1.4826 * median(&mut near)
    };
    let absurd = |k: usize, d: f64| {
        let share = y[k] / (y[k] - d);
        d.abs() > least
            && isolated(k, d)
            && !(speed && PULSES.contains(&share))
            && (d.abs() > span || !moving(context, target.rows[k]))
    };
    let found = departures.iter().enumerate().filter(|(k, d)| absurd(k + 2, **d));
    let mut found: Vec<(usize, f64)> = found.map(|(k, d)| (target.rows[k + 2], *d)).collect();
    without_recurring(context, target, &mut found);
    found
}
