//! A mission flown.
//!
//! What it is: the vehicle under the mission's pulses, millisecond by millisecond.
//! What can go wrong: powerplants that are not as many as the rotors ([`fly`] gives nothing).
//! Units: us, s.
//! Reference: specification `flight.md`, "The body".

use super::aboard::{Board, Seen};
use super::hovering::{Catalogue, RotorCurves, hover, modes};
use super::steering::Steering;
use super::{AirframeFile, Mission};
use crate::flight::autopilot::Mixer;
use crate::flight::{Flying, Vehicle};
use crate::imu::{Aboard, BusFault};
use crate::native::ahrs::ImuRig;
use crate::plant::{Powerplant, RigPlant};

/// Time for which the rotors of a flight that begins in the air run before it, s: some fifty of their time constants.
const SPIN_UP_S: f64 = 3.0;

/// Powerplants of the catalogue, one a rotor.
#[must_use]
pub fn catalogue_plants(airframe: &AirframeFile) -> Vec<Box<dyn Powerplant>> {
    let parts = airframe.parts();
    airframe.rotors().iter().map(|_| Box::new(RigPlant::new(parts.clone(), 1)) as Box<dyn Powerplant>).collect()
}

/// What a flight leaves.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Flight {
    /// What was there, at the rate of the log.
    pub rows: Vec<Flying>,
    /// What the IMU board said, with the truth at that instant: from its power-up on.
    pub seen: Vec<(Seen, crate::flight::Rotation)>,
    /// What the controller ended or changed, and when, s.
    pub events: Vec<(f64, String)>,
    /// Touches of the ground.
    pub touches: Vec<Touch>,
}

/// A touch of the ground by a vehicle that was in the air.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// When, s.
    pub t_s: f64,
    /// How fast its centre of gravity came down, m/s.
    pub down_m_s: f64,
}

/// Time in the air after which a contact is another touch, ms. The ground gives back a twentieth of the speed: the bounce of a fall at 40 m/s
/// is over in 0.4 s.
const TOUCH_MS: u64 = 500;

/// Time for which a flight goes on after its motors were stopped, ms.
const AFTER_MS: u64 = 3000;

/// Flies `mission` on the catalogue's slopes; the rows of its log. `reference_density` is that of the powerplants, kg/m^3; `progress` hears
/// the share done.
pub fn fly(
    mission: &Mission,
    airframe: &AirframeFile,
    plants: Vec<Box<dyn Powerplant>>,
    reference_density: f64,
    progress: &mut dyn FnMut(f64),
) -> Option<Vec<Flying>> {
    Some(fly_whole(mission, airframe, plants, &Catalogue(airframe), reference_density, progress)?.rows)
}

/// Flies `mission` with what is aboard. `curves` are those of the powerplants: a controller takes its slopes from them. Nothing where the
/// masses make no body, or a controller is to steer what cannot hover.
pub fn fly_whole(
    mission: &Mission,
    airframe: &AirframeFile,
    plants: Vec<Box<dyn Powerplant>>,
    curves: &dyn RotorCurves,
    reference_density: f64,
    progress: &mut dyn FnMut(f64),
) -> Option<Flight> {
    fly_kept(mission, airframe, plants, curves, reference_density, progress, None)
}

/// The same, and the board with its surroundings as it has ridden along, for another run of its firmware: that of the flash image, say.
pub fn fly_again(
    mission: &Mission,
    airframe: &AirframeFile,
    plants: Vec<Box<dyn Powerplant>>,
    curves: &dyn RotorCurves,
    reference_density: f64,
) -> Option<(Flight, ImuRig)> {
    let section = mission.imu.unwrap_or_default();
    let rig = super::aboard::rig(&section, mission.seed, bus_fault(mission, section.rest_s));
    let with_board = Mission { imu: Some(section), ..mission.clone() };
    let kept = rig.aboard.clone();
    let flight = fly_kept(&with_board, airframe, plants, curves, reference_density, &mut |_| (), kept)?;
    Some((flight, rig))
}

