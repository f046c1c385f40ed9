//! Does the circle close? A run that was simulated with a model, judged against that model.
//!
//! What it is: the residual of each channel against the model as it stands, its size over the noise floor, its whiteness, and
//! what the search still finds in it.
//! What can go wrong: a static relation makes no claim while the rotor settles: those rows are left out ([`SETTLING_S`], and
//! where the model's own speed lags as long as that moves it), and speeds below [`SLOWEST_RPM`] too, where a mark passes less
//! often than the log is written. The load cell is tared before every run: one constant a channel is the second run's own.
//! Units: the channel's; whiteness is a p-value.
//! Reference: specification `closing-the-loop.md`, step 9; `formats.md` (rows without a claim).

use crate::attribution::diagnose::{Diagnosis, diagnose};
use crate::channel::{Context, Relation, unit_of};
use crate::log::{Log, SPEED};
use crate::model::Declared;
use crate::model::Model;
use crate::signal::residual::whiteness;

/// Time after a change of the command during which a static relation makes no claim, s.
pub const SETTLING_S: f64 = 0.5;
/// Change of a lagging speed over [`SETTLING_S`], as a share of its top, below which it stands still.
const STILL: f64 = 5.0e-5;
/// Speed below which the capture channels give less than two readings a second of their own, rev/min.
pub const SLOWEST_RPM: f64 = 300.0;
/// How long a capture channel remembers such a speed after the rotor has stopped: three periods of one mark a revolution, s.
const SLOW_MEMORY_S: f64 = 2.0;

/// What a channel leaves over.
#[derive(Debug, Clone, PartialEq)]
pub struct Left {
    /// Channel.
    pub channel: String,
    /// Unit of the figures.
    pub unit: &'static str,
    /// Samples that were judged.
    pub samples: usize,
    /// Root mean square of the residual.
    pub rms: f64,
    /// Noise floor.
    pub noise_floor: f64,
    /// Ljung-Box p-value.
    pub whiteness_p: f64,
}

/// The judgement of a second run.
#[derive(Debug, Clone)]
pub struct Circle {
    /// Channels in the order of the questions.
    pub channels: Vec<Left>,
    /// What the search found beyond the model; `None` where no channel could be judged.
    pub diagnosis: Option<Diagnosis>,
}

impl Circle {
    /// Whether nothing is left: the search names nothing.
    #[must_use]
    pub fn closes(&self) -> bool {
        self.diagnosis.as_ref().is_some_and(|d| d.best.fit.placed.is_empty())
    }

    /// Identifiers of what is left, empty when the circle closes.
    #[must_use]
    pub fn left(&self) -> Vec<String> {
        self.diagnosis.as_ref().map(|d| d.best.ids()).unwrap_or_default()
    }
}

/// Judges a run that was simulated with `model`.
#[must_use]
pub fn circle(again: &Log, model: &Model) -> Circle {
    let mut context = model.context(again);
    settle(&mut context, model);
    tare(&mut context, model);
    let channels = context
        .targets
        .iter()
        .filter(|t| !t.relation.is_evidence())
        .filter_map(|target| {
            let prediction = model.predict_at_its_own_supply(&context, target.name)?;
            let residual: Vec<f64> = target.rows.iter().zip(&target.y).map(|(i, y)| y - prediction[*i]).collect();
            let t: Vec<f64> = target.rows.iter().map(|i| context.t[*i]).collect();
            let rms = (residual.iter().map(|r| r * r).sum::<f64>() / residual.len().max(1) as f64).sqrt();
            Some(Left {
                channel: target.name.to_owned(),
                unit: unit_of(target.name),
                samples: residual.len(),
                rms,
                noise_floor: target.noise.rms,
                whiteness_p: whiteness(&t, &residual),
            })
        })
        .collect();
    let diagnosis = diagnose(&context, Declared { model: Some(model) }, &mut |_| {});
    Circle { channels, diagnosis }
}

/// Leaves out the rows on which static relations make no claim, and the channels that no plant of this kind makes: vibration
/// and the differences between the speed sensors bear witness to a real rig only.
fn settle(context: &mut Context, model: &Model) {
    context.targets.retain(|t| !t.relation.is_evidence());
    let Some(settled) = settled(context, model) else { return };
    for target in context.targets.iter_mut().filter(|t| t.relation != Relation::Voltage) {
        let kept: Vec<usize> = (0..target.rows.len()).filter(|k| settled[target.rows[*k]]).collect();
        target.y = kept.iter().map(|k| target.y[*k]).collect();
        target.rows = kept.iter().map(|k| target.rows[*k]).collect();
    }
}

/// Takes the second run's own tare out of the load-cell channels.
fn tare(context: &mut Context, model: &Model) {
    for name in ["thrust_n", "torque_nm"] {
        let Some(prediction) = model.predict_at_its_own_supply(context, name) else { continue };
        let Some(target) = context.targets.iter_mut().find(|t| t.name == name) else { continue };
        let sum: f64 = target.rows.iter().zip(&target.y).map(|(i, y)| y - prediction[*i]).sum();
        let offset = sum / target.rows.len().max(1) as f64;
        target.y.iter_mut().for_each(|y| *y -= offset);
    }
}

/// For each row whether the command has stood for [`SETTLING_S`], a lag of the model's own speed has run out, and the rotor is
/// fast enough to be measured.
fn settled(context: &Context, model: &Model) -> Option<Vec<bool>> {
    let pulse = context.pulse.as_ref()?;
    let speed = context
        .with_relation(Relation::SpeedFromPulse)
        .find_map(|i| model.predict_at_its_own_supply(context, context.targets[i].name))?;
    let lags = model.effects.iter().map(|e| &e.placed).any(|p| {
        p.effect.about().depends_on.contains(&"time_since_step")
            && p.instance.channels.iter().any(|c| SPEED.contains(&c.as_str()))
    });
    let still = STILL * speed.iter().copied().fold(0.0, f64::max);
    let (mut last, mut last_slow, mut from) = (f64::NEG_INFINITY, f64::NEG_INFINITY, 0);
    let rows = 0..pulse.len();
    Some(
        rows.map(|i| {
            if i > 0 && (pulse[i] - pulse[i - 1]).abs() > 0.5 {
                last = context.t[i];
            }
            while context.t[i] - context.t[from] > SETTLING_S {
                from += 1;
            }
            let moves = lags && speed[from..=i].iter().any(|v| (v - speed[i]).abs() > still);
            if speed[i] > 0.0 && speed[i] < SLOWEST_RPM {
                last_slow = context.t[i];
            }
            context.t[i] - last > SETTLING_S && context.t[i] - last_slow > SLOW_MEMORY_S && !moves
        })
        .collect(),
    )
}
