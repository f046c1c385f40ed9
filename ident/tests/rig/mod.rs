//! A simulated run whose every plateau is known: the judge of detectors and of standard errors.
//!
//! What it is: a staircase with first-order settling and coloured noise, and the troubles of section 5.7.4 one by one or together.
//! What can go wrong: nothing; a seed gives one run.
//! Units: s, us, rev/min, N, N.m, A, V.
//! Reference: Beharie 2013, section 5.7.3 (the problems listed there) and Figure 5.85.

#![allow(dead_code, unreachable_pub, missing_docs)] // each test uses a part of it

use ident::log::{Column, Log};
use ident::plateau::score::Truth;

/// Small generator of uniform and normal numbers (xorshift64*, Marsaglia 2003; Box & Muller 1958).
pub struct Chance(u64);

impl Chance {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0xD1B5_4A32_D192_ED03)
    }

    pub fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn normal(&mut self) -> f64 {
        let (u, v) = (self.uniform().max(1e-300), self.uniform());
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }
}

/// Noise with memory.
struct Coloured {
    rho: f64,
    state: f64,
}

impl Coloured {
    fn next(&mut self, chance: &mut Chance) -> f64 {
        self.state = self.rho * self.state + (1.0 - self.rho * self.rho).sqrt() * chance.normal();
        self.state
    }
}

/// The troubles that a run has.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Trouble {
    /// The beam rings around 2510 rev/min: speed and thrust scatter tenfold.
    pub resonance: bool,
    /// Steps of uneven height and length, and a speed that hunts slowly.
    pub erratic: bool,
    /// A sixth of the samples is missing, commands too, and whole seconds with them.
    pub missing: bool,
    /// Speed and thrust drift by about one per cent inside each plateau.
    pub drift: bool,
    /// Up and down again.
    pub up_down: bool,
    /// No command was logged.
    pub no_command: bool,
    /// One level in twenty is spoilt: its thrust and torque are off by a quarter.
    pub spoilt: bool,
}

/// A run with its truth.
pub struct Run {
    pub log: Log,
    pub truths: Vec<Truth>,
    /// Settled, noiseless speed and thrust on every row.
    pub rpm: Vec<f64>,
    pub thrust: Vec<f64>,
    /// Time constant of the rotor, s.
    pub tau: f64,
}

/// Truth of the fits.
pub const K_THRUST: f64 = 1.56e-5;
pub const K_TORQUE: f64 = 2.4e-7;
pub const STEP: f64 = 0.1;

pub fn omega(rpm: f64) -> f64 {
    rpm * std::f64::consts::TAU / 60.0
}

/// Supply, V; motor's torque constant (570 KV), N.m/A; resistance, ohm; no-load current, A; the controller's own draw, W.
pub const SUPPLY: f64 = 11.5;
pub const KV: f64 = 570.0;
pub const RESISTANCE: f64 = 0.178;
pub const NO_LOAD: f64 = 0.3;
const OWN_DRAW: f64 = 0.35;

fn torque_constant() -> f64 {
    60.0 / (std::f64::consts::TAU * KV)
}

/// Speed of the healthy rig, settled: d V = Kt w + R I with I = Q/Kt + I0.
pub fn speed(pulse: f64) -> f64 {
    let kt = torque_constant();
    let a = RESISTANCE * K_TORQUE / kt;
    let c = RESISTANCE * NO_LOAD - (pulse - 1000.0) / 1000.0 * SUPPLY;
    if pulse < 1040.0 { 0.0 } else { (-kt + (kt * kt - 4.0 * a * c).sqrt()) / (2.0 * a) * 60.0 / std::f64::consts::TAU }
}

/// Supply current from the power balance.
fn draw(omega: f64) -> f64 {
    let kt = torque_constant();
    let load = if omega > 0.1 { K_TORQUE * omega * omega + kt * NO_LOAD } else { 0.0 };
    (omega * load + RESISTANCE / (kt * kt) * load * load + OWN_DRAW) / SUPPLY
}

fn schedule(trouble: Trouble, hold: usize, chance: &mut Chance) -> Vec<(f64, usize)> {
    let mut levels: Vec<(f64, usize)> = if trouble.erratic {
        let mut pulse = 1100.0;
        let mut out = Vec::new();
        while pulse <= 2000.0 {
            out.push((pulse, (hold as f64 * (0.4 + 1.2 * chance.uniform())) as usize));
            pulse += (20.0 + 70.0 * chance.uniform()).round();
        }
        out
    } else {
        (0..21).map(|k| (1000.0 + 50.0 * f64::from(k), hold)).collect()
    };
    if trouble.up_down {
        let down: Vec<_> = levels.iter().rev().skip(1).copied().collect();
        levels.extend(down);
    }
    levels
}

