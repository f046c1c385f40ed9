//! Identification: plateaus, declared fits, curves with bands, physical constants, quality.
//!
//! What it is: the thesis' static powerplant with standard errors, and what a designer reads from it.
//! What can go wrong: a log in which no channel can be predicted from another is refused.
//! Units: as stated on each figure.
//! Reference: specification `identification.md`, items 1 to 3.

pub mod curves;

use crate::channel::{Context, unit_of};
use crate::identify::curves::power::{Disc, Level, levels};
use crate::identify::curves::surface::{Surface, surface};
use crate::identify::curves::{Estimate, Fitted, Law, Spin, Zero, declared, motor, relations, speeds, spin, square_law};
use crate::log::Log;
use crate::model::{FittedTo, Model};
use crate::plateau::{Plateau, detect};

/// Why the loop cannot be closed on a log.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CloseError {
    /// Nothing can be predicted from anything.
    #[error(
        "{run}: no channel can be fitted; expected at least two related channels (pulse, rpm, thrust, torque, current, voltage) with more than 8 common samples"
    )]
    NoRelation {
        /// The log.
        run: String,
    },
}

/// Quality of one fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Quality {
    /// Channel.
    pub channel: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Root mean square residual.
    pub rms: f64,
    /// Noise floor inside steady stretches.
    pub noise_floor: f64,
    /// Share of the variance that is explained.
    pub r2: f64,
}

/// A physical constant.
#[derive(Debug, Clone, PartialEq)]
pub struct Constant {
    /// Symbol.
    pub name: &'static str,
    /// Value.
    pub value: f64,
    /// Standard error.
    pub se: f64,
    /// Half width of the 95 % interval.
    pub half: f64,
    /// Unit.
    pub unit: &'static str,
    /// How well its law describes the levels, where it comes from one.
    pub law: Option<Law>,
}

impl Constant {
    fn new(name: &'static str, e: Estimate, unit: &'static str, law: Option<Law>) -> Self {
        Self { name, value: e.value, se: e.se, half: e.half, unit, law }
    }

    /// What it is.
    #[must_use]
    pub fn words(&self) -> &'static str {
        match self.name {
            "k_T" => "thrust for the square of the speed",
            "k_Q" => "torque for the square of the speed",
            "KV" => "speed for each volt",
            "R" => "resistance",
            "I0" => "current without load",
            "tau_up" => "time constant as it speeds up",
            "tau_down" => "time constant as it slows down",
            _ => "",
        }
    }
}

/// What identification gives.
#[derive(Debug, Clone)]
pub struct Identified {
    /// Model with declared fits and no effect.
    pub model: Model,
    /// Plateaus.
    pub plateaus: Vec<Plateau>,
    /// Column names of their means.
    pub columns: Vec<String>,
    /// Consensus speed at each plateau and its error, rev/min.
    pub speeds: Vec<Option<(f64, f64)>>,
    /// Quality of each declared fit.
    pub quality: Vec<Quality>,
    /// Curves through the plateaus.
    pub curves: Vec<Fitted>,
    /// What thrust and torque read at rest, where a level is at rest: taken off in the constants, the levels and the surface.
    pub zeros: [Option<Zero>; 2],
    /// k_T, k_Q, KV, R, I0, spin-up and spin-down time constants, where they can be had.
    pub constants: Vec<Constant>,
    /// What is known of propeller and air.
    pub disc: Disc,
    /// What a designer asks of each plateau.
    pub levels: Vec<Level>,
    /// Thrust over throttle and voltage, or why it is not known.
    pub surface: Result<Surface, String>,
}

/// Identifies a log.
///
/// # Errors
/// [`CloseError::NoRelation`] where nothing can be fitted.
pub fn identify(log: &Log) -> Result<Identified, CloseError> {
    identify_in(log, None)
}

