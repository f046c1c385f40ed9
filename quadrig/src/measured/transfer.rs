//! What a corrected model is worth on a run that took no part in it.
//!
//! What it is: of every two runs of one rig, the declared and the corrected model of the first predict each channel of the second as
//! `quadrig predict` writes it; one constant a channel (the tare) is taken off both. Which names of the first the second names too.
//! What can go wrong: a rig with one run gives nothing; a channel that the first run's model does not know is no prediction.
//! Units: errors in the channel's unit; factors 1.
//! Reference: specification `closing-the-loop.md`, "Real measurements".

use super::Recorded;
use ident::channel::Context;
use ident::close::Closed;
use ident::log::{Log, MODELLED};
use ident::model::Model;

/// Noise floors above which a declared model's error is there to be removed (specification, "What counts as proof").
pub(crate) const LOUD: f64 = 3.0;
/// Share by which an error may grow before the channel counts as worse (as above).
pub(crate) const WORSE: f64 = 0.05;

/// One channel of one run, predicted by the models of another.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Prediction {
    /// Run of the models.
    pub(crate) from: String,
    /// Run that is predicted.
    pub(crate) on: String,
    /// Channel.
    pub(crate) channel: &'static str,
    /// Noise floor of the channel on the run that is predicted.
    pub(crate) floor: f64,
    /// Error of the declared model.
    pub(crate) before: f64,
    /// Error of the corrected one.
    pub(crate) after: f64,
}

impl Prediction {
    /// Whether the declared model leaves more than noise.
    pub(crate) fn is_loud(&self) -> bool {
        self.before > LOUD * self.floor
    }

    /// How many times smaller the error is after than before. Below a floor nothing is left to gain.
    pub(crate) fn factor(&self) -> f64 {
        self.before.max(self.floor) / self.after.max(self.floor)
    }

    /// Whether the corrected model is the worse one.
    pub(crate) fn is_worse(&self) -> bool {
        self.after > (1.0 + WORSE) * self.before
    }

    /// Whether nothing but noise is left.
    pub(crate) fn is_quiet_after(&self) -> bool {
        self.after <= LOUD * self.floor
    }
}

/// Every prediction of a set, and how its names come back.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Transfer {
    /// Rigs with two runs or more.
    pub(crate) rigs: usize,
    /// Predictions of a channel on another run.
    pub(crate) predictions: Vec<Prediction>,
    /// Names of a run that another run of its rig has too, and all of them.
    pub(crate) names: (usize, usize),
}

impl Transfer {
    /// Whether no rig has a second run.
    pub(crate) fn is_empty(&self) -> bool {
        self.rigs == 0
    }

    /// The predictions where the declared model leaves more than noise.
    pub(crate) fn loud(&self) -> impl Iterator<Item = &Prediction> + Clone {
        self.predictions.iter().filter(|p| p.is_loud())
    }

    /// Geometric mean of the factors where the declared model leaves more than noise; not a number where it nowhere does.
    pub(crate) fn factor(&self) -> f64 {
        let (sum, n) = self.loud().fold((0.0, 0.0), |(s, n), p| (s + p.factor().ln(), n + 1.0));
        f64::exp(sum / n)
    }

    /// Both together.
    pub(crate) fn and(mut self, other: &Self) -> Self {
        self.rigs += other.rigs;
        self.predictions.extend(other.predictions.iter().cloned());
        self.names.0 += other.names.0;
        self.names.1 += other.names.1;
        self
    }
}

/// Every run of a set on the other runs of its rig.
pub(crate) fn of(runs: &[Recorded], progress: &mut dyn FnMut(f64)) -> Transfer {
    let mut out = Transfer::default();
    let mut rigs: Vec<&str> = Vec::new();
    for (done, run) in runs.iter().enumerate() {
        progress(done as f64 / runs.len() as f64);
        let Ok(closed) = &run.closed else { continue };
        for other in runs.iter().filter(|o| o.rig == run.rig && o.name != run.name) {
            let (Ok(there), Some(log)) = (&other.closed, &other.log) else { continue };
            if !rigs.contains(&run.rig.as_str()) {
                rigs.push(&run.rig);
            }
            out.predictions.extend(predicted(closed, log).into_iter().map(|p| Prediction {
                from: run.name.clone(),
                on: other.name.clone(),
                ..p
            }));
            let (back, all) = names(closed, there);
            out.names.0 += back;
            out.names.1 += all;
        }
    }
    out.rigs = rigs.len();
    out
}

