//! Recorded flights: the loop on each, and the corrected model on another flight of the same vehicle.
//!
//! What it is: each flight is imported and closed; its model predicts every other flight of its vehicle; a vehicle with one flight is split in
//! the middle, each half predicting the other. One page a set, and a section of the summary page.
//! What can go wrong: a set that is absent is said to be absent; a flight that cannot be closed says why.
//! Units: as the channels state.
//! Reference: specification `flight.md`, "The loop on flights".

use super::page::{three, word};
use crate::Failure;
use crate::progress::Bar;
use crate::trouble::unwritten;
use ident::flight::{Closed, close};
use ident::log::import::flight;
use ident::log::{Column, Log, write_whole};
use ident::report::{Figure, write_figures};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// A set of flights.
pub(crate) struct Flights {
    /// Folder below `rig`.
    pub(crate) folder: &'static str,
    /// What was recorded.
    what: &'static str,
    /// Flights: file, vehicle, mass in kg where it is told.
    flights: &'static [(&'static str, &'static str, Option<f64>)],
}

/// From the middle of a Crazyflie 2.1 to a rotor, m (Bitcraze: 92 mm from motor to motor).
const ARM_M: f64 = 0.046;

/// Every set.
pub(crate) const SETS: [Flights; 2] = [
    Flights {
        folder: "crazyflie-flights",
        what: "Crazyflies of IMRCLab, TU Berlin, at 500 Hz: specific force, rate, four rotor speeds, commands, voltage, estimated motion. Two figures of eight of a brushless vehicle, the second half again as fast; twenty seconds of a brushed one that turns about itself.",
        flights: &[
            ("brushless-eckart00", "brushless", Some(0.037)),
            ("brushless-eckart22", "brushless", Some(0.037)),
            ("brushed-jana01-first20s", "brushed", Some(0.0347)),
        ],
    },
    Flights {
        folder: "arpl-crazyflie-flights",
        what: "A Crazyflie of ARPL, NYU, that is excited for ten seconds, at 1 kHz: specific force, rate and motor commands; no rotor speeds, no motion. Force and moments go with the commands.",
        flights: &[("log10-10to20s", "excited", None)],
    },
];

/// One flight, and what came of it.
struct Flown {
    name: String,
    closed: Result<Closed, String>,
}

/// What came of a set.
pub(crate) struct Page {
    set: &'static Flights,
    flown: Vec<Flown>,
}

/// Runs a set and writes its page and figures into `folder`.
pub(crate) fn work(set: &'static Flights, data: &Path, folder: &Path, quiet: bool) -> Result<Page, Failure> {
    let from = data.join(set.folder);
    let logs: Vec<(&str, &str, Log)> = set
        .flights
        .iter()
        .filter(|f| file(&from, f.0).is_file())
        .map(|(name, vehicle, mass)| Ok((*name, *vehicle, read(&file(&from, name), *mass)?)))
        .collect::<Result<_, Failure>>()?;
    let bar = Bar::new(set.folder, quiet);
    let mut flown = Vec::new();
    for (k, (name, vehicle, log)) in logs.iter().enumerate() {
        let others: Vec<Log> = logs.iter().filter(|l| l.1 == *vehicle && l.0 != *name).map(|l| l.2.clone()).collect();
        let halves = if others.is_empty() { halves(name, log) } else { vec![((*name).to_owned(), log.clone(), others)] };
        for (name, log, others) in halves {
            let mut tell = |p: f64| bar.set((k as f64 + p) / logs.len() as f64);
            let closed = close(&log, None, &others, &mut tell).map_err(|e| e.to_string());
            flown.push(Flown { name, closed });
        }
    }
    drop(bar);
    let page = Page { set, flown };
    let path = folder.join(format!("{}.md", set.folder));
    write_whole(&path, |out| out.write_all(page.text().as_bytes())).map_err(unwritten(&path))?;
    write_figures(folder, &page.figures()).map_err(|(path, e)| format!("{}: {e}", path.display()))?;
    Ok(page)
}

fn file(folder: &Path, name: &str) -> PathBuf {
    folder.join(format!("{name}.csv"))
}

