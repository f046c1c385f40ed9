//! One measured channel as a target: its samples, their variances, and what is claimed of them.
//!
//! What it is: a column of a log beside what it is predicted from. Bridged regressors stand on every row; a target keeps its own samples only.
//! What can go wrong: a channel without a sample, or with nothing to be predicted from, is no target.
//! Units: those of the channel.
//! Reference: specification `formats.md` (primary relations), `closing-the-loop.md` step 2.

use super::{Context, DIFFERENCES, Relation, states};
use crate::log::{Log, SPEED};
use crate::numeric::solve::Normal;
use crate::signal::noise::{self, Noise};
use crate::signal::stretches::FEWEST_OF_A_KIND;

/// One measured channel as a target.
#[derive(Debug, Clone)]
pub struct Target {
    /// Column name.
    pub name: &'static str,
    /// What it is predicted from.
    pub relation: Relation,
    /// Rows that hold a sample.
    pub rows: Vec<usize>,
    /// The samples, one for each of `rows`.
    pub y: Vec<f64>,
    /// Noise as the data show it inside steady stretches.
    pub noise: Noise,
    /// Share of this target in a joint likelihood: four speed channels see one rotor.
    pub weight: f64,
    /// For each sample its variance for the weights of the least squares (see [`Noise::weight_variance`]).
    pub levelled: Vec<f64>,
    /// For each sample its variance in the likelihood of the scatter.
    pub floored: Vec<f64>,
    /// Rows about which no prediction makes a claim, in order: the channel's glitches. The log alone decides which.
    pub unclaimed: Vec<usize>,
    /// Rows whose samples were set aside as bad ones (see [`crate::signal::bad`]), in order.
    pub aside: Vec<usize>,
    /// Rows at which nothing is predicted, in order; they are no samples here. Of a speed those of a rotor that is told to turn and does not yet: it is
    /// taken as it was read. Of a load those on which nobody read the speed that makes it, while the rotor went from one to another.
    pub given: Vec<usize>,
    /// Error that a declared model is known to make, on every row of the log; empty without one.
    pub known: Vec<f64>,
    /// Share of the noise in the scatter that it is known to leave about that, on every row of the log; empty without one.
    pub trust: Vec<f64>,
    /// Root mean square about the curve where the load was held on the day of a declared model; 0 without one.
    pub usual: f64,
    /// For each sample whether the load has just jumped; empty where too few have, or too few have not, to tell the two apart.
    pub unsettled: Vec<bool>,
}

/// Share of the mean variance in the weights of the least squares: a stretch with little noise must not outvote the others
/// where a polynomial misfits.
const LEVELLED: f64 = 0.5;
/// Share of the mean variance in the likelihood: enough to keep a standing rotor's silence from counting without bound.
const FLOORED: f64 = 0.05;

/// Times what a channel scattered on the day of a declared model from which on it is noisier than days differ: 2.6 times is seen where gusts
/// are taken for noise on one day and for the rotor's way on another.
pub(crate) const NOISIER: f64 = 4.0;

/// Samples beyond the degree of a polynomial that a fit needs: one for the constant, three to tell its noise.
pub(super) const FEWEST_BEYOND: usize = 4;
impl Target {
    fn new(context: &Context, name: &'static str, relation: Relation, rows: Vec<usize>, y: Vec<f64>, noise: Noise) -> Self {
        let speed = |i: &usize| if context.rpm.is_empty() { 0.0 } else { context.rpm[*i] };
        let levelled = rows.iter().map(|i| noise.weight_variance(speed(i), LEVELLED)).collect();
        let floored = rows.iter().map(|i| noise.weight_variance(speed(i), FLOORED)).collect();
        let mut calm = vec![false; context.t.len()];
        context.calm.iter().for_each(|(a, b)| calm[*a..*b].fill(true));
        // no curve of a driven motor holds for speed, torque and current of a rotor whose motor is off and that still turns
        let driven = matches!(relation, Relation::SpeedFromPulse | Relation::Torque | Relation::Current);
        let mut unsettled: Vec<bool> = rows.iter().map(|i| !calm[*i] || driven && context.runs_down(*i)).collect();
        let jumps = unsettled.iter().filter(|u| **u).count();
        if jumps < FEWEST_OF_A_KIND || unsettled.len() - jumps < FEWEST_OF_A_KIND.max(unsettled.len() / 4) {
            unsettled.clear();
        }
        Self {
            name,
            relation,
            rows,
            y,
            noise,
            weight: 1.0,
            levelled,
            floored,
            unclaimed: Vec::new(),
            aside: Vec::new(),
            given: Vec::new(),
            known: Vec::new(),
            trust: Vec::new(),
            usual: 0.0,
            unsettled,
        }
    }

    /// Whether predictions of a row are to be judged.
    #[must_use]
    pub fn claims(&self, row: usize) -> bool {
        [&self.unclaimed, &self.aside, &self.given].iter().all(|rows| rows.binary_search(&row).is_err())
    }

    /// A residual in the measure in which it is news: against a declared model less where that is known to be rough.
    #[must_use]
    pub fn news(&self, row: usize, residual: f64) -> f64 {
        residual * self.trust.get(row).copied().unwrap_or(1.0)
    }

    /// A residual against the declared model as it stands: what is known of its error belongs to it.
    #[must_use]
    pub fn as_it_stands(&self, row: usize, residual: f64) -> f64 {
        residual + self.known.get(row).copied().unwrap_or(0.0)
    }

