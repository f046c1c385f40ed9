//! A rig's configuration as a file.
//!
//! What it is: TOML to [`RigConfig`] and back. A section that is not there says that the channel is not fitted.
//! What can go wrong: an unknown key, a missing one and a value out of its range are refused with file, line and column.
//! Units: each key carries its own.
//! Reference: specification `rig.md`, "Partial rigs are normal"; `docs/configuration.md` lists every key.

use super::date;
use crate::Failure;
use crate::trouble::unread;
use esc_pwm::{Bounds, EscOutput};
use firmware_rig::config::{CurrentChannel, TemperatureChannel, TorqueChannel, VoltageChannel};
use firmware_rig::rig_config::{Answers, Calibrated, EscProfile, EscTelemetry, MOST_POLE_PAIRS};
use firmware_rig::strain::{Beam, Bridge, StrainChannel};
use firmware_rig::{Config, RigConfig};
use frame::calibration::AdcScale;
use frame::units::{Ampere, Celsius, Newton, NewtonMetre, PulseWidth, RevPerMin, Volt};
use serde::Deserialize;
use std::ops::Range;
use std::path::Path;
use toml::Spanned;

/// Names of the analogue channels in the file.
pub(crate) const ANALOGUE: [&str; 5] = ["thrust", "torque", "current", "voltage", "temperature"];
/// The encoder's steps of which the board's timer makes one capture.
const PRESCALER: f64 = 4.0;

