//! What a log says it was recorded with, and what happened meanwhile.
//!
//! What it is: the lines of a log's head (board, firmware, configuration, scale of every channel with its errors and its day), the columns of
//! flags and of raw codes, and each event in words with its time. Recorded and simulated logs take them from here.
//! What can go wrong: a board whose configuration could not be read: the scales then stand without errors and day.
//! Units: counts, ticks, and the channels' own.
//! Reference: specification `formats.md`, "Rig log".

use crate::rig::{date, file};
use firmware_rig::rig_config::Calibrated;
use firmware_rig::{Config, RigConfig};
use frame::calibration::{Calibration, Converted};
use frame::esc::{BACK_EMF_NAME, ESC_NAMES};
use frame::flag::{FLAG_SUFFIX, Flag};
use frame::message::{Event, Hello, SettingsNews};
use frame::rig::{ADC_NAMES, AdcVerdict, CAPTURE_NAMES, CaptureVerdict, Fault, FaultSet, RigSample};
use frame::units::Ticks;
use std::fmt::Write;
use toml::{Table, Value};

/// A float as short as it is known: seven digits of an `f32`.
fn short(value: f32) -> Value {
    Value::Float(value.to_string().parse().unwrap_or(f64::from(value)))
}

/// The head of a log: keys and values in the order in which they are to stand.
pub(crate) fn head(hello: Option<&Hello>, calibration: &Calibration, config: Option<&RigConfig>) -> Vec<(String, Value)> {
    let mut lines = Vec::new();
    if let Some(Hello { firmware: [major, minor, patch], config, .. }) = hello {
        lines.push(("firmware".to_owned(), Value::String(format!("rig {major}.{minor}.{patch}"))));
        lines.push(("config_crc32".to_owned(), Value::String(format!("{config:08x}"))));
    }
    lines.push(("timer_hz".to_owned(), Value::Integer(i64::from(calibration.timer_hz))));
    for (name, marks) in CAPTURE_NAMES.iter().zip(calibration.marks).filter(|(_, marks)| *marks > 0) {
        lines.push((
            format!("calibration_{name}"),
            Value::Table(Table::from_iter([("marks".to_owned(), Value::Integer(marks.into()))])),
        ));
    }
    let [esc, meter] = calibration.pole_pairs;
    for (name, pairs) in [(ESC_NAMES[0], esc), (BACK_EMF_NAME, meter)].into_iter().filter(|(_, pairs)| *pairs > 0) {
        let pairs = Table::from_iter([("pole_pairs".to_owned(), Value::Integer(pairs.into()))]);
        lines.push((format!("calibration_{name}"), Value::Table(pairs)));
    }
    for (channel, name) in ADC_NAMES.iter().enumerate().filter(|(n, _)| config.is_none_or(|c| c.fitted[*n])) {
        lines.push((format!("calibration_{name}"), Value::Table(scale(channel, calibration, config))));
    }
    let flags = Flag::ALL.iter().map(|flag| (flag.code.to_string(), Value::String(flag.words.to_owned())));
    lines.push(("flags".to_owned(), Value::Table(flags.collect())));
    if let Some(config) = config {
        lines.push(("rig_config".to_owned(), Value::String(file::text(config))));
    }
    lines
}

/// The scale of an analogue channel as it is in force, and how it was found.
fn scale(channel: usize, calibration: &Calibration, config: Option<&RigConfig>) -> Table {
    let now = calibration.adc[channel];
    let mut table = Table::from_iter([("zero_counts".to_owned(), short(now.zero)), ("per_count".to_owned(), short(now.gain))]);
    if let Some(config) = config {
        let untared = config.apply(&Config::thesis_570kv()).calibration().adc[channel];
        table.insert("untared_zero_counts".to_owned(), short(untared.zero));
        how_found(&mut table, config.calibrated[channel].as_ref());
    }
    table
}

/// How a scale was found: by its design, or by a calibration with its errors and its day.
pub(crate) fn how_found(table: &mut Table, found: Option<&Calibrated>) {
    for key in ["zero_sigma", "per_count_sigma", "residual", "worst", "points", "date"] {
        table.remove(key);
    }
    let mut put = |key: &str, value: Value| drop(table.insert(key.to_owned(), value));
    put("source", Value::String(if found.is_some() { "calibrated" } else { "design" }.to_owned()));
    let Some(found) = found else { return };
    put("zero_sigma", short(found.zero_sigma));
    put("per_count_sigma", short(found.gain_sigma));
    put("residual", short(found.residual));
    put("worst", short(found.worst));
    put("points", Value::Integer(found.points.into()));
    if found.day > 0 {
        put("date", Value::String(date::text(found.day)));
    }
}

