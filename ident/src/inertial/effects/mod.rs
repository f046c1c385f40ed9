//! What may be wrong with an inertial unit or with its surroundings: one file a cause.
//!
//! What it is: for each sensor the causes that its residual is asked for. A new one is one file and one line here.
//! What can go wrong: a cause whose column the log lacks offers no shape and is not asked.
//! Units: in each file.
//! Reference: specification `closing-the-loop.md`, "Inertial".

mod channel_delay;
mod current_induced_field;
mod g_sensitivity;
mod gyro_bias;
mod gyro_temperature;
mod hard_iron;
mod lever_arm;
mod soft_iron;
mod stationary_magnet;

use super::search::{Cause, Scene};

/// Causes of the field.
pub(crate) fn field() -> Vec<Box<dyn Cause>> {
    vec![
        Box::new(hard_iron::HardIron),
        Box::new(soft_iron::SoftIron),
        Box::new(channel_delay::ChannelDelay),
        Box::new(current_induced_field::CurrentInducedField),
        Box::new(stationary_magnet::StationaryMagnet),
    ]
}

/// Causes of the specific force that a few constants describe.
pub(crate) fn force() -> Vec<Box<dyn Cause>> {
    vec![Box::new(lever_arm::LeverArm)]
}

/// Causes of the rate at rest.
pub(crate) fn rate() -> Vec<Box<dyn Cause>> {
    vec![Box::new(gyro_bias::GyroBias), Box::new(gyro_temperature::GyroTemperature), Box::new(g_sensitivity::GSensitivity)]
}

/// Names of the axes.
const AXES: [&str; 3] = ["x", "y", "z"];

/// Instants at which something may have set in: about sixty, away from the ends.
fn instants(scene: &Scene<'_>) -> impl Iterator<Item = f64> {
    let (from, to) = scene.heard;
    let step = (to - from) / 60.0;
    (2..59).map(move |k| from + f64::from(k) * step)
}
