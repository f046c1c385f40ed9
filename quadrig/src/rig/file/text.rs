//! A configuration as the file that it would be read from.

use super::super::date;
use super::{ANALOGUE, PRESCALER};
use esc_pwm::{Bounds, EscOutput};
use firmware_rig::RigConfig;
use firmware_rig::rig_config::{Answers, Calibrated, EscTelemetry};
use firmware_rig::strain::Bridge;
use frame::units::PulseWidth;
use std::fmt::Write;

/// The file of a configuration; it reads back as the same.
pub(crate) fn text(config: &RigConfig) -> String {
    let mut out = format!("# configuration of a rig board, CRC-32 {:08x}\n", config.digest());
    let mut line = |text: String| {
        out.push_str(&text);
        out.push('\n');
    };
    line(format!("rate_hz = {}", 1000.0 / f64::from(config.log_period_ms)));
    line(format!("link_ms = {}", config.link_ms));
    line(format!("slew_us_per_ms = {}", f64::from(config.slew_ns_per_ms) / 1000.0));
    if let Some(curve) = config.curve {
        line(format!("curve_us = {:?}", curve.map(PulseWidth::as_us)));
    }
    let [beam, opto, hall, encoder] = config.marks;
    if config.marks != [0; 4] {
        line("\n# marks a revolution; what is left out is not fitted\n[speed]".to_owned());
        let fitted = [("beam", beam), ("opto", opto), ("hall", hall), ("encoder", encoder * PRESCALER as u16)];
        fitted.iter().filter(|(_, marks)| *marks > 0).for_each(|(name, marks)| line(format!("{name} = {marks}")));
    }
    let sections = [thrust(config), torque(config), current(config), voltage(config), temperature(config)];
    for (n, section) in sections.into_iter().enumerate().filter(|(n, _)| config.fitted[*n]) {
        line(format!("\n[{}]\n{section}live_zero = {}", ANALOGUE[n], config.live_zero[n]));
    }
    if let Some(EscTelemetry { pole_pairs, asked }) = config.esc_telemetry {
        line(format!(
            "\n# the ESC's own word; asked: it sends only when it is asked (DShot)\n[esc_telemetry]\npole_pairs = {pole_pairs}\nasked = {asked}"
        ));
    }
    if config.back_emf > 0 {
        line(format!("\n[back_emf]\npole_pairs = {}", config.back_emf));
    }
    line(String::new());
    let l = &config.limits;
    limit(&mut line, "speed_rpm", l.speed, |v| v.0);
    limit(&mut line, "thrust_n", l.thrust, |v| v.0);
    limit(&mut line, "torque_nm", l.torque, |v| v.0);
    limit(&mut line, "current_a", l.current, |v| v.0);
    limit(&mut line, "voltage_v", l.voltage, |v| v.0);
    limit(&mut line, "temperature_c", l.temperature, |v| v.0);
    let esc = &config.esc;
    let (answers, hold) = match esc.answers {
        Answers::LongCellsReady => ("long-cells-ready", None),
        Answers::LongReady => ("long-ready", None),
        Answers::Silent { hold_ms } => ("silent", Some(hold_ms)),
    };
    let output = match config.output {
        EscOutput::Pwm => "pwm",
        EscOutput::DShot300 => "dshot300",
        EscOutput::DShot600 => "dshot600",
    };
    line(format!("[esc]\noutput = {output:?}\nanswers = {answers:?}"));
    if let Some(hold) = hold {
        line(format!("hold_ms = {hold}"));
    }
    line(format!("highest_us = {}\npower_ms = {}", esc.highest.as_us(), esc.hold_min_ms));
    line(format!("cells_ms = {}\nready_ms = {}", esc.cells_ms, esc.ready_ms));
    line("\n[calibrated]".to_owned());
    for (name, calibrated) in ANALOGUE.iter().zip(config.calibrated) {
        if let Some(calibrated) = calibrated {
            line(scale(name, &calibrated).trim_end().to_owned());
        }
    }
    out
}

/// The section of a calibrated scale.
pub(crate) fn scale(name: &str, c: &Calibrated) -> String {
    let mut out = format!("[calibrated.{name}]\nzero_counts = {}\nzero_sigma = {}\n", c.scale.zero, c.zero_sigma);
    let _ = writeln!(out, "per_count = {}\nper_count_sigma = {}", c.scale.gain, c.gain_sigma);
    let _ = writeln!(out, "residual = {}\nworst = {}\npoints = {}", c.residual, c.worst, c.points);
    if c.day > 0 {
        let _ = writeln!(out, "date = {:?}", date::text(c.day));
    }
    out
}

fn limit<T: Copy>(line: &mut impl FnMut(String), name: &str, bounds: Bounds<T>, number: impl Fn(T) -> f32) {
    line(format!("[limits.{name}]"));
    if let Some(low) = bounds.low {
        line(format!("low = {}", number(low)));
    }
    if let Some(high) = bounds.high {
        line(format!("high = {}", number(high)));
    }
    line(format!("ms = {}\n", bounds.ms));
}

fn thrust(config: &RigConfig) -> String {
    let s = &config.strain;
    let bridge = match s.bridge {
        Bridge::Quarter => "quarter",
        Bridge::Half => "half",
        Bridge::Full => "full",
    };
    let mut out = format!("bridge = {bridge:?}\ngauge_factor = {}\nexcitation_v = {}\n", s.gauge_factor, s.excitation.0);
    let _ = writeln!(out, "gain = {}\nzero_v = {}\ndivider = {}", s.gain, s.zero.0, s.divider);
    let _ = writeln!(out, "down_is_positive = {}\nlength_m = {}", s.down_is_positive, s.beam.length_m);
    let _ = writeln!(out, "width_m = {}\nheight_m = {}\nmodulus_pa = {:e}", s.beam.width_m, s.beam.height_m, s.beam.modulus_pa);
    let _ = writeln!(out, "density_kg_m3 = {}\nyield_pa = {:e}", s.beam.density, s.beam.yield_pa);
    out
}

fn torque(config: &RigConfig) -> String {
    let t = &config.torque;
    format!("arm_m = {}\nvolts_per_newton = {}\nzero_v = {}\n", t.arm_m, t.volts_per_newton, t.zero.0)
}

fn current(config: &RigConfig) -> String {
    let c = &config.current;
    format!("shunt_ohm = {}\ngain = {}\nzero_v = {}\n", c.shunt_ohm, c.gain, c.zero.0)
}

fn voltage(config: &RigConfig) -> String {
    let v = &config.voltage;
    format!(
        "# volts at the converter over volts of the supply, and without one\ndivider = {}\nzero_v = {}\n",
        v.divider, v.zero.0
    )
}

fn temperature(config: &RigConfig) -> String {
    let t = &config.temperature;
    format!("# volts at 0 degC\nzero_v = {}\nvolts_per_kelvin = {}\n", t.zero.0, t.volts_per_kelvin)
}
