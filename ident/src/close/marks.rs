//! What a board tells of the marks of its speed sensors.
//!
//! What it is: a sensor with two marks that do not stand opposite each other has periods that are long and short by turns. A board that times whole
//! revolutions reads the right speed all the same: no residual shows the fault, and the board's own account of the pattern
//! (`uneven_*_deg` in the log) does. It is named from there; no prediction changes.
//! What can go wrong: an error of one reading's pattern (a mark missed or seen twice) is no angle: medians are taken. A blade that twists
//! stands further off the faster it turns: the angle must be the same at low and at high speed. Few readings tell nothing.
//! Units: deg, deviation of the second mark from 180.
//! Reference: Beharie 2013, section 5.7.1 and Fig. 5.27; specification `rig.md`, "Four RPM capture channels".

use crate::channel::{Context, STANDSTILL};
use crate::effects::placed::Placed;
use crate::effects::tachometer::alternating_period::ANGLE;
use crate::effects::{self, Estimate, Instance};
use crate::log::Log;
use crate::log::board::UNEVEN;
use crate::model::Declared;
use crate::model::{AddedEffect, Model};
use crate::numeric::order::median;
use crate::verdict::TOLD_BY_THE_BOARD;
use crate::verdict::{EffectEntry, Kin, Kind, Verdict};

/// Angle, or change of it since the declared model's day, beyond which it is worth a name, deg: a magnet set by hand on the rim of a rotor of
/// 30 mm is off by a millimetre, which is 4 degrees.
const LEAST_DEG: f64 = 5.0;
/// Fewest readings at low and at high speed.
const FEWEST: usize = 20;
/// Least ratio of the high to the low speed: an angle that grows as the square of the speed, as a twist does, changes by two fifths there.
const APART: f64 = 1.3;
/// Largest difference between low and high speed, as a share of the angle: half of what such a twist shows; and what edges' own noise may make of
/// marks that stand as they should, deg.
const STEADY: (f64, f64) = (0.2, 1.0);
/// Probability of what the readings themselves show: no campaign has counted how often that is wrong.
pub(crate) const CERTAIN: f64 = 0.95;
/// Standard deviation, in digits, of what is rounded to whole ones: 1/sqrt(12).
const ROUNDED: f64 = 0.288_675;
/// Digit in which boards tell the angle, deg: 90 deg by a ten-thousandth of a period.
const DIGIT_DEG: f64 = 90.0 / 10_000.0;
/// Standard error of a median over that of a mean, of normal readings; and standard deviation over median absolute deviation.
const OF_A_MEDIAN: f64 = 1.2533 * 1.4826;

/// What the board tells of one channel, and no model said.
pub(crate) struct Told {
    /// The news, as an effect: the difference to what the declared model says.
    pub(crate) added: AddedEffect,
    /// Angle that the board sees, deg.
    seen: f64,
    /// Angle that the declared model says, deg.
    known: f64,
}

/// The marks that stand off their places as the declared model does not say.
pub(crate) fn told(log: &Log, context: &Context, declared: Declared<'_>) -> Vec<Told> {
    let offset = |(channel, column): &(&str, &str)| {
        let (seen, se) = angle(context, log.column(column)?)?;
        let known = known(declared, channel);
        context.target(channel)?;
        ((seen - known).abs() > LEAST_DEG).then(|| Told { added: added(channel, seen - known, se), seen, known })
    };
    UNEVEN.iter().filter_map(offset).collect()
}

