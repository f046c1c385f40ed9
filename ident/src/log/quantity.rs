//! Physical quantities at the public edges of selection and beam design.
//!
//! What it is: one newtype a quantity, so that grams never meet newtons by accident; conversions are named functions.
//! What can go wrong: nothing; a value that is not finite stays so and is refused where it is used.
//! Units: SI unless the name says otherwise.
//! Reference: specification `house.md`, rule 4.

macro_rules! quantity {
    ($($(#[$doc:meta])* $name:ident),+ $(,)?) => {$(
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default, serde::Serialize, serde::Deserialize)]
        #[serde(transparent)]
        pub struct $name(pub f64);
    )+};
}

quantity! {
    /// Force, N.
    Newton,
    /// Electric current, A.
    Ampere,
    /// Electric potential, V.
    Volt,
    /// Mass, kg.
    Kilogram,
    /// Length, m.
    Metre,
    /// Stress or modulus, Pa.
    Pascal,
    /// Frequency, Hz.
    Hertz,
    /// Density, kg/m^3.
    Density,
    /// Rotational speed, rev/min.
    RevPerMin,
    /// Electric charge, A.h.
    AmpereHour,
    /// Time, min.
    Minute,
}

/// Standard gravity as the thesis rounds it, m/s^2 (Beharie 2013, section 6.1: 19.62 N for 2 kg).
pub const GRAVITY: f64 = 9.81;

impl Newton {
    /// The force that carries a mass.
    #[must_use]
    pub fn weight_of(mass: Kilogram) -> Self {
        Self(mass.0 * GRAVITY)
    }

    /// The mass that the force carries.
    #[must_use]
    pub fn carries(self) -> Kilogram {
        Kilogram(self.0 / GRAVITY)
    }
}

impl Metre {
    /// From inches.
    #[must_use]
    pub fn from_inches(inches: f64) -> Self {
        Self(inches * 0.0254)
    }
}

impl Hertz {
    /// The speed at which something that happens `times` a revolution happens this often.
    #[must_use]
    pub fn as_speed(self, times: u32) -> RevPerMin {
        RevPerMin(self.0 * 60.0 / f64::from(times.max(1)))
    }
}
