//! Hidden effects: what a rig does and its declared model does not say.
//!
//! What it is: one physical mechanism a file, described by its parameters; an effect either fits another part to the bench
//! or moves a parameter of a part as a function of the run's own time. The parts integrate it. Each acts throughout or in a
//! window of the run ([`Scheduled`]).
//! What can go wrong: effects on the powerplant do nothing when an identified model stands in for it.
//! Units: each parameter carries its own in its name.
//! Reference: specification `closing-the-loop.md`, "Effects that the library starts with" (ids and parameters).
//!
//! A new effect is one file and one line in the list below.

use crate::noise::{Source, Stream};
use crate::parts::BenchParts;
use crate::plant::PlantLevers;
use frame::rig::ADC_CHANNELS;
use serde::{Deserialize, Serialize};

mod scheduled;
pub use scheduled::Scheduled;
pub(crate) use scheduled::{fitted, open};

/// Parameters that effects move during a run. The default is a healthy rig.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Levers {
    /// The powerplant's.
    pub plant: PlantLevers,
    /// Shift of the load cell's zero, N.
    pub strain_zero_n: f64,
    /// Factor on the load cell's reading.
    pub strain_gain: f64,
    /// Lift read per torque on the arm, N/(N.m).
    pub torque_to_lift: f64,
    /// Unbalance on top of the propeller's own, kg.m.
    pub unbalance_kgm: f64,
    /// The encoder is off the shaft.
    pub encoder_off: bool,
    /// How far the load cell's logger is behind, s.
    pub late_s: f64,
    /// What is coupled into the wires at the ADC pins, V.
    pub spike_v: [f64; ADC_CHANNELS],
    /// Seed of the run, for effects that happen at random instants.
    pub seed: u64,
}

impl Default for Levers {
    fn default() -> Self {
        Self {
            plant: PlantLevers::default(),
            strain_zero_n: 0.0,
            strain_gain: 1.0,
            torque_to_lift: 0.0,
            unbalance_kgm: 0.0,
            encoder_off: false,
            late_s: 0.0,
            spike_v: [0.0; ADC_CHANNELS],
            seed: 0,
        }
    }
}

/// One mechanism with its parameters.
pub trait Effect: Sized {
    /// Name of the effect in every file.
    const ID: &'static str;
    /// What it does, as a formula.
    const EQUATION: &'static str;
    /// Parameters drawn at random for a run of `run_s`, clearly above the noise floor of the demonstration rig.
    fn draw(stream: &mut Stream, run_s: f64) -> Self;
    /// Fits other parts before the run.
    fn fit(&self, parts: &mut BenchParts) {
        let _ = parts;
    }
    /// Moves parameters, `run_s` into the run.
    fn act(&self, run_s: f64, levers: &mut Levers) {
        let _ = (run_s, levers);
    }
    /// Parameters under the names and in the units of the specification's table.
    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)>;
}

/// An effect that the catalogue offers.
#[derive(Debug, Clone, Copy)]
pub struct CatalogueEntry {
    /// Name of the effect.
    pub id: &'static str,
    /// What it does, as a formula.
    pub equation: &'static str,
    draw: fn(&mut Stream, f64) -> EffectKind,
}

impl CatalogueEntry {
    /// The effect with parameters drawn from `seed` for a run of `run_s`.
    #[must_use]
    pub fn draw(&self, seed: u64, run_s: f64) -> EffectKind {
        (self.draw)(&mut Stream::new(seed, Source::Effect, 0), run_s)
    }
}

/// The entry of the catalogue with this id.
#[must_use]
pub fn find(id: &str) -> Option<&'static CatalogueEntry> {
    catalogue().iter().find(|e| e.id == id)
}

