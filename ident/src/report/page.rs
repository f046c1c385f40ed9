//! The page of a rig's closed loop.
//!
//! What it is: the traces of a rig's channels before and after, and without each effect, handed to the page that every closed loop has; then
//! the speed channels together, and the folds.
//! What can go wrong: nothing; figures of channels that the log lacks are left out.
//! Units: on the axes.
//! Reference: specification `closing-the-loop.md`, step 8.

use super::closed::{
    self as parts, ALONE, Origin, Page, Reading, Trace, Vocabulary, against, enlarged, lifted, moves, over_time, pair, thinned,
    two_ways,
};
use super::designer::designer;
use super::figure::{Figure, Layer};
use super::run;
use super::sheet::Sheet;
use crate::channel::{Context, DIFFERENCES, Target, unit_of};
use crate::close::Closed;
use crate::effects::unknown::variable;
use crate::fit::heldout::residuals;
use crate::fit::{Rows, fit};
use crate::identify::identify;
use crate::log::{Log, SPEED};
use crate::model::Declared;
use crate::model::Model;
use crate::numeric::order::median;
use crate::several::Shown;
use crate::verdict::words::{self, channel, heading};
use crate::verdict::{EffectEntry, Unexplained, Verdict};

/// The report of a closed loop as one self-contained page.
#[must_use]
pub fn closed_loop(log: &Log, closed: &Closed, origin: Origin) -> String {
    let v = &closed.verdict;
    let page = Page {
        verdict: v,
        words: Vocabulary::RIG,
        news: closed.context.against_model,
        origin,
        declared: declared(closed),
        hero: hero(log, closed),
        cards: cards(log, closed),
        left: left(closed),
        readings: readings_apart(&closed.context, v, ""),
        parameters: Vec::new(),
        speeds: (SPEEDS, speeds(log, closed)),
    };
    let mut sheet = parts::begin(&page);
    sheet.fold("Every channel in figures", |sheet| sheet.figures(every_channel(closed)));
    identified(&mut sheet, log, closed);
    parts::candidates(&mut sheet, &closed.diagnosis);
    parts::aside(&mut sheet, v);
    sheet.html()
}

fn declared(closed: &Closed) -> String {
    let what = if closed.context.against_model {
        "Before: the declared model as it stands."
    } else {
        "Before: the declared baseline, static curves alone: speed over the pulse, thrust, torque and current over the speed, a constant voltage."
    };
    match pair(&closed.verdict)[1] {
        "" => format!("{what} Nothing was added to it."),
        _ => format!("{what} After: the same with every effect of the cards above."),
    }
}

/// The residual of a target under a model as the verdict judges it, on the rows of which it claims something: a declared model that knows its
/// own supply does not follow a voltage that this run's effects explain.
fn residual(context: &Context, target: &Target, model: &Model) -> Option<Vec<f64>> {
    let p = model.predict_at_its_own_supply(context, target.name)?;
    Some(claimed(target).map(|k| target.y[k] - p[target.rows[k]]).collect())
}

/// Places in `target.rows` that count.
fn claimed(target: &Target) -> impl Iterator<Item = usize> + '_ {
    (0..target.rows.len()).filter(|k| target.claims(target.rows[*k]))
}

/// Values of the rows that count.
fn of_rows(target: &Target, values: &[f64]) -> Vec<f64> {
    claimed(target).map(|k| values[target.rows[k]]).collect()
}

fn target<'c>(closed: &'c Closed, name: &str) -> Option<&'c Target> {
    let name = name.strip_suffix(" - others").map_or(name, |c| DIFFERENCES.iter().find(|d| d.0 == c).map_or(c, |d| d.1));
    closed.context.targets.iter().find(|t| t.name == name)
}

/// What is left of a channel before and after; nothing of one that no model predicts.
fn trace(closed: &Closed, target: &Target) -> Option<Trace> {
    if closed.verdict.channels.not_predicted.contains_key(target.name) {
        return None;
    }
    let context = &closed.context;
    let said =
        DIFFERENCES.iter().find(|d| d.1 == target.name).map_or_else(|| target.name.to_owned(), |d| format!("{} - others", d.0));
    Some(Trace {
        channel: said,
        unit: unit_of(target.name).to_owned(),
        floor: target.noise.rms,
        time_label: time_label(context),
        t: of_rows(target, &context.t),
        before: residual(context, target, &closed.declared)?,
        after: residual(context, target, &closed.model)?,
    })
}

