//! What a model says of a powerplant from the command alone, as every peer needs it.
//!
//! What it is: settled speed, thrust, torque, current and voltage over the pulse; the rotor's lag; the quotients that peers ask for.
//! What can go wrong: a model without thrust or without a command has no curve; a channel that it lacks is not known and is not made up.
//! Units: SI, rev/min, us; `signal` is the share of the range from 1000 to 2000 us.
//! Reference: specification `formats.md`, "Powerplant model".

use crate::Failure;
use crate::fly::rotor::{ModelRotor, gathers, latency_of_rows_s};
use hal_sim::mission::RotorCurves;
use ident::model::{AddedEffect, Model};
use std::f64::consts::TAU;
use std::path::Path;

/// How the line about the supply's lead begins.
pub(super) const LEAD: &str = "resistance of the supply's lead";
/// Points of the curve.
const POINTS: usize = 101;
/// Signal from which on a run has seen full throttle: rigs end at 1990 us and more.
const FULL: f64 = 0.99;
/// Share of full thrust at which thrust has begun.
const BEGUN: f64 = 0.002;

/// One settled state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Point {
    /// Share of the pulse's range.
    pub(super) signal: f64,
    pub(super) rpm: f64,
    pub(super) thrust_n: f64,
    pub(super) torque_nm: Option<f64>,
    pub(super) current_a: Option<f64>,
    pub(super) voltage_v: Option<f64>,
}

/// The powerplant.
#[derive(Debug, Clone)]
pub(super) struct Powerplant {
    /// From 1000 to 2000 us.
    pub(super) points: Vec<Point>,
    /// Time in which the rotor comes to 63 % of a small step about 1500 us, s; nothing where the model holds no lag.
    pub(super) lag_s: Option<f64>,
    /// The log that the model is from.
    pub(super) source: String,
    /// Motor and propeller, as the log's head named them.
    pub(super) named: [Option<String>; 2],
    /// Pairs of poles, where the head told them.
    pub(super) pole_pairs: Option<i64>,
    /// Signal at which the rotor starts, in steps of 5 us.
    pub(super) turns: f64,
    /// Time by which the rotor answers late beside its lag, s, where the model holds one.
    pub(super) latency_s: Option<f64>,
    /// Time by which the rows of the model's log follow a command that jumps between two of them, s; how much of it is the rotor's no row tells.
    pub(super) row_latency_s: Option<f64>,
    /// Resistance of the supply's lead, ohm, where the model holds one.
    pub(super) lead_ohm: Option<f64>,
    /// Fall of the supply for the charge drawn, V/Ah, where the model holds one.
    pub(super) fall_v_per_ah: Option<f64>,
    /// The model holds a discharge or a heat, and the curve is that of the run's beginning.
    pub(super) begins: bool,
    /// Share of the pulse's range up to which the model's run went; nothing where its file does not tell.
    pub(super) measured: Option<f64>,
    /// Channels whose meter on the rig is late, and by how much, s.
    pub(super) late: Vec<(String, f64)>,
}