/// Each channel of a log by the models of another run.
fn predicted(closed: &Closed, log: &Log) -> Vec<Prediction> {
    predicted_by([&closed.declared, &closed.model], log)
}

/// The same by a declared and a corrected model.
pub(crate) fn predicted_by(models: [&Model; 2], log: &Log) -> Vec<Prediction> {
    let [as_read, context] = models.map(|model| model.context(log));
    let [declared, corrected] = models.map(|model| model.on(log));
    let of_channel = |channel: &'static str| {
        let before = error(&declared, &as_read, channel)?;
        let after = error(&corrected, &context, channel)?;
        let floor = context.targets[context.target(channel)?].noise.rms;
        Some(Prediction { from: String::new(), on: String::new(), channel, floor, before, after })
    };
    MODELLED.into_iter().filter_map(of_channel).collect()
}

/// Error of a channel about its mean, on the rows of which the model claims something.
fn error(model: &Model, context: &Context, channel: &'static str) -> Option<f64> {
    let prediction = model.predict(context, channel)?;
    let target = &context.targets[context.target(channel)?];
    let claimed = target.rows.iter().zip(&target.y).filter(|(row, _)| target.claims(**row));
    scatter(&claimed.map(|(row, y)| y - prediction[*row]).collect::<Vec<f64>>())
}

/// Root mean square about the mean; nothing without samples.
fn scatter(residual: &[f64]) -> Option<f64> {
    let n = residual.len() as f64;
    let own = residual.iter().sum::<f64>() / n;
    let rms = (residual.iter().map(|r| (r - own).powi(2)).sum::<f64>() / n).sqrt();
    rms.is_finite().then_some(rms)
}

/// How many names of a verdict another verdict has too, and how many there are. What stays without a name is none.
fn names(here: &Closed, there: &Closed) -> (usize, usize) {
    let of = |c: &Closed| -> Vec<String> {
        let mut ids: Vec<String> = c.verdict.effects.iter().map(|e| e.id.clone()).filter(|id| id != "unknown").collect();
        ids.sort_unstable();
        ids.dedup();
        ids
    };
    let (here, there) = (of(here), of(there));
    (here.iter().filter(|id| there.contains(id)).count(), here.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn prediction(before: f64, after: f64) -> Prediction {
        Prediction { from: "a".into(), on: "b".into(), channel: "thrust_n", floor: 0.01, before, after }
    }

    #[test]
    fn only_what_is_above_three_floors_counts_in_the_factor() {
        let predictions = vec![prediction(0.08, 0.02), prediction(0.09, 0.01), prediction(0.02, 0.2)];
        let transfer = Transfer { rigs: 1, predictions, names: (1, 2) };
        assert!((transfer.factor() - 6.0).abs() < 1e-12, "{}", transfer.factor());
        assert_eq!(transfer.predictions.iter().filter(|p| p.is_worse()).count(), 1);
        let both = transfer.clone().and(&transfer);
        assert_eq!((both.rigs, both.predictions.len(), both.names), (2, 6, (2, 4)));
    }

    #[test]
    fn an_error_below_the_floor_is_no_gain() {
        assert!((prediction(0.05, 0.000_1).factor() - 5.0).abs() < 1e-12);
        assert!(Transfer::default().factor().is_nan());
    }

    #[test]
    fn the_tare_is_taken_off() {
        assert_eq!(scatter(&[5.0, 7.0]), Some(1.0));
        assert_eq!(scatter(&[]), None);
    }
}