/// The figure that convinces most; of names that the readings themselves show those readings.
fn hero(log: &Log, closed: &Closed) -> Vec<Figure> {
    let mut named = closed.verdict.effects.iter().filter(|e| e.id != "unknown").peekable();
    if let Some(first) = named.peek().copied()
        && named.all(EffectEntry::is_read_off)
    {
        return readings(log, first, "read");
    }
    let targets = closed.context.targets.iter().filter(|t| !t.relation.is_evidence());
    let traces: Vec<Trace> = targets.filter_map(|t| trace(closed, t)).collect();
    let most = parts::most(&closed.verdict, Vocabulary::RIG, &traces);
    if !most.is_empty() {
        return most;
    }
    let beside = closed.verdict.effects.iter().find_map(|e| trace(closed, beside_others(closed, e)?));
    beside.map(|trace| parts::shown_most(&trace, pair(&closed.verdict))).unwrap_or_default()
}

/// What the sensor of an effect reads beyond the others, where its own channel does not show the effect.
fn beside_others<'c>(closed: &'c Closed, e: &EffectEntry) -> Option<&'c Target> {
    let unseen = 1.0 - e.heldout_error_reduction > 1.0 / parts::SEEN;
    target(closed, &format!("{} - others", e.channels.first()?)).filter(|_| unseen)
}

/// Rows before and after whose median a single reading is held against.
const BESIDE: usize = 2;

/// The readings of a run about which nothing is claimed, on the channels that the verdict names for it; `run` is its name among several.
pub(super) fn readings_apart(context: &Context, v: &Verdict, run: &str) -> Vec<Reading> {
    let told = |e: &&EffectEntry| e.is_of_single_readings() && e.run.as_deref().is_none_or(|of| of == run);
    let named: Vec<&String> = v.effects.iter().filter(told).flat_map(|e| &e.channels).collect();
    let of_target = |target: &Target| -> Vec<Reading> {
        let of = |row: &usize| {
            let k = target.rows.iter().position(|r| r == row)?;
            let around = target.y.get(k.saturating_sub(BESIDE)..(k + BESIDE + 1).min(target.y.len()))?;
            Some(Reading {
                run: run.to_owned(),
                channel: target.name.to_owned(),
                t: context.t[*row],
                is_row: context.time_is_row,
                value: target.y[k],
                expected: median(&mut around.to_vec()),
                unit: unit_of(target.name),
            })
        };
        target.unclaimed.iter().filter_map(of).collect()
    };
    context.targets.iter().filter(|t| named.iter().any(|name| *name == t.name)).flat_map(of_target).collect()
}

/// What an effect's channels read at each command, the levels included that nothing is predicted of.
fn readings(log: &Log, e: &EffectEntry, id: &str) -> Vec<Figure> {
    let Some(pulse) = log.column("pulse_us") else { return Vec::new() };
    let figure = |name: &String| {
        let y = log.column(name)?.to_vec();
        Some(thinned(Figure {
            id: format!("{id}-{}", parts::slug(name)),
            title: format!("{} as measured, against the command", heading(name)),
            x_label: axis("pulse_us"),
            y_label: axis(name),
            layers: vec![Layer::Dots { name: "measured".to_owned(), class: "a", x: pulse.to_vec(), y }],
            height: 280.0,
            ..Figure::default()
        }))
    };
    e.channels.iter().filter_map(figure).collect()
}

/// What is left of one of several runs, predicted by a fit to the others.
fn across(shown: &Shown) -> Trace {
    Trace {
        channel: shown.channel.to_owned(),
        unit: unit_of(shown.channel).to_owned(),
        floor: shown.floor,
        time_label: over(shown.timeless),
        t: shown.t.clone(),
        before: shown.before.clone(),
        after: shown.after.clone(),
    }
}

/// The figure that convinces most of several runs.
pub(super) fn over_runs(verdict: &Verdict, shown: &Shown) -> Vec<Figure> {
    let (trace, names) = (across(shown), pair(verdict));
    std::iter::once(over_time(&trace, "most", names)).chain(enlarged(&trace, "most", names)).collect()
}

