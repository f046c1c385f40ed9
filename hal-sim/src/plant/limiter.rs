//! What the ESC's output stage does to the duty cycle it was asked for.
//!
//! What it is: a coarse throttle input, a soft response, a current limit and a reduction with its own heat.
//! What can go wrong: a current limit below the friction current stops the rotor.
//! Units: us, s, A, duty 0..1.
//! Reference: Beharie 2013 Appendix C, protection C (over heat: the output is reduced, to not less than 35 %).

/// Least output that heat leaves (Appendix C).
const LEAST_OUTPUT: f64 = 0.35;

/// Parameters. The default follows its input exactly and at once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limiter {
    /// Least throttle at which the motor is driven, 0..1.
    pub start_throttle: f64,
    /// Step of the throttle input, us; 0 where it has none.
    pub step_us: f64,
    /// Time constants of the response to a higher and a lower throttle, s; 0 where it follows at once.
    pub lag_s: (f64, f64),
    /// Largest motor-side supply current, A.
    pub current_a: f64,
    /// Share of the output that is lost for each A^2 of heat.
    pub derate_per_a2: f64,
    /// Time constant of the heat, s.
    pub derate_tau_s: f64,
}

impl Default for Limiter {
    fn default() -> Self {
        Self {
            start_throttle: 0.06,
            step_us: 0.0,
            lag_s: (0.0, 0.0),
            current_a: f64::INFINITY,
            derate_per_a2: 0.0,
            derate_tau_s: 60.0,
        }
    }
}

/// State of the output stage.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LimiterState {
    throttle: f64,
    heat_a2: f64,
}

impl LimiterState {
    /// Duty cycle after a pulse of `pulse_us`, before the current limit; 0 where the motor is not driven.
    #[inline]
    pub fn duty(&mut self, limiter: &Limiter, pulse_us: f64, dt_s: f64) -> f64 {
        let mut above_us = pulse_us - 1000.0;
        if limiter.step_us > 0.0 {
            above_us = (above_us / limiter.step_us).floor() * limiter.step_us;
        }
        let asked = (above_us * 1.0e-3).clamp(0.0, 1.0);
        let lag = if asked > self.throttle { limiter.lag_s.0 } else { limiter.lag_s.1 };
        self.throttle = if lag > 0.0 { self.throttle + (asked - self.throttle) * (dt_s / lag).min(1.0) } else { asked };
        if self.throttle < limiter.start_throttle {
            return 0.0;
        }
        self.throttle * (1.0 - limiter.derate_per_a2 * self.heat_a2).max(LEAST_OUTPUT)
    }

    /// Takes the heat of `current_a` for `dt_s`.
    pub fn warm(&mut self, limiter: &Limiter, current_a: f64, dt_s: f64) {
        if limiter.derate_per_a2 > 0.0 {
            self.heat_a2 += (current_a * current_a - self.heat_a2) * (dt_s / limiter.derate_tau_s).min(1.0);
        }
    }
}

impl Limiter {
    /// Whether its duty stands still while the pulse does: no lag, no limit of the current, nothing taken for heat.
    #[must_use]
    pub fn is_steady(&self) -> bool {
        self.lag_s == (0.0, 0.0) && !self.current_a.is_finite() && self.derate_per_a2 == 0.0
    }

    /// The highest duty up to `duty` that keeps duty x motor current within the limit, for a back-EMF, an open-circuit voltage,
    /// the phase resistance and the line resistance.
    #[must_use]
    #[inline]
    pub fn limited(&self, duty: f64, emf_v: f64, open_v: f64, phase_ohm: f64, line_ohm: f64) -> f64 {
        if !self.current_a.is_finite() {
            return duty;
        }
        // duty (duty V - E) / (R + duty^2 r) = I: the positive root.
        let a = open_v - self.current_a * line_ohm;
        let root = (emf_v + (emf_v * emf_v + 4.0 * a * self.current_a * phase_ohm).sqrt()) / (2.0 * a);
        duty.min(root)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_holds_the_current() {
        let l = Limiter { current_a: 5.0, ..Limiter::default() };
        let (e, v, r, line) = (9.0, 11.5, 0.18, 0.05);
        let d = l.limited(1.0, e, v, r, line);
        assert!(d < 1.0);
        assert!((d * (d * v - e) / (r + d * d * line) - 5.0).abs() < 1e-9);
        assert_eq!(l.limited(0.7, e, v, r, line), 0.7);
    }

    #[test]
    fn steps_lag_and_heat() {
        let mut s = LimiterState::default();
        let coarse = Limiter { step_us: 16.0, ..Limiter::default() };
        assert!((s.duty(&coarse, 1250.0, 1e-4) - 0.240).abs() < 1e-12);
        let mut s = LimiterState::default();
        let slow = Limiter { lag_s: (0.5, 1.0), ..Limiter::default() };
        let mut d = 0.0;
        for _ in 0..5000 {
            d = s.duty(&slow, 1500.0, 1e-4);
        }
        assert!((d - 0.5 * (1.0 - libm::exp(-1.0))).abs() < 1e-3, "{d}");
        let hot = Limiter { derate_per_a2: 0.001, derate_tau_s: 10.0, ..Limiter::default() };
        let mut s = LimiterState::default();
        for _ in 0..1_000_000 {
            s.warm(&hot, 7.0, 1e-4);
        }
        assert!((s.duty(&hot, 2000.0, 1e-4) - (1.0 - 0.049)).abs() < 1e-4);
    }
}
