//! Random numbers of the simulator.
//!
//! What it is: one named ChaCha stream per noise source, so that adding a source leaves every other one as it was.
//! What can go wrong: two sources that share a stream are correlated; a [`Source`] is therefore taken once a bench.
//! Units: standard deviations; each user scales to its own.
//! Reference: Irwin-Hall approximation of the normal law (Marsaglia 1964), cut at 3.46 standard deviations.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};

/// What a random stream is for. The number is the ChaCha stream and never changes its meaning.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u64)]
pub enum Source {
    /// Turbulence of the air at the rotor.
    Gust = 1,
    /// Amplifier and interference noise ahead of the ADC; five sub-streams.
    Amplifier = 10,
    /// Conversion noise of the ADC.
    Adc = 20,
    /// Edge jitter of the four speed sensors; four sub-streams.
    Edge = 30,
    /// Step errors of the encoder disc.
    EncoderDisc = 40,
    /// Sizes of drawn effects.
    Effect = 50,
    /// Losses on the serial line.
    Line = 80,
    /// Gusts that a flying body meets; six sub-streams, two an axis.
    Wind = 70,
    /// Noise of the three chips of the IMU board; three sub-streams, and one for what is drawn of them.
    Imu = 90,
    /// What a noisy line makes of the ESC's telemetry.
    EscLine = 100,
    /// Jitter of the back-EMF comparator.
    BackEmf = 110,
    /// Start angle of the rotor and phase of the imbalance.
    Phase = 60,
}

/// A uniform number in 0..1 that depends on `seed` and `slot` alone: for events at random instants (splitmix64).
#[must_use]
pub fn chance(seed: u64, slot: u64) -> f64 {
    let mut z = seed.wrapping_mul(0xD129_0309_5FA5_1F4D).wrapping_add(slot.wrapping_mul(0x9E37_79B9_7F4A_7C15));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}

/// One stream of random numbers.
#[derive(Debug, Clone)]
pub struct Stream {
    rng: ChaCha8Rng,
}

impl Stream {
    /// The stream of `source` (and its sub-stream `index`) under `seed`.
    #[must_use]
    pub fn new(seed: u64, source: Source, index: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(source as u64 * 64 + index);
        Self { rng }
    }