/// The figure of an effect that several runs share, on one of them.
pub(super) fn card_across(closed: &Closed, e: &EffectEntry, shown: &Shown, id: &str) -> Option<Figure> {
    Some(drawn(closed, e, target(closed, shown.channel)?, &across(shown), id))
}

/// The figure of what one of several runs has alone: what is left when it is taken out of the model, one constant apart.
pub(super) fn card_alone(closed: &Closed, e: &EffectEntry, id: &str) -> Option<Figure> {
    let position = closed.model.effects.iter().rposition(|added| added.placed.is_told_by(e))?;
    let target = target(closed, e.channels.first()?)?;
    let whole = trace(closed, target)?;
    let mut without = taken_out(closed, target, position)?;
    let more: Vec<f64> = without.iter().zip(&whole.after).map(|(w, a)| w - a).filter(|d| d.is_finite()).collect();
    let mean = more.iter().sum::<f64>() / more.len().max(1) as f64;
    without.iter_mut().for_each(|w| *w -= mean);
    Some(drawn(closed, e, target, &whole.with_before(without), id))
}

/// Figures of each effect: what its first channel leaves over without it and with it; of what whole levels show their readings.
fn cards(log: &Log, closed: &Closed) -> Vec<Vec<Figure>> {
    let mut used = vec![false; closed.model.effects.len()];
    closed
        .verdict
        .effects
        .iter()
        .enumerate()
        .map(|(k, e)| {
            let id = format!("effect-{}", k + 1);
            let same = |i: &usize| !used[*i] && closed.model.effects[*i].placed.is_told_by(e);
            match (0..used.len()).find(same) {
                Some(i) => {
                    used[i] = true;
                    card(closed, e, i, &id).unwrap_or_default()
                }
                None if e.is_read_off() && !e.is_of_single_readings() => readings(log, e, &id),
                None => Vec::new(),
            }
        })
        .collect()
}

fn card(closed: &Closed, e: &EffectEntry, position: usize, id: &str) -> Option<Vec<Figure>> {
    let target = beside_others(closed, e).or_else(|| target(closed, e.channels.first()?))?;
    let whole = trace(closed, target)?;
    let trace = whole.with_before(without(closed, target, position)?);
    (trace.before != trace.after).then(|| vec![drawn(closed, e, target, &trace, id)])
}

/// What is left of a channel without an effect and with it, over what the effect goes with.
fn drawn(closed: &Closed, e: &EffectEntry, target: &Target, trace: &Trace, id: &str) -> Figure {
    let context = &closed.context;
    // a sum of means tells nothing of what scatters
    if let Some(figure) = scattered(context, e, target, trace, id) {
        return figure;
    }
    if e.depends_on.iter().any(|v| v == "torque_nm")
        && target.name != "torque_nm"
        && let Some(x) = torque_beyond(closed, target).filter(|x| moves(x))
    {
        return against(trace, id, ("torque beyond its curve", unit_of("torque_nm")), &x, ALONE);
    }
    if e.depends_on.iter().any(|v| v == "direction") && moves(&context.rpm) {
        let up = upwards(&context.rpm);
        let up: Vec<bool> = claimed(target).map(|k| up[target.rows[k]]).collect();
        return two_ways(trace, id, &words::axis("rpm"), &of_rows(target, &context.rpm), &up);
    }
    let of_steps = e.depends_on.iter().any(|v| ["time_since_step", "rpm_rate"].contains(&v.as_str()));
    let over = if of_steps {
        None
    } else {
        let x = |name: &str| match (name, e.parameter("tau")) {
            ("heat", Some(tau)) => Some(of_rows(target, &heat(context, tau.value))),
            _ => values(context, target, name),
        };
        e.depends_on.iter().find_map(|name| Some((name, x(name).filter(|x| moves(x))?)))
    };
    match over {
        Some((name, x)) => against(trace, id, (name, unit_of_variable(name)), &x, ALONE),
        None => match enlarged(trace, id, ALONE).filter(|_| of_steps) {
            Some(figure) => figure,
            None => over_time(trace, id, ALONE),
        },
    }
}