impl Powerplant {
    /// Of a model file.
    pub(super) fn of(path: &Path, model: &Model) -> Result<Self, Failure> {
        let rotor = ModelRotor::new(model, 0.0).map_err(|why| format!("{}: the model predicts {why}", path.display()))?;
        let has = |channel: &str| model.polynomials.iter().any(|p| p.channel == channel);
        let [torque, current, voltage] = ["torque_nm", "current_a", "voltage_v"].map(has);
        let point = |k: usize| {
            let signal = k as f64 / (POINTS - 1) as f64;
            let s = rotor.settled(1000.0 + 1000.0 * signal, 1.0);
            Point {
                signal,
                rpm: s.rpm,
                thrust_n: if s.rpm > 0.0 { s.thrust_n.max(0.0) } else { 0.0 },
                torque_nm: torque.then_some(s.torque_nm),
                current_a: current.then_some(s.current_a),
                voltage_v: voltage.then_some(s.voltage_v),
            }
        };
        let text = |key: &str| model.meta.get(key).and_then(toml::Value::as_str).map(str::to_owned);
        let estimate = |id: &str, name: &str| {
            let effect = model.effects.iter().find(|e| e.placed.effect.id() == id)?;
            effect.estimates.iter().find(|e| e.name == name || e.name.starts_with(&format!("{name}_"))).map(|e| e.value)
        };
        let late = |e: &AddedEffect| {
            let delay = e.placed.shape.first().copied().unwrap_or(0.0);
            e.placed.instance.channels.iter().map(move |channel| (channel.clone(), delay)).collect::<Vec<_>>()
        };
        let found = Self {
            points: (0..POINTS).map(point).collect(),
            lag_s: rotor.lag_s(),
            turns: (0..200)
                .map(|k| f64::from(k) / 200.0)
                .find(|u| rotor.settled(1000.0 + 1000.0 * u, 1.0).rpm > 0.0)
                .unwrap_or(1.0),
            latency_s: rotor.latency_s(),
            row_latency_s: latency_of_rows_s(model),
            source: model.runs_in_words(),
            named: ["motor", "propeller"].map(text),
            pole_pairs: model.meta.get("pole_pairs").and_then(toml::Value::as_integer),
            lead_ohm: estimate("supply_sag", "resistance"),
            fall_v_per_ah: estimate("battery_discharge", "slope"),
            begins: model.effects.iter().any(gathers),
            measured: model.highest_pulse_us.map(|us| ((us - 1000.0) / 1000.0).clamp(0.0, 1.0)),
            late: model.effects.iter().filter(|e| e.placed.effect.id() == "channel_delay").flat_map(late).collect(),
        };
        if found.full_n() <= 0.0 {
            return Err(format!(
                "{}: the model gives no thrust at full throttle; expected one identified from a run that lifts",
                path.display()
            )
            .into());
        }
        Ok(found)
    }

    /// Thrust at full throttle, N.
    pub(super) fn full_n(&self) -> f64 {
        self.points.last().map_or(0.0, |p| p.thrust_n)
    }

    /// Pulse in us and thrust in N up to which the run went, where that is not full throttle: what lies beyond is computed.
    pub(super) fn ends_at(&self) -> Option<(f64, f64)> {
        let signal = self.measured.filter(|signal| *signal < FULL)?;
        Some((1000.0 + 1000.0 * signal, self.share(signal) * self.full_n()))
    }

    /// What is measured and what is not, in words.
    pub(super) fn reach(&self) -> Option<String> {
        let full = self.full_n();
        match (self.ends_at(), self.measured) {
            (Some((us, n)), _) => {
                Some(format!("the run ends at {us:.0} us, {n:.2} N by the model; beyond is computed, {full:.2} N at 2000 us"))
            }
            (None, None) => Some("how far its run went the model does not tell: the upper end may be computed".to_owned()),
            _ => None,
        }
    }

    /// Least signal at which the rotor turns: what a peer calls its idle keeps it turning.
    pub(super) fn begins(&self) -> f64 {
        let turning = self.points.partition_point(|p| p.thrust_n <= BEGUN * self.full_n());
        self.points[turning.min(self.points.len() - 1)].signal
    }

    /// Share of full thrust at a signal, between the points linearly.
    pub(super) fn share(&self, signal: f64) -> f64 {
        let place = signal.clamp(0.0, 1.0) * (POINTS - 1) as f64;
        let k = (place as usize).min(POINTS - 2);
        let (a, b) = (self.points[k].thrust_n, self.points[k + 1].thrust_n);
        (a + (b - a) * (place - k as f64)) / self.full_n()
    }

