//! The batch as two tables: a row a run, and a row a parameter.
//!
//! What it is: plain CSV (UTF-8, commas, a point, empty for nothing) with the same columns whatever the runs, so that tables of several
//! batches can be put under each other.
//! What can go wrong: nothing.
//! Units: in the headers; k_T in N.s2, k_Q in N.m.s2, KV in rev/min/V.
//! Reference: RFC 4180; read by pandas, polars and DuckDB without options.

use super::result::Done;
use crate::Failure;
use ident::log::MODELLED;

/// Constants, as they are named where they are found and in the table.
const CONSTANTS: [(&str, &str); 7] = [
    ("k_T", "k_t_n_s2"),
    ("k_Q", "k_q_nm_s2"),
    ("KV", "kv_rpm_per_v"),
    ("R", "r_ohm"),
    ("I0", "i0_a"),
    ("tau_up", "tau_up_s"),
    ("tau_down", "tau_down_s"),
];

fn number(v: f64) -> String {
    if v.is_finite() { format!("{v:?}") } else { String::new() }
}

/// Both tables by their names, with their heads.
pub(super) fn heads() -> Result<[(&'static str, Vec<u8>); 2], Failure> {
    Ok([("manifest.csv", manifest(&[])?), ("effects.csv", effects(&[])?)])
}

/// A row for each run.
pub(super) fn manifest(done: &[Done]) -> Result<Vec<u8>, Failure> {
    let mut out = csv::Writer::from_writer(Vec::new());
    let mut head: Vec<String> =
        ["file", "state", "message", "sha256", "rows", "seconds", "motor", "propeller", "verdict", "named", "unexplained"]
            .map(str::to_owned)
            .to_vec();
    for (_, name) in CONSTANTS {
        head.extend([name.to_owned(), format!("{name}_se")]);
    }
    for channel in MODELLED {
        head.extend(["floor", "before", "after"].map(|what| format!("{channel}_{what}")));
    }
    out.write_record(&head)?;
    for d in done {
        let mut named: Vec<&str> = d.effects.iter().map(|e| e.effect.as_str()).collect();
        named.dedup();
        let rows = if d.state == "closed" { d.rows.to_string() } else { String::new() };
        let seconds = d.seconds.map(number).unwrap_or_default();
        let mut row = vec![d.file.clone(), d.state.clone(), d.message.clone(), d.sha256.clone(), rows, seconds];
        row.extend(d.named.clone());
        row.extend([d.verdict.clone(), named.join(";"), d.unexplained.join(";")]);
        for (name, _) in CONSTANTS {
            let found = d.constants.iter().find(|c| c.name == name);
            row.extend(found.map_or_else(|| [String::new(), String::new()], |c| [number(c.value), number(c.se)]));
        }
        for channel in MODELLED {
            let found = d.channels.iter().find(|c| c.name == channel);
            row.extend(found.map_or_else(|| [const { String::new() }; 3], |c| c.figures.map(number)));
        }
        out.write_record(&row)?;
    }
    Ok(out.into_inner().map_err(|e| e.to_string())?)
}

/// A row for each parameter of each effect.
pub(super) fn effects(done: &[Done]) -> Result<Vec<u8>, Failure> {
    let mut out = csv::Writer::from_writer(Vec::new());
    out.write_record([
        "file",
        "effect",
        "scope",
        "channels",
        "probability",
        "heldout_error_reduction",
        "parameter",
        "value",
        "unit",
        "low95",
        "high95",
    ])?;
    for d in done {
        for e in &d.effects {
            let mut row = vec![
                d.file.clone(),
                e.effect.clone(),
                e.scope.clone(),
                e.channels.clone(),
                number(e.probability),
                number(e.reduction),
            ];
            row.extend(match &e.parameter {
                Some((name, value, unit, [low, high])) => {
                    [name.clone(), number(*value), unit.clone(), number(*low), number(*high)]
                }
                None => [const { String::new() }; 5],
            });
            out.write_record(&row)?;
        }
    }
    Ok(out.into_inner().map_err(|e| e.to_string())?)
}
