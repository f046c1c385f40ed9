//! Configuration of the filter.
//!
//! What it is: time constants, thresholds and ranges, each with its unit and, where it is a filter, its cut-off.
//! What can go wrong: constants per sample would change their meaning with the sample rate; these are all in seconds.
//! Units: s, rad, rad/s, m/s^2, uT.
//! Reference: what both sets of recordings say of each number stands in `docs/ahrs-constants.md`; the thresholds of rest and of the
//! field are those of Laidig & Seel 2023.

use crate::STANDARD_GRAVITY;
use core::borrow::Borrow;

/// One degree, rad.
const DEGREE: f32 = core::f32::consts::PI / 180.0;

/// When the body is said to rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RestConfig {
    /// Low-pass that readings are compared with, s; second order, cut-off sqrt(2)/(2 pi tau) = 0.45 Hz.
    pub filter_tau: f32,
    /// Time for which all readings must stay near it, s.
    pub time: f32,
    /// Largest distance of the rate, rad/s.
    pub rate: f32,
    /// Largest distance of the specific force, m/s^2.
    pub force: f32,
    /// Largest rate, after the bias found before, rad/s; holds once the bias is trusted.
    pub known_rate: f32,
}

/// How the gyro bias is estimated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BiasConfig {
    /// Largest bias of an axis, rad/s; also the largest rate that rest may show while the bias is unknown.
    pub limit: f32,
    /// Time of rest that weighs as much as the variance at the start, s.
    pub rest_weight: f32,
    /// Share of the tilt correction that goes to the bias in motion, 1/s.
    pub tilt_gain: f32,
    /// How much more of it goes there while nothing is known of the bias: at most as fast as `lag` lets the direction be known, so
    /// that `tilt_gain` times one more than this stays below its inverse.
    pub tilt_boost: f32,
    /// Growth of the bias about the vertical for a heading error of one radian, 1/s^2.
    pub heading_gain: f32,
    /// How much more while nothing is known of the bias.
    pub heading_boost: f32,
    /// Time constant of the averaged attitude that corrections are turned into body axes with, s; first order, cut-off
    /// 1/(2 pi tau) = 0.03 Hz.
    pub lag: f32,
    /// Time in which the variance decays in motion, s.
    pub motion_tau: f32,
    /// Growth of the variance, 1/s.
    pub forgetting: f32,
    /// Variance (1 at the start) below which the bias is trusted.
    pub trusted: f32,
}

/// When the field is believed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldConfig {
    /// Time over which fields are summed in earth axes before their average is used, s.
    pub window: f32,
    /// Smoothing of norm and dip, s; first order, cut-off 1/(2 pi tau) = 3.2 Hz.
    pub smoothing: f32,
    /// Largest deviation of the norm, as a share of the reference.
    pub norm: f32,
    /// Largest deviation of the dip angle, rad.
    pub dip: f32,
    /// Averaging of the reference, which follows a field that is believed, s; first order, cut-off 1/(2 pi tau) = 0.008 Hz.
    pub reference_tau: f32,
    /// Undisturbed time before the field is believed again, s.
    pub settle: f32,
    /// Time for which a new field must hold, in motion, to become the reference, s.
    pub new_time: f32,
    /// The same for the first reference, s.
    pub first_time: f32,
    /// Rate above which time counts towards a new field, rad/s.
    pub new_rate: f32,
    /// Longest time for which the heading stays frozen, s.
    pub longest_freeze: f32,
    /// Factor on the correction after that, and on how fast the time of freezing is given back.
    pub doubt: f32,
    /// A stronger field, hard iron taken off, is a magnet's whatever it agrees with, uT: nothing is learnt from it and no heading taken.
    /// (The Earth's is 67 at most, World Magnetic Model; half as much again for a room's iron and a rough calibration.)
    pub strongest: f32,
    /// A reading beyond this is no reading, uT.
    pub range: f32,
}

/// How the hard iron that travels with the sensor is estimated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IronConfig {
    /// Averages of attitude and field, s; first order, cut-off 1/(2 pi tau) = 0.053 Hz.
    pub lag: f32,
    /// Time in which evidence is forgotten, s; first order, cut-off 1/(2 pi tau) = 0.0013 Hz.
    pub memory: f32,
    /// An offset shorter than this is not applied, and a longer one shortened by it, uT: below it soft iron and a field that
    /// changes with place look the same.
    pub dead_zone: f32,
    /// Longest offset that is applied, uT.
    pub limit: f32,
}

