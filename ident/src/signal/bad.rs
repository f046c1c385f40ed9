//! Bad samples: readings that nothing else in the log bears out.
//!
//! What it is: a spike, a drop-out with its slow recovery or a value that got stuck is found by what all other channels and the command say
//! of the same rows, and of those just before and after. What is found is taken out of every fit and listed.
//! What can go wrong: what lasts, what recurs with the load and what another channel shows as well is an effect and stays; so do single absurd
//! readings that come more than once, which `glitch_rows`, `missed_pulses` and `double_pulses` speak of.
//! Units: rows of the log, s, the channel's own.
//! Reference: contaminated normal distribution, Tukey 1960; Lange, Little & Taylor 1989 (Student's t for robust modelling).

mod curve;
mod dropout;
mod excursion;
mod first_turns;
mod last_turns;
mod old;
mod scale;
mod spike;
mod stuck;
mod unpowered;
mod unread;
mod witness;

pub(crate) use curve::Curve;

use crate::log::{Column, Log, MODELLED, SPEED, trimmed};
use crate::numeric::order::median;
use excursion::Event;
use serde::Serialize;
use std::borrow::Cow;
use std::fmt;
use std::ops::Range;
use witness::Witnesses;

/// Rows of one channel that were set aside.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SetAside {
    /// Column.
    pub channel: String,
    /// First row, counted from 0 beneath the header.
    pub row: usize,
    /// How many samples in a row.
    pub rows: usize,
    /// Time of the first, s.
    pub t_s: f64,
    /// Time of the last, s.
    pub until_s: f64,
    /// The reading that is farthest off.
    pub value: f64,
    /// What all other channels make one expect there.
    pub expected: f64,
    /// One of several single readings of its channel: it stays in the log for the effect that speaks of them.
    #[serde(skip)]
    pub recurs: bool,
    /// The zeros of a sensor that does not see the rotor turn yet, or any more: no reading to judge by, but what it reads then is known.
    #[serde(skip)]
    pub silent: bool,
    /// The same reading row after row, and not nothing.
    #[serde(skip)]
    pub stuck: bool,
    /// Of a log without a time: its row is all that is known of when.
    #[serde(skip)]
    pub timeless: bool,
    /// What the channel read on them, row by row.
    #[serde(skip)]
    pub readings: Vec<f64>,
}

impl fmt::Display for SetAside {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { channel, row, rows, t_s, until_s, .. } = self;
        let place = match (*rows, self.timeless) {
            (1, true) => format!("row {row}"),
            (1, false) => format!("row {row} ({t_s:.3} s)"),
            (_, true) => format!("{rows} rows from {row} on"),
            (_, false) => format!("{rows} rows from {row} on ({t_s:.3} to {until_s:.3} s)"),
        };
        write!(f, "column {channel}, {place}: {}; set aside", self.off())
    }
}

/// Figures of a reading that was set aside, and of what was expected of it.
const FIGURES: f64 = 4.0;
/// Most decimals of both.
const DECIMALS: usize = 9;

impl SetAside {
    /// What it reads, and what is expected there where that is another: to four figures, or to as many as part the two.
    fn off(&self) -> String {
        let size = if self.expected == 0.0 { self.value } else { self.expected };
        let places = (FIGURES - 1.0 - size.abs().max(1e-6).log10().floor()).clamp(0.0, DECIMALS as f64) as usize;
        let of = |places: usize| [self.value, self.expected].map(|v| shown(v, places));
        let stuck = if self.stuck { "stuck at " } else { "" };
        match of(places) {
            [value, expected] if value == expected && self.stuck => format!("stuck at {}", trimmed(self.value, places)),
            [shown, _] => match (places..=DECIMALS).map(of).find(|[value, expected]| value != expected) {
                Some([value, expected]) => format!("{stuck}{value} where the rest of the log says {expected}"),
                // the last reading of a rotor that is no longer seen, shown on
                None => format!("{shown}, kept from before"),
            },
        }
    }
}

/// To so many decimals; nothing is 0.
fn shown(value: f64, places: usize) -> String {
    let text = format!("{value:.places$}");
    if text.chars().all(|c| matches!(c, '-' | '0' | '.')) { "0".to_owned() } else { text }
}