    /// How many times what it scattered on the day of a declared model the channel does now, where that is more than days differ.
    #[must_use]
    pub fn noisier(&self) -> Option<f64> {
        let times = if self.usual > 0.0 { self.noise.rms / self.usual } else { 0.0 };
        (times > NOISIER).then_some(times)
    }

    /// The least scale of the variances that a fit may have: a tenth of the noise's standard deviation; what a declared model leaves over
    /// does not shrink because a run happens to agree with it.
    pub(crate) fn least_scale(&self) -> f64 {
        if self.trust.is_empty() { 0.01 } else { 1.0 }
    }

    /// Widens the variance of the samples whose speed was bridged by what the speed's own makes of it.
    fn allow_for_speed(&mut self, context: &Context) {
        let x = |row: usize| context.rpm[row] / 1000.0;
        let points = self.rows.iter().zip(&self.y).map(|(i, v)| (x(*i), *v, 1.0));
        let Some(fit) = Normal::of_polynomial(self.relation.degree(), points).solve() else { return };
        let slope = |x: f64| {
            let terms = fit.coefficients.iter().enumerate().skip(1);
            terms.map(|(k, c)| k as f64 * c * x.powi(k as i32 - 1)).sum::<f64>()
        };
        let of_speed = |row: usize| (slope(x(row)) * context.rpm_sd[row] / 1000.0).powi(2);
        for variances in [&mut self.levelled, &mut self.floored] {
            variances.iter_mut().zip(&self.rows).for_each(|(v, row)| *v += of_speed(*row));
        }
    }

    /// Takes the noise of single rows for samples that are means of `sizes[row]` rows each.
    pub(crate) fn weigh(&mut self, noise: Noise, rpm: &[f64], sizes: &[f64]) {
        let variance = |i: &usize, share| noise.weight_variance(rpm.get(*i).copied().unwrap_or(0.0), share) / sizes[*i];
        self.levelled = self.rows.iter().map(|i| variance(i, LEVELLED)).collect();
        self.floored = self.rows.iter().map(|i| variance(i, FLOORED)).collect();
        self.noise = noise;
    }
}

/// A channel less its declared polynomial in the measured speed; others as they are.
fn less_speed(context: &Context, relation: Relation, rows: &[usize], y: &[f64]) -> Vec<f64> {
    let follows = matches!(relation, Relation::Thrust | Relation::Torque | Relation::Current);
    if !follows || context.rpm.is_empty() {
        return y.to_vec();
    }
    let x = |row: usize| context.rpm[row] / 1000.0;
    let points = rows.iter().zip(y).map(|(i, v)| (x(*i), *v, 1.0));
    let Some(solution) = Normal::of_polynomial(relation.degree(), points).solve() else { return y.to_vec() };
    let fitted = |x: f64| solution.coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c);
    rows.iter().zip(y).map(|(i, v)| v - fitted(x(*i))).collect()
}

/// All targets of a log.
pub(super) fn all(log: &Log, context: &Context) -> Vec<Target> {
    Context::declared_names(log).into_iter().filter_map(|name| context.declared(log, name)).collect()
}

/// A channel as a target, of the rows that count.
pub(super) fn of(log: &Log, context: &Context, name: &'static str, counts: &dyn Fn(usize) -> bool) -> Option<Target> {
    let column = log.column(name)?;
    let relation = Relation::of(name, context.pulse.is_some())?;
    let needs_rpm = relation.is_of_speed();
    if needs_rpm && context.rpm.is_empty() {
        return None;
    }
    let given = states::given(context, relation);
    let judged = |i: &usize| column[*i].is_finite() && counts(*i) && given.binary_search(i).is_err();
    let rows: Vec<usize> = (0..column.len()).filter(judged).collect();
    if rows.is_empty() {
        return None;
    }
    let y: Vec<f64> = rows.iter().map(|i| column[*i]).collect();
    let noise = noise::estimate(&rows, &y, &less_speed(context, relation, &rows, &y), &context.rpm, context.stretches());
    let speeds = SPEED.into_iter().filter(|s| log.column(s).is_some()).count().max(1);
    let weight = if matches!(relation, Relation::SpeedFromPulse | Relation::SpeedAlone) { 1.0 / speeds as f64 } else { 1.0 };
    let mut target = Target { weight, given, ..Target::new(context, name, relation, rows, y, noise) };
    if needs_rpm && !context.rpm_sd.is_empty() {
        target.allow_for_speed(context);
    }
    Some(target)
}

/// Speed channels that can be compared with the consensus: what all of them share (supply, load, lag) drops out. With fewer than
/// three channels nobody can be outvoted, and there are none.
pub(super) fn differing(log: &Log) -> Vec<&'static str> {
    let measured = |channel: &str| log.column(channel).is_some_and(|c| c.iter().any(|v| v.is_finite()));
    let present: Vec<&'static str> =
        DIFFERENCES.into_iter().filter(|(c, _)| log.column(c).is_some()).map(|(_, name)| name).collect();
    if DIFFERENCES.iter().filter(|(c, _)| measured(c)).count() < 3 { Vec::new() } else { present }
}

/// One speed channel less the consensus.
pub(super) fn difference(context: &Context, name: &'static str, column: &[f64]) -> Option<Target> {
    let rows: Vec<usize> = (0..column.len()).filter(|i| column[*i].is_finite()).collect();
    let y: Vec<f64> = rows.iter().map(|i| column[*i] - context.rpm[*i]).collect();
    let noise = noise::estimate(&rows, &y, &y, &context.rpm, context.stretches());
    let target = Target::new(context, name, Relation::SpeedDifference, rows, y, noise);
    (target.rows.len() > 8).then_some(target)
}
