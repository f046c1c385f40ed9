//! Which causes a sensor's residual has.
//!
//! What it is: causes join one at a time; each must predict left-out stretches better than without it, by more than the attitude is
//! in doubt, and a rigid cause (a few constants) goes before a flexible one (a curve) that explains hardly more. Once all have
//! joined, each is asked again beside the others.
//! What can go wrong: a motion that shows nothing lets no cause join; two causes that predict alike are both reported, with their
//! probabilities.
//! Units: evidence in nats.
//! Reference: specification `closing-the-loop.md`, step 6.

use super::Recording;
use super::account::by_axis;
use super::least::{Column, Readings, Solved, Term};
use crate::verdict::Parameter;
use nalgebra::{Matrix3, Vector3};

/// What causes are made from.
#[derive(Clone, Copy)]
pub(crate) struct Scene<'a> {
    pub(crate) recording: &'a Recording,
    /// Body to earth.
    pub(crate) to_earth: &'a [Matrix3<f64>],
    /// What the declared model predicts of the sensor, body axes.
    pub(crate) predicted: &'a [Vector3<f64>],
    /// Rate of change of the rate, rad/s^2; empty where no cause asks.
    pub(crate) turning: &'a [Vector3<f64>],
    /// Times at which the sensor was heard first and last, s.
    pub(crate) heard: (f64, f64),
}

/// Parameters from coefficients and their standard errors.
pub(crate) type Summary<'a> = Box<dyn Fn(&[f64], &[f64]) -> Vec<Parameter> + 'a>;

/// A cause with its shape fixed: linear in its terms.
pub(crate) struct Instance<'a> {
    pub(crate) id: &'static str,
    pub(crate) depends_on: Vec<&'static str>,
    pub(crate) equation: &'static str,
    pub(crate) terms: Vec<Term<'a>>,
    /// Name and unit of its shape parameter.
    pub(crate) shape: Option<(&'static str, &'static str, f64)>,
    /// A curve rather than a few constants.
    pub(crate) flexible: bool,
    /// Where the coefficients themselves are not what a reader wants.
    pub(crate) summary: Option<Summary<'a>>,
}

/// A known cause.
pub(crate) trait Cause {
    /// Its name in the verdict.
    fn id(&self) -> &'static str;
    /// Shapes to try; not a number for a cause without shape. Empty where the log cannot hold it.
    fn shapes(&self, scene: &Scene<'_>) -> Vec<f64>;
    /// Resolution to which the best shape is refined; 0 for none.
    fn resolution(&self) -> f64 {
        0.0
    }
    /// With a shape.
    fn instance<'a>(&self, scene: &Scene<'a>, shape: f64) -> Instance<'a>;
    /// Whether it may end within the log; its shape is an instant then.
    fn may_end(&self) -> bool {
        false
    }
    /// Whether the log can tell a span from other causes.
    fn can_be_told(&self, _: &Scene<'_>, _: Span) -> bool {
        true
    }
    /// From one instant to another; not a number for one that lies outside the log.
    fn lasting<'a>(&self, scene: &Scene<'a>, [from, _]: Span) -> Instance<'a> {
        self.instance(scene, from)
    }
}

/// A shape, and behind it the end of a cause that ends; not a number where there is none.
pub(crate) type Span = [f64; 2];

/// A cause that was found.
pub(crate) struct Found<'a> {
    pub(crate) instance: Instance<'a>,
    /// When it ends; not a number where it does not.
    pub(crate) until: f64,
    /// 95 % intervals of the shape and of the end.
    pub(crate) shape_ci: [[f64; 2]; 2],
    /// 1 - (held-out error with all)/(without this one).
    pub(crate) reduction: f64,
    /// The same of each axis.
    pub(crate) by_axis: [f64; 3],
    /// Coefficients of the declared model and of the other causes when it is left out, in their order.
    pub(crate) without: Vec<f64>,
}

/// What came of a search.
pub(crate) struct Outcome<'a> {
    pub(crate) found: Vec<Found<'a>>,
    /// The declared model.
    pub(crate) before: Solved,
    /// With everything that was found; base terms first, then each cause's in order.
    pub(crate) after: Solved,
    pub(crate) probability: f64,
    /// Others for the last cause, or for none.
    pub(crate) alternatives: Vec<(Vec<&'static str>, f64)>,
}

