//! Each step of the loop on its own, as a table.
//!
//! What it is: the nine steps, from the declared model to the closed loop, each computed from the log alone and given as rows that
//! a person or a program reads.
//! What can go wrong: a log with no relation to test has nothing to show ([`step`] gives `None`).
//! Units: in the heads of the columns.
//! Reference: specification `closing-the-loop.md`, "The steps".

mod depends;
mod left;
mod orders;

use crate::channel::{Context, Relation, unit_of};
use crate::close::{Closed, close};
use crate::effects::library;
use crate::fit::heldout;
use crate::fit::search::{base, scan};
use crate::fit::{Fit, Rows, fit};
use crate::log::Log;
use crate::model::Declared;
use crate::model::Model;
use crate::model::simulate::from_command;
use crate::numeric::digits::number;

/// The steps in their order, with what each answers.
pub const STEPS: [(&str, &str); 9] = [
    ("declare", "the declared model: polynomials with standard errors"),
    ("residual", "what it leaves over, from the command alone and from the other channels"),
    (
        "anything",
        "is anything left: whiteness, size over the noise floor, runs, strongest period, lines that turn with the rotor",
    ),
    ("depends", "what the residual depends on, and which of these variables this schedule confounds"),
    ("candidates", "every effect that the log could hold, with its parameters and what it gains alone"),
    ("choose", "the hypotheses with their probabilities"),
    ("nameless", "the empirical correction: the smooth function that predicts held-out rows best"),
    ("report", "error before and after, and the parameters with their intervals"),
    ("close", "the run predicted from its command alone, by the declared and by the corrected model"),
];

/// What a step gives.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Table {
    /// Name of the step.
    pub step: &'static str,
    /// What it answers.
    pub question: &'static str,
    /// Heads of the columns.
    pub columns: Vec<&'static str>,
    /// The cells.
    pub rows: Vec<Vec<String>>,
    /// What to know when reading it.
    pub note: String,
}

/// The declared model on a log.
pub(crate) struct Start {
    pub(crate) context: Context,
    pub(crate) fit: Fit,
    /// Residual of each target.
    pub(crate) residuals: Vec<Vec<f64>>,
    /// Blades of the propeller as the log states them, else two.
    pub(crate) blades: f64,
}

impl Start {
    fn new(log: &Log) -> Option<Self> {
        let context = Context::of_run(log);
        let fit = fit(&context, Declared::default(), &[], None, Rows::All)?;
        let residuals = heldout::residuals(&context, Declared::default(), &fit);
        let stated = log.meta.get("blades").and_then(|v| v.as_integer()).filter(|b| (1..=12).contains(b));
        Some(Self { context, fit, residuals, blades: stated.map_or(2.0, |b| b as f64) })
    }
}

/// One step on a log; `None` for a name that is none, and for a log on which nothing can be fitted.
#[must_use]
pub fn step(name: &str, log: &Log, progress: &mut dyn FnMut(f64)) -> Option<Table> {
    let (step, question) = *STEPS.iter().find(|s| s.0 == name)?;
    let (columns, rows, note) = match step {
        "declare" => declare(log, &Start::new(log)?),
        "residual" => residual(log, &Start::new(log)?),
        "anything" => left::anything(&Start::new(log)?),
        "depends" => depends::depends(&Start::new(log)?, progress),
        "nameless" => depends::nameless(&Start::new(log)?),
        "candidates" => candidates(&Start::new(log)?, progress),
        _ => {
            let closed = close(log, None, &[], progress).ok()?;
            match step {
                "choose" => choose(&closed),
                "report" => report(&closed),
                _ => from_the_command(log, &closed),
            }
        }
    };
    Some(Table { step, question, columns, rows, note })
}

/// Columns, rows and note of a table.
pub(crate) type Content = (Vec<&'static str>, Vec<Vec<String>>, String);

fn declare(log: &Log, start: &Start) -> Content {
    let model = Model::from_fit(&start.context, log, Declared::default(), &start.fit);
    let rows = model.polynomials.iter().flat_map(|p| {
        p.coefficients.iter().zip(&p.errors).enumerate().map(|(k, (c, e))| {
            let per = if p.channel.starts_with("rpm") { "kus" } else { "krpm" };
            let unit = if k == 0 { unit_of(&p.channel).to_owned() } else { format!("{}/{per}^{k}", unit_of(&p.channel)) };
            vec![p.channel.clone(), k.to_string(), number(*c), number(*e), unit]
        })
    });
    let note = format!("the motor starts at {} us", number(model.start_pulse_us));
    (vec!["channel", "order", "coefficient", "standard error", "unit"], rows.collect(), note)
}

fn rms(r: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = r.fold((0.0, 0usize), |(s, n), v| (s + v * v, n + 1));
    (sum / n.max(1) as f64).sqrt()
}

fn residual(log: &Log, start: &Start) -> Content {
    let model = Model::from_fit(&start.context, log, Declared::default(), &start.fit);
    let blind = start.context.pulse.as_ref().map(|p| from_command(&model, &log.name, &log.t, p, &log.columns));
    let rows = start.context.targets.iter().zip(&start.residuals).map(|(target, r)| {
        let alone = blind
            .as_ref()
            .and_then(|b| b.column(target.name))
            .map_or_else(|| "-".to_owned(), |p| number(rms(target.rows.iter().zip(&target.y).map(|(i, y)| y - p[*i]))));
        let by_relation = rms(r.iter().copied());
        vec![
            target.name.to_owned(),
            relation(target.relation).to_owned(),
            number(target.noise.rms),
            number(by_relation),
            format!("{:.2}", by_relation / target.noise.rms),
            alone,
            unit_of(target.name).to_owned(),
        ]
    });
    let excluded = &start.context.consensus.excluded;
    let note = if excluded.is_empty() {
        "all speed channels agree".to_owned()
    } else {
        format!("speed channels that disagree with the others, left out of the consensus: {}", excluded.join(", "))
    };
    (
        vec!["channel", "predicted from", "noise floor", "residual", "over the floor", "from the command alone", "unit"],
        rows.collect(),
        note,
    )
}

fn relation(r: Relation) -> &'static str {
    match r {
        Relation::SpeedFromPulse => "pulse",
        Relation::SpeedAlone | Relation::Voltage => "a constant",
        Relation::SpeedDifference => "the consensus of the speeds",
        _ => "measured speed",
    }
}

