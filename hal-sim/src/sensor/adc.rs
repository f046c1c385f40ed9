//! Analogue front ends and the 12-bit converter.
//!
//! What it is: five linear front ends (strain, torque, current, voltage, temperature) up to the ADC pin, coloured noise on each
//! wire, and conversions with quantisation and their own noise, summed a millisecond at a time.
//! What can go wrong: a pin outside 0..3.3 V gives the code at that end.
//! Units: V at the pin, counts of 3.3 V / 4096.
//! Reference: STM32F405 ADC, RM0090 section 13; Beharie 2013 Eq. 5.57-5.58 and errata 5.59 (shunt: I = V/(R_s G)).

use super::conversions::{ALL, EIGHT, Levels, PAIRS, Pairs};
use crate::noise::{Coloured, Source, Stream, quick};
use crate::plant::powerplant::STEPS_PER_MS;
use crate::plant::{Bridge, PlantState};
use firmware_rig::AdcBlock;
use frame::calibration::AdcScale;
use frame::rig::ADC_CHANNELS;

/// Reference voltage, V.
pub const REFERENCE_V: f64 = 3.3;
/// Codes of 12 bits.
pub const CODES: f64 = 4096.0;
/// Correlation time of the noise on the wires, s.
const NOISE_TAU_S: f64 = 3.0e-3;
/// Logging interval for which the noise figures of a scenario hold, s.
const NOISE_WINDOW_S: f64 = 0.1;
/// Interval at which the noise on the wires is renewed, s.
const NOISE_INTERVAL_S: f64 = 1.0e-3;

/// Linear front ends: pin voltage = zero + value / unit_per_volt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AnalogFront {
    /// Pin voltage at value zero, V.
    pub zero_v: [f64; ADC_CHANNELS],
    /// Channel's unit per volt at the pin.
    pub unit_per_volt: [f64; ADC_CHANNELS],
    /// The same the other way round.
    volt_per_unit: [f64; ADC_CHANNELS],
}

impl AnalogFront {
    /// Front ends of the rig: bridge as given; torque arm of 0.1 m with 0.25 V/N about 1.65 V; shunt of 1 mohm times 50 above
    /// 0.2 V; supply divided by 6; TMP36 (10 mV/K, 0.5 V at 0 degC).
    #[must_use]
    pub fn new(bridge: &Bridge) -> Self {
        let unit_per_volt = [bridge.newton_per_volt(), 0.4, 20.0, 6.0, 100.0];
        Self { zero_v: [bridge.resting_v(), 1.65, 0.2, 0.0, 0.5], unit_per_volt, volt_per_unit: unit_per_volt.map(|u| 1.0 / u) }
    }

    /// The scales that turn counts back into values.
    #[must_use]
    pub fn scales(&self) -> [AdcScale; ADC_CHANNELS] {
        core::array::from_fn(|i| AdcScale {
            zero: (self.zero_v[i] * CODES / REFERENCE_V) as f32,
            gain: (self.unit_per_volt[i] * REFERENCE_V / CODES) as f32,
        })
    }

    /// Pin voltages without noise; the strain pin comes from the bridge.
    #[must_use]
    #[inline]
    pub fn pins(&self, strain_v: f64, state: &PlantState) -> [f64; ADC_CHANNELS] {
        let values = [0.0, state.torque_nm, state.current_a, state.voltage_v, state.temp_c];
        let mut out = core::array::from_fn(|i| self.zero_v[i] + values[i] * self.volt_per_unit[i]);
        out[0] = strain_v;
        out
    }

    /// What a current changes at its pin, V.
    #[must_use]
    pub fn volts_of(&self, current_a: f64) -> f64 {
        current_a * self.volt_per_unit[2]
    }

    /// Voltage of the torque pin at `torque_nm`.
    #[must_use]
    #[inline]
    pub fn torque_v(&self, torque_nm: f64) -> f64 {
        self.zero_v[1] + torque_nm * self.volt_per_unit[1]
    }
}

/// The converter with the noise on its five wires.
#[derive(Debug, Clone)]
pub struct Converter {
    wires: [Coloured; ADC_CHANNELS],
    offset_v: [f64; ADC_CHANNELS],
    conversion: Stream,
    conversion_counts: f64,
    eight: Pairs,
    /// Words with those of a ninth among them; their place is kept.
    drawn: [[u8; 8]; ALL + ADC_CHANNELS],
}

