//! Stress variants of the trials.
//!
//! What it is: the changes that the README of the data names, each written down here in full.
//! What can go wrong: the README does not give every detail of its variants. The definitions below are those with which
//! VQF 2.1.2 (default) gives the published figures to 0.02 degrees: 2.30 bias, 39.88 bigbias, 3.53 cold, 2.40 rate95, 2.93
//! rate48, 4.49 magslow (published 4.47), 4.28 hw. [`Variant::Worst`] is ours.
//! Units: rad/s, m/s^2, uT, s.
//! Reference: README of the data; data sheets of ITG-3200, ADXL345 and HMC5883L for resolution.

use super::trial::{Sample, Trial};

/// A change to a trial.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Variant {
    Base,
    Bias,
    BigBias,
    Cold,
    Rate95,
    Rate48,
    MagSlow,
    Hardware,
    Worst,
}

/// Degrees a second added to the gyro: 1 deg/s in length.
const BIAS_DPS: [f64; 3] = [0.6, -0.64, 0.48];
/// The offsets of an ITG-3200 as the Razor firmware prints them as its example: 7.4 deg/s in length.
const BIG_BIAS_DPS: [f64; 3] = [-2.9, 6.7, -1.3];
/// The cold start begins this long before the first scored sample, s.
const COLD_BEFORE_S: f64 = 1.0;
/// The worst one this long after it, in the middle of motion, s.
const WORST_AFTER_S: f64 = 5.0;
/// Magnetometer of the slow variants, Hz.
const SLOW_MAG_HZ: f64 = 15.0;

impl Variant {
    pub(crate) const ALL: [Self; 9] = [
        Self::Base,
        Self::Bias,
        Self::BigBias,
        Self::Cold,
        Self::Rate95,
        Self::Rate48,
        Self::MagSlow,
        Self::Hardware,
        Self::Worst,
    ];

    /// The name in `peers-shared.csv`.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Base => "base",
            Self::Bias => "bias",
            Self::BigBias => "bigbias",
            Self::Cold => "cold",
            Self::Rate95 => "rate95",
            Self::Rate48 => "rate48",
            Self::MagSlow => "magslow",
            Self::Hardware => "hw",
            Self::Worst => "worst",
        }
    }

    /// The trial with the change.
    pub(crate) fn of(self, trial: &Trial) -> Vec<Sample> {
        let all = &trial.samples;
        match self {
            Self::Base => all.clone(),
            Self::Bias => offset(all, BIAS_DPS),
            Self::BigBias => offset(all, BIG_BIAS_DPS),
            Self::Cold => from_motion(all, -COLD_BEFORE_S),
            Self::Rate95 => slower(all, 3),
            Self::Rate48 => slower(all, 6),
            Self::MagSlow => held(all, SLOW_MAG_HZ),
            Self::Hardware => quantised(&held(&slower(all, 6), SLOW_MAG_HZ)),
            // all of it together: another chip's offset, the start in motion, its rates, its resolution
            Self::Worst => {
                let moving = from_motion(&offset(all, BIG_BIAS_DPS), WORST_AFTER_S);
                quantised(&held(&slower(&moving, 6), SLOW_MAG_HZ))
            }
        }
    }
}

fn offset(all: &[Sample], dps: [f64; 3]) -> Vec<Sample> {
    let add = dps.map(|d| d.to_radians() as f32);
    all.iter().map(|s| Sample { gyro: std::array::from_fn(|i| s.gyro[i] + add[i]), ..*s }).collect()
}

/// Without the rest at the start.
fn from_motion(all: &[Sample], after: f64) -> Vec<Sample> {
    let Some(first) = all.iter().find(|s| s.truth.is_some()) else { return all.to_vec() };
    all.iter().filter(|s| s.t >= first.t + after).copied().collect()
}

/// The mean of every n samples, at the time and with the truth of the last.
fn slower(all: &[Sample], n: usize) -> Vec<Sample> {
    let mean = |block: &[Sample], of: fn(&Sample) -> [f32; 3]| {
        std::array::from_fn(|i| block.iter().map(|s| of(s)[i]).sum::<f32>() / n as f32)
    };
    all.chunks_exact(n)
        .map(|b| Sample { gyro: mean(b, |s| s.gyro), accel: mean(b, |s| s.accel), mag: mean(b, |s| s.mag), ..b[n - 1] })
        .collect()
}

/// The magnetometer repeats its reading.
fn held(all: &[Sample], hz: f64) -> Vec<Sample> {
    let Some(mut last) = all.first().copied() else { return Vec::new() };
    let mut next = last.t;
    all.iter()
        .map(|s| {
            if s.t >= next - 1e-9 {
                last = *s;
                next += 1.0 / hz;
            }
            Sample { mag: last.mag, ..*s }
        })
        .collect()
}

/// Resolution of the Razor board's chips: 14.375 LSB per deg/s, 256 LSB per g, 1090 LSB per gauss.
fn quantised(all: &[Sample]) -> Vec<Sample> {
    let gyro = (1.0f32 / 14.375).to_radians();
    let accel = dcm::STANDARD_GRAVITY / 256.0;
    let mag = 100.0 / 1090.0;
    let round = |v: [f32; 3], lsb: f32| v.map(|c| (c / lsb).round() * lsb);
    all.iter().map(|s| Sample { gyro: round(s.gyro, gyro), accel: round(s.accel, accel), mag: round(s.mag, mag), ..*s }).collect()
}
