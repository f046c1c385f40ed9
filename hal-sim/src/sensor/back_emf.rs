//! A meter that counts the motor's electrical turns by its back-EMF, a cross-check on the four speed sensors.
//!
//! What it is: a meter clipped across two windings, as the thesis' K1: a comparator on the voltage between them, rising zero crossings
//! timed over a gate, divided by the pole pairs.
//! What can go wrong: below the comparator's threshold the motor makes too little voltage and the meter shows nothing; a wrong number of
//! pole pairs in the meter's menu scales its reading.
//! Units: V between two windings (amplitude); rev/min; s.
//! Reference: Beharie 2013 section 5.4.7, Eq. 5.11-5.12 and errata 5.11 (no-load only: rpm = KV (V - I R)). The threshold and the gate of
//! the K1 are not stated: 0.15 V and 0.5 s are assumed.

use crate::noise::{Source, Stream};
use crate::plant::BackEmf;

/// The meter's properties.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BackEmfMeter {
    /// Amplitude below which its comparator sees nothing, V.
    pub threshold_v: f64,
    /// Time over which it counts, s.
    pub gate_s: f64,
    /// Pole pairs set in its menu; `None` for those of the motor.
    pub pole_pairs: Option<u32>,
}

impl Default for BackEmfMeter {
    fn default() -> Self {
        Self { threshold_v: 0.15, gate_s: 0.5, pole_pairs: None }
    }
}

/// The meter at work.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BackEmfState {
    meter: BackEmfMeter,
    first_s: Option<f64>,
    /// The turning in which the last crossing came; its instant is asked for once a gate.
    last: Turning,
    crossings: u32,
    gate_end_s: f64,
    reading: Option<f64>,
}

impl BackEmfState {
    /// Switched on at time 0.
    #[must_use]
    pub fn new(meter: BackEmfMeter) -> Self {
        Self { meter, gate_end_s: meter.gate_s, ..Self::default() }
    }

    /// What it shows, rev/min.
    #[must_use]
    pub fn rpm(&self) -> Option<f64> {
        self.reading
    }

    /// The rotor turned evenly from `from` to `to` revolutions, neither negative, in the `dt_s` up to `now_s`, with `emf` at the windings.
    pub fn pass(&mut self, (from, to): (f64, f64), emf: Option<BackEmf>, now_s: f64, dt_s: f64) {
        if let Some(emf) = emf.filter(|e| e.amplitude_v >= self.meter.threshold_v && to > from) {
            let pairs = f64::from(emf.pole_pairs);
            let turning = Turning { begin: from * pairs, end: to * pairs, now_s, dt_s };
            let passed = whole(turning.end) - whole(turning.begin);
            if passed >= 1.0 {
                if self.crossings == 0 {
                    self.first_s = Some(turning.at(whole(turning.begin) + 1.0));
                }
                self.crossings += passed as u32;
                self.last = turning;
            }
        }
        if now_s < self.gate_end_s {
            return;
        }
        let pairs = emf.map(|e| f64::from(self.meter.pole_pairs.unwrap_or(e.pole_pairs)));
        self.reading = self.first_s.zip(pairs).filter(|_| self.crossings > 1).map(|(first, pairs)| {
            let periods = f64::from(self.crossings - 1);
            60.0 * periods / (self.last.at(whole(self.last.end)) - first) / pairs
        });
        (self.first_s, self.crossings) = (None, 0);
        self.gate_end_s += self.meter.gate_s;
    }
}

/// The meter's comparator alone, as a board sees its output: high for one half of each electrical turn.
#[derive(Debug, Clone)]
pub struct Comparator {
    meter: BackEmfMeter,
    jitter: Stream,
    /// Half turns up to the next change; a change to high at even ones.
    half: i64,
    /// Where it comes, electrical turns.
    at: f64,
    level: bool,
}

/// Standard deviation of the angle at which the comparator changes, electrical turns: 1 degree. What is left of the ESC's pulse-width modulation
/// behind the filter is assumed to be so much.
const JITTER: f64 = 1.0 / 360.0;
/// Most of it, so that changes keep their order.
const MOST: f64 = 0.2;

impl Comparator {
    /// At a rotor at rest.
    #[must_use]
    pub fn new(meter: BackEmfMeter, seed: u64) -> Self {
        Self { meter, jitter: Stream::new(seed, Source::BackEmf, 0), half: i64::MIN, at: f64::NEG_INFINITY, level: false }
    }

    /// Level of the output.
    #[must_use]
    pub fn level(&self) -> bool {
        self.level
    }