type Number = Spanned<f64>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    rate_hz: Number,
    link_ms: Option<Number>,
    slew_us_per_ms: Option<Number>,
    curve_us: Option<Spanned<[f64; 5]>>,
    speed: Option<Speed>,
    thrust: Option<Thrust>,
    torque: Option<Torque>,
    current: Option<Current>,
    voltage: Option<Voltage>,
    temperature: Option<Temperature>,
    #[serde(default)]
    limits: Limits,
    esc: Option<Esc>,
    calibrated: Option<Scales>,
    esc_telemetry: Option<Telemetry>,
    back_emf: Option<BackEmf>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Telemetry {
    pole_pairs: Number,
    asked: Option<Spanned<bool>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BackEmf {
    pole_pairs: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Speed {
    beam: Option<Number>,
    opto: Option<Number>,
    hall: Option<Number>,
    encoder: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Thrust {
    bridge: BridgeName,
    gauge_factor: Number,
    excitation_v: Number,
    gain: Number,
    zero_v: Number,
    divider: Number,
    down_is_positive: bool,
    length_m: Number,
    width_m: Number,
    height_m: Number,
    modulus_pa: Number,
    density_kg_m3: Number,
    yield_pa: Number,
    live_zero: Option<bool>,
}

#[derive(Deserialize, Clone, Copy)]
#[serde(rename_all = "lowercase")]
enum BridgeName {
    Quarter,
    Half,
    Full,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Torque {
    arm_m: Number,
    volts_per_newton: Number,
    zero_v: Number,
    live_zero: Option<bool>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Current {
    shunt_ohm: Number,
    gain: Number,
    zero_v: Number,
    live_zero: Option<bool>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Voltage {
    divider: Number,
    zero_v: Option<Number>,
    live_zero: Option<bool>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Temperature {
    zero_v: Number,
    volts_per_kelvin: Number,
    live_zero: Option<bool>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct Limits {
    speed_rpm: Option<Limit>,
    thrust_n: Option<Limit>,
    torque_nm: Option<Limit>,
    current_a: Option<Limit>,
    voltage_v: Option<Limit>,
    temperature_c: Option<Limit>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Limit {
    low: Option<Number>,
    high: Option<Number>,
    ms: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Esc {
    answers: AnswersName,
    hold_ms: Option<Number>,
    highest_us: Number,
    power_ms: Number,
    cells_ms: Number,
    ready_ms: Number,
    output: Option<OutputName>,
}

#[derive(Deserialize, Clone, Copy)]
#[serde(rename_all = "lowercase")]
enum OutputName {
    Pwm,
    DShot300,
    DShot600,
}

#[derive(Deserialize, Clone, Copy, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
enum AnswersName {
    LongCellsReady,
    LongReady,
    Silent,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Scales {
    thrust: Option<Scale>,
    torque: Option<Scale>,
    current: Option<Scale>,
    voltage: Option<Scale>,
    temperature: Option<Scale>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Scale {
    zero_counts: Number,
    zero_sigma: Option<Number>,
    per_count: Number,
    per_count_sigma: Option<Number>,
    residual: Number,
    worst: Number,
    points: Number,
    date: Option<Spanned<String>>,
}

/// What was refused: where, and what was expected.
type Refused = (Range<usize>, String);

/// A number within its range.
fn within(number: &Number, low: f64, high: f64) -> Result<f32, Refused> {
    let value = *number.get_ref();
    if (low..=high).contains(&value) {
        Ok(value as f32)
    } else {
        Err((number.span(), format!("expected a number from {low} to {high}, found {value}")))
    }
}

/// A whole number within its range.
fn whole(number: &Number, low: f64, high: f64) -> Result<u32, Refused> {
    let value = *number.get_ref();
    if value.fract() == 0.0 && (low..=high).contains(&value) {
        Ok(value as u32)
    } else {
        Err((number.span(), format!("expected a whole number from {low} to {high}, found {value}")))
    }
}

/// A number between two sizes, on either side of zero.
fn size_within(number: &Number, low: f64, high: f64) -> Result<f32, Refused> {
    let value = *number.get_ref();
    if (low..=high).contains(&value.abs()) {
        Ok(value as f32)
    } else {
        Err((number.span(), format!("expected a size from {low} to {high}, found {value}")))
    }
}

/// A finite number.
fn finite(number: &Number) -> Result<f32, Refused> {
    within(number, f64::from(f32::MIN), f64::from(f32::MAX))
}

/// A finite number that is not negative.
fn error(number: &Number) -> Result<f32, Refused> {
    within(number, 0.0, f64::from(f32::MAX))
}

impl Limit {
    fn bounds<T>(&self, unit: impl Fn(f32) -> T, most: f64, longest: f64) -> Result<Bounds<T>, Refused> {
        let limit = |n: &Option<Number>| n.as_ref().map(|n| within(n, -most, most)).transpose();
        let (low, high) = (limit(&self.low)?, limit(&self.high)?);
        if let (Some(low), Some(high), Some(number)) = (low, high, &self.high)
            && low >= high
        {
            return Err((number.span(), format!("expected a limit above the low one of {low}, found {high}")));
        }
        let ms = whole(&self.ms, 1.0, longest)? as u16;
        Ok(Bounds { low: low.map(&unit), high: high.map(&unit), ms })
    }
}

/// A limit from its section; as it was where there is none.
fn bounds<T: Copy>(
    section: &Option<Limit>,
    before: Bounds<T>,
    unit: impl Fn(f32) -> T,
    most: f64,
    longest: f64,
) -> Result<Bounds<T>, Refused> {
    section.as_ref().map_or(Ok(before), |limit| limit.bounds(unit, most, longest))
}

impl File {
    /// The configuration, and whether it says anything of calibrated scales.
    fn config(&self) -> Result<(RigConfig, bool), Refused> {
        let mut config = RigConfig::of(&Config::thesis_570kv());
        self.times(&mut config)?;
        self.channels(&mut config)?;
        let l = &self.limits;
        let to = &mut config.limits;
        to.speed = bounds(&l.speed_rpm, to.speed, RevPerMin, 30_000.0, 10_000.0)?;
        to.thrust = bounds(&l.thrust_n, to.thrust, Newton, 10_000.0, 1_000.0)?;
        to.torque = bounds(&l.torque_nm, to.torque, NewtonMetre, 1_000.0, 10_000.0)?;
        to.current = bounds(&l.current_a, to.current, Ampere, 1_000.0, 1_000.0)?;
        to.voltage = bounds(&l.voltage_v, to.voltage, Volt, 100.0, 1_000.0)?;
        to.temperature = bounds(&l.temperature_c, to.temperature, Celsius, 500.0, 60_000.0)?;
        if let Some(esc) = &self.esc {
            config.esc = esc.profile()?;
            config.output = match esc.output {
                None | Some(OutputName::Pwm) => EscOutput::Pwm,
                Some(OutputName::DShot300) => EscOutput::DShot300,
                Some(OutputName::DShot600) => EscOutput::DShot600,
            };
        }
        if let Some(scales) = &self.calibrated {
            config.calibrated = scales.all()?;
        }
        let pairs = |n: &Number| whole(n, 1.0, f64::from(MOST_POLE_PAIRS)).map(|pairs| pairs as u16);
        let output = config.output;
        let telemetry = |t: &Telemetry| match &t.asked {
            Some(asked) if *asked.get_ref() && !output.is_digital() => {
                Err((asked.span(), "pulses cannot ask: expected an output of dshot300 or dshot600 in [esc]".to_owned()))
            }
            asked => {
                let asked = asked.as_ref().is_some_and(|asked| *asked.get_ref());
                Ok(EscTelemetry { pole_pairs: pairs(&t.pole_pairs)?, asked })
            }
        };
        config.esc_telemetry = self.esc_telemetry.as_ref().map(telemetry).transpose()?;
        config.back_emf = self.back_emf.as_ref().map_or(Ok(0), |meter| pairs(&meter.pole_pairs))?;
        if config.marks == [0; 4] && config.fitted == [false; 5] {
            return Err((0..0, "nothing is fitted: expected a section [speed], [thrust] or another channel".to_owned()));
        }
        if config.in_range() {
            Ok((config, self.calibrated.is_some()))
        } else {
            Err((0..0, "a value is out of its range; expected the ranges of docs/configuration.md".to_owned()))
        }
    }

    fn times(&self, config: &mut RigConfig) -> Result<(), Refused> {
        let rate = *self.rate_hz.get_ref();
        let period = 1000.0 / rate;
        if !(1.0..=1000.0).contains(&rate) || (period - period.round()).abs() > 1e-6 * period {
            return Err((self.rate_hz.span(), format!("expected a rate from 1 to 1000 that divides 1000, found {rate}")));
        }
        config.log_period_ms = period.round() as u16;
        if let Some(ms) = &self.link_ms {
            config.link_ms = whole(ms, 200.0, 5000.0)? as u16;
        }
        if let Some(slew) = &self.slew_us_per_ms {
            config.slew_ns_per_ms = (f64::from(within(slew, 0.01, 1000.0)?) * 1000.0).round() as u32;
        }
        config.curve = None;
        if let Some(curve) = &self.curve_us {
            let points = curve.get_ref();
            if !(points.is_sorted() && points.iter().all(|us| (1000.0..=2000.0).contains(us))) {
                return Err((curve.span(), "expected five rising pulses from 1000 to 2000 us".to_owned()));
            }
            config.curve = Some(points.map(|us| PulseWidth((us * 1000.0).round() as u32)));
        }
        Ok(())
    }

    fn channels(&self, config: &mut RigConfig) -> Result<(), Refused> {
        let marks = |n: &Option<Number>| n.as_ref().map_or(Ok(0), |n| whole(n, 1.0, 100.0).map(|m| m as u16));
        config.marks = [0; 4];
        if let Some(Speed { beam, opto, hall, encoder }) = &self.speed {
            let steps = encoder.as_ref().map_or(Ok(0), |n| {
                let steps = whole(n, PRESCALER, 100.0 * PRESCALER)?;
                if steps.is_multiple_of(PRESCALER as u32) {
                    Ok((steps / PRESCALER as u32) as u16)
                } else {
                    Err((n.span(), format!("expected a multiple of {PRESCALER}, the board's prescaler; found {steps}")))
                }
            })?;
            config.marks = [marks(beam)?, marks(opto)?, marks(hall)?, steps];
        }
        config.fitted = [
            self.thrust.is_some(),
            self.torque.is_some(),
            self.current.is_some(),
            self.voltage.is_some(),
            self.temperature.is_some(),
        ];
        let alive = [
            self.thrust.as_ref().and_then(|s| s.live_zero),
            self.torque.as_ref().and_then(|s| s.live_zero),
            self.current.as_ref().and_then(|s| s.live_zero),
            self.voltage.as_ref().and_then(|s| s.live_zero),
            self.temperature.as_ref().and_then(|s| s.live_zero),
        ];
        for (to, alive) in config.live_zero.iter_mut().zip(alive) {
            *to = alive.unwrap_or(*to);
        }
        if let Some(thrust) = &self.thrust {
            config.strain = thrust.channel()?;
        }
        if let Some(t) = &self.torque {
            config.torque = TorqueChannel {
                arm_m: within(&t.arm_m, 1e-3, 10.0)?,
                volts_per_newton: size_within(&t.volts_per_newton, 1e-4, 1e3)?,
                zero: Volt(within(&t.zero_v, 0.0, 60.0)?),
            };
        }
        if let Some(c) = &self.current {
            config.current = CurrentChannel {
                shunt_ohm: within(&c.shunt_ohm, 1e-6, 10.0)?,
                gain: within(&c.gain, 1.0, 1000.0)?,
                zero: Volt(within(&c.zero_v, 0.0, 60.0)?),
            };
        }
        if let Some(v) = &self.voltage {
            config.voltage = VoltageChannel {
                divider: within(&v.divider, 1e-3, 1.0)?,
                zero: Volt(v.zero_v.as_ref().map_or(Ok(0.0), |zero| within(zero, 0.0, 60.0))?),
            };
        }
        if let Some(t) = &self.temperature {
            config.temperature = TemperatureChannel {
                zero: Volt(within(&t.zero_v, 0.0, 60.0)?),
                volts_per_kelvin: size_within(&t.volts_per_kelvin, 1e-5, 1.0)?,
            };
        }
        Ok(())
    }
}

impl Thrust {
    fn channel(&self) -> Result<StrainChannel, Refused> {
        Ok(StrainChannel {
            beam: Beam {
                length_m: within(&self.length_m, 1e-4, 10.0)?,
                width_m: within(&self.width_m, 1e-4, 10.0)?,
                height_m: within(&self.height_m, 1e-4, 10.0)?,
                modulus_pa: within(&self.modulus_pa, 1e6, 1e12)?,
                density: within(&self.density_kg_m3, 1.0, 1e5)?,
                yield_pa: within(&self.yield_pa, 1e6, 1e12)?,
            },
            bridge: match self.bridge {
                BridgeName::Quarter => Bridge::Quarter,
                BridgeName::Half => Bridge::Half,
                BridgeName::Full => Bridge::Full,
            },
            gauge_factor: within(&self.gauge_factor, 0.1, 1000.0)?,
            excitation: Volt(within(&self.excitation_v, 0.1, 60.0)?),
            gain: within(&self.gain, 1.0, 1000.0)?,
            zero: Volt(within(&self.zero_v, 0.0, 60.0)?),
            divider: within(&self.divider, 1e-3, 1.0)?,
            down_is_positive: self.down_is_positive,
        })
    }
}

impl Esc {
    fn profile(&self) -> Result<EscProfile, Refused> {
        let time = |n: &Number| whole(n, 1000.0, 600_000.0);
        let hold_min_ms = time(&self.power_ms)?;
        let answers = match (self.answers, &self.hold_ms) {
            (AnswersName::LongCellsReady, None) => Answers::LongCellsReady,
            (AnswersName::LongReady, None) => Answers::LongReady,
            (AnswersName::Silent, Some(hold)) => {
                let most = f64::from(hold_min_ms - 1).min(60_000.0);
                Answers::Silent { hold_ms: whole(hold, 2000.0, most)? as u16 }
            }
            (AnswersName::Silent, None) => {
                return Err((self.power_ms.span(), "an ESC that is silent: expected hold_ms beside power_ms".to_owned()));
            }
            (_, Some(hold)) => {
                return Err((hold.span(), "hold_ms: expected with an ESC that is silent only; take it out".to_owned()));
            }
        };
        let highest = PulseWidth((f64::from(within(&self.highest_us, 1100.0, 2000.0)?) * 1000.0).round() as u32);
        Ok(EscProfile { answers, highest, hold_min_ms, cells_ms: time(&self.cells_ms)?, ready_ms: time(&self.ready_ms)? })
    }
}

impl Scales {
    fn all(&self) -> Result<[Option<Calibrated>; 5], Refused> {
        let Self { thrust, torque, current, voltage, temperature } = self;
        let mut found = [None; 5];
        for (to, scale) in found.iter_mut().zip([thrust, torque, current, voltage, temperature]) {
            *to = scale.as_ref().map(Scale::calibrated).transpose()?;
        }
        Ok(found)
    }
}

impl Scale {
    fn calibrated(&self) -> Result<Calibrated, Refused> {
        let gain = finite(&self.per_count)?;
        if gain == 0.0 {
            return Err((self.per_count.span(), "expected a scale other than 0".to_owned()));
        }
        let day = self.date.as_ref().map_or(Ok(0), |text| {
            date::day(text.get_ref())
                .ok_or_else(|| (text.span(), format!("expected a date as 2026-01-31, found {:?}", text.get_ref())))
        })?;
        Ok(Calibrated {
            scale: AdcScale { zero: finite(&self.zero_counts)?, gain },
            zero_sigma: self.zero_sigma.as_ref().map_or(Ok(0.0), error)?,
            gain_sigma: self.per_count_sigma.as_ref().map_or(Ok(0.0), error)?,
            residual: error(&self.residual)?,
            worst: error(&self.worst)?,
            points: whole(&self.points, 0.0, 255.0)? as u8,
            day,
        })
    }
}

/// Reads a file. The second value says whether it names calibrated scales: without, a board keeps its own.
pub(crate) fn read(path: &Path) -> Result<(RigConfig, bool), Failure> {
    let text = std::fs::read_to_string(path).map_err(unread(&path))?;
    parse(&text, path).map_err(Into::into)
}

fn parse(text: &str, path: &Path) -> Result<(RigConfig, bool), String> {
    let file: File = section(text, path, "docs/configuration.md")?;
    file.config().map_err(|reason| placed(text, path, reason))
}

/// A refusal with its place.
fn placed(text: &str, path: &Path, (span, reason): Refused) -> String {
    let before = text.get(..span.start).unwrap_or(text);
    let (line, column) = (before.matches('\n').count() + 1, before.chars().rev().take_while(|c| *c != '\n').count() + 1);
    format!("{}:{line}:{column}: {reason}", path.display())
}

fn section<T: serde::de::DeserializeOwned>(text: &str, path: &Path, page: &str) -> Result<T, String> {
    let said = |error: &toml::de::Error| hal_sim::scenario::in_words(&error.message().replace('\n', " "), page);
    toml::from_str(text).map_err(|error| placed(text, path, (error.span().unwrap_or(0..0), said(&error))))
}

/// What a file says of calibrated scales, whatever else stands in it.
#[derive(Deserialize)]
struct ScalesAlone {
    calibrated: Option<Scales>,
}

/// The calibrated scales of a file: of a configuration, or of one that `quadrig calibrate` wrote.
pub(crate) fn scales(path: &Path) -> Result<[Option<Calibrated>; 5], Failure> {
    let text = std::fs::read_to_string(path).map_err(unread(&path))?;
    let file: ScalesAlone = section(&text, path, "docs/calibration.md")?;
    let found = file.calibrated.as_ref().map_or(Ok([None; 5]), Scales::all).map_err(|reason| placed(&text, path, reason))?;
    if found == [None; 5] {
        return Err(format!("{}: no section [calibrated.X]; expected a file of `quadrig calibrate`", path.display()).into());
    }
    Ok(found)
}

/// Whether a file holds calibrated scales and nothing else.
pub(crate) fn is_scales_alone(path: &Path) -> bool {
    let table = std::fs::read_to_string(path).ok().and_then(|text| text.parse::<toml::Table>().ok());
    table.is_some_and(|table| table.len() == 1 && table.contains_key("calibrated"))
}

/// The torque arm that a configuration's text names, m.
pub(crate) fn arm_of(text: &str) -> Option<f64> {
    let table: toml::Table = text.parse().ok()?;
    table.get("torque")?.get("arm_m")?.as_float()
}

mod text;
pub(crate) use text::{scale, text};

#[cfg(test)]
mod tests;