    /// Share e of the square in thrust = (1 - e) x + e x^2, where x goes from 0 at `from` to 1 at full signal; least squares, within 0 to 1.
    pub(super) fn square_share(&self, from: f64) -> f64 {
        let (mut top, mut bottom) = (0.0, 0.0);
        for p in self.points.iter().filter(|p| p.signal > from) {
            let x = (p.signal - from) / (1.0 - from);
            top += (p.thrust_n / self.full_n() - x) * (x * x - x);
            bottom += (x * x - x).powi(2);
        }
        if bottom > 0.0 { (top / bottom).clamp(0.0, 1.0) } else { 0.0 }
    }

    /// Farthest distance of a peer's curve (share of full thrust over signal) from the model's, per cent of full thrust.
    pub(super) fn off_percent(&self, peer: impl Fn(f64) -> f64) -> f64 {
        let off = |p: &Point| (peer(p.signal) - p.thrust_n / self.full_n()).abs();
        100.0 * self.points.iter().map(off).fold(0.0, f64::max)
    }

    /// Thrust for the square of the angular speed, N.s^2, and torque for the thrust, m: least squares over the states that the run went through,
    /// as one constant has to do for all of them.
    pub(super) fn quotients(&self) -> (f64, Option<f64>) {
        let square = |p: &Point| (p.rpm * TAU / 60.0).powi(2);
        let seen = || self.points.iter().filter(|p| p.signal <= self.measured.unwrap_or(1.0));
        let for_square = |of: &dyn Fn(&Point) -> Option<f64>| {
            let top: Option<f64> = seen().map(|p| Some(of(p)? * square(p))).sum();
            top.map(|top| top / seen().map(|p| square(p).powi(2)).sum::<f64>())
        };
        let thrust = for_square(&|p| Some(p.thrust_n)).unwrap_or(0.0);
        (thrust, for_square(&|p| p.torque_nm).map(|torque| torque / thrust))
    }

    /// Supply at full throttle, V.
    pub(super) fn supply_v(&self) -> Option<f64> {
        self.points.last()?.voltage_v
    }

    /// Who turned what, for a head.
    pub(super) fn title(&self) -> String {
        let named = |k: usize, absent: &str| self.named[k].clone().unwrap_or_else(|| absent.to_owned());
        let supply = self.supply_v().map_or_else(|| "supply not known".to_owned(), |v| format!("{v:.2} V at full throttle"));
        format!("{} with {}, {supply}; model of {}", named(0, "motor not named"), named(1, "propeller not named"), self.source)
    }

    /// What stands in the place of a lag that nobody knows.
    pub(super) fn no_lag(&self) -> String {
        "time constant of the rotor: the model holds no lag (identify keeps none, close-loop names it where the run shows it); the speed is taken to be there at once"
            .to_owned()
    }

    /// What most peers have no key for.
    pub(super) fn beside(&self) -> Vec<String> {
        let lag = match self.lag_s {
            Some(lag_s) => format!("time constant of the rotor {lag_s:.4} s"),
            None => self.no_lag(),
        };
        let latency = self.latency_s.map(|s| format!("latency of the rotor's answer {s:.4} s, beside its time constant"));
        let latency = latency.or_else(|| self.of_the_rows());
        let lead = self.lead_ohm.map(|r| format!("{LEAD} {r:.4} ohm"));
        let fall = self.fall_v_per_ah.map(|v| format!("fall of the supply {v:.4} V for each ampere hour drawn"));
        std::iter::once(lag).chain(latency).chain(lead).chain(fall).chain(self.meters()).collect()
    }

    /// A latency that is the rows' and not known to be the rotor's.
    pub(super) fn of_the_rows(&self) -> Option<String> {
        self.row_latency_s.map(|s| {
            format!(
                "latency of the log's rows {s:.4} s: when between two rows a command came, and the mean over a row, are in it; how much is the rotor's is not known"
            )
        })
    }

    /// Meters of the rig that are late: not the powerplant's, but a simulation of the rig has them.
    pub(super) fn meters(&self) -> impl Iterator<Item = String> + '_ {
        self.late.iter().map(|(channel, s)| format!("delay of the rig's meter of {channel} {s:.4} s"))
    }
}
