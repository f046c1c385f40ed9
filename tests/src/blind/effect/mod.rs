//! Effects of the generator: what each one is, how it is drawn, what its true parameters are.
//!
//! What it is: one record for every effect; `drive` holds those of supply, motor and propeller, `cell` those of the load cell,
//! `sense` those of the speed sensors and of the acquisition.
//! What can go wrong: a strength out of the physical range is refused by [`Effect::range`], which bounds the search for a size.
//! Units: those of the parameter table.
//! Reference: specification `closing-the-loop.md`, effect list and parameter table.

pub mod cell;
pub mod drive;
pub mod sense;

use super::chance::Chance;
use super::rig::{Rig, poly};

/// Every effect that the campaign draws and that the library is expected to know.
pub const KNOWN: [&str; 33] = [
    "supply_sag",
    "battery_discharge",
    "current_limit",
    "thermal_derate",
    "throttle_quantisation",
    "spinup_lag",
    "bearing_friction",
    "reynolds_thrust",
    "air_density",
    "blade_flex",
    "blade_damage",
    "stall",
    "zero_drift",
    "thermal_zero",
    "creep",
    "hysteresis",
    "gain_change",
    "beam_resonance",
    "torque_crosstalk",
    "amplifier_saturation",
    "tare_shift",
    "missed_pulses",
    "double_pulses",
    "alternating_period",
    "blade_twist",
    "encoder_drag",
    "coupling_slip",
    "channel_delay",
    "channel_filter",
    "sample_hold",
    "clock_drift",
    "glitch_rows",
    "quantisation",
];

/// One effect with its numbers. What `strength` and the rest mean depends on the effect; [`Effect::truth`] names them.
#[derive(Debug, Clone)]
pub struct Effect {
    /// Identifier of the effect list, or a name that starts with `unknown_`.
    pub id: &'static str,
    /// The one channel that it acts on, where it acts on one.
    pub channel: &'static str,
    /// The number that is scaled until the size is right; carries its sign in `sign`.
    pub strength: f64,
    /// Plus or minus one.
    pub sign: f64,
    /// Second number.
    pub b: f64,
    /// Third number.
    pub c: f64,
    /// Onset within the run, s.
    pub t0: f64,
    /// Which of several forms.
    pub form: u8,
}

/// What an effect may rely on when it is drawn.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    /// Shortest of the two runs, s.
    pub shortest: f64,
    /// Length of the run, s.
    pub duration: f64,
    /// Charge that the clean run draws, Ah.
    pub charge: f64,
}

impl Effect {
    /// Draws an effect for a rig.
    #[must_use]
    pub fn draw(id: &'static str, rig: &Rig, f: Frame, k: &mut Chance) -> Self {
        let measured: Vec<&'static str> = [("thrust_n", true), ("torque_nm", rig.present[0]), ("current_a", rig.present[1])]
            .into_iter()
            .filter(|p| p.1)
            .map(|p| p.0)
            .collect();
        let mut speed = measured.clone();
        speed.extend(rig.speeds.iter().map(|s| s.0));
        let mut e = Self {
            id,
            channel: "thrust_n",
            strength: 1.0,
            sign: k.sign(),
            b: 0.0,
            c: 0.0,
            t0: k.between(0.25, 0.75) * f.shortest,
            form: u8::from(k.happens(0.5)),
        };
        match id {
            "battery_discharge" => e.b = f.charge,
            "thermal_derate" => e.b = k.log_between(8.0, 60.0),
            "spinup_lag" => e.b = k.between(0.6, 1.8),
            "bearing_friction" | "encoder_drag" => {
                e.b = if k.happens(0.4) { k.between(0.2, 1.0) * 30.0 / rig.top } else { 0.0 };
                e.c = k.of(&[0.0, 1.0, k.clone().between(0.1, 0.9)]);
            }
            "blade_flex" | "stall" | "blade_twist" | "coupling_slip" => e.b = k.between(0.45, 0.8) * rig.top,
            "blade_damage" => e.b = k.between(-0.5, 1.0),
            "creep" => e.b = k.log_between(4.0, 60.0),
            "hysteresis" => e.b = k.between(0.03, 0.15),
            "gain_change" => e.b = f.duration,
            "beam_resonance" => {
                e.b = k.between(0.45, 0.9) * rig.top / 60.0 * if e.form == 1 { 2.0 } else { 1.0 };
                e.c = k.log_between(0.008, 0.05);
            }
            "channel_delay" | "channel_filter" | "sample_hold" => e.channel = k.of(&speed),
            "quantisation" => e.channel = k.of(&measured),
            "glitch_rows" => {
                e.channel = k.of(&measured);
                e.b = k.log_between(0.03, 0.6);
            }
            "missed_pulses" | "double_pulses" | "dead_rotor_speed" => {
                let names: Vec<&'static str> = rig.speeds.iter().map(|s| s.0).collect();
                e.channel = k.of(&names);
                e.c = 1.0 / rig.hz;
            }
            "alternating_period" => {
                e.channel = rig.speeds.iter().map(|s| s.0).find(|n| *n == "rpm_hall").unwrap_or(rig.speeds[0].0)
            }
            _ => super::unknown::draw(&mut e, rig, f, k),
        }
        if id == "blade_twist" {
            e.channel = "rpm_beam";
        } else if id == "coupling_slip" {
            e.channel = "rpm_encoder";
        }
        e
    }

