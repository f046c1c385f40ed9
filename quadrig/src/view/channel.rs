//! A channel as it is shown.
//!
//! What it is: value, verdict, limits, trend, and what a model is off by.
//! What can go wrong: nothing; what is not fitted is shown as such.
//! Units: the log's.
//! Reference: specification `rig.md`, "The operator's side".

use super::screen::Tone;
use super::trend::Trend;
use firmware_rig::RigConfig;
use frame::calibration::Converted;
use frame::esc::ESC_UNITS;
use frame::rig::{ADC_CHANNELS, ADC_NAMES, AdcVerdict, CAPTURE_CHANNELS, CAPTURE_NAMES, CaptureVerdict, RigSample};

/// Channels of a rig: the capture channels, then the analogue ones.
pub(crate) const CHANNELS: usize = CAPTURE_CHANNELS + ADC_CHANNELS;

/// One channel.
#[derive(Debug, Clone)]
pub(crate) struct Channel {
    /// Its column in the log.
    pub(crate) name: &'static str,
    /// Its unit.
    pub(crate) unit: &'static str,
    /// Digits after the point.
    pub(crate) digits: usize,
    /// Fitted, as far as is known.
    pub(crate) fitted: bool,
    /// Last reading.
    pub(crate) value: Option<f64>,
    /// What the board says of it, in a word.
    pub(crate) verdict: (&'static str, Tone),
    /// Limits that are in force.
    pub(crate) limits: (Option<f64>, Option<f64>),
    /// Its last minutes.
    pub(crate) trend: Trend,
    /// What the model is off by, noise floors.
    pub(crate) floors: Option<f64>,
}

impl Channel {
    /// All of them, before anything was heard.
    pub(crate) fn all() -> [Self; CHANNELS] {
        std::array::from_fn(|i| {
            let (name, unit, digits) = match i.checked_sub(CAPTURE_CHANNELS) {
                None => (CAPTURE_NAMES[i], "rev/min", 1),
                Some(k) => {
                    let (unit, digits) = [("N", 3), ("N.m", 4), ("A", 2), ("V", 2), ("degC", 1)][k];
                    (ADC_NAMES[k], unit, digits)
                }
            };
            Self {
                name,
                unit,
                digits,
                fitted: true,
                value: None,
                verdict: ("", Tone::Dim),
                limits: (None, None),
                trend: Trend::default(),
                floors: None,
            }
        })
    }

    /// The limits that a configuration puts in force on each of them.
    pub(crate) fn limit(channels: &mut [Self; CHANNELS], config: &RigConfig) {
        let l = &config.limits;
        let both = |low: Option<f32>, high: Option<f32>| (low.map(f64::from), high.map(f64::from));
        let speed = both(l.speed.low.map(|v| v.0), l.speed.high.map(|v| v.0));
        let analogue = [
            both(l.thrust.low.map(|v| v.0), l.thrust.high.map(|v| v.0)),
            both(l.torque.low.map(|v| v.0), l.torque.high.map(|v| v.0)),
            both(l.current.low.map(|v| v.0), l.current.high.map(|v| v.0)),
            both(l.voltage.low.map(|v| v.0), l.voltage.high.map(|v| v.0)),
            both(l.temperature.low.map(|v| v.0), l.temperature.high.map(|v| v.0)),
        ];
        let (captures, rest) = channels.split_at_mut(CAPTURE_CHANNELS);
        for (channel, marks) in captures.iter_mut().zip(config.marks) {
            (channel.limits, channel.fitted) = (speed, marks > 0);
        }
        for ((channel, limits), fitted) in rest.iter_mut().zip(analogue).zip(config.fitted) {
            (channel.limits, channel.fitted) = (limits, fitted);
        }
    }

    /// Where the value lies between the ends of its bar, 0 to 1; the ends are zero, or a negative low limit, and the high limit.
    pub(crate) fn share(&self) -> Option<f64> {
        let (low, high) = self.limits;
        let from = low.filter(|l| *l < 0.0).unwrap_or(0.0);
        Some((self.value? - from) / (high? - from))
    }

    /// The smallest range that a trend shows at full height, so that noise is not drawn as news: ten steps of the last digit but one that is shown.
    pub(crate) fn least_range(&self) -> f64 {
        100.0 * 10f64.powi(-(self.digits as i32))
    }
}

/// A capture channel's verdict in a word.
pub(crate) fn capture_words(verdict: CaptureVerdict) -> (&'static str, Tone) {
    match verdict {
        CaptureVerdict::Nominal => ("ok", Tone::Good),
        CaptureVerdict::Stopped => ("stands", Tone::Dim),
        CaptureVerdict::Lost => ("LOST", Tone::Bad),
        CaptureVerdict::OverCapture => ("too fast", Tone::Bad),
        CaptureVerdict::Missed => ("misses", Tone::Warn),
        CaptureVerdict::Doubled => ("doubles", Tone::Warn),
        CaptureVerdict::Alternating => ("uneven", Tone::Warn),
        CaptureVerdict::Disagrees => ("disagrees", Tone::Warn),
        CaptureVerdict::Absent => ("not fitted", Tone::Dim),
        CaptureVerdict::BladeTwist => ("twist", Tone::Warn),
    }
}

/// What the ESC and the back-EMF meter say, in a line; `None` where neither is fitted.
pub(crate) fn second_words(sample: &RigSample, values: &Converted) -> Option<(Tone, String)> {
    let (mut tone, mut parts) = (Tone::Plain, Vec::new());
    if let Some(code) = &sample.esc {
        match code.verdict.flag() {
            None => {
                let digits = |unit: &str| if unit == "A" || unit == "V" { 2 } else { 0 };
                let told =
                    values.esc.iter().zip(ESC_UNITS).filter_map(|(v, unit)| Some(format!("{:.*} {unit}", digits(unit), (*v)?)));
                parts.push(format!("ESC {}", told.collect::<Vec<_>>().join(" ")));
            }
            Some(flag) => {
                tone = Tone::Warn;
                parts.push(format!("ESC: {}", flag.words));
            }
        }
    }
    if let Some(code) = &sample.back_emf {
        let (words, own) = capture_words(code.verdict);
        if matches!(own, Tone::Warn | Tone::Bad) {
            tone = Tone::Warn;
        }
        let value = values.rpm_bemf.map_or_else(|| "-".to_owned(), |v| format!("{v:.1}"));
        parts.push(format!("back-EMF {value} rev/min {words}"));
    }
    (!parts.is_empty()).then(|| (tone, parts.join("; ")))
}

/// An analogue channel's verdict in a word.
pub(crate) fn adc_words(verdict: AdcVerdict) -> (&'static str, Tone) {
    match verdict {
        AdcVerdict::Nominal => ("ok", Tone::Good),
        AdcVerdict::Saturated => ("SATURATED", Tone::Bad),
        AdcVerdict::Open => ("OPEN", Tone::Bad),
        AdcVerdict::Missing => ("missing", Tone::Bad),
        AdcVerdict::Short => ("SHORT", Tone::Bad),
        AdcVerdict::Absent => ("not fitted", Tone::Dim),
    }
}
