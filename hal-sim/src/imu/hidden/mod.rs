//! Hidden effects of the inertial unit: what sensors, board and room do and nobody declared.
//!
//! What it is: one physical mechanism a file, described by its parameters; each adds to field, rate, force or temperature at an
//! instant, throughout or in a window of the run. The chips measure the sum.
//! What can go wrong: nothing fails; an effect outside of its window leaves everything as it was.
//! Units: s since power-up; gauss, rad/s, m/s^2, K in the levers; each parameter carries its own in its name.
//! Reference: specification `closing-the-loop.md`, "Inertial".
//!
//! A new effect is one file and one line in the list below.

use super::body::Body;
use crate::noise::{Source, Stream};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Where and when.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instant {
    /// Since power-up, s.
    pub run_s: f64,
    /// Place of the body in the room, earth NED, m.
    pub place_m: [f64; 3],
}

/// What effects add at an instant; the default is nothing.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ImuLevers {
    /// Field in the room, earth NED, gauss.
    pub room_field: [f64; 3],
    /// Field at the magnetometer, body axes, gauss.
    pub body_field: [f64; 3],
    /// What iron beside the magnetometer adds of the field, body axes.
    pub iron: [[f64; 3]; 3],
    /// Reading of the gyro, body axes, rad/s.
    pub rate: [f64; 3],
    /// Its change with the chip's temperature from 25 degC, body axes, rad/s/K.
    pub rate_per_k: [f64; 3],
    /// Acceleration of the body, earth NED, m/s^2.
    pub carried: [f64; 3],
    /// Acceleration of the board against the body, body axes, m/s^2.
    pub shaken: [f64; 3],
    /// Temperature of the board, K.
    pub warm_k: f64,
    /// How late the magnetometer's readings are, s.
    pub late_s: f64,
}

/// One mechanism with its parameters.
pub trait ImuEffect: Sized {
    /// Name of the effect in every file.
    const ID: &'static str;
    /// What it does, as a formula.
    const EQUATION: &'static str;
    /// Parameters drawn at random for a run of `run_s`.
    fn draw(stream: &mut Stream, run_s: f64) -> Self;
    /// Adds to the levers at an instant.
    fn act(&self, at: &Instant, levers: &mut ImuLevers);
    /// What comes of it under the names and in the units of a verdict, where it is a number.
    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)>;
}

macro_rules! effects {
    ($($module:ident :: $name:ident),* $(,)?) => {
        $(pub mod $module;)*

        /// Any of them, as a scenario file holds it.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "id", rename_all = "snake_case")]
        pub enum ImuEffectKind {
            $(
                #[doc = concat!("See [`", stringify!($module), "`].")]
                $name($module::$name),
            )*
        }

        impl ImuEffectKind {
            /// All ids.
            pub const IDS: &'static [&'static str] = &[$($module::$name::ID,)*];

            /// The effect of this id with parameters drawn from `seed` for a run of `run_s`; `None` where there is none.
            #[must_use]
            pub fn draw(id: &str, seed: u64, run_s: f64) -> Option<Self> {
                let mut stream = Stream::new(seed, Source::Imu, 62);
                $(if id == $module::$name::ID { return Some(Self::$name($module::$name::draw(&mut stream, run_s))); })*
                None
            }
            /// Name of the effect.
            #[must_use]
            pub fn id(&self) -> &'static str {
                match self { $(Self::$name(_) => $module::$name::ID,)* }
            }
            /// What it does, as a formula.
            #[must_use]
            pub fn equation(&self) -> &'static str {
                match self { $(Self::$name(_) => $module::$name::EQUATION,)* }
            }
            /// Adds to the levers at an instant.
            pub fn act(&self, at: &Instant, levers: &mut ImuLevers) {
                match self { $(Self::$name(e) => e.act(at, levers),)* }
            }
            /// Name, value and unit of what a verdict may say of it.
            #[must_use]
            pub fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
                match self { $(Self::$name(e) => e.parameters(),)* }
            }
        }
    };
}

effects! {
    hard_iron::HardIron,
    soft_iron::SoftIron,
    stationary_magnet::StationaryMagnet,
    channel_delay::ChannelDelay,
    linear_acceleration::LinearAcceleration,
    vibration::Vibration,
    gyro_bias::GyroBias,
    gyro_temperature::GyroTemperature,
    transmitter::Transmitter,
}

