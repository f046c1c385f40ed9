//! Logs that are none, or of other units: broken text, columns, times and values that no rig gives.
//!
//! What it is: the cases of the table of refusals that meet a log.
//! What can go wrong: see `refusals.rs`.
//! Units: as the columns state.
//! Reference: specification `formats.md`, "Log".

use super::{Case, IDENTIFY, alone, with};
use quadrig_tests::bench::{HEAD, good_log};

/// The good log, its rows changed.
fn rows(change: impl Fn(Vec<String>) -> Vec<String>) -> String {
    let text = good_log();
    let lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let (head, rows) = lines.split_at(HEAD);
    [head.to_vec(), change(rows.to_vec())].concat().join("\n") + "\n"
}

fn row(n: usize, change: impl Fn(&str) -> String) -> String {
    rows(|mut rows| {
        rows[n] = change(&rows[n]);
        rows
    })
}

fn times(change: impl Fn(f64) -> String) -> String {
    let changed = |row: &String| {
        let (t, rest) = row.split_once(',').expect("a row has commas");
        format!("{},{rest}", change(t.parse().expect("a time")))
    };
    rows(|rows| rows.iter().map(changed).collect())
}

pub(super) fn logs() -> Vec<Case> {
    let head = |from: &str, to: &str| good_log().replacen(from, to, 1);
    let shuffled = rows(|rows| (0..rows.len()).map(|n| rows[n * 131 % rows.len()].clone()).collect());
    let twice = rows(|rows| [rows.clone(), rows].concat());
    vec![
        with(
            "line ends of carriage returns",
            "bad.csv",
            good_log().replace('\n', "\r"),
            IDENTIFY,
            &["bad.csv:1: lines that end with a carriage return alone"],
        ),
        with("shuffled rows", "bad.csv", shuffled, IDENTIFY, &["bad.csv:8: column t_s", "rows look shuffled, sort them by t_s"]),
        with("two runs in one", "bad.csv", twice, IDENTIFY, &["bad.csv:424: column t_s: 0 steps back from 41.9", "a second run"]),
        with(
            "every fifth row dropped",
            "bad.csv",
            rows(|rows| rows.into_iter().enumerate().filter(|(n, _)| n % 5 != 2).map(|(_, r)| r).collect()),
            IDENTIFY,
            &["bad.csv:5: column t_s: 84 of the 420 rows are missing", "rows were dropped"],
        ),
        with(
            "a fifth of the rows dropped",
            "bad.csv",
            rows(|rows| rows.into_iter().enumerate().filter(|(n, _)| n * 7919 % 97 >= 20).map(|(_, r)| r).collect()),
            "close-loop bad.csv -o out",
            &["bad.csv:7: column t_s", "rows are missing that sample_hz = 10 promises"],
        ),
        with(
            "the third fifth dropped",
            "bad.csv",
            rows(|rows| [&rows[..168], &rows[252..]].concat()),
            "plateaus bad.csv",
            &["bad.csv:171: column t_s: 84 of the 420 rows", "in one hole"],
        ),
        with(
            "thinned without a word",
            "bad.csv",
            rows(|rows| rows.into_iter().step_by(2).collect()),
            "step residual bad.csv",
            &["bad.csv:4: column t_s: 209 of the 419 rows"],
        ),
        with(
            "milliseconds",
            "bad.csv",
            times(|t| format!("{:.0}", 1000.0 * t)),
            IDENTIFY,
            &["bad.csv:4: column t_s: rows 100 s apart", "these look like milliseconds: divide t_s by 1000"],
        ),
        with(
            "microseconds",
            "bad.csv",
            times(|t| format!("{:.0}", 1e6 * t)),
            "predict model.toml bad.csv -o out.csv",
            &["these look like microseconds"],
        ),
        with(
            "milliseconds without a rate",
            "bad.csv",
            times(|t| format!("{:.0}", 1000.0 * t)).replace("# sample_hz = 10.0\n", ""),
            IDENTIFY,
            &["bad.csv:3: column t_s: whole numbers, 100 apart", "milliseconds"],
        ),
        with("a rate in words", "bad.csv", head("10.0", "\"ten\""), IDENTIFY, &["bad.csv:2: sample_hz = \"ten\""]),
        with(
            "semicolons",
            "bad.csv",
            good_log().replace(',', ";"),
            IDENTIFY,
            &["bad.csv:3: semicolons between the columns", "`quadrig import`"],
        ),
        with("tabs", "bad.csv", good_log().replace(',', "\t"), IDENTIFY, &["bad.csv:3: tabs between the columns"]),
        with("decimal commas", "bad.csv", good_log().replace('.', ","), IDENTIFY, &["bad.csv:4: ", "decimal points"]),
        with(
            "one decimal comma",
            "bad.csv",
            row(100, |row| row.replacen(",1200.0,", ",1200,0,", 1).replacen(",1350.0,", ",1350,0,", 1)),
            IDENTIFY,
            &["bad.csv:104: column pulse_us: '1200,0', and so 7 fields", "a decimal comma? Write 1200.0"],
        ),
        with("bytes", "bad.csv", (0..=255_u8).cycle().take(4096).collect::<Vec<u8>>(), IDENTIFY, &["bad.csv"]),
        with("nothing", "bad.csv", "", IDENTIFY, &["bad.csv"]),
        with("no rows", "bad.csv", rows(|_| Vec::new()), IDENTIFY, &["bad.csv:", "no data rows"]),
        with("another version", "bad.csv", head("log 1", "log 9"), IDENTIFY, &["bad.csv:1: '# quadrig-log 9'"]),
        with(
            "time is not first",
            "bad.csv",
            head("t_s,pulse_us", "pulse_us,t_s"),
            IDENTIFY,
            &["bad.csv:3: column pulse_us: not the time column"],
        ),
        with(
            "a log without its header",
            "bad.csv",
            good_log().replacen("t_s,pulse_us,rpm,thrust_n,current_a,voltage_v\n", "", 1),
            IDENTIFY,
            &["bad.csv:3: no header: the first line that is no comment holds numbers", "put it back"],
        ),
        with("a column twice", "bad.csv", head("current_a", "rpm"), IDENTIFY, &["bad.csv:3: column rpm: it stands twice"]),
        with("a column without a name", "bad.csv", head("current_a", ""), IDENTIFY, &["bad.csv:3: column 5 has no name"]),
        with(
            "grams",
            "bad.csv",
            head("thrust_n", "thrust_g"),
            IDENTIFY,
            &["bad.csv:3: column thrust_g", "thrust_n; convert the values"],
        ),
        with(
            "a column in capitals",
            "bad.csv",
            head("thrust_n", "Thrust_N"),
            IDENTIFY,
            &["bad.csv:3: column Thrust_N: a known column in other letters", "thrust_n"],
        ),
        with(
            "milliamperes",
            "bad.csv",
            head("current_a", "current_ma"),
            IDENTIFY,
            &["bad.csv:3: column current_ma", "current_a"],
        ),
        with(
            "pulses in ms",
            "bad.csv",
            row(100, |row| row.replacen(",1200.0,", ",1.2,", 1).replacen(",1350.0,", ",1.35,", 1)),
            IDENTIFY,
            &["bad.csv:104: column pulse_us: 1.2", "500 to 2500 us"],
        ),
        with(
            "not a number",
            "bad.csv",
            row(50, |row| row.replacen(",1000.0,", ",NaN,", 1)),
            IDENTIFY,
            &["bad.csv:54: column pulse_us: 'NaN'"],
        ),
        with(
            "a column whose name has no end",
            "bad.csv",
            head("current_a", &"x".repeat(66_000)),
            IDENTIFY,
            &["bad.csv:3: column xxx", "a name of 66000 characters", "200 at most"],
        ),
        with(
            "an export's column whose name has no end",
            "bad.csv",
            good_log().lines().skip(2).map(|line| line.replace("current_a", &"x".repeat(66_000)) + "\n").collect::<String>(),
            IDENTIFY,
            &["bad.csv:1: column xxx", "a name of 66000 characters"],
        ),
        with(
            "a number whose digits have no end",
            "bad.csv",
            row(60, |row| {
                let fields = row.split(',').enumerate();
                let long = |(k, field): (usize, &str)| if k == 1 { "9".repeat(100_000) } else { field.to_owned() };
                fields.map(long).collect::<Vec<String>>().join(",")
            }),
            IDENTIFY,
            &["bad.csv:64: column pulse_us: '99999", "999...'"],
        ),
        with("a word", "bad.csv", row(60, |row| format!("{}x", row)), IDENTIFY, &["bad.csv:64: column voltage_v: '"]),
        with(
            "a row cut short",
            "bad.csv",
            row(70, |row| row[..row.len() - 8].to_owned()),
            IDENTIFY,
            &["bad.csv:74: column voltage_v: the row ends before it"],
        ),
        with(
            "a row cut short in its time",
            "bad.csv",
            good_log()
                .lines()
                .map(|line| line.strip_prefix("41.9,").map_or(format!("{line}\n"), |_| "41".to_owned()))
                .collect::<String>(),
            IDENTIFY,
            &["bad.csv:423: column pulse_us: the row ends before it (1 field)", "is the file truncated?"],
        ),
        with("a field too many", "bad.csv", row(70, |row| format!("{row},1")), IDENTIFY, &["bad.csv:74: 7 fields"]),
        with(
            "a time without a value",
            "bad.csv",
            row(80, |row| row[row.find(',').expect("a comma")..].to_owned()),
            IDENTIFY,
            &["bad.csv:84: column t_s: an empty field"],
        ),
        with(
            "a time twice",
            "bad.csv",
            row(80, |row| row.replacen("8.0,", "7.9,", 1)),
            IDENTIFY,
            &["bad.csv:84: column t_s: 7.9 repeats the row before"],
        ),
        with(
            "a time that steps back",
            "bad.csv",
            row(80, |row| row.replacen("8.0,", "7.0,", 1)),
            IDENTIFY,
            &["bad.csv:84: column t_s: 7 steps back from 7.9", "one row steps back"],
        ),
        with(
            "a time that leaps ahead",
            "bad.csv",
            row(80, |row| row.replacen("8.0,", "999999,", 1)),
            IDENTIFY,
            &["bad.csv:84: column t_s: 999999 leaps ahead, after 7.9; line 85 goes on at 8.1", "take the row out"],
        ),
        with("two rows", "bad.csv", rows(|rows| rows[..2].to_vec()), IDENTIFY, &["bad.csv", "more than 8 common samples"]),
        with(
            "channels without values",
            "bad.csv",
            rows(|rows| rows.iter().map(|r| format!("{},,,,,", r.split(',').next().expect("a time"))).collect()),
            IDENTIFY,
            &["bad.csv"],
        ),
        alone("a log that is not there", "close-loop nowhere.csv", &["nowhere.csv: cannot be read", "check name and folder"]),
        alone("a folder in the place of a log", "identify . -o out.toml", &[".: "]),
        with(
            "an attitude log in the place of a rig log",
            "bad.csv",
            "t_s,gx,gy,gz,ax,ay,az\n0,0,0,0,0,0,9.8\n",
            IDENTIFY,
            &["bad.csv"],
        ),
        alone("a rig log in the place of an attitude log", "ahrs good.csv out.csv", &["good.csv:3: ", "gx,gy,gz"]),
        with(
            "an attitude log without its accelerometer",
            "bad.csv",
            "t_s,gx,gy,gz,ax,ay\n0,0,0,0,0,0\n",
            "ahrs bad.csv out.csv",
            &["bad.csv:1: ", "ax,ay,az"],
        ),
        with(
            "attitude times that step back",
            "bad.csv",
            "t_s,gx,gy,gz,ax,ay,az\n0,0,0,0,0,0,9.8\n1,0,0,0,0,0,9.8\n0.5,0,0,0,0,0,9.8\n",
            "ahrs bad.csv out.csv",
            &["bad.csv:4: column t_s: 0.5 does not come after 1"],
        ),
        with(
            "a pair without its motor",
            "bad.csv",
            "motor,propeller,thrust_n,current_a\n,B,9,3\n",
            "select bad.csv",
            &["bad.csv:2: column motor: an empty field"],
        ),
        with(
            "a pair that lifts a mountain",
            "bad.csv",
            "motor,propeller,thrust_n,current_a\nA,B,1e30,3\n",
            "select bad.csv",
            &["bad.csv:2: column thrust_n: '1e30'", "a sensor can read"],
        ),
        with(
            "a table of pairs with a word",
            "bad.csv",
            "motor,propeller,thrust_n,current_a\nA,B,x,1\n",
            "select bad.csv",
            &["bad.csv:2: column thrust_n: 'x'"],
        ),
    ]
}

