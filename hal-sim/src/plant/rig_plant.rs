//! The simulated powerplant.
//!
//! What it is: supply, ESC output stage, motor, propeller and air, integrated in time: what turns at 10 kHz ([`super::shaft`]), what heats,
//! drains or blows at 1 kHz.
//! What can go wrong: nothing here fails; a rotor that its motor cannot start stays at rest.
//! Units: SI; rev/min for rotor speed, us for the pulse.
//! Reference: Beharie 2013 section 2.3 and Eq. 5.11 corrected; errata 2.22-2.24 (the frame feels inertia and drag, not friction).

use super::commutation::CommutationState;
use super::fixed::Fixed;
use super::flux::FluxState;
use super::limiter::LimiterState;
use super::parts::Parts;
use super::powerplant::{BackEmf, PlantBlock, PlantLevers, PlantState, Powerplant, STEPS_PER_MS};
use super::room_air::Draught;
use super::shaft::{Acting, Begun, Shaft, Turns, show};
use super::thermal::ThermalState;
use crate::noise::{Coloured, Source, Stream};
use core::f64::consts::TAU;

/// rev/min in one rad/s.
pub const RPM_PER_RAD_S: f64 = 60.0 / TAU;
/// Draw of the ESC's own electronics, A.
pub(crate) const ESC_IDLE_A: f64 = 0.03;

/// What is constant for a millisecond: everything that heats, drains, drifts or blows.
#[derive(Debug, Clone, Copy, Default)]
struct Slow {
    open_v: f64,
    line_ohm: f64,
    kt: f64,
    holding_nm: f64,
    drag_nms: f64,
    air_k: f64,
    thrust_k: f64,
    per_inertia: f64,
    inertia: f64,
    driven: bool,
}

/// Drive voltage and conductance of the winding at one duty cycle.
#[derive(Debug, Clone, Copy, Default)]
struct Drive {
    duty: f64,
    emf_free_v: f64,
    per_ohm: f64,
}

/// The simulated powerplant.
#[derive(Debug, Clone)]
pub struct RigPlant {
    parts: Parts,
    fixed: Fixed,
    levers: PlantLevers,
    thermal: ThermalState,
    flux: FluxState,
    draught: Draught,
    commutation: CommutationState,
    gusts: Coloured,
    limiter: LimiterState,
    slow: Slow,
    drive: Drive,
    steps: u32,
    elapsed_s: f64,
    speed: f64,
    motor_a: f64,
    supply_a: f64,
    charge_as: f64,
}

/// Interval and correlation time of the gusts, s.
const GUST_INTERVAL_S: f64 = 1.0e-3;
const GUST_TAU_S: f64 = 0.05;
/// Speed from which the back-EMF can be seen and the start is no longer blind, rev/min.
const BLIND_RPM: f64 = 200.0;
/// Steps of the fast integration in one of the slow.
const SLOW_STEPS: u32 = STEPS_PER_MS as u32;

impl RigPlant {
    /// At rest.
    #[must_use]
    pub fn new(parts: Parts, seed: u64) -> Self {
        let gusts = Coloured::new(Stream::new(seed, Source::Gust, 0), parts.gust, GUST_TAU_S, GUST_INTERVAL_S);
        Self {
            thermal: ThermalState::new(parts.thermal),
            flux: FluxState::default(),
            draught: Draught::default(),
            commutation: CommutationState::default(),
            levers: PlantLevers::default(),
            gusts,
            limiter: LimiterState::default(),
            slow: Slow::default(),
            drive: Drive::default(),
            steps: 0,
            elapsed_s: 0.0,
            speed: 0.0,
            motor_a: 0.0,
            supply_a: ESC_IDLE_A,
            charge_as: 0.0,
            fixed: Fixed::of(&parts),
            parts,
        }
    }

