//! The text of a log.
//!
//! What it is: `quadrig-log 1` as this generator writes it, with no code of the reader.
//! What can go wrong: two time stamps that round to the same value; four decimals keep them apart at these rates.
//! Units: as the column names say.
//! Reference: specification `formats.md`, "Rig log".

use super::rig::Rig;
use super::run::Run;
use std::fmt::Write;

/// The log as text.
#[must_use]
pub fn text(rig: &Rig, run: &Run) -> String {
    let mut s = String::from("# quadrig-log 1\n");
    for line in &rig.meta {
        s.push_str("# ");
        s.push_str(line);
        s.push('\n');
    }
    s.push_str("t_s");
    for (name, _) in &run.columns {
        s.push(',');
        s.push_str(name);
    }
    s.push('\n');
    for (row, t) in run.t.iter().enumerate() {
        let _ = write!(s, "{t:.4}");
        for (name, y) in &run.columns {
            let v = y[row];
            let v = if v == 0.0 { 0.0 } else { v };
            s.push(',');
            if v.is_finite() {
                let digits = match *name {
                    "torque_nm" => 5,
                    "thrust_n" | "thrust_rms_n" => 4,
                    "current_a" | "voltage_v" => 3,
                    "pulse_us" => 1,
                    n if n.starts_with("rpm") => 1,
                    _ => 2,
                };
                let _ = write!(s, "{v:.digits$}");
            }
        }
        s.push('\n');
    }
    s
}

/// What is true of a scenario, in words: for a person who looks at one run.
#[must_use]
pub fn truth(s: &super::scenario::Scenario) -> String {
    let mut out = format!(
        "seed {}\nhidden {:?}\nschedules {} / {}\nhz {} rows {}\n",
        s.seed,
        s.hidden,
        s.schedules[0].shape.name(),
        s.schedules[1].shape.name(),
        s.rig.hz,
        (s.schedules[0].duration * s.rig.hz) as usize
    );
    for ((e, size), shown) in s.effects.iter().zip(&s.sizes).zip(&s.shown) {
        let _ = writeln!(
            out,
            "{} size {size:.2} shown by {shown}, channel {}, form {}, strength {}, b {}, c {}, t0 {}",
            e.id,
            e.channel,
            e.form,
            e.signed(),
            e.b,
            e.c,
            e.t0
        );
        for (name, value) in e.truth(&s.rig) {
            let _ = writeln!(out, "  {name} = {value}");
        }
    }
    out
}
