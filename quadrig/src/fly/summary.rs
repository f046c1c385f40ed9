//! What came of a flight, for a reader and for a machine.
//!
//! What it is: hover, margins, time aloft, the modes about the hover, and how the flight ended.
//! What can go wrong: a vehicle that cannot hover says so instead of its hover.
//! Units: as printed.
//! Reference: specification `flight.md`, "The body"; docs/mission.md, "The summary".

use hal_sim::flight::attitude::to_euler;
use hal_sim::flight::{Airframe, Flying, G, Vector};
use hal_sim::mission::{AirframeFile, Flight, HoverPoint, Mission, Modes, RotorCurves, Touch, apart, hover, modes};
use ident::report::{WIDEST, wrapped};
use serde_json::{Value, json};

/// Most touches that have a line each.
const TOLD: usize = 5;

/// The summary of a flight.
pub(super) struct Summary {
    /// Its name.
    pub(super) mission: String,
    /// What turned the rotors.
    pub(super) powerplant: String,
    weight_n: f64,
    charge_ah: f64,
    rotors: usize,
    /// Where it hovers and how it answers there.
    pub(super) hover: Option<(HoverPoint, Modes)>,
    flight_s: f64,
    highest_m: f64,
    fastest_m_s: f64,
    steepest_deg: f64,
    /// Touches of the ground.
    touches: Vec<Touch>,
    /// Whether the flight ended with a touch.
    pub(super) ends_in_touch: bool,
    /// Whether it stands on the ground in the end.
    on_ground: bool,
    board: Option<Off>,
    /// What the controller ended or changed, and when, s.
    pub(super) events: Vec<(f64, String)>,
    place_m: [f64; 3],
    velocity_m_s: [f64; 3],
    attitude_deg: [f64; 3],
}

/// What the IMU board was off by in flight: at the most and rms, deg.
struct Off {
    tilt_deg: [f64; 2],
    heading_deg: [f64; 2],
}

impl Off {
    /// Nothing of a flight without a board, or of one whose filter has not started.
    fn of(flight: &Flight) -> Option<Self> {
        let flying = flight.seen.iter().filter(|(s, _)| s.t_s >= 0.0);
        let off: Vec<(f64, f64)> = flying.filter_map(|(s, truth)| Some(apart(&s.attitude?, truth))).collect();
        let figures = |of: &dyn Fn(&(f64, f64)) -> f64| {
            let most = off.iter().map(|o| of(o).abs()).fold(0.0, f64::max);
            let square = off.iter().map(|o| of(o) * of(o)).sum::<f64>() / off.len() as f64;
            [most, square.sqrt()].map(f64::to_degrees)
        };
        (!off.is_empty()).then(|| Self { tilt_deg: figures(&|o| o.0), heading_deg: figures(&|o| o.1) })
    }
}

impl Summary {
    /// Of a flight that was flown; `curves` hold at `reference_density`, kg/m^3.
    pub(super) fn of(
        mission: &Mission,
        file: &AirframeFile,
        airframe: &Airframe,
        (curves, reference_density): (&dyn RotorCurves, f64),
        powerplant: String,
        flight: &Flight,
    ) -> Self {
        let rows = &flight.rows;
        let around = mission.surroundings();
        let share = mission.ground_density() / reference_density;
        let hover = hover(airframe, curves, share).map(|at| (at, modes(airframe, &at, curves, &around)));
        let most = |of: &dyn Fn(&Flying) -> f64| rows.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
        let last = &rows[rows.len() - 1];
        let m = &last.motion;
        let lowest = airframe.rotors.iter().map(|r| (m.attitude * Vector::from(r.place)).z).fold(f64::NEG_INFINITY, f64::max);
        Self {
            mission: mission.name.clone(),
            powerplant,
            weight_n: airframe.mass_kg * G,
            charge_ah: file.charge_ah(),
            rotors: airframe.rotors.len(),
            hover,
            flight_s: last.t_s,
            highest_m: most(&|f| -f.motion.place.z),
            fastest_m_s: most(&|f| f.motion.velocity.norm()),
            steepest_deg: most(&|f| tilt(f).to_degrees()),
            touches: flight.touches.clone(),
            ends_in_touch: mission.ends_on_ground && flight.touches.iter().any(|touch| touch.t_s >= last.t_s),
            on_ground: m.place.z + lowest > 0.0,
            board: Off::of(flight),
            events: flight.events.clone(),
            place_m: m.place.into(),
            velocity_m_s: m.velocity.into(),
            attitude_deg: to_euler(&m.attitude).map(f64::to_degrees),
        }
    }