/// Fewest samples of a channel whose scatter can be told.
const FEWEST: usize = 50;
/// Largest share of a channel's samples that can be bad: one that is worse has an effect.
const MOST: f64 = 0.05;
/// Rows up to which a departure is a single reading: the running median of five that `glitch_rows` looks through copes with two.
const SINGLE: usize = 2;

/// The channel that reads the supply.
const CHANNEL_OF_SUPPLY: &str = "voltage_v";

/// The channels that are judged, those first that others are judged by.
fn judged() -> impl Iterator<Item = &'static str> {
    MODELLED.into_iter().chain(["thrust_rms_n", "temp_c"])
}

/// A way to find bad samples of a channel.
type Finder = fn(&Witnesses<'_>, &'static str) -> Vec<Event>;

/// The bad samples of a log, in the order of the channels.
#[must_use]
pub fn found(log: &Log) -> Vec<SetAside> {
    let mut of_channels: Vec<(&str, &[f64], Vec<Event>)> = Vec::new();
    let mut kept = Vec::new();
    let speeds = SPEED.iter().filter(|s| log.column(s).is_some_and(|c| c.iter().any(|v| v.is_finite()))).count();
    let mut witnesses = Witnesses::of(log);
    for name in judged() {
        let Some(column) = log.column(name) else { continue };
        let samples = column.iter().filter(|v| v.is_finite()).count();
        if samples < FEWEST {
            // a table of levels: nothing stands beside a reading but the load of its own level
            let events = if SPEED.contains(&name) { unread::found(log, name) } else { Vec::new() };
            of_channels.push((name, column, events));
            continue;
        }
        let old = if SPEED.contains(&name) { old::found(log, name) } else { Vec::new() };
        witnesses.take_out(name, &old);
        let lost = if SPEED.contains(&name) { of_probe(&mut witnesses, name) } else { Vec::new() };
        let off = if name == CHANNEL_OF_SUPPLY { unpowered::found(log) } else { Vec::new() };
        witnesses.take_out(name, &off);
        let mut events = stuck::found(&witnesses, name);
        witnesses.take_out(name, &events);
        // a probe's recovery belongs to its drop-out; elsewhere a single reading stands by itself
        let order: [Finder; 2] =
            if SPEED.contains(&name) { [excursion::found, spike::found] } else { [spike::found, excursion::found] };
        for found in order {
            let more = found(&witnesses, name);
            witnesses.take_out(name, &more);
            events.extend(more);
        }
        let (mut events, recurring) = of_no_effect(name, column, events, samples, Probes { speeds, lost: lost.len() });
        events.extend(lost.into_iter().chain(off).chain(old));
        events.sort_by_key(|e| e.rows.start);
        witnesses.settle(name, &events);
        kept.extend(recurring.iter().filter_map(|e| Some(SetAside { recurs: true, ..told(log, name, column, e)? })));
        of_channels.push((name, column, events));
    }
    let borne_out = |name: &str, event: &Event| {
        let others = of_channels.iter().filter(|(other, ..)| *other != name && !SPEED.contains(other) && !SPEED.contains(&name));
        let mut lasting = others.flat_map(|(.., events)| events).filter(|e| e.rows.len() > SINGLE);
        event.rows.len() > SINGLE && lasting.any(|e| e.rows.start < event.rows.end && event.rows.start < e.rows.end)
    };
    let each = of_channels.iter().flat_map(|(name, column, events)| events.iter().map(move |e| (*name, *column, e)));
    each.filter(|(name, _, e)| !borne_out(name, e))
        .filter_map(|(name, column, e)| told(log, name, column, e))
        .chain(kept)
        .collect()
}

/// What a probe has not seen: a start's zeros and a coasting rotor's, which would be taken for a mark that was lost, and the marks that it has
/// lost. It reads nothing then, however often: no effect speaks of it.
fn of_probe(witnesses: &mut Witnesses<'_>, name: &'static str) -> Vec<Event> {
    let mut silent = first_turns::found(witnesses, name);
    silent.extend(last_turns::found(witnesses, name));
    witnesses.take_out(name, &silent);
    let lost = dropout::found(witnesses, name);
    witnesses.take_out(name, &lost);
    [silent, lost].concat()
}

