//! From a simulated run to a rig log, and from an identified model back to a plant.
//!
//! What it is: the two hand-overs between `hal-sim` and `ident`, which never see each other.
//! What can go wrong: nothing; missing codes become missing samples.
//! Units: as in the log.
//! Reference: specification `formats.md`; `closing-the-loop.md`, step 9.

use crate::evidence::{self, Fitted};
use firmware_rig::RigConfig;
use frame::message::Event;
use frame::rig::{FaultSet, RigSample, RigState};
use hal_sim::native::firmware_config;
use hal_sim::plant::PlantLevers;
use hal_sim::plant::air::Air;
use hal_sim::scenario::SupplySection;
use hal_sim::{PlantState, Powerplant, RunRecord, Scenario};
use ident::log::{Column, Log};
use ident::model::Model;
use ident::model::simulate::from_command;

/// The log of a run, as `quadrig log` would record it; with the raw codes beside the readings where `raw` says so.
pub(crate) fn to_log(scenario: &Scenario, record: &RunRecord, name: &str, raw: bool) -> Log {
    let rows: Vec<_> = record.converted().collect();
    let mut log = Log { name: name.to_owned(), t: rows.iter().map(|r| r.t_s).collect(), ..Log::default() };
    let text = |s: &str| toml::Value::String(s.to_owned());
    log.meta.insert("motor".into(), text(&scenario.motor));
    log.meta.insert("propeller".into(), text(&scenario.propeller));
    log.meta.insert("supply".into(), text(&supply(scenario)));
    // a run that is computed has no day, and the same seed gives the same bytes on every one
    log.meta.insert("date".into(), text(SIMULATED));
    // what a laboratory reads off its barometer before the run
    let air = Air { temperature_c: scenario.air.temperature_c, pressure_pa: scenario.air.pressure_pa };
    log.meta.insert("air_density_kg_m3".into(), toml::Value::Float((1e4 * air.density()).round() / 1e4));
    let config = RigConfig::of(&firmware_config(scenario));
    let config = (config.digest() == record.hello.config).then_some(&config);
    log.meta.extend(evidence::head(Some(&record.hello), &record.calibration, config));
    if let Ok(schedule) = toml::Value::try_from(&scenario.schedule) {
        log.meta.insert("schedule".into(), schedule);
    }
    log.events = events(record);
    log.meta.insert("sample_hz".into(), toml::Value::Float(f64::from(scenario.log.rate_hz)));
    log.columns.push(Column { name: "pulse_us".into(), values: rows.iter().map(|r| r.pulse_us).collect() });
    let mut push = |name: &str, values: Vec<f64>| {
        if values.iter().any(|v| v.is_finite()) {
            log.columns.push(Column { name: name.into(), values });
        }
    };
    for (i, name) in frame::rig::CAPTURE_NAMES.iter().enumerate() {
        push(name, rows.iter().map(|r| r.rpm[i].unwrap_or(f64::NAN)).collect());
    }
    for (i, name) in frame::rig::ADC_NAMES.iter().enumerate() {
        push(name, rows.iter().map(|r| r.adc[i].unwrap_or(f64::NAN)).collect());
    }
    push("thrust_rms_n", rows.iter().map(|r| r.thrust_rms_n.unwrap_or(f64::NAN)).collect());
    for (i, name) in frame::rig::UNEVEN_NAMES.iter().enumerate() {
        push(name, rows.iter().map(|r| r.uneven_deg[i].unwrap_or(f64::NAN)).collect());
    }
    let fitted = Fitted::of(Some(&record.hello), &record.calibration);
    let new: Vec<bool> = record.samples.iter().scan(None, |before, s| Some(s.esc_is_new(before.replace(s)))).collect();
    let cross: Vec<Vec<f64>> =
        rows.iter().zip(&new).map(|(row, new)| fitted.cross(row, *new).map(|v| v.unwrap_or(f64::NAN)).collect()).collect();
    for (i, name) in fitted.cross_columns().enumerate() {
        push(name, cross.iter().map(|row| row[i]).collect());
    }
    let mut beside = |names: Vec<String>, cells: &dyn Fn(&RigSample) -> Vec<f64>| {
        let mut columns: Vec<Column> = names.into_iter().map(|name| Column { name, values: Vec::new() }).collect();
        for sample in &record.samples {
            columns.iter_mut().zip(cells(sample)).for_each(|(column, cell)| column.values.push(cell));
        }
        log.columns.append(&mut columns);
    };
    beside(evidence::flag_columns(&fitted), &|s| fitted.flags(s).map(|f| f.map_or(f64::NAN, |f| f64::from(f.code))).collect());
    if raw {
        beside(evidence::raw_columns(&fitted), &|s| evidence::raw_codes(&fitted, s).into_iter().map(f64::from).collect());
    }
    log
}

/// What stands in the place of the day of a run that nobody made.
pub(crate) const SIMULATED: &str = "simulated";