/// The figure of an effect that makes a channel scatter about a speed; nothing of any other.
fn scattered(context: &Context, e: &EffectEntry, target: &Target, trace: &Trace, id: &str) -> Option<Figure> {
    let size = e.parameter("scatter")?.value;
    let (natural, damping) = (e.parameter("natural_frequency")?.value, e.parameter("damping_ratio")?.value);
    if context.rpm.is_empty() || !moves(&context.rpm) {
        return None;
    }
    let turns = if e.equation.ends_with("[blade_pass]") { 2.0 } else { 1.0 };
    let peak = 1.0 / (2.0 * damping * (1.0 - damping * damping).sqrt());
    let answers = |rpm: f64| {
        let r2 = (rpm / 60.0 * turns / natural).powi(2);
        r2 / ((1.0 - r2).powi(2) + 4.0 * damping * damping * r2).sqrt() / peak
    };
    let told = |rpm: f64| trace.floor.hypot(size * answers(rpm));
    Some(parts::scatter(trace, id, &words::axis("rpm"), &of_rows(target, &context.rpm), &told))
}

/// What the torque is beyond its own curve over the speed, on the rows of another channel that count: the thrust's own curve takes the rest.
fn torque_beyond(closed: &Closed, of: &Target) -> Option<Vec<f64>> {
    let torque = target(closed, "torque_nm")?;
    let beyond = residual(&closed.context, torque, &closed.declared)?;
    let mut all = vec![f64::NAN; closed.context.len()];
    claimed(torque).zip(beyond).for_each(|(k, left)| all[torque.rows[k]] = left);
    Some(of_rows(of, &all))
}

/// What is left of a target without one of the effects. Where nothing was declared all others are fitted again, as they would be by who does not
/// know of it.
fn without(closed: &Closed, target: &Target, position: usize) -> Option<Vec<f64>> {
    let context = &closed.context;
    let mut others = closed.diagnosis.best.fit.placed.clone();
    if context.against_model || position >= others.len() {
        return taken_out(closed, target, position);
    }
    others.remove(position);
    let fit = fit(context, Declared::default(), &others, None, Rows::All)?;
    Some(of_samples(target, &residuals(context, Declared::default(), &fit)[context.target(target.name)?]))
}

/// The same with everything else as the model has it.
fn taken_out(closed: &Closed, target: &Target, position: usize) -> Option<Vec<f64>> {
    let mut model = closed.model.clone();
    model.effects.remove(position);
    residual(&closed.context, target, &model)
}

/// Of one value a sample those of the rows that count.
fn of_samples(target: &Target, values: &[f64]) -> Vec<f64> {
    claimed(target).map(|k| values[k]).collect()
}

/// Share of the top speed by which the speed must turn back until it counts as the other way.
const TURN: f64 = 0.02;

/// Whether each row is on the way up: the speed is above where it last turned.
fn upwards(rpm: &[f64]) -> Vec<bool> {
    let turn = TURN * rpm.iter().copied().filter(|v| v.is_finite()).fold(0.0, f64::max);
    let (mut up, mut end) = (true, rpm.first().copied().unwrap_or(0.0));
    let of = |v: &f64| {
        let further = if up { *v >= end } else { *v <= end };
        if further || (*v - end).abs() > turn {
            (up, end) = (*v > end || (up && further), *v);
        }
        up
    };
    rpm.iter().map(of).collect()
}

/// What a load leaves behind as heat: the square of the current, or of a speed's cube where no current was measured, through a lag, from cold;
/// as a share of the most.
fn heat(context: &Context, tau: f64) -> Vec<f64> {
    let load: Vec<f64> = context.current.clone().unwrap_or_else(|| context.rpm.iter().map(|n| n.powi(3)).collect());
    let (mut now, mut out) = (0.0, Vec::with_capacity(context.len()));
    for i in 0..context.len().min(load.len()) {
        if i > 0 {
            let keeps = (-(context.t[i] - context.t[i - 1]) / tau).exp();
            now = keeps * now + (1.0 - keeps) * load[i - 1] * load[i - 1];
        }
        out.push(now);
    }
    let most = out.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    out.into_iter().map(|heat| heat / most).collect()
}

/// Unit of a variable: of a column its own, of what adds up over a run that of the sum.
fn unit_of_variable(name: &str) -> &'static str {
    if name == "charge" { "Ah" } else { unit_of(name) }
}