/// A line of a head.
pub(crate) fn line(key: &str, value: &Value) -> String {
    ident::log::meta_line(key, value) + "\n"
}

/// Names of the columns of flags, of the channels that are fitted: speed sensors, then analogue channels.
pub(crate) fn flag_columns(fitted: &Fitted) -> Vec<String> {
    fitted.names().map(|name| format!("{name}{FLAG_SUFFIX}")).collect()
}

/// Channels that a board has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Fitted {
    captures: [bool; 4],
    analogue: [bool; 5],
    /// The ESC's telemetry, and the back-EMF meter.
    cross: [bool; 2],
}

impl Fitted {
    /// As the board says who it is; of one that says nothing, all that have a scale.
    pub(crate) fn of(hello: Option<&Hello>, calibration: &Calibration) -> Self {
        let captures = calibration.marks.map(|marks| marks > 0);
        let analogue = hello.map_or([true; 5], |hello| std::array::from_fn(|n| hello.analogue >> n & 1 == 1));
        Self { captures, analogue, cross: calibration.pole_pairs.map(|pairs| pairs > 0) }
    }

    fn captures(&self) -> impl Iterator<Item = usize> {
        let fitted = self.captures;
        (0..4).filter(move |n| fitted[*n])
    }

    fn analogue(&self) -> impl Iterator<Item = usize> {
        let fitted = self.analogue;
        (0..5).filter(move |n| fitted[*n])
    }

    fn names(&self) -> impl Iterator<Item = &'static str> {
        // the verdict on a frame of the ESC stands beside its speed
        let [esc, meter] = self.cross;
        let cross = [(esc, ESC_NAMES[0]), (meter, BACK_EMF_NAME)].into_iter().filter_map(|(fitted, name)| fitted.then_some(name));
        self.captures().map(|n| CAPTURE_NAMES[n]).chain(self.analogue().map(|n| ADC_NAMES[n])).chain(cross)
    }

    /// Columns of the cross-checks that are fitted.
    pub(crate) fn cross_columns(&self) -> impl Iterator<Item = &'static str> {
        let [esc, meter] = self.cross;
        ESC_NAMES.into_iter().filter(move |_| esc).chain([BACK_EMF_NAME].into_iter().filter(move |_| meter))
    }

    /// What they read, under [`Fitted::cross_columns`]. Of the ESC only what is `new`: between its frames nothing is known.
    pub(crate) fn cross<'s>(&self, values: &'s Converted, new: bool) -> impl Iterator<Item = Option<f64>> + 's {
        let [esc, meter] = self.cross;
        let told = values.esc.iter().map(move |value| value.filter(|_| new)).filter(move |_| esc);
        told.chain([values.rpm_bemf].into_iter().filter(move |_| meter))
    }

    /// The flags of a sample, under [`flag_columns`].
    pub(crate) fn flags<'s>(&'s self, sample: &'s RigSample) -> impl Iterator<Item = Option<Flag>> + 's {
        let captures = self.captures().map(|n| sample.rpm[n].verdict.flag());
        let [esc, meter] = self.cross;
        let esc = esc.then(|| sample.esc.and_then(|code| code.verdict.flag()));
        let meter = meter.then(|| sample.back_emf.and_then(|code| code.verdict.flag()));
        captures.chain(self.analogue().map(|n| sample.adc[n].verdict.flag())).chain(esc).chain(meter)
    }
}

/// Names of the columns of raw codes.
pub(crate) fn raw_columns(fitted: &Fitted) -> Vec<String> {
    let captures = fitted.captures().flat_map(|n| ["edges", "span"].map(|what| format!("raw_{}_{what}", CAPTURE_NAMES[n])));
    let analogue = fitted.analogue().flat_map(|n| ["sum", "count", "rms_q8"].map(|what| format!("raw_{}_{what}", ADC_NAMES[n])));
    let [esc, meter] = fitted.cross;
    let esc = esc.then(|| format!("raw_{}_speed", ESC_NAMES[0]));
    let meter = meter.then(|| ["edges", "span"].map(|what| format!("raw_{BACK_EMF_NAME}_{what}")));
    captures.chain(analogue).chain(esc).chain(meter.into_iter().flatten()).collect()
}

