//! Strain bridge and its amplifier, up to the ADC pin.
//!
//! What it is: full bridge on the beam, instrumentation amplifier with a zero, rails and an output stage that may fall slower
//! than it rises, a visco-elastic share of the beam (creep), divider, and the meter's own filter.
//! What can go wrong: beyond its rails the amplifier saturates; the pin then shows the rail.
//! Units: newton of lift (up is positive) in, volt at the ADC pin out.
//! Reference: Beharie 2013 Eq. 5.47-5.55 (corrected: V = 6 K F L G V_in/(b h^2 E)), Table 7; errata "signal after the amplifier".

use super::beam::BeamMode;
use super::meter::{Meter, MeterState};

/// Share of a change of load that the joint's friction holds back until it slips (assumed).
const JOINT_SHARE: f64 = 0.3;
/// Time over which the joint feels the load, s (assumed): several turns, so that the shaking of one does not narrow its loop.
const JOINT_S: f64 = 0.05;
/// Standard gravity, m/s^2.
const G: f64 = 9.806_65;

/// Parameters of bridge and amplifier.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bridge {
    /// Amplifier output per newton at the tip, V/N.
    pub volt_per_newton: f64,
    /// Amplifier output of the unloaded beam, V.
    pub zero_v: f64,
    /// Rails of the amplifier output, V.
    pub rails_v: (f64, f64),
    /// Divider between amplifier and ADC pin.
    pub divider: f64,
    /// Mass of motor and tachometer on the beam, kg; it pulls down.
    pub tip_mass_kg: f64,
    /// Time constant of the output stage while it rises, s.
    pub rise_s: f64,
    /// Time constant of the output stage while it falls, s.
    pub fall_s: f64,
    /// Time constant of the meter's RC filter ahead of the ADC, s; 0 where there is none.
    pub filter_s: f64,
    /// Share of the load that the beam gives only after [`Bridge::creep_s`]; 0 where there is none.
    pub creep_share: f64,
    /// Time constant of the creep, s.
    pub creep_s: f64,
    /// Width of the loop of the readings between rising and falling load, N: dry friction in the joint of the beam.
    pub hysteresis_n: f64,
    /// Digital meter ahead of the ADC.
    pub meter: Meter,
    /// Zero shift with temperature, N/K.
    pub zero_n_per_k: f64,
    /// Temperature at which the zero was set, degC.
    pub zero_temperature_c: f64,
}

impl Default for Bridge {
    /// Table 7 at length 115 mm and gain 1000: 231.4 g/V, zero 2.30 V, 244 g on the beam, divider 0.5.
    fn default() -> Self {
        let (k, length, gain, excitation) = (2.0, 0.115, 1000.0, 11.5);
        let (b, h, e) = (0.020, 0.003, 200.0e9);
        Self {
            volt_per_newton: 6.0 * k * length * gain * excitation / (b * h * h * e),
            zero_v: 2.30,
            rails_v: (0.05, 5.0),
            divider: 0.5,
            tip_mass_kg: 0.244,
            rise_s: 0.4e-3,
            fall_s: 0.4e-3,
            filter_s: 0.0,
            creep_share: 0.0,
            creep_s: 60.0,
            hysteresis_n: 0.0,
            meter: Meter::default(),
            zero_n_per_k: 0.0,
            zero_temperature_c: 23.0,
        }
    }
}

impl Bridge {
    /// Pin voltage of a resting, tared rig, V.
    #[must_use]
    pub fn resting_v(&self) -> f64 {
        self.divider * (self.zero_v + self.volt_per_newton * self.tip_mass_kg * G)
    }

    /// Lift per volt at the pin, N/V; negative because lift unloads the beam.
    #[must_use]
    pub fn newton_per_volt(&self) -> f64 {
        -1.0 / (self.volt_per_newton * self.divider)
    }
}

/// State of amplifier, creep and filter.
#[derive(Debug, Clone, PartialEq)]
pub struct BridgeState {
    bridge: Bridge,
    creep_n: f64,
    lift_n: f64,
    /// Load as the joint feels it, N.
    joint_n: f64,
    stuck_n: f64,
    output_v: f64,
    pin_v: f64,
    meter: MeterState,
    rise: f64,
    fall: f64,
    filter: f64,
    creep: f64,
    joint: f64,
    /// Amplifier output of the beam with nothing but the motor on it, V.
    empty_v: f64,
}

