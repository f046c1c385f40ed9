//! `quadrig fly`.
//!
//! What it is: a mission flown on the powerplants of the catalogue or on an identified model; states, flight log and page in a folder,
//! the hover and what came of the flight as a summary.
//! What can go wrong: a mission, airframe or model that is refused, a model that predicts no thrust from a command; then nothing is written.
//! Units: as the files state.
//! Reference: docs/mission.md; specification `flight.md`, "Missions".

mod page;
mod record;
pub(crate) mod rotor;
mod summary;

use crate::Failure;
use crate::apart::Paths;
use crate::close_loop::{flight, inertial};
use crate::folder::{Folder, name_of};
use crate::kind::instead;
use crate::open::read_model;
use crate::progress::Bar;
use crate::trouble::unread;
use hal_sim::Powerplant;
use hal_sim::flight::Airframe;
use hal_sim::mission::{AirframeFile, Catalogue, Flight, Mission, RotorCurves, catalogue_plants, fly_whole};
use hal_sim::plant::air::SEA_LEVEL_DENSITY;
use ident::log::digest;
use ident::model::Model;
use rotor::ModelRotor;
use std::io::Write;
use std::path::{Path, PathBuf};
use summary::Summary;

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The mission file.
    mission: PathBuf,
    /// An identified model in the place of the catalogue's powerplants.
    #[arg(long)]
    model: Option<PathBuf>,
    /// Folder for states.csv, flight.csv, attitude.csv and flight.html.
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// The summary as JSON on stdout and nothing else.
    #[arg(long)]
    json: bool,
}

impl Args {
    /// What it reads and writes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        Paths::default().reads([&self.mission]).reads(&self.model).fills("-o", &self.output)
    }
}

/// What turns the rotors.
enum Rotors {
    Catalogue,
    Model(Box<ModelRotor>),
}

impl Rotors {
    /// Density for which they are set up, kg/m^3.
    fn density(&self) -> f64 {
        match self {
            Self::Catalogue => SEA_LEVEL_DENSITY,
            Self::Model(rotor) => rotor.density().0,
        }
    }
}

/// Flight from which on it is said how long it is before it begins, s.
const LONG_S: f64 = 600.0;

/// What is expected of a file.
const MISSION: &str = "a mission, such as examples/flight/takeoff.toml: docs/mission.md lists its keys";

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let (mission, file) = Mission::load(&args.mission).map_err(|why| instead(&args.mission, MISSION, why))?;
    args.paths().reads(mission.files(&args.mission).iter().flatten()).check()?;
    let folder = args.output.as_deref().map(|path| Folder::new(path, "fly")).transpose()?;
    let airframe = file.airframe();
    if airframe.body().is_none() {
        return Err(format!(
            "{}: the airframe's masses make no body; expected masses above 0 at more than one place (docs/mission.md)",
            args.mission.display()
        )
        .into());
    }
    let model = args.model.as_deref().map(|path| model_of_a_rig(path, quiet)).transpose()?;
    let rotors = rotors_of(model.as_ref(), args.model.as_deref(), &airframe)?;
    let curves: &dyn RotorCurves = match &rotors {
        Rotors::Catalogue => &Catalogue(&file),
        Rotors::Model(rotor) => rotor.as_ref(),
    };
    if mission.length_s() >= LONG_S && !quiet {
        note!("{}: up to {:.0} s of flight, {} rows", args.mission.display(), mission.length_s(), mission.rows());
    }
    let flight = flown(&mission, &file, &rotors, curves, quiet || args.json)?;
    has_numbers(&flight, args.model.as_deref().unwrap_or(&args.mission))?;
    let of = (curves, rotors.density());
    let summary = Summary::of(&mission, &file, &airframe, of, powerplant(&file, &rotors, model.as_ref()), &flight);
    if let Some(mut folder) = folder {
        let told =
            [("mission", mission.name.clone()), ("airframe", file.name.clone()), ("powerplant", summary.powerplant.clone())];
        let mut log = Vec::new();
        ident::log::flight_log::write_to(&record::flight_log(&flight.rows, &airframe, &told), &mut log)?;
        folder.add("states.csv", record::states(&flight.rows).into_bytes());
        folder.add("flight.csv", log);
        if !flight.seen.is_empty() {
            folder.add("attitude.csv", record::attitudes(&flight.seen).into_bytes());
        }
        folder.add("flight.html", page::page(&summary, &flight, &comes_from(args)?).into_bytes());
        folder.write()?;
    }
    let said = if args.json { summary.json() } else { summary.text() };
    if args.json || !quiet {
        writeln!(crate::say::out(), "{}", said.trim_end())?;
    }
    Ok(())
}

/// Refuses a flight that left the numbers: nothing that is said of it would be true.
fn has_numbers(flight: &Flight, from: &Path) -> Result<(), Failure> {
    let states = |f: &hal_sim::flight::Flying| {
        let motion = f.motion.place.iter().chain(f.motion.velocity.iter()).chain(f.specific_force.iter());
        motion.copied().chain(f.rotors.iter().flat_map(|r| [r.rpm, r.thrust_n, r.torque_nm])).all(f64::is_finite)
    };
    flight.rows.iter().find(|row| !states(row)).map_or(Ok(()), |row| {
        let expected = "expected speeds and thrusts that a rotor can have: was the model changed by hand?";
        Err(format!("{}: the flight on it has no finite numbers from {:.2} s on; {expected}", from.display(), row.t_s).into())
    })
}

