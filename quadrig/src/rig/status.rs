//! `quadrig rig status`: what the board reads, how it is calibrated, and how it is.
//!
//! What it is: one sample, the configuration's calibrations and one report of the board's own health, as text.
//! What can go wrong: a board that reports no health within its second and a half says so by its absence.
//! Units: as printed.
//! Reference: specification `rig.md`, "Acquisition" ("jitter measured and reported"); `frame::message::Health`.

use super::{configure, date, fitted, reset_cause};
use crate::Failure;
use crate::board::{Board, Heard};
use firmware_rig::RigConfig;
use frame::calibration::{Calibration, Converted};
use frame::esc::{BACK_EMF_NAME, ESC_NAMES, ESC_UNITS};
use frame::message::{Command, Health, Hello, Message};
use frame::rig::{ADC_NAMES, CAPTURE_NAMES, Fault, RigSample};
use frame::units::Ticks;
use std::fmt::Write;
use std::time::Duration;

/// The board reports once a second.
const WAIT: Duration = Duration::from_millis(2_500);
/// Units of the analogue channels.
const UNITS: [&str; 5] = ["N", "N.m", "A", "V", "degC"];
/// Core cycles in a millisecond at 168 MHz: what a control tick has.
const CYCLES_MS: f64 = 1.0e-3;

/// Everything that a status is made of.
struct Heed {
    hello: Hello,
    calibration: Calibration,
    config: RigConfig,
    sample: Option<RigSample>,
    health: Option<Health>,
}

/// Prints the status.
pub(super) fn run(board: &mut Board) -> Result<(), Failure> {
    let mut calibration = None;
    let hello = board.ask(Command::Identify, |_| {}, |m| if let Message::Hello(hello) = m { Some(*hello) } else { None })?;
    let config = configure::in_force(board)?;
    let (mut sample, mut health) = (None, None);
    let until = board.now() + WAIT;
    board.send(Command::Identify)?;
    while (sample.is_none() || health.is_none() || calibration.is_none()) && board.now() < until {
        let Heard::Messages(messages) = board.hear() else { return Err(board.gone().into()) };
        for received in messages {
            match received.message {
                Message::Rig(told) => sample = Some(told),
                Message::Health(told) => health = Some(told),
                Message::Calibration(told) => calibration = Some(told),
                _ => {}
            }
        }
    }
    let calibration = calibration.ok_or("the board tells no calibration; expected a rig board: `quadrig rig identify`")?;
    crate::say::text(&text(&Heed { hello, calibration, config, sample, health }));
    Ok(())
}

fn text(heed: &Heed) -> String {
    let Hello { firmware: [major, minor, patch], core_hz, reset_cause: cause, config, .. } = heed.hello;
    let mut out = format!(
        "rig board, firmware {major}.{minor}.{patch}, core {} MHz; last reset: {}\n",
        core_hz / 1_000_000,
        reset_cause(cause)
    );
    let _ = writeln!(out, "fitted: {}; configuration {config:08x}\n", fitted(&heed.hello));
    match &heed.sample {
        Some(sample) => readings(&mut out, heed, sample),
        None => out.push_str("no sample arrived\n"),
    }
    scales(&mut out, heed);
    match &heed.health {
        Some(health) => {
            condition(&mut out, health, core_hz);
            let [good, damaged, errors] = health.esc;
            if heed.config.esc_telemetry.is_some() {
                let _ = writeln!(
                    out,
                    "ESC          {good} frames heard, {damaged} damaged, {errors} bytes with an error of the line"
                );
            }
        }
        None => out.push_str("\nno report of its health arrived\n"),
    }
    out
}

fn readings(out: &mut String, heed: &Heed, sample: &RigSample) {
    let faults: Vec<&str> = sample.faults.iter().map(Fault::words).collect();
    let faults = if faults.is_empty() { "no fault is latched".to_owned() } else { format!("latched: {}", faults.join(", ")) };
    let _ = writeln!(out, "{} at {:.0} us; {faults}", sample.state.words(), sample.pulse.as_us());
    let values = heed.calibration.convert(sample);
    let speeds = CAPTURE_NAMES.iter().zip(heed.calibration.marks).zip(values.rpm.iter().zip(&sample.rpm));
    for ((name, _), (value, code)) in speeds.filter(|((_, marks), _)| *marks > 0) {
        let value = value.map_or_else(|| "-".to_owned(), |v| format!("{v:.1} rev/min"));
        let flag = code.verdict.flag().map_or("", |flag| flag.words);
        let _ = writeln!(out, "{name:<12} {value:>18}  {:>5} edges in {} ticks  {flag}", code.edges, code.span);
    }
    for (n, name) in ADC_NAMES.iter().enumerate().filter(|(n, _)| heed.config.fitted[*n]) {
        let code = &sample.adc[n];
        let value = values.adc[n].map_or_else(|| "-".to_owned(), |v| format!("{v:.4} {}", UNITS[n]));
        let mean = f64::from(code.sum) / f64::from(code.count.max(1));
        let flag = code.verdict.flag().map_or("", |flag| flag.words);
        let _ = writeln!(out, "{name:<12} {value:>18}  {mean:>9.3} counts, rms {:.2}  {flag}", f64::from(code.rms_q8) / 256.0);
    }
    second(out, sample, &values);
}

