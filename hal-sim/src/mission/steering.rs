//! Who steers: the controller on its way, and what it does when something fails.
//!
//! What it is: every 4 ms the set point of the mission, the attitude of the board and the last word of the positioning system become pulses.
//! What can go wrong: a lost chip of the board ends the way: the vehicle comes down where it is, without turning, and lands; without the gyro,
//! or when it does not follow, the motors stop at once. Each end is told with its time.
//! Units: s, us, m.
//! Reference: specification `flight.md`, "Missions".

use super::aboard::Seen;
use super::sections::ControllerSection;
use crate::flight::autopilot::{Autopilot, INTERVAL_S, Mixer, SetPoint, Told};
use crate::flight::{Motion, Vector};
use crate::noise::{Source, Stream};

/// Pulse of a rotor that waits for the take-off, and of one that is off, us.
const IDLE_US: f64 = 1080.0;
const OFF_US: f64 = 1000.0;
/// Speed of a descent that nobody planned, m/s.
const DESCENT_M_S: f64 = 0.6;
/// How far below ground a set point must be for a landing, how near to it the vehicle, m, and how slowly it may still rise or sink, m/s. It may
/// slide: the ground has no friction.
const LANDED_M: [f64; 3] = [0.3, 0.15, 0.3];
/// Height of the set point from which the rotors begin to carry, m.
const TAKES_OFF_M: f64 = 0.02;

/// What the vehicle does.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Phase {
    Waits,
    Flies,
    /// Comes down since then from there.
    Descends(f64, SetPoint),
    Off,
}

/// The controller of a flight.
#[derive(Debug)]
pub(super) struct Steering {
    section: ControllerSection,
    autopilot: Autopilot,
    streams: Vec<Stream>,
    phase: Phase,
    seen: Option<Seen>,
    place: Vector,
    velocity: Vector,
    pulses: Vec<f64>,
    /// What ended or changed the flight, and when.
    pub(super) events: Vec<(f64, String)>,
}

impl Steering {
    /// For a flight of `rotors`.
    pub(super) fn new(section: ControllerSection, mixer: Mixer, rotors: usize, seed: u64) -> Self {
        Self {
            autopilot: Autopilot::new(section.gains, mixer),
            section,
            streams: (0..6).map(|axis| Stream::new(seed, Source::Wind, 16 + axis)).collect(),
            phase: Phase::Waits,
            seen: None,
            place: Vector::zeros(),
            velocity: Vector::zeros(),
            pulses: vec![OFF_US; rotors],
            events: Vec::new(),
        }
    }

    /// What the board said last.
    pub(super) fn sees(&mut self, seen: Seen) {
        self.seen = Some(seen);
    }

    /// Whether the motors are off for good.
    pub(super) fn is_over(&self) -> bool {
        self.phase == Phase::Off
    }

    /// Pulses for millisecond `ms` of the flight.
    pub(super) fn millisecond(&mut self, ms: u64, truth: &Motion) -> &[f64] {
        let positioning = self.section.positioning;
        if ms.is_multiple_of(u64::from(1000 / positioning.rate_hz)) {
            let noise: Vec<f64> = self.streams.iter_mut().map(Stream::normal).collect();
            self.place = truth.place + Vector::from_column_slice(&noise[..3]) * positioning.place_m;
            self.velocity = truth.velocity + Vector::from_column_slice(&noise[3..]) * positioning.velocity_m_s;
        }
        if ms.is_multiple_of((INTERVAL_S * 1000.0) as u64) {
            self.decide(ms as f64 * 1.0e-3);
        }
        &self.pulses
    }

