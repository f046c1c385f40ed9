//! A mission flown.
//!
//! What it is: the vehicle under the mission's pulses, millisecond by millisecond.
//! What can go wrong: powerplants that are not as many as the rotors ([`fly`] gives nothing).
//! Units: us, s.
//! Reference: specification `flight.md`, "The body".

use super::{AirframeFile, Mission};
use crate::flight::{Flying, Vehicle};
use crate::plant::{Powerplant, RigPlant};

/// Time for which the rotors of a flight that begins in the air run before it, s: some fifty of their time constants.
const SPIN_UP_S: f64 = 3.0;

/// Powerplants of the catalogue, one a rotor.
#[must_use]
pub fn catalogue_plants(airframe: &AirframeFile) -> Vec<Box<dyn Powerplant>> {
    let parts = airframe.parts();
    airframe.rotors().iter().map(|_| Box::new(RigPlant::new(parts.clone(), 1)) as Box<dyn Powerplant>).collect()
}

/// Flies `mission`; the rows of its log. `reference_density` is that of the powerplants, kg/m^3; `progress` hears the share done.
pub fn fly(
    mission: &Mission,
    airframe: &AirframeFile,
    plants: Vec<Box<dyn Powerplant>>,
    reference_density: f64,
    progress: &mut dyn FnMut(f64),
) -> Option<Vec<Flying>> {
    let rotors = plants.len();
    let mut vehicle = Vehicle::new(airframe.airframe(), plants, reference_density, mission.surroundings(), mission.motion())?;
    let pulses = |t_s: f64, into: &mut Vec<f64>| {
        into.clear();
        into.extend((0..rotors).map(|rotor| mission.pulse_us(rotor, t_s)));
    };
    let mut now = Vec::with_capacity(rotors);
    pulses(0.0, &mut now);
    if mission.start.spun_up {
        vehicle.spin_up(&now, SPIN_UP_S);
    }
    let total = (mission.length_s() * 1000.0).round() as u64;
    let every = u64::from(1000 / mission.log_hz);
    let mut rows = vec![vehicle.now()];
    for ms in 0..total {
        pulses(ms as f64 * 1.0e-3, &mut now);
        vehicle.millisecond(&now);
        let landed = mission.ends_on_ground && vehicle.on_ground();
        if (ms + 1) % every == 0 || landed {
            rows.push(vehicle.now());
        }
        if landed {
            break;
        }
        if ms % 1000 == 0 {
            progress(ms as f64 / total as f64);
        }
    }
    Some(rows)
}