    /// Bounds of the strength.
    #[must_use]
    pub fn range(&self, rig: &Rig) -> (f64, f64) {
        let step = 1.0 / rig.hz;
        match self.id {
            "supply_sag" => (3e-4, 0.8),
            "battery_discharge" => (0.003, 1.3),
            "current_limit" | "amplifier_saturation" => (0.002, 0.7),
            "thermal_derate" => (1e-3, 1.0),
            "throttle_quantisation" => (0.5, 60.0),
            "spinup_lag" => (step.max(0.03), 3.0),
            "bearing_friction" | "encoder_drag" => (1e-6, 0.6 * poly(&rig.torque, rig.top / 1000.0)),
            "reynolds_thrust" => (0.01, 0.45),
            "air_density" => (0.3, 25.0),
            "blade_flex" | "stall" => (0.002, 0.9),
            "blade_damage" => (5e-4, 0.4),
            "zero_drift" => (1e-7, 0.1),
            "thermal_zero" => (1e-5, 1.0),
            "creep" => (3e-4, 0.3),
            "hysteresis" => (1e-4, 3.0),
            "gain_change" => (2e-4, 0.4),
            "beam_resonance" => (1e-6, 0.5),
            "torque_crosstalk" => (0.05, 80.0),
            "tare_shift" => (1e-4, 3.0),
            // a handful of hits in a run, at the least
            "missed_pulses" | "double_pulses" => {
                (if self.form == 0 { 0.0015 / (rig.top / 120.0 * self.c).max(1.0) } else { 0.0015 }, 0.3)
            }
            "alternating_period" => (1e-3, 20.0),
            "blade_twist" | "coupling_slip" => (1e-4, 0.4),
            "channel_delay" => (0.7 * step, 6.0),
            // a window below two samples is a delay to any reader
            "channel_filter" => (if self.form == 0 { 2.2 * step } else { 0.8 * step }, 6.0),
            "sample_hold" => (1.6 * step, 8.0),
            "clock_drift" => (1e-5, 0.05),
            "glitch_rows" => (0.0015, 0.03),
            "quantisation" => (1e-6, 2.0),
            "dead_rotor_speed" => (1e-3, 0.6),
            _ => super::unknown::range(self.id),
        }
    }

    /// Signed strength.
    #[must_use]
    pub fn signed(&self) -> f64 {
        self.sign * self.strength
    }

    /// Whether single rows are hit by chance, so that no model can predict them.
    #[must_use]
    pub fn by_chance(&self) -> bool {
        matches!(
            self.id,
            "missed_pulses"
                | "double_pulses"
                | "alternating_period"
                | "glitch_rows"
                | "unknown_gain_walk"
                | "unknown_telegraph"
                | "beam_resonance"
        )
    }