/// What the ESC and the back-EMF meter say, where they are fitted.
fn second(out: &mut String, sample: &RigSample, values: &Converted) {
    if let Some(code) = &sample.esc {
        for ((name, unit), value) in ESC_NAMES.iter().zip(ESC_UNITS).zip(values.esc) {
            let value = value.map_or_else(|| "-".to_owned(), |v| format!("{v:.2} {unit}"));
            let age = if code.age_ms < u16::MAX { format!("{} ms ago", code.age_ms) } else { "never heard".to_owned() };
            let flag = code.verdict.flag().map_or("", |flag| flag.words);
            let _ = writeln!(out, "{name:<14} {value:>16}  {age:>11}  {flag}");
        }
    }
    if let Some(code) = &sample.back_emf {
        let value = values.rpm_bemf.map_or_else(|| "-".to_owned(), |v| format!("{v:.1} rev/min"));
        let flag = code.verdict.flag().map_or("", |flag| flag.words);
        let _ = writeln!(out, "{BACK_EMF_NAME:<12} {value:>18}  {:>5} edges in {} ticks  {flag}", code.edges, code.span);
    }
}

fn scales(out: &mut String, heed: &Heed) {
    out.push_str("\ncalibration\n");
    for (n, name) in ADC_NAMES.iter().enumerate().filter(|(n, _)| heed.config.fitted[*n]) {
        let Some(found) = heed.config.calibrated[n] else {
            let _ = writeln!(out, "{name:<12} as designed: {} {} a count", heed.calibration.adc[n].gain, UNITS[n]);
            continue;
        };
        let day = if found.day > 0 { date::text(found.day) } else { "day unknown".to_owned() };
        let _ = writeln!(
            out,
            "{name:<12} {} +- {} {unit} a count, zero at {} +- {} counts; {} points, residuals {} {unit} rms, {} {unit} at most; {day}",
            found.scale.gain,
            found.gain_sigma,
            found.scale.zero,
            found.zero_sigma,
            found.points,
            found.residual,
            found.worst,
            unit = UNITS[n],
        );
    }
}

fn condition(out: &mut String, health: &Health, core_hz: u32) {
    let [shortest, longest] = health.tick_span.map(|ticks| f64::from(ticks) / f64::from(Ticks::HZ) * 1.0e6);
    let _ = writeln!(out, "\nhealth\njitter       ticks {shortest:.2} to {longest:.2} us apart in the last second");
    let cycles = |n: u32| if n > 0 { n.to_string() } else { "not measured".to_owned() };
    let share = 100.0 * f64::from(health.tick_cycles) / (f64::from(core_hz) * CYCLES_MS);
    let _ = writeln!(
        out,
        "cycles       {} at most in a tick ({share:.1} % of it), {} in a capture interrupt",
        cycles(health.tick_cycles),
        cycles(health.capture_cycles)
    );
    if health.stack_size > 0 {
        let _ = writeln!(out, "stack        {} of {} bytes were never used", health.stack_free, health.stack_size);
    } else {
        out.push_str("stack        not measured\n");
    }
    let [forwards, backwards] = health.steps;
    let direction = match (forwards, backwards) {
        (0, 0) => "no steps with channel B",
        (f, b) if f > b => "forwards",
        _ => "backwards",
    };
    let _ = writeln!(out, "direction    {direction}: {forwards} steps forwards, {backwards} backwards in the last second");
    let _ = writeln!(out, "index        {} marks since the reset", health.index);
    let [good, damaged, replayed] = health.frames;
    let _ = writeln!(out, "line         {good} commands heard, {damaged} frames damaged, {replayed} replayed");
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::HELLO;
    use firmware_rig::{Config, EscTelemetry};
    use frame::esc::{EscCode, EscVerdict};
    use frame::rig::CaptureCode;

    #[test]
    fn everything_of_the_boards_health_is_shown() {
        let factory = Config::thesis_570kv();
        let health = Health {
            tick_cycles: 14_900,
            capture_cycles: 210,
            stack_free: 21_000,
            stack_size: 96_408,
            tick_span: [83_958, 84_084],
            frames: [12, 3, 1],
            steps: [1_708, 2],
            index: 77,
            esc: [320, 2, 5],
        };
        let esc = EscCode { verdict: EscVerdict::Nominal, voltage: 1148, speed: 451, age_ms: 7, ..EscCode::default() };
        let sample = RigSample { at: Ticks(0), esc: Some(esc), back_emf: Some(CaptureCode::default()), ..RigSample::default() };
        let telemetry = EscTelemetry { pole_pairs: 11, asked: false };
        let config = RigConfig { esc_telemetry: Some(telemetry), back_emf: 11, ..RigConfig::of(&factory) };
        let heed = Heed {
            hello: HELLO,
            calibration: config.apply(&factory).calibration(),
            config,
            sample: Some(sample),
            health: Some(health),
        };
        let said = text(&heed);
        for word in [
            "999.50 to 1001.00 us",
            "14900 at most in a tick (8.9 % of it), 210 in a capture interrupt",
            "21000 of 96408 bytes",
            "forwards: 1708 steps forwards, 2 backwards",
            "77 marks",
            "12 commands heard, 3 frames damaged, 1 replayed",
            "configuration deadbeef",
            "no fault is latched",
            "thrust_n     as designed",
            "voltage_esc_v           11.48 V     7 ms ago",
            "rpm_esc         4100.00 rev/min     7 ms ago",
            "rpm_bemf            0.0 rev/min",
            "320 frames heard, 2 damaged, 5 bytes with an error",
        ] {
            assert!(said.contains(word), "{word:?} is not in\n{said}");
        }
        let bare = text(&Heed { health: Some(Health::default()), ..heed });
        assert!(bare.contains("not measured at most in a tick") && bare.contains("stack        not measured"), "{bare}");
    }
}