/// What feeds a simulated rig, as an operator would write it down: a hidden battery is plain to see, and what is left in it is not.
fn supply(of: &Scenario) -> String {
    if of.effects.iter().any(|e| e.effect.id() == "battery_discharge") {
        return "lithium battery".to_owned();
    }
    match of.supply {
        SupplySection::Bench { voltage_v } => format!("bench supply, {voltage_v} V"),
        SupplySection::Lipo { cells, capacity_ah, .. } => format!("{cells}S lithium battery, {capacity_ah} A.h"),
    }
}

/// What happened in a run, with its times.
fn events(record: &RunRecord) -> Vec<String> {
    let mut latched = FaultSet::NONE;
    let mut told = Vec::new();
    for event in &record.events {
        let before = latched;
        match event {
            Event::Faults { faults, .. } => latched = *faults,
            Event::State { from: RigState::Faulted, .. } => latched = FaultSet::NONE,
            _ => {}
        }
        let Some(at) = evidence::instant(event) else { continue };
        let after = record.samples.iter().find(|s| s.at >= at);
        let words = evidence::words(event, before, after);
        told.extend(words.map(|words| evidence::timed(at.as_s() - record.start.as_s(), &words)));
    }
    told
}

/// What a model predicts along the command of a log, row for row, and each channel as it would read; `None` of a model that predicts no
/// speed from a command.
pub(crate) fn along(model: &Model, log: &Log) -> Option<(Vec<PlantState>, Log)> {
    let pulse = ident::signal::stretches::bridge(&log.t, log.column("pulse_us")?);
    let covariates: Vec<Column> = log
        .columns
        .iter()
        .map(|c| Column { name: c.name.clone(), values: ident::signal::stretches::bridge(&log.t, &c.values) })
        .collect();
    let predicted = from_command(model, &log.name, &log.t, &pulse, &covariates);
    // the speed that every other relation hangs on is the consensus of the channels
    let speed = model.context(&predicted).rpm;
    if speed.is_empty() {
        return None;
    }
    let column = |name: &str, absent: f64| predicted.column(name).map_or_else(|| vec![absent; log.len()], <[f64]>::to_vec);
    let [thrust, torque] = ["thrust_n", "torque_nm"].map(|name| column(name, 0.0));
    let [current, voltage, temperature] = [("current_a", 0.0), ("voltage_v", 0.0), ("temp_c", 20.0)].map(|(n, v)| column(n, v));
    let rows = (0..log.len())
        .map(|i| PlantState {
            rpm: speed[i].max(0.0),
            thrust_n: thrust[i],
            torque_nm: torque[i],
            current_a: current[i],
            voltage_v: voltage[i],
            temp_c: temperature[i],
        })
        .collect();
    Some((rows, predicted))
}

/// An identified model in the powerplant's place: it plays, for the command of one run, what it predicts from that command.
#[derive(Clone)]
pub(crate) struct IdentifiedPlant {
    run_s: f64,
    t: Vec<f64>,
    rows: Vec<PlantState>,
    at_rest: PlantState,
    /// What each speed channel reads beyond the rotor's speed, by row: the model's own words on that sensor.
    misread: Vec<Column>,
}

impl IdentifiedPlant {
    /// Predicts the run that `log` commands. Temperatures are taken from the log: no model here predicts the weather.
    pub(crate) fn new(model: &Model, log: &Log) -> Option<Self> {
        let (rows, predicted) = along(model, log)?;
        let misread = predicted
            .columns
            .iter()
            .filter(|c| ident::log::SPEED.contains(&c.name.as_str()))
            .map(|c| Column { name: c.name.clone(), values: c.values.iter().zip(&rows).map(|(v, r)| v - r.rpm).collect() })
            .collect();
        let at_rest = PlantState { rpm: 0.0, thrust_n: 0.0, torque_nm: 0.0, ..rows.first().copied()? };
        Some(Self { run_s: -1.0, t: log.t.clone(), rows, at_rest, misread })
    }

    /// Lets the speed channels of a run read what the model says that they read: a plant has one rotor, and a model that found a
    /// sensor at fault (or fitted each channel its own polynomial) says more than that.
    pub(crate) fn misread(&self, log: &mut Log) {
        for m in &self.misread {
            let Some(column) = log.columns.iter_mut().find(|c| c.name == m.name) else { continue };
            for (v, t) in column.values.iter_mut().zip(&log.t) {
                let row = self.t.partition_point(|own| *own < t - 1e-6).min(self.t.len() - 1);
                if *v > 0.0 {
                    *v += m.values[row];
                }
            }
        }
    }
}

impl Powerplant for IdentifiedPlant {
    fn advance(&mut self, _dt_s: f64, _pulse_us: f64) -> PlantState {
        if self.run_s < 0.0 {
            return self.at_rest;
        }
        // a row is the mean over the interval that ends at its time stamp
        let i = self.t.partition_point(|t| *t < self.run_s).min(self.rows.len() - 1);
        self.rows[i]
    }

    fn adjust(&mut self, levers: &PlantLevers) {
        self.run_s = levers.run_s;
    }
}
