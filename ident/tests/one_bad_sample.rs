//! One bad sample changes nothing.
//!
//! What it is: spikes, drop-outs with a slow recovery and stuck values, drawn by channel, place, size and length, in a simulated run and in
//! recorded ones: the verdict and its names are those of the run without, parameters lie within their intervals, and the bad samples
//! are listed.
//! What can go wrong: without the recordings (`QUADRIG_DATA`) only the simulated run is asked, and the test says so. A rotor is on its way
//! for seconds after each step: a drop-out that meets one is not asked for, nor is a recorded reading of twice its height right there.
//! Units: rows, the channels' own.
//! Reference: specification `closing-the-loop.md`, "One bad sample changes nothing".

mod rig;

use ident::close::close;
use ident::log::Log;
use ident::log::import::import;
use ident::signal::bad;
use ident::verdict::Verdict;
use rig::{Chance, Trouble};
use std::path::{Path, PathBuf};

/// What is wrong with a channel, and how many samples it lasts.
#[derive(Debug, Clone, Copy)]
enum Fault {
    /// Times the reading.
    Times(f64),
    /// This reading.
    Reads(f64),
    /// A share of the reading is lost for so many samples and comes back with a time constant of so many.
    Drops(f64, usize, f64),
    /// The reading of so many samples ago.
    Sticks(usize),
}

/// A fault, where it stands.
#[derive(Debug, Clone)]
struct Case {
    channel: String,
    row: usize,
    fault: Fault,
}

impl Case {
    fn draw(log: &Log, channels: &[&str], at_steps: bool, chance: &mut Chance) -> Self {
        let channel = channels[(chance.uniform() * channels.len() as f64) as usize].to_owned();
        let column = log.column(&channel).expect("a channel of the log");
        let pulse = log.column("pulse_us").expect("a command");
        let top = column.iter().copied().fold(0.0, f64::max);
        let jumps: Vec<usize> = (1..log.len()).filter(|i| (pulse[*i] - pulse[i - 1]).abs() > 5.0).collect();
        let highest = pulse.iter().copied().fold(0.0, f64::max);
        let plenty = |i: usize| column[i].is_finite() && column[i] > 0.2 * top && i + 60 < log.len() && i > 20;
        let row = loop {
            let pick = |rows: &[usize], u: f64| rows[(u * rows.len() as f64) as usize];
            let u = chance.uniform();
            let row = match (3.0 * chance.uniform()) as u32 {
                0 => (u * log.len() as f64) as usize,
                1 => pick(&jumps, u) + (2.0 * chance.uniform()) as usize,
                _ => pick(&(0..log.len()).filter(|i| pulse[*i] == highest).collect::<Vec<_>>(), u),
            };
            if plenty(row) {
                break row;
            }
        };
        let absurd = if channel.starts_with("rpm") { 60_000.0 } else { 80.0 };
        let samples = 1 + (40.0 * chance.uniform()) as usize;
        let fault = match (6.0 * chance.uniform()) as u32 {
            0 => Fault::Times(2.0),
            1 => Fault::Reads(absurd),
            2 => Fault::Reads(1e12),
            3 => Fault::Drops(1.0, samples, 1e-6),
            4 => Fault::Drops(0.2 + 0.8 * chance.uniform(), samples, 1.0 + 10.0 * chance.uniform()),
            _ => Fault::Sticks(samples),
        };
        // a drop-out hides behind a rotor that is on its way
        let near = |j: &usize| *j <= row && log.t[row] - log.t[*j] < 4.0 || *j > row && *j < row + 90;
        let stuck_or_spike = match fault {
            Fault::Drops(..) => false,
            Fault::Times(_) => at_steps,
            Fault::Reads(_) | Fault::Sticks(_) => true,
        };
        let hidden = !stuck_or_spike && jumps.iter().any(near);
        if hidden { Self::draw(log, channels, at_steps, chance) } else { Self { channel, row, fault } }
    }

    /// The log with the fault.
    fn onto(&self, log: &Log) -> Log {
        let mut log = log.clone();
        let column = log.columns.iter_mut().find(|c| c.name == self.channel).expect("a channel of the log");
        let y = &mut column.values;
        let held = y[self.row];
        match self.fault {
            Fault::Times(factor) => y[self.row] *= factor,
            Fault::Reads(value) => y[self.row] = value,
            Fault::Drops(depth, samples, recovers) => {
                for (age, v) in y[self.row..].iter_mut().enumerate() {
                    let lost = depth * (-(age as f64 - samples as f64 + 1.0).max(0.0) / recovers).exp();
                    if lost < 1e-3 {
                        break;
                    }
                    *v *= 1.0 - lost;
                }
            }
            Fault::Sticks(samples) => y[self.row..].iter_mut().take(samples).for_each(|v| *v = held),
        }
        log
    }

    /// Whether the fault is in the list: one that changed a reading by more than scatter and lag.
    fn is_listed(&self, clean: &Log, set_aside: &[bad::SetAside]) -> bool {
        let gross = matches!(self.fault, Fault::Times(_) | Fault::Reads(_) | Fault::Drops(..));
        let _ = clean;
        !gross || set_aside.iter().any(|a| a.channel == self.channel && a.span().contains(&self.row))
    }
}

fn verdict(log: &Log) -> Verdict {
    close(log, None, &[], &mut |_| {}).expect("a verdict").verdict
}

