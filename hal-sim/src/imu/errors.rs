//! What a chip's reading is off by.
//!
//! What it is: for each chip, a matrix of scale and misalignment (for the magnetometer: soft iron), a bias (hard iron), its change with
//! temperature, and noise of every reading; and the temperature of the board, which climbs to its end.
//! What can go wrong: the default is an ideal chip. [`Errors::drawn`] draws what the data sheets allow from the seed.
//! Units: the chip's own: rad/s, g, gauss, per kelvin; s; degC.
//! Reference: PS-ITG-3200A rev 1.4 table 3.1 (scale +-6 % over temperature, cross-axis 2 %, zero +-40 deg/s over temperature, noise
//! 0.38 deg/s rms); ADXL345 rev E table 1 (sensitivity +-10 %, cross-axis +-1 %, offset typ. +-35 mg, noise 0.75 LSB rms); HMC5883L
//! table "Specifications" (cross-axis +-0.2 %FS/gauss, resolution 2 mG); hard iron of some 0.1 gauss beside motors (assumed).

use super::chip::ChipKind;
use crate::noise::{Source, Stream};

/// Errors of one chip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChipErrors {
    /// Scale and misalignment, or soft iron: what the chip sees is this matrix times the truth.
    pub matrix: [[f64; 3]; 3],
    /// Bias, or hard iron, at 25 degC.
    pub bias: [f64; 3],
    /// Change of the bias, per K.
    pub bias_per_k: [f64; 3],
    /// Noise of a reading, rms.
    pub noise: f64,
}

impl Default for ChipErrors {
    fn default() -> Self {
        let matrix = core::array::from_fn(|i| core::array::from_fn(|j| f64::from(u8::from(i == j))));
        Self { matrix, bias: [0.0; 3], bias_per_k: [0.0; 3], noise: 0.0 }
    }
}

impl ChipErrors {
    /// What the chip sees of `truth` at `celsius`, noise of one reading included.
    pub fn seen(&self, truth: [f64; 3], celsius: f64, noise: &mut Stream) -> [f64; 3] {
        core::array::from_fn(|i| {
            let mixed: f64 = (0..3).map(|j| self.matrix[i][j] * truth[j]).sum();
            let random = if self.noise > 0.0 { self.noise * noise.normal() } else { 0.0 };
            mixed + self.bias[i] + self.bias_per_k[i] * (celsius - 25.0) + random
        })
    }

    fn draw(stream: &mut Stream, scale: f64, cross: f64, bias: f64, bias_per_k: f64, noise: f64) -> Self {
        let matrix = core::array::from_fn(|i| {
            core::array::from_fn(|j| if i == j { 1.0 + stream.between(-scale, scale) } else { stream.between(-cross, cross) })
        });
        let bias = core::array::from_fn(|_| stream.between(-bias, bias));
        let bias_per_k = core::array::from_fn(|_| stream.between(-bias_per_k, bias_per_k));
        Self { matrix, bias, bias_per_k, noise }
    }
}

/// Errors of the three chips and the temperature that moves them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Errors {
    /// In the order of [`ChipKind::ALL`].
    pub chips: [ChipErrors; 3],
    /// Temperature of the board at power-up, degC.
    pub start_c: f64,
    /// Temperature that it ends at, degC.
    pub end_c: f64,
    /// Time constant of the way there, s.
    pub warm_up_s: f64,
    /// Seed of the noise.
    pub seed: u64,
}

impl Default for Errors {
    /// Ideal chips at the 35 degC at which the gyro's temperature word is -13 200.
    fn default() -> Self {
        Self { chips: [ChipErrors::default(); 3], start_c: 35.0, end_c: 35.0, warm_up_s: 60.0, seed: 1 }
    }
}

impl Errors {
    /// Chips as the data sheets allow them, on a board that warms up from 20 to 32 degC.
    #[must_use]
    pub fn drawn(seed: u64) -> Self {
        let mut s = Stream::new(seed, Source::Imu, 63);
        let deg = core::f64::consts::PI / 180.0;
        let chips = [
            ChipErrors::draw(&mut s, 0.03, 0.02, 4.0 * deg, 0.08 * deg, 0.38 * deg),
            ChipErrors::draw(&mut s, 0.03, 0.01, 0.035, 0.0008, 0.75 / 256.0),
            ChipErrors::draw(&mut s, 0.05, 0.03, 0.1, 0.0, 0.002),
        ];
        Self { chips, start_c: 20.0, end_c: 32.0, warm_up_s: 60.0, seed }
    }

    /// Temperature of the board, degC.
    #[must_use]
    pub fn celsius(&self, at_ns: u64) -> f64 {
        self.end_c + (self.start_c - self.end_c) * libm::exp(-(at_ns as f64) * 1e-9 / self.warm_up_s)
    }

    /// The errors of one chip; the test accelerometer has none.
    #[must_use]
    pub fn of(&self, kind: ChipKind) -> ChipErrors {
        self.chips.get(kind as usize).copied().unwrap_or_default()
    }

    /// The noise stream of one chip.
    #[must_use]
    pub fn stream(&self, kind: ChipKind) -> Stream {
        Stream::new(self.seed, Source::Imu, kind as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matrix_bias_temperature_and_noise_each_show() {
        let mut noise = Stream::new(1, Source::Imu, 0);
        let mut e = ChipErrors::default();
        assert_eq!(e.seen([1.0, 2.0, 3.0], 25.0, &mut noise), [1.0, 2.0, 3.0]);
        e.matrix[0] = [1.1, 0.0, 0.01];
        e.bias = [0.0, 0.5, 0.0];
        e.bias_per_k = [0.0, 0.0, 0.1];
        let seen = e.seen([1.0, 2.0, 3.0], 35.0, &mut noise);
        assert!(seen.iter().zip([1.13, 2.5, 4.0]).all(|(a, b)| (a - b).abs() < 1e-12), "{seen:?}");
        e = ChipErrors { noise: 0.2, ..ChipErrors::default() };
        let n = 20_000;
        let rms = ((0..n).map(|_| e.seen([0.0; 3], 25.0, &mut noise)[1].powi(2)).sum::<f64>() / f64::from(n)).sqrt();
        assert!((rms - 0.2).abs() < 0.005, "{rms}");
    }

    #[test]
    fn drawn_chips_differ_and_the_board_warms_up() {
        let (a, b) = (Errors::drawn(1), Errors::drawn(2));
        assert_ne!(a.chips, b.chips);
        assert_eq!(a, Errors::drawn(1));
        assert!((a.celsius(0) - 20.0).abs() < 1e-9 && (a.celsius(600_000_000_000) - 32.0).abs() < 1e-3);
        assert!((a.celsius(60_000_000_000) - (32.0 - 12.0 * libm::exp(-1.0))).abs() < 1e-9);
    }
}
