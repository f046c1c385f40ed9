//! `quadrig select`.
//!
//! What it is: motor, propeller and battery choice from the thesis' figures, from tables of pairs, from measured runs, or from the
//! simulator's catalogue flown on the spot.
//! What can go wrong: refused input; a simulated run that the firmware stops is a pair without a result.
//! Units: N, A, kg, A.h, min.
//! Reference: specification `identification.md`, item 4; Beharie 2013, section 6.1.

use crate::Failure;
use crate::apart::Paths;
use crate::folder::{Folder, figures, name_of};
use crate::open::{Columns, open};
use crate::progress::Bar;
use crate::replace::put;
use crate::run_log::to_log;
use crate::trouble::unread;
use hal_sim::Scenario;
use hal_sim::plant::{Propeller, motor};
use hal_sim::scenario::Schedule;
use ident::channel::Context;
use ident::identify::settled;
use ident::log::digest;
use ident::log::quantity::{AmpereHour, Kilogram, Minute, Newton};
use ident::plateau::plateaus;
use ident::report::{WIDEST, selection, tenths, wrapped};
use ident::sizing::select::{
    Airframe, LEVELS, Need, Pair, Row, choose, from_log, is_repeated, misses, read_levels, read_table, row, thesis, why,
};
use std::io::{BufReader, Read, Write};
use std::path::{Path, PathBuf};

/// Most that a value of a multirotor can be, and the smaller unit that one above it is likely to be in: a thousandth.
struct Limit {
    most: f64,
    unit: &'static str,
    thousandth: &'static str,
}

/// The heaviest multirotors weigh some 100 kg, and carry some 100 A.h.
const MASS: Limit = Limit { most: 200.0, unit: "kg", thousandth: "g" };
/// See [`MASS`].
const CHARGE: Limit = Limit { most: 200.0, unit: "A.h", thousandth: "mAh" };

impl Limit {
    fn check(&self, name: &str, value: f64) -> Result<(), Failure> {
        let Self { most, unit, thousandth } = self;
        if value > *most {
            let likely = format!("is it in {thousandth}? {value} {thousandth} are {} {unit}", value / 1000.0);
            return Err(format!("{name} {value}: expected {unit}, {most} at most: {likely}").into());
        }
        Ok(())
    }
}

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Rig logs or exports, tables of `identify --table`, or tables `motor,propeller,thrust_n,current_a`; none: the figures that the thesis states.
    files: Vec<PathBuf>,
    /// Flies every pair of the simulator's catalogue.
    #[arg(long, conflicts_with = "files")]
    simulated: bool,
    /// Only this motor; a run that names none is taken for its.
    #[arg(long)]
    motor: Option<String>,
    /// Name of the propeller of runs that name none.
    #[arg(long)]
    propeller: Option<String>,
    #[command(flatten)]
    columns: Columns,
    /// Least thrust of all four motors together, N.
    #[arg(long, default_value_t = 19.62, value_parser = crate::number::from(0.0, 100_000.0, "N"))]
    thrust: f64,
    /// Batteries on board.
    #[arg(long, default_value_t = 1, value_parser = crate::number::whole::<u32>(1, 12, "batteries"))]
    batteries: u32,
    /// Least endurance at full throttle, min.
    #[arg(long, default_value_t = 0.0, value_parser = crate::number::from(0.0, 10_000.0, "minutes"))]
    minutes: f64,
    /// Least thrust above the weight, N.
    #[arg(long, default_value_t = 0.0, value_parser = crate::number::from(0.0, 100_000.0, "N"))]
    resultant: f64,
    /// Mass without a battery, kg.
    #[arg(long, default_value_t = 0.774, value_parser = crate::number::positive(1e6, "kg"))]
    bare: f64,
    /// Mass of one battery, kg.
    #[arg(long, default_value_t = 0.4, value_parser = crate::number::positive(1e6, "kg"))]
    battery: f64,
    /// Charge of one battery, A.h.
    #[arg(long, default_value_t = 4.4, value_parser = crate::number::positive(1e6, "A.h"))]
    capacity: f64,
    /// Writes the page with Tables 8 and 9 and the figures.
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Writes each figure as a file into this folder.
    #[arg(long)]
    svg: Option<PathBuf>,
    /// Rows and choice as JSON.
    #[arg(long)]
    json: bool,
}