fn fly_kept(
    mission: &Mission,
    airframe: &AirframeFile,
    plants: Vec<Box<dyn Powerplant>>,
    curves: &dyn RotorCurves,
    reference_density: f64,
    progress: &mut dyn FnMut(f64),
    kept: Option<Aboard>,
) -> Option<Flight> {
    let (body, rotors) = (airframe.airframe(), plants.len());
    let mut steering = steering(mission, &body, curves, reference_density)?;
    let section = mission.imu.or(steering.as_ref().map(|_| Default::default()));
    let mut board = section.map(|s| Board::new(&s, &body, airframe.blades(), mission.seed, bus_fault(mission, s.rest_s), kept));
    let mut vehicle = Vehicle::new(body, plants, reference_density, mission.surroundings(), mission.motion())?;
    let dead = dead_rotors(mission);
    let pulses = |ms: u64, into: &mut Vec<f64>| {
        into.clear();
        into.extend((0..rotors).map(|rotor| mission.pulse_us(rotor, ms as f64 * 1.0e-3)));
    };
    let mut now = Vec::with_capacity(rotors);
    pulses(0, &mut now);
    if mission.start.spun_up && steering.is_none() {
        vehicle.spin_up(&now, SPIN_UP_S);
    }
    vehicle.stand();
    let mut flight = Flight::default();
    if let Some(board) = &mut board {
        let attitude = vehicle.motion().attitude;
        flight.seen = board.rest(vehicle.motion(), vehicle.rotors()).into_iter().map(|seen| (seen, attitude)).collect();
    }
    if let (Some(steering), Some((seen, _))) = (&mut steering, flight.seen.last()) {
        steering.sees(*seen);
    }
    let total = (mission.length_s() * 1000.0).round() as u64;
    let every = u64::from(1000 / mission.log_hz);
    let mut ends = total;
    // what begins on the ground has touched it already
    let mut in_air_ms = if mission.start.height_m > 0.0 { TOUCH_MS } else { 0 };
    flight.rows.push(vehicle.now());
    for ms in 0..total {
        match &mut steering {
            Some(steering) => {
                now.clear();
                now.extend_from_slice(steering.millisecond(ms, vehicle.motion()));
                if steering.is_over() {
                    ends = ends.min(ms + AFTER_MS);
                }
            }
            None => pulses(ms, &mut now),
        }
        for (rotor, from_ms) in &dead {
            if ms >= *from_ms {
                now[*rotor] = 1000.0;
            }
        }
        let down_m_s = vehicle.motion().velocity.z;
        vehicle.millisecond(&now);
        let on_ground = vehicle.on_ground();
        if on_ground && in_air_ms >= TOUCH_MS {
            flight.touches.push(Touch { t_s: vehicle.t_s(), down_m_s });
        }
        in_air_ms = if on_ground { 0 } else { in_air_ms + 1 };
        if let Some(seen) = board.as_mut().and_then(|b| b.millisecond(&vehicle)) {
            flight.seen.push((seen, vehicle.motion().attitude));
            steering.iter_mut().for_each(|s| s.sees(seen));
        }
        let landed = mission.ends_on_ground && on_ground;
        if (ms + 1) % every == 0 || landed {
            flight.rows.push(vehicle.now());
        }
        if landed || ms >= ends {
            break;
        }
        if ms % 1000 == 0 {
            progress(ms as f64 / total as f64);
        }
    }
    flight.events = steering.map_or_else(Vec::new, |s| s.events);
    Some(flight)
}

/// The controller, where there is one; nothing where it cannot hover.
fn steering(
    mission: &Mission,
    body: &crate::flight::Airframe,
    curves: &dyn RotorCurves,
    reference_density: f64,
) -> Option<Option<Steering>> {
    let Some(section) = &mission.controller else { return Some(None) };
    let at = hover(body, curves, mission.ground_density() / reference_density)?;
    let slopes = modes(body, &at, curves, &mission.surroundings());
    let mixer = Mixer::new(body, at.pulse_us, slopes.thrust_per_us, slopes.turning_per_us[2]);
    Some(Some(Steering::new(section.clone(), mixer, body.rotors.len(), mission.seed)))
}

/// Rotors (from 0) that die, and when, ms.
fn dead_rotors(mission: &Mission) -> Vec<(usize, u64)> {
    let dead = mission.failure.iter().filter_map(|f| Some((f.rotor.as_ref()?.get_ref() - 1, f)));
    dead.map(|(rotor, f)| (rotor, (f.at_s.get_ref() * 1000.0) as u64)).collect()
}

/// The first chip that leaves the bus, in the board's time.
fn bus_fault(mission: &Mission, rest_s: f64) -> BusFault {
    let lost = mission.failure.iter().find_map(|f| Some((f.chip? as usize, *f.at_s.get_ref())));
    lost.map_or(BusFault::None, |(nth, at_s)| BusFault::LoosePlug {
        nth,
        off_ns: ((rest_s + at_s) * 1.0e9) as u64,
        back_ns: u64::MAX,
    })
}
