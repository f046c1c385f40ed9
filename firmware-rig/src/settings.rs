//! What the operator may change and the board remembers.
//!
//! What it is: the settings, how each changes the [`Config`], and their form in flash (postcard, sealed by `settings-store`).
//! What can go wrong: a setting out of its range is refused and changes nothing; a stored form of another version, length or
//! checksum is refused as damaged, and factory settings stay in force.
//! Units: on each field.
//! Reference: specification `rig.md`, "stored with checksum and version, refused when damaged".

use crate::config::Config;
use esc_pwm::{Slew, ThrottleCurve};
use frame::calibration::AdcScale;
use frame::message::Setting;
use frame::rig::CAPTURE_CHANNELS;
use frame::units::{Ampere, PulseWidth, RevPerMin, Ticks, Volt};
use serde::{Deserialize, Serialize};
use settings_store::Stored;

/// A setting out of its range.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OutOfRange;

/// The settings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Time between two samples, milliseconds.
    pub log_period_ms: u16,
    /// Marks a revolution of the capture channels.
    pub marks: [u16; CAPTURE_CHANNELS],
    /// Throttle curve by five points.
    pub curve: Option<[PulseWidth; 5]>,
    /// Most change of pulse in a millisecond, nanoseconds.
    pub slew_ns_per_ms: u32,
    /// Highest rotor speed.
    pub speed: RevPerMin,
    /// Highest current.
    pub current: Ampere,
    /// Lowest supply while armed.
    pub voltage: Volt,
    /// Longest silence of the host while armed, milliseconds.
    pub link_ms: u16,
    /// Scale of the load cell from masses; `None` is the design's.
    pub strain: Option<AdcScale>,
}

impl Settings {
    /// What `config` says.
    #[must_use]
    pub fn of(config: &Config) -> Self {
        Self {
            log_period_ms: config.log_period().as_ms() as u16,
            marks: config.marks,
            curve: match config.curve {
                ThrottleCurve::Linear => None,
                ThrottleCurve::Points(points) => Some(points),
            },
            slew_ns_per_ms: config.slew.ns_per_ms,
            speed: config.limits.speed,
            current: config.limits.current,
            voltage: config.limits.voltage,
            link_ms: config.limits.link_ms as u16,
            strain: None,
        }
    }

    /// These settings with one changed.
    ///
    /// # Errors
    /// [`OutOfRange`]; nothing is changed then.
    pub fn with(mut self, setting: &Setting, factory: &Self) -> Result<Self, OutOfRange> {
        match *setting {
            Setting::LogPeriodMs(ms) => self.log_period_ms = ms,
            Setting::Marks(marks) => self.marks = marks,
            Setting::Curve(curve) => self.curve = curve,
            Setting::SlewNsPerMs(slew) => self.slew_ns_per_ms = slew,
            Setting::SpeedLimit(rpm) => self.speed = RevPerMin(rpm),
            Setting::CurrentLimit(ampere) => self.current = Ampere(ampere),
            Setting::VoltageLimit(volt) => self.voltage = Volt(volt),
            Setting::LinkMs(ms) => self.link_ms = ms,
            Setting::Factory => self = *factory,
        }
        if self.in_range() { Ok(self) } else { Err(OutOfRange) }
    }

    /// Whether every setting is possible. A NaN is in no range.
    #[must_use]
    pub fn in_range(&self) -> bool {
        let rising = |points: &[PulseWidth; 5]| {
            let [a, b, c, d, e] = points;
            a <= b && b <= c && c <= d && d <= e && points.iter().all(|p| *p == p.clamped())
        };
        (10..=1000).contains(&self.log_period_ms)
            && self.marks.iter().all(|m| *m <= 100)
            && self.marks.iter().any(|m| *m > 0)
            && self.curve.as_ref().is_none_or(rising)
            && (10..=1_000_000).contains(&self.slew_ns_per_ms)
            && (100.0..=30_000.0).contains(&self.speed.0)
            && (0.1..=200.0).contains(&self.current.0)
            && (1.0..=60.0).contains(&self.voltage.0)
            && (200..=5000).contains(&self.link_ms)
            && self.strain.is_none_or(|s| s.zero.is_finite() && s.gain.is_finite() && s.gain != 0.0)
    }