impl Converter {
    /// Noise figures `mean_noise` are standard deviations of a mean over 0.1 s, in each channel's unit.
    #[must_use]
    pub fn new(front: &AnalogFront, mean_noise: [f64; ADC_CHANNELS], seed: u64) -> Self {
        let wires = core::array::from_fn(|i| {
            let volts = (mean_noise[i] / front.unit_per_volt[i]).abs();
            let sigma = Coloured::sigma_for_mean(volts, NOISE_TAU_S, NOISE_WINDOW_S);
            Coloured::new(Stream::new(seed, Source::Amplifier, i as u64), sigma, NOISE_TAU_S, NOISE_INTERVAL_S)
        });
        Self {
            wires,
            offset_v: [0.0; ADC_CHANNELS],
            conversion: Stream::new(seed, Source::Adc, 0),
            conversion_counts: 1.2, // rms, STM32F405 datasheet: total unadjusted error +-2 LSB typical
            eight: Pairs::default(),
            drawn: [[0; 8]; ALL + ADC_CHANNELS],
        }
    }

    /// Draws the noise of the next millisecond with `count` conversions of each channel (8 or 9), in the order in which
    /// [`Converter::renew`] and one conversion after the other would: work that needs no level, for whoever waits for one.
    pub fn draw_ahead(&mut self, count: u16) {
        self.renew();
        if usize::from(count) > EIGHT {
            self.conversion.words(&mut self.drawn);
            let places = self.eight.words.chunks_exact_mut(PAIRS).zip(&mut self.eight.ninth);
            for (own, (eight, ninth)) in self.drawn.chunks_exact(PAIRS + 1).zip(places) {
                eight.copy_from_slice(&own[..PAIRS]);
                [*ninth, _] = quick(u64::from_le_bytes(own[PAIRS]));
            }
        } else {
            self.conversion.words(&mut self.eight.words);
        }
    }

    /// Renews the noise on the wires; once a millisecond.
    pub fn renew(&mut self) {
        for (offset, wire) in self.offset_v.iter_mut().zip(&mut self.wires) {
            *offset = wire.next();
        }
    }

    /// Noise on the wire of `channel` now, V.
    #[must_use]
    pub fn offset_v(&self, channel: usize) -> f64 {
        self.offset_v[channel]
    }

    /// One conversion of `channel` with `pin_v` (noise on the wire not included) at the pin.
    pub fn convert(&mut self, channel: usize, pin_v: f64) -> u16 {
        let [noise, _] = self.conversion.quick_normals();
        self.code((pin_v + self.offset_v[channel]) * (CODES / REFERENCE_V), noise)
    }

    /// Code of a level of `counts` with `noise` standard deviations of the converter's own.
    #[inline]
    fn code(&self, counts: f64, noise: f64) -> u16 {
        let noisy = counts + self.conversion_counts * noise + 0.5;
        // The cast truncates and saturates at 0; the ideal converter's thresholds lie half a count below each code.
        (noisy as u16).min(CODES as u16 - 1)
    }

    /// The conversions of every channel, of which the noise has been drawn ahead: strain at the voltages of one millisecond, the
    /// others at one.
    pub fn blocks(
        &mut self,
        count: u16,
        strain_v: &[f64; STEPS_PER_MS],
        pins_v: &[f64; ADC_CHANNELS],
        out: &mut [AdcBlock; ADC_CHANNELS],
    ) {
        let level = self.levels(count, strain_v, pins_v);
        self.eight.convert(&level, self.conversion_counts, out);
    }

    /// The single conversions of `channel` of which [`Converter::blocks`] was the sum, in order.
    pub fn codes(
        &self,
        channel: usize,
        count: u16,
        strain_v: &[f64; STEPS_PER_MS],
        pins_v: &[f64; ADC_CHANNELS],
    ) -> impl Iterator<Item = u16> {
        let level = self.levels(count, strain_v, pins_v);
        self.eight.codes(channel, &level, self.conversion_counts).into_iter().take(usize::from(count))
    }

    /// What stands at the pins in a millisecond, the wires' noise included.
    fn levels(&self, count: u16, strain_v: &[f64; STEPS_PER_MS], pins_v: &[f64; ADC_CHANNELS]) -> Levels {
        let counts = |pin_v: f64, offset_v: f64| (pin_v + offset_v) * (CODES / REFERENCE_V);
        let nine = usize::from(count) > EIGHT;
        let strain = if nine { readings::<9>(strain_v) } else { readings::<8>(strain_v) };
        let strain = strain.map(|pin_v| counts(pin_v, self.offset_v[0]));
        let mut level = [strain[EIGHT]; ADC_CHANNELS];
        for ((level, pin_v), offset_v) in level.iter_mut().zip(pins_v).zip(&self.offset_v).skip(1) {
            *level = counts(*pin_v, *offset_v);
        }
        let [first @ .., _] = strain;
        Levels { first, all: level, nine }
    }
}

