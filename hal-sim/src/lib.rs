//! The simulated rig: the only clock, plants, sensors, hidden effects, and the native run of the firmware.
//!
//! What it is: a bench of physical parts ([`bench::Bench`]) that the portable firmware drives at 1 kHz (`native::run`); a
//! TOML `scenario::Scenario` describes it; an identified model can stand in for the powerplant ([`plant::Powerplant`]). Without the feature
//! `files` there are the plants, sensors, effects, bench, body and chips alone: no TOML, no schedule files, no firmware that drives them.
//!
//! What can go wrong: a scenario that cannot be taken is refused with file, line and column; a run whose firmware refuses a
//! command or latches a fault ends with an error that says which.
//!
//! Units: SI inside, rev/min, us and g.mm at the edges; ns and ticks of 84 MHz for time.
//!
//! Reference: specification `rig.md`, "The simulator". The same seed gives the same bytes, in debug and release: a fixed step,
//! one named random stream a noise source, `libm` for every transcendental function.
#![forbid(unsafe_code)]

pub mod bench;
#[cfg(feature = "files")]
pub mod catalogue;
pub mod clock;
pub mod effect;
#[cfg(feature = "emulated")]
pub mod emulated;
#[cfg(feature = "files")]
pub mod fault;
pub mod flight;
#[cfg(feature = "files")]
pub mod hal;
pub mod imu;
#[cfg(feature = "files")]
pub mod mission;
#[cfg(feature = "files")]
pub mod native;
pub mod noise;
mod number;
pub mod parts;
pub mod plant;
#[cfg(feature = "files")]
pub mod scenario;
pub mod sensor;

pub use bench::{Bench, Listens, Millisecond, Truth};
#[cfg(feature = "files")]
pub use native::{RunRecord, SimError, run};
pub use plant::{PlantState, Powerplant};
#[cfg(feature = "files")]
pub use scenario::{Scenario, ScenarioError};
pub use sensor::{Edge, EdgeDetail};