    /// `config` with these settings in force.
    #[must_use]
    pub fn apply(&self, config: &Config) -> Config {
        let mut config = config.clone();
        config.log_period = Ticks(u64::from(config.ticks_per_ms()) * u64::from(self.log_period_ms));
        config.marks = self.marks;
        config.curve = self.curve.map_or(ThrottleCurve::Linear, ThrottleCurve::Points);
        config.slew = Slew { ns_per_ms: self.slew_ns_per_ms };
        config.limits.speed = self.speed;
        config.limits.current = self.current;
        config.limits.voltage = self.voltage;
        config.limits.link_ms = u32::from(self.link_ms);
        config.strain_scale = self.strain;
        config
    }
}

impl Stored for Settings {
    const VERSION: u8 = 1;

    fn write(&self, content: &mut [u8]) -> Option<usize> {
        Some(postcard::to_slice(self, content).ok()?.len())
    }

    fn read(content: &[u8]) -> Option<Self> {
        postcard::from_bytes::<Self>(content).ok().filter(Self::in_range)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use settings_store::{MAX_STORED, open, seal};

    fn factory() -> Settings {
        Settings::of(&Config::thesis_570kv())
    }

    #[test]
    fn the_stored_form_comes_back_and_fits() {
        let curve = Some([PulseWidth::MIN, PulseWidth::MAX, PulseWidth::MAX, PulseWidth::MAX, PulseWidth::MAX]);
        let fullest = Settings {
            log_period_ms: 1000,
            marks: [100; 4],
            curve,
            slew_ns_per_ms: 1_000_000,
            link_ms: 5000,
            strain: Some(AdcScale { zero: 1.5, gain: -0.1 }),
            ..factory()
        };
        for settings in [factory(), fullest] {
            let mut buffer = [0; MAX_STORED];
            let stored = seal(&settings, &mut buffer).expect("it fits");
            assert_eq!(open(stored), Some(settings));
        }
    }

    #[test]
    fn applied_settings_say_the_same_again() {
        let config = Config::thesis_570kv();
        let changed = Settings { log_period_ms: 20, marks: [3, 1, 2, 25], link_ms: 700, ..factory() };
        assert_eq!(Settings::of(&changed.apply(&config)), changed);
    }

    #[test]
    fn impossible_settings_change_nothing() {
        for bad in [
            Setting::LogPeriodMs(9),
            Setting::LogPeriodMs(1001),
            Setting::Marks([0; 4]),
            Setting::Marks([101, 1, 1, 1]),
            Setting::Curve(Some([PulseWidth::MAX, PulseWidth::MIN, PulseWidth::MIN, PulseWidth::MIN, PulseWidth::MIN])),
            Setting::SlewNsPerMs(0),
            Setting::SpeedLimit(f32::NAN),
            Setting::CurrentLimit(f32::INFINITY),
            Setting::VoltageLimit(-1.0),
            Setting::LinkMs(100),
        ] {
            assert_eq!(factory().with(&bad, &factory()), Err(OutOfRange), "{bad:?}");
        }
    }

    proptest! {
        /// Any damage of any one byte, and any cut, is noticed.
        #[test]
        fn damage_is_refused(at in 0usize..96, flip in 1u8..=255, cut in 0usize..96) {
            let mut buffer = [0; MAX_STORED];
            let stored = seal(&factory(), &mut buffer).unwrap().to_vec();
            let mut broken = stored.clone();
            broken[at % stored.len()] ^= flip;
            prop_assert_eq!(open::<Settings>(&broken), None);
            prop_assert_eq!(open::<Settings>(&stored[..cut % stored.len()]), None);
        }
    }
}
