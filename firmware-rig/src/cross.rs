//! What is measured of the rotor and its supply a second time: by the ESC itself, and by a back-EMF meter.
//!
//! What it is: [`CrossChecks`], the telemetry line ([`crate::esc_line`]) and a capture channel of the motor's electrical turns. Both are told
//! beside the four speed sensors and the analogue channels.
//! What can go wrong: a dead or garbled line, a meter that is silent or disagrees: told by their verdicts, and no reason for a stop. The
//! consensus of the speed sensors, and what protections judge by, never have them in: the ESC's word is some 30 ms old and comes from the very part
//! that is to be protected against, and below its threshold the meter does not see a rotor that turns. One exception: where no speed sensor is
//! fitted, a limit of the speed is judged by the meter, which can only stop a run that nothing would have stopped.
//! Units: ticks of the capture timer, rev/min.
//! Reference: Beharie 2013 section 5.4.7 (back-EMF meter as a cross-check); specification `rig.md`, "Four RPM capture channels".

use crate::bank::CaptureBank;
use crate::capture::CaptureChannel;
use crate::config::Config;
use crate::esc_line::{EscCounts, EscLine};
use frame::esc::{EscCode, EscVerdict};
use frame::rig::{CaptureCode, CaptureVerdict};
use frame::units::{RevPerMin, Ticks};

/// What arrived for the cross-checks since the last tick.
#[derive(Debug, Clone, Copy)]
pub struct Beside<'a> {
    /// Bytes of the ESC's telemetry, with [`crate::esc_line::LINE_ERROR`] where one came damaged.
    pub esc: &'a [u16],
    /// Captures of the back-EMF meter, one an electrical turn, in ticks of the capture timer modulo 2^32.
    pub back_emf: &'a [u32],
    /// One of these was overwritten, or their queue was full.
    pub over_capture: bool,
}

impl Beside<'_> {
    /// Neither wire is there.
    pub const UNWIRED: Self = Self { esc: &[], back_emf: &[], over_capture: false };
}

/// The two cross-checks.
#[derive(Debug, Clone)]
pub(crate) struct CrossChecks {
    line: Option<EscLine>,
    asked: bool,
    told: EscVerdict,
    meter: CaptureChannel,
}

impl CrossChecks {
    /// Those of `config`.
    pub(crate) fn new(config: &Config) -> Self {
        Self {
            line: config.esc_telemetry.map(|_| EscLine::default()),
            asked: config.esc_telemetry.is_some_and(|esc| esc.asked),
            told: EscVerdict::default(),
            meter: CaptureChannel::new(config.back_emf, config.timer_hz, config.capture),
        }
    }

    /// Those of `config` in the place of those so far, with nothing heard yet.
    pub(crate) fn refit(&mut self, config: &Config) {
        self.line = config.esc_telemetry.map(|_| EscLine::default());
        self.asked = config.esc_telemetry.is_some_and(|esc| esc.asked);
        self.told = EscVerdict::default();
        self.meter.refit(config.back_emf);
    }

    /// Which are fitted: bit 4 the telemetry, bit 5 the meter, as [`frame::Hello::present`] has them.
    pub(crate) fn fitted(&self) -> u8 {
        u8::from(self.line.is_some()) << 4 | u8::from(self.meter.marks > 0) << 5
    }

    /// Takes what arrived since the last tick; gives the telemetry's verdict where it is another than before.
    pub(crate) fn take(&mut self, now: Ticks, beside: &Beside<'_>) -> Option<EscVerdict> {
        self.meter.take(now, beside.back_emf, beside.over_capture);
        let line = self.line.as_mut()?;
        line.take(now, beside.esc);
        let verdict = line.verdict(now);
        (core::mem::replace(&mut self.told, verdict) != verdict).then_some(verdict)
    }

    /// What a sample tells of them; to be called behind [`CaptureBank::sample`].
    pub(crate) fn sample(&mut self, now: Ticks, bank: &CaptureBank) -> (Option<EscCode>, Option<CaptureCode>) {
        (self.line.as_ref().map(|line| line.code(now)), (self.meter.marks > 0).then(|| self.metered(now, bank)))
    }

    fn metered(&mut self, now: Ticks, bank: &CaptureBank) -> CaptureCode {
        let meter = &mut self.meter;
        // an edge too few or too many in an earlier revolution shows as disagreement; a look at each period of the reading takes its time
        let latest = usize::from(meter.marks) + 2;
        let mut code = meter.code_by(now, bank.turning_others(now), latest);
        let speed = meter.speed().filter(|_| code.verdict == CaptureVerdict::Nominal);
        let apart = match (speed, bank.agreed()) {
            (Some(speed), Some((middle, tolerance))) => (speed.0 - middle).abs() > tolerance * middle,
            _ => false,
        };
        if apart && meter.deviations > 0 {
            code.verdict = CaptureVerdict::Disagrees;
        }
        meter.deviations = u8::from(apart);
        meter.told(now);
        code
    }