    fn decide(&mut self, t_s: f64) {
        self.look(t_s);
        let Some((seen, attitude)) = self.seen.and_then(|seen| Some((seen, seen.attitude?))) else { return };
        let wanted = match self.phase {
            Phase::Off => return self.pulses.fill(OFF_US),
            Phase::Waits | Phase::Flies => self.section.set_point(t_s),
            Phase::Descends(since_s, from) => {
                let down = Vector::new(0.0, 0.0, DESCENT_M_S);
                Some(SetPoint { place: from.place + down * (t_s - since_s), velocity: down, ..from })
            }
        };
        let Some(wanted) = wanted else { return self.pulses.fill(IDLE_US) };
        if self.phase == Phase::Waits {
            if wanted.place.z > -TAKES_OFF_M {
                return self.pulses.fill(IDLE_US);
            }
            self.phase = Phase::Flies;
        }
        let told = Told { attitude, rate: seen.rate, place: self.place, velocity: self.velocity };
        let [below, near, slow] = LANDED_M;
        if wanted.place.z > below && self.place.z > -near && self.velocity.z.abs() < slow {
            return self.stop(t_s, "landed, motors off");
        }
        if !self.autopilot.tick(&told, &wanted, &mut self.pulses) {
            self.stop(t_s, "motors off: the vehicle does not follow");
        }
    }

    /// What the board has lost.
    fn look(&mut self, t_s: f64) {
        let lost = self.seen.and_then(|seen| seen.lost());
        match (self.phase, lost) {
            (Phase::Flies | Phase::Descends(..), Some("gyro")) => self.stop(t_s, "motors off: the gyro is lost"),
            (Phase::Waits, Some(chip)) => self.stop(t_s, &format!("no take-off: the {chip} is lost")),
            (Phase::Flies, Some(chip)) => {
                let seen = self.seen.and_then(|s| s.attitude).unwrap_or_default();
                let heading = crate::flight::attitude::to_euler(&seen)[2];
                let from = SetPoint { place: self.place, velocity: Vector::zeros(), heading };
                self.phase = Phase::Descends(t_s, from);
                self.events.push((t_s, format!("controlled descent: the {chip} is lost")));
            }
            _ => {}
        }
    }

    fn stop(&mut self, t_s: f64, why: &str) {
        self.phase = Phase::Off;
        self.pulses.fill(OFF_US);
        self.events.push((t_s, why.to_owned()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::{Airframe, Rotation};
    use crate::mission::WayPoint;

    /// What happens to a vehicle that moves as `velocity` at `up_m` while its set point goes from 1 m above ground to 1 m below it.
    fn ends(up_m: f64, velocity: Vector) -> Vec<(f64, String)> {
        let place = |at_s: f64, up_m: f64| WayPoint { at_s, north_m: 0.0, east_m: 0.0, up_m, heading_deg: 0.0 };
        let section = ControllerSection { way: vec![place(0.0, 1.0), place(1.0, -1.0)], ..ControllerSection::default() };
        let mixer = Mixer::new(&Airframe::thesis(1e-4), 1684.0, 0.008, 0.01);
        let mut steering = Steering::new(section, mixer, 4, 1);
        let truth = Motion { place: Vector::new(0.0, 0.0, -up_m), velocity, ..Motion::default() };
        steering.sees(Seen { t_s: 0.0, attitude: Some(Rotation::identity()), rate: Vector::zeros(), alive: u8::MAX });
        for ms in 0..2_000 {
            steering.millisecond(ms, &truth);
        }
        steering.events
    }

    /// The ground has no friction: a vehicle that stands on it and slides has landed.
    #[test]
    fn what_slides_on_the_ground_has_landed() {
        for sideways in [0.0, 1.0, 5.0] {
            let events = ends(-0.002, Vector::new(0.0, sideways, 0.0));
            // the set point is 0.3 m under ground after 0.65 s
            assert!(matches!(&events[..], [(t, how)] if how == "landed, motors off" && (0.65..0.8).contains(t)), "{events:?}");
        }
        for (up_m, sinks) in [(0.1, 1.0), (0.5, 0.0)] {
            let events = ends(up_m, Vector::new(0.0, 0.0, sinks));
            assert!(events.is_empty(), "{up_m} m, {sinks} m/s: {events:?}");
        }
    }
}
