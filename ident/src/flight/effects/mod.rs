//! What a flight's model may lack: one file an effect, one line each in [`library`].
//!
//! What it is: for each effect the forms in which a flight could hold it, what it changes of what acts, and the columns it adds.
//! What can go wrong: an effect whose columns the log lacks offers no form and is not asked.
//! Units: stated on each parameter.
//! Reference: specification `flight.md`, "The loop on flights".

mod accelerometer_bias;
mod battery_discharge;
mod body_drag;
mod channel_delay;
mod current_induced_field;
mod dead_rotor_speed;
mod g_sensitivity;
mod ground_effect;
mod gyro_bias;
mod gyro_temperature;
mod hard_iron;
mod hub_moment;
mod lever_arm;
mod mass_offset;
mod rotor_drag;
mod rotor_gain;
mod soft_iron;
mod spinup_lag;
mod supply_sag;
mod translational_lift;
mod vibration_rectification;
mod wind;

use crate::attribution::columns::Shape;
use crate::effects::{About, Clause, EffectEntry};
use crate::flight::columns::{Flight, Sink};
use crate::flight::scene::Scene;
use crate::verdict::Parameter;
use crate::verdict::Scope;

/// One way in which a flight may hold an effect.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Form {
    /// What tells it from the others, in words; empty where there is one.
    pub name: String,
    /// A rotor or sensor.
    pub index: usize,
    /// First row, and the row after the last, where it has them.
    pub rows: (usize, usize),
    /// Its shapes.
    pub shapes: Vec<Shape>,
    /// Shapes from which the search for it starts; empty where it has none.
    pub starts: Vec<Vec<f64>>,
}

/// A value and its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Told {
    /// Best value.
    pub value: f64,
    /// Standard error.
    pub se: f64,
}

/// What was found of one effect.
pub struct Found<'f> {
    /// The flight.
    pub flight: &'f Flight,
    /// Its form.
    pub form: &'f Form,
    /// Its shapes and then its amplitudes, by name.
    pub own: Vec<(&'static str, Told)>,
    /// Amplitudes of the declared model and of the other terms, by name.
    pub others: Vec<(&'static str, f64)>,
}

impl Found<'_> {
    /// A parameter of its own.
    #[must_use]
    pub fn of(&self, name: &str) -> Told {
        self.own.iter().find(|(n, _)| *n == name).map_or(Told { value: 0.0, se: 0.0 }, |o| o.1)
    }

    /// A parameter of the others.
    #[must_use]
    pub fn other(&self, name: &str) -> Option<f64> {
        self.others.iter().find(|(n, _)| *n == name).map(|o| o.1)
    }

    /// One of its own as a parameter of the verdict, times a factor.
    #[must_use]
    pub fn scaled(&self, name: &str, as_name: &str, unit: &str, factor: f64) -> Parameter {
        let Told { value, se } = self.of(name);
        let (value, half) = (factor * value, (1.96 * factor * se).abs());
        Parameter { name: as_name.to_owned(), value, unit: unit.to_owned(), ci95: [value - half, value + half] }
    }

    /// One of its own as it is.
    #[must_use]
    pub fn plain(&self, name: &str, unit: &str) -> Parameter {
        self.scaled(name, name, unit, 1.0)
    }

    /// The mass, and the unit of a force with it: 1 and N/kg where it is not known.
    #[must_use]
    pub fn mass(&self) -> (f64, &'static str) {
        self.flight.record.vehicle.mass_kg.map_or((1.0, "N/kg"), |m| (m, "N"))
    }
}

/// One effect on a flight.
pub trait AirframeEffect: Sync {
    /// Identifier, a contract of the verdict file.
    fn id(&self) -> &'static str;
    /// What it is.
    fn about(&self) -> About;
    /// What it does here, in the words of a lab, with its size.
    fn said(&self, found: &EffectEntry) -> Clause;
    /// What it belongs to.
    fn scope(&self, form: &Form) -> Scope;
    /// The ways in which this flight could hold it.
    fn forms(&self, flight: &Flight) -> Vec<Form>;
    /// Effects of which one must be there, because it acts through them.
    fn needs(&self) -> &'static [&'static str] {
        &[]
    }
    /// Other forms, of its own or of another effect, that say the same of the same part.
    fn excludes(&self, _form: &Form) -> Vec<(&'static str, String)> {
        Vec::new()
    }
    /// Whether every vehicle has it, and what counts is how much.
    fn is_of_every_vehicle(&self) -> bool {
        false
    }
    /// Whether it changes what acts, and with it the columns of others.
    fn alters(&self) -> bool {
        false
    }
    /// Changes what acts.
    fn alter(&self, _flight: &Flight, _form: &Form, _shape: &[f64], _scene: &mut Scene<'_>) {}
    /// Adds its columns.
    fn columns(&self, _form: &Form, _shape: &[f64], _sink: &mut Sink<'_>) {}
    /// Its parameters as they are told, from what was found.
    fn report(&self, found: &Found<'_>) -> Vec<Parameter>;
}

/// What an effect of a flight is.
#[must_use]
pub fn about(id: &str) -> Option<About> {
    library().iter().find(|e| e.id() == id).map(|e| e.about())
}

/// What a found effect of a flight does, in words; `None` where the library lacks it.
pub(crate) fn said(found: &EffectEntry) -> Option<Clause> {
    library().iter().find(|e| e.id() == found.id).map(|e| e.said(found))
}

/// Every effect.
#[must_use]
pub fn library() -> &'static [&'static dyn AirframeEffect] {
    &[
        &rotor_drag::RotorDrag,
        &body_drag::BodyDrag,
        &hub_moment::HubMoment,
        &translational_lift::TranslationalLift,
        &ground_effect::GroundEffect,
        &wind::Wind,
        &supply_sag::SupplySag,
        &battery_discharge::BatteryDischarge,
        &spinup_lag::SpinupLag,
        &dead_rotor_speed::DeadRotorSpeed,
        &rotor_gain::RotorGain,
        &mass_offset::MassOffset,
        &lever_arm::LeverArm,
        &vibration_rectification::VibrationRectification,
        &accelerometer_bias::AccelerometerBias,
        &gyro_bias::GyroBias,
        &gyro_temperature::GyroTemperature,
        &g_sensitivity::GSensitivity,
        &channel_delay::ChannelDelay,
        &current_induced_field::CurrentInducedField,
        &hard_iron::HardIron,
        &soft_iron::SoftIron,
    ]
}

/// Effects on the voltage, of which the first in a hypothesis brings the column by which the speeds follow it.
pub(crate) const FOLLOWED: [&str; 2] = ["supply_sag", "battery_discharge"];

/// Names of a vector's three amplitudes.
macro_rules! by_axis {
    ($name:literal) => {
        [concat!($name, "_x"), concat!($name, "_y"), concat!($name, "_z")]
    };
}
pub(crate) use by_axis;

/// The only form of an effect that has one.
pub(crate) fn single(there: bool) -> Vec<Form> {
    if there { vec![Form::default()] } else { Vec::new() }
}
