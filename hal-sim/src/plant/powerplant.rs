//! The powerplant: pulse in, motion, force and current out.
//!
//! What it is: the trait behind which an identified model can take the place of the simulated one, and the simulated one
//! (supply, ESC output stage, motor, propeller, air), integrated in time.
//! What can go wrong: a model that gives a negative speed or a NaN; the bench clamps it to a resting rotor.
//! Units: SI; rev/min for rotor speed, us for the pulse.
//! Reference: Beharie 2013 section 2.3 and Eq. 5.11 corrected; errata 2.22-2.24 (the frame feels inertia and drag, not friction).

use super::air::Air;
use super::blade::Blade;
use super::limiter::{Limiter, LimiterState};
use super::motor::Motor;
use super::propeller::Propeller;
use super::supply::Supply;
use super::thermal::{Thermal, ThermalState};
use crate::noise::{Coloured, Source, Stream};
use core::f64::consts::TAU;

/// rev/min in one rad/s.
pub const RPM_PER_RAD_S: f64 = 60.0 / TAU;
/// Draw of the ESC's own electronics, A.
const ESC_IDLE_A: f64 = 0.03;

/// What the powerplant does at one instant.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PlantState {
    /// Rotor speed, rev/min.
    pub rpm: f64,
    /// Lift on the beam, N.
    pub thrust_n: f64,
    /// Torque on the arm that carries the motor, N.m.
    pub torque_nm: f64,
    /// Supply current, A.
    pub current_a: f64,
    /// Voltage at the ESC, V.
    pub voltage_v: f64,
    /// Temperature of the rig, degC.
    pub temp_c: f64,
}

/// What turns a pulse into motion, force and current.
pub trait Powerplant: Send {
    /// Steps by `dt_s` with the ESC following a pulse of `pulse_us` (1000 is off).
    fn advance(&mut self, dt_s: f64, pulse_us: f64) -> PlantState;

    /// Takes what the effects make of the plant at this moment. A model that is not made of parts ignores it.
    fn adjust(&mut self, levers: &PlantLevers) {
        let _ = levers;
    }
}

/// Parameters of the plant that effects move during a run. The default is a healthy rig.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlantLevers {
    /// Seconds since run start; negative before.
    pub run_s: f64,
    /// Resistance between source and ESC on top of the supply's own, ohm.
    pub resistance_ohm: f64,
    /// Constant drag on the shaft, N.m.
    pub drag_nm: f64,
    /// Drag in proportion to speed, N.m.s/rad.
    pub drag_nms: f64,
    /// Share of that drag whose reaction does not go through the torque arm's motor, 0..1.
    pub drag_share: f64,
    /// Factor on the thrust coefficient.
    pub thrust_factor: f64,
    /// Factor on the torque coefficient.
    pub torque_factor: f64,
}

impl Default for PlantLevers {
    fn default() -> Self {
        Self {
            run_s: 0.0,
            resistance_ohm: 0.0,
            drag_nm: 0.0,
            drag_nms: 0.0,
            drag_share: 0.0,
            thrust_factor: 1.0,
            torque_factor: 1.0,
        }
    }
}

/// Parts of the simulated powerplant.
#[derive(Debug, Clone, PartialEq)]
pub struct Parts {
    /// Source and wiring.
    pub supply: Supply,
    /// Motor and ESC output stage.
    pub motor: Motor,
    /// Propeller.
    pub propeller: Propeller,
    /// Air.
    pub air: Air,
    /// Temperature node.
    pub thermal: Thermal,
    /// The density of the air follows the room temperature.
    pub air_follows_room: bool,
    /// ESC output stage.
    pub limiter: Limiter,
    /// Departure of the blades from the square law.
    pub blade: Blade,
    /// Turbulence: relative standard deviation of the drag torque.
    pub gust: f64,
}

/// The simulated powerplant.
#[derive(Debug, Clone)]
pub struct RigPlant {
    parts: Parts,
    levers: PlantLevers,
    thermal: ThermalState,
    gusts: Coloured,
    gust: f64,
    blade: (f64, f64),
    thinning: f64,
    to_gust_s: f64,
    speed: f64,
    limiter: LimiterState,
    thrust_k: f64,
    torque_k: f64,
    inertia: f64,
    kt: f64,
}

/// Interval and correlation time of the gusts, s.
const GUST_INTERVAL_S: f64 = 1.0e-3;
const GUST_TAU_S: f64 = 0.05;

