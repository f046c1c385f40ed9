//! A mission flown, and where it would hover.
//!
//! What it is: the vehicle under the mission's pulses, millisecond by millisecond; the pulse at which thrust carries the weight.
//! What can go wrong: powerplants that are not as many as the rotors ([`fly`] gives nothing); a vehicle too heavy to hover.
//! Units: us, rev/min, N, s.
//! Reference: specification `flight.md`, "The body".

use super::{AirframeFile, Mission};
use crate::flight::{Flying, G, Vehicle};
use crate::plant::{PlantState, Powerplant, RigPlant};

/// Time for which the rotors of a flight that begins in the air run before it, s: some fifty of their time constants.
const SPIN_UP_S: f64 = 3.0;

/// Where thrust carries the weight at ground level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HoverPoint {
    /// Pulse, us.
    pub pulse_us: f64,
    /// A rotor there.
    pub rotor: PlantState,
    /// Thrust of all rotors at full throttle over the weight.
    pub thrust_to_weight: f64,
}

/// Powerplants of the catalogue, one a rotor.
#[must_use]
pub fn catalogue_plants(airframe: &AirframeFile) -> Vec<Box<dyn Powerplant>> {
    let parts = airframe.parts();
    airframe.rotors().iter().map(|_| Box::new(RigPlant::new(parts.clone(), 1)) as Box<dyn Powerplant>).collect()
}

/// Where a powerplant of the catalogue settles, each from rest, at `pulse_us`.
#[must_use]
pub fn settled_catalogue(airframe: &AirframeFile, pulse_us: f64) -> PlantState {
    let mut plant = RigPlant::new(airframe.parts(), 1);
    (0..30_000).map(|_| plant.advance(1.0e-4, pulse_us)).last().unwrap_or_default()
}

/// The hover of an airframe whose powerplants settle as `settled` says; nothing where full throttle does not carry it.
pub fn hover(airframe: &AirframeFile, settled: &dyn Fn(f64) -> PlantState) -> Option<HoverPoint> {
    let body = airframe.airframe();
    let each_n = body.mass_kg * G / body.rotors.len() as f64;
    let full = settled(2000.0);
    if full.thrust_n < each_n {
        return None;
    }
    // halves of 1000 us: 20 of them are a thousandth of one
    let (mut low, mut high) = (1000.0, 2000.0);
    for _ in 0..20 {
        let middle = 0.5 * (low + high);
        if settled(middle).thrust_n < each_n { low = middle } else { high = middle }
    }
    Some(HoverPoint { pulse_us: high, rotor: settled(high), thrust_to_weight: full.thrust_n / each_n })
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
