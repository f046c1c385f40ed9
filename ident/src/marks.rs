//! What a board tells of the marks of its speed sensors.
//!
//! What it is: a sensor with two marks that do not stand opposite each other has periods that are long and short by turns. A board that times whole
//! revolutions reads the right speed all the same: no residual shows the fault, and the board's own account of the pattern
//! (`uneven_*_deg` in the log) does. It is named from there; no prediction changes.
//! What can go wrong: an error of one reading's pattern (a mark missed or seen twice) is no angle: medians are taken. A blade that twists
//! stands further off the faster it turns: the angle must be the same at low and at high speed. Few readings tell nothing.
//! Units: deg, deviation of the second mark from 180.
//! Reference: Beharie 2013, section 5.7.1 and Fig. 5.27; specification `rig.md`, "Four RPM capture channels".

use crate::context::{Context, STANDSTILL};
use crate::effects::alternating_period::{ANGLE, TOLD_BY_THE_BOARD};
use crate::effects::{self, Estimate, Instance};
use crate::hypothesis::{Declared, Placed};
use crate::log::Log;
use crate::model::AddedEffect;
use crate::noise::median;
use crate::verdict::{EffectEntry, Kind, Verdict};

/// Speed channels and the columns in which their board tells how far their two marks stand off their opposite places.
pub(crate) const UNEVEN: [(&str, &str); 4] = [
    ("rpm_beam", "uneven_beam_deg"),
    ("rpm_opto", "uneven_opto_deg"),
    ("rpm_hall", "uneven_hall_deg"),
    ("rpm_encoder", "uneven_encoder_deg"),
];

/// Smallest angle, or change of it since the declared model's day, that is worth a name, deg: marks are set by hand to a few degrees.
const LEAST_DEG: f64 = 5.0;
/// Fewest readings at low and at high speed.
const FEWEST: usize = 20;
/// Largest difference between low and high speed, as a share of the angle.
const STEADY: f64 = 0.2;
/// Probability of what a board tells at all speeds: no campaign has counted how often that is wrong.
const CERTAIN: f64 = 0.95;
/// Standard error of one reading that a board rounds to a ten-thousandth of a period, deg.
const ROUNDING_DEG: f64 = 0.009 * 0.2887;
/// Standard error of a median over that of a mean, of normal readings; and standard deviation over median absolute deviation.
const OF_A_MEDIAN: f64 = 1.2533 * 1.4826;

/// Whether a column tells of marks: it explains no residual.
pub(crate) fn is_of_marks(column: &str) -> bool {
    UNEVEN.iter().any(|(_, name)| *name == column)
}

/// The marks that stand off their places as the declared model does not say.
pub(crate) fn told(log: &Log, context: &Context, declared: Declared<'_>) -> Vec<AddedEffect> {
    let offset = |(channel, column): &(&str, &str)| {
        let (angle, se) = angle(context, log.column(column)?)?;
        let news = angle - known(declared, channel);
        context.target(channel)?;
        (news.abs() > LEAST_DEG).then(|| added(channel, news, se))
    };
    UNEVEN.iter().filter_map(offset).collect()
}

/// The angle that a column tells, and its standard error; `None` where it is not the same at low and at high speed.
fn angle(context: &Context, column: &[f64]) -> Option<(f64, f64)> {
    let turns = |i: &usize| column[*i].is_finite() && context.rpm.get(*i).is_some_and(|rpm| *rpm > STANDSTILL);
    let mut rows: Vec<usize> = (0..column.len()).filter(turns).collect();
    rows.sort_by(|a, b| context.rpm[*a].total_cmp(&context.rpm[*b]));
    let third = rows.len() / 3;
    if third < FEWEST {
        return None;
    }
    let of = |rows: &[usize]| median(&mut rows.iter().map(|i| column[*i]).collect::<Vec<f64>>());
    let (slow, fast, all) = (of(&rows[..third]), of(&rows[rows.len() - third..]), of(&rows));
    let spread = median(&mut rows.iter().map(|i| (column[*i] - all).abs()).collect::<Vec<f64>>());
    ((fast - slow).abs() < STEADY * all).then_some((all, (OF_A_MEDIAN * spread / (rows.len() as f64).sqrt()).hypot(ROUNDING_DEG)))
}

/// What a declared model says of a channel's marks, deg.
fn known(declared: Declared<'_>, channel: &str) -> f64 {
    let own = declared.model.iter().flat_map(|m| &m.effects).filter(|e| e.placed.instance.form == TOLD_BY_THE_BOARD);
    own.flat_map(|e| &e.amplitudes).filter(|(of, _)| of == channel).filter_map(|(_, values)| values.first()).sum()
}

fn added(channel: &str, angle: f64, se: f64) -> AddedEffect {
    let instance = Instance::new(&[channel], TOLD_BY_THE_BOARD);
    let placed = Placed { effect: &effects::alternating_period::AlternatingPeriod, instance, shape: Vec::new() };
    let estimates = vec![Estimate { name: ANGLE.name.to_owned(), unit: ANGLE.unit.to_owned(), value: angle, se }];
    AddedEffect { placed, amplitudes: vec![(channel.to_owned(), vec![angle])], estimates }
}

/// Adds what the board tells to a verdict. One without a name has one entry only, which then speaks of the marks as well.
pub(crate) fn tell(verdict: &mut Verdict, told: &[AddedEffect], mut probability: f64) {
    if told.is_empty() {
        return;
    }
    if let (Kind::Unattributed, Some(unknown)) = (verdict.verdict, verdict.effects.first_mut()) {
        unknown.evidence =
            told.iter().fold(std::mem::take(&mut unknown.evidence), |text, added| format!("{text}; {}", words(added)));
        return;
    }
    if verdict.verdict == Kind::None {
        (verdict.verdict, probability) = (Kind::Attributed, 1.0);
    }
    probability *= CERTAIN;
    verdict.effects.extend(told.iter().map(entry));
    // each entry has the probability of the whole
    verdict.effects.iter_mut().for_each(|e| e.probability = probability);
}

fn entry(added: &AddedEffect) -> EffectEntry {
    let about = added.placed.effect.about();
    EffectEntry {
        id: added.placed.effect.id().to_owned(),
        channels: added.placed.instance.channels.clone(),
        depends_on: about.depends_on.iter().map(|v| (*v).to_owned()).collect(),
        equation: format!("{} [{TOLD_BY_THE_BOARD}]", about.equation),
        probability: CERTAIN,
        parameters: added.estimates.iter().map(|e| crate::close::parameter(e, &[])).collect(),
        heldout_error_reduction: 0.0,
        evidence: words(added),
    }
}

/// What the board tells, for people.
fn words(added: &AddedEffect) -> String {
    let channel = added.placed.instance.channels.join(", ");
    let angle = added.estimates.first().map_or(f64::NAN, |e| e.value);
    format!(
        "the board sees the periods of {channel} long and short by turns at all speeds, as of marks {angle:.1} deg off; timed over whole revolutions the speed is right"
    )
}
