//! The shaft between motor and propeller.
//!
//! What it is: everything that turns or brakes the rotor while duty and air stand still, and one step of its motion.
//! What can go wrong: nothing here fails; friction holds a rotor that nothing turns.
//! Units: SI.
//! Reference: Beharie 2013 Eq. 5.11 corrected; errata 2.22-2.24 (the frame feels inertia and drag, not friction).

use super::powerplant::STEPS_PER_MS;
use super::rig_plant::RPM_PER_RAD_S;
use multiversion::multiversion;

/// What a rotor of speed w gains in a step, rad/s: s - d w - a w^2.
#[derive(Debug, Clone, Copy)]
struct Gain {
    standing: f64,
    damping: f64,
    air: f64,
}

impl Gain {
    /// Gain at `w`; friction holds a resting rotor. The air's part is the longest way and the last to come in.
    #[inline(always)]
    fn at(&self, w: f64) -> f64 {
        let gain = self.turning(w);
        if w > 0.0 || gain >= 0.0 { gain } else { zero() }
    }

    /// Gain of a rotor that turns.
    #[inline(always)]
    fn turning(&self, w: f64) -> f64 {
        (self.standing - self.damping * w) - self.air * w * w
    }

    /// Gain of half a step: exact halves.
    fn half(&self) -> Self {
        Self { standing: 0.5 * self.standing, damping: 0.5 * self.damping, air: 0.5 * self.air }
    }
}

/// What acts on the shaft, before it is brought into the form of its steps.
#[derive(Debug, Clone, Copy)]
pub(super) struct Acting {
    pub(super) kt: f64,
    pub(super) emf_free_v: f64,
    pub(super) per_ohm: f64,
    pub(super) holding_nm: f64,
    pub(super) drag_nms: f64,
    pub(super) air_k: f64,
    pub(super) per_inertia: f64,
    pub(super) inertia: f64,
    pub(super) thrust_k: f64,
    pub(super) extra_nm: f64,
    pub(super) extra_nms: f64,
    pub(super) seen_share: f64,
}

/// Ten steps of the shaft: the speed after each, what was gained in it, and the speed that its rule looked ahead to, rad/s.
#[derive(Debug, Clone, Copy, Default)]
pub struct Turns {
    pub(super) speed: [f64; STEPS_PER_MS],
    gained: [f64; STEPS_PER_MS],
    ahead: [f64; STEPS_PER_MS],
}

/// A millisecond in which nothing but the shaft moves: its ten steps are still to be taken.
#[derive(Debug, Clone, Copy)]
pub struct Begun {
    pub(super) shaft: Shaft,
    /// Speed at the beginning, rad/s.
    pub(super) from: f64,
    pub(super) dt_s: f64,
}

impl Begun {
    /// Its ten steps: the numbers of [`Shaft::turn`] one after the other. `meanwhile` is done while they wait for one another.
    #[inline]
    pub fn turn(&self, turns: &mut Turns, meanwhile: &mut dyn FnMut()) {
        let driven = self.is_driven();
        if driven {
            self.shaft.drive(self.from, turns);
        }
        meanwhile();
        if !(driven && self.shaft.drove(turns)) {
            self.shaft.one_by_one(self.from, turns);
        }
    }

    fn is_driven(&self) -> bool {
        self.from > 0.0 && self.shaft.is_driven(self.from)
    }
}

/// Shafts whose steps are taken side by side.
pub const ABREAST: usize = 4;

/// The steps of four shafts side by side: the numbers of [`Begun::turn`], in little more than the time of one.
pub fn turn_abreast(begun: [&Begun; ABREAST], turns: &mut [Turns; ABREAST]) {
    let drove = if begun.iter().all(|b| b.is_driven()) { drive_abreast(begun, turns) } else { [false; ABREAST] };
    for ((begun, turns), drove) in begun.iter().zip(turns).zip(drove) {
        if !drove {
            begun.turn(turns, &mut || ());
        }
    }
}