fn read(path: &Path, mass_kg: Option<f64>) -> Result<Log, Failure> {
    let Some((mut log, _)) = flight(path)? else { return Err(format!("{}: no flight", path.display()).into()) };
    log.meta.insert("arm_m".into(), toml::Value::Float(ARM_M));
    if let Some(mass) = mass_kg {
        log.meta.insert("mass_kg".into(), toml::Value::Float(mass));
    }
    Ok(log)
}

/// Both halves of a flight, each with the other to predict.
fn halves(name: &str, log: &Log) -> Vec<(String, Log, Vec<Log>)> {
    let middle = log.len() / 2;
    let part = |which: &str, rows: std::ops::Range<usize>| {
        let columns = log.columns.iter().map(|c| Column { name: c.name.clone(), values: c.values[rows.clone()].to_vec() });
        Log {
            name: format!("{name}, {which} half"),
            meta: log.meta.clone(),
            t: log.t[rows.clone()].to_vec(),
            columns: columns.collect(),
            ..Log::default()
        }
    };
    let (a, b) = (part("first", 0..middle), part("second", middle..log.len()));
    vec![(a.name.clone(), a.clone(), vec![b.clone()]), (b.name.clone(), b, vec![a])]
}

/// Channels of the tables, and their order.
const SHOWN: [&str; 11] =
    ["acc_x", "acc_y", "acc_z", "ang_acc_x", "ang_acc_y", "ang_acc_z", "rpm_1", "rpm_2", "rpm_3", "rpm_4", "voltage_v"];

impl Page {
    fn closed(&self) -> impl Iterator<Item = (&str, &Closed)> {
        self.flown.iter().filter_map(|f| Some((f.name.as_str(), f.closed.as_ref().ok()?)))
    }

    /// The set's page.
    fn text(&self) -> String {
        let mut out = format!("# {}\n\n{}\n", self.set.folder, self.set.what);
        if self.flown.is_empty() {
            out.push_str("\nThe set was absent when this page was written.\n");
            return out;
        }
        for f in &self.flown {
            match &f.closed {
                Err(why) => {
                    let _ = writeln!(out, "\n## {}\n\nThe loop cannot be closed: {why}.", f.name);
                }
                Ok(closed) => one(&mut out, &f.name, closed),
            }
        }
        out.push_str("\n## On flights that took no part\n");
        self.transfer(&mut out, &SHOWN);
        out.push_str("\n## What was left over, and what is left now\n");
        for figure in self.figures() {
            let _ = writeln!(out, "\n![{}]({}.svg)", figure.title, figure.id);
        }
        out
    }

    /// Errors on other flights: a row for each flight that was corrected, flight that was predicted, and channel.
    fn transfer(&self, out: &mut String, shown: &[&str]) {
        out.push_str("\n| corrected on | predicted | channel | unit | before | after | factor |\n| --- | --- | --- | --- | --- | --- | --- |\n");
        for (name, closed) in self.closed() {
            for other in &closed.verdict.validation {
                for channel in shown {
                    let Some(b) = other.channels.get(*channel) else { continue };
                    let unit = closed.verdict.channels.get(*channel).map_or("", |c| c.unit.as_str());
                    let factor = b.before / b.after.max(f64::MIN_POSITIVE);
                    let row = [three(b.before), three(b.after), format!("{factor:.2}")].join(" | ");
                    let _ = writeln!(out, "| {name} | {} | {channel} | {unit} | {row} |", other.run.trim_end_matches(".csv"));
                }
            }
        }
    }

    /// The set's part of the summary page.
    pub(crate) fn section(&self) -> String {
        let mut out = format!("\n### {}\n\n{} [All of it](measured/{}.md).\n", self.set.folder, self.set.what, self.set.folder);
        if self.flown.is_empty() {
            out.push_str("\nAbsent when this page was written.\n");
            return out;
        }
        out.push_str("\n| flight | verdict | effects, the surest first |\n| --- | --- | --- |\n");
        for f in &self.flown {
            let what = match &f.closed {
                Err(why) => format!("not closed | {why}"),
                Ok(c) => format!("{} | {}", word(c.verdict.verdict), effects(c)),
            };
            let _ = writeln!(out, "| {} | {what} |", f.name);
        }
        self.transfer(&mut out, &SHOWN[..6]);
        out
    }