/// The log without the samples that were set aside: they are missing ones.
#[must_use]
pub fn without<'l>(log: &'l Log, aside: &[SetAside]) -> Cow<'l, Log> {
    if aside.iter().all(|a| a.recurs) {
        return Cow::Borrowed(log);
    }
    let of_column = |c: &Column| {
        let mut values = c.values.clone();
        for a in aside.iter().filter(|a| a.channel == c.name && !a.recurs) {
            values[a.span()].fill(f64::NAN);
        }
        Column { name: c.name.clone(), values }
    };
    let columns = log.columns.iter().map(of_column).collect();
    Cow::Owned(Log {
        name: log.name.clone(),
        meta: log.meta.clone(),
        events: log.events.clone(),
        t: log.t.clone(),
        columns,
        sha256: log.sha256.clone(),
    })
}

impl SetAside {
    /// The rows.
    #[must_use]
    pub fn span(&self) -> Range<usize> {
        self.row..self.row + self.rows
    }
}

/// What is known of the speed probes.
#[derive(Clone, Copy)]
struct Probes {
    /// How many there are.
    speeds: usize,
    /// How often the one that is judged has lost its mark.
    lost: usize,
}

/// Fewest speed channels among which one can be outvoted, so that pulses too few or too many have a name.
const VOTES: usize = 3;

/// Those departures of a channel that are bad samples and no effect of it, and the single ones that an effect speaks of.
fn of_no_effect(name: &str, column: &[f64], mut events: Vec<Event>, samples: usize, probes: Probes) -> (Vec<Event>, Vec<Event>) {
    events.sort_by_key(|e| e.rows.start);
    let speed = SPEED.contains(&name);
    let single = |e: &Event| e.rows.len() <= SINGLE;
    let too_many = |events: &[Event]| events.iter().map(|e| e.rows.len()).sum::<usize>() as f64 > MOST * samples as f64;
    if too_many(&events) {
        // what lasts has a cause; single readings beside it are as bad as ever
        events.retain(single);
    }
    if too_many(&events) {
        return (Vec::new(), Vec::new());
    }
    let singles = events.iter().filter(|e| single(e)).count();
    // a probe that loses its mark for a while loses it for a single reading as well
    let lasting = events.len() - singles + probes.lost;
    // what follows a step of the load at once is no glitch to any reader, unless others are
    let settled = events.iter().filter(|e| single(e) && !e.at_step).count();
    if singles < 2
        || !speed && settled < 2
        || speed && (lasting * 3 >= singles || probes.speeds < VOTES || !of_one_size(column, events.iter().filter(|e| single(e))))
    {
        return (events, Vec::new());
    }
    // a speed of nothing at all is no pulse too few: the probe saw nothing
    let saw_nothing = |e: &Event| speed && column[e.rows.start].abs() < 0.05 * e.expected.abs();
    events.into_iter().partition(|e| !single(e) || saw_nothing(e))
}

/// Whether most readings of a speed are off by about the same share of it: a pulse too few or too many always is.
fn of_one_size<'e>(column: &[f64], events: impl Iterator<Item = &'e Event>) -> bool {
    let off: Vec<f64> = events.map(|e| column[e.worst] / e.expected - 1.0).filter(|off| off.is_finite()).collect();
    let usual = median(&mut off.clone());
    2 * off.iter().filter(|off| (**off - usual).abs() <= 0.5 * usual.abs()).count() > off.len()
}

