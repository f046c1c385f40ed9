//! A random rig: motor, propeller, supply, sensors and their noise.
//!
//! What it is: the static balance of a brushless motor and a propeller, put into the polynomials of the declared baseline so that
//! a clean run leaves noise alone; what an effect changes is computed from the balance itself.
//! What can go wrong: a balance without a root (the motor cannot turn) is clamped at rest.
//! Units: SI inside; speed rev/min, pulse us, temperature degC, pressure hPa.
//! Reference: permanent-magnet motor: n = KV (uV - I R), torque = Kt (I - I0); propeller: T = ct rho n^2 D^4, Q = cq rho n^2 D^5.

use super::chance::Chance;

/// Polynomial, constant first.
pub(crate) fn poly(c: &[f64], x: f64) -> f64 {
    c.iter().rev().fold(0.0, |s, k| s * x + k)
}

/// What departs from the declared state of supply, winding and propeller.
#[derive(Debug, Clone, Copy)]
pub struct Drive {
    /// Supply at the ESC, V.
    pub volt: f64,
    /// Winding resistance over its cold value.
    pub resistance: f64,
    /// Extra drag torque on the rotor, N.m.
    pub drag: f64,
    /// Propeller torque coefficient over its declared value.
    pub load: f64,
}

/// What a day has of its own, beside the declared state.
#[derive(Debug, Clone, Copy, Default)]
pub struct Day {
    /// Supply, V.
    pub volt: f64,
    /// Temperature, K.
    pub temperature: f64,
    /// Pressure, hPa.
    pub pressure: f64,
}

/// Noise of one channel.
#[derive(Debug, Clone, Copy, Default)]
pub struct ChannelNoise {
    /// Standard deviation at rest.
    pub fixed: f64,
    /// Standard deviation that is added in square at full speed.
    pub at_full: f64,
    /// Lag-one autocorrelation.
    pub rho: f64,
    /// Last digit of the log.
    pub quantum: f64,
}

/// The rig.
#[derive(Debug, Clone)]
pub struct Rig {
    /// rev/min per volt.
    pub kv: f64,
    /// Supply, V.
    pub volt: f64,
    /// Winding, ohm.
    pub ohm: f64,
    /// No-load current, A.
    pub idle_motor: f64,
    /// Current of the electronics, A.
    pub idle: f64,
    /// Pulse of zero duty, us.
    pub pulse_zero: f64,
    /// Pulse below which the motor stands, us.
    pub start: f64,
    /// Torque for (rev/min)^2, N.m.
    pub k_torque: f64,
    /// Cubic of speed in (pulse - 1000)/1000.
    pub speed: [f64; 4],
    /// Quadratic of thrust in rpm/1000.
    pub thrust: [f64; 3],
    /// Quadratic of torque in rpm/1000.
    pub torque: [f64; 3],
    /// Cubic of current in rpm/1000.
    pub current: [f64; 4],
    /// Speed at 2000 us, rev/min.
    pub top: f64,
    /// Real wander of the speed, relative.
    pub wander: f64,
    /// Slow wander of the rotor that all sensors see: rms, rev/min, and correlation time, s.
    pub common: (f64, f64),
    /// Real fluctuation of the torque, relative.
    pub turbulence: f64,
    /// Private noise of a speed channel, relative.
    pub speed_noise: f64,
    /// Noise of thrust, torque, current, voltage, temperature.
    pub noise: [ChannelNoise; 5],
    /// Speed channels and their gains.
    pub speeds: Vec<(&'static str, f64)>,
    /// Whether torque, current, voltage, temperature are logged.
    pub present: [bool; 4],
    /// Whether the pressure is logged.
    pub pressure: bool,
    /// Whether the rms of the strain is logged.
    pub strain_rms: bool,
    /// Further covariates without any meaning.
    pub decoys: Vec<&'static str>,
    /// Sampling, Hz.
    pub hz: f64,
    /// Standard deviation of the sampling instant over the interval.
    pub jitter: f64,
    /// Share of missing samples.
    pub missing: f64,
    /// The day of the run.
    pub day: Day,
    /// Whether commands change at the instant of a sample, as where one host commands and logs.
    pub aligned: bool,
    /// Head of the log.
    pub meta: Vec<String>,
}

impl Rig {
    /// Draws a rig.
    #[must_use]
    pub fn draw(c: &mut Chance) -> Self {
        let kv = c.of(&[390.0, 490.0, 570.0, 690.0, 850.0, 1000.0]);
        let inches: f64 = c.of(&[9.0, 10.0, 11.0, 12.0]);
        let pitch = c.of(&[4.5, 4.7]);
        let (d, rho) = (inches * 0.0254, 1.19);
        let volt = c.between(10.8, 12.6);
        let per_rev2 = 1.0 / 3600.0;
        let k_thrust = c.between(0.085, 0.12) * rho * d.powi(4) * per_rev2;
        let k_torque = c.between(0.0055, 0.008) * rho * d.powi(5) * per_rev2;
        let mut rig = Self {
            kv,
            volt,
            ohm: c.between(0.06, 0.12) * (900.0 / kv).powf(0.8) + 0.05,
            idle_motor: c.between(0.25, 0.8),
            idle: c.between(0.02, 0.06),
            pulse_zero: c.between(960.0, 1000.0),
            start: c.between(1015.0, 1045.0),
            k_torque,
            speed: [0.0; 4],
            thrust: [0.0; 3],
            torque: [0.0; 3],
            current: [0.0; 4],
            top: 0.0,
            wander: c.log_between(0.000_25, 0.000_9),
            common: (0.0, 1.0),
            turbulence: 0.0,
            speed_noise: c.log_between(0.000_03, 0.000_3),
            noise: [ChannelNoise::default(); 5],
            speeds: speeds(c),
            present: [c.happens(0.88), c.happens(0.8), c.happens(0.9), c.happens(0.78)],
            pressure: c.happens(0.2),
            strain_rms: c.happens(0.15),
            decoys: Vec::new(),
            hz: c.of(&[10.0, 12.5, 16.0, 20.0, 25.0, 50.0]),
            jitter: if c.happens(0.35) { c.between(0.003, 0.02) } else { 0.0 },
            missing: if c.happens(0.55) { c.between(0.001, 0.015) } else { 0.0 },
            day: Day::default(),
            aligned: c.happens(0.8),
            meta: Vec::new(),
        };
        for (name, p) in [("vibration_g", 0.1), ("humidity_pct", 0.12), ("esc_temp_c", 0.1)] {
            if c.happens(p) {
                rig.decoys.push(name);
            }
        }
        rig.fit(k_thrust, c);
        rig.draw_noise(c);
        rig.meta = [
            format!("motor = \"{kv:.0}KV\""),
            format!("propeller = \"{inches:.0}x{pitch}\""),
            "blades = 2".to_owned(),
            format!("pole_pairs = {}", c.of(&[7, 11, 12])),
            format!("supply = \"PSU {volt:.1} V\""),
        ]
        .into_iter()
        .filter(|_| c.happens(0.75))
        .collect();
        rig.meta.push(format!("sample_hz = {:.1}", rig.hz));
        rig
    }