    /// Residuals of the flight that shows most, one figure a channel.
    fn figures(&self) -> Vec<Figure> {
        let Some((name, closed)) = self.closed().max_by_key(|c| c.1.verdict.effects.len()) else { return Vec::new() };
        let mut all = ident::report::flight::figures(closed);
        all.retain(|f| SHOWN[..6].iter().any(|c| f.id == format!("residual-{c}")));
        for figure in &mut all {
            figure.title = format!("{}, {name}", figure.title);
            figure.id = format!("{}-{}", self.set.folder, figure.id.trim_start_matches("residual-"));
        }
        all
    }
}

/// Names with their parameters.
fn effects(closed: &Closed) -> String {
    let named = closed.verdict.effects.iter().filter(|e| e.id != "unknown");
    let list: Vec<String> = named
        .map(|e| {
            let told: Vec<String> = e.parameters.iter().map(|p| format!("{} {} {}", p.name, three(p.value), p.unit)).collect();
            format!("{} ({})", e.id, told.join(", "))
        })
        .collect();
    let nameless = closed.verdict.effects.iter().filter(|e| e.id == "unknown").count();
    let further = if nameless > 0 { format!("; {nameless} functions without a name") } else { String::new() };
    if list.is_empty() { format!("-{further}") } else { list.join("; ") + &further }
}

fn one(out: &mut String, name: &str, closed: &Closed) {
    let v = &closed.verdict;
    let windows = closed.flight.windows.len();
    let _ = writeln!(out, "\n## {name}\n\n{windows} windows. Verdict: **{}**. Effects: {}.", word(v.verdict), effects(closed));
    out.push_str(
        "\n| channel | unit | noise floor | held-out before | held-out after | factor |\n| --- | --- | --- | --- | --- | --- |\n",
    );
    for (channel, c) in &v.channels {
        let (b, a) = (c.before.heldout_rms, c.after.heldout_rms);
        let _ = writeln!(
            out,
            "| {channel} | {} | {} | {} | {} | {:.2} |",
            c.unit,
            three(c.noise_floor_rms),
            three(b),
            three(a),
            b / a
        );
    }
    for u in &v.unexplained {
        let on = if u.depends_on.is_empty() { String::new() } else { format!(", goes with {}", u.depends_on.join(", ")) };
        let _ = writeln!(out, "\nLeft on {}: {:.1} noise floors, {}{on}.", u.channel, u.over_floor, u.looks_like);
    }
}

/// What others get on such data.
const LITERATURE: &str = "\n### Beside the literature\n\nOn the brushless vehicle the force across the rotors falls 5 to 8 times on the other flight, with one coefficient for both axes: 0.0116 and 0.0126 N/(m/s), 1.8e-6 and 2.0e-6 N/(m/s) for each rad/s of the four rotors together. Foerster (ETH Zurich, 2015) identified 0.92e-6 for the lighter, brushed Crazyflie 2.0 with smaller propellers; Faessler, Franchi and Scaramuzza (RA-L 2018) show that such a drag, linear in speed, is what a controller needs beside thrust. What is left of force and moments along the flight goes with airflow at the rotors: Bauersfeld and others (NeuroBEM, RSS 2021) halve the error of blade element models with a network trained on hours of flight, which ten seconds cannot teach. Thrust rises with the square of the speed across the rotors on the faster flight, by 2.7 % of the weight at 2 m/s; on the slower one, at half of that speed, other changes along z are larger. Along z and in turning the models of one flight are worth 1.0 to 2.0 times on the other.\n";

/// The part of the summary page on flights.
pub(crate) fn summary(pages: &[Page]) -> String {
    let mut out = String::from(
        "\n## Flights\n\n[The loop on flights](flights.md): specific force along three axes and angular acceleration about them, each as the mean over windows of 40 ms, beside the declared model (thrust with the squares of the speeds, reaction torque, a rigid body; no drag) and the corrected one. The model of one flight predicts another of the same vehicle, one constant a channel apart; a vehicle with one flight is split in the middle.\n",
    );
    pages.iter().for_each(|p| out.push_str(&p.section()));
    out.push_str(LITERATURE);
    out
}
