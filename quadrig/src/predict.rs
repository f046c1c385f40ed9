//! `quadrig predict`.
//!
//! What it is: a model's prediction of every measured channel of a log, one line for each row of the log.
//! What can go wrong: an inertial model predicts its own recording only. A model that knows none of the log's channels is refused. Glitch rows, which the log alone decides, stay empty.
//! Units: the log's.
//! Reference: specification `formats.md`.

use crate::Failure;
use crate::apart::Paths;
use crate::close_loop::{flight, inertial};
use crate::open::{Columns, Names, open};
use crate::replace::put_as;
use clap::ValueEnum;
use ident::log::{Column, Log};
use ident::model::Model;
use ident::model::simulate::from_command;
use std::borrow::Cow;
use std::path::PathBuf;

/// What a prediction starts from.
#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum From {
    /// Each channel by its primary relation, from measured regressors.
    Relations,
    /// Everything from the command alone.
    Command,
}

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The model.
    model: PathBuf,
    /// The log whose rows are predicted.
    log: PathBuf,
    /// Where the prediction goes.
    #[arg(short, long)]
    output: PathBuf,
    /// What the prediction starts from.
    #[arg(long, value_enum, default_value_t = From::Relations)]
    from: From,
    /// Events and drifts of the model's own run at the same instants of this log too; without it another run of the rig gets what
    /// carries over: effects of the rig, what events left behind, and the mean of the rest.
    #[arg(long)]
    events: bool,
    #[command(flatten)]
    columns: Columns,
    #[command(flatten)]
    names: Names,
}

impl Args {
    /// What it reads and writes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        Paths::default().reads([&self.model, &self.log]).writes("-o", [&self.output])
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    if let Some(text) = inertial::model_text(&args.model) {
        if args.from == From::Command {
            return Err(format!(
                "{}: of an attitude log, which holds no command; expected --from relations",
                args.model.display()
            )
            .into());
        }
        return inertial::predict(&args.model, &text, &args.log, &args.output);
    }
    if let Some(text) = flight::model_text(&args.model) {
        if args.from == From::Command {
            return Err(format!(
                "{}: of a flight, whose motion no command alone decides; expected --from relations",
                args.model.display()
            )
            .into());
        }
        return flight::predict(&args.model, &text, &args.log, &args.output);
    }
    crate::kind::refuse_no_model(&args.model)?;
    let model = Model::read(&args.model)?;
    let log = open(&args.log, &args.columns.options(&args.names), false)?;
    let model = if args.events && !model.is_of(&log) { Cow::Borrowed(&model) } else { model.on(&log) };
    let columns = match args.from {
        From::Relations => by_relations(&model, &log),
        From::Command => by_command(&model, &log)?,
    };
    if columns.is_empty() {
        return Err(format!(
            "{}: knows none of the channels of {}; expected a model of the same rig",
            args.model.display(),
            args.log.display()
        )
        .into());
    }
    let names: Vec<&str> = columns.iter().map(|c| c.name.as_str()).collect();
    let head = format!("t_s,{}", names.join(","));
    put_as(&args.output, &head, |out| {
        writeln!(out, "{head}")?;
        for (i, t) in log.t.iter().enumerate() {
            write!(out, "{t}")?;
            for c in &columns {
                if c.values[i].is_finite() { write!(out, ",{:.9}", c.values[i])? } else { write!(out, ",")? }
            }
            writeln!(out)?;
        }
        Ok(())
    })
}

fn by_relations(model: &Model, log: &Log) -> Vec<Column> {
    let context = model.context(log);
    let claim = |name: &'static str| {
        let mut values = model.predict(&context, name)?;
        let target = &context.targets[context.target(name)?];
        for row in target.unclaimed.iter().chain(&target.aside).chain(&target.given) {
            values[*row] = f64::NAN; // an empty field
        }
        // a tachometer that has not seen its second mark reads nothing, whatever the rotor does
        for silent in context.set_aside.iter().filter(|a| a.silent && a.channel == name) {
            values[silent.span()].fill(0.0);
        }
        Some(Column { name: name.to_owned(), values })
    };
    log.measured().filter_map(claim).collect()
}

fn by_command(model: &Model, log: &Log) -> Result<Vec<Column>, Failure> {
    let pulse =
        log.column("pulse_us").ok_or_else(|| format!("{}: no column pulse_us; expected one with --from command", log.name))?;
    let pulse = ident::signal::stretches::bridge(&log.t, pulse);
    let predicted = from_command(model, &log.name, &log.t, &pulse, &log.columns);
    Ok(log.measured().filter_map(|name| predicted.columns.iter().find(|c| c.name == name).cloned()).collect())
}