fn candidates(start: &Start, progress: &mut dyn FnMut(f64)) -> Content {
    let mut rows: Vec<(f64, Vec<String>)> = Vec::new();
    let all: Vec<_> = library().iter().flat_map(|e| e.instances(&start.context).into_iter().map(move |i| (*e, i))).collect();
    let count = all.len().max(1) as f64;
    let base = base(&start.context, Declared::default(), &[]);
    for (k, (effect, instance)) in all.into_iter().enumerate() {
        progress(k as f64 / count);
        let found = scan(&start.context, &base, effect, &instance, &vec![true; start.context.targets.len()]);
        let shapes = effect.shapes(&start.context, &instance);
        let parameters: Vec<String> =
            shapes.iter().map(|s| format!("{} {}..{} {}", s.name, number(s.range.0), number(s.range.1), s.unit)).collect();
        let at: Vec<String> = found.iter().flat_map(|f| f.0.iter().map(|v| number(*v))).collect();
        let gain = found.map_or(f64::NEG_INFINITY, |f| f.1);
        let form = if instance.form.is_empty() { String::new() } else { format!(" [{}]", instance.form) };
        rows.push((
            gain,
            vec![
                format!("{}{form}", effect.id()),
                instance.channels.join(" "),
                parameters.join(", "),
                at.join(", "),
                format!("{gain:.1}"),
            ],
        ));
    }
    rows.sort_by(|a, b| b.0.total_cmp(&a.0));
    let note = "gain of each effect alone over the declared model, in nats, before its price and before the noise's colour is counted; the search adds them one at a time".to_owned();
    (
        vec!["effect", "channels", "shape parameters and bounds", "best start", "gain"],
        rows.into_iter().map(|r| r.1).collect(),
        note,
    )
}

fn choose(closed: &Closed) -> Content {
    let d = &closed.diagnosis;
    let mut rows = vec![vec![format!("{:.4}", d.probability), d.best.ids().join(" + "), format!("{:.1}", d.best.evidence)]];
    rows.extend(d.rivals.iter().map(|r| vec![format!("{:.4}", r.probability), r.ids.join(" + "), "-".to_owned()]));
    let note = format!("verdict {:?}", closed.verdict.verdict).to_lowercase();
    (vec!["probability", "effects", "net evidence, nats"], rows, note)
}

fn report(closed: &Closed) -> Content {
    let mut rows: Vec<Vec<String>> = closed
        .verdict
        .channels
        .iter()
        .map(|(name, c)| {
            let f = [c.noise_floor_rms, c.before.heldout_rms, c.after.heldout_rms].map(number);
            let [floor, before, after] = f;
            vec![name.clone(), floor, before, after, format!("p {:.3}", c.after.whiteness_p), c.unit.clone()]
        })
        .collect();
    for e in &closed.verdict.effects {
        for p in &e.parameters {
            rows.push(vec![
                format!("{}.{}", e.id, p.name),
                number(p.value),
                number(p.ci95[0]),
                number(p.ci95[1]),
                "95 %".into(),
                p.unit.clone(),
            ]);
        }
    }
    let note =
        "channels: noise floor, held-out error before and after, whiteness after; parameters: value and interval".to_owned();
    (vec!["channel or parameter", "floor or value", "before or from", "after or to", "", "unit"], rows, note)
}

fn from_the_command(log: &Log, closed: &Closed) -> Content {
    let Some(pulse) = &closed.context.pulse else {
        return (vec!["channel"], Vec::new(), "the log has no command to start from".to_owned());
    };
    let alone = |m: &Model| from_command(m, &log.name, &log.t, pulse, &log.columns);
    let (before, after) = (alone(&closed.declared), alone(&closed.model));
    let rows = closed.context.targets.iter().filter(|t| !t.relation.is_evidence()).filter_map(|target| {
        let error = |l: &Log| {
            Some(rms(target.rows.iter().zip(&target.y).map(|(i, y)| y - l.column(target.name).map_or(f64::NAN, |p| p[*i]))))
        };
        let (b, a) = (error(&before)?, error(&after)?);
        Some(vec![target.name.to_owned(), number(target.noise.rms), number(b), number(a), unit_of(target.name).to_owned()])
    });
    let note = "the whole run from its command alone; `quadrig sim --model` puts the corrected model in the plant's place, `quadrig loop` judges what is left".to_owned();
    (vec!["channel", "noise floor", "declared", "corrected", "unit"], rows.collect(), note)
}