impl Args {
    /// What it reads and writes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        Paths::default().reads(&self.files).writes("-o", &self.output).fills("--svg", &self.svg)
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let given = [("--bare", args.bare, &MASS), ("--battery", args.battery, &MASS), ("--capacity", args.capacity, &CHARGE)];
    given.into_iter().try_for_each(|(name, value, limit)| limit.check(name, value))?;
    let svg = args.svg.as_deref().map(|path| Folder::new(path, "select --svg")).transpose()?;
    let airframe =
        Airframe { bare_kg: Kilogram(args.bare), battery_kg: Kilogram(args.battery), capacity_ah: AmpereHour(args.capacity) };
    let need = Need {
        total_thrust_n: Newton(args.thrust),
        batteries: args.batteries,
        full_throttle_min: Minute(args.minutes),
        resultant_n: Newton(args.resultant),
    };
    let Found { mut pairs, from, left_out } = match (&args.files[..], args.simulated) {
        ([], true) => Found::of(fly_catalogue(quiet), "the simulator's catalogue, every pair flown"),
        ([], false) => Found::of(thesis(), "the figures that the thesis states"),
        (files, _) => read(files, args, quiet)?,
    };
    // 390KV before 1000KV
    let number =
        |name: &str| name.chars().take_while(char::is_ascii_digit).collect::<String>().parse::<u32>().unwrap_or(u32::MAX);
    pairs.sort_by(|a, b| {
        (number(&a.motor), &a.motor, number(&a.propeller), &a.propeller).cmp(&(
            number(&b.motor),
            &b.motor,
            number(&b.propeller),
            &b.propeller,
        ))
    });
    if let Some(motor) = &args.motor {
        let mut there: Vec<String> = pairs.iter().map(|p| p.motor.clone()).collect();
        there.dedup();
        pairs.retain(|p| p.motor == *motor);
        if pairs.is_empty() {
            return Err(format!("--motor {motor}: no pair has this motor; expected one of {}", there.join(", ")).into());
        }
    }
    let batteries = args.batteries.max(3);
    let rows: Vec<Row> = pairs.iter().filter_map(|p| row(p, &airframe, batteries)).collect();
    let chosen = choose(&rows, &need);
    let sheet = selection(&pairs, &rows, &airframe, (&need, batteries), &from);
    if let Some(path) = &args.output {
        put(path, &sheet.html())?;
    }
    if let Some(folder) = svg {
        figures(folder, sheet.drawn())?;
    }
    let mut out = crate::say::out();
    if args.json {
        let names: Vec<String> = chosen.iter().map(|r| format!("{} {}", r.pair.motor, r.pair.propeller)).collect();
        let json = serde_json::json!({"airframe": airframe, "need": need, "rows": rows, "chosen": names, "why": why(&rows, &chosen, &need), "left_out": left_out});
        writeln!(out, "{}", serde_json::to_string_pretty(&json)?)?;
    } else if !quiet {
        write!(out, "{}", table(&pairs, &rows, &chosen, &need))?;
    }
    drop(out);
    if !quiet {
        left_out.iter().for_each(|why| note!("left out: {why}"));
    }
    Ok(())
}

