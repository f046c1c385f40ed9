//! What the board sees of the rig: edges of four speed sensors, voltages of five analogue channels.
//!
//! What it is: sensor geometry and analogue front ends, one file each.
//! What can go wrong: see each sensor.
//! Units: revolutions and ticks of 84 MHz for edges; volt at the ADC pin and 12-bit counts for the analogue side.
//! Reference: specification `rig.md`, "Four RPM capture channels" and "Load cell".

pub mod adc;
pub mod back_emf;
mod channel;
mod conversions;
pub mod edge;
pub mod esc_telemetry;
pub mod logger;
pub mod tachometers;

pub use adc::{AnalogFront, Converter};
pub use back_emf::{BackEmfMeter, Comparator};
pub use edge::{Edge, EdgeDetail, Geometry};
pub use esc_telemetry::{EscErrors, EscTelemetry, EscWire};
pub use logger::Logger;
pub use tachometers::Tachometers;
