//! A model beside the run.
//!
//! What it is: every sample becomes a row of the watch ([`ident::close::watch`]), which a thread of its own judges; what it finds comes back when it is done. A virtual
//! board waits for each answer, so that the same run is judged the same.
//! What can go wrong: a model that cannot be read; a board that is reset begins a new watch, and that is told.
//! Units: noise floors; s of the run, from its first row.
//! Reference: specification `rig.md`, "The operator's side" (`--model`, `--stop-at`).

use crate::Failure;
use crate::open::read_model;
use crate::view::Under;
use frame::calibration::{Calibration, Converted};
use frame::message::Message;
use frame::rig::{ADC_NAMES, CAPTURE_NAMES, RigSample};
use frame::units::Ticks;
use ident::close::watch::{Departure, Shown, Watch};
use ident::model::Model;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};

/// A departure that is told where `--stop-at` says nothing, noise floors.
const TOLD_AT: f64 = 8.0;

/// The options.
#[derive(clap::Args, Clone, Debug, Default)]
#[group(skip)] // the commands that take it have a group of this name
pub(crate) struct Args {
    /// Hold the run against this model while it goes on: each channel's residual in noise floors, and the row where the run leaves it.
    #[arg(long, value_name = "MODEL")]
    pub(crate) model: Option<PathBuf>,
    /// Stop the motor when the run leaves its model by so many noise floors.
    #[arg(long, value_name = "FLOORS", requires = "model", value_parser = crate::number::positive(1e6, "noise floors"))]
    stop_at: Option<f64>,
}

/// A row for the watch, or a new run.
enum Given {
    Row(f64, Vec<(&'static str, f64)>),
    Anew,
}

/// What the watch says after so many rows.
struct Judged {
    rows: usize,
    shown: Vec<Shown>,
    departure: Option<Departure>,
}

/// The watch and what it has said.
pub(crate) struct Overseer {
    rows: Sender<Given>,
    judged: Receiver<Judged>,
    /// Waits for each answer.
    in_step: bool,
    given: usize,
    calibration: Option<Calibration>,
    early: Vec<RigSample>,
    first: Option<Ticks>,
    last: Option<Ticks>,
    /// What is shown.
    pub(crate) under: Under,
    /// Residuals of the last row that was judged.
    pub(crate) shown: Vec<Shown>,
}

impl Overseer {
    /// The watch that the options ask for, if they do.
    pub(crate) fn new(args: &Args, in_step: bool) -> Result<Option<Self>, Failure> {
        let Some(path) = &args.model else { return Ok(None) };
        let floors = args.stop_at.unwrap_or(TOLD_AT);
        Self::with(path, floors, args.stop_at.is_some(), in_step).map(Some)
    }

    fn with(path: &Path, floors: f64, stops: bool, in_step: bool) -> Result<Self, Failure> {
        let model = read_model(path, false)?;
        let under = Under { model: model.source.clone(), stops, floors, departure: None };
        let (rows, given) = channel();
        let (said, judged) = channel();
        std::thread::spawn(move || judge(&model, floors, &given, &said));
        Ok(Self {
            rows,
            judged,
            in_step,
            given: 0,
            calibration: None,
            early: Vec::new(),
            first: None,
            last: None,
            under,
            shown: Vec::new(),
        })
    }

    /// Takes a message of the board; `true` when the board was reset and the watch begins anew.
    pub(crate) fn take(&mut self, message: &Message) -> bool {
        match message {
            Message::Calibration(calibration) => {
                self.calibration = Some(*calibration);
                for sample in std::mem::take(&mut self.early) {
                    self.row(&sample, calibration);
                }
                false
            }
            Message::Rig(sample) => {
                let reset = self.last.is_some_and(|last| sample.at < last);
                self.last = Some(sample.at);
                if reset {
                    let _ = self.rows.send(Given::Anew);
                    (self.first, self.under.departure) = (None, None);
                }
                match self.calibration {
                    Some(calibration) => self.row(sample, &calibration),
                    None => self.early.push(*sample),
                }
                reset
            }
            _ => false,
        }
    }

    fn row(&mut self, sample: &RigSample, calibration: &Calibration) {
        let values = calibration.convert(sample);
        let first = *self.first.get_or_insert(sample.at);
        let _ = self.rows.send(Given::Row(sample.at.since(first).as_s(), cells(&values)));
        self.given += 1;
    }

    /// What the watch has found since the last look; gives the departure when it is new.
    pub(crate) fn look(&mut self) -> Option<Departure> {
        let before = self.under.departure.is_some();
        let mut done = false;
        while !done {
            let next = if self.in_step && self.given > 0 { self.judged.recv().ok() } else { self.judged.try_recv().ok() };
            let Some(Judged { rows, shown, departure }) = next else { break };
            self.given = self.given.saturating_sub(rows);
            self.shown = shown;
            self.under.departure = self.under.departure.or(departure);
            done = self.in_step && self.given == 0;
        }
        self.under.departure.filter(|_| !before)
    }
}

/// A departure in one line.
pub(crate) fn words(departure: &Departure) -> String {
    format!(
        "the run left its model: {} is off by {:+.1} noise floors from row {} ({:.1} s) on",
        departure.channel, departure.floors, departure.row, departure.t_s
    )
}

/// A sample under the names of a log.
fn cells(values: &Converted) -> Vec<(&'static str, f64)> {
    let number = |v: &Option<f64>| v.unwrap_or(f64::NAN);
    let speeds = CAPTURE_NAMES.into_iter().zip(values.rpm.iter().map(number));
    let analogue = ADC_NAMES.into_iter().zip(values.adc.iter().map(number));
    std::iter::once(("pulse_us", values.pulse_us)).chain(speeds).chain(analogue).collect()
}

/// Judges rows as they come, those that have gathered at once.
fn judge(model: &Model, floors: f64, given: &Receiver<Given>, said: &Sender<Judged>) {
    let mut watch = Watch::new(model.clone(), floors);
    while let Ok(first) = given.recv() {
        let mut rows = 0;
        for one in std::iter::once(first).chain(given.try_iter()) {
            match one {
                Given::Row(t_s, cells) => {
                    watch.push(t_s, &cells);
                    rows += 1;
                }
                Given::Anew => watch = Watch::new(model.clone(), floors),
            }
        }
        let departure = watch.judge();
        if said.send(Judged { rows, shown: watch.shown().to_vec(), departure }).is_err() {
            return;
        }
    }
}
