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
use crate::replace::put;
use ident::channel::Context;
use ident::log::import::Options;
use ident::log::quantity::{Density, Kilogram, Metre, Newton, Pascal, RevPerMin, Volt};
use ident::plateau::plateaus;
use ident::report::{beam, beam_figures, beam_warning};
use ident::sizing::beam::Beam;
use std::io::Write;
use std::path::PathBuf;

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Width, mm.
    #[arg(long, default_value_t = 20.0, value_parser = crate::number::positive(1e4, "mm"))]
    width: f64,
    /// Height, mm.
    #[arg(long, default_value_t = 3.0, value_parser = crate::number::positive(1e4, "mm"))]
    height: f64,
    /// Length from clamp to thrust axis, mm.
    #[arg(long, default_value_t = 115.0, value_parser = crate::number::positive(1e4, "mm"))]
    length: f64,
    /// Young's modulus, GPa.
    #[arg(long, default_value_t = 200.0, value_parser = crate::number::positive(1e4, "GPa"))]
    modulus: f64,
    /// Density, kg/m^3.
    #[arg(long, default_value_t = 7850.0, value_parser = crate::number::positive(1e5, "kg/m^3"))]
    density: f64,
    /// Yield strength, MPa.
    #[arg(long, default_value_t = 250.0, value_parser = crate::number::positive(1e5, "MPa"))]
    yield_strength: f64,
    /// Safety factor against yield.
    #[arg(long, default_value_t = 2.0, value_parser = crate::number::positive(1000.0, "times the load"))]
    safety: f64,
    /// Gauge factor.
    #[arg(long, default_value_t = 2.1, value_parser = crate::number::positive(1e4, "gauge factors"))]
    gauge_factor: f64,
    /// Bridge excitation, V.
    #[arg(long, default_value_t = 11.5, value_parser = crate::number::positive(1000.0, "V"))]
    excitation: f64,
    /// Amplifier gain.
    #[arg(long, default_value_t = 1000.0, value_parser = crate::number::positive(1e6, "times"))]
    gain: f64,
    /// Load at the tip, g.
    #[arg(long, default_value_t = 800.0, value_parser = crate::number::positive(1e6, "g"))]
    load: f64,
    /// Mass at the tip (motor, tachometer, propeller), g.
    #[arg(long, default_value_t = 244.0, value_parser = crate::number::positive(1e6, "g"))]
    tip: f64,
    /// Blades of the propeller.
    #[arg(long, default_value_t = 2, value_parser = crate::number::whole::<u32>(1, 12, "blades"))]
    blades: u32,
    /// Levels of the schedule, rev/min, separated by commas; the run passes every speed up to the highest.
    #[arg(long, value_delimiter = ',', conflicts_with = "run", value_parser = crate::number::from(0.0, 1e6, "rev/min"))]
    speeds: Vec<f64>,
    /// A rig log: the levels are those of its plateaus.
    #[arg(long)]
    run: Option<PathBuf>,
    /// How near a level may stand to a resonance, per cent of its speed.
    #[arg(long, default_value_t = 10.0, value_parser = crate::number::from(0.0, 100.0, "per cent"))]
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
    let design = design(args);
    let speeds = speeds(args, quiet)?;
    let met = design.crossings(args.blades, &speeds, args.near / 100.0);
    let sheet = beam(&design, args.blades, &met);
    if let Some(path) = &args.output {
        put(path, &sheet.html())?;
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

fn design(args: &Args) -> Beam {
    Beam {
        width_m: Metre(args.width / 1e3),
        height_m: Metre(args.height / 1e3),
        length_m: Metre(args.length / 1e3),
        modulus_pa: Pascal(args.modulus * 1e9),
        density_kg_m3: Density(args.density),
        yield_pa: Pascal(args.yield_strength * 1e6),
        safety: args.safety,
        gauge_factor: args.gauge_factor,
        excitation_v: Volt(args.excitation),
        gain: args.gain,
        load_n: Newton::weight_of(Kilogram(args.load / 1e3)),
        tip_kg: Kilogram(args.tip / 1e3),
    }
}

fn speeds(args: &Args, quiet: bool) -> Result<Vec<RevPerMin>, Failure> {
    let Some(path) = &args.run else { return Ok(args.speeds.iter().map(|s| RevPerMin(*s)).collect()) };
    let log = open(path, &Options::default(), quiet)?;
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