/// Evidence that a cause needs, nats: a thousand to one after a dozen were asked.
pub(super) const NAMED: f64 = 9.0;
/// Share of the held-out sum of squares that it must take away.
const LEAST_GAIN: f64 = 0.05;
/// A rigid cause with this share of a flexible one's evidence goes first.
const RIGID_FIRST: f64 = 0.6;
/// Evidence that an instant of setting in needs, nats.
const SHAPE: f64 = 5.0;
/// Residual over noise and doubt below which nothing is asked.
const THERE: f64 = 1.25;
/// Causes beside each other.
const MOST: usize = 3;

/// Shapes that were tried, each with what it leaves.
type Scan = Vec<(Span, f64)>;

struct Try<'a> {
    instance: Instance<'a>,
    span: Span,
    columns: Vec<Column>,
    solved: Solved,
    scanned: Scan,
    evidence: f64,
    gain: f64,
}

/// Share by which the error of an axis may grow.
const WORSE: f64 = 0.02;

/// Which axes are predicted worse after than before.
pub(crate) fn spoils(before: &[f64], after: &[f64]) -> [bool; 3] {
    let (before, after) = (by_axis(before), by_axis(after));
    std::array::from_fn(|k| after[k] > (1.0 + WORSE) * before[k])
}

/// 1 - (error with)/(without) of each axis.
pub(crate) fn reductions(without: &[f64], with: &[f64]) -> [f64; 3] {
    let (without, with) = (by_axis(without), by_axis(with));
    std::array::from_fn(|k| 1.0 - with[k] / without[k].max(1e-300))
}

/// The axes, the one that gains most first.
pub(crate) fn descending(by_axis: [f64; 3]) -> [usize; 3] {
    let mut axes = [0, 1, 2];
    axes.sort_by(|a, b| by_axis[*b].total_cmp(&by_axis[*a]));
    axes
}