    /// Minutes on the charge on board; nothing where the current is not known.
    fn minutes(&self, current_a: f64) -> Option<f64> {
        (current_a > 0.0).then(|| HoverPoint::minutes(self.charge_ah, self.rotors, current_a))
    }

    /// For a reader.
    pub(super) fn text(&self) -> String {
        // a list that does not fit stands on a line of its own
        let mut lead = self.lead();
        if lead.chars().count() > WIDEST {
            lead = lead.replace("; of the rig", ";\nof the rig");
        }
        let mut out = format!("{lead}\n{}\n", wrapped(&self.told(), 0));
        for row in self.table() {
            out += &format!("{:<9} {}\n", row[0], wrapped(&row[1], 10));
        }
        out
    }

    /// What was flown on what.
    pub(super) fn lead(&self) -> String {
        format!("{}: {:.2} s on {}", self.mission, self.flight_s, self.powerplant)
    }

    /// How it ended, how far it went and how well the board kept up, in plain words.
    pub(super) fn told(&self) -> String {
        let ended: Vec<String> = self.events.iter().map(|(t, what)| sentence(*t, what)).collect();
        let height = shown(-self.place_m[2]);
        let touched = self.touched();
        let end = match (ended.is_empty(), self.ends_in_touch) {
            (false, _) => ended.join(" "),
            (true, true) => touched.clone(),
            (true, false) if self.on_ground => format!("{touched} After {:.1} s it is on the ground.", self.flight_s),
            (true, false) => {
                let going = match shown(-self.velocity_m_s[2]) {
                    v if v > 0.0 => format!("rises at {v:.1} m/s"),
                    v if v < 0.0 => format!("sinks at {:.1} m/s", -v),
                    _ => "keeps its height".to_owned(),
                };
                format!("{touched} After {:.1} s it is {height:.1} m up and {going}.", self.flight_s)
            }
        };
        let end = end.trim_start();
        let far = format!("At the most it was {:.1} m high and leaned by {:.1} degrees.", self.highest_m, self.steepest_deg);
        let board = self.board.as_ref().map_or_else(String::new, |off| {
            format!(
                " The board was off by up to {:.1} degrees in tilt and {:.1} in heading.",
                off.tilt_deg[0], off.heading_deg[0]
            )
        });
        let touched = if ended.is_empty() || touched.is_empty() { String::new() } else { format!(" {touched}") };
        format!("{end} {far}{touched}{board}")
    }

    /// The touches of the ground, in plain words; nothing without one.
    fn touched(&self) -> String {
        let hardest = self.touches.iter().max_by(|a, b| a.down_m_s.total_cmp(&b.down_m_s));
        let (Some(first), Some(hardest)) = (self.touches.first(), hardest) else { return String::new() };
        let at = |touch: &Touch| format!("after {:.1} s, at {:.1} m/s downwards", touch.t_s, shown(touch.down_m_s));
        match self.touches.len() {
            1 => format!("It touched the ground {}.", at(first)),
            n => format!("It touched the ground {n} times: first {}; hardest {}.", at(first), at(hardest)),
        }
    }

