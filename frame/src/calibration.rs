//! The one place where raw codes become physical values.
//!
//! What it is: gains and zeros of the ADC channels, pulses per revolution of the capture channels.
//! What can go wrong: a missing or saturated code gives no value rather than a wrong one.
//! Units: SI and rev/min out; ADC counts and timer ticks in.
//! Reference: speed over whole revolutions, specification `rig.md`; linear load-cell calibration, Beharie 2013 Eq. 5.35.

use crate::rig::{ADC_CHANNELS, AdcCode, AdcVerdict, CAPTURE_CHANNELS, CaptureCode, CaptureVerdict, RigSample, UNEVEN_PARTS};
use crate::units::Ticks;
use serde::{Deserialize, Serialize};

/// Linear scale of one ADC channel: value = (mean counts - zero) * gain.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AdcScale {
    /// Counts at value zero.
    pub zero: f32,
    /// Channel's unit per count.
    pub gain: f32,
}

/// What turns a [`RigSample`] into physical values. Sent by the board and recorded with the log.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Calibration {
    /// Capture timer, Hz.
    pub timer_hz: u32,
    /// Equal marks a revolution for each capture channel; 0 where none is fitted.
    pub marks: [u16; CAPTURE_CHANNELS],
    /// Scales of strain (N), torque (N.m), current (A), voltage (V), temperature (degC).
    pub adc: [AdcScale; ADC_CHANNELS],
    /// Pole pairs of the motor as the ESC's telemetry and as the back-EMF meter count by them; 0 where it is not fitted.
    pub pole_pairs: [u16; 2],
}

/// Physical values of one sample; `None` where there is no trustworthy code.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Converted {
    /// Time since reset, s.
    pub t_s: f64,
    /// Pulse width, us.
    pub pulse_us: f64,
    /// Rotor speed of each capture channel, rev/min.
    pub rpm: [Option<f64>; CAPTURE_CHANNELS],
    /// Thrust N, torque N.m, current A, voltage V, temperature degC.
    pub adc: [Option<f64>; ADC_CHANNELS],
    /// Root mean square of the strain about its mean, N.
    pub thrust_rms_n: Option<f64>,
    /// Angle by which the two marks of a capture channel stand off their opposite places, deg; of channels with two marks only.
    pub uneven_deg: [Option<f64>; CAPTURE_CHANNELS],
    /// What the ESC tells, in the order of [`crate::esc::ESC_NAMES`].
    pub esc: [Option<f64>; 5],
    /// Rotor speed by the back-EMF meter, rev/min.
    pub rpm_bemf: Option<f64>,
}

impl Calibration {
    /// Rotor speed of capture channel `channel`, rev/min.
    ///
    /// Faulty verdicts still give their number (the host sees the verdict beside it); lost, over-captured and absent
    /// channels give none.
    #[must_use]
    pub fn speed(&self, channel: usize, code: &CaptureCode) -> Option<f64> {
        self.turning(*self.marks.get(channel)?, code)
    }

    /// Rotor speed by `marks` equal marks a revolution, rev/min.
    fn turning(&self, marks: u16, code: &CaptureCode) -> Option<f64> {
        match code.verdict {
            CaptureVerdict::Stopped => (marks > 0).then_some(0.0),
            CaptureVerdict::Lost | CaptureVerdict::OverCapture | CaptureVerdict::Absent => None,
            _ if marks == 0 || code.span == 0 => None,
            _ => {
                let revolutions = f64::from(code.edges) / f64::from(marks);
                Some(60.0 * revolutions * f64::from(self.timer_hz) / f64::from(code.span))
            }
        }
    }

    /// Angle by which the two marks of capture channel `channel` stand off their opposite places, deg: their periods are long and short by
    /// turns, by `angle / 90 deg` of their mean. `None` where there are not two, or the reading does not tell.
    #[must_use]
    pub fn uneven_deg(&self, channel: usize, code: &CaptureCode) -> Option<f64> {
        (self.marks.get(channel) == Some(&2) && code.uneven > 0).then(|| 90.0 * f64::from(code.uneven) / f64::from(UNEVEN_PARTS))
    }

    /// Value of ADC channel `channel` in its unit.
    #[must_use]
    pub fn value(&self, channel: usize, code: &AdcCode) -> Option<f64> {
        let scale = self.adc.get(channel)?;
        match code.verdict {
            AdcVerdict::Missing | AdcVerdict::Open | AdcVerdict::Short | AdcVerdict::Absent => None,
            AdcVerdict::Nominal | AdcVerdict::Saturated => (code.count > 0).then(|| {
                let mean = f64::from(code.sum) / f64::from(code.count);
                (mean - f64::from(scale.zero)) * f64::from(scale.gain)
            }),
        }
    }

    /// Everything in one sample.
    #[must_use]
    pub fn convert(&self, sample: &RigSample) -> Converted {
        let mut out = Converted {
            t_s: if self.timer_hz == Ticks::HZ { sample.at.as_s() } else { sample.at.0 as f64 / f64::from(self.timer_hz) },
            pulse_us: sample.pulse.as_us(),
            ..Converted::default()
        };
        for (i, (value, code)) in out.rpm.iter_mut().zip(&sample.rpm).enumerate() {
            *value = self.speed(i, code);
        }
        for (i, (value, code)) in out.uneven_deg.iter_mut().zip(&sample.rpm).enumerate() {
            *value = self.uneven_deg(i, code);
        }
        for (i, (value, code)) in out.adc.iter_mut().zip(&sample.adc).enumerate() {
            *value = self.value(i, code);
        }
        if let (Some(code), Some(scale)) = (sample.adc.first(), self.adc.first())
            && code.count > 0
        {
            let gain = if scale.gain < 0.0 { -scale.gain } else { scale.gain };
            out.thrust_rms_n = Some(f64::from(code.rms_q8) / 256.0 * f64::from(gain));
        }
        let [esc, back_emf] = self.pole_pairs;
        out.esc = sample.esc.map_or([None; 5], |code| code.values(esc));
        out.rpm_bemf = sample.back_emf.and_then(|code| self.turning(back_emf, &code));
        out
    }
}