    /// Everything that moves in seconds, once a millisecond.
    fn settle(&mut self, duty: f64) {
        let (p, fixed, l, dt_s) = (&mut self.parts, &self.fixed, &self.levers, self.elapsed_s);
        p.supply.draw(self.charge_as, dt_s);
        let run_s = l.run_s.max(0.0);
        let loss_w = self.motor_a * self.motor_a * p.motor.resistance_ohm + fixed.friction_nm * self.speed;
        self.thermal.step(loss_w, run_s, dt_s);
        self.limiter.warm(&p.limiter, self.supply_a, dt_s);

        let gust = 1.0 + self.gusts.next();
        let (density, relative) = if p.air_follows_room {
            let density = fixed.density * p.thermal.thinning(run_s);
            (density, density / p.propeller.reference_density)
        } else {
            (fixed.density, fixed.relative_density)
        };
        let rpm = self.speed * RPM_PER_RAD_S;
        let blade = p.blade.factors(rpm);
        let thrust_n = self.slow.thrust_k * self.speed * self.speed;
        let inflow = self.draught.step(&p.room, thrust_n, self.speed, density, dt_s);
        let flux =
            if fixed.flux_acts { self.flux.step(&p.flux, rpm, loss_w, self.motor_a, p.thermal.room_c(run_s), dt_s) } else { 1.0 };
        let inertia = p.propeller.inertia_kgm2 + p.motor.inertia_kgm2 + l.inertia_kgm2;
        self.slow = Slow {
            open_v: p.supply.open_circuit_v(),
            line_ohm: p.supply.resistance_ohm + l.resistance_ohm,
            kt: fixed.torque_constant * flux,
            holding_nm: fixed.friction_nm + l.drag_nm,
            drag_nms: l.drag_nms,
            air_k: p.propeller.torque_coefficient * relative * l.torque_factor * blade.1 * inflow.1 * gust,
            thrust_k: p.propeller.thrust_coefficient * relative * l.thrust_factor * blade.0 * inflow.0,
            per_inertia: 1.0 / inertia,
            inertia,
            driven: self.commutation.step(&p.commutation, self.motor_a, dt_s) && (rpm > BLIND_RPM || p.motor.starts(inertia)),
        };
        self.drive = self.driving(duty);
        (self.steps, self.elapsed_s, self.charge_as) = (0, 0.0, 0.0);
    }

    fn driving(&mut self, duty: f64) -> Drive {
        if duty <= 0.0 || !self.slow.driven {
            return Drive { duty, ..Drive::default() };
        }
        let s = &self.slow;
        let per_ohm = self.fixed.per_ohm(duty, s.line_ohm);
        Drive { duty, emf_free_v: duty * (s.open_v - s.line_ohm * ESC_IDLE_A), per_ohm }
    }

    /// What turns the rotor for the rest of this millisecond.
    fn shaft(&self, dt_s: f64) -> Shaft {
        let (s, d, l) = (&self.slow, &self.drive, &self.levers);
        let acting = Acting {
            kt: s.kt,
            emf_free_v: d.emf_free_v,
            per_ohm: d.per_ohm,
            holding_nm: s.holding_nm,
            drag_nms: s.drag_nms,
            air_k: s.air_k,
            per_inertia: s.per_inertia,
            inertia: s.inertia,
            thrust_k: s.thrust_k,
            extra_nm: l.drag_nm,
            extra_nms: l.drag_nms,
            seen_share: l.drag_share,
        };
        Shaft::new(acting, dt_s)
    }

    /// State of the outside at the speed, torque and currents of now.
    fn state(&self, thrust_n: f64, torque_nm: f64) -> PlantState {
        PlantState {
            rpm: self.speed * RPM_PER_RAD_S,
            thrust_n,
            torque_nm,
            current_a: self.supply_a,
            voltage_v: self.slow.open_v - self.slow.line_ohm * self.supply_a,
            temp_c: self.thermal.temperature_c,
        }
    }
}

impl Powerplant for RigPlant {
    fn adjust(&mut self, levers: &PlantLevers) {
        self.levers = *levers;
    }

    fn refit(&mut self, parts: &Parts) {
        let mut supply = self.parts.supply;
        supply.refit(parts.supply);
        self.parts = Parts { supply, ..parts.clone() };
        self.fixed = Fixed::of(parts);
        self.thermal.refit(parts.thermal);
    }

    fn back_emf(&self) -> Option<BackEmf> {
        // as the ESC's six-step drive sees it: the constant that KV states, with the magnets as they are now
        Some(BackEmf { amplitude_v: self.slow.kt * self.speed, pole_pairs: self.parts.motor.pole_pairs })
    }

