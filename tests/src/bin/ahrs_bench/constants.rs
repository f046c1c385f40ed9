//! The numbers of the filter's default and what else each of them could be.
//!
//! What it is: every field of [`dcm::Config`], where its value comes from, and the round values that `--scan` tries beside it.
//! What can go wrong: nothing; a field without a line here is one that no data were asked about.
//! Units: said in each line; `scale` turns them into the filter's own.
//! Reference: Laidig & Seel 2023 (VQF) and its published defaults; `docs/ahrs.md`.

use dcm::Config;

/// A number of the configuration.
pub(super) struct Constant {
    /// As in the source.
    pub(super) name: &'static str,
    /// Unit of the tried values.
    pub(super) unit: &'static str,
    /// One such unit in the filter's own.
    pub(super) scale: f32,
    /// Where the default comes from.
    pub(super) origin: &'static str,
    /// Its place.
    pub(super) of: fn(&mut Config) -> &mut f32,
    /// Values to try, in `unit`.
    pub(super) tried: &'static [f32],
}

impl Constant {
    /// The default's value, in `unit`.
    pub(super) fn shipped(&self) -> f32 {
        *(self.of)(&mut Config::DEFAULT.clone()) / self.scale
    }

    /// The default with another value, given in `unit`.
    pub(super) fn set(&self, value: f32) -> Config {
        let mut config = Config::DEFAULT;
        *(self.of)(&mut config) = value * self.scale;
        config
    }
}

/// One degree, rad.
const DEGREE: f32 = core::f32::consts::PI / 180.0;

macro_rules! constants {
    ($($($path:ident).+, $unit:literal, $scale:expr, $origin:literal, $tried:expr;)*) => {
        /// All of them.
        pub(super) const ALL: &[Constant] = &[$(Constant {
            name: stringify!($($path).+),
            unit: $unit,
            scale: $scale,
            origin: $origin,
            of: |config| &mut config.$($path).+,
            tried: &$tried,
        }),*];
    };
}

constants! {
    tilt_tau, "s", 1.0, "recordings", [1.5, 1.8, 2.2, 2.5, 3.0, 4.0];
    tilt_stretch, "", 1.0, "recordings", [0.0, 4.0, 5.0, 6.0, 8.0];
    tilt_rate, "rad/s", 1.0, "recordings", [1.0, 1.5, 2.0, 3.0, 1000.0];
    tilt_memory, "s", 1.0, "recordings", [2.0, 5.0, 10.0, 20.0];
    tilt_window, "ms", 1e-3, "cost", [1.0, 10.5, 20.5, 30.5, 40.5];
    heading_tau, "s", 1.0, "recordings", [6.0, 9.0, 12.0, 16.0, 20.0, 30.0];
    rest.filter_tau, "s", 1.0, "VQF", [0.25, 0.5, 1.0];
    rest.time, "s", 1.0, "VQF", [0.75, 1.0, 1.5, 2.0, 3.0];
    rest.rate, "deg/s", DEGREE, "VQF", [1.0, 1.5, 2.0, 3.0, 4.0];
    rest.force, "m/s2", 1.0, "VQF", [0.2, 0.3, 0.5, 0.7, 1.0];
    rest.known_rate, "deg/s", DEGREE, "VQF", [1.0, 2.0, 3.0, 5.0];
    bias.limit, "deg/s", DEGREE, "chip", [8.0, 10.0, 15.0, 20.0];
    bias.rest_weight, "s", 1.0, "recordings", [0.01, 0.02, 0.035, 0.05, 0.1];
    bias.tilt_gain, "1/s", 1.0, "recordings", [0.0, 0.03, 0.045, 0.06, 0.08];
    bias.tilt_boost, "", 1.0, "recordings", [0.0, 1.0, 1.5, 2.0];
    bias.heading_gain, "1e-4/s2", 1e-4, "recordings", [0.0, 1.0, 2.0, 3.0, 5.0];
    bias.heading_boost, "", 1.0, "recordings", [0.0, 30.0, 50.0, 100.0, 200.0];
    bias.lag, "s", 1.0, "recordings", [3.0, 4.0, 5.0, 6.0];
    bias.motion_tau, "s", 1.0, "recordings", [20.0, 30.0, 60.0, 100.0, 200.0];
    bias.forgetting, "1e-4/s", 1e-4, "recordings", [0.1, 0.3, 1.0, 3.0, 10.0];
    bias.trusted, "", 1.0, "recordings", [0.05, 0.1, 0.2, 0.5];
    field.window, "ms", 1e-3, "cost", [1.0, 13.0, 20.0, 35.0, 50.0, 70.0];
    field.smoothing, "s", 1.0, "VQF", [0.02, 0.05, 0.1, 0.2];
    field.norm, "", 1.0, "recordings", [0.07, 0.1, 0.15, 0.2];
    field.dip, "deg", DEGREE, "VQF", [5.0, 7.0, 10.0, 15.0, 20.0];
    field.reference_tau, "s", 1.0, "VQF", [10.0, 20.0, 40.0];
    field.settle, "s", 1.0, "VQF", [0.2, 0.5, 1.0, 2.0];
    field.new_time, "s", 1.0, "VQF", [10.0, 20.0, 40.0];
    field.first_time, "s", 1.0, "VQF", [2.0, 5.0, 10.0];
    field.new_rate, "deg/s", DEGREE, "VQF", [10.0, 20.0, 40.0];
    field.longest_freeze, "s", 1.0, "VQF", [30.0, 60.0, 120.0];
    field.doubt, "", 1.0, "VQF", [1.0, 2.0, 4.0];
    field.strongest, "uT", 1.0, "physics", [70.0, 80.0, 100.0, 150.0, 1000.0];
    field.range, "uT", 1.0, "chip", [500.0, 1000.0, 2000.0];
    iron.lag, "s", 1.0, "recordings", [1.0, 2.0, 3.0, 5.0, 10.0];
    iron.memory, "s", 1.0, "recordings", [60.0, 120.0, 200.0];
    iron.dead_zone, "uT", 1.0, "recordings", [0.0, 2.0, 3.0, 5.0, 7.0, 10.0, 1000.0];
    iron.limit, "uT", 1.0, "chip", [50.0, 100.0, 200.0];
    gyro_range, "deg/s", DEGREE, "chip", [1500.0, 2000.0, 4000.0];
    accel_range, "m/s2", 1.0, "chip", [78.5, 156.9064, 313.8];
    max_dt, "s", 1.0, "gap", [0.1, 0.25, 1.0];
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each line says its own field, and the default is among the values tried.
    #[test]
    fn every_line_has_the_default_among_its_values() {
        for c in ALL {
            let near = |v: &&f32| (**v - c.shipped()).abs() <= 1e-5 * c.shipped();
            assert!(c.tried.iter().any(|v| near(&v)), "{}: {} is not tried", c.name, c.shipped());
            for v in c.tried {
                let mut config = c.set(*v);
                assert_eq!(*(c.of)(&mut config), v * c.scale);
            }
        }
        // every number of the configuration but the declination, which is an input
        assert_eq!(ALL.len() + 1, size_of::<Config>() / size_of::<f32>());
    }
}
