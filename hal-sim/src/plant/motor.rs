//! Brushless motor with its ESC's output stage, averaged over the commutation.
//!
//! What it is: back-EMF, winding resistance, friction and inertia of one motor; the six motors of the thesis.
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
    /// The 570 KV resistance follows from Table 9 (5.779 N at 7.33 A and 11.5 V with k_T = 1.56e-5 N s^2: 608.7 rad/s,
    /// back-EMF 10.20 V). No measurement of the others is known: the same copper gives a resistance as 1/KV^2.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let (kv, pole_pairs) = *MOTORS.iter().find(|(kv, _)| name == format!("{kv}KV"))?;
        let kv = f64::from(kv);
        let ratio = 570.0 / kv;
        Some(Self {
            name: name.to_owned(),
            kv_rpm_per_v: kv,
            resistance_ohm: 0.1778 * ratio * ratio,
            no_load_current_a: 0.30 / ratio,
            inertia_kgm2: 1.2e-5,
            pole_pairs,
        })
    }
}

/// KV and pole pairs of the motors of the thesis (errata, "1.8, 6.1, abstract").
pub const MOTORS: [(u32, u32); 6] = [(390, 11), (490, 11), (570, 11), (690, 11), (1000, 6), (1200, 6)];