/// The same in air whose density is known from elsewhere, kg/m^3.
///
/// # Errors
/// As [`identify`].
pub fn identify_in(log: &Log, air_kg_m3: Option<f64>) -> Result<Identified, CloseError> {
    let context = Context::bare(log, None);
    // the fits over all rows and the plateaus need nothing of each other: one core each
    let (fitted, plateaus) = std::thread::scope(|scope| {
        let found = scope.spawn(|| detect(log, &context.rpm));
        let relations = all_rows(log, &context);
        (relations, found.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
    });
    let (model, quality) = fitted.ok_or_else(|| CloseError::NoRelation { run: log.name.clone() })?;
    let speeds = speeds(log, &plateaus, &context.consensus.channels);
    let (plateaus, speeds) = if plateaus.is_empty() { table_rows(log, &context) } else { (plateaus, speeds) };
    let curves = relations(log, &plateaus, &speeds);
    let mut constants = Vec::new();
    let zeros = ["thrust_n", "torque_nm"].map(|channel| Zero::of(log, &plateaus, &speeds, channel));
    let [of_thrust, of_torque] = [zeros[0].as_ref(), zeros[1].as_ref()];
    let mut k_torque = None;
    for (name, channel, unit, zero) in [("k_T", "thrust_n", "N.s2", of_thrust), ("k_Q", "torque_nm", "N.m.s2", of_torque)] {
        if let Some((k, law)) = square_law(log, &plateaus, &speeds, channel, zero) {
            constants.push(Constant::new(name, k, unit, Some(law)));
            if channel == "torque_nm" {
                k_torque = Some(k);
            }
        }
    }
    let motor = motor(log, &plateaus, &speeds, of_torque);
    if let Some(m) = &motor {
        constants.push(Constant::new("KV", m.kv, "rev/min/V", Some(m.law)));
        constants.push(Constant::new("R", m.resistance, "ohm", Some(m.law)));
        constants.push(Constant::new("I0", m.no_load, "A", Some(m.law)));
    }
    let told = Disc::of(log);
    let disc = Disc { density_kg_m3: air_kg_m3.or(told.density_kg_m3), ..told };
    let levels = levels(log, &plateaus, &speeds, [of_thrust, of_torque], &disc);
    let surface = surface(log, &plateaus, &speeds, motor.as_ref(), k_torque, of_thrust);
    // row numbers are no seconds
    let Spin { up, down } = if log.time_is_row() { Spin::default() } else { spin(log, &plateaus, &context.rpm) };
    constants.extend(up.map(|e| Constant::new("tau_up", e, "s", None)));
    constants.extend(down.map(|e| Constant::new("tau_down", e, "s", None)));
    Ok(Identified {
        model,
        columns: log.columns.iter().map(|c| c.name.clone()).collect(),
        plateaus,
        speeds,
        quality,
        curves,
        zeros,
        constants,
        disc,
        levels,
        surface,
    })
}

impl Identified {
    /// Which zero the figures of thrust and torque stand on, in words; nothing where neither was measured.
    #[must_use]
    pub fn zero_words(&self) -> String {
        let there = |name: &str| self.levels.iter().any(|l| l.of(name).is_some());
        let said = [("thrust", "thrust_n", "N"), ("torque", "torque_nm", "N.m")].into_iter().zip(&self.zeros);
        said.filter(|((_, column, _), _)| there(column))
            .map(|((what, _, unit), zero)| match zero {
                Some(zero) => format!("{what} less {}", zero.words(unit)),
                None => format!("{what} as read, for no level is at rest"),
            })
            .collect::<Vec<_>>()
            .join("; ")
    }
}

/// Longest log whose rows may each be a level of their own.
const TABLE: usize = 64;
/// Error that a row of a table is given, as a share of its column's largest value; the scatter about a curve corrects it.
pub(crate) const TABLE_ERROR: f64 = 0.01;

/// Whether a log is a table with one row for each level.
#[must_use]
pub fn is_table(context: &Context, log: &Log) -> bool {
    log.len() <= TABLE && detect(log, &context.rpm).is_empty()
}

/// The levels of a log: its plateaus, or every row of a table that has one row for each level.
#[must_use]
pub fn settled(context: &Context, log: &Log) -> Vec<Plateau> {
    let plateaus = detect(log, &context.rpm);
    if plateaus.is_empty() { table_rows(log, context).0 } else { plateaus }
}

/// A static table has one row for each level: every row is a point.
fn table_rows(log: &Log, context: &Context) -> (Vec<Plateau>, Vec<Option<(f64, f64)>>) {
    if log.len() > TABLE {
        return (Vec::new(), Vec::new());
    }
    let top = |v: &[f64]| v.iter().copied().filter(|v| v.is_finite()).fold(0.0_f64, |m, v| m.max(v.abs()));
    let errors: Vec<f64> = log.columns.iter().map(|c| TABLE_ERROR * top(&c.values)).collect();
    let rows = (0..log.len()).map(|i| Plateau {
        from_s: log.t[i],
        to_s: log.t[i],
        first: i,
        rows: 1,
        settling_s: 0.0,
        means: log.columns.iter().zip(&errors).map(|(c, e)| c.values[i].is_finite().then_some((c.values[i], *e))).collect(),
    });
    let speed = context.rpm.iter().map(|v| Some((*v, TABLE_ERROR * top(&context.rpm)))).collect::<Vec<_>>();
    (rows.collect(), if speed.is_empty() { vec![None; log.len()] } else { speed })
}

/// The declared relations over all rows, one channel at a time: a long log must not stand in memory once for each.
fn all_rows(log: &Log, context: &Context) -> Option<(Model, Vec<Quality>)> {
    let (mut polynomials, mut quality) = (Vec::new(), Vec::new());
    let mut related = false;
    for name in Context::declared_names(log) {
        let Some(target) = context.declared(log, name) else { continue };
        let Some(fitted) = declared(context, &target) else { continue };
        related |= target.relation.degree() > 0 && target.rows.len() > 8;
        polynomials.push(fitted.polynomial);
        quality.push(Quality {
            channel: target.name,
            unit: unit_of(target.name),
            rms: fitted.rms,
            noise_floor: target.noise.rms,
            r2: fitted.r2,
        });
    }
    related.then(|| (Model { runs: vec![FittedTo::of(log)], ..Model::of(context, log, polynomials) }, quality))
}
