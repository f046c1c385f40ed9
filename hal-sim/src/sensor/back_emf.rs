//! A meter that counts the motor's electrical turns by its back-EMF, a cross-check on the four speed sensors.
//!
//! What it is: a meter clipped across two windings, as the thesis' K1: a comparator on the voltage between them, rising zero crossings
//! timed over a gate, divided by the pole pairs.
//! What can go wrong: below the comparator's threshold the motor makes too little voltage and the meter shows nothing; a wrong number of
//! pole pairs in the meter's menu scales its reading.
//! Units: V between two windings (amplitude); rev/min; s.
//! Reference: Beharie 2013 section 5.4.7, Eq. 5.11-5.12 and errata 5.11 (no-load only: rpm = KV (V - I R)). The threshold and the gate of
//! the K1 are not stated: 0.15 V and 0.5 s are assumed.

/// What the windings give at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BackEmf {
    /// Amplitude of the voltage between two windings, V: the back-EMF constant 60/(2 pi KV) times the speed in rad/s.
    pub amplitude_v: f64,
    /// Electrical turns in a turn of the rotor.
    pub pole_pairs: u32,
}

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
    fn too_little_voltage_shows_nothing() {
        assert_eq!(after(BackEmfMeter::default(), 80.0, 0.14), None);
        assert!(after(BackEmfMeter::default(), 90.0, 0.16).is_some());
        assert_eq!(after(BackEmfMeter::default(), 0.0, 0.16), None);
    }
}
