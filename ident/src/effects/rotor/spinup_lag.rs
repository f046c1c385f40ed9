//! `spinup_lag`: the rotor takes time to follow the command.
//!
//! What it is: rpm follows its static value by a first-order lag, with different time constants up and down, or as a rotor between winding and
//! air does, with a controller that brakes while it runs (`braked`) or does not (`coasting`): see [`crate::effects::rotor::coasting`].
//! What can go wrong: needs steps and samples inside the transient; with none it is not offered. After a gap in time
//! its state is the speed that the first row measures.
//! Units: s.
//! Reference: first-order motor model, Beharie 2013, section 5.7.3 (settling after each step).

use crate::channel::Context;
use crate::effects::design::TargetDesign;
use crate::effects::rotor::coasting::{Coasting, Rotor};
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, operator, speeds};
use crate::signal::stretches::{CALM_US, LATE_S, latest};

/// See the module.
pub(crate) struct SpinupLag;

/// Form of a rotor that nothing brakes but air and friction.
const COASTING: &str = "coasting";
/// The same where the command jumps from row to row.
const COASTING_OF_STEPS: &str = "coasting_of_steps";
/// Form of a rotor that a running controller brakes, too.
const BRAKED: &str = "braked";
/// The same where the command jumps from row to row.
const BRAKED_OF_STEPS: &str = "braked_of_steps";
/// Time constant of the quickest rotors, s.
const QUICK: f64 = 0.04;
/// Time in which the air alone halves the full speed, s: 0.05 s of a motor of three grams at 40 000 rev/min, whose inertia is 6e-8 kg.m2 at
/// 0.0055 N.m, to that of a flywheel.
const AIR: (f64, f64) = (0.01, 60.0);
/// Logarithm of how many times longer a rotor takes on its way down than on its way up, and its standard deviation: from one time, where
/// the controller brakes, to two, where the air does (0.0125 and 0.025 s in RotorS: Furrer et al. 2016), so that both ends are one standard
/// deviation out. `tau_air` over `tau_up` is 1.0 to 1.5 on eleven real runs of five stands, and 2.6 on one. A run that only climbs says nothing of
/// the way down.
const SLOWER: (f64, f64) = (0.35, 0.35);

