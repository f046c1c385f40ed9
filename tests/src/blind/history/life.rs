//! One rig over its runs.
//!
//! What it is: what the rig has on every day (a lead, the air), what a day has of its own (supply, temperature, pressure, a new zero of the
//! load cell, another wear of the schedule), and what changes.
//! What can go wrong: a size out of an effect's reach is taken at the largest; one below the least that counts is drawn again.
//! Units: as the columns say; days since the first run.
//! Reference: module `effect`; lab air, 2 K and 5 hPa from day to day.

use crate::blind::chance::Chance;
use crate::blind::effect::{Effect, Frame};
use crate::blind::rig::{Day, Rig, poly};
use crate::blind::run::{self, Run};
use crate::blind::scenario::CLEAN;
use crate::blind::schedule::{Schedule, Shape};
use crate::blind::write;

/// What may come from one run to the next.
pub const CHANGES: [&str; 18] = [
    "supply_sag",
    "blade_damage",
    "bearing_friction",
    "gain_change",
    "channel_filter",
    "hysteresis",
    "missed_pulses",
    "creep",
    "spinup_lag",
    "thermal_zero",
    "alternating_period",
    "amplifier_saturation",
    "glitch_rows",
    "sample_hold",
    "quantisation",
    "channel_delay",
    "zero_drift",
    "coupling_slip",
];
/// Effects whose whole-run form only other runs show: their strength is drawn, over the whole.
const WHOLE: [&str; 3] = ["blade_damage", "bearing_friction", "gain_change"];
/// One seed in so many has a drift in the place of a change.
const DRIFTS: u64 = 10;
/// Most rows of a log.
const ROWS: f64 = 3600.0;

/// What becomes of a rig.
#[derive(Debug, Clone, PartialEq)]
pub enum Fate {
    /// Nothing.
    None,
    /// An effect from a run on.
    Change {
        /// First run that has it, from 0.
        first: usize,
    },
    /// The load cell's gain creeps away, over one for each week.
    Drift {
        /// Rate.
        rate: f64,
    },
}

/// A rig and its days.
#[derive(Debug, Clone)]
pub struct Life {
    /// Seed.
    pub seed: u64,
    /// The rig on no day.
    rig: Rig,
    /// What it has on every day.
    own: Vec<Effect>,
    /// What changes, if anything does.
    pub change: Option<Effect>,
    /// Its size.
    pub size: f64,
    /// What becomes of it.
    pub fate: Fate,
    /// Day of each run.
    pub days: Vec<f64>,
    /// Whether the logs are dated.
    pub dated: bool,
    schedules: Vec<Schedule>,
}