/// The angle that a column tells, and its standard error; `None` where it is not the same at low and at high speed, or the run has not both.
fn angle(context: &Context, column: &[f64]) -> Option<(f64, f64)> {
    let turns = |i: &usize| column[*i].is_finite() && context.rpm.get(*i).is_some_and(|rpm| *rpm > STANDSTILL);
    let mut rows: Vec<usize> = (0..column.len()).filter(turns).collect();
    rows.sort_by(|a, b| context.rpm[*a].total_cmp(&context.rpm[*b]));
    let third = rows.len() / 3;
    if third < FEWEST {
        return None;
    }
    let of = |rows: &[usize], values: &[f64]| median(&mut rows.iter().map(|i| values[*i]).collect::<Vec<f64>>());
    let (slow, fast) = (&rows[..third], &rows[rows.len() - third..]);
    if of(fast, &context.rpm) < APART * of(slow, &context.rpm) {
        return None;
    }
    let (all, change) = (of(&rows, column), (of(fast, column) - of(slow, column)).abs());
    let spread = median(&mut rows.iter().map(|i| (column[*i] - all).abs()).collect::<Vec<f64>>());
    let se = (OF_A_MEDIAN * spread / (rows.len() as f64).sqrt()).hypot(ROUNDED * DIGIT_DEG).hypot(0.5 * change);
    (change < (STEADY.0 * all).max(STEADY.1)).then_some((all, se))
}

/// What a declared model says of a channel's marks, deg.
fn known(declared: Declared<'_>, channel: &str) -> f64 {
    let own = declared.model.into_iter().flat_map(Model::told_by_the_board);
    own.flat_map(|e| &e.amplitudes).filter(|(of, _)| of == channel).filter_map(|(_, values)| values.first()).sum()
}

fn added(channel: &str, angle: f64, se: f64) -> AddedEffect {
    let instance = Instance::new(&[channel], TOLD_BY_THE_BOARD);
    let placed = Placed { effect: &effects::tachometer::alternating_period::AlternatingPeriod, instance, shape: Vec::new() };
    let estimates = vec![Estimate { name: ANGLE.name.to_owned(), unit: ANGLE.unit.to_owned(), value: angle, se }];
    AddedEffect {
        placed,
        amplitudes: vec![(channel.to_owned(), vec![angle])],
        estimates,
        mean: Vec::new(),
        reach: Vec::new(),
        shape_errors: Vec::new(),
    }
}

/// Adds what the board tells to a verdict and to the model that it amounts to, beside what has no name.
pub(crate) fn tell(verdict: &mut Verdict, model: &mut Model, told: &[Told]) {
    if told.is_empty() {
        return;
    }
    model.effects.extend(told.iter().map(|one| one.added.clone()));
    stand(verdict, told.iter().map(entry).collect());
}

/// Puts names that the readings themselves show into a verdict.
pub(crate) fn stand(verdict: &mut Verdict, entries: Vec<EffectEntry>) {
    if matches!(verdict.verdict, Kind::None | Kind::Unattributed) {
        verdict.verdict = Kind::Attributed;
    }
    // the other hypotheses hold what is told as well
    for other in &mut verdict.alternatives {
        other.probability *= CERTAIN;
        other.ids.extend(entries.iter().map(|e| e.id.clone()));
    }
    // what has no name stays last
    let names = verdict.effects.iter().take_while(|e| e.id != "unknown").count();
    verdict.effects.splice(names..names, entries);
}

fn entry(told: &Told) -> EffectEntry {
    let Told { added, .. } = told;
    let about = added.placed.effect.about();
    let channel = added.placed.instance.channels.first().map_or("", String::as_str);
    EffectEntry {
        kin: Kin::Own,
        id: added.placed.effect.id().to_owned(),
        scope: added.placed.effect.scope(&added.placed.instance),
        run: None,
        channels: added.placed.instance.channels.clone(),
        depends_on: about.depends_on.iter().map(|v| (*v).to_owned()).collect(),
        equation: format!("{} [{TOLD_BY_THE_BOARD}]", about.equation),
        probability: CERTAIN,
        parameters: added.estimates.iter().map(|e| crate::effects::reported::parameter(e, &[], channel)).collect(),
        heldout_error_reduction: 0.0,
        evidence: words(told),
    }
}

/// What the board tells, for people.
fn words(told: &Told) -> String {
    let (channel, seen) = (told.added.placed.instance.channels.join(", "), told.seen);
    let news = if told.known == 0.0 {
        format!("the board sees the periods of {channel} long and short by turns at all speeds, as of marks {seen:.1} deg off")
    } else {
        format!("the board sees the marks of {channel} {seen:.1} deg off at all speeds, where the model says {:.1}", told.known)
    };
    format!("{news}; timed over whole revolutions the speed is right")
}