/// What differs between the verdicts on a run without and with a fault.
fn differs(clean: &Verdict, faulty: &Verdict) -> Vec<String> {
    let mut out = Vec::new();
    let names = |v: &Verdict| v.effects.iter().map(|e| (e.id.clone(), e.channels.clone())).collect::<Vec<_>>();
    let sorted = |v: &Verdict| {
        let mut ids: Vec<String> = v.effects.iter().map(|e| e.id.clone()).collect();
        ids.sort();
        ids
    };
    if clean.verdict != faulty.verdict || sorted(clean) != sorted(faulty) {
        return vec![format!("{:?} {:?} became {:?} {:?}", clean.verdict, names(clean), faulty.verdict, names(faulty))];
    }
    for e in &clean.effects {
        let there: Vec<_> = faulty.effects.iter().filter(|f| f.id == e.id).collect();
        for p in &e.parameters {
            let inside = |v: f64| p.ci95[0] <= v && v <= p.ci95[1];
            let found: Vec<f64> =
                there.iter().flat_map(|f| &f.parameters).filter(|q| q.name == p.name).map(|q| q.value).collect();
            if !found.iter().any(|v| inside(*v)) {
                out.push(format!("{} {} {:?} became {found:?}", e.id, p.name, p.ci95));
            }
        }
    }
    out
}

/// Asks `cases` of a log, the list only of `listed` more.
fn ask(name: &str, log: &Log, channels: &[&str], (cases, listed): (usize, usize), seed: u64) -> Vec<String> {
    let clean = verdict(log);
    println!("{name}: {:?}, set aside {:?}", clean.effects.iter().map(|e| &e.id).collect::<Vec<_>>(), clean.set_aside);
    let chance = &mut Chance::new(seed);
    let mut faults = Vec::new();
    let only_list = std::env::var_os("ONLY_LIST").is_some();
    for k in if only_list { cases } else { 0 }..cases + listed {
        let case = Case::draw(log, channels, name == SIMULATED, chance);
        let faulty = case.onto(log);
        if k >= cases && !case.is_listed(log, &bad::found(&faulty)) {
            faults.push(format!("{name}, {case:?} reads {:?}: not listed", log.column(&case.channel).map(|c| c[case.row])));
        }
        if k < cases {
            faults.extend(differs(&clean, &verdict(&faulty)).into_iter().map(|d| format!("{name}, {case:?}: {d}")));
        }
    }
    faults
}

const SIMULATED: &str = "a simulated run";
const CHANNELS: [&str; 5] = ["rpm", "thrust_n", "torque_nm", "current_a", "voltage_v"];

#[test]
fn in_a_simulated_run() {
    let log = rig::run(Trouble { up_down: true, ..Trouble::default() }, 160, 4).log;
    let faults = ask(SIMULATED, &log, &CHANNELS, (8, 200), 1);
    assert!(faults.is_empty(), "{} faults\n{}", faults.len(), faults.join("\n"));
}

/// A folder of the recorded data; nothing, and a word about it, on a desk without them.
fn recorded(folder: &str) -> Option<PathBuf> {
    let shared = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let folder = std::env::var_os("QUADRIG_DATA").map_or_else(shared, PathBuf::from).join(folder);
    if folder.is_dir() {
        return Some(folder);
    }
    assert!(std::env::var_os("CI").is_none(), "no recorded data at {}", folder.display());
    println!("SKIPPED: no recorded data at {} (QUADRIG_DATA names the folder)", folder.display());
    None
}

#[test]
fn in_recorded_runs() {
    let Some(folder) = recorded("rig") else { return };
    let mut faults = Vec::new();
    for (file, cases) in
        [("lever-rig-10x45/tidy/robbe12.2.csv", 3), ("stand1585-micro/tidy/TimeConstant_Test_2023-12-17_162234.csv", 0)]
    {
        let (log, _) = import(&folder.join(file), &[]).unwrap_or_else(|e| panic!("{e}"));
        let channels: Vec<&str> = CHANNELS.into_iter().filter(|c| log.column(c).is_some()).collect();
        faults.extend(ask(file, &log, &channels, (cases, 150), 2));
    }
    assert!(faults.is_empty(), "{} faults\n{}", faults.len(), faults.join("\n"));
}

/// A departure that a witness cannot tell while the command steps is none: what every probe reads, the rotor did.
#[test]
fn what_all_speed_probes_read_is_kept() {
    let Some(folder) = recorded("blind-sample") else { return };
    let mut asked = 0;
    for file in std::fs::read_dir(folder).expect("a folder").map(|f| f.expect("a file").path()) {
        if file.extension().is_none_or(|e| e != "csv") {
            continue;
        }
        let (log, _) = import(&file, &[]).unwrap_or_else(|e| panic!("{e}"));
        let probes: Vec<&str> = ["rpm_beam", "rpm_opto", "rpm_hall"].into_iter().filter(|c| log.column(c).is_some()).collect();
        if probes.len() < 2 {
            continue;
        }
        asked += 1;
        let aside = bad::found(&log);
        let on = |probe: &str, row: usize| aside.iter().any(|a| a.channel == probe && a.span().contains(&row));
        let everywhere = (0..log.len()).find(|row| probes.iter().all(|p| on(p, *row)));
        assert_eq!(everywhere, None, "{}: {aside:?}", file.display());
    }
    assert!(asked >= 10, "{asked} logs with several probes");
}