/// Those that the library of the identification does not know.
pub const UNKNOWN: [&str; 1] = ["transmitter"];

/// An effect and its window.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ImuScheduled {
    /// Begin, s since power-up; from power-up when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from_s: Option<f64>,
    /// End, s; never when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub until_s: Option<f64>,
    /// The effect.
    #[serde(flatten)]
    pub effect: ImuEffectKind,
}

/// All effects of a run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Hidden(Arc<[ImuScheduled]>);

impl Hidden {
    /// These.
    #[must_use]
    pub fn new(effects: &[ImuScheduled]) -> Self {
        Self(effects.into())
    }

    /// Their sum at an instant.
    #[must_use]
    pub fn levers(&self, at_ns: u64, body: &Body) -> ImuLevers {
        let mut levers = ImuLevers::default();
        if !self.0.is_empty() {
            let at = Instant { run_s: at_ns as f64 * 1e-9, place_m: body.place(at_ns) };
            for s in self.0.iter() {
                if s.from_s.is_none_or(|from| at.run_s >= from) && s.until_s.is_none_or(|until| at.run_s < until) {
                    s.effect.act(&at, &mut levers);
                }
            }
        }
        levers
    }
}

/// A direction, each as likely as the others.
fn direction(stream: &mut Stream) -> [f64; 3] {
    let z = stream.between(-1.0, 1.0);
    let (s, c) = libm::sincos(stream.between(0.0, core::f64::consts::TAU));
    let flat = libm::sqrt(1.0 - z * z);
    [flat * c, flat * s, z]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Field in gauss of a dipole of `moment` A.m^2 at `away` metres from it: mu0 / 4 pi (3 (m.u) u - m) / r^3 (Jackson, *Classical
/// Electrodynamics*, eq. 5.56).
fn dipole(moment: [f64; 3], away: [f64; 3]) -> [f64; 3] {
    /// mu0 / 4 pi, gauss m^3 / (A.m^2).
    const MU0: f64 = 1e-3;
    let r = libm::sqrt(dot(away, away)).max(1e-3);
    let u = away.map(|x| x / r);
    let along = dot(moment, u);
    core::array::from_fn(|i| MU0 * (3.0 * along * u[i] - moment[i]) / (r * r * r))
}

#[cfg(test)]
mod tests {
    use super::super::motion::Motion;
    use super::*;

    #[test]
    fn ids_draws_and_windows() {
        for id in ImuEffectKind::IDS {
            let a = ImuEffectKind::draw(id, 5, 90.0).unwrap();
            assert_eq!((a.id(), Some(&a)), (*id, ImuEffectKind::draw(id, 5, 90.0).as_ref()));
            assert_ne!(Some(&a), ImuEffectKind::draw(id, 6, 90.0).as_ref(), "{id}");
            let text = toml::to_string(&a).unwrap();
            assert_eq!(toml::from_str::<ImuEffectKind>(&text).unwrap(), a, "{text}");
            let hidden = Hidden::new(&[ImuScheduled { from_s: Some(10.0), until_s: Some(80.0), effect: a }]);
            let body = Body::from(Motion { walk_m: [0.9, 0.6, 0.2], walk_hz: 0.05, ..Motion::LEVEL });
            let acts = |s: f64| hidden.levers((s * 1e9) as u64, &body) != ImuLevers::default();
            assert!(!acts(9.9) && !acts(80.1) && (0..700).any(|k| acts(10.0 + f64::from(k) * 0.1)), "{id}");
        }
        assert!(ImuEffectKind::draw("poltergeist", 1, 90.0).is_none());
    }

    /// A moment of 1 A.m^2 has 2 gauss at 10 cm on its axis, half of it and the other way round beside it.
    #[test]
    fn a_dipole_s_field() {
        let near = |got: [f64; 3], want: [f64; 3]| got.iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(near(dipole([0.0, 0.0, 1.0], [0.0, 0.0, 0.1]), [0.0, 0.0, 2.0]));
        assert!(near(dipole([0.0, 0.0, 1.0], [0.1, 0.0, 0.0]), [0.0, 0.0, -1.0]));
    }
}