impl RigPlant {
    /// At rest.
    #[must_use]
    pub fn new(parts: Parts, seed: u64) -> Self {
        let density = parts.air.density() / parts.propeller.reference_density;
        let gusts = Coloured::new(Stream::new(seed, Source::Gust, 0), parts.gust, GUST_TAU_S, GUST_INTERVAL_S);
        Self {
            thrust_k: parts.propeller.thrust_coefficient * density,
            torque_k: parts.propeller.torque_coefficient * density,
            inertia: parts.propeller.inertia_kgm2 + parts.motor.inertia_kgm2,
            kt: parts.motor.torque_constant(),
            thermal: ThermalState::new(parts.thermal),
            levers: PlantLevers::default(),
            gusts,
            gust: 1.0,
            blade: (1.0, 1.0),
            thinning: 1.0,
            to_gust_s: 0.0,
            speed: 0.0,
            limiter: LimiterState::default(),
            parts,
        }
    }

    /// Motor current at rotor speed `w` and duty `duty`, A; none flows back.
    fn motor_current(&self, w: f64, duty: f64) -> f64 {
        if duty <= 0.0 {
            return 0.0;
        }
        let line = self.parts.supply.resistance_ohm + self.levers.resistance_ohm;
        let path = self.parts.motor.resistance_ohm + duty * duty * line;
        ((duty * (self.parts.supply.open_circuit_v() - line * ESC_IDLE_A) - self.kt * w) / path).max(0.0)
    }

    /// Sum of the torques that oppose the rotor at `w`, N.m: friction, extra drag, air.
    fn opposing(&self, w: f64) -> (f64, f64, f64) {
        let l = &self.levers;
        let extra = l.drag_nm + l.drag_nms * w;
        let air = self.torque_k * l.torque_factor * self.thinning * self.blade.1 * self.gust * w * w;
        (self.parts.motor.friction_nm(), extra, air)
    }

    /// Angular acceleration, rad/s^2; friction holds a resting rotor.
    fn acceleration(&self, w: f64, duty: f64) -> f64 {
        let (friction, extra, air) = self.opposing(w);
        let drive = self.kt * self.motor_current(w, duty);
        let net = drive - friction - extra - air;
        if w <= 0.0 && net < 0.0 { 0.0 } else { net / self.inertia }
    }
}

impl Powerplant for RigPlant {
    fn adjust(&mut self, levers: &PlantLevers) {
        self.levers = *levers;
    }