macro_rules! effects {
    ($($module:ident :: $name:ident),* $(,)?) => {
        $(pub mod $module;)*

        /// Any effect of the catalogue, as a scenario file holds it.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "id", rename_all = "snake_case")]
        pub enum EffectKind {
            $(
                #[doc = concat!("See [`", stringify!($module), "`].")]
                $name($module::$name),
            )*
        }

        impl EffectKind {
            /// Name of the effect.
            #[must_use]
            pub fn id(&self) -> &'static str {
                match self { $(Self::$name(_) => $module::$name::ID,)* }
            }
            /// Fits other parts before the run.
            pub fn fit(&self, parts: &mut BenchParts) {
                match self { $(Self::$name(e) => e.fit(parts),)* }
            }
            /// Moves parameters, `run_s` into the run.
            pub fn act(&self, run_s: f64, levers: &mut Levers) {
                match self { $(Self::$name(e) => e.act(run_s, levers),)* }
            }
            /// Whether the operator takes a sensor off during the run, so that its silence is no fault.
            #[must_use]
            pub fn takes_a_sensor_off(&self) -> bool {
                matches!(self, Self::EncoderDrag(_))
            }
            /// Name, value and unit of each parameter.
            #[must_use]
            pub fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
                match self { $(Self::$name(e) => e.parameters(),)* }
            }
        }

        /// All effects that the simulator knows.
        #[must_use]
        pub fn catalogue() -> &'static [CatalogueEntry] {
            const ALL: &[CatalogueEntry] = &[$(
                CatalogueEntry {
                    id: $module::$name::ID,
                    equation: $module::$name::EQUATION,
                    draw: |stream, run_s| EffectKind::$name($module::$name::draw(stream, run_s)),
                },
            )*];
            ALL
        }
    };
}

effects! {
    supply_sag::SupplySag,
    battery_discharge::BatteryDischarge,
    battery_relaxation::BatteryRelaxation,
    current_limit::CurrentLimit,
    thermal_derate::ThermalDerate,
    throttle_quantisation::ThrottleQuantisation,
    spinup_lag::SpinupLag,
    bearing_friction::BearingFriction,
    reynolds_thrust::ReynoldsThrust,
    air_density::AirDensity,
    blade_flex::BladeFlex,
    blade_damage::BladeDamage,
    zero_drift::ZeroDrift,
    thermal_zero::ThermalZero,
    creep::Creep,
    hysteresis::Hysteresis,
    gain_change::GainChange,
    beam_resonance::BeamResonance,
    torque_crosstalk::TorqueCrosstalk,
    amplifier_saturation::AmplifierSaturation,
    tare_shift::TareShift,
    missed_pulses::MissedPulses,
    channel_delay::ChannelDelay,
    channel_filter::ChannelFilter,
    sample_hold::SampleHold,
    quantisation::Quantisation,
    stall::Stall,
    double_pulses::DoublePulses,
    alternating_period::AlternatingPeriod,
    blade_twist::BladeTwist,
    encoder_drag::EncoderDrag,
    coupling_slip::CouplingSlip,
    clock_drift::ClockDrift,
    glitch_rows::GlitchRows,
    dead_rotor_speed::DeadRotorSpeed,
    recirculation::Recirculation,
    magnet_heat::MagnetHeat,
    blade_icing::BladeIcing,
    loosening_mount::LooseningMount,
    esc_timing::EscTiming,
    stator_saturation::StatorSaturation,
    desync::Desync,
    arm_friction::ArmFriction,
    noisy_edges::NoisyEdges,
}

/// Effects of ours that the library of the identification does not know.
pub const UNKNOWN: [&str; 9] = [
    "recirculation",
    "magnet_heat",
    "blade_icing",
    "loosening_mount",
    "esc_timing",
    "stator_saturation",
    "desync",
    "arm_friction",
    "noisy_edges",
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_are_what_the_files_call_them_and_draws_repeat() {
        for entry in catalogue() {
            let a = entry.draw(5, 330.0);
            assert_eq!(a, entry.draw(5, 330.0));
            assert_ne!(a, entry.draw(6, 330.0), "{}", entry.id);
            let text = toml::to_string(&a).unwrap();
            assert!(text.contains(&format!("id = \"{}\"", entry.id)), "{text}");
            assert_eq!(toml::from_str::<EffectKind>(&text).unwrap(), a);
            assert!(!a.parameters().is_empty());
            assert!(find(entry.id).is_some());
        }
        assert!(find("poltergeist").is_none());
    }
}
