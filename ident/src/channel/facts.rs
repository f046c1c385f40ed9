//! What is read off a log once and asked for again and again.
//!
//! What it is: the facts that effects keep with a [`super::Context`], each made by whom asks first, and the shapes that a search has found.
//! What can go wrong: nothing; a fact depends on the log alone, and a found shape on all that its question holds.
//! Units: stated at each.
//! Reference: memoisation, Michie 1968, Nature 218:19.

use std::collections::HashMap;
use std::sync::{Mutex, OnceLock, PoisonError};

/// Deceleration at which no current is left of a rotor that slows down: drag omega^2 + friction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Coast {
    /// 1/rad.
    pub(crate) drag: f64,
    /// rad/s^2.
    pub(crate) friction: f64,
    /// All of it at the highest speed, rad/s^2.
    pub(crate) at_top: f64,
    /// Whether a row of the run falls as fast as a coasting rotor may for all that is known before.
    pub(crate) shown: bool,
}

/// What effects read off a log once and ask for again and again.
#[derive(Debug, Clone, Default)]
pub(crate) struct Facts {
    /// Step, offset and anchoring of the saw-tooth of the pulse that fits best.
    pub(crate) tooth: OnceLock<SawTooth>,
    /// Speed that the pulse alone makes one expect on each row, rev/min.
    pub(crate) expected: OnceLock<Vec<f64>>,
    /// Whether speed and command change within single rows.
    pub(crate) abrupt: OnceLock<bool>,
    /// The torque that acted on the rig on each row, N.m, less what is the torque sensor's own noise.
    pub(crate) torque: OnceLock<Option<Vec<f64>>>,
    /// Temperature on each row less its meter's noise, degC.
    pub(crate) warmth: OnceLock<Option<Vec<f64>>>,
    /// Logarithm of the air's density over that of standard air on each row.
    pub(crate) density: OnceLock<Vec<f64>>,
    /// Current that a held speed draws, and the highest such speed, krpm.
    pub(crate) draw: OnceLock<Option<(Draw, f64)>>,
    /// R/Kt^2 of the winding, W/(N.m)^2.
    pub(crate) winding: OnceLock<f64>,
    /// Angular acceleration on the way to where the command sends the rotor, rad/s^2; nothing without a command.
    pub(crate) driven: OnceLock<Option<Vec<f64>>>,
    /// When a rotor that slows down draws nothing; nothing where the run does not say.
    pub(crate) balance: OnceLock<Option<Coast>>,
    /// The supply as a straight line: voltage without a current, V, what an ampere adds to it, ohm, and what each Ah drawn adds, V/Ah.
    pub(crate) supply: OnceLock<Option<[f64; 3]>>,
    /// Cells in series of the pack that feeds it, and the state of charge at which the run begins.
    pub(crate) pack: OnceLock<Option<[f64; 2]>>,
    /// Slope of the static speed curve on each row, rev/min per us.
    pub(crate) slope: OnceLock<Vec<f64>>,
    /// Where the thrust reads one and the same largest value.
    pub(crate) rail: OnceLock<Option<Rail>>,
    /// Period, its standard error and an instant of each target's updates, s, where it repeats its values and does not change with each.
    pub(crate) clocks: OnceLock<Vec<Option<[f64; 3]>>>,
    /// The same of updates that noise hides, told by how late jumps of the load show.
    pub(crate) late_clocks: OnceLock<Vec<Option<[f64; 3]>>>,
    /// Step and offset of the grid that each target's readings gather about, beneath noise.
    pub(crate) grids: OnceLock<Vec<Option<[f64; 2]>>>,
    /// See [`Context::step`].
    pub(crate) step: OnceLock<f64>,
    /// Shapes that a search has found.
    pub(crate) refined: Remembered,
}

/// The saw-tooth that fits the departures best.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SawTooth {
    /// Its step, us.
    pub(crate) step: f64,
    /// Where it begins, in steps.
    pub(crate) offset: f64,
    /// The offset is that of a plain counter.
    pub(crate) anchored: bool,
    /// By how many steps the command is too short beside that.
    pub(crate) short: f64,
    /// Squared departure that it explains.
    pub(crate) score: f64,
    /// Shortest and longest step that explain nearly as much: on few levels one tooth passes for another.
    pub(crate) others: (f64, f64),
}

/// Current that a speed draws where it is held, and what of it the winding takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Draw {
    /// Second and third power of krpm, A.
    pub(crate) powers: [f64; 2],
    /// Square of the speed at which the winding takes most, by the current, krpm^2/A.
    pub(crate) lossy: f64,
}

/// Where the thrust reads one and the same largest value.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rail {
    /// Speed from which on it does, rev/min: what noise does at the rail's edge is left out. A grid of speeds meets no rail close beneath
    /// the top speed.
    pub(crate) reached: f64,
    /// Evidence, nats, that noise alone does not repeat a reading to the last digit so often; none where that cannot be told from a meter
    /// that holds or rounds, nor against a model, which may have the rail already.
    pub(crate) unlikely: f64,
}

/// An effect of a question: its identifier, channels and form, and the bits of the shapes that it starts from.
pub(crate) type Asked = (&'static str, Vec<String>, String, Vec<u64>);

/// All that a refinement depends on beside the log itself.
#[derive(Debug, PartialEq, Eq, Hash)]
pub(crate) struct Question {
    /// The effects of the group.
    pub(crate) group: Vec<Asked>,
    /// Digest of the rows that may teach, of the readings, their variances and the declared model.
    pub(crate) ground: u64,
    /// Whether the scatter is asked about too.
    pub(crate) scattering: bool,
    /// Evaluations that are allowed.
    pub(crate) evaluations: usize,
}

/// Refined shapes of the effects of a group, by what was asked.
#[derive(Debug, Default)]
pub(crate) struct Remembered(Mutex<HashMap<Question, Vec<Vec<f64>>>>);

impl Clone for Remembered {
    /// A log's copy is there to be changed: it remembers nothing.
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl Remembered {
    /// What was found, or what is found now.
    pub(crate) fn or_found(&self, question: Question, find: impl FnOnce() -> Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        let known = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(shapes) = known().get(&question) {
            return shapes.clone();
        }
        let shapes = find();
        known().insert(question, shapes.clone());
        shapes
    }
}
