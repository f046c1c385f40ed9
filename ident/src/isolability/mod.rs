//! Which causes a schedule can tell apart, and from which size on: before a run is flown as well as after.
//!
//! What it is: every effect that the library offers for the channels of a log is put into it, small and then larger, and the search that gives
//! verdicts is asked what it would say. A row of the matrix is a cause: the size from which on it is named, and from which on it is told from
//! each other one. Causes that stay alike form groups.
//! What can go wrong: one cause at a time, and exactly as the library describes it; a real one is rougher. An effect that is only
//! offered where readings show it (coarse steps, held values, glitches) is not asked about on a log that shows none.
//! Units: noise floors of the cause's main channel, and the unit of its own parameter.
//! Reference: structural isolability, Krysander & Frisk 2008, IEEE Trans. SMC-A 38:1183; distinguishability with noise, Eriksson, Frisk &
//! Krysander 2013, Automatica 49:1591.

mod ask;
mod climb;
mod group;
mod size;
mod words;

pub use climb::FURTHEST;
pub use group::Group;
pub use words::{Standing, short};

use crate::attribution::columns::candidates::LEAST_ANGLE;
use crate::attribution::long::{kept, thinned};
use crate::attribution::round::offers;
use crate::close::{Closed, close};
use crate::effects::library;
use crate::effects::placed::Placed;
use crate::fit::heldout;
use crate::identify::CloseError;
use crate::log::Log;
use crate::model::Declared;
use ask::{Question, Rig, is_one_cause};
use climb::{Climbed, climb};
use size::Line;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;

/// A parameter with its value.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Quantity {
    /// Name, a contract of the verdict file.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Value.
    pub value: f64,
}

/// A size of a cause.
#[derive(Debug, Clone, PartialEq)]
pub struct Size {
    /// Root mean square, in noise floors of the main channel, of what the declared model cannot take up.
    pub floors: f64,
    /// The parameter that grows.
    pub quantity: Quantity,
}

/// How one cause stands to another one.
#[derive(Debug, Clone, PartialEq)]
pub enum Apart {
    /// Both carry one name: another form or channel of it.
    SameName,
    /// They share no channel.
    Elsewhere,
    /// Told apart from this size on.
    From(Size),
    /// Not at any size that was tried.
    Never,
}

impl Cause {
    /// Whether the declared model takes up so much of it that the rest is within what its form is off by (see
    /// [`crate::attribution::columns::candidates::LEAST_ANGLE`]).
    #[must_use]
    pub fn is_hidden(&self) -> bool {
        self.free < LEAST_ANGLE
    }
}

/// A cause that the channels of the log could hold.
#[derive(Debug, Clone)]
pub struct Cause {
    /// Name that is unique in the matrix: the effect, with form and channel where it has several.
    pub name: String,
    /// Identifier of the effect.
    pub id: &'static str,
    /// What it is, in plain words.
    pub title: &'static str,
    /// Channels that it touches.
    pub channels: Vec<String>,
    /// The channel that shows most of it beside the declared model.
    pub main: String,
    /// Share of its squares on that channel that the declared model cannot take up: 1 all, 0 hidden whole.
    pub free: f64,
    /// Parameters that were held: instants, onsets, time constants.
    pub held: Vec<Quantity>,
    /// Size from which on the search names it; `None` where it does at no size.
    pub seen: Option<Size>,
    /// Whether the search could fit it at some size with values that make sense; else nothing is said of it.
    pub sensible: bool,
    /// Largest size that was tried.
    pub tried: Size,
    /// Towards each cause of the list, in its order.
    pub apart: Vec<Apart>,
}

