//! The shaft between motor and propeller.
//!
//! What it is: everything that turns or brakes the rotor while duty and air stand still, and one step of its motion.
//! What can go wrong: nothing here fails; friction holds a rotor that nothing turns.
//! Units: SI.
//! Reference: Beharie 2013 Eq. 5.11 corrected; errata 2.22-2.24 (the frame feels inertia and drag, not friction).

/// Everything that acts on the shaft while duty and air stand still.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shaft {
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

impl Shaft {
    /// Motor current at rotor speed `w`, A; none flows back.
    #[inline]
    pub(super) fn motor_current(&self, w: f64) -> f64 {
        or_zero((self.emf_free_v - self.kt * w) * self.per_ohm)
    }

    /// Torque of the air at `w`, N.m.
    #[inline]
    pub(super) fn air_nm(&self, w: f64) -> f64 {
        self.air_k * w * w
    }

    /// Angular acceleration, rad/s^2; friction holds a resting rotor. `DRAGS`: something brakes in proportion to the speed.
    #[inline]
    fn acceleration<const DRAGS: bool>(&self, w: f64) -> f64 {
        let mut net = self.kt * self.motor_current(w) - self.holding_nm;
        if DRAGS {
            net -= self.drag_nms * w;
        }
        net -= self.air_nm(w);
        if w > 0.0 || net >= 0.0 { net * self.per_inertia } else { zero() }
    }

    /// Speed after a step and the acceleration in it: Heun's rule, two evaluations, second order; the rotor's own time constant is
    /// some 40 ms. Each step waits for the one before, so this chain is the run's longest.
    #[inline(always)] // in the loop of steps, or its state goes through memory
    pub(super) fn turn<const DRAGS: bool>(&self, w: f64, dt_s: f64) -> (f64, f64) {
        let first = self.acceleration::<DRAGS>(w);
        let second = self.acceleration::<DRAGS>(or_zero(w + first * dt_s));
        let twice = first + second;
        let next = or_zero(w + twice * (0.5 * dt_s)); // halving is exact
        (next, if next > 0.0 { 0.5 * twice } else { stopped(w, dt_s) })
    }

    /// Lift and torque on the arm at `w` and its `acceleration`.
    #[inline]
    pub(super) fn reaction(&self, w: f64, acceleration: f64) -> (f64, f64) {
        let extra = self.extra_nm + self.extra_nms * w;
        let seen_drag = if w > 0.0 { self.seen_share * extra } else { 0.0 };
        (self.thrust_k * w * w, self.air_nm(w) + seen_drag + self.inertia * acceleration)
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

/// Deceleration that stops a rotor of speed `w` within a step.
#[cold]
#[inline(never)]
fn stopped(w: f64, dt_s: f64) -> f64 {
    -w / dt_s
}
