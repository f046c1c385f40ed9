//! Analogue front ends and the 12-bit converter.
//!
//! What it is: five linear front ends (strain, torque, current, voltage, temperature) up to the ADC pin, coloured noise on each
//! wire, and conversions with quantisation and their own noise, summed a millisecond at a time.
//! What can go wrong: a pin outside 0..3.3 V gives the code at that end.
//! Units: V at the pin, counts of 3.3 V / 4096.
//! Reference: STM32F405 ADC, RM0090 section 13; Beharie 2013 Eq. 5.57-5.58 and errata 5.59 (shunt: I = V/(R_s G)).

use crate::noise::{Coloured, Source, Stream};
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

    /// `count` conversions of `channel`, spread over the voltages of one millisecond.
    pub fn block(&mut self, channel: usize, count: u16, pins_v: &[f64]) -> AdcBlock {
        let mut block = AdcBlock { min: u16::MAX, ..AdcBlock::default() };
        let offset = self.offset_v[channel];
        let mut spare = 0.0;
        for i in 0..count {
            let noise = if i & 1 == 0 {
                let [now, next] = self.conversion.quick_normals();
                spare = next;
                now
            } else {
                spare
            };
            let pin = if pins_v.len() == 1 { pins_v[0] } else { pins_v[usize::from(i) * pins_v.len() / usize::from(count)] };
            let code = self.code((pin + offset) * (CODES / REFERENCE_V), noise);
            block.sum += u32::from(code);
            block.sum_sq += u64::from(u32::from(code) * u32::from(code));
            block.min = block.min.min(code);
            block.max = block.max.max(code);
        }
        block.count = count;
        block
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_of_many_conversions_finds_the_pin_between_two_codes() {
        let front = AnalogFront::new(&Bridge::default());
        let mut c = Converter::new(&front, [0.0; 5], 1);
        let lsb = REFERENCE_V / CODES;
        for fraction in [0.0, 0.25, 0.5, 0.75] {
            let pin = (1000.0 + fraction) * lsb;
            let b = c.block(0, 20_000, &[pin]);
            let mean = f64::from(b.sum) / f64::from(b.count);
            assert!((mean - 1000.0 - fraction).abs() < 0.03, "{mean}");
            let rms = (b.sum_sq as f64 / f64::from(b.count) - mean * mean).sqrt();
            assert!((rms - (1.44f64 + 1.0 / 12.0).sqrt()).abs() < 0.05, "{rms}");
        }
    }

    #[test]
    fn the_ends_saturate() {
        let front = AnalogFront::new(&Bridge::default());
        let mut c = Converter::new(&front, [0.0; 5], 1);
        assert_eq!(c.block(0, 9, &[-0.5]).max, 0);
        assert_eq!(c.block(0, 9, &[4.0]).min, 4095);
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