/// Searches; `noise` is a block's own standard deviation, `doubt` what the attitude's error makes of it.
pub(crate) fn search<'a>(
    readings: &Readings,
    base: &[Term<'a>],
    causes: &[Box<dyn Cause>],
    scene: &Scene<'a>,
    noise: f64,
    doubt: f64,
) -> Option<Outcome<'a>> {
    let base: Vec<Column> = base.iter().map(|t| readings.column(t)).collect();
    let before = readings.solve(&base.iter().collect::<Vec<_>>(), noise)?;
    let slack = before.heldout.len() as f64 * doubt * doubt;
    let mut chosen: Vec<Try<'a>> = Vec::new();
    let mut rivals: Vec<(Vec<&'static str>, f64)> = Vec::new();
    let mut shapes: Vec<(&'static str, Scan)> = Vec::new();
    // below noise and doubt there is nothing to explain
    let nothing = THERE * THERE * before.heldout.len() as f64 * (noise * noise + doubt * doubt);
    while chosen.len() < MOST {
        let curve = chosen.iter().any(|c| c.instance.flexible);
        let fixed: Vec<&Column> = base.iter().chain(chosen.iter().flat_map(|c| &c.columns)).collect();
        let now = Readings::square(chosen.last().map_or(&before, |c| &c.solved).heldout.as_slice());
        if now <= nothing {
            break;
        }
        let mut tries: Vec<Try<'a>> = causes
            .iter()
            .filter(|c| chosen.iter().all(|k| k.instance.id != c.id()))
            .filter_map(|c| {
                // beside a curve with its hundreds of columns a shape stays as it was found before
                let known = shapes.iter().rev().find(|s| s.0 == c.id()).filter(|_| curve).map(|s| s.1.clone());
                attempt(readings, &fixed, c.as_ref(), known, scene, noise, (now, slack))
            })
            .collect();
        shapes.extend(tries.iter().map(|t| (t.instance.id, t.scanned.clone())));
        tries.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
        let Some(top) = tries.first().map(|t| t.evidence) else { break };
        let rigid = tries.iter().position(|t| !t.instance.flexible && t.evidence >= RIGID_FIRST * top && named(t));
        let best = rigid.unwrap_or(0);
        if !named(&tries[best]) {
            if chosen.is_empty() {
                rivals = tries.iter().map(|t| (vec![t.instance.id], t.evidence)).collect();
            }
            break;
        }
        let kept: Vec<&'static str> = chosen.iter().map(|c| c.instance.id).collect();
        let won = tries.remove(best);
        let bonus = won.evidence.max(top);
        rivals = tries
            .iter()
            .map(|t| (kept.iter().copied().chain([t.instance.id]).collect(), t.evidence - bonus))
            .chain([(kept.clone(), -won.evidence)])
            .filter(|(ids, _): &(Vec<_>, f64)| !ids.is_empty())
            .collect();
        chosen.push(won);
    }
    prune(readings, &base, &mut chosen, noise, slack);
    drop_open(readings, &base, &mut chosen, noise);
    Some(conclude(readings, &base, chosen, before, rivals, noise))
}

fn named(t: &Try<'_>) -> bool {
    t.evidence >= NAMED && t.gain >= LEAST_GAIN
}

/// Evidence of a fall of the held-out sum of squares.
pub(crate) fn evidence(looks: f64, before: f64, after: f64, slack: f64) -> f64 {
    0.5 * looks * ((before + slack).max(1e-300) / (after + slack).max(1e-300)).ln()
}

/// How many numbers of a span lie within the log.
fn numbers(span: &Span) -> usize {
    span.iter().filter(|v| v.is_finite()).count()
}

/// The best of the spans with the fewest numbers: one more is believed where what is left says so.
fn plainest(scanned: &Scan, gain: &dyn Fn(f64, f64) -> f64) -> Option<Span> {
    let best = |count: usize| scanned.iter().filter(|s| numbers(&s.0) == count).min_by(|a, b| a.1.total_cmp(&b.1));
    (0..=2).filter_map(best).copied().reduce(|few, more| if gain(few.1, more.1) < SHAPE { few } else { more }).map(|s| s.0)
}

/// Every how many of the instants at which a cause may have begun one is tried with an end, at first: pairs of them all would be a thousand fits.
const COARSE: usize = 4;

/// Tries shapes, and finer ones about the best; of a cause that may end both numbers in turn.
fn scan(cause: &dyn Cause, scene: &Scene<'_>, left: &dyn Fn(Span) -> f64) -> Scan {
    let shapes = cause.shapes(scene);
    if shapes.len() < 2 {
        return shapes.into_iter().map(|s| ([s, f64::NAN], 0.0)).collect();
    }
    let step = shapes.windows(2).map(|w| w[1] - w[0]).filter(|d| d.is_finite()).fold(0.0, f64::max);
    let told = |span: &Span| cause.can_be_told(scene, *span);
    let spans = shapes.iter().map(|s| [*s, f64::NAN]).filter(told);
    let mut out: Scan = spans.map(|span| (span, left(span))).collect();
    refine(cause, scene, &mut out, step, left);
    if cause.may_end() {
        let instants: Vec<f64> = shapes.iter().filter(|s| s.is_finite()).step_by(COARSE).copied().collect();
        let begins = std::iter::once(f64::NAN).chain(instants.iter().copied());
        let spans =
            begins.flat_map(|from| instants.iter().filter(move |until| from.is_nan() || **until > from).map(move |u| [from, *u]));
        let mut ending: Scan = spans.filter(told).map(|span| (span, left(span))).collect();
        refine(cause, scene, &mut ending, COARSE as f64 * step, left);
        out.extend(ending);
    }
    out
}

/// Finer shapes about the best, down to the cause's resolution, and then outward from it for its interval.
fn refine(cause: &dyn Cause, scene: &Scene<'_>, scanned: &mut Scan, mut step: f64, left: &dyn Fn(Span) -> f64) {
    let fits = |span: &Span| {
        let inside = |v: &f64| !v.is_finite() || *v > scene.heard.0 && *v < scene.heard.1;
        span.iter().all(inside) && (numbers(span) < 2 || span[0] < span[1]) && cause.can_be_told(scene, *span)
    };
    let about = |scanned: &mut Scan, steps: &[f64]| {
        for which in 0..2 {
            let Some(best) = scanned.iter().min_by(|a, b| a.1.total_cmp(&b.1)).map(|s| s.0) else { return };
            let moved = |by: &f64| {
                let mut span = best;
                span[which] += by;
                span
            };
            let spans: Vec<Span> = steps.iter().map(moved).filter(|s| s[which].is_finite() && fits(s)).collect();
            scanned.extend(spans.into_iter().map(|span| (span, left(span))));
        }
    };
    while cause.resolution() > 0.0 && step > cause.resolution() {
        step /= 4.0;
        about(scanned, &[-3.0, -2.0, -1.0, 1.0, 2.0, 3.0].map(|k| k * step));
    }
    let ends = scanned.iter().min_by(|a, b| a.1.total_cmp(&b.1)).is_some_and(|s| s.0[1].is_finite());
    if ends {
        about(scanned, &OUTWARD.map(|k| k * step));
    }
}

/// Steps from the best span outward, between which the end of an interval lies.
const OUTWARD: [f64; 14] = [-64.0, -32.0, -16.0, -8.0, -4.0, -2.0, -1.0, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0];

fn attempt<'a>(
    readings: &Readings,
    fixed: &[&Column],
    cause: &dyn Cause,
    known: Option<Scan>,
    scene: &Scene<'a>,
    noise: f64,
    (now, slack): (f64, f64),
) -> Option<Try<'a>> {
    let columns = |span: Span| -> Vec<Column> { cause.lasting(scene, span).terms.iter().map(|t| readings.column(t)).collect() };
    let left = |span: Span| -> f64 {
        let own = columns(span);
        readings.quick(&fixed.iter().copied().chain(&own).collect::<Vec<_>>(), noise)
    };
    let mut scanned = known.unwrap_or_else(|| scan(cause, scene, &left));
    let span = plainest(&scanned, &|a, b| evidence(readings.looks(), a, b, slack))?;
    let instance = cause.lasting(scene, span);
    let own = columns(span);
    let all: Vec<&Column> = fixed.iter().copied().chain(&own).collect();
    let solved = readings.solve(&all, noise)?;
    let after = Readings::square(&solved.heldout);
    let evidence = evidence(readings.looks(), now, after, slack);
    scanned.sort_by(|a, b| a.0[0].total_cmp(&b.0[0]).then(a.0[1].total_cmp(&b.0[1])));
    Some(Try { instance, span, columns: own, solved, scanned, evidence, gain: 1.0 - after / now.max(1e-300) })
}