/// What each of `COUNT` readings of a millisecond finds: the i-th that of step i x steps / count.
fn readings<const COUNT: usize>(steps: &[f64; STEPS_PER_MS]) -> [f64; EIGHT + 1] {
    core::array::from_fn(|i| steps[(i * STEPS_PER_MS / COUNT).min(STEPS_PER_MS - 1)])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The conversions of one millisecond.
    fn millisecond(
        c: &mut Converter,
        count: u16,
        strain_v: &[f64; 10],
        pins_v: &[f64; ADC_CHANNELS],
    ) -> [AdcBlock; ADC_CHANNELS] {
        let mut blocks = [AdcBlock::default(); ADC_CHANNELS];
        c.draw_ahead(count);
        c.blocks(count, strain_v, pins_v, &mut blocks);
        blocks
    }

    #[test]
    fn the_mean_of_many_conversions_finds_the_pin_between_two_codes() {
        let front = AnalogFront::new(&Bridge::default());
        let mut c = Converter::new(&front, [0.0; 5], 1);
        let lsb = REFERENCE_V / CODES;
        for fraction in [0.0, 0.25, 0.5, 0.75] {
            let pin = (1000.0 + fraction) * lsb;
            let mut b = AdcBlock::default();
            for ms in 0..2_500 {
                b.add(&millisecond(&mut c, 8 + ms % 2, &[pin; 10], &[pin; ADC_CHANNELS])[usize::from(ms % 5)]);
            }
            let mean = f64::from(b.sum) / f64::from(b.count);
            assert!((mean - 1000.0 - fraction).abs() < 0.03, "{mean}");
            let rms = (b.sum_sq as f64 / f64::from(b.count) - mean * mean).sqrt();
            assert!((rms - (1.44f64 + 1.0 / 12.0).sqrt()).abs() < 0.05, "{rms}");
        }
    }

    /// A block is its conversions one by one.
    #[test]
    fn a_block_is_its_conversions() {
        let front = AnalogFront::new(&Bridge::default());
        let mut c = Converter::new(&front, [0.01; 5], 4);
        let low: [f64; 10] = core::array::from_fn(|i| -0.001 + 0.0009 * i as f64);
        let high: [f64; 10] = core::array::from_fn(|i| 3.2965 + 0.0009 * i as f64);
        for round in 0..200u16 {
            let (strain, count) = ([low, high][usize::from(round % 2)], 8 + round / 2 % 2);
            let pins: [f64; ADC_CHANNELS] = core::array::from_fn(|i| strain[2 * i]);
            let mut stream = c.conversion.clone();
            let blocks = millisecond(&mut c, count, &strain, &pins);
            for (channel, got) in blocks.iter().enumerate() {
                let mut want = AdcBlock { count, min: u16::MAX, ..AdcBlock::default() };
                let mut one_by_one = Vec::new();
                let mut spare = 0.0;
                for i in 0..count {
                    let noise = if i % 2 == 0 {
                        let [now, next] = stream.quick_normals();
                        spare = next;
                        now
                    } else {
                        spare
                    };
                    let pin =
                        if channel == 0 { strain[usize::from(i) * strain.len() / usize::from(count)] } else { pins[channel] };
                    let code = c.code((pin + c.offset_v(channel)) * (CODES / REFERENCE_V), noise);
                    one_by_one.push(code);
                    want.sum += u32::from(code);
                    want.sum_sq += u64::from(u32::from(code) * u32::from(code));
                    (want.min, want.max) = (want.min.min(code), want.max.max(code));
                }
                assert_eq!(*got, want, "channel {channel}, {count}");
                let codes: Vec<u16> = c.codes(channel, count, &strain, &pins).collect();
                assert_eq!(codes, one_by_one, "channel {channel}, {count}");
            }
        }
    }

    #[test]
    fn the_ends_saturate() {
        let front = AnalogFront::new(&Bridge::default());
        let mut c = Converter::new(&front, [0.0; 5], 1);
        let blocks = millisecond(&mut c, 9, &[-0.5; 10], &[4.0; ADC_CHANNELS]);
        assert_eq!(blocks[0].max, 0);
        assert!(blocks[1..].iter().all(|b| b.min == 4095));
    }

    #[test]
    fn scales_invert_the_front_ends() {
        let front = AnalogFront::new(&Bridge::default());
        let state = PlantState { torque_nm: 0.05, current_a: 7.0, voltage_v: 11.2, temp_c: 25.0, ..PlantState::default() };
        let strain = front.zero_v[0] + 2.0 / front.unit_per_volt[0];
        let want = [2.0, 0.05, 7.0, 11.2, 25.0];
        for ((pin, scale), want) in front.pins(strain, &state).iter().zip(front.scales()).zip(want) {
            let got = (pin * CODES / REFERENCE_V - f64::from(scale.zero)) * f64::from(scale.gain);
            assert!((got - want).abs() < 1e-3, "{got} {want}");
        }
    }
}