impl Effect for SpinupLag {
    fn id(&self) -> &'static str {
        "spinup_lag"
    }

    fn about(&self) -> About {
        About {
            title: "Rotor follows the command with a lag",
            equation: "tau d(rpm)/dt = rpm_static(pulse) - rpm, tau = tau_up or tau_down; a rotor between winding and air, v = rpm over that at 2000 us, g = v_static(t - latency): dv/dt = (g - v) (1/tau_up + (g + v - 1)/tau_air); not below -v^2/tau_air - friction where nothing brakes (coasting) or the motor is off",
            source: "Beharie 2013, section 5.7.3; rotor: J dw/dt = kt i - kQ w^2 - Q_f with i = (V - kt w)/R, coasting: not below 0, Eq. 2.21 as corrected and 5.11",
            depends_on: &["pulse_us", "time_since_step"],
            signature: "rpm(pulse) is off for a moment after every step and right before the next; thrust(rpm) holds throughout",
            look_alikes: &["channel_filter", "channel_delay"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new("the rotor", found.tell("tau_up", |v| format!("takes {v} to follow the command"), "follows the command late"))
    }

    fn is_of_every_rig(&self) -> bool {
        true
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn stage(&self) -> Stage {
        Stage::Output
    }

    fn runs_on(&self, _: &Instance) -> [bool; 2] {
        [false, false]
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        let channels = speeds(context);
        if context.time_is_row || channels.is_empty() {
            return Vec::new();
        }
        let forms =
            if operator::commands_abruptly(context) { ["", COASTING_OF_STEPS, BRAKED_OF_STEPS] } else { ["", COASTING, BRAKED] };
        forms.iter().map(|form| Instance::new(&channels, form)).collect()
    }

    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape> {
        let dt = context.step();
        if !instance.form.is_empty() {
            let base = dt.max(QUICK);
            let (up, late) = ([0.6, 1.5].map(|k| k * base), [0.4, 1.6].map(|k| f64::min(k * dt, 0.5 * dt + LATE_S)));
            let tau_up = Shape { name: "tau_up", unit: "s", range: (0.02 * dt, (100.0 * dt).max(5.0)), starts: up.to_vec() };
            let tau_air = Shape { name: "tau_air", unit: "s", range: AIR, starts: vec![0.3, 1.0] };
            let friction = Shape { name: "friction", unit: "1/s", range: (0.0, 10.0), starts: vec![0.1] };
            let latency = Shape { name: "latency", unit: "s", range: (0.0, latest(&context.t)), starts: late.to_vec() };
            return vec![tau_up, tau_air, friction, latency];
        }
        // on a log of many rows a second ten rows are still quick for a rotor
        let slow = [0.5, 2.0].into_iter().filter(|tau| *tau > 15.0 * dt);
        let starts: Vec<f64> = [0.3, 1.0, 3.0, 10.0].iter().map(|k| k * dt).chain(slow).collect();
        let range = (0.02 * dt, (100.0 * dt).max(5.0));
        vec![
            Shape { name: "tau_up", unit: "s", range, starts: starts.clone() },
            Shape { name: "tau_down", unit: "s", range, starts },
            operator::phase(),
        ]
    }

    fn prior(&self, _: &Context, instance: &Instance, shape: &[f64]) -> f64 {
        let [up, down, ..] = shape else { return 0.0 };
        // air that would have more than all of the approach has all of it
        let least = if instance.form.is_empty() { f64::MIN_POSITIVE } else { 1.0 };
        -0.5 * (((down / up).max(least).ln() - SLOWER.0) / SLOWER.1).powi(2)
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        Vec::new()
    }

    /// The air has not more than all of the approach.
    fn report(&self, _: &Context, _: &Instance, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
        let Some((up, se)) = fitted.iter().find(|e| e.name == "tau_up").map(|e| (e.value, e.se)) else { return fitted };
        for air in fitted.iter_mut().filter(|e| e.name == "tau_air" && e.value < up) {
            (air.value, air.se) = (up, se);
        }
        fitted
    }

    fn apply(&self, context: &Context, instance: &Instance, shape: &[f64], _: usize, design: &mut TargetDesign) {
        if let Some(rotor) = rotor(instance, shape) {
            let jumps = instance.form.ends_with(operator::OF_STEPS);
            let coasting = Coasting::new(context, rotor, jumps).starting_at(&context.starts);
            design.map_together(|columns| coasting.of(columns));
            starts(context, design, || coasting.carried(&context.starts));
            return;
        }
        let ([up, down, phase], Some(pulse)) = (shape, &context.pulse) else { return };
        // which of the two constants holds is decided by the command alone, so that every column sees the same operator
        let mut state = pulse.first().copied().unwrap_or(0.0);
        let tau = [down.max(1e-9), up.max(1e-9)];
        let mut decays = [[operator::Decay::new(); 2]; 2];
        let interval = |(p, t): (&[f64], &[f64])| {
            let rising = usize::from(p[1] >= state);
            let h = (t[1] - t[0]) / tau[rising];
            let [early, late] = &mut decays[rising];
            let left = late.of(h);
            state = p[1] + (state - p[1]) * left;
            if (p[1] - p[0]).abs() > CALM_US {
                // a command jumps somewhere between two rows
                operator::Interval::jump(early.of(h * phase), late.of(h * (1.0 - phase)))
            } else {
                operator::Interval::change(left, operator::weight_of_ramp(h, left))
            }
        };
        let intervals = pulse.windows(2).zip(context.t.windows(2)).map(interval).collect();
        let lag = operator::Lag::of_intervals(intervals).starting_at(&context.starts);
        design.map_together(|columns| lag.of(columns));
        starts(context, design, || lag.carried(&context.starts));
    }
}

/// The rotor of a shape; nothing for a lag of first order.
fn rotor(instance: &Instance, shape: &[f64]) -> Option<Rotor> {
    let [tau_up, tau_air, friction, latency] = *shape else { return None };
    let braked = [BRAKED, BRAKED_OF_STEPS].contains(&instance.form.as_str());
    Some(Rotor { tau_up, tau_air, friction, latency, braked })
}

/// Where the log did not see what the rotor did before a row, it begins there with the speed that was measured.
fn starts(context: &Context, design: &mut TargetDesign, carried: impl FnOnce() -> Vec<f64>) {
    if !context.starts.is_empty() {
        design.fixed.resize(context.len(), 0.0);
        design.fixed.iter_mut().zip(carried()).for_each(|(f, c)| *f += c);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Log;

    #[test]
    fn a_rotor_does_not_take_ten_times_longer_on_its_way_down() {
        let context = Context::new(&Log::default(), None);
        for form in ["", COASTING] {
            let prior = |down: f64| SpinupLag.prior(&context, &Instance::new(&["rpm"], form), &[0.1, down, 0.0, 0.05]);
            assert!(prior(0.14) > -0.1 && prior(0.2) > -0.6, "{form}");
            assert!(prior(1.0) < -10.0, "{form}");
        }
        // air that would have more than all of the approach has all of it
        let all = |air: f64| SpinupLag.prior(&context, &Instance::new(&["rpm"], COASTING), &[0.1, air, 0.0, 0.05]);
        assert_eq!(all(0.1), all(0.01));
    }
}