/// The matrix.
#[derive(Debug, Clone)]
pub struct Isolability {
    /// Name of the log or scenario.
    pub run: String,
    /// Rows, and length in s.
    pub rows: usize,
    /// Length, s; nothing where the rows have no time.
    pub duration_s: Option<f64>,
    /// Measured channels with their noise floors and units.
    pub channels: Vec<(String, f64, &'static str)>,
    /// The causes, those that are named at the smallest size first.
    pub causes: Vec<Cause>,
    /// Causes that stay alike, largest group first.
    pub groups: Vec<Group>,
    /// Effects that the channels of the log cannot hold, or that readings must show first.
    pub not_offered: Vec<&'static str>,
    /// What the search names on the log as it is: it stays in the log, beside every cause but itself.
    pub found: Vec<String>,
}

impl Isolability {
    /// How long the run is: its rows, and their time where they have one.
    #[must_use]
    pub fn length(&self) -> String {
        let time = self.duration_s.map_or_else(|| " without a time".to_owned(), |s| format!(" in {s:.0} s"));
        format!("{} rows{time}", self.rows)
    }
}

/// Asks about every cause. `progress` hears a share of the work done, 0 to 1.
///
/// # Errors
/// [`CloseError`] when no channel can be fitted.
pub fn isolability(log: &Log, progress: &mut dyn FnMut(f64)) -> Result<Isolability, CloseError> {
    let few = kept(log).map(|rows| thinned(log, &rows));
    let closed = close(few.as_ref().unwrap_or(log), None, &[], &mut |p| progress(0.05 * p))?;
    let rig = rig_of(closed);
    let named = causes_of(&rig);
    let names: Vec<(String, Placed)> = named.iter().map(|(name, line)| (name.clone(), line.placed(1.0))).collect();
    let climbed = all(&rig, &named, &names, &mut |p| progress(0.05 + 0.95 * p));
    let mut causes: Vec<Cause> = (0..named.len()).map(|k| cause(&rig, &named[k].1, &climbed[k], &names, k)).collect();
    let groups = group::groups(&rig.context, &causes, &climbed);
    let order = order(&causes);
    let groups = groups.into_iter().map(|g| g.in_order(&order)).collect();
    causes.iter_mut().for_each(|c| c.apart = order.iter().map(|k| c.apart[*k].clone()).collect());
    let causes: Vec<Cause> = order.iter().map(|k| causes[*k].clone()).collect();
    let not_offered = library().iter().map(|e| e.id()).filter(|id| causes.iter().all(|c| c.id != *id)).collect();
    let context = &rig.context;
    let channels = context.targets.iter().filter(|t| !t.relation.is_evidence());
    Ok(Isolability {
        run: log.name.clone(),
        rows: log.len(),
        duration_s: (!context.time_is_row).then(|| context.duration()),
        channels: channels.map(|t| (t.name.to_owned(), t.noise.rms, crate::channel::unit_of(t.name))).collect(),
        causes,
        groups,
        not_offered,
        found: rig.found,
    })
}

fn rig_of(closed: Closed) -> Rig {
    let best = &closed.diagnosis.best;
    Rig {
        noise: heldout::residuals(&closed.context, Declared::default(), &best.fit),
        found: best.names(),
        folds: closed.diagnosis.folds.clone(),
        best: closed.diagnosis.best.fit,
        context: closed.context,
    }
}

/// The causes that the log could hold, each with its name: the first way in which each may be there.
fn causes_of(rig: &Rig) -> Vec<(String, Line)> {
    let mut lines: Vec<(Placed, Line)> = Vec::new();
    for offer in offers(&rig.context) {
        let new = Placed { effect: offer.effect, instance: offer.instance.clone(), shape: Vec::new() };
        if lines.iter().any(|(p, _)| is_one_cause(p, &new)) {
            continue;
        }
        lines.extend(Line::new(&rig.context, &rig.best, offer.effect, offer.instance).map(|line| (new, sensible(rig, line))));
    }
    let name = |own: &Placed| {
        let alike: Vec<&Placed> = lines.iter().map(|l| &l.0).filter(|p| p.effect.id() == own.effect.id()).collect();
        let several = |of: &dyn Fn(&Placed) -> String| alike.iter().any(|p| of(p) != of(own));
        let first = |p: &Placed| p.instance.channels.first().map_or_else(String::new, |c| bare(c).to_owned());
        let scope = |p: &Placed| p.effect.scope(&p.instance).word().to_owned();
        let on = if several(&first) { format!(" {}", first(own)) } else { String::new() };
        let form = if several(&scope) { format!(" {}", own.instance.form) } else { String::new() };
        format!("{}{form}{on}", own.effect.id())
    };
    lines.iter().map(|(own, line)| (name(own), line.clone())).collect()
}

/// Size, noise floors, at which the signs of a cause's parts are tried: well above all that the search needs.
const LOUD: f64 = 16.0;

/// The line with the first signs of its parts that make sense together.
fn sensible(rig: &Rig, line: Line) -> Line {
    let makes_sense = |l: &Line| rig.makes_sense(l, l.place(&rig.context, &rig.best, LOUD));
    line.turned().into_iter().find(makes_sense).unwrap_or(line)
}

/// A channel without its unit.
fn bare(channel: &str) -> &str {
    channel.rsplit_once('_').filter(|(_, unit)| ["n", "nm", "a", "v"].contains(unit)).map_or(channel, |(name, _)| name)
}

/// Climbs all causes, as many at once as the machine has cores; the answers do not depend on how many.
fn all(rig: &Rig, named: &[(String, Line)], names: &[(String, Placed)], progress: &mut dyn FnMut(f64)) -> Vec<Climbed> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from).clamp(1, named.len().max(1));
    let next = AtomicUsize::new(0);
    let (send, receive) = mpsc::channel();
    let mut out: Vec<Option<Climbed>> = named.iter().map(|_| None).collect();
    std::thread::scope(|scope| {
        for _ in 0..threads {
            let (send, next) = (send.clone(), &next);
            scope.spawn(move || {
                loop {
                    let k = next.fetch_add(1, Ordering::Relaxed);
                    let Some((own, line)) = named.get(k) else { break };
                    let rivals = rivals(names, k);
                    if send.send((k, climb(rig, &Question { line, names, own }, &rivals))).is_err() {
                        break;
                    }
                }
            });
        }
        drop(send);
        for (done, (k, climbed)) in receive.iter().enumerate() {
            out[k] = Some(climbed);
            progress((done + 1) as f64 / named.len() as f64);
        }
    });
    out.into_iter().flatten().collect()
}