    /// The rotor turned evenly from `from` to `to` revolutions with `emf` at the windings: each change of the output, with the share of the step
    /// that has passed.
    pub fn turn(&mut self, (from, to): (f64, f64), emf: Option<BackEmf>, mut change: impl FnMut(bool, f64)) {
        let Some(emf) = emf.filter(|e| e.amplitude_v >= self.meter.threshold_v && to > from) else {
            self.half = i64::MIN; // it sees nothing, and begins anew where it sees something again
            return;
        };
        let pairs = f64::from(emf.pole_pairs);
        let (begin, end) = (from * pairs, to * pairs);
        if self.half == i64::MIN {
            self.half = (2.0 * begin) as i64;
            self.await_next();
        }
        while self.at <= end {
            let high = self.half % 2 == 0;
            if high != self.level {
                self.level = high;
                // one whose jitter puts it before this step comes with its beginning
                change(high, ((self.at - begin) / (end - begin)).max(0.0));
            }
            self.await_next();
        }
    }

    fn await_next(&mut self) {
        self.half += 1;
        self.at = 0.5 * self.half as f64 + (JITTER * self.jitter.normal()).clamp(-MOST, MOST);
    }
}

/// Even turning between two angles, electrical turns, in the time up to an instant.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Turning {
    begin: f64,
    end: f64,
    now_s: f64,
    dt_s: f64,
}

impl Turning {
    /// When it passed the angle `crossing`, s.
    fn at(&self, crossing: f64) -> f64 {
        self.now_s - self.dt_s * (self.end - crossing) / (self.end - self.begin)
    }
}

/// Whole turns in an angle that is not negative.
fn whole(turns: f64) -> f64 {
    (turns as i64) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(meter: BackEmfMeter, rpm: f64, volts: f64) -> Option<f64> {
        let mut state = BackEmfState::new(meter);
        let mut angle = 0.37;
        for ms in 1..=1000 {
            let next = angle + rpm / 60.0 * 1e-3;
            let emf = BackEmf { amplitude_v: volts, pole_pairs: 11 };
            state.pass((angle, next), Some(emf), 1e-3 * f64::from(ms), 1e-3);
            angle = next;
        }
        state.rpm()
    }

    #[test]
    fn it_counts_electrical_turns() {
        let rpm = after(BackEmfMeter::default(), 4321.0, 7.0).unwrap();
        assert!((rpm / 4321.0 - 1.0).abs() < 1e-9, "{rpm}");
        let wrong = after(BackEmfMeter { pole_pairs: Some(7), ..BackEmfMeter::default() }, 4200.0, 7.0).unwrap();
        assert!((wrong / 6600.0 - 1.0).abs() < 1e-9, "11 pairs counted as 7: {wrong}");
    }

    #[test]
    fn the_comparator_gives_an_edge_an_electrical_turn_and_none_where_it_sees_too_little() {
        let edges = |rpm: f64, volts: f64| {
            let mut comparator = Comparator::new(BackEmfMeter::default(), 3);
            let (mut angle, mut rises, mut last) = (0.37, Vec::new(), false);
            for ms in 0..1000 {
                let next = angle + rpm / 60.0 * 1e-3;
                let emf = BackEmf { amplitude_v: volts, pole_pairs: 11 };
                comparator.turn((angle, next), Some(emf), |high, share| {
                    assert!(high != last && (0.0..=1.0).contains(&share));
                    last = high;
                    rises.extend(high.then_some(f64::from(ms) + share));
                });
                angle = next;
            }
            rises
        };
        let rises = edges(4_321.0, 7.0);
        let turns = 4_321.0 / 60.0 * 11.0;
        assert!((rises.len() as f64 - turns).abs() <= 1.0, "{} edges in {turns} turns", rises.len());
        let mean = (rises[rises.len() - 1] - rises[0]) / (rises.len() - 1) as f64;
        assert!((mean * turns / 1000.0 - 1.0).abs() < 1e-4, "{mean} ms a turn");
        let spread = rises.windows(2).map(|w| (w[1] - w[0] - mean).powi(2)).sum::<f64>() / rises.len() as f64;
        let expected = 2.0f64.sqrt() * JITTER * mean;
        assert!((spread.sqrt() / expected - 1.0).abs() < 0.1, "{} and {expected} ms", spread.sqrt());
        assert!(edges(4_321.0, 0.14).is_empty());
    }

    #[test]
    fn too_little_voltage_shows_nothing() {
        assert_eq!(after(BackEmfMeter::default(), 80.0, 0.14), None);
        assert!(after(BackEmfMeter::default(), 90.0, 0.16).is_some());
        assert_eq!(after(BackEmfMeter::default(), 0.0, 0.16), None);
    }
}