/// An event in the words of the list.
fn told(log: &Log, name: &str, column: &[f64], event: &Event) -> Option<SetAside> {
    let mut measured = event.rows.clone().filter(|r| column[*r].is_finite());
    let (first, last) = (measured.next()?, measured.next_back());
    let rows = last.map_or(1, |last| last + 1 - first);
    let value = column[first];
    let stuck = rows > SINGLE && value != 0.0 && column[first..first + rows].iter().all(|v| v.is_nan() || *v == value);
    // what a line through other channels says beneath rest is rest
    let expected = if SPEED.contains(&name) { event.expected.max(0.0) } else { event.expected };
    Some(SetAside {
        channel: name.to_owned(),
        row: first,
        rows,
        t_s: log.t[first],
        until_s: log.t[last.unwrap_or(first)],
        value: column[event.worst],
        expected,
        recurs: false,
        silent: event.silent,
        stuck,
        timeless: log.time_is_row(),
        readings: column[first..first + rows].to_vec(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(value: f64, expected: f64, stuck: bool) -> SetAside {
        let (channel, rows) = ("rpm_beam".to_owned(), if stuck { 12 } else { 1 });
        let [recurs, silent, timeless] = [false; 3];
        let readings = vec![value; rows];
        SetAside { channel, row: 1, rows, t_s: 0.1, until_s: 0.1, value, expected, recurs, silent, stuck, timeless, readings }
    }

    fn aside(value: f64, expected: f64, stuck: bool) -> String {
        one(value, expected, stuck).to_string()
    }

    /// A log whose rows have no time tells rows.
    #[test]
    fn without_a_time_a_reading_has_its_row_alone() {
        for (stuck, place, timed) in [(false, "row 1", " (0.100 s)"), (true, "12 rows from 1 on", " (0.100 to 0.100 s)")] {
            for (timeless, behind) in [(true, ""), (false, timed)] {
                let said = SetAside { timeless, ..one(0.0, 511.0, stuck) }.to_string();
                assert!(said.starts_with(&format!("column rpm_beam, {place}{behind}: ")), "{said}");
            }
        }
    }

    #[test]
    fn a_reading_and_what_was_expected_are_never_told_alike() {
        for (value, expected, said) in [
            (2417.082, 3625.4, "2417 where the rest of the log says 3625"),
            (0.123_456, 1.5, "0.123 where the rest of the log says 1.500"),
            (270.71, 270.74, "270.71 where the rest of the log says 270.74"),
            (2080.0, 0.0, "2080 where the rest of the log says 0"),
            (0.0, 511.04, "0 where the rest of the log says 511.0"),
            (1472.0, 1472.0, "1472, kept from before"),
        ] {
            let told = aside(value, expected, false);
            assert!(told.ends_with(&format!(": {said}; set aside")), "{told}");
        }
        assert!(aside(302.0, 302.04, true).ends_with("12 rows from 1 on (0.100 to 0.100 s): stuck at 302; set aside"));
        assert!(aside(302.0, 350.0, true).ends_with("stuck at 302.0 where the rest of the log says 350.0; set aside"));
    }

    /// A speed is never expected to be less than none, and rows that repeat a reading are told from others.
    #[test]
    fn a_speed_is_expected_to_be_none_at_the_least() {
        let log = Log { t: (0..9).map(f64::from).collect(), ..Log::default() };
        let of = |name: &str, column: &[f64], expected: f64| {
            let event = Event { rows: 2..6, worst: 3, expected, at_step: false, silent: false };
            told(&log, name, column, &event).map(|a| (a.expected, a.stuck))
        };
        let stuck = [0.0, 0.0, 7.0, 7.0, 7.0, 7.0, 0.0, 0.0, 0.0];
        assert_eq!(of("rpm_beam", &stuck, -237.1), Some((0.0, true)));
        assert_eq!(of("thrust_n", &stuck, -0.5), Some((-0.5, true)));
        assert_eq!(of("rpm_beam", &[0.0; 9], 500.0), Some((500.0, false)));
    }

    /// Two doubled readings beside a fault that lasts for a fifth of the run.
    #[test]
    fn what_lasts_does_not_hide_single_readings() {
        let event =
            |rows: Range<usize>, expected: f64| Event { worst: rows.start, rows, expected, at_step: false, silent: false };
        let mut column = vec![4000.0; 1000];
        column[300] = 8000.0;
        column[600] = 8000.0;
        column[700..900].fill(1500.0);
        let events = || vec![event(300..301, 4000.0), event(600..601, 4000.0), event(700..900, 4000.0)];
        let (bad, recurring) = of_no_effect("rpm_opto", &column, events(), 1000, Probes { speeds: 3, lost: 0 });
        let rows = |events: &[Event]| events.iter().map(|e| e.rows.start).collect::<Vec<_>>();
        assert_eq!((rows(&bad), rows(&recurring)), (vec![], vec![300, 600]), "two of one size have a name");
        let (bad, _) = of_no_effect("thrust_n", &column, events().split_off(1), 1000, Probes { speeds: 3, lost: 0 });
        assert_eq!(rows(&bad), [600], "one alone is bad");
        let many = (0..60).map(|k| event(10 * k..10 * k + 1, 4000.0)).collect();
        let (bad, recurring) = of_no_effect("thrust_n", &column, many, 1000, Probes { speeds: 3, lost: 0 });
        assert!(bad.is_empty() && recurring.is_empty(), "one that is bad so often has a fault");
    }
}