/// What acts on beam and bridge in the steps of a block.
#[derive(Debug, Clone, Copy)]
pub struct Load<'a> {
    /// Thrust, N.
    pub thrust_n: &'a [f64],
    /// Force of the unbalance, N.
    pub shaking_n: &'a [f64],
    /// Torque on the arm, N.m.
    pub torque_nm: &'a [f64],
    /// Temperature of the rig, degC.
    pub temp_c: &'a [f64],
    /// Shift of the zero, N, and what each newton metre of torque adds to it.
    pub zero_n: (f64, f64),
    /// Factor on the reading.
    pub gain: f64,
}

impl Load<'_> {
    /// Force on the beam, shift of the zero and temperature, step by step.
    #[inline]
    fn steps(&self) -> impl Iterator<Item = (f64, f64, f64)> {
        let (zero_n, per_torque) = self.zero_n;
        let forces = self.thrust_n.iter().zip(self.shaking_n).map(|(thrust, shaking)| thrust + shaking);
        let zeros = self.torque_nm.iter().map(move |torque| zero_n + per_torque * torque);
        forces.zip(zeros).zip(self.temp_c).map(|((force, zero), temp)| (force, zero, *temp))
    }
}

/// Fraction of a first-order lag covered in one step; 1 when there is no lag.
fn share(dt_s: f64, tau_s: f64) -> f64 {
    if tau_s > 0.0 { 1.0 - libm::exp(-dt_s / tau_s) } else { 1.0 }
}

impl BridgeState {
    /// At rest, for steps of `dt_s`.
    #[must_use]
    pub fn new(bridge: Bridge, dt_s: f64) -> Self {
        let output_v = bridge.resting_v() / bridge.divider;
        Self {
            bridge,
            creep_n: 0.0,
            lift_n: 0.0,
            joint_n: 0.0,
            stuck_n: 0.0,
            meter: MeterState::new(bridge.meter, bridge.resting_v(), dt_s),
            output_v,
            pin_v: bridge.resting_v(),
            rise: share(dt_s, bridge.rise_s),
            fall: share(dt_s, bridge.fall_s),
            filter: share(dt_s, bridge.filter_s),
            creep: share(dt_s, bridge.creep_s),
            joint: share(dt_s, JOINT_S),
            empty_v: bridge.resting_v() / bridge.divider,
        }
    }

    /// Goes on from here with another bridge; a meter is replaced only when it is another one.
    pub fn refit(&mut self, bridge: Bridge, dt_s: f64) {
        let fresh = Self::new(bridge, dt_s);
        let meter =
            if bridge.meter == self.bridge.meter { self.meter.clone() } else { MeterState::new(bridge.meter, self.pin_v, dt_s) };
        *self = Self {
            creep_n: self.creep_n,
            lift_n: self.lift_n,
            // a joint that begins to stick has felt the load all along
            joint_n: if self.bridge.hysteresis_n == 0.0 { self.lift_n } else { self.joint_n },
            stuck_n: self.stuck_n,
            output_v: self.output_v,
            pin_v: self.pin_v,
            meter,
            ..fresh
        };
    }

    /// One step: `lift_n` on the beam, `zero_n` and `gain` of the moment, rig temperature; gives the pin voltage.
    #[inline]
    pub fn step(&mut self, lift_n: f64, zero_n: f64, gain: f64, temperature_c: f64) -> f64 {
        let b = &self.bridge;
        let mut seen_n = lift_n;
        if b.creep_share != 0.0 || self.creep_n != 0.0 {
            self.creep_n += (b.creep_share * lift_n - self.creep_n) * self.creep;
            seen_n += self.creep_n;
        }
        if b.hysteresis_n != 0.0 || self.stuck_n != 0.0 {
            // A slider in the joint holds back a share of each change of load until it slips (Jenkins element).
            let half = 0.5 * b.hysteresis_n;
            let change_n = (lift_n - self.joint_n) * self.joint;
            self.joint_n += change_n;
            self.stuck_n = (self.stuck_n + JOINT_SHARE * change_n).clamp(-half, half);
            seen_n -= self.stuck_n;
        }
        self.lift_n = lift_n;
        let shift = zero_n + b.zero_n_per_k * (temperature_c - b.zero_temperature_c);
        let wanted = (self.empty_v - b.volt_per_newton * (seen_n * gain + shift)).clamp(b.rails_v.0, b.rails_v.1);
        let error = wanted - self.output_v;
        self.output_v += error * if error > 0.0 { self.rise } else { self.fall };
        let pin_v = b.divider * self.output_v;
        self.pin_v = if b.filter_s > 0.0 { self.pin_v + (pin_v - self.pin_v) * self.filter } else { pin_v };
        self.meter.step(self.pin_v)
    }

