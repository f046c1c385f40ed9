//! Brushless motor with its ESC's output stage, averaged over the commutation.
//!
//! What it is: back-EMF, winding resistance, friction and inertia of one motor; the six motors of the thesis;
//! whether the ESC's start without a back-EMF gets it to turn.
//! What can go wrong: a current never flows back into the supply (the ESC does not brake), so the rotor coasts down.
//! Units: SI; KV in rev/min per volt.
//! Reference: Beharie 2013, Eq. 5.11 corrected (rpm = KV (V - I R), no-load only); Table 9 for the 570 KV motor.

use core::f64::consts::TAU;

/// Parameters of one motor.
#[derive(Debug, Clone, PartialEq)]
pub struct Motor {
    /// Name, as it stands in the log.
    pub name: String,
    /// Speed constant, rev/min per volt.
    pub kv_rpm_per_v: f64,
    /// Winding, ESC and lead resistance in the phase path, ohm.
    pub resistance_ohm: f64,
    /// No-load current: bearing and iron friction, A.
    pub no_load_current_a: f64,
    /// Inertia of the rotor without the propeller, kg.m^2.
    pub inertia_kgm2: f64,
    /// Pairs of poles.
    pub pole_pairs: u32,
}

impl Motor {
    /// Torque constant, N.m/A, which is also the back-EMF constant, V.s/rad.
    #[must_use]
    pub fn torque_constant(&self) -> f64 {
        60.0 / (TAU * self.kv_rpm_per_v)
    }

    /// Bearing and iron friction, N.m.
    #[must_use]
    pub fn friction_nm(&self) -> f64 {
        self.torque_constant() * self.no_load_current_a
    }

    /// A motor of the thesis by its name ("570KV").
    ///
    /// Resistance and no-load current of three motors follow from stated figures; no measurement of the others is known:
    /// - 570 KV: 5.779 N at 7.33 A and 11.5 V with k_T = 1.56e-5 N s^2 is 608.7 rad/s, back-EMF 10.20 V (Table 9, hover).
    /// - 390 and 490 KV: the same copper, R as 1/KV^2 and I_0 as KV; with it the 9x4.7's coefficients give 171 g at 1.61 A on 390 KV.
    /// - 1000 KV: 675 g on the 11x4.5, whose coefficients the 570 KV motor gives, at 15.64 A.
    /// - 690 and 1200 KV: such that no pair passes the highest thrust stated, 675 g, by more than 5 %.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let (kv, pole_pairs) = *MOTORS.iter().find(|(kv, _)| name == format!("{kv}KV"))?;
        let kv_rpm_per_v = f64::from(kv);
        let ratio = 570.0 / kv_rpm_per_v;
        let (resistance_ohm, no_load_current_a) = match kv {
            690 => (0.24, 0.36),
            1000 => (0.3365, 0.57),
            1200 => (0.37, 0.68),
            _ => (0.1778 * ratio * ratio, 0.30 / ratio),
        };
        Some(Self { name: name.to_owned(), kv_rpm_per_v, resistance_ohm, no_load_current_a, inertia_kgm2: 1.2e-5, pole_pairs })
    }

    /// Whether the ESC's blind start gets a rotor of `inertia_kgm2` in all to turn: it drives [`START_A`] through the winding and
    /// steps the field on at [`START_RAD_S2`], whether the rotor follows or not.
    #[must_use]
    pub fn starts(&self, inertia_kgm2: f64) -> bool {
        self.torque_constant() * START_A > inertia_kgm2 * START_RAD_S2 + self.friction_nm()
    }
}

/// Winding current of the ESC's blind start, A. With [`START_RAD_S2`] it is assumed such that, of the 36 pairs, only 1200 KV with
/// 12x4.5 does not start (errata, "1.8, 6.1": the pair without a result).
pub const START_A: f64 = 10.6;
/// Acceleration of the field in the blind start, rad/s^2.
pub const START_RAD_S2: f64 = 1000.0;

/// KV and pole pairs of the motors of the thesis (errata, "1.8, 6.1, abstract").
pub const MOTORS: [(u32, u32); 6] = [(390, 11), (490, 11), (570, 11), (690, 11), (1000, 6), (1200, 6)];
