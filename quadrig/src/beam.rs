//! `quadrig beam`.
//!
//! What it is: signal, strength and first natural frequency of a load-cell beam, with a warning when a run meets its resonance.
//! What can go wrong: a dimension that is no positive number; a run without speeds.
//! Units: mm, g, GPa, MPa, V and rev/min on the command line; SI within.
//! Reference: Beharie 2013, Eq. 5.53 to 5.56 as corrected in the errata.

use crate::Failure;
use crate::apart::Paths;
use crate::folder::{Folder, figures};
use crate::open::open;
use crate::trouble::unwritten;
use ident::beam::Beam;
use ident::context::Context;
use ident::import::Options;
use ident::log::write_whole;
use ident::plateau::plateaus;
use ident::quantity::{Density, Kilogram, Metre, Newton, Pascal, RevPerMin, Volt};
use ident::report::{beam, beam_figures, beam_warning};
use std::io::Write;
use std::path::PathBuf;

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Width, mm.
    #[arg(long, default_value_t = 20.0)]
    width: f64,
    /// Height, mm.
    #[arg(long, default_value_t = 3.0)]
    height: f64,
    /// Length from clamp to thrust axis, mm.
    #[arg(long, default_value_t = 115.0)]
    length: f64,
    /// Young's modulus, GPa.
    #[arg(long, default_value_t = 200.0)]
    modulus: f64,
    /// Density, kg/m^3.
    #[arg(long, default_value_t = 7850.0)]
    density: f64,
    /// Yield strength, MPa.
    #[arg(long, default_value_t = 250.0)]
    yield_strength: f64,
    /// Safety factor against yield.
    #[arg(long, default_value_t = 2.0)]
    safety: f64,
    /// Gauge factor.
    #[arg(long, default_value_t = 2.1)]
    gauge_factor: f64,
    /// Bridge excitation, V.
    #[arg(long, default_value_t = 11.5)]
    excitation: f64,
    /// Amplifier gain.
    #[arg(long, default_value_t = 1000.0)]
    gain: f64,
    /// Load at the tip, g.
    #[arg(long, default_value_t = 800.0)]
    load: f64,
    /// Mass at the tip (motor, tachometer, propeller), g.
    #[arg(long, default_value_t = 244.0)]
    tip: f64,
    /// Blades of the propeller.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=12))]
    blades: u32,
    /// Levels of the schedule, rev/min, separated by commas; the run passes every speed up to the highest.
    #[arg(long, value_delimiter = ',', conflicts_with = "run")]
    speeds: Vec<f64>,
    /// A rig log: the levels are those of its plateaus.
    #[arg(long)]
    run: Option<PathBuf>,
    /// How near a level may stand to a resonance, per cent of its speed.
    #[arg(long, default_value_t = 10.0)]
    near: f64,
    /// Writes the page with Figures 5.40 to 5.42.
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Writes each figure as a file into this folder.
    #[arg(long)]
    svg: Option<PathBuf>,
    /// Design and resonances as JSON.
    #[arg(long)]
    json: bool,
}

impl Args {
    /// What it reads and writes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        Paths::default().reads(&self.run).writes("-o", &self.output).fills("--svg", &self.svg)
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let svg = args.svg.as_deref().map(|path| Folder::new(path, "beam --svg")).transpose()?;
    let design = design(args)?;
    let speeds = speeds(args)?;
    let met = design.crossings(args.blades, &speeds, args.near / 100.0);
    let sheet = beam(&design, args.blades, &met);
    if let Some(path) = &args.output {
        write_whole(path, |out| out.write_all(sheet.html().as_bytes())).map_err(unwritten(&path))?;
    }
    if let Some(folder) = svg {
        figures(folder, sheet.drawn())?;
    }
    let mut out = crate::say::out();
    if args.json {
        let json = serde_json::json!({
            "beam": design,
            "stress_pa": design.stress(),
            "strain": design.strain(),
            "bridge_v": design.bridge_output(),
            "amplified_v": design.amplified(),
            "deflection_m": design.deflection(),
            "natural_frequency_hz": design.natural_frequency(),
            "resonances": design.resonances(args.blades),
            "met": met,
        });
        writeln!(out, "{}", serde_json::to_string_pretty(&json)?)?;
    } else if !quiet {
        for row in beam_figures(&design, args.blades) {
            writeln!(out, "{:<52} {:>9} {}", row[0], row[1], row[2])?;
        }
    }
    drop(out);
    if design.safety_reached() < design.safety {
        note!(
            "warning: the safety factor is {:.2}; expected at least {} (shorten to {:.0} mm or load at most {:.0} g)",
            design.safety_reached(),
            design.safety,
            design.longest().0 * 1e3,
            design.strongest().carries().0 * 1e3
        );
    }
    for c in &met {
        note!("warning: {}", beam_warning(c));
    }
    Ok(())
}

fn design(args: &Args) -> Result<Beam, Failure> {
    let positive = |name: &str, v: f64| {
        if v.is_finite() && v > 0.0 { Ok(v) } else { Err(format!("--{name} {v}: expected a positive number")) }
    };
    Ok(Beam {
        width_m: Metre(positive("width", args.width)? / 1e3),
        height_m: Metre(positive("height", args.height)? / 1e3),
        length_m: Metre(positive("length", args.length)? / 1e3),
        modulus_pa: Pascal(positive("modulus", args.modulus)? * 1e9),
        density_kg_m3: Density(positive("density", args.density)?),
        yield_pa: Pascal(positive("yield-strength", args.yield_strength)? * 1e6),
        safety: positive("safety", args.safety)?,
        gauge_factor: positive("gauge-factor", args.gauge_factor)?,
        excitation_v: Volt(positive("excitation", args.excitation)?),
        gain: positive("gain", args.gain)?,
        load_n: Newton::weight_of(Kilogram(positive("load", args.load)? / 1e3)),
        tip_kg: Kilogram(positive("tip", args.tip)? / 1e3),
    })
}

fn speeds(args: &Args) -> Result<Vec<RevPerMin>, Failure> {
    let Some(path) = &args.run else { return Ok(args.speeds.iter().map(|s| RevPerMin(*s)).collect()) };
    let log = open(path, &Options::default(), true)?;
    let context = Context::new(&log, None);
    if context.rpm.is_empty() {
        return Err(format!(
            "{}: no speed channel; expected rpm or one of rpm_beam, rpm_opto, rpm_hall, rpm_encoder",
            path.display()
        )
        .into());
    }
    let column = log.columns.iter().position(|c| ident::log::SPEED.contains(&c.name.as_str()));
    let mut levels: Vec<RevPerMin> = plateaus(&context, &log)
        .iter()
        .filter_map(|p| p.means.get(column?).copied().flatten())
        .map(|(mean, _)| RevPerMin(mean))
        .collect();
    levels.push(RevPerMin(context.rpm.iter().copied().fold(0.0, f64::max)));
    Ok(levels)
}