/// A variable on the rows that count; time has a figure of its own kind.
fn values(context: &Context, target: &Target, name: &str) -> Option<Vec<f64>> {
    match name {
        "t_s" | "row" => None,
        "reading" => Some(claimed(target).map(|k| target.y[k]).collect()),
        "torque_nm" => context.torque.as_ref().map(|v| of_rows(target, v)),
        _ => variable(context, name).map(|v| of_rows(target, &v)),
    }
}

/// Of a channel on which something is left: over the variable that it goes with, else over time.
pub(super) fn rest(closed: &Closed, u: &Unexplained) -> Option<Figure> {
    let target = target(closed, &u.channel)?;
    Some(over_what(closed, u, target, &trace(closed, target)?))
}

/// The same of one of several runs, predicted by a fit to the others.
pub(super) fn left_across(closed: &Closed, u: &Unexplained, shown: &Shown) -> Option<Figure> {
    Some(over_what(closed, u, target(closed, shown.channel)?, &across(shown)))
}

fn over_what(closed: &Closed, u: &Unexplained, target: &Target, trace: &Trace) -> Figure {
    let over = u.depends_on.iter().find_map(|name| Some((name, values(&closed.context, target, name).filter(|x| moves(x))?)));
    match over {
        Some((name, x)) => against(trace, "left", (name, unit_of_variable(name)), &x, pair(&closed.verdict)),
        None => over_time(trace, "left", pair(&closed.verdict)),
    }
}

/// Figures of what is left.
fn left(closed: &Closed) -> Vec<Figure> {
    let with_model = |u: &&Unexplained| !closed.verdict.channels.not_predicted.contains_key(&u.channel);
    let loudest = parts::loudest(&closed.verdict);
    // the loudest has its figure where it is told, also where it is one of several that are drawn together
    let own = |u: &&Unexplained| !is_drawn_together(closed, u) || loudest.is_some_and(|l| l == *u);
    closed.verdict.unexplained.iter().filter(own).filter(with_model).filter_map(|u| rest(closed, u)).collect()
}

/// Whether a channel is one of several speed sensors, which have their figures together.
pub(super) fn is_drawn_together(closed: &Closed, u: &Unexplained) -> bool {
    let several = SPEED.iter().filter(|c| target(closed, c).is_some()).count() > 1;
    several && SPEED.contains(&u.channel.trim_end_matches(" - others"))
}

/// Residual, and measured beside predicted, of every channel.
fn every_channel(closed: &Closed) -> Vec<Figure> {
    let context = &closed.context;
    let mut out = Vec::new();
    for target in context.targets.iter().filter(|t| !t.relation.is_evidence()) {
        let Some(trace) = trace(closed, target) else { continue };
        out.push(over_time(&trace, "every", pair(&closed.verdict)));
        let measured: Vec<f64> = claimed(target).map(|k| target.y[k]).collect();
        let predicted = |left: &[f64]| -> Vec<f64> { measured.iter().zip(left).map(|(m, r)| m - r).collect() };
        let line = |name: &str, class, y: Vec<f64>| {
            let (x, y) = lifted(&trace.t, &y);
            Layer::Line { name: name.to_owned(), class, x, y }
        };
        let after = pair(&closed.verdict)[1].trim_end_matches(", after");
        out.push(thinned(Figure {
            id: format!("measured-{}", parts::slug(target.name)),
            title: format!("{} as measured and as predicted", heading(target.name)),
            x_label: trace.time_label.clone(),
            y_label: axis(target.name),
            layers: [line("measured", "d", measured.clone()), line("declared", "b", predicted(&trace.before))]
                .into_iter()
                .chain((!after.is_empty()).then(|| line(after, "a", predicted(&trace.after))))
                .collect(),
            height: 280.0,
            ..Figure::default()
        }));
    }
    out
}

/// Heading of the speed sensors' figures.
pub(super) const SPEEDS: &str = "Speed sensors";