/// Keys of the head with values that no rig has: each at its own line.
/// An export whose head says grams.
const IN_GRAMS: &str = "t_s,rpm,Load(g)\n0,1000,10\n0.1,1000,10\n0.2,1000,10\n";

pub(super) fn heads() -> Vec<Case> {
    let case = |name, line: &str, said| {
        let text = good_log().replacen("# sample_hz", &format!("# motor = \"570KV\"\n{line}\n# sample_hz"), 1);
        with(name, "bad.csv", text, IDENTIFY, said)
    };
    let foreign = good_log().replacen("# quadrig-log 1", "# pole_pairs = 0", 1);
    vec![
        case("pole pairs below 0", "# pole_pairs = -7", &["bad.csv:3: pole_pairs = -7; expected a whole number of pole pairs"]),
        case("no pole pairs", "# pole_pairs = 0", &["bad.csv:3: pole_pairs = 0; ", "take the line out"]),
        case("many pole pairs", "# pole_pairs = \"many\"", &["bad.csv:3: pole_pairs = \"many\"; "]),
        case("no blades", "# blades = 0", &["bad.csv:3: blades = 0; ", "from 1 to 12"]),
        case("a diameter below 0", "# diameter_m = -1", &["bad.csv:3: diameter_m = -1; ", "in m, above 0"]),
        case("a diameter in mm", "# diameter_m = 280", &["bad.csv:3: diameter_m = 280: ", "millimetres"]),
        case("air below 0", "# air_density_kg_m3 = -1", &["bad.csv:3: air_density_kg_m3 = -1; ", "such as 1.2"]),
        case("thin air", "# air_density_kg_m3 = \"thin\"", &["bad.csv:3: air_density_kg_m3 = \"thin\"; ", "kg/m^3"]),
        case("thick air", "# air_density_kg_m3 = 1e9", &["bad.csv:3: air_density_kg_m3 = 1000000000.0: air of", "vouched"]),
        case("a propeller in mm", "# propeller = \"280x120\"", &["bad.csv:3: propeller = \"280x120\": ", "millimetres?"]),
        case("a head in kelvin", "# temp_c = 288", &["bad.csv:3: temp_c = 288; ", "Celsius"]),
        case("a pressure in pascal", "# pressure_hpa = 101325", &["bad.csv:3: pressure_hpa = 101325; ", "hPa"]),
        case(
            "a propeller without quotes",
            "# propeller = 11x4.7",
            &["bad.csv:3: column propeller: 11x4.7; ", "propeller = \"11x4.7\""],
        ),
        with(
            "an export in grams",
            "bad.csv",
            IN_GRAMS,
            "import bad.csv -o out.csv --map thrust_n=Load(g)",
            &["bad.csv:1: column Load(g): its head says g", "--map 'thrust_n=Load(g)*0.00980665'"],
        ),
        with(
            "a channel without its unit",
            "bad.csv",
            IN_GRAMS,
            "import bad.csv -o out.csv --map thrust=Load(g)*0.0098",
            &["bad.csv:1: column Load(g): no channel is called thrust; ", "--map 'thrust_n=...'"],
        ),
        with("an export without pole pairs", "bad.csv", foreign, "import bad.csv -o out.csv", &["bad.csv:1: pole_pairs = 0; "]),
    ]
}