    /// Speed over the last revolution by the back-EMF meter, for a limit that nothing else could judge.
    pub(crate) fn speed(&self, now: Ticks) -> Option<RevPerMin> {
        self.meter.latest_speed(now)
    }

    /// What the telemetry line has heard.
    pub(crate) fn counts(&self) -> EscCounts {
        self.line.as_ref().map_or(EscCounts::default(), EscLine::counts)
    }

    /// Whether the ESC is to be asked for a frame in this tick.
    pub(crate) fn asks(&mut self, now: Ticks) -> bool {
        self.asked && self.line.as_mut().is_some_and(|line| line.asks(now))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    const MS: u64 = 84_000;

    /// A meter of 11 pole pairs beside an optical sensor with one tab.
    struct Pair {
        bank: CaptureBank,
        cross: CrossChecks,
        now: u64,
    }

    impl Pair {
        fn new() -> Self {
            let config = Config { marks: [0, 1, 0, 0], back_emf: 11, ..Config::thesis_570kv() };
            Self { bank: CaptureBank::new(&config), cross: CrossChecks::new(&config), now: 0 }
        }

        /// Takes what came since the last tick.
        fn take(&mut self, now: u64, opto: &[u64], meter: &[u64]) {
            let [opto, meter] = [opto, meter].map(|list| list.iter().map(|at| *at as u32).collect::<Vec<u32>>());
            self.now = now;
            self.bank.take(Ticks(now), &[&[], &opto, &[], &[]], &[false; 4]);
            self.cross.take(Ticks(now), &Beside { back_emf: &meter, ..Beside::UNWIRED });
        }

        fn told(&mut self) -> CaptureVerdict {
            self.bank.sample(Ticks(self.now));
            self.cross.sample(Ticks(self.now), &self.bank).1.map_or(CaptureVerdict::Absent, |code| code.verdict)
        }
    }

    /// A meter that sees nothing is no fault while the rotor stands or hardly turns: below its threshold it cannot see it.
    #[test]
    fn a_silent_meter_is_lost_only_beside_a_rotor_that_turns_well() {
        let beside = |revolution_ms: u64| {
            let mut pair = Pair::new();
            for n in 0..3000 {
                let opto = [n * MS];
                let marks: &[u64] = if revolution_ms > 0 && n % revolution_ms == 0 { &opto } else { &[] };
                pair.take(n * MS, marks, &[]);
            }
            pair.told()
        };
        assert_eq!(
            [beside(0), beside(240), beside(20)],
            [CaptureVerdict::Stopped, CaptureVerdict::Stopped, CaptureVerdict::Lost]
        );
    }

    /// A reading of the meter holds many revolutions: its last one is looked at period by period, the earlier ones are not.
    #[test]
    fn the_last_revolution_of_the_meter_is_looked_at_for_missed_edges() {
        let missed = |back: u64| {
            let mut pair = Pair::new();
            let edges: Vec<u64> = (1..=100).filter(|n| *n != 100 - back).map(|n| n * MS).collect(); // 11 ms a revolution
            for turn in 1..=9 {
                pair.take(11 * turn * MS, &[11 * turn * MS], &[]);
            }
            pair.take(100 * MS, &[], &edges);
            pair.told()
        };
        assert_eq!(
            [missed(1), missed(2), missed(11), missed(20)].map(|told| told == CaptureVerdict::Missed),
            [false, true, true, false]
        );
    }

    /// 1 % to the last bit is agreement, as among the sensors.
    #[test]
    fn one_per_cent_to_the_last_bit_is_agreement() {
        let speed = |revolution: u64| 60.0 * Ticks::HZ as f32 / revolution as f32;
        let edge = (20_000..40_000u64).map(|n| n * 50).find_map(|middle| {
            let off = speed(middle) - 0.01 * speed(middle);
            let near = (speed(1) / off) as u64 / 11 * 11;
            let same = |r: &u64| (speed(*r) - speed(middle)).abs() == 0.01 * speed(middle);
            [near - 11, near, near + 11].into_iter().find(same).map(|other| (middle, other))
        });
        let (middle, other) = edge.expect("one of twenty thousand");
        let verdict = |turn: u64| {
            let mut pair = Pair::new();
            let mut last = CaptureVerdict::Absent;
            for n in 1..=60 {
                // ten revolutions of the sensor a sample, the meter's edges up to there
                let (from, to) = ((n - 1) * 4 * middle, n * 4 * middle);
                let opto: Vec<u64> = (1..=4).map(|k| from + k * middle).collect();
                let meter: Vec<u64> = (from / (turn / 11) + 1..=to / (turn / 11)).map(|k| k * (turn / 11)).collect();
                pair.take(to, &opto, &meter);
                last = pair.told();
            }
            last
        };
        assert_eq!([verdict(other), verdict(other + 110)], [CaptureVerdict::Nominal, CaptureVerdict::Disagrees]);
    }
}