/// Everything that does not change while the filter runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config {
    /// Averaging of the specific force in the earth frame without true acceleration, s; second order, cut-off
    /// sqrt(2)/(2 pi tau) = 0.10 Hz.
    pub tilt_tau: f32,
    /// How much longer, as a share, it averages for a true acceleration of one g: the more it swings, the longer it takes to cancel.
    pub tilt_stretch: f32,
    /// Rate at which half of that is left, rad/s: scale and alignment errors of a gyro grow with its rate, and leave less time.
    pub tilt_rate: f32,
    /// Averaging of the acceleration that the stretch is made of, s; first order, a few steps of a walker.
    pub tilt_memory: f32,
    /// Time over which the specific force is summed in earth axes before it is used, s (seven readings of 200 Hz, two of 48).
    pub tilt_window: f32,
    /// Averaging of the heading, s; first order, cut-off 1/(2 pi tau) = 0.013 Hz.
    pub heading_tau: f32,
    /// Rest.
    pub rest: RestConfig,
    /// Gyro bias.
    pub bias: BiasConfig,
    /// Magnetic field.
    pub field: FieldConfig,
    /// Hard iron.
    pub iron: IronConfig,
    /// End of the gyro's range, rad/s: a rate beyond it is cut to it and flagged.
    pub gyro_range: f32,
    /// End of the accelerometer's range, m/s^2: a reading at it is left out and flagged.
    pub accel_range: f32,
    /// Magnetic declination, rad, east positive: 0 makes yaw a magnetic heading.
    pub declination: f32,
    /// A step longer than this is a gap: the tilt starts anew, s.
    pub max_dt: f32,
}

impl Config {
    /// The one default, for every sensor and motion.
    pub const DEFAULT: Self = Self {
        tilt_tau: 2.2,
        tilt_stretch: 6.0,
        tilt_rate: 2.0,
        tilt_memory: 10.0,
        tilt_window: 0.0305,
        heading_tau: 12.0,
        rest: RestConfig { filter_tau: 0.5, time: 1.5, rate: 2.0 * DEGREE, force: 0.5, known_rate: 2.0 * DEGREE },
        bias: BiasConfig {
            limit: 10.0 * DEGREE,
            rest_weight: 0.035,
            tilt_gain: 0.06,
            tilt_boost: 1.5,
            heading_gain: 2e-4,
            heading_boost: 100.0,
            lag: 5.0,
            motion_tau: 60.0,
            forgetting: 1e-4,
            trusted: 0.2,
        },
        field: FieldConfig {
            window: 0.035,
            smoothing: 0.05,
            norm: 0.15,
            dip: 10.0 * DEGREE,
            reference_tau: 20.0,
            settle: 0.5,
            new_time: 20.0,
            first_time: 5.0,
            new_rate: 20.0 * DEGREE,
            longest_freeze: 60.0,
            doubt: 2.0,
            strongest: 100.0,
            range: 1000.0,
        },
        iron: IronConfig { lag: 3.0, memory: 120.0, dead_zone: 5.0, limit: 100.0 },
        gyro_range: 2000.0 * DEGREE,
        accel_range: 16.0 * STANDARD_GRAVITY,
        declination: 0.0,
        max_dt: 0.25,
    };
}

/// [`Config::DEFAULT`] as a type: the compiler knows every number, and a filter with it keeps none of them in RAM.
///
/// A board that needs another configuration at this price writes a type like it:
/// ```
/// # use dcm::{Config, Dcm};
/// #[derive(Clone)]
/// struct AtHome;
/// impl core::borrow::Borrow<Config> for AtHome {
///     fn borrow(&self) -> &Config {
///         &const { Config { declination: 0.07, ..Config::DEFAULT } }
///     }
/// }
/// assert!(size_of_val(&Dcm::new(AtHome)) < size_of::<Dcm>());
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Standard;

impl Borrow<Config> for Standard {
    fn borrow(&self) -> &Config {
        &Config::DEFAULT
    }
}

impl Default for Config {
    fn default() -> Self {
        Self::DEFAULT
    }
}