/// A run of levels of about `hold` rows each.
pub fn run(trouble: Trouble, hold: usize, seed: u64) -> Run {
    let chance = &mut Chance::new(seed);
    let levels = schedule(trouble, hold, chance);
    let (mut truths, mut pulse) = (Vec::new(), Vec::new());
    for (p, n) in &levels {
        truths.push(Truth { from: pulse.len(), settled: pulse.len(), to: pulse.len() + n });
        pulse.extend(std::iter::repeat_n(*p, *n));
    }
    let n = pulse.len();
    let tau = 0.25 + 0.5 * chance.uniform();
    let (mut hunting, mut white, mut load) =
        (Coloured { rho: 0.9, state: 0.0 }, Coloured { rho: 0.4, state: 0.0 }, Coloured { rho: 0.3, state: 0.0 });
    let mut state = speed(pulse[0]);
    let (mut rpm, mut thrust) = (Vec::new(), Vec::new());
    let mut measured: [Vec<f64>; 5] = std::array::from_fn(|_| Vec::with_capacity(n));
    for (k, truth) in truths.iter().enumerate() {
        let slope = if trouble.drift { 0.01 * (0.5 + chance.uniform()) * if k % 3 == 2 { 1.0 } else { -1.0 } } else { 0.0 };
        let spoil = if trouble.spoilt && k == 13 { 1.25 } else { 1.0 };
        for (i, command) in pulse.iter().enumerate().take(truth.to).skip(truth.from) {
            let share = (i - truth.from) as f64 / (truth.to - truth.from) as f64;
            let drifted = 1.0 + slope * share;
            let settled = speed(*command) * drifted;
            state += (speed(*command) - state) * (1.0 - (-STEP / tau).exp());
            let ring = if trouble.resonance { 30.0 * (-((state - 2510.0) / 180.0).powi(2)).exp() } else { 0.0 };
            let noise = 2.0 * white.next(chance) + if trouble.erratic { 8.0 * hunting.next(chance) } else { 0.0 };
            let turning = if state > 1.0 { 1.0 } else { 0.0 };
            let actual = state * drifted + turning * noise;
            rpm.push(settled);
            let zero = if trouble.drift { 2e-5 * i as f64 } else { 0.0 };
            thrust.push(K_THRUST * omega(settled).powi(2) + zero);
            let w = omega(actual);
            let load_noise = load.next(chance);
            measured[0].push(actual + turning * ring * chance.normal());
            measured[1].push(spoil * K_THRUST * w * w + zero + 0.007 * load_noise + 0.006 * ring * chance.normal());
            measured[2].push(spoil * K_TORQUE * w * w + 3e-4 * chance.normal());
            measured[3].push(draw(w) + 0.03 * chance.normal());
            measured[4].push(SUPPLY + 0.01 * chance.normal());
        }
    }
    let mut columns = vec![Column { name: "pulse_us".into(), values: pulse }];
    for (name, values) in ["rpm", "thrust_n", "torque_nm", "current_a", "voltage_v"].into_iter().zip(measured) {
        columns.push(Column { name: name.into(), values });
    }
    if trouble.missing {
        drop_samples(&mut columns, chance);
    }
    if trouble.no_command {
        columns.remove(0);
    }
    let t = (0..n).map(|i| i as f64 * STEP).collect();
    Run { log: Log { name: format!("run-{seed}.csv"), t, columns, ..Log::default() }, truths, rpm, thrust, tau }
}

fn drop_samples(columns: &mut [Column], chance: &mut Chance) {
    for column in columns.iter_mut() {
        for v in &mut column.values {
            if chance.uniform() < 0.16 {
                *v = f64::NAN;
            }
        }
    }
    let n = columns[0].values.len();
    for _ in 0..6 {
        let from = (chance.uniform() * (n - 30) as f64) as usize;
        let long = 5 + (chance.uniform() * 12.0) as usize;
        for column in columns.iter_mut() {
            column.values[from..from + long].fill(f64::NAN);
        }
    }
}
