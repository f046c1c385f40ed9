//! Chance: every random number of the campaign.
//!
//! What it is: a seeded stream with the few distributions that the generator needs.
//! What can go wrong: one stream for two purposes makes one depend on the other, so each purpose has its own stream number.
//! Units: those of the arguments.
//! Reference: Box and Muller 1958; ChaCha8 as in `rand_chacha`.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A seeded stream.
#[derive(Debug, Clone)]
pub struct Chance {
    inner: ChaCha8Rng,
    spare: Option<f64>,
}

impl Chance {
    /// Stream number `stream` of a seed.
    #[must_use]
    pub fn new(seed: u64, stream: u64) -> Self {
        let mut inner = ChaCha8Rng::seed_from_u64(seed ^ 0x51D7_348D_A2C3_11E5);
        inner.set_stream(stream);
        Self { inner, spare: None }
    }

    /// Uniform between two bounds.
    pub fn between(&mut self, lo: f64, hi: f64) -> f64 {
        lo + (hi - lo) * self.inner.random::<f64>()
    }

    /// Uniform in the logarithm between two positive bounds.
    pub fn log_between(&mut self, lo: f64, hi: f64) -> f64 {
        self.between(lo.ln(), hi.ln()).exp()
    }

    /// True with a probability.
    pub fn happens(&mut self, probability: f64) -> bool {
        self.inner.random::<f64>() < probability
    }

    /// Plus or minus one.
    pub fn sign(&mut self) -> f64 {
        if self.happens(0.5) { 1.0 } else { -1.0 }
    }

    /// One of a slice.
    ///
    /// # Panics
    /// On an empty slice.
    pub fn of<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.inner.random_range(0..choices.len())]
    }

    /// Standard normal.
    pub fn normal(&mut self) -> f64 {
        if let Some(v) = self.spare.take() {
            return v;
        }
        let u = 1.0 - self.inner.random::<f64>();
        let (s, c) = (std::f64::consts::TAU * self.inner.random::<f64>()).sin_cos();
        let r = (-2.0 * u.ln()).sqrt();
        self.spare = Some(r * s);
        r * c
    }

    /// How many of `n` independent trials succeed.
    pub fn binomial(&mut self, n: u32, probability: f64) -> u32 {
        (0..n).filter(|_| self.happens(probability)).count() as u32
    }
}
