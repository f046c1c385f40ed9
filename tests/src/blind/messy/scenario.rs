//! A messy rig, what is on top of it, and two runs of it.
//!
//! What it is: everything that one seed stands for. The rig's own effects act on both runs; an event acts on the first, and what it left
//! behind on the second from its start (a tare that slipped is set anew and leaves nothing). A drift is the first run's own.
//! What can go wrong: an effect on top that this rig cannot show at the wanted size is kept at its largest, and its size says so.
//! Units: sizes in noise floors.
//! Reference: specification `closing-the-loop.md`, "Blind trials"; `formats.md`, scope.

use super::dirt::Dirt;
use super::size::size;
use crate::blind::chance::Chance;
use crate::blind::effect::{Effect, Frame, KNOWN, compatible};
use crate::blind::rig::Rig;
use crate::blind::run::{self, Run};
use crate::blind::schedule::{Schedule, Shape};
use crate::blind::unknown::UNKNOWN;

/// What happens once in a run.
const EVENTS: [&str; 3] = ["tare_shift", "blade_damage", "bearing_friction"];
/// Most rows of a run: a campaign of a hundred runs takes minutes.
const ROWS: f64 = 3000.0;

/// What is on top of the rig.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Top {
    /// Nothing.
    Nothing,
    /// A listed effect.
    Known,
    /// One that is not listed.
    Unknown,
    /// Something that happens once.
    Event,
    /// A listed effect and one that is not.
    Both,
}

impl Top {
    /// What a seed has: even and odd seeds go through all in turn.
    #[must_use]
    pub fn of(seed: u64) -> Self {
        [Self::Nothing, Self::Known, Self::Unknown, Self::Event, Self::Both, Self::Known][(seed / 2 % 6) as usize]
    }

    /// Name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Nothing => "none",
            Self::Known => "known",
            Self::Unknown => "unknown",
            Self::Event => "event",
            Self::Both => "both",
        }
    }
}

/// A messy rig and its runs.
#[derive(Debug, Clone)]
pub struct Messy {
    /// Seed.
    pub seed: u64,
    /// What is on top.
    pub top: Top,
    /// The rig.
    pub rig: Rig,
    /// What its logger and probes do.
    pub dirt: Dirt,
    /// The rig's own effects, then what is on top.
    pub effects: Vec<Effect>,
    /// How many of them are the rig's own.
    pub own: usize,
    /// Size of each, and the channel that shows it most.
    pub sizes: Vec<(f64, &'static str)>,
    /// Schedules of the two runs.
    pub schedules: [Schedule; 2],
}

impl Messy {
    /// Everything from one seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        let (top, mut k) = (Top::of(seed), Chance::new(seed, 500));
        let mut rig = Rig::draw(&mut k);
        let mut ids = Vec::new();
        if matches!(top, Top::Known | Top::Both) {
            ids.push(KNOWN[(seed / 6) as usize % KNOWN.len()]);
        }
        if matches!(top, Top::Unknown | Top::Both) {
            ids.push(UNKNOWN[(seed / 12) as usize % UNKNOWN.len()]);
        }
        if top == Top::Event {
            ids.push(EVENTS[(seed / 12) as usize % EVENTS.len()]);
        }
        ids.iter().for_each(|id| Effect::equip(id, &mut rig, &mut k));
        // a fault of a sensor needs the others; else one to four of them
        let needed = rig.speeds.iter().all(|s| s.1 == 1.0) && ids.iter().any(|id| SENSORS.contains(id));
        let wanted = k.of(&[1, 2, 3, 4]);
        while !needed && rig.speeds.len() > wanted {
            let gone = k.of(&rig.speeds).0;
            rig.speeds.retain(|s| s.0 != gone);
        }
        rig.speeds.iter_mut().for_each(|s| s.1 = 1.0 + 0.003 * k.normal());
        rig.wander = 0.0;
        rig.common = (k.log_between(0.5, 5.0), k.log_between(0.2, 3.0));
        rig.decoys.clear();
        let duration = k.log_between(90.0, 240.0).min(ROWS / rig.hz);
        let shapes = [k.of(&Shape::ALL), k.of(&[Shape::UpDown, Shape::Random, Shape::Visits])];
        let other = (0.9 * duration).max(80.0);
        let schedules = [(shapes[0], duration), (shapes[1], other)].map(|(s, d)| Schedule::draw(s, d, 1050.0, 2000.0, &mut k));
        let mut effects = own_effects(&mut rig, &ids, &mut k);
        let own = effects.len();
        let dirt = Dirt::draw(&rig.speeds, &mut k);
        let frame = Frame { shortest: duration.min(other), duration, charge: run::charge(&rig, &schedules[0]) };
        for id in ids {
            let mut e = Effect::draw(id, &rig, frame, &mut k);
            let want = k.log_between(1.5, 20.0);
            scale(&rig, &effects, &mut e, want, &schedules[0], seed, dirt.command);
            effects.push(e);
        }
        let sizes = (0..effects.len()).map(|i| size(&rig, &effects, i, &schedules[0], seed, dirt.command)).collect();
        Self { seed, top, rig, dirt, effects, own, sizes, schedules }
    }