/// Drops what the others have made superfluous.
fn prune(readings: &Readings, base: &[Column], chosen: &mut Vec<Try<'_>>, noise: f64, slack: f64) {
    let mut k = 0;
    while chosen.len() > 1 && k < chosen.len() {
        let Some(full) = chosen.last().map(|c| Readings::square(&c.solved.heldout)) else { return };
        let others = || chosen.iter().enumerate().filter(|(i, _)| *i != k).flat_map(|(_, c)| &c.columns);
        let Some(without) = readings.solve(&base.iter().chain(others()).collect::<Vec<_>>(), noise) else { return };
        let left = Readings::square(&without.heldout);
        let lost = evidence(readings.looks(), left, full, slack);
        if lost < NAMED || 1.0 - full / left < LEAST_GAIN {
            chosen.remove(k);
            if let Some(last) = chosen.last_mut() {
                last.solved = without;
            }
            k = 0;
        } else {
            k += 1;
        }
    }
}

/// Drops a cause of a few constants each of which may be nothing, one after the other.
fn drop_open(readings: &Readings, base: &[Column], chosen: &mut Vec<Try<'_>>, noise: f64) {
    loop {
        let Some(solved) = chosen.last().map(|c| &c.solved) else { return };
        let mut at = base.len();
        let open = chosen.iter().position(|c| {
            let own = at..at + c.columns.len();
            at = own.end;
            !c.instance.flexible && own.into_iter().all(|i| solved.coefficients[i].abs() < 1.96 * solved.sigma[i])
        });
        let Some(k) = open else { return };
        chosen.remove(k);
        let columns = base.iter().chain(chosen.iter().flat_map(|c| &c.columns)).collect::<Vec<_>>();
        let Some(without) = readings.solve(&columns, noise) else { return };
        if let Some(last) = chosen.last_mut() {
            last.solved = without;
        }
    }
}