/// The raw codes of a sample, under [`raw_columns`].
pub(crate) fn raw_codes(fitted: &Fitted, sample: &RigSample) -> Vec<u32> {
    let captures = fitted.captures().flat_map(|n| [u32::from(sample.rpm[n].edges), sample.rpm[n].span]);
    let analogue = fitted.analogue().flat_map(|n| [sample.adc[n].sum, u32::from(sample.adc[n].count), sample.adc[n].rms_q8]);
    let [esc, meter] = fitted.cross;
    let esc = esc.then(|| sample.esc.map_or(0, |code| code.speed.into()));
    let meter = meter.then(|| sample.back_emf.map_or([0; 2], |code| [code.edges.into(), code.span]));
    captures.chain(analogue).chain(esc).chain(meter.into_iter().flatten()).collect()
}

/// When something happened on the board's clock; `None` where the event does not say.
pub(crate) fn instant(event: &Event) -> Option<Ticks> {
    match event {
        Event::State { at, .. }
        | Event::Faults { at, .. }
        | Event::ScheduleDone { at }
        | Event::StopLoop { at, .. }
        | Event::EscTelemetry { at, .. } => Some(*at),
        _ => None,
    }
}

/// An event in words; `None` of one that is no news to whoever reads the log later. `before` are the faults that were latched already, and
/// `sample` the sample that came after it: its verdicts say which channel a sensor's fault is about.
pub(crate) fn words(event: &Event, before: FaultSet, sample: Option<&RigSample>) -> Option<String> {
    Some(match event {
        Event::State { from, to, .. } => format!("state: {} to {}", from.words(), to.words()),
        Event::Faults { faults, .. } => {
            let new = faults.iter().filter(|fault| !before.contains(*fault));
            let each: Vec<String> = new.map(|fault| fault_words(fault, sample)).collect();
            if each.is_empty() {
                return None;
            }
            each.join("; ")
        }
        Event::Refused(reasons) => format!("refused: {}", reasons.words().collect::<Vec<_>>().join("; ")),
        Event::ScheduleDone { .. } => "schedule done".to_owned(),
        Event::Settings(SettingsNews::Saved) => "settings saved".to_owned(),
        Event::Settings(news) => format!("settings: {}", news.words()),
        Event::Panicked { line, file } => {
            let file: String = file.iter().take_while(|b| **b != 0).map(|b| char::from(*b)).collect();
            format!("before the last reset: panic at {file}:{line}")
        }
        Event::Crashed(crash) => format!("before the last reset: {} at {:#010x}", crash.cause.words(), crash.pc),
        Event::Clock(news) if news.crystal_hz == 0 => {
            format!("no crystal: the internal oscillator is in use ({} Hz measured)", news.measured_hz)
        }
        Event::EscTelemetry { verdict, .. } => verdict.words().to_owned(),
        Event::StopLoop { open, .. } => format!("stop loop {}", if *open { "opened" } else { "closed" }),
        Event::Clock(_) | Event::Accepted | Event::Schedule(_) => return None,
    })
}

/// A fault, with the channels that it is about.
fn fault_words(fault: Fault, sample: Option<&RigSample>) -> String {
    let mut text = fault.words().to_owned();
    let Some(sample) = sample else { return text };
    let captures = |wanted: &[CaptureVerdict]| -> Vec<&str> {
        let codes = CAPTURE_NAMES.iter().zip(&sample.rpm);
        codes.filter(|(_, code)| wanted.contains(&code.verdict)).map(|(name, _)| *name).collect()
    };
    let about = match fault {
        Fault::SensorLost => captures(&[CaptureVerdict::Lost]),
        Fault::SensorDisagreement => {
            captures(&[CaptureVerdict::Disagrees, CaptureVerdict::Missed, CaptureVerdict::Doubled, CaptureVerdict::Lost])
        }
        Fault::AdcLost => {
            let codes = ADC_NAMES.iter().zip(&sample.adc);
            let gone = |verdict: AdcVerdict| verdict == AdcVerdict::Missing || verdict.is_stuck();
            codes.filter(|(_, code)| gone(code.verdict)).map(|(name, _)| *name).collect()
        }
        _ => Vec::new(),
    };
    if !about.is_empty() {
        let _ = write!(text, ": {}", about.join(", "));
    }
    text
}

/// What a new calibration says that the old one did not: a tare, or another scale.
pub(crate) fn recalibrated(old: &Calibration, new: &Calibration) -> Option<String> {
    let pairs = || ADC_NAMES.iter().zip(old.adc.iter().zip(&new.adc)).filter(|(_, (a, b))| a != b);
    let tared = pairs().all(|(_, (a, b))| a.gain == b.gain);
    let each: Vec<String> =
        pairs().map(|(name, (_, b))| format!("{name} zero at {} counts, {} a count", b.zero, b.gain)).collect();
    if each.is_empty() {
        return None;
    }
    Some(format!("{}: {}", if tared { "tared" } else { "recalibrated" }, each.join("; ")))
}