/// [`Shaft::drive`] of four, and which [`Shaft::drove`].
#[multiversion(targets("x86_64+avx2"))]
fn drive_abreast(begun: [&Begun; ABREAST], turns: &mut [Turns; ABREAST]) -> [bool; ABREAST] {
    let each = |of: fn(&Gain) -> f64| begun.map(|b| of(&b.shaft.driven.0));
    let (standing, damping, air) = (each(|g| g.standing), each(|g| g.damping), each(|g| g.air));
    let half = |whole: [f64; ABREAST]| whole.map(|x| 0.5 * x);
    let (half_standing, half_damping, half_air) = (half(standing), half(damping), half(air));
    let mut from = begun.map(|b| b.from);
    let mut steps = [[[0.0; ABREAST]; 3]; STEPS_PER_MS];
    let (mut slowest, mut fastest) = (from, from);
    for [speed, gained, ahead] in &mut steps {
        for i in 0..ABREAST {
            let first = (standing[i] - damping[i] * from[i]) - air[i] * from[i] * from[i];
            let there = from[i] + first;
            let second = (half_standing[i] - half_damping[i] * there) - half_air[i] * there * there;
            from[i] = (from[i] + 0.5 * first) + second;
            (speed[i], gained[i], ahead[i]) = (from[i], 0.5 * first + second, there);
            let (low, high) = if from[i] < there { (from[i], there) } else { (there, from[i]) };
            slowest[i] = if low < slowest[i] { low } else { slowest[i] };
            fastest[i] = if high > fastest[i] { high } else { fastest[i] };
        }
    }
    for (i, turns) in turns.iter_mut().enumerate() {
        for (step, [speed, gained, ahead]) in steps.iter().enumerate() {
            (turns.speed[step], turns.gained[step], turns.ahead[step]) = (speed[i], gained[i], ahead[i]);
        }
    }
    // a speed that is no number stays one up to the last
    [0, 1, 2, 3].map(|i| from[i] > 0.0 && slowest[i] > 0.0 && begun[i].shaft.is_driven(fastest[i]))
}

/// The shaft while duty and air stand still.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shaft {
    acting: Acting,
    per_step_s: f64,
    /// While current flows, over a step and over half of one.
    driven: (Gain, Gain),
    /// While none does.
    coasting: (Gain, Gain),
}

impl Shaft {
    /// For steps of `dt_s`. The winding's brake is linear in the speed, the air's square: two products one after the other instead of the whole
    /// way through the current, for each step of the run waits for the one before.
    #[inline]
    pub(super) fn new(acting: Acting, dt_s: f64) -> Self {
        let per_torque = acting.per_inertia * dt_s;
        let coupling = acting.kt * acting.per_ohm;
        let air = acting.air_k * per_torque;
        let gain = |torque_nm: f64, brake_nms: f64| {
            let whole = Gain { standing: torque_nm * per_torque, damping: brake_nms * per_torque, air };
            (whole, whole.half())
        };
        Self {
            acting,
            per_step_s: 1.0 / dt_s,
            driven: gain(coupling * acting.emf_free_v - acting.holding_nm, coupling * acting.kt + acting.drag_nms),
            coasting: gain(-acting.holding_nm, acting.drag_nms),
        }
    }

    /// Motor current at rotor speed `w`, A; none flows back.
    #[inline]
    pub(super) fn motor_current(&self, w: f64) -> f64 {
        or_zero((self.acting.emf_free_v - self.acting.kt * w) * self.acting.per_ohm)
    }

    /// Torque of the air at `w`, N.m.
    #[inline]
    pub(super) fn air_nm(&self, w: f64) -> f64 {
        self.acting.air_k * w * w
    }

    #[inline(always)]
    fn is_driven(&self, w: f64) -> bool {
        self.acting.kt * w < self.acting.emf_free_v
    }

    /// Speed after a step and what was gained in it, rad/s: Heun's rule, two evaluations, second order; the rotor's own time constant
    /// is some 40 ms. Each step waits for the one before, so this chain is the run's longest.
    #[inline(always)] // in the loop of steps, or its state goes through memory
    pub(super) fn turn(&self, w: f64) -> (f64, f64) {
        let first = if self.is_driven(w) { self.driven.0.at(w) } else { coast(&self.coasting.0, w) };
        let ahead = or_zero(w + first);
        let half = if self.is_driven(ahead) { self.driven.1.at(ahead) } else { coast(&self.coasting.1, ahead) };
        let next = or_zero((w + 0.5 * first) + half);
        (next, if next > 0.0 { 0.5 * first + half } else { stopped(w) })
    }