/// All speed channels in one figure, what is left of them in a second, and what each reads beyond the others beneath; none where there is
/// one sensor.
pub(super) fn speeds(log: &Log, closed: &Closed) -> Vec<Figure> {
    let Some(together) = run::overlaid(log) else { return Vec::new() };
    let mut figures = vec![thinned(together)];
    for (id, title, of_contrast) in [
        ("speeds-left", "Speed left over after, every sensor", false),
        ("speed-contrasts", "What each speed sensor reads beyond the others", true),
    ] {
        let layer = |(name, class): (&str, &'static str)| {
            let asked = if of_contrast { format!("{name} - others") } else { name.to_owned() };
            let trace = trace(closed, target(closed, &asked)?)?;
            let (name, x, y) = (channel(name), trace.t, trace.after);
            Some(if of_contrast { Layer::Dots { name, class, x, y } } else { Layer::Line { name, class, x, y } })
        };
        let present = SPEED.into_iter().filter(|c| log.column(c).is_some());
        let mut layers: Vec<Layer> = present.zip(run::CLASSES).filter_map(layer).collect();
        if layers.is_empty() {
            continue;
        }
        let beyond = pinned(&mut layers);
        let title = match beyond {
            0 => title.to_owned(),
            n => format!("{title} ({n} readings lie beyond the edges)"),
        };
        figures.push(thinned(Figure {
            id: id.into(),
            title,
            x_label: time_label(&closed.context),
            y_label: "rev/min".into(),
            layers,
            ..Figure::default()
        }));
    }
    figures
}

/// Share of the dots that decides how far the axis goes, and the room beside them.
const MOST_DOTS: f64 = 0.98;
const ROOM: f64 = 2.0;

/// Puts the few dots that lie far out onto the edges, so that they flatten no others; how many.
fn pinned(layers: &mut [Layer]) -> usize {
    let of_dots = |layer: &Layer| if let Layer::Dots { y, .. } = layer { y.clone() } else { Vec::new() };
    let mut sizes: Vec<f64> = layers.iter().flat_map(of_dots).filter(|v| v.is_finite()).map(f64::abs).collect();
    sizes.sort_unstable_by(f64::total_cmp);
    let Some(edge) = sizes.get((MOST_DOTS * sizes.len() as f64) as usize).map(|v| ROOM * v).filter(|v| *v > 0.0) else {
        return 0;
    };
    for layer in layers {
        if let Layer::Dots { y, .. } = layer {
            y.iter_mut().for_each(|v| *v = v.clamp(-edge, edge));
        }
    }
    sizes.iter().filter(|v| **v > edge).count()
}

/// Plateaus, fits and constants, as `identify` has them.
fn identified(sheet: &mut Sheet, log: &Log, closed: &Closed) {
    let v = &closed.verdict;
    let Ok(mut found) = identify(log) else { return };
    // the card of the rotor's lag has its time constants, beside everything else that was found
    if v.effects.iter().any(|e| e.id == "spinup_lag") {
        found.constants.retain(|c| !c.name.starts_with("tau_"));
    }
    sheet.fold("Plateaus, fits and constants", |sheet| {
        run::constants(sheet, &found);
        sheet.figures(found.curves.iter().map(run::relation).map(thinned).collect());
        run::coefficients(sheet, &found);
        run::plateaus(sheet, log, &found);
        if let Some(said) = closed.model.said_of_the_supply() {
            sheet.say(&said);
        }
    });
    sheet.fold("Power, efficiency, coefficients", |sheet| designer(sheet, &found, thinned));
}

fn time_label(context: &Context) -> String {
    over(context.time_is_row)
}

/// Label of an axis of time, of a log without one too.
fn over(timeless: bool) -> String {
    if timeless { "row" } else { "time, s" }.to_owned()
}