    /// Puts the balance into the polynomials of the baseline.
    fn fit(&mut self, k_thrust: f64, c: &mut Chance) {
        let declared = self.declared();
        let pulses: Vec<f64> = (0..60).map(|i| self.start + (2000.0 - self.start) * f64::from(i) / 59.0).collect();
        let n: Vec<f64> = pulses.iter().map(|p| self.balance(*p, declared)).collect();
        let x: Vec<f64> = pulses.iter().map(|p| (p - 1000.0) / 1000.0).collect();
        let s = super::fit::polyfit(&x, &n, 3);
        self.speed.copy_from_slice(&s);
        self.top = poly(&self.speed, 1.0);
        let k: Vec<f64> = (0..60).map(|i| self.top / 1000.0 * f64::from(i) / 59.0).collect();
        let amps: Vec<f64> = k
            .iter()
            .map(|v| self.idle + self.supply_current(v * 1000.0, declared) - self.supply_current(0.0, declared))
            .collect();
        let a = super::fit::polyfit(&k, &amps, 3);
        self.current.copy_from_slice(&a);
        self.current[0] = self.idle;
        let bend = c.between(-0.03, 0.06);
        let (t2, q2, m) = (k_thrust * 1e6, self.k_torque * 1e6, self.top / 1000.0);
        self.thrust = [0.0, bend * t2 * m, t2 * (1.0 - bend)];
        let bend = c.between(0.0, 0.08);
        self.torque = [0.0, bend * q2 * m, q2 * (1.0 - bend)];
    }