/// Names of the causes that could be taken for one: another name on a channel that both touch.
fn rivals(names: &[(String, Placed)], k: usize) -> Vec<&str> {
    let own = &names[k].1;
    let others = names.iter().filter(|(_, p)| p.effect.id() != own.effect.id() && shares_channel(p, own));
    others.map(|(name, _)| name.as_str()).collect()
}

fn shares_channel(a: &Placed, b: &Placed) -> bool {
    a.instance.channels.iter().any(|c| b.instance.touches(c))
}

/// A row of the matrix.
fn cause(rig: &Rig, line: &Line, climbed: &Climbed, names: &[(String, Placed)], k: usize) -> Cause {
    let (context, healthy) = (&rig.context, &rig.best);
    let size = |floors: f64| {
        let place = line.place(context, healthy, floors);
        Size { floors, quantity: line.quantities(context, place).0 }
    };
    let shown = line.place(context, healthy, climbed.seen.unwrap_or(climbed.tried));
    let parts = line.parts(context, healthy, shown);
    let loudest = parts.iter().max_by(|a, b| a.beside.total_cmp(&b.beside));
    let (name, own) = &names[k];
    let apart = names.iter().map(|(other, p)| {
        if p.effect.id() == own.effect.id() {
            Apart::SameName
        } else if !shares_channel(p, own) {
            Apart::Elsewhere
        } else {
            climbed.apart(other).map_or(Apart::Never, |floors| Apart::From(size(floors)))
        }
    });
    Cause {
        name: name.clone(),
        id: own.effect.id(),
        title: own.effect.about().title,
        channels: own.instance.channels.clone(),
        main: loudest.map_or_else(String::new, |p| context.targets[p.target].name.to_owned()),
        free: loudest.map_or(0.0, |p| (p.beside / p.whole).powi(2).min(1.0)),
        held: line.quantities(context, shown).1,
        seen: climbed.seen.map(size),
        sensible: climbed.is_sensible(),
        tried: size(climbed.tried),
        apart: apart.collect(),
    }
}

/// Causes in the order of the matrix: those that are named at the smallest size first.
fn order(causes: &[Cause]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..causes.len()).collect();
    let size = |k: &usize| causes[*k].seen.as_ref().map_or(f64::INFINITY, |s| s.floors);
    order.sort_by(|a, b| size(a).total_cmp(&size(b)));
    order
}