fn conclude<'a>(
    readings: &Readings,
    base: &[Column],
    chosen: Vec<Try<'a>>,
    before: Solved,
    rivals: Vec<(Vec<&'static str>, f64)>,
    noise: f64,
) -> Outcome<'a> {
    let after = chosen.last().map_or_else(|| before.clone(), |c| c.solved.clone());
    let full = Readings::square(&after.heldout);
    let looks = readings.looks();
    let weights: f64 = rivals.iter().map(|(_, e)| e.min(0.0).exp()).sum();
    let probability = if chosen.is_empty() { 0.0 } else { 1.0 / (1.0 + weights) };
    let alternatives = rivals.into_iter().map(|(ids, e)| (ids, e.min(0.0).exp() / (1.0 + weights))).collect();
    let count = chosen.len();
    let mut found = Vec::with_capacity(count);
    let lost: Vec<Option<Solved>> = (0..count)
        .map(|k| {
            let others = chosen.iter().enumerate().filter(|(i, _)| *i != k).flat_map(|(_, c)| &c.columns);
            readings.solve(&base.iter().chain(others).collect::<Vec<_>>(), noise)
        })
        .collect();
    for (t, lost) in chosen.into_iter().zip(lost) {
        let (lost, without) = lost.map_or_else(|| (after.heldout.clone(), Vec::new()), |s| (s.heldout, s.coefficients));
        let left = Readings::square(&lost);
        // of those that have as many numbers as the one that was chosen
        let least = t.scanned.iter().filter(|s| numbers(&s.0) == numbers(&t.span)).map(|s| s.1).fold(f64::INFINITY, f64::min);
        let near = |left: f64| 0.5 * looks * (left / least.max(1e-300)).ln() < 1.92;
        found.push(Found {
            instance: t.instance,
            until: t.span[1],
            shape_ci: [0, 1].map(|which| bracket(&t.scanned, t.span, which, near)),
            reduction: 1.0 - (full / left.max(1e-300)).sqrt(),
            by_axis: reductions(&lost, &after.heldout),
            without,
        });
    }
    Outcome { found, before, after, probability, alternatives }
}

/// From the last shape below those that explain nearly as well as the best to the first above them, with the other number of the span as it is: the
/// truth lies between tries.
fn bracket(scanned: &[(Span, f64)], best: Span, which: usize, near: impl Fn(f64) -> bool) -> [f64; 2] {
    let other = 1 - which;
    let same =
        |span: &Span| span[which].is_finite() && (span[other] == best[other] || span[other].is_nan() && best[other].is_nan());
    let mut known: Vec<(f64, f64)> = scanned.iter().filter(|s| same(&s.0)).map(|s| (s.0[which], s.1)).collect();
    known.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (Some(first), Some(last)) = (known.iter().position(|s| near(s.1)), known.iter().rposition(|s| near(s.1))) else {
        return [f64::INFINITY, f64::NEG_INFINITY];
    };
    [known[first.saturating_sub(1)].0, known[(last + 1).min(known.len() - 1)].0]
}

/// Sum of terms at a row, with coefficients from `from` on.
pub(crate) fn predict(terms: &[Term<'_>], coefficients: &[f64], t: f64, row: usize) -> Vector3<f64> {
    let active = terms.iter().zip(coefficients).filter(|(term, _)| term.support.0 <= t && t <= term.support.1);
    active.fold(Vector3::zeros(), |sum, (term, c)| sum + *c * (term.value)(row))
}

/// The parameters of a found cause.
pub(crate) fn parameters(found: &Found<'_>, coefficients: &[f64], sigma: &[f64]) -> Vec<Parameter> {
    let i = &found.instance;
    let mut out = match &i.summary {
        Some(summary) => summary(coefficients, sigma),
        None => {
            i.terms.iter().zip(coefficients.iter().zip(sigma)).map(|(t, (c, s))| parameter(&t.name, *c, t.unit, *s)).collect()
        }
    };
    let until = Some(("t1", "s", found.until));
    for (which, (name, unit, value)) in [i.shape, until].into_iter().enumerate().filter_map(|(k, s)| Some((k, s?))) {
        if value.is_finite() {
            let [lo, hi] = found.shape_ci[which];
            out.push(Parameter { name: name.to_owned(), value, unit: unit.to_owned(), ci95: [lo.min(value), hi.max(value)] });
        }
    }
    out
}

/// A parameter with the interval of a normal error.
pub(crate) fn parameter(name: &str, value: f64, unit: &str, sigma: f64) -> Parameter {
    let half = 1.96 * sigma;
    Parameter { name: name.to_owned(), value, unit: unit.to_owned(), ci95: [value - half, value + half] }
}