    /// Uniform in 0..1, 53 bits.
    pub fn uniform(&mut self) -> f64 {
        (self.rng.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Uniform in `low..high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Log-uniform in `low..high`, both positive.
    pub fn log_between(&mut self, low: f64, high: f64) -> f64 {
        libm::exp(self.between(libm::log(low), libm::log(high)))
    }

    /// -1 or +1.
    pub fn sign(&mut self) -> f64 {
        if self.rng.next_u32() & 1 == 0 { -1.0 } else { 1.0 }
    }

    /// Nearly normal, mean 0 and standard deviation 1: the sum of four 16-bit uniforms.
    pub fn normal(&mut self) -> f64 {
        let w = self.rng.next_u64();
        let sum = (w & 0xffff) + (w >> 16 & 0xffff) + (w >> 32 & 0xffff) + (w >> 48);
        // 4 x (65536^2 - 1)/12, square root
        (sum as f64 - 131_070.0) * (1.0 / 37_837.227_006_3)
    }

    /// Two coarser and faster ones than [`Stream::normal`]: four 8-bit uniforms each, 148 levels a standard deviation.
    #[inline]
    pub fn quick_normals(&mut self) -> [f64; 2] {
        quick(self.rng.next_u64())
    }

    /// The words of which [`Stream::quick_normals`] makes its two each, many at once: the same as one after the other, the lowest
    /// byte first.
    #[inline]
    pub(crate) fn words(&mut self, into: &mut [[u8; 8]]) {
        self.rng.fill_bytes(into.as_flattened_mut());
    }
}

/// Two nearly normal numbers of a word.
#[inline]
pub(crate) fn quick(word: u64) -> [f64; 2] {
    const PAIRS: u64 = 0x00ff_00ff_00ff_00ff;
    /// 2^52, whose lowest bits count ones: a small whole number becomes a double without a conversion.
    const WHOLE: f64 = 4_503_599_627_370_496.0;
    let scaled = |sum: u64| (f64::from_bits(WHOLE.to_bits() | (sum & 0xffff)) - (WHOLE + 510.0)) * (1.0 / 147.800_541_3);
    // two sums of two bytes in each half, then one of four
    let twos = (word & PAIRS) + (word >> 8 & PAIRS);
    let fours = twos + (twos >> 16);
    [scaled(fours), scaled(fours >> 32)]
}

/// Coloured noise: an Ornstein-Uhlenbeck process sampled at a fixed interval.
#[derive(Debug, Clone)]
pub struct Coloured {
    stream: Stream,
    keep: f64,
    kick: f64,
    value: f64,
}

impl Coloured {
    /// Standard deviation `sigma`, correlation time `tau_s`, one [`Coloured::next`] every `interval_s`.
    #[must_use]
    pub fn new(stream: Stream, sigma: f64, tau_s: f64, interval_s: f64) -> Self {
        let keep = libm::exp(-interval_s / tau_s);
        Self { stream, keep, kick: sigma * (1.0 - keep * keep).sqrt(), value: 0.0 }
    }

    /// The next value.
    #[allow(clippy::should_implement_trait)]
    pub fn next(&mut self) -> f64 {
        self.value = self.keep * self.value + self.kick * self.stream.normal();
        self.value
    }

    /// Standard deviation such that the mean over `window_s` has standard deviation `target`.
    #[must_use]
    pub fn sigma_for_mean(target: f64, tau_s: f64, window_s: f64) -> f64 {
        let r = tau_s / window_s;
        // variance of the mean of an Ornstein-Uhlenbeck process: 2 r (1 - r (1 - exp(-1/r)))
        target / (2.0 * r * (1.0 - r * (1.0 - libm::exp(-1.0 / r)))).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_have_unit_variance() {
        let mut a = Stream::new(1, Source::Gust, 0);
        let n = 200_000;
        let (mut m, mut v, mut w) = (0.0, 0.0, 0.0);
        for _ in 0..n {
            let x = a.normal();
            m += x;
            v += x * x;
            let [y, z] = a.quick_normals();
            w += 0.5 * (y * y + z * z);
        }
        let n = f64::from(n);
        assert!((m / n).abs() < 0.01);
        assert!((v / n - 1.0).abs() < 0.01, "{}", v / n);
        assert!((w / n - 1.0).abs() < 0.01, "{}", w / n);
    }

    #[test]
    fn many_words_are_one_after_the_other() {
        let (mut one, mut many) = (Stream::new(5, Source::Adc, 0), Stream::new(5, Source::Adc, 0));
        for _ in 0..100 {
            let want: [[f64; 2]; 25] = core::array::from_fn(|_| one.quick_normals());
            let mut words = [[0; 8]; 25];
            many.words(&mut words);
            assert_eq!(words.map(|word| quick(u64::from_le_bytes(word))), want);
        }
    }

    #[test]
    fn streams_are_apart_and_repeatable() {
        let take = |seed, source, index| {
            let mut s = Stream::new(seed, source, index);
            [s.uniform(), s.uniform()]
        };
        assert_eq!(take(7, Source::Edge, 1), take(7, Source::Edge, 1));
        assert_ne!(take(7, Source::Edge, 1), take(7, Source::Edge, 2));
        assert_ne!(take(7, Source::Edge, 1), take(8, Source::Edge, 1));
    }

    #[test]
    fn the_mean_of_coloured_noise_has_the_wanted_size() {
        let sigma = Coloured::sigma_for_mean(1.0, 0.003, 0.1);
        let mut c = Coloured::new(Stream::new(3, Source::Amplifier, 0), sigma, 0.003, 0.001);
        let blocks = 4000;
        let mut v = 0.0;
        for _ in 0..blocks {
            let mean = (0..100).map(|_| c.next()).sum::<f64>() / 100.0;
            v += mean * mean;
        }
        let got = (v / f64::from(blocks)).sqrt();
        assert!((got - 1.0).abs() < 0.05, "{got}");
    }
}