/// An event as it stands in a log: its time, then its words.
pub(crate) fn timed(t_s: f64, words: &str) -> String {
    format!("{t_s:.3} s: {words}")
}

#[cfg(test)]
pub(crate) const HELLO: Hello = Hello {
    board: frame::message::BoardId::Rig,
    firmware: [0, 1, 0],
    core_hz: 168_000_000,
    reset_cause: 0x0E,
    present: 0b1111,
    analogue: 0b1_1111,
    config: 0xdead_beef,
};

#[cfg(test)]
mod tests {
    use super::*;
    use frame::calibration::AdcScale;
    use ident::log::Log;

    fn config() -> RigConfig {
        let mut config = RigConfig::of(&Config::thesis_570kv());
        config.calibrated[0] = Some(Calibrated {
            scale: AdcScale { zero: 1427.25, gain: -0.003_659 },
            zero_sigma: 0.02,
            gain_sigma: 2.1e-6,
            residual: 0.000_4,
            worst: 0.000_7,
            points: 6,
            day: 20_781,
        });
        config
    }

    /// The head is one that a reader takes, and it holds what a stranger needs: who, when, how well, and the whole configuration.
    #[test]
    fn the_head_tells_every_scale_with_its_errors_and_its_day() {
        let config = config();
        let mut calibration = config.apply(&Config::thesis_570kv()).calibration();
        calibration.adc[0].zero = 1510.5; // tared
        let lines: String = head(Some(&HELLO), &calibration, Some(&config)).iter().map(|(k, v)| line(k, v)).collect();
        let log = Log::parse("run.csv", format!("# quadrig-log 1\n{lines}t_s,a,b\n0,1,2\n").as_bytes()).expect("a log");
        let thrust = log.meta["calibration_thrust_n"].as_table().expect("a table");
        let float = |key: &str| thrust[key].as_float().unwrap_or_else(|| panic!("{key} in {thrust}"));
        assert_eq!((float("zero_counts"), float("untared_zero_counts"), float("per_count")), (1510.5, 1427.25, -0.003_659));
        assert_eq!(
            (float("zero_sigma"), float("per_count_sigma"), float("residual"), float("worst")),
            (0.02, 2.1e-6, 0.000_4, 0.000_7)
        );
        assert_eq!((thrust["points"].as_integer(), thrust["date"].as_str()), (Some(6), Some("2026-11-24")));
        assert_eq!(log.meta["calibration_voltage_v"]["source"].as_str(), Some("design"));
        assert_eq!(log.meta["calibration_rpm_encoder"]["marks"].as_integer(), Some(25));
        assert_eq!(log.meta["flags"]["11"].as_str(), Some("saturated"));
        assert_eq!(log.meta["firmware"].as_str(), Some("rig 0.1.0"));
        let text = log.meta["rig_config"].as_str().expect("the configuration");
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("rig.toml"), text).expect("a file");
        assert_eq!(file::read(&folder.path().join("rig.toml")).expect("it reads back").0, config);
    }

    #[test]
    fn a_fault_names_the_channels_that_it_is_about_and_is_told_once() {
        let mut sample = RigSample::default();
        sample.rpm[0].verdict = CaptureVerdict::Lost;
        let lost = FaultSet::NONE.with(Fault::SensorLost);
        let event = Event::Faults { faults: lost.with(Fault::OperatorStop), at: Ticks(0) };
        let stop = FaultSet::NONE.with(Fault::OperatorStop);
        assert_eq!(words(&event, stop, Some(&sample)).as_deref(), Some("speed sensor lost: rpm_beam"));
        assert_eq!(words(&event, FaultSet::NONE, None).as_deref(), Some("operator's stop; speed sensor lost"));
        assert_eq!(words(&event, lost.with(Fault::OperatorStop), Some(&sample)), None, "nothing new");
        assert_eq!(words(&Event::Accepted, stop, None), None);
        assert_eq!(timed(12.34, "sensor lost: rpm_beam"), "12.340 s: sensor lost: rpm_beam");
    }

    #[test]
    fn a_tare_is_told_with_its_counts() {
        let old = config().apply(&Config::thesis_570kv()).calibration();
        let mut new = old;
        assert_eq!(recalibrated(&old, &new), None);
        new.adc[1].zero = 2050.125;
        let told = recalibrated(&old, &new).expect("news");
        assert!(told.starts_with("tared: torque_nm zero at 2050.125 counts"), "{told}");
        new.adc[0].gain = -0.004;
        assert!(recalibrated(&old, &new).is_some_and(|told| told.starts_with("recalibrated: thrust_n")));
    }
}
