//! What the magnets and the iron make of the torque constant.
//!
//! What it is: one factor on torque and back-EMF constant from the temperature of the rotor's magnets (reversible loss, and loss
//! for good beyond a knee), from the saturation of the stator's teeth, and from the lead angle at which the ESC commutates.
//! What can go wrong: a motor whose flux is gone turns faster and pulls more current; the factor stays above 0.2.
//! Units: degC, A, deg, 1.
//! Reference: NdFeB grades lose 0.11 %/K reversibly (Arnold Magnetic Technologies, N42 data sheet); Hendershot & Miller 2010,
//! *Design of Brushless Permanent-Magnet Machines*, chapters 3 (demagnetisation, saturation) and 8 (phase advance).

/// Parameters. The default magnet, iron and timing do nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flux {
    /// Reversible loss of flux, 1/K.
    pub loss_per_k: f64,
    /// Temperature from which flux is lost for good, degC.
    pub knee_c: f64,
    /// Share lost for good for each kelvin that the knee was exceeded by.
    pub knee_loss_per_k: f64,
    /// Rise of the magnets for each watt of motor loss, K/W.
    pub rise_k_per_w: f64,
    /// Time constant of the magnets' temperature, s.
    pub tau_s: f64,
    /// Current at which saturation has taken 29 % of the torque constant, A; infinite for none.
    pub saturation_a: f64,
    /// Speed above which the ESC advances its commutation, rev/min, and below which it takes that back.
    pub advance_rpm: (f64, f64),
    /// Lead angle then, electrical degrees.
    pub advance_deg: f64,
}

impl Default for Flux {
    fn default() -> Self {
        Self {
            loss_per_k: 0.0,
            knee_c: f64::INFINITY,
            knee_loss_per_k: 0.0,
            rise_k_per_w: 0.0,
            tau_s: 60.0,
            saturation_a: f64::INFINITY,
            advance_rpm: (f64::INFINITY, f64::INFINITY),
            advance_deg: 0.0,
        }
    }
}

/// State of magnets and timing.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FluxState {
    rise_k: f64,
    lost: f64,
    advanced: bool,
}

impl FluxState {
    /// One step at `rpm` with `loss_w` of motor loss and `current_a` in the winding, in a room of `room_c`; gives the factor.
    pub fn step(&mut self, flux: &Flux, rpm: f64, loss_w: f64, current_a: f64, room_c: f64, dt_s: f64) -> f64 {
        if *flux == Flux::default() {
            return 1.0;
        }
        self.rise_k += (flux.rise_k_per_w * loss_w - self.rise_k) * (dt_s / flux.tau_s).min(1.0);
        let over_k = room_c + self.rise_k - flux.knee_c;
        self.lost = self.lost.max(flux.knee_loss_per_k * over_k);
        if rpm > flux.advance_rpm.0 {
            self.advanced = true;
        } else if rpm < flux.advance_rpm.1 {
            self.advanced = false;
        }
        let relative = current_a / flux.saturation_a;
        let iron = 1.0 / (1.0 + relative * relative).sqrt();
        let lead = if self.advanced { libm::cos(flux.advance_deg.to_radians()) } else { 1.0 };
        ((1.0 - flux.loss_per_k * self.rise_k) * (1.0 - self.lost) * iron * lead).max(0.2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heat_is_taken_back_and_the_knee_is_not() {
        let flux =
            Flux { loss_per_k: 1.1e-3, knee_c: 60.0, knee_loss_per_k: 2.0e-3, rise_k_per_w: 5.0, tau_s: 1.0, ..Flux::default() };
        let mut s = FluxState::default();
        let mut run = |loss: f64| (0..20_000).map(|_| s.step(&flux, 0.0, loss, 0.0, 20.0, 1e-3)).last().unwrap();
        assert!((run(4.0) - (1.0 - 0.022)).abs() < 1e-6, "20 K of rise");
        assert!((run(0.0) - 1.0).abs() < 1e-6, "and back");
        run(10.0); // 70 degC, 10 K beyond the knee
        assert!((run(0.0) - 0.98).abs() < 1e-6, "2 % are gone");
    }

    #[test]
    fn saturation_and_timing() {
        let mut s = FluxState::default();
        let iron = Flux { saturation_a: 10.0, ..Flux::default() };
        assert!((s.step(&iron, 0.0, 0.0, 10.0, 20.0, 1e-3) - 0.5f64.sqrt()).abs() < 1e-12);
        let timing = Flux { advance_rpm: (4000.0, 3500.0), advance_deg: 15.0, ..Flux::default() };
        let mut at = |rpm: f64| s.step(&timing, rpm, 0.0, 0.0, 20.0, 1e-3);
        assert_eq!(at(3900.0), 1.0);
        assert!(at(4100.0) < 0.97);
        assert!(at(3700.0) < 0.97, "it holds on the way down");
        assert_eq!(at(3400.0), 1.0);
    }
}
