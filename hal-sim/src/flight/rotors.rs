//! The rotors of a vehicle.
//!
//! What it is: one powerplant a rotor, each with its pulse, millisecond by millisecond, and what they do to the body together.
//! What can go wrong: a rotor that gives a NaN or a negative speed rests.
//! Units: SI; us for pulses, rev/min for rotor speed.
//! Reference: specification `flight.md`, "The body"; errata 2.15-2.30 (moments).

use super::{Airframe, Rotor, Vector};
use crate::plant::powerplant::STEPS_PER_MS;
use crate::plant::rig_plant::RPM_PER_RAD_S;
use crate::plant::shaft::{ABREAST, Begun, Turns, turn_abreast};
use crate::plant::{PlantBlock, PlantLevers, PlantState, Powerplant};

/// Step of the powerplants, s.
const STEP_S: f64 = 1.0e-3 / STEPS_PER_MS as f64;
/// The pulse of a rotor that gets none, us.
const LOWEST_US: f64 = 1000.0;

/// Sum of the rotors: lift along -z, moment, spin.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Lift {
    pub(super) thrust_n: f64,
    pub(super) moment: Vector,
    pub(super) spin: f64,
}

/// One powerplant and what it did in the last millisecond.
struct Turning {
    plant: Box<dyn Powerplant>,
    pulse_us: f64,
    block: PlantBlock,
}

/// The rotors, in the airframe's order.
pub(super) struct Rotors {
    turning: Vec<Turning>,
    states: Vec<PlantState>,
    /// Their place is kept.
    turns: [Turns; ABREAST],
}

impl Rotors {
    pub(super) fn new(plants: Vec<Box<dyn Powerplant>>) -> Self {
        let turning = |plant| Turning { plant, pulse_us: LOWEST_US, block: PlantBlock::default() };
        Self {
            states: vec![PlantState::default(); plants.len()],
            turning: plants.into_iter().map(turning).collect(),
            turns: Default::default(),
        }
    }

    /// A millisecond with a pulse for each; a rotor without one gets the lowest. Their sum at its middle and its end.
    pub(super) fn millisecond(&mut self, airframe: &Airframe, pulses_us: &[f64], levers: &PlantLevers) -> [Lift; 2] {
        for (i, rotor) in self.turning.iter_mut().enumerate() {
            rotor.pulse_us = pulses_us.get(i).copied().filter(|p| p.is_finite()).unwrap_or(LOWEST_US);
        }
        turn(&mut self.turning, levers, &mut self.turns);
        for (state, rotor) in self.states.iter_mut().zip(&self.turning) {
            *state = rotor.block.last;
        }
        [STEPS_PER_MS / 2 - 1, STEPS_PER_MS - 1].map(|step| {
            let mut sum = Lift::default();
            for (place, rotor) in airframe.rotors.iter().zip(&self.turning) {
                place.add(&rotor.block, step, airframe.rotor_inertia_kgm2, &mut sum);
            }
            sum
        })
    }

    /// What each did at the end of the last millisecond.
    pub(super) fn states(&self) -> &[PlantState] {
        &self.states
    }

    /// The pulse of each, us.
    pub(super) fn pulses_us(&self) -> impl ExactSizeIterator<Item = f64> {
        self.turning.iter().map(|rotor| rotor.pulse_us)
    }
}

impl Turning {
    fn begin(&mut self, levers: &PlantLevers) -> Option<Begun> {
        self.plant.adjust(levers);
        self.plant.begin(STEP_S, self.pulse_us)
    }
}

/// Rotors turn four at a time: they have nothing of each other.
fn turn(rotors: &mut [Turning], levers: &PlantLevers, turns: &mut [Turns; ABREAST]) {
    for four in rotors.chunks_mut(ABREAST) {
        let mut begun = [None; ABREAST];
        for (begun, rotor) in begun.iter_mut().zip(four.iter_mut()) {
            *begun = rotor.begin(levers);
        }
        if let [Some(a), Some(b), Some(c), Some(d)] = &begun {
            turn_abreast([a, b, c, d], turns);
        } else {
            for (begun, turns) in begun.iter().zip(turns.iter_mut()) {
                begun.iter().for_each(|begun| begun.turn(turns, &mut || ()));
            }
        }
        for ((rotor, begun), turns) in four.iter_mut().zip(&begun).zip(&*turns) {
            match begun {
                Some(begun) => rotor.plant.end(begun, turns, &mut rotor.block),
                None => rotor.plant.advance_block(STEP_S, rotor.pulse_us, &mut rotor.block, &mut || ()),
            }
        }
    }
}

impl Rotor {
    /// Adds what it does in a step: lift, its moment about the middle (-y T, x T), its reaction against its turning, its spin.
    fn add(&self, block: &PlantBlock, step: usize, inertia_kgm2: f64, sum: &mut Lift) {
        let (thrust_n, torque_nm, rpm) = (block.thrust_n[step], block.torque_nm[step], block.rpm[step]);
        if !(rpm >= 0.0 && thrust_n.is_finite() && torque_nm.is_finite()) {
            return;
        }
        sum.thrust_n += thrust_n;
        sum.moment += Vector::new(-self.place[1] * thrust_n, self.place[0] * thrust_n, -self.turns * torque_nm);
        sum.spin += self.turns * inertia_kgm2 * rpm / RPM_PER_RAD_S;
    }
}