impl Life {
    /// Everything from one seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        (0..).map(|attempt| Self::attempt(seed, attempt)).find(Self::is_seen).expect("an attempt that counts")
    }

    /// Whether what changes can be seen at all: three floors, or two hundredths of the whole.
    fn is_seen(&self) -> bool {
        self.change.as_ref().is_none_or(|e| if WHOLE.contains(&e.id) { self.size >= 0.02 } else { self.size >= 3.0 })
    }

    fn attempt(seed: u64, attempt: u64) -> Self {
        let mut k = Chance::new(seed, 900 + attempt);
        let mut rig = Rig::draw(&mut k);
        rig.hz = rig.hz.min(20.0);
        // the head says the rate that is written
        rig.meta
            .iter_mut()
            .filter(|line| line.starts_with("sample_hz"))
            .for_each(|line| *line = format!("sample_hz = {:.1}", rig.hz));
        let id = if seed >= CLEAN || (seed / 2) % DRIFTS == DRIFTS - 1 { None } else { Some(Self::id(seed)) };
        if let Some(id) = id {
            Effect::equip(id, &mut rig, &mut k);
        }
        let runs = 10 + k.of(&[0, 2, 5, 8, 12, 16, 20]);
        let duration = k.log_between(110.0, 220.0).min(ROWS / rig.hz);
        let (low, high) = (1100.0, k.of(&[1950.0, 2000.0]));
        // what differs between up and down needs both
        let shape = k.of(&[Shape::UpDown, Shape::UpDown, Shape::Random, Shape::Visits, Shape::Ramp]);
        let one = Schedule::draw(shape, duration, low, high, &mut k);
        let same = k.happens(0.7);
        let mut schedules: Vec<Schedule> =
            (0..runs).map(|_| if same { one.clone() } else { Schedule::draw(shape, duration, low, high, &mut k) }).collect();
        if rig.aligned {
            schedules.iter_mut().for_each(|s| s.align(1.0 / rig.hz));
        }
        let mut at = 0.0;
        let mut day = |_| {
            at += k.of(&[1.0, 1.0, 2.0, 3.0, 7.0]);
            at
        };
        let days = (0..runs).map(&mut day).collect();
        let frame = Frame { shortest: duration, duration, charge: run::charge(&rig, &one) };
        let own = ["supply_sag", "air_density"].map(|id| Effect { strength: 1.0, ..Effect::draw(id, &rig, frame, &mut k) });
        let mut life = Self {
            seed,
            own: own.to_vec(),
            rig,
            change: None,
            size: 0.0,
            fate: Fate::None,
            days,
            dated: k.happens(0.5),
            schedules,
        };
        life.own[0].strength = k.between(0.005, 0.03);
        if let Some(id) = id {
            life.fate = Fate::Change { first: 3 + (k.between(0.0, 1.0) * (runs - 5) as f64) as usize };
            life.draw(id, frame, &mut k);
        } else if seed < CLEAN {
            life.fate = Fate::Drift { rate: k.sign() * k.log_between(0.003, 0.01) };
        }
        life
    }

    /// Which effect comes to the rig of a seed.
    fn id(seed: u64) -> &'static str {
        let turn = seed / 2;
        CHANGES[((turn - turn / DRIFTS) % CHANGES.len() as u64) as usize]
    }

    fn draw(&mut self, id: &'static str, frame: Frame, k: &mut Chance) {
        let mut e = Effect { t0: 0.0, ..Effect::draw(id, &self.rig, frame, k) };
        if WHOLE.contains(&id) {
            self.size = k.log_between(0.02, 0.08);
            e.strength = self.size;
            match id {
                "bearing_friction" => e.strength *= poly(&self.rig.torque, self.rig.top / 1000.0),
                "gain_change" => e.form = 0,
                _ => {}
            }
        } else {
            self.size = self.scale(&mut e, k.log_between(3.0, 20.0));
        }
        self.change = Some(e);
    }

    /// Bisects the strength until the size is right; what it came to.
    fn scale(&self, e: &mut Effect, want: f64) -> f64 {
        let (lo, hi) = e.range(&self.rig);
        let (mut lo, mut hi) = (lo.ln(), hi.ln());
        e.strength = hi.exp();
        let mut size = self.size_of(e);
        if size < want {
            return size;
        }
        for _ in 0..12 {
            let mid = 0.5 * (lo + hi);
            e.strength = mid.exp();
            size = self.size_of(e);
            if (size / want - 1.0).abs() < 0.05 {
                break;
            }
            if size > want { hi = mid } else { lo = mid }
        }
        size
    }

    fn size_of(&self, e: &Effect) -> f64 {
        let quiet = run::run(&self.rig, std::slice::from_ref(e), &self.schedules[0], self.seed, 100, false);
        run::sizes(&self.rig, &quiet).into_iter().map(|(_, s)| s).fold(0.0, f64::max)
    }

    /// The text of one run's log.
    #[must_use]
    pub fn log(&self, number: usize) -> String {
        let mut k = Chance::new(self.seed, 2000 + number as u64);
        let mut rig = self.rig.clone();
        rig.day = Day { volt: 0.05 * k.normal(), temperature: 2.0 * k.normal(), pressure: 5.0 * k.normal() };
        let mut effects = self.own.clone();
        let tared = Effect { id: "tare_shift", channel: "thrust_n", ..self.own[0].clone() };
        effects.push(Effect { strength: 0.01 * k.normal(), sign: 1.0, t0: 0.0, ..tared.clone() });
        match self.fate {
            Fate::Change { first } if number >= first => effects.extend(self.change.clone()),
            Fate::Drift { rate } => {
                effects.push(Effect {
                    id: "gain_change",
                    strength: rate * self.days[number] / 7.0,
                    sign: 1.0,
                    form: 0,
                    t0: 0.0,
                    ..tared
                });
            }
            _ => {}
        }
        if self.dated {
            let (month, day) = (1 + (self.days[number] / 28.0) as u32, 1 + (self.days[number] % 28.0) as u32);
            rig.meta.push(format!("date = \"2026-{month:02}-{day:02}\""));
        }
        let run: Run = run::run(&rig, &effects, &self.schedules[number], self.seed, 10_000 + 10 * number as u64, true);
        write::text(&rig, &run)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_says_all_and_clean_ones_have_no_change() {
        let lives = [CLEAN, CLEAN + 2].map(Life::new);
        assert!(lives.iter().all(|l| l.change.is_none() && l.fate == Fate::None));
        assert_eq!(lives[0].log(3), Life::new(CLEAN).log(3));
        assert_ne!(lives[0].log(3), lives[0].log(4));
        assert!(lives.iter().all(|l| (10..=30).contains(&l.days.len())));
    }

    #[test]
    fn every_change_is_drawn_and_drifts_are() {
        let ids: std::collections::BTreeSet<&str> = (0..20 * 10).step_by(2).map(Life::id).collect();
        assert_eq!(ids.len(), CHANGES.len());
        assert!(matches!(Life::new(2 * (DRIFTS - 1)).fate, Fate::Drift { .. }));
    }
}