/// Readings that no rig has.
pub(super) fn impossible() -> Vec<Case> {
    let column = |k: usize, of: &dyn Fn(&str) -> String| {
        let changed = |row: &String| {
            let mut cells: Vec<String> = row.split(',').map(str::to_owned).collect();
            cells[k] = of(&cells[k]);
            cells.join(",")
        };
        rows(|rows| rows.iter().map(changed).collect())
    };
    let turned = column(3, &|thrust| format!("{:.4}", -thrust.parse::<f64>().expect("a number")));
    let unseen = column(2, &|_| "0".to_owned());
    let backwards = column(2, &|rpm| format!("{:.1}", -rpm.parse::<f64>().expect("a number")));
    let warm = |line: &str| match line.split(',').count() {
        6 if line.starts_with("t_s") => format!("{line},temp_c\n"),
        6 => format!("{line},288.15\n"),
        _ => format!("{line}\n"),
    };
    let kelvin: String = good_log().lines().map(warm).collect();
    let holed = rows(|mut rows| {
        rows.drain(200..300);
        rows
    });
    let unrated = |keep: &dyn Fn(usize) -> bool| {
        let kept = rows(|rows| rows.into_iter().enumerate().filter(|(n, _)| keep(*n)).map(|(_, row)| row).collect());
        kept.replacen("# sample_hz = 10.0\n", "", 1)
    };
    let foreign = |keep: &dyn Fn(usize) -> bool| {
        unrated(keep).lines().skip(1).map(|line| line.replacen("t_s", "Time (s)", 1) + "\n").collect::<String>()
    };
    // an export of another program: rows of an even clock are gone here and there
    let thinned: String = good_log()
        .lines()
        .skip(2)
        .enumerate()
        .filter(|(n, _)| *n == 0 || (n * n + n / 7) % 4 != 3)
        .map(|(_, line)| line.replacen("t_s", "Time (s)", 1) + "\n")
        .collect();
    vec![
        with("thrust of the other sign", "bad.csv", turned, IDENTIFY, &["bad.csv:3: column thrust_n: ", "the other way round?"]),
        with("a speed of the other sign", "bad.csv", backwards, IDENTIFY, &["bad.csv:3: column rpm: -", "the sign?"]),
        with("kelvin", "bad.csv", kelvin, IDENTIFY, &["bad.csv:3: column temp_c: 288.1", "kelvin?"]),
        with("a rotor that no sensor sees", "bad.csv", unseen, IDENTIFY, &["column rpm: 0 rev/min on every sensor", "A"]),
        with(
            "a thrust without measure",
            "bad.csv",
            row(80, |row| {
                let mut cells: Vec<&str> = row.split(',').collect();
                cells[3] = "1e308";
                cells.join(",")
            }),
            IDENTIFY,
            &["bad.csv:84: column thrust_n: '1e308'", "a number that a sensor can read"],
        ),
        with(
            "no rows a second",
            "bad.csv",
            good_log().replacen("sample_hz = 10.0", "sample_hz = 0", 1),
            IDENTIFY,
            &["bad.csv:2: sample_hz = 0", "above 0"],
        ),
        with(
            "a hole in the midst",
            "bad.csv",
            holed,
            IDENTIFY,
            &["bad.csv:203: column t_s: 100 of the ", "in one hole, from 19.9 s on"],
        ),
        with(
            "an export with a quarter of its rows gone",
            "bad.csv",
            thinned,
            IDENTIFY,
            &["bad.csv:1: column t_s: ", "use the whole export"],
        ),
        with(
            "an export without every fifth row",
            "bad.csv",
            foreign(&|n| n % 5 != 3),
            "import bad.csv -o out.csv",
            &["bad.csv:1: column t_s: 20 % of the time has no row", "a thinned export", "--map 't_s=COLUMN*1'"],
        ),
        with(
            "an export without a fifth of its rows",
            "bad.csv",
            foreign(&|n| n * 7919 % 97 >= 20),
            "import bad.csv -o out.csv",
            &["bad.csv:1: column t_s: ", "at uneven places", "use the whole export"],
        ),
        with(
            "a log without every fifth row, and without a rate",
            "bad.csv",
            unrated(&|n| n % 5 != 3),
            IDENTIFY,
            &["bad.csv:2: column t_s: 20 % of the time has no row", "use the whole log", "# vouched = [\"t_s\"]"],
        ),
        with(
            "a log without a fifth of its rows, and without a rate",
            "bad.csv",
            unrated(&|n| n * 7919 % 97 >= 20),
            "close-loop bad.csv -o out",
            &["bad.csv:2: column t_s: ", "at uneven places", "use the whole log"],
        ),
    ]
}