    fn draw_noise(&mut self, c: &mut Chance) {
        let full = [
            poly(&self.thrust, self.top / 1000.0),
            poly(&self.torque, self.top / 1000.0),
            poly(&self.current, self.top / 1000.0),
        ];
        let coloured = c.happens(0.3);
        for (i, n) in self.noise.iter_mut().enumerate() {
            match i {
                0 => n.fixed = c.log_between(0.002, 0.02),
                1 => n.fixed = c.log_between(0.000_05, 0.0004),
                2 => n.fixed = c.log_between(0.01, 0.05),
                3 => n.fixed = c.log_between(0.003, 0.014),
                _ => n.fixed = c.between(0.04, 0.12),
            }
            if i < 3 && c.happens(0.3) {
                n.at_full = full[i] * c.log_between(0.002, 0.015);
            }
            if coloured && c.happens(0.6) {
                n.rho = c.between(0.1, 0.6);
            }
            n.quantum = match i {
                0 => c.of(&[0.0001, 0.0002, 0.0005, 0.001, 0.002]),
                1 => c.of(&[0.000_01, 0.000_02, 0.000_06]),
                2 => c.of(&[0.001, 0.005, 0.01]),
                3 => c.of(&[0.001, 0.005]),
                _ => c.of(&[0.01, 0.0625, 0.1]),
            };
        }
    }

    /// The state that the baseline declares.
    #[must_use]
    pub fn declared(&self) -> Drive {
        Drive { volt: self.volt, resistance: 1.0, drag: 0.0, load: 1.0 }
    }

    fn kt(&self) -> f64 {
        60.0 / (std::f64::consts::TAU * self.kv)
    }

    /// Speed at which motor and propeller balance, rev/min.
    #[must_use]
    pub fn balance(&self, pulse: f64, d: Drive) -> f64 {
        let duty = ((pulse - self.pulse_zero) / (2000.0 - self.pulse_zero)).clamp(0.0, 1.2);
        let r = self.ohm * d.resistance;
        // load k n^2 + Kt/(R KV) n + drag + Kt I0 - Kt u V/R = 0
        let (a, b) = (self.k_torque * d.load, self.kt() / (r * self.kv));
        let c = d.drag + self.kt() * self.idle_motor - self.kt() * duty * d.volt / r;
        let disc = b * b - 4.0 * a * c;
        if disc <= 0.0 { 0.0 } else { ((disc.sqrt() - b) / (2.0 * a)).max(0.0) }
    }

    /// Current from the supply at a speed: motor current times duty, A.
    #[must_use]
    pub fn supply_current(&self, n: f64, d: Drive) -> f64 {
        let motor = self.k_torque * d.load * n * n / self.kt() + self.idle_motor + d.drag / self.kt();
        let duty = (n / self.kv + motor * self.ohm * d.resistance) / d.volt.max(1.0);
        duty * motor
    }

    /// Speed of the rig at a pulse in a state, rev/min.
    #[must_use]
    pub fn speed_at(&self, pulse: f64, d: Drive) -> f64 {
        if pulse < self.start {
            return 0.0;
        }
        let (declared, driven) = (poly(&self.speed, (pulse - 1000.0) / 1000.0), self.balance(pulse, d));
        // what a brake holds stands, and does not creep by what the declared curve and the balance differ
        let held = d.drag > 0.0 && driven <= 0.0;
        if held { 0.0 } else { (declared + driven - self.balance(pulse, self.declared())).max(0.0) }
    }

    /// Current of the rig at a speed in a state, A.
    #[must_use]
    pub fn current_at(&self, n: f64, d: Drive) -> f64 {
        let declared = poly(&self.current, n / 1000.0);
        if n <= 0.0 { self.idle } else { declared + self.supply_current(n, d) - self.supply_current(n, self.declared()) }
    }

    /// Noise of a logged channel at a speed.
    #[must_use]
    pub fn sigma(&self, channel: &str, n: f64) -> f64 {
        let i = match channel {
            "thrust_n" => 0,
            "torque_nm" => 1,
            "current_a" => 2,
            "voltage_v" => 3,
            "temp_c" => 4,
            _ => {
                let common = if n > 0.0 { self.common.0 } else { 0.0 };
                return (n * self.wander.hypot(self.speed_noise).max(1e-9)).hypot(common) + 0.03;
            }
        };
        let k = &self.noise[i];
        let real = if i == 1 { self.turbulence * poly(&self.torque, n / 1000.0) } else { 0.0 };
        let grown = k.fixed.hypot(k.at_full * n / self.top).hypot(real);
        grown.hypot(k.quantum / 12f64.sqrt())
    }
}

fn speeds(c: &mut Chance) -> Vec<(&'static str, f64)> {
    if c.happens(0.08) {
        return vec![("rpm", 1.0)];
    }
    let mut names = vec!["rpm_beam", "rpm_opto", "rpm_hall", "rpm_encoder"];
    for _ in 0..c.of(&[0, 0, 0, 1, 1, 1, 2]) {
        let drop = c.of(&names);
        names.retain(|n| *n != drop);
    }
    let uneven = c.happens(0.15);
    names.into_iter().map(|n| (n, if uneven { 1.0 + c.between(-0.0015, 0.0015) } else { 1.0 })).collect()
}