    /// What acts on a run: the second one has what an event left behind, and no drift of the first.
    #[must_use]
    pub fn acting(&self, which: usize) -> Vec<Effect> {
        let mut out = self.effects.clone();
        if which == 1 {
            let of_the_first = |e: &Effect| ["zero_drift", "tare_shift"].contains(&e.id) || e.id == "gain_change" && e.form == 1;
            out.retain(|e| !of_the_first(e));
            // what happened at an instant of the first run has happened
            out.iter_mut().for_each(|e| e.t0 = 0.0);
        }
        out
    }

    /// A run as it is logged, and which samples of each column a probe made up.
    #[must_use]
    pub fn run(&self, which: usize) -> (Run, Vec<Vec<bool>>) {
        let stream = 100 + 10 * which as u64;
        let run = run::run(&self.rig, &self.acting(which), &self.schedules[which], self.seed, stream, true);
        self.dirt.onto(run, &mut Chance::new(self.seed, 700 + which as u64))
    }

    /// Speed of each row at a command without any wander, by channel, thinned like the run. A jump of the command lies in the middle of its row's
    /// interval: when within it the log does not say.
    #[must_use]
    pub fn still(&self, which: usize) -> Run {
        let stream = 100 + 10 * which as u64;
        let mut schedule = self.schedules[which].clone();
        schedule.as_logged(self.rig.hz);
        let run = run::run(&self.rig, &self.acting(which), &schedule, self.seed, stream, false);
        self.dirt.onto(run, &mut Chance::new(self.seed, 700 + which as u64)).0
    }
}

/// Faults that show in one speed sensor.
const SENSORS: [&str; 5] = ["missed_pulses", "double_pulses", "alternating_period", "blade_twist", "coupling_slip"];

fn plain(id: &'static str, channel: &'static str, strength: f64) -> Effect {
    Effect { id, channel, strength, sign: 1.0, b: 1.0, c: 0.0, t0: 0.0, form: 0 }
}