/// Label of an axis under a title that names the channel: its unit.
fn axis(name: &str) -> String {
    let unit = unit_of(name);
    if unit.is_empty() { channel(name) } else { unit.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::close::close;
    use crate::log::Column;

    /// A staircase on a supply behind a lead of so many ohms: the speed follows the voltage.
    fn run(lead: f64) -> Log {
        let t: Vec<f64> = (0..1000).map(|i| 0.1 * f64::from(i)).collect();
        let pulse: Vec<f64> = (0..1000).map(|i| 1100.0 + 80.0 * f64::from(i / 100)).collect();
        let wave = |i: usize, k: f64| (k * (i * i) as f64).sin();
        let free: Vec<f64> = pulse.iter().map(|p| 7.0 * (p - 1000.0)).collect();
        let current: Vec<f64> = free.iter().map(|r| 3e-11 * r.powi(3)).collect();
        let voltage: Vec<f64> = current.iter().map(|a| 12.0 - lead * a).collect();
        let rpm: Vec<f64> = free.iter().zip(&voltage).map(|(r, v)| r * (v / 12.0).powf(0.8)).collect();
        let thrust = rpm.iter().map(|r| 1e-7 * r * r).collect();
        let columns = [
            ("pulse_us", pulse, 0.0),
            ("rpm", rpm, 4.0),
            ("thrust_n", thrust, 0.01),
            ("current_a", current, 0.02),
            ("voltage_v", voltage, 0.005),
        ];
        let noisy = |(k, (name, values, size)): (usize, (&str, Vec<f64>, f64))| Column {
            name: name.to_owned(),
            values: values.into_iter().enumerate().map(|(i, v)| v + size * wave(i, 0.7 + k as f64)).collect(),
        };
        Log { name: "run.csv".into(), t, columns: columns.into_iter().enumerate().map(noisy).collect(), ..Log::default() }
    }

    /// The thrust's own curve takes what the torque does along its curve: a figure against the torque has the rest of it.
    #[test]
    fn torque_is_drawn_beyond_its_curve() {
        let mut log = run(0.0);
        let rpm = log.column("rpm").expect("a speed").to_vec();
        let sway = |i: usize| 2e-3 * (0.05 * i as f64).sin();
        let values: Vec<f64> = rpm.iter().enumerate().map(|(i, r)| 2e-9 * r * r + sway(i)).collect();
        let most = values.iter().copied().fold(0.0, f64::max);
        log.columns.push(Column { name: "torque_nm".into(), values });
        let closed = close(&log, None, &[], &mut |_| {}).expect("a log");
        let thrust = target(&closed, "thrust_n").expect("a thrust");
        let beyond = torque_beyond(&closed, thrust).expect("a torque");
        let largest = beyond.iter().filter(|v| v.is_finite()).fold(0.0, |most: f64, v| most.max(v.abs()));
        assert!(beyond.len() == claimed(thrust).count() && largest < 0.2 * most && largest > 1e-3, "{largest} of {most}");
    }

    #[test]
    fn a_speed_that_turns_is_on_the_other_way() {
        let speeds = [0.0, 1000.0, 2000.0, 1990.0, 2010.0, 4000.0, 3000.0, 3010.0, 2000.0, 0.0, 500.0];
        let up = [true, true, true, true, true, true, false, false, false, false, true];
        assert_eq!(upwards(&speeds), up);
    }

    /// A staircase upwards: the heat rises, and never beyond the most.
    #[test]
    fn heat_rises_under_load_and_falls_without() {
        let context = Context::new(&run(0.05), None);
        let heat = heat(&context, 5.0);
        assert!(heat.len() == context.len() && heat[0] == 0.0 && heat.iter().all(|h| (0.0..=1.0).contains(h)));
        assert!(heat[999] > 0.9 && heat[500] < heat[700], "{} {}", heat[500], heat[999]);
    }

    /// A declared model that knows its own supply must not be drawn as if it knew the lead that is new.
    #[test]
    fn what_is_drawn_is_what_the_verdict_judges() {
        let healthy = close(&run(0.0), None, &[], &mut |_| {}).expect("a log").model;
        let thin = close(&run(0.08), Some(&healthy), &[], &mut |_| {}).expect("a log");
        let rms = |r: &[f64]| (r.iter().map(|v| v * v).sum::<f64>() / r.len() as f64).sqrt();
        for name in ["rpm", "voltage_v"] {
            let told = &thin.verdict.channels[name];
            let drawn = trace(&thin, target(&thin, name).expect(name)).expect(name);
            for (what, drawn, told) in [("before", &drawn.before, told.before.rms), ("after", &drawn.after, told.after.rms)] {
                assert!((rms(drawn) / told - 1.0).abs() < 0.1, "{name} {what}: {} drawn, {told} told", rms(drawn));
            }
            assert!(told.before.rms > 3.0 * told.after.rms, "{name}: {told:?}");
        }
    }
}