/// Another kind than was wanted, in plain words: no type of the program's own.
pub(super) fn plain_words() -> Vec<Case> {
    const SIM: &str = "sim bad.toml -o out.csv";
    const CONFIGURE: &str = "rig --port sim --speed 0 configure bad.toml";
    const NEXT: &str = "rig --port sim --speed 0 run --next bad.json -o out.csv";
    let web = "<!doctype html><html><head><title>404</title></head><body>Not Found</body></html>\n";
    vec![
        with("a supply that is a number", "bad.toml", "supply = 12\n", SIM, &["bad.toml:1:10: supply: ", "expected a table"]),
        with("an ESC that is a word", "bad.toml", "esc = \"x\"\n", SIM, &["bad.toml:1:7: esc: a text", "expected a table"]),
        with(
            "a controller that is a number",
            "bad.toml",
            "duration_s = 2\ncontroller = 5\n",
            "fly bad.toml -o out",
            &["bad.toml:2:14: controller: ", "expected a table"],
        ),
        with(
            "a limit that is a number",
            "bad.toml",
            "[limits]\nspeed_rpm = 5\n",
            CONFIGURE,
            &["bad.toml:2:13: ", "expected a table"],
        ),
        with("a rate that is a word", "bad.toml", "rate_hz = \"x\"\n", CONFIGURE, &["bad.toml:1:11: ", "expected a"]),
        with(
            "a step above the whole range",
            "bad.toml",
            "[schedule]\nkind = \"staircase\"\nstep_us = 50000\nhold_s = 3\ntop_us = 2000\n",
            SIM,
            &["bad.toml:3:11: step_us: ", "above 0 and up to 1000 us, found 50000"],
        ),
        with(
            "a fault that ends before it begins",
            "bad.toml",
            "[[fault]]\nid = \"link_lost\"\nfrom_s = 5\nuntil_s = 3\n",
            SIM,
            &["bad.toml:4:11: until_s: ", "after from_s = 5, found 3"],
        ),
        with(
            "an unknown key with a list",
            "bad.toml",
            "duration_s = 2\n[wind]\nmean_m_s = [3, 0, 0]\n[[command]]\nrotors = [1, 2, 3, 4]\nsteps = [{ pulse_us = 1700, hold_s = 2 }]\n",
            "fly bad.toml -o out",
            &["bad.toml:3:1: unknown field `mean_m_s`"],
        ),
        alone(
            "a model in the place of a verdict",
            "rig --port sim --speed 0 run --next model.toml -o out.csv",
            &["model.toml:1:", "no verdict, which is JSON", "verdict.json of `quadrig close-loop"],
        ),
        with(
            "a verdict cut short",
            "bad.json",
            "{\"next_experiment\": {",
            NEXT,
            &["bad.json:1:", "ends in the midst", "cut short?"],
        ),
        with("a verdict with a comma too many", "bad.json", "{\"a\": 1,,}", NEXT, &["bad.json:1:", "no JSON from here on"]),
        with(
            "a verdict with a word for its schedule",
            "bad.json",
            "{\"next_experiment\": {\"why\": \"x\", \"schedule\": \"y\"}}",
            NEXT,
            &["bad.json:1:", "expected a list in brackets"],
        ),
        alone(
            "a mapping for a rig log",
            "identify good.csv -o out.toml --map thrust_n=x",
            &["good.csv is a rig log", "no --map"],
        ),
        with("a web page", "bad.csv", web, IDENTIFY, &["bad.csv:1:1: a web page", "was a link saved"]),
        with("a web page for a scenario", "bad.toml", web, SIM, &["bad.toml:1:1: a web page", "a description in TOML"]),
        alone("a folder for pairs", "select full", &["full: is a folder", "rig logs, exports or tables", "full/*.csv"]),
        alone("a staircase that is never climbed", "rig --port sim --speed 0 run --step 0 -o out.csv", &["--step 0: "]),
        with(
            "a pair twice",
            "bad.csv",
            "motor,propeller,thrust_n,current_a\nA,B,3,1\nA,B,4,1\n",
            "select bad.csv",
            &["bad.csv:3: 'A' with 'B' stands on line 2, too", "each pair once"],
        ),
    ]
}