/// Where the page comes from: the mission and the model with their digests, and the command.
fn comes_from(args: &Args) -> Result<Vec<(&'static str, String)>, Failure> {
    let mut out = Vec::new();
    let mut again = format!("quadrig fly {}", name_of(&args.mission));
    for (what, path) in std::iter::once(("mission", &args.mission)).chain(args.model.iter().map(|path| ("model", path))) {
        let bytes = std::fs::read(path).map_err(unread(path))?;
        out.extend([(what, name_of(path)), ("SHA-256", digest(&bytes))]);
        if what == "model" {
            again += &format!(" --model {}", name_of(path));
        }
    }
    out.push(("again", again + " -o out"));
    Ok(out)
}

/// A rig's model. A flight's or an inertial unit's is refused as what it is.
fn model_of_a_rig(path: &Path, quiet: bool) -> Result<Model, Failure> {
    let other = [("a flight", flight::model_text(path)), ("an inertial unit", inertial::model_text(path))];
    if let Some((of, _)) = other.iter().find(|(_, text)| text.is_some()) {
        return Err(format!(
            "{}:1:1: a model of {of}, which holds no rotor alone; expected a rig's model, of `quadrig identify` or `close-loop` on a rig log",
            path.display()
        )
        .into());
    }
    read_model(path, quiet)
}

fn rotors_of(model: Option<&Model>, path: Option<&Path>, airframe: &Airframe) -> Result<Rotors, Failure> {
    let (Some(model), Some(path)) = (model, path) else { return Ok(Rotors::Catalogue) };
    let rotor = ModelRotor::new(model, airframe.rotor_inertia_kgm2)
        .map_err(|why| format!("{}: the model predicts {why}", path.display()))?;
    Ok(Rotors::Model(Box::new(rotor)))
}

/// What turns the rotors, in words.
fn powerplant(file: &AirframeFile, rotors: &Rotors, model: Option<&Model>) -> String {
    let (Rotors::Model(rotor), Some(model)) = (rotors, model) else {
        return format!("{} with {}, catalogue", file.motor, file.propeller);
    };
    let [flies, stays] = rotor.effects(model);
    let list = |names: &[&str]| if names.is_empty() { "none".to_owned() } else { names.join(", ") };
    let air = (!rotor.density().1).then_some("air of its run unknown, taken as 1.225 kg/m^3");
    let notes: String = rotor.lacks().into_iter().chain(air).map(|note| format!("; {note}")).collect();
    format!(
        "model of {}; its effects in flight: {}; of the rig alone: {}{notes}",
        model.runs_in_words(),
        list(&flies),
        list(&stays)
    )
}

fn flown(
    mission: &Mission,
    file: &AirframeFile,
    rotors: &Rotors,
    curves: &dyn RotorCurves,
    quiet: bool,
) -> Result<Flight, Failure> {
    let plants = match rotors {
        Rotors::Catalogue => catalogue_plants(file),
        Rotors::Model(rotor) if mission.controller.is_some() => following(file, rotor),
        Rotors::Model(rotor) => planned(mission, file, rotor)?,
    };
    let bar = Bar::new("flying", quiet || mission.length_s() < 60.0);
    let flight = fly_whole(mission, file, plants, curves, rotors.density(), &mut |share| bar.set(share));
    flight.ok_or_else(|| "a controller is to steer what cannot hover; expected more thrust, or less weight".into())
}

/// Rotors of the model for pulses that the flight decides on.
fn following(file: &AirframeFile, rotor: &ModelRotor) -> Vec<Box<dyn Powerplant>> {
    let one = rotor.following();
    file.rotors().iter().map(|_| Box::new(one.clone()) as Box<dyn Powerplant>).collect()
}

/// One rotor of the model for each of the vehicle; those with the same pulses share what the model says of them.
fn planned(mission: &Mission, file: &AirframeFile, rotor: &ModelRotor) -> Result<Vec<Box<dyn Powerplant>>, Failure> {
    let mut known: Vec<(usize, rotor::Planned)> = Vec::new();
    let mut plants: Vec<Box<dyn Powerplant>> = Vec::new();
    for i in 0..file.rotors().len() {
        let same = |j: usize| mission.same_pulses(i, j);
        let plan = match known.iter().find(|(j, _)| same(*j)) {
            Some((_, plan)) => plan.clone(),
            None => {
                let plan = rotor.planned(|t| mission.pulse_us(i, t), mission.length_s(), mission.start.spun_up);
                plan.ok_or(
                    "the model predicts no speed from a command; expected one identified from a log with pulse_us and a speed",
                )?
            }
        };
        plants.push(Box::new(plan.clone()));
        known.push((i, plan));
    }
    Ok(plants)
}
