//! Temperature of the rig.
//!
//! What it is: one node that motor losses warm towards the ambient temperature plus a rise, first order, and an ambient that
//! may move during the run.
//! What can go wrong: nothing that a run could notice; the node is linear.
//! Units: degC, W, K/W, s.
//! Reference: lumped-capacitance heating, Incropera & DeWitt, *Fundamentals of Heat and Mass Transfer*, section 5.1.

/// Parameters of the node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Thermal {
    /// Ambient temperature at run start, degC.
    pub ambient_c: f64,
    /// Rate of the ambient temperature, K/s.
    pub ambient_rate_k_per_s: f64,
    /// Rise above ambient per watt of motor loss, K/W. 0: the sensor sits away from the motor.
    pub rise_k_per_w: f64,
    /// Time constant, s.
    pub tau_s: f64,
}

impl Default for Thermal {
    fn default() -> Self {
        Self { ambient_c: 23.0, ambient_rate_k_per_s: 0.0, rise_k_per_w: 0.0, tau_s: 90.0 }
    }
}

impl Thermal {
    /// Room temperature `run_s` into the run, degC.
    #[must_use]
    pub fn room_c(&self, run_s: f64) -> f64 {
        self.ambient_c + self.ambient_rate_k_per_s * run_s
    }

    /// Density of the air in the room over that at run start, at constant pressure.
    #[must_use]
    pub fn thinning(&self, run_s: f64) -> f64 {
        (self.ambient_c + 273.15) / (self.room_c(run_s) + 273.15)
    }
}

/// State of the node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThermalState {
    node: Thermal,
    /// Temperature now, degC.
    pub temperature_c: f64,
}

impl ThermalState {
    /// At ambient temperature.
    #[must_use]
    pub fn new(node: Thermal) -> Self {
        Self { node, temperature_c: node.ambient_c }
    }

    /// Goes on with another node from the temperature reached.
    pub fn refit(&mut self, node: Thermal) {
        self.node = node;
    }

    /// One step with `loss_w` of motor loss, `run_s` into the run.
    pub fn step(&mut self, loss_w: f64, run_s: f64, dt_s: f64) -> f64 {
        let n = &self.node;
        let goal = n.room_c(run_s) + n.rise_k_per_w * loss_w;
        self.temperature_c += (goal - self.temperature_c) * (dt_s / n.tau_s).min(1.0);
        self.temperature_c
    }
}