    /// As many steps as `load` has, `beam` ahead of the bridge, with the same numbers: puts the pin voltages into `pin_v` and gives the
    /// force that the gauges saw last.
    pub fn block(&mut self, beam: &mut BeamMode, load: &Load<'_>, pin_v: &mut [f64]) -> f64 {
        let b = &self.bridge;
        let creeps = b.creep_share != 0.0 || self.creep_n != 0.0;
        let sticks = b.hysteresis_n != 0.0 || self.stuck_n != 0.0;
        if creeps || sticks || b.filter_s > 0.0 || !self.meter.is_wire() {
            for (pin_v, (force_n, zero_n, temperature_c)) in pin_v.iter_mut().zip(load.steps()) {
                *pin_v = self.step(beam.step(force_n), zero_n, load.gain, temperature_c);
            }
        } else if self.rise == self.fall {
            self.plain_block::<true>(beam, load, pin_v);
        } else {
            self.plain_block::<false>(beam, load, pin_v);
        }
        self.lift_n
    }

    /// Gauges, amplifier and divider alone; `EVEN` when its output falls as it rises. Beam and amplifier are two chains of steps that
    /// wait for the ones before: in one loop they wait at the same time.
    #[inline]
    fn plain_block<const EVEN: bool>(&mut self, beam: &mut BeamMode, load: &Load<'_>, pin_v: &mut [f64]) {
        let b = &self.bridge;
        let (mut mode, mut output_v, mut seen_n) = (*beam, self.output_v, self.lift_n);
        for (pin_v, (force_n, zero_n, temperature_c)) in pin_v.iter_mut().zip(load.steps()) {
            seen_n = mode.step(force_n);
            let shift = zero_n + b.zero_n_per_k * (temperature_c - b.zero_temperature_c);
            let wanted = (self.empty_v - b.volt_per_newton * (seen_n * load.gain + shift)).clamp(b.rails_v.0, b.rails_v.1);
            let error = wanted - output_v;
            output_v += error * if EVEN || error > 0.0 { self.rise } else { self.fall };
            *pin_v = b.divider * output_v;
        }
        self.pin_v = b.divider * output_v;
        (*beam, self.output_v, self.lift_n) = (mode, output_v, seen_n);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::Beam;

    #[test]
    fn the_slope_and_the_voltages_of_the_errata_come_out() {
        let b = Bridge::default();
        let grams_per_volt = 1000.0 / (b.volt_per_newton * G);
        assert!((grams_per_volt - 231.37).abs() < 0.2, "{grams_per_volt}");
        // 3.35 V at +244 g, 0.40 V at -440 g
        assert!((b.resting_v() / b.divider - 3.35).abs() < 0.01);
        assert!((b.zero_v - b.volt_per_newton * 0.440 * G - 0.40).abs() < 0.01);
    }

    #[test]
    fn a_slow_fall_lifts_the_mean_of_a_vibration_and_leaves_a_constant_alone() {
        let dt = 1.0e-4;
        let run = |fall_s, amplitude: f64| {
            let b = Bridge { fall_s, ..Bridge::default() };
            let mut s = BridgeState::new(b, dt);
            let mut sum = 0.0;
            let n = 200_000;
            for i in 0..n {
                let lift = 1.0 + amplitude * libm::sin(260.0 * dt * f64::from(i));
                let v = s.step(lift, 0.0, 1.0, 23.0);
                if i >= n / 2 {
                    sum += (v - b.resting_v()) * b.newton_per_volt();
                }
            }
            sum / f64::from(n / 2)
        };
        assert!((run(2.0e-3, 0.0) - 1.0).abs() < 1e-9);
        assert!((run(0.4e-3, 0.5) - 1.0).abs() < 2e-3);
        assert!((run(2.0e-3, 0.5) - 1.0).abs() > 0.02);
    }

    #[test]
    fn a_block_is_its_steps() {
        let odd = [
            Bridge::default(),
            Bridge { fall_s: 2e-3, zero_n_per_k: 0.01, ..Bridge::default() },
            Bridge { creep_share: 0.02, ..Bridge::default() },
            Bridge { hysteresis_n: 0.05, ..Bridge::default() },
            Bridge { filter_s: 0.02, ..Bridge::default() },
            Bridge { meter: Meter { hold_s: 3e-3, step_v: 0.01, delay_s: 1e-3 }, ..Bridge::default() },
        ];
        for b in odd {
            let (mut one, mut ten) = (BridgeState::new(b, 1e-4), BridgeState::new(b, 1e-4));
            let (mut beam, mut beam_of_ten) = (BeamMode::new(&Beam::default(), 1e-4), BeamMode::new(&Beam::default(), 1e-4));
            for ms in 0..400 {
                let thrust: [f64; 10] = core::array::from_fn(|i| 2.0 + 1.9 * libm::sin(0.3 * f64::from(ms) + i as f64));
                let (torque, shaking): ([f64; 10], _) = (core::array::from_fn(|i| 1e-3 * i as f64), [0.01; 12]);
                let warm = [23.0 + 0.01 * f64::from(ms); 10];
                let want: [f64; 10] =
                    core::array::from_fn(|i| one.step(beam.step(thrust[i] + shaking[i]), 0.02 + 0.3 * torque[i], 1.01, warm[i]));
                let load = Load {
                    thrust_n: &thrust,
                    shaking_n: &shaking,
                    torque_nm: &torque,
                    temp_c: &warm,
                    zero_n: (0.02, 0.3),
                    gain: 1.01,
                };
                let mut pin_v = [0.0; 10];
                let seen_n = ten.block(&mut beam_of_ten, &load, &mut pin_v);
                assert_eq!(pin_v, want, "{b:?}");
                assert_eq!((&one, beam), (&ten, beam_of_ten));
                assert_eq!(seen_n, ten.lift_n);
            }
        }
    }

    #[test]
    fn friction_in_the_joint_opens_a_loop_of_its_width() {
        // a turn takes 10 ms, and may shake the beam by more than the loop is wide
        for (shaking, within) in [(0.0, 1e-9), (0.2, 0.005)] {
            let b = Bridge { hysteresis_n: 0.1, ..Bridge::default() };
            let mut s = BridgeState::new(b, 1.0e-3);
            let mut read = |lift: f64| {
                let turn = |ms: i32| shaking * libm::cos(0.2 * core::f64::consts::PI * f64::from(ms));
                let v: Vec<f64> = (0..1000).map(|ms| s.step(lift + turn(ms), 0.0, 1.0, 23.0)).collect();
                let mean = v[500..].iter().sum::<f64>() / 500.0;
                (mean - b.resting_v()) * b.newton_per_volt()
            };
            let up: Vec<f64> = (0..=10).map(|i| read(f64::from(i) * 0.4)).collect();
            let down: Vec<f64> = (0..=10).rev().map(|i| read(f64::from(i) * 0.4)).collect();
            assert!((down[5] - up[5] - 0.1).abs() < within, "{shaking}: {} {}", up[5], down[5]);
        }
    }

    #[test]
    fn a_joint_that_begins_to_stick_does_not_jump() {
        let mut s = BridgeState::new(Bridge::default(), 1.0e-3);
        let before = (0..1000).map(|_| s.step(3.0, 0.0, 1.0, 23.0)).last().unwrap();
        s.refit(Bridge { hysteresis_n: 0.1, ..Bridge::default() }, 1.0e-3);
        let after = (0..1000).map(|_| s.step(3.0, 0.0, 1.0, 23.0)).last().unwrap();
        assert!((after - before).abs() < 1e-9, "{before} {after}");
    }
}