    /// What came of it: a word and what there is to say, a row each.
    pub(super) fn table(&self) -> Vec<Vec<String>> {
        let mut rows: Vec<(&str, String)> = match &self.hover {
            Some((at, modes)) => self.about_hover(at, modes),
            None => vec![("hover", format!("none: full throttle does not carry {:.2} N", self.weight_n))],
        };
        let (highest, fastest, steepest) = (self.highest_m, self.fastest_m_s, self.steepest_deg);
        rows.push(("flight", format!("highest {highest:.1} m, fastest {fastest:.2} m/s, steepest {steepest:.1} deg")));
        if let Some(off) = &self.board {
            let of = |[most, rms]: [f64; 2]| format!("{most:.2} deg at the most, {rms:.2} rms");
            rows.push(("ahrs", format!("tilt off by {}; heading by {}", of(off.tilt_deg), of(off.heading_deg))));
        }
        for (t, what) in &self.events {
            rows.push(("control", format!("{t:.2} s: {what}")));
        }
        for touch in self.touches.iter().take(TOLD) {
            let (t, speed) = (touch.t_s, shown(touch.down_m_s));
            rows.push(("ground", format!("touched after {t:.2} s at {speed:.2} m/s downwards")));
        }
        if let Some(more) = self.touches.len().checked_sub(TOLD).filter(|more| *more > 0) {
            rows.push(("ground", format!("touched {more} times more")));
        }
        let ([n, e, d], [vn, ve, vd]) = (self.place_m.map(shown), self.velocity_m_s.map(shown));
        let [roll, pitch, yaw] = self.attitude_deg.map(shown);
        let place = format!("{n:.1} m north, {e:.1} m east, {:.1} m up; {vn:.2}, {ve:.2}, {:.2} m/s", shown(-d), shown(-vd));
        rows.push(("end", format!("{place}; roll {roll:.1}, pitch {pitch:.1}, yaw {yaw:.1} deg")));
        rows.into_iter().map(|(word, text)| vec![word.to_owned(), text]).collect()
    }

    fn about_hover(&self, at: &HoverPoint, m: &Modes) -> Vec<(&'static str, String)> {
        let [roll, pitch, yaw] = m.turning_per_us.map(|w| (100.0 * w).to_degrees());
        let heave = if m.heave_rad_s > 0.0 {
            format!("heave by the air's density {:.0} s period, undamped", core::f64::consts::TAU / m.heave_rad_s)
        } else {
            "no heave".to_owned()
        };
        let coning = if m.coning_rad_s > 0.0 { format!("coning {:.3} rad/s; ", m.coning_rad_s) } else { String::new() };
        let minutes = |current_a: f64| self.minutes(current_a).map_or_else(|| "?".to_owned(), |m| format!("{m:.1}"));
        let (pulse, rotor) = (at.pulse_us, &at.rotor);
        vec![
            (
                "hover",
                format!(
                    "{pulse:.1} us ({:.1} % throttle), {:.0} rev/min, {:.3} N and {:.2} A a rotor",
                    (pulse - 1000.0) / 10.0,
                    rotor.rpm,
                    rotor.thrust_n,
                    rotor.current_a
                ),
            ),
            (
                "margin",
                format!(
                    "thrust to weight {:.2}; {:.0} us up to full throttle, {:.3} N for 1 us on all",
                    at.thrust_to_weight,
                    2000.0 - pulse,
                    m.thrust_per_us * self.rotors as f64
                ),
            ),
            (
                "aloft",
                format!(
                    "{} min in hover, {} min at full throttle on {} Ah",
                    minutes(rotor.current_a),
                    minutes(at.full.current_a),
                    self.charge_ah
                ),
            ),
            (
                "modes",
                format!(
                    "rotor lag {:.3} s; {heave}; {coning}all else neutral: roll and pitch 4 integrators each, yaw 2",
                    m.rotor_lag_s
                ),
            ),
            ("answer", format!("100 us on one rotor: roll {roll:.1}, pitch {pitch:.1}, yaw {yaw:.2} deg/s^2")),
        ]
    }