    fn advance(&mut self, dt_s: f64, pulse_us: f64) -> PlantState {
        self.to_gust_s -= dt_s;
        if self.to_gust_s <= 0.0 {
            self.to_gust_s += GUST_INTERVAL_S;
            self.gust = 1.0 + self.gusts.next();
            if self.parts.air_follows_room {
                self.thinning = self.parts.thermal.thinning(self.levers.run_s.max(0.0));
            }
            self.blade = self.parts.blade.factors(self.speed * RPM_PER_RAD_S);
        }
        let line = self.parts.supply.resistance_ohm + self.levers.resistance_ohm;
        let open_v = self.parts.supply.open_circuit_v();
        let asked = self.limiter.duty(&self.parts.limiter, pulse_us, dt_s);
        let duty = self.parts.limiter.limited(asked, self.kt * self.speed, open_v, self.parts.motor.resistance_ohm, line);

        // Heun's rule: two evaluations, second order; the rotor's own time constant is some 40 ms.
        let w = self.speed;
        let first = self.acceleration(w, duty);
        let guess = (w + first * dt_s).max(0.0);
        let second = self.acceleration(guess, duty);
        let next = (w + 0.5 * (first + second) * dt_s).max(0.0);
        let acceleration = (next - w) / dt_s;
        self.speed = next;

        let current = self.motor_current(next, duty);
        let supply_current = duty * current + ESC_IDLE_A;
        let voltage = open_v - line * supply_current;
        self.limiter.warm(&self.parts.limiter, supply_current, dt_s);
        self.parts.supply.draw(supply_current, dt_s);
        let (friction, extra, air) = self.opposing(next);
        let loss = current * current * self.parts.motor.resistance_ohm + friction * next;
        let temp_c = self.thermal.step(loss, self.levers.run_s.max(0.0), dt_s);
        let seen_drag = if next > 0.0 { self.levers.drag_share * extra } else { 0.0 };
        PlantState {
            rpm: next * RPM_PER_RAD_S,
            thrust_n: self.thrust_k * self.levers.thrust_factor * self.thinning * self.blade.0 * next * next,
            torque_nm: air + seen_drag + self.inertia * acceleration,
            current_a: supply_current,
            voltage_v: voltage,
            temp_c,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::supply::Source as Feed;

    fn parts(resistance_ohm: f64) -> Parts {
        Parts {
            supply: Supply::new(Feed::Bench { voltage_v: 11.5 }, resistance_ohm),
            motor: Motor::named("570KV").unwrap(),
            propeller: Propeller::named("11x4.7").unwrap(),
            air: Air::standard(0.0),
            thermal: Thermal::default(),
            air_follows_room: false,
            limiter: Limiter::default(),
            blade: Blade::default(),
            gust: 0.0,
        }
    }

    fn settled(parts: &Parts, pulse_us: f64) -> PlantState {
        let mut plant = RigPlant::new(parts.clone(), 1);
        (0..30_000).map(|_| plant.advance(1.0e-4, pulse_us)).last().unwrap()
    }

    /// Positive root of R k_Q/K w^2 + K w + R I_0 = duty V, with the wiring resistance seen through the duty cycle.
    #[test]
    fn steady_state_is_the_closed_form() {
        for resistance in [0.0, 0.2] {
            for duty in [0.1, 0.5, 1.0] {
                let p = parts(resistance);
                let k = p.motor.torque_constant();
                let r = p.motor.resistance_ohm + duty * duty * resistance;
                let q = p.propeller.torque_coefficient * p.air.density() / p.propeller.reference_density;
                let (a, b) = (r * q / k, k);
                let c = r * p.motor.no_load_current_a - duty * (11.5 - resistance * ESC_IDLE_A);
                let w = (-b + (b * b - 4.0 * a * c).sqrt()) / (2.0 * a);
                let state = settled(&p, 1000.0 + 1000.0 * duty);
                assert!((state.rpm / RPM_PER_RAD_S / w - 1.0).abs() < 1e-6, "{} {w}", state.rpm / RPM_PER_RAD_S);
                let current = duty * (q * w * w / k + p.motor.no_load_current_a) + ESC_IDLE_A;
                assert!((state.current_a / current - 1.0).abs() < 1e-6);
                assert!((state.voltage_v - (11.5 - resistance * current)).abs() < 1e-6);
                assert!((state.torque_nm / (q * w * w) - 1.0).abs() < 1e-6);
            }
        }
    }

    /// Errata: 5.779 N at 7.33 A and full throttle; hover 2.879 N near 8.36 % duty and 4100 rev/min.
    #[test]
    fn the_figures_of_the_errata_come_out() {
        let full = settled(&parts(0.0), 2000.0);
        assert!((full.thrust_n / 5.779 - 1.0).abs() < 0.01, "{}", full.thrust_n);
        assert!((full.current_a / 7.33 - 1.0).abs() < 0.02, "{}", full.current_a);
        let hover = settled(&parts(0.0), 200.0 * 8.36);
        assert!((hover.rpm / 4100.0 - 1.0).abs() < 0.03, "{}", hover.rpm);
        assert!((hover.thrust_n / 2.879 - 1.0).abs() < 0.05, "{}", hover.thrust_n);
    }

    /// What the supply gives is heat, friction, air and motion.
    #[test]
    fn energy_is_accounted_for() {
        let p = parts(0.1);
        let mut plant = RigPlant::new(p.clone(), 1);
        let (mut given, mut spent) = (0.0, 0.0);
        let dt = 1.0e-4;
        let duty = 0.7;
        let mut w = 0.0;
        for _ in 0..20_000 {
            let s = plant.advance(dt, 1000.0 + 1000.0 * duty);
            w = s.rpm / RPM_PER_RAD_S;
            given += 11.5 * s.current_a * dt;
            let motor_a = (s.current_a - ESC_IDLE_A) / duty;
            let air = plant.opposing(w).2;
            let heat = motor_a * motor_a * p.motor.resistance_ohm + s.current_a * s.current_a * 0.1 + s.voltage_v * ESC_IDLE_A;
            spent += (heat + (p.motor.friction_nm() + air) * w) * dt;
        }
        let inertia = p.motor.inertia_kgm2 + p.propeller.inertia_kgm2;
        let motion = 0.5 * inertia * w * w;
        assert!(motion > 0.02 * given, "the spin-up is part of the test: {motion} of {given}");
        assert!((given / (spent + motion) - 1.0).abs() < 2e-3, "{given} {spent} {motion}");
    }

    #[test]
    fn thin_air_gives_less_thrust_and_more_speed() {
        let thin = Parts { air: Air::standard(2000.0), ..parts(0.0) };
        let (low, high) = (settled(&parts(0.0), 1600.0), settled(&thin, 1600.0));
        assert!(high.rpm > low.rpm && high.thrust_n < 0.95 * low.thrust_n);
    }

    #[test]
    fn below_the_start_throttle_it_rests() {
        assert_eq!(settled(&parts(0.0), 1050.0).rpm, 0.0);
        assert!(settled(&parts(0.0), 1100.0).rpm > 300.0);
    }
}