    #[inline]
    fn advance(&mut self, dt_s: f64, pulse_us: f64) -> PlantState {
        let asked = self.limiter.duty(&self.parts.limiter, pulse_us, dt_s);
        let (resistance, kt) = (self.parts.motor.resistance_ohm, self.slow.kt);
        let duty = self.parts.limiter.limited(asked, kt * self.speed, self.slow.open_v, resistance, self.slow.line_ohm);
        if self.steps == 0 || self.steps >= SLOW_STEPS {
            self.settle(duty);
        } else if duty != self.drive.duty {
            self.drive = self.driving(duty);
        }
        self.steps += 1;
        self.elapsed_s += dt_s;

        let shaft = self.shaft(dt_s);
        let (next, gained) = shaft.turn(self.speed);
        self.speed = next;
        self.motor_a = shaft.motor_current(next);
        self.supply_a = duty * self.motor_a + ESC_IDLE_A;
        self.charge_as += self.supply_a * dt_s;
        let (thrust_n, torque_nm) = shaft.reaction(next, gained);
        self.state(thrust_n, torque_nm)
    }

    fn begin(&mut self, dt_s: f64, pulse_us: f64) -> Option<Begun> {
        let begins = self.steps == 0 || self.steps >= SLOW_STEPS;
        if !begins || !self.parts.limiter.is_steady() {
            return None;
        }
        // From here to the end of the millisecond nothing but the shaft moves.
        let duty = self.limiter.duty(&self.parts.limiter, pulse_us, dt_s);
        self.settle(duty);
        Some(Begun { shaft: self.shaft(dt_s), from: self.speed, dt_s })
    }

    fn end(&mut self, begun: &Begun, turns: &Turns, out: &mut PlantBlock) {
        let mut motor_a = [0.0; STEPS_PER_MS];
        show(&begun.shaft, turns, &mut out.rpm, &mut out.thrust_n, &mut out.torque_nm, &mut motor_a);
        for motor_a in motor_a {
            self.supply_a = self.drive.duty * motor_a + ESC_IDLE_A;
            self.charge_as += self.supply_a * begun.dt_s;
            self.elapsed_s += begun.dt_s;
        }
        self.motor_a = motor_a[STEPS_PER_MS - 1];
        self.speed = turns.speed[STEPS_PER_MS - 1];
        self.steps = SLOW_STEPS;
        out.temp_c = [self.thermal.temperature_c; STEPS_PER_MS];
        out.last = self.state(out.thrust_n[STEPS_PER_MS - 1], out.torque_nm[STEPS_PER_MS - 1]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::supply::Source as Feed;
    use crate::plant::{Air, Blade, Commutation, Flux, Limiter, Motor, Propeller, RoomAir, Supply, Thermal};

    fn parts(resistance_ohm: f64) -> Parts {
        Parts {
            supply: Supply::new(Feed::Bench { voltage_v: 11.5 }, resistance_ohm),
            motor: Motor::named("570KV").unwrap(),
            propeller: Propeller::named("11x4.7").unwrap(),
            air: Air::standard(0.0),
            thermal: Thermal::default(),
            air_follows_room: false,
            flux: Flux::default(),
            room: RoomAir::default(),
            commutation: Commutation::default(),
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

    /// A millisecond at once is ten steps, to the bit, with every part that could make it otherwise.
    #[test]
    fn a_block_is_ten_steps() {
        let lagging = Limiter { lag_s: (0.05, 0.2), ..Limiter::default() };
        let limited = Limiter { current_a: 4.0, ..Limiter::default() };
        let hot = Limiter { derate_per_a2: 0.002, derate_tau_s: 0.5, ..Limiter::default() };
        for limiter in [Limiter::default(), lagging, limited, hot] {
            let p = Parts {
                limiter,
                gust: 0.01,
                thermal: Thermal { rise_k_per_w: 0.3, tau_s: 1.0, ..Thermal::default() },
                ..parts(0.1)
            };
            let (mut one, mut ten) = (RigPlant::new(p.clone(), 3), RigPlant::new(p, 3));
            let levers = PlantLevers { drag_nm: 0.002, drag_nms: 1e-6, drag_share: 0.5, ..PlantLevers::default() };
            let (mut block, mut want) = (PlantBlock::default(), PlantBlock::default());
            for ms in 0..3000 {
                let pulse = [1000.0, 1600.0, 2000.0, 1200.0, 1000.0][ms / 600];
                if ms == 900 {
                    one.adjust(&levers);
                    ten.adjust(&levers);
                }
                for i in 0..STEPS_PER_MS {
                    want.put(i, one.advance(1.0e-4, pulse));
                }
                ten.advance_block(1.0e-4, pulse, &mut block, &mut || ());
                assert_eq!(block, want, "{limiter:?}, {ms} ms");
            }
        }
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
            let air = plant.shaft(dt).air_nm(w);
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