    /// True parameters under the shared names of the table.
    #[must_use]
    pub fn truth(&self, rig: &Rig) -> Vec<(&'static str, f64)> {
        let (a, s) = (self.strength, self.signed());
        match self.id {
            "supply_sag" => vec![("resistance", a)],
            "battery_discharge" => vec![("capacity", self.b / a)],
            "current_limit" => vec![("limit", drive::limit(self, rig))],
            "thermal_derate" => vec![("tau", self.b)],
            "throttle_quantisation" | "quantisation" => vec![("step", a)],
            "spinup_lag" => vec![("tau_up", a), ("tau_down", a * self.b)],
            "bearing_friction" => vec![("constant", a), ("viscous", a * self.b), ("t0", self.t0), ("share", self.c)],
            "encoder_drag" => vec![("constant", a), ("share", self.c)],
            "reynolds_thrust" => vec![("exponent", a)],
            "air_density" => vec![("exponent", 1.0)],
            "blade_damage" => vec![("thrust_change", -a), ("t0", self.t0)],
            // the smooth form has no sharp onset
            "blade_flex" if self.form == 1 => Vec::new(),
            "blade_flex" | "stall" | "blade_twist" | "coupling_slip" => vec![("onset", self.b)],
            "zero_drift" => vec![("rate", s)],
            "thermal_zero" => vec![("coefficient", s)],
            "creep" => vec![("amplitude", s), ("tau", self.b)],
            "hysteresis" => vec![("width", s)],
            "gain_change" if self.form == 0 => vec![("gain_change", s), ("t0", self.t0)],
            "gain_change" => vec![("rate", s / self.b)],
            // twice a turn at twice the frequency looks the same, so that only the damping is comparable then
            "beam_resonance" if self.form == 1 => vec![("damping_ratio", self.c)],
            "beam_resonance" => vec![("natural_frequency", self.b), ("damping_ratio", self.c)],
            "torque_crosstalk" => vec![("coefficient", s)],
            "amplifier_saturation" => vec![("level", cell::level(self, rig))],
            "tare_shift" => vec![("offset", s), ("t0", self.t0)],
            "missed_pulses" | "double_pulses" => vec![("probability", a)],
            "alternating_period" => vec![("angle", a)],
            "channel_delay" => vec![("delay", a)],
            "channel_filter" if self.form == 0 => vec![("window", a)],
            "channel_filter" => vec![("tau", a)],
            "sample_hold" => vec![("period", a)],
            "clock_drift" => vec![("rate", a)],
            "dead_rotor_speed" => vec![("factor", 1.0 - a)],
            _ => Vec::new(),
        }
    }

    /// Makes the rig one on which the effect can be seen at all: the sensor that it belongs to is there.
    pub fn equip(id: &str, rig: &mut Rig, k: &mut Chance) {
        let needs = |rig: &mut Rig, name: &'static str| {
            if !rig.speeds.iter().any(|s| s.0 == name) {
                rig.speeds.push((name, 1.0));
            }
        };
        match id {
            "missed_pulses" | "double_pulses" | "alternating_period" | "blade_twist" | "coupling_slip" | "dead_rotor_speed" => {
                rig.speeds = ["rpm_beam", "rpm_opto", "rpm_hall", "rpm_encoder"].map(|n| (n, 1.0)).to_vec();
                let gone = k.of(&["", "rpm_opto", "rpm_beam", "rpm_encoder"]);
                rig.speeds.retain(|s| s.0 != gone);
                match id {
                    "blade_twist" => needs(rig, "rpm_beam"),
                    "coupling_slip" => needs(rig, "rpm_encoder"),
                    _ => {}
                }
            }
            "encoder_drag" => {
                needs(rig, "rpm_encoder");
                rig.speeds.retain(|s| s.0 != "rpm");
            }
            "thermal_zero" | "air_density" => rig.present[3] = true,
            "supply_sag" | "battery_discharge" => rig.present[2] |= k.happens(0.8),
            "torque_crosstalk" => {
                rig.present[0] = true;
                rig.turbulence = k.between(0.01, 0.03);
            }
            "beam_resonance" => rig.strain_rms = k.happens(0.7),
            "unknown_humidity" if !rig.decoys.contains(&"humidity_pct") => rig.decoys.push("humidity_pct"),
            "unknown_shunt_heat" => rig.present[1] = true,
            "unknown_torque_band" => rig.present[0] = true,
            _ => {}
        }
    }
}

/// Whether two effects may share a run: not two that act on the same reading in the same way.
#[must_use]
pub fn compatible(p: &str, q: &str) -> bool {
    const ALIKE: [&[&str]; 4] = [
        &["missed_pulses", "double_pulses", "alternating_period", "dead_rotor_speed", "blade_twist", "coupling_slip"],
        &["channel_delay", "channel_filter", "sample_hold", "clock_drift", "glitch_rows", "quantisation"],
        &["blade_flex", "stall", "reynolds_thrust", "amplifier_saturation"],
        &["encoder_drag", "bearing_friction"],
    ];
    p != q && !ALIKE.iter().any(|g| g.contains(&p) && g.contains(&q))
}