    /// For a machine.
    pub(super) fn json(&self) -> String {
        let hover = self.hover.as_ref().map_or(Value::Null, |(at, m)| {
            json!({
                "pulse_us": at.pulse_us,
                "rpm": at.rotor.rpm,
                "thrust_n": at.rotor.thrust_n,
                "current_a": at.rotor.current_a,
                "thrust_to_weight": at.thrust_to_weight,
                "minutes": self.minutes(at.rotor.current_a),
                "minutes_full": self.minutes(at.full.current_a),
                "modes": {
                    "thrust_n_per_us": m.thrust_per_us,
                    "turning_rad_s2_per_us": m.turning_per_us,
                    "rotor_lag_s": m.rotor_lag_s,
                    "heave_rad_s": m.heave_rad_s,
                    "coning_rad_s": m.coning_rad_s,
                },
            })
        });
        let summary = json!({
            "format": "quadrig-flight-summary 1",
            "mission": self.mission,
            "powerplant": self.powerplant,
            "weight_n": self.weight_n,
            "hover": hover,
            "flight_s": self.flight_s,
            "highest_m": self.highest_m,
            "fastest_m_s": self.fastest_m_s,
            "steepest_deg": self.steepest_deg,
            "ahrs": self.board.as_ref().map(|off| json!({ "tilt_deg": off.tilt_deg, "heading_deg": off.heading_deg })),
            "events": self.events.iter().map(|(t, what)| json!({ "t_s": t, "what": what })).collect::<Vec<_>>(),
            "touched_s": self.touches.first().map(|touch| touch.t_s),
            "touched_m_s": self.touches.first().map(|touch| touch.down_m_s),
            "touches": self.touches.iter().map(|touch| json!({ "t_s": touch.t_s, "down_m_s": touch.down_m_s })).collect::<Vec<_>>(),
            "end": { "place_m": self.place_m, "velocity_m_s": self.velocity_m_s, "attitude_deg": self.attitude_deg },
        });
        format!("{summary:#}")
    }
}

/// What the controller did, and when, as a sentence.
fn sentence(t_s: f64, what: &str) -> String {
    let at = format!("After {t_s:.1} s");
    let why = |kind: &str| what.strip_prefix(kind).and_then(|rest| rest.strip_prefix(": "));
    match (what, why("motors off"), why("no take-off"), why("controlled descent")) {
        ("landed, motors off", ..) => format!("{at} it landed and the motors went off."),
        (_, Some(why), ..) => format!("{at} the motors went off: {why}."),
        (_, _, Some(why), _) => format!("{at} it had not taken off: {why}."),
        (_, _, _, Some(why)) => format!("{at} a controlled descent began: {why}."),
        _ => format!("{at}: {what}."),
    }
}

/// A number without the sign of a rounding error.
fn shown(value: f64) -> f64 {
    if value.abs() < 5e-3 { 0.0 } else { value }
}

/// Angle between body and earth vertical, rad.
fn tilt(f: &Flying) -> f64 {
    (f.motion.attitude * hal_sim::flight::Vector::z()).z.clamp(-1.0, 1.0).acos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_controller_did_is_a_sentence() {
        assert_eq!(sentence(106.61, "landed, motors off"), "After 106.6 s it landed and the motors went off.");
        assert_eq!(sentence(3.0, "motors off: the gyro is lost"), "After 3.0 s the motors went off: the gyro is lost.");
        assert_eq!(sentence(0.0, "no take-off: the gyro is lost"), "After 0.0 s it had not taken off: the gyro is lost.");
        let descends = sentence(30.0, "controlled descent: the magnetometer is lost");
        assert_eq!(descends, "After 30.0 s a controlled descent began: the magnetometer is lost.");
        assert_eq!(sentence(1.0, "something else"), "After 1.0 s: something else.");
    }
}