/// Pairs, where they come from, and why other files are left out.
struct Found {
    pairs: Vec<Pair>,
    /// For the page: files with their digests.
    from: Vec<(&'static str, String)>,
    left_out: Vec<String>,
}

impl Found {
    /// Pairs that no file holds.
    fn of(pairs: Vec<Pair>, source: &str) -> Self {
        Self { pairs, from: vec![("pairs", source.to_owned())], left_out: Vec::new() }
    }
}

/// Logs and tables, told apart by their first line, and why others are left out; refused only where none is left.
fn read(files: &[PathBuf], args: &Args, quiet: bool) -> Result<Found, Failure> {
    let (mut pairs, mut from, mut left_out) = (Vec::new(), Vec::new(), Vec::new());
    for path in files {
        match pairs_of(path, args, quiet) {
            Ok((found, without)) => {
                pairs.extend(found);
                left_out.extend(without);
                from.extend([("file", name_of(path)), ("SHA-256", digest(&std::fs::read(path).map_err(unread(path))?))]);
            }
            Err(why) => left_out.push(why.to_string()),
        }
    }
    match left_out.first() {
        Some(only) if files.len() == 1 => Err(only.clone().into()),
        Some(first) if pairs.is_empty() => {
            Err(format!("none of the {} files holds a pair; the first: {first}", files.len()).into())
        }
        _ => Ok(Found { pairs, from, left_out }),
    }
}

/// The pairs of a file, and why lines of a table hold none.
fn pairs_of(path: &Path, args: &Args, quiet: bool) -> Result<(Vec<Pair>, Vec<String>), Failure> {
    if path.is_dir() {
        let expected = "expected rig logs, exports or tables: name the files in it";
        return Err(format!("{}: is a folder; {expected}, such as {}", path.display(), path.join("*.csv").display()).into());
    }
    let shown = path.display().to_string();
    let source = || Ok::<_, Failure>(BufReader::new(std::fs::File::open(path).map_err(unread(path))?));
    let head = head_of(path)?;
    if head.starts_with("motor") {
        let table = read_table(&shown, source()?)?;
        return Ok((table.pairs, table.left_out.iter().map(ToString::to_string).collect()));
    }
    let (mut log, plateaus) = if head.starts_with(&LEVELS.join(",")) {
        read_levels(&shown, &name_of(path), source()?)?
    } else {
        let log = open(path, &args.columns.named(None, None), quiet)?;
        let plateaus = settled(&Context::new(&log, None), &log);
        (log, plateaus)
    };
    let given = [("motor", &args.motor), ("propeller", &args.propeller)];
    for (key, value) in given.into_iter().filter_map(|(k, v)| Some((k, v.as_ref()?))) {
        log.meta.entry(key.to_owned()).or_insert_with(|| toml::Value::String(value.clone()));
    }
    let pair = from_log(&log, &plateaus);
    if pair.maximum.is_none() {
        let expected =
            "expected a run with thrust_n and current_a on levels of at least 5 rows, or a table with a row for each level";
        return Err(format!("{}: no plateau with thrust and current; {expected}", path.display()).into());
    }
    Ok((vec![pair], Vec::new()))
}

/// The first line that is no comment; nothing of a rig log, which says in its first line what it is.
fn head_of(path: &Path) -> Result<String, Failure> {
    let file = std::fs::File::open(path).map_err(unread(path))?;
    let mut head = Vec::new();
    std::io::Read::take(file, 4096).read_to_end(&mut head).map_err(unread(path))?;
    let head = String::from_utf8_lossy(&head).into_owned();
    let first = head.lines().map(str::trim).find(|l| !l.starts_with('#') && !l.is_empty());
    Ok(first.filter(|_| !head.starts_with("# quadrig-")).unwrap_or_default().to_owned())
}

/// Every motor with every propeller that the simulator knows, on a short staircase.
fn fly_catalogue(quiet: bool) -> Vec<Pair> {
    let bar = Bar::new("flying", quiet);
    let propellers: Vec<&str> = Propeller::names().collect();
    let count = motor::MOTORS.len() * propellers.len();
    let mut pairs = Vec::new();
    for (kv, _) in motor::MOTORS {
        for propeller in &propellers {
            pairs.push(fly(&format!("{kv}KV"), propeller));
            bar.set(pairs.len() as f64 / count as f64);
        }
    }
    pairs
}

fn fly(motor: &str, propeller: &str) -> Pair {
    let scenario = Scenario {
        name: format!("{motor} {propeller}"),
        motor: motor.to_owned(),
        propeller: propeller.to_owned(),
        schedule: Schedule::Staircase { step_us: 100.0, hold_s: 3.0, top_us: 2000.0 },
        ..Scenario::default()
    };
    let nothing = |why: String| Pair {
        motor: motor.to_owned(),
        propeller: propeller.to_owned(),
        maximum: None,
        clipped: false,
        levels: Vec::new(),
        without: Some(why),
        source: scenario.name.clone(),
    };
    match hal_sim::run(&scenario, None, &mut |_| {}) {
        Ok(record) => {
            let log = to_log(&scenario, &record, &scenario.name, false);
            let pair = from_log(&log, &plateaus(&Context::new(&log, None), &log));
            // a run that a protection cut short says nothing of full throttle
            let top = log.column("pulse_us").map_or(0.0, |p| p.iter().copied().fold(0.0, f64::max));
            if record.truth.iter().all(|t| t.plant.rpm == 0.0) {
                nothing("the motor does not turn this propeller at any pulse".to_owned())
            } else if top < 1999.0 {
                nothing(format!("the firmware stopped the run at {top:.0} us"))
            } else {
                pair
            }
        }
        Err(e) => nothing(e.to_string()),
    }
}

/// Least columns of the names, and the most that both together leave room beside.
const MOTOR: usize = 8;
const PROPELLER: usize = 9;
const NAMES: usize = 32;

fn table(pairs: &[Pair], rows: &[Row], chosen: &[&Row], need: &Need) -> String {
    let width = |of: fn(&Pair) -> &str, least: usize| pairs.iter().map(|p| of(p).chars().count()).fold(least, usize::max);
    // names that leave no room for the figures stand above them
    let (m, p) = match (width(|p| &p.motor, MOTOR), width(|p| &p.propeller, PROPELLER)) {
        (m, p) if m + p <= NAMES => (m, p),
        _ => (MOTOR, PROPELLER),
    };
    let mut out = format!(
        "{:<m$} {:<p$} {:>8} {:>6} {:>7} {:>7} {:>9}",
        "motor", "propeller", "thrust N", "A", "N per A", "hovers", "resultant"
    );
    let counts: Vec<u32> = rows.first().map_or_else(Vec::new, |r| r.with_batteries.iter().map(|w| w.batteries).collect());
    for n in &counts {
        out += &format!(" {:>7}", format!("min x{n}"));
    }
    out.push('\n');
    for r in rows {
        let misses = misses(r, need);
        let mark = if misses.is_empty() { "  meets the need".to_owned() } else { format!("  {}", misses.join(", ")) };
        let clipped = if r.pair.clipped { "; thrust reading clipped: a lower bound" } else { "" };
        let with = r.with_batteries.iter().find(|w| w.batteries == need.batteries);
        let (motor, propeller) = (r.pair.motor.as_str(), r.pair.propeller.as_str());
        let fits = motor.chars().count() <= m && propeller.chars().count() <= p;
        if !fits {
            out += &format!("{}\n", wrapped(&format!("{motor} {propeller}"), 2));
        }
        let [motor, propeller] = if fits { [motor, propeller] } else { [""; 2] };
        out += &format!(
            "{motor:<m$} {propeller:<p$} {:>8.3} {:>6.2} {:>7.2} {:>4.2} kg {:>7} N",
            r.total_thrust_n.0 / 4.0,
            r.pair.maximum.map_or(f64::NAN, |m| m.current_a.0),
            r.efficiency_n_per_a,
            r.hover_mass_kg.0,
            with.map_or_else(|| "-".to_owned(), |w| tenths(w.resultant_n.0))
        );
        for w in &r.with_batteries {
            out += &format!(" {:>7.1}", w.full_throttle_min.0);
        }
        // what does not fit beside the figures stands beneath them
        let words = format!("{mark}{clipped}");
        let beside = out.lines().last().map_or(0, |l| l.chars().count()) + words.chars().count() <= WIDEST;
        out += &if beside { format!("{words}\n") } else { format!("\n    {}\n", wrapped(words.trim(), 4)) };
        if is_repeated(rows, r) {
            out += &format!("    of {}\n", r.pair.source);
        }
    }
    for pair in pairs.iter().filter(|p| p.maximum.is_none()) {
        let why = pair.without.as_ref().map_or_else(String::new, |why| format!(": {why}"));
        let told = wrapped(&format!("no result{why}"), m + p + 2);
        out += &format!("{:<m$} {:<p$} {told}\n", pair.motor, pair.propeller);
    }
    out += &format!("{}\n", wrapped(&why(rows, chosen, need), 0));
    out
}