    /// Ten steps of a rotor that turns and is driven all the way: nothing is asked in between, so that the chain of the steps is short
    /// enough for the processor to see beyond it.
    #[inline]
    fn drive(&self, w: f64, turns: &mut Turns) {
        let (whole, half) = self.driven;
        let mut from = w;
        for ((speed, gained), ahead) in turns.speed.iter_mut().zip(&mut turns.gained).zip(&mut turns.ahead) {
            let first = whole.turning(from);
            let there = from + first;
            let second = half.turning(there);
            from = (from + 0.5 * first) + second;
            (*speed, *gained, *ahead) = (from, 0.5 * first + second, there);
        }
    }

    /// Whether it was so all the way.
    #[inline]
    fn drove(&self, turns: &Turns) -> bool {
        // a speed that is no number stays one up to the last
        let (mut slowest, mut fastest) = (turns.speed[STEPS_PER_MS - 1], turns.speed[STEPS_PER_MS - 1]);
        for (speed, ahead) in turns.speed.iter().zip(&turns.ahead) {
            let (low, high) = if speed < ahead { (*speed, *ahead) } else { (*ahead, *speed) };
            slowest = if low < slowest { low } else { slowest };
            fastest = if high > fastest { high } else { fastest };
        }
        slowest > 0.0 && self.is_driven(fastest)
    }

    #[cold]
    fn one_by_one(&self, w: f64, turns: &mut Turns) {
        let (mut from, mut gain) = self.turn(w);
        if w == 0.0 && from == 0.0 {
            (turns.speed, turns.gained) = ([from; STEPS_PER_MS], [gain; STEPS_PER_MS]); // it goes on resting
            return;
        }
        for (speed, gained) in turns.speed.iter_mut().zip(&mut turns.gained) {
            (*speed, *gained) = (from, gain);
            (from, gain) = self.turn(from);
        }
    }

    /// Lift and torque on the arm at `w` after a step that `gained` so much.
    #[inline]
    pub(super) fn reaction(&self, w: f64, gained: f64) -> (f64, f64) {
        let a = &self.acting;
        let extra = a.extra_nm + a.extra_nms * w;
        let seen_drag = if w > 0.0 { a.seen_share * extra } else { 0.0 };
        (a.thrust_k * w * w, self.air_nm(w) + seen_drag + a.inertia * (gained * self.per_step_s))
    }
}

/// What steps show, side by side: the numbers of [`Shaft::reaction`] and [`Shaft::motor_current`], and the speed in rev/min.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn show(
    shaft: &Shaft,
    turns: &Turns,
    rpm: &mut [f64; STEPS_PER_MS],
    thrust_n: &mut [f64; STEPS_PER_MS],
    torque_nm: &mut [f64; STEPS_PER_MS],
    motor_a: &mut [f64; STEPS_PER_MS],
) {
    let (a, per_step_s) = (shaft.acting, shaft.per_step_s);
    for i in 0..STEPS_PER_MS {
        let (w, gained) = (turns.speed[i], turns.gained[i]);
        rpm[i] = w * RPM_PER_RAD_S;
        let current = (a.emf_free_v - a.kt * w) * a.per_ohm;
        motor_a[i] = if current > 0.0 { current } else { 0.0 };
        let seen_drag = a.seen_share * (a.extra_nm + a.extra_nms * w);
        let seen_drag = if w > 0.0 { seen_drag } else { 0.0 };
        thrust_n[i] = a.thrust_k * w * w;
        torque_nm[i] = a.air_k * w * w + seen_drag + a.inertia * (gained * per_step_s);
    }
}

/// The larger of `x` and 0, as a branch that is foreseen: a maximum would be waited for in each step.
#[inline]
fn or_zero(x: f64) -> f64 {
    if x > 0.0 { x } else { zero() }
}

#[cold]
#[inline(never)]
fn zero() -> f64 {
    0.0
}

/// Gain of a rotor that no current turns: a branch that is foreseen as well.
#[cold]
#[inline(never)]
fn coast(gain: &Gain, w: f64) -> f64 {
    gain.at(w)
}

/// What a rotor of speed `w` that comes to rest within a step gains.
#[cold]
#[inline(never)]
fn stopped(w: f64) -> f64 {
    -w
}

#[cfg(test)]
mod tests {
    use super::*;