/// What this rig has whatever is on top of it: none of it twice, none that the effect on top hides behind.
fn own_effects(rig: &mut Rig, ids: &[&'static str], k: &mut Chance) -> Vec<Effect> {
    let mut out = Vec::new();
    let free = |id: &str| ids.iter().all(|top| *top != id && compatible(id, top));
    if free("supply_sag") && k.happens(0.7) {
        rig.present[2] = true;
        out.push(plain("supply_sag", "voltage_v", k.log_between(0.005, 0.15)));
    }
    if free("spinup_lag") && k.happens(0.7) {
        let e = plain("spinup_lag", "rpm", k.log_between(0.04, 0.35));
        out.push(Effect { b: k.between(1.0, 1.8), ..e });
        out.push(plain("rotor_inertia", "current_a", k.log_between(1e-5, 1e-4)));
    }
    let meters: Vec<(usize, &'static str)> = [(0, "thrust_n"), (1, "torque_nm"), (2, "current_a")]
        .into_iter()
        .filter(|(i, _)| *i == 0 || rig.present[i - 1])
        .collect();
    for (_, name) in &meters {
        if free("channel_filter") && k.happens(0.35) {
            let e = plain("channel_filter", name, k.log_between(2.5 / rig.hz, 1.2));
            out.push(Effect { form: u8::from(k.happens(0.5)), ..e });
        }
    }
    for (i, name) in meters {
        if free("quantisation") && k.happens(0.2) {
            let step = rig.noise[i].fixed * k.log_between(2.0, 20.0);
            out.push(plain("quantisation", name, step));
        }
    }
    out
}

/// Bisects the strength of an effect on top until its size is right.
fn scale(rig: &Rig, own: &[Effect], e: &mut Effect, want: f64, schedule: &Schedule, seed: u64, command: bool) {
    let (lo, hi) = e.range(rig);
    let (mut lo, mut hi) = (lo.ln(), hi.ln());
    let mut reach = |strength: f64| {
        e.strength = strength;
        let all: Vec<Effect> = own.iter().cloned().chain([e.clone()]).collect();
        size(rig, &all, own.len(), schedule, seed, command).0
    };
    if reach(hi.exp()) < want {
        return;
    }
    for _ in 0..12 {
        let mid = 0.5 * (lo + hi);
        let got = reach(mid.exp());
        if (got / want - 1.0).abs() < 0.03 {
            return;
        }
        if got > want { hi = mid } else { lo = mid }
    }
}

#[cfg(test)]
mod tests {
    use super::super::size::SHOWN;
    use super::*;

    #[test]
    fn a_seed_says_all_and_rigs_differ() {
        let text = |s: u64| crate::blind::write::text(&Messy::new(s).rig, &Messy::new(s).run(0).0);
        assert_eq!(text(6), text(6));
        assert_ne!(text(6), text(8));
    }

    #[test]
    fn every_kind_of_mess_is_drawn() {
        let all: Vec<Messy> = (0..40).map(|k| Messy::new(2 * k)).collect();
        let has = |wanted: &dyn Fn(&Messy) -> bool| all.iter().filter(|m| wanted(m)).count();
        for id in ["supply_sag", "spinup_lag", "rotor_inertia", "channel_filter", "quantisation"] {
            assert!(has(&|m| m.effects[..m.own].iter().any(|e| e.id == id)) >= 3, "{id}");
        }
        assert!(has(&|m| !m.dirt.drops.is_empty()) >= 3 && has(&|m| m.dirt.gaps > 0) >= 3);
        assert!(has(&|m| m.dirt.sparse > 1) >= 3 && has(&|m| !m.dirt.command) >= 2);
        for n in 1..=4 {
            assert!(has(&|m| m.rig.speeds.len() == n) >= 2, "{n} speed channels");
        }
        let shown = all.iter().flat_map(|m| m.sizes.iter().take(m.own)).filter(|s| s.0 >= SHOWN).count();
        assert!(shown >= 20, "{shown} of the rigs' own effects can be seen");
    }

    /// A wander that all sensors see is no part of the contrast, so that a fault of one of them shows far below the wander.
    #[test]
    fn a_fault_of_one_sensor_is_sized_in_the_contrast() {
        let m = Messy::new(2);
        let mut rig = m.rig.clone();
        rig.speeds = vec![("rpm_beam", 1.0), ("rpm_hall", 1.0), ("rpm_opto", 1.0)];
        rig.speed_noise = 1e-4;
        let fault = Effect { b: 0.5 * rig.top, ..plain("blade_twist", "rpm_beam", 0.005) };
        let sized = |wander: f64| {
            let rig = Rig { common: (wander, 1.0), ..rig.clone() };
            size(&rig, std::slice::from_ref(&fault), 0, &m.schedules[0], 2, true)
        };
        let (calm, restless) = (sized(0.5), sized(50.0));
        assert_eq!(restless.1, "rpm_beam");
        assert!(restless.0 > 3.0 && (calm.0 / restless.0 - 1.0).abs() < 0.01, "{calm:?} {restless:?}");
    }
}