    const RIG: Acting = Acting {
        kt: 0.0165,
        emf_free_v: 7.0,
        per_ohm: 5.0,
        holding_nm: 0.008,
        drag_nms: 1.0e-6,
        air_k: 3.0e-7,
        per_inertia: 1.0e4,
        inertia: 1.0e-4,
        thrust_k: 2.0e-5,
        extra_nm: 0.0,
        extra_nms: 0.0,
        seen_share: 0.0,
    };

    /// The torques one by one, as the equation of motion states them.
    fn acceleration(a: &Acting, w: f64) -> f64 {
        let current = ((a.emf_free_v - a.kt * w) * a.per_ohm).max(0.0);
        let net = a.kt * current - a.holding_nm - a.drag_nms * w - a.air_k * w * w;
        if w > 0.0 || net >= 0.0 { net * a.per_inertia } else { 0.0 }
    }

    /// Ten steps at once are ten steps: at rest, starting, driven, into and out of coasting, to rest.
    #[test]
    fn ten_turns_are_one_after_the_other() {
        for (emf_free_v, from) in
            [(0.0, 0.0), (7.0, 0.0), (7.0, 300.0), (7.0, 423.9), (7.0, 424.6), (0.0, 600.0), (0.0, 3.0), (0.0, 0.1)]
        {
            let shaft = Shaft::new(Acting { emf_free_v, ..RIG }, 1.0e-4);
            let (mut w, mut turns) = (from, Turns::default());
            for _ in 0..100 {
                Begun { shaft, from: w, dt_s: 1.0e-4 }.turn(&mut turns, &mut || ());
                for (speed, gained) in turns.speed.iter().zip(&turns.gained) {
                    let (next, gain) = shaft.turn(w);
                    assert_eq!((speed.to_bits(), gained.to_bits()), (next.to_bits(), gain.to_bits()), "{emf_free_v} V, {from}");
                    w = next;
                }
            }
        }
    }

    /// Four side by side do what each does alone: all driven, one that coasts or stops, one at rest, one whose speed is lost.
    #[test]
    fn abreast_is_one_by_one() {
        let some =
            [(7.0, 300.0), (7.0, 423.9), (7.0, 424.6), (0.0, 600.0), (0.01, 0.03), (0.0, 0.0), (7.0, 0.0), (7.0, f64::NAN)];
        let begun = |(emf_free_v, from): (f64, f64)| {
            let shaft = Shaft::new(Acting { emf_free_v, ..RIG }, 1.0e-4);
            Begun { shaft, from, dt_s: 1.0e-4 }
        };
        let bits = |turns: &Turns| (turns.speed.map(f64::to_bits), turns.gained.map(f64::to_bits));
        for (i, first) in some.iter().enumerate() {
            for others in [[some[0]; 3], [*first; 3], [some[0], some[(i + 3) % 8], some[(i + 5) % 8]]] {
                let four = [*first, others[0], others[1], others[2]].map(begun);
                let mut together = [Turns::default(); ABREAST];
                turn_abreast(four.each_ref(), &mut together);
                for (begun, turns) in four.iter().zip(&together) {
                    let mut alone = Turns::default();
                    begun.turn(&mut alone, &mut || ());
                    assert_eq!(bits(turns), bits(&alone), "{first:?} beside {others:?}");
                }
            }
        }
    }

    /// Steps by gains are Heun's steps of the equation of motion: driven, coasting, across the two and to rest.
    #[test]
    fn a_step_is_that_of_the_equation_of_motion() {
        let dt = 1.0e-4;
        for (emf_free_v, from) in [(7.0, 0.0), (7.0, 300.0), (7.0, 800.0), (7.0, 424.3), (0.0, 600.0), (0.0, 3.0), (0.0, 0.0)] {
            let acting = Acting { emf_free_v, ..RIG };
            let shaft = Shaft::new(acting, dt);
            let (mut w, mut want) = (from, from);
            for step in 0..3000 {
                let first = acceleration(&acting, want);
                let second = acceleration(&acting, (want + first * dt).max(0.0));
                let next = (want + 0.5 * (first + second) * dt).max(0.0);
                let (got, gained) = shaft.turn(w);
                assert!((got - next).abs() < 1e-9, "{emf_free_v} V, step {step}: {got} {next}");
                assert!((w + gained - got).abs() < 1e-9, "{emf_free_v} V, step {step}: {gained}");
                (w, want) = (got, next);
            }
            assert!(if emf_free_v > 0.0 { w > 250.0 } else { w < 500.0 }, "{emf_free_v} V: {w}");
        }
    }
}
