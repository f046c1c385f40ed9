//! What people have: small files in the manner of many programs, each with the log or the refusal that must come of it.
//!
//! What it is: one table: bytes, what the user adds, and a value, a line of the report or a line of refusal.
//! What can go wrong: a unit guessed, a conversion not said, a file refused without its reason.
//! Units: as the headers say.
//! Reference: specification `formats.md`, `quadrig import`; RCbenchmark 1585 and 1780, Tyto Flight Stand, VESC Tool, KISS, BLHeli, AM32.

use ident::log::Log;
use ident::log::import::{Options, Report, import_from};

fn import(bytes: &[u8], options: &Options) -> Result<(Log, Report), String> {
    import_from("x.csv", bytes, options).map_err(|e| e.to_string())
}

fn maps(words: &[&str]) -> Options {
    Options { mappings: words.iter().map(|w| w.parse().expect("a mapping")).collect(), ..Options::default() }
}

/// A column's value in a row, and what the report must say.
struct Wanted {
    name: &'static str,
    text: &'static str,
    values: &'static [(&'static str, usize, f64)],
    said: &'static [&'static str],
}

const TAKEN: [Wanted; 24] = [
    Wanted {
        name: "RCbenchmark 1585, rad/s, optical probe alone",
        text: "Time (s),ESC signal (\u{b5}s),Servo 1 (\u{b5}s),Torque (N\u{b7}m),Thrust (gf),Voltage (V),Current (A),Motor Electrical Speed (rad/s),Motor Optical Speed (rad/s),Electrical Power (W),App message,\n\
               0,1000,,0,0,16,0,0,0,0,,\n0.5,1500,,0.02,200,16,2,0,800,32,,\n1,1500,,0.02,200,16,2,0,800,32,,\n",
        values: &[("rpm", 1, 7_639.437_268), ("thrust_n", 1, 1.961_33), ("torque_nm", 1, 0.02)],
        said: &[
            "reads zero throughout: column left out",
            "the only speed that reads is the speed",
            "times 9.549297",
            "times 0.00980665",
        ],
    },
    Wanted {
        name: "a lone optical speed",
        text: "Time (s),Motor Optical Speed (RPM),Thrust (N)\n0,1000,0.1\n1,2000,0.4\n",
        values: &[("rpm", 1, 2000.0)],
        said: &["the only speed that reads is the speed"],
    },
    Wanted {
        name: "two speeds, the electrical one loses low speeds",
        text: "Time (s),Motor Electrical Speed (RPM),Motor Optical Speed (RPM),Thrust (N)\n0,0,0,0\n1,0,1000,0.1\n2,0,2000,0.4\n3,3000,3000,0.9\n",
        values: &[("rpm", 1, 1000.0), ("rpm_electrical", 1, 0.0)],
        said: &["of two speeds: this one is the speed (3 samples turn, 1 of rpm_electrical"],
    },
    Wanted {
        name: "two speeds, the optical one hardly reads",
        text: "Time (s),Motor Electrical Speed (RPM),Motor Optical Speed (RPM),Thrust (N)\n0,1000,0,0.1\n1,2000,0,0.4\n2,3000,3000,0.9\n",
        values: &[("rpm", 1, 2000.0), ("rpm_optical", 2, 3000.0)],
        said: &["of two speeds: this one is the speed (3 samples turn, 1 of rpm_optical"],
    },
    Wanted {
        name: "RCbenchmark 1780, two powertrains",
        text: "Time (s),ESC signal A (\u{b5}s),ESC signal B (\u{b5}s),Thrust A (kgf),Thrust B (kgf),Motor Optical Speed A (RPM),Motor Optical Speed B (RPM)\n0,1000,1000,0,0,0,0\n1,1500,1600,1,2,4000,5000\n",
        values: &[("thrust_n", 1, 9.806_65), ("rpm", 1, 4000.0), ("thrust_b_kgf", 1, 2.0)],
        said: &["more than one powertrain: side 1 is the rig"],
    },
    Wanted {
        name: "Tyto Flight Stand",
        text: "Time (s),Powertrain 1 - ESC throttle (\u{3bc}s),Powertrain 1 - rotation speed (rpm),Powertrain 1 - thrust (kgf),Powertrain 1 - torque (N\u{22c5}m),Powertrain 1 - voltage (V),Powertrain 1 - current (A),Powertrain 1 - electrical power (W)\n0,1000,0,0,0,24,0,0\n0.1,1500,3000,1,0.1,24,8,192\n",
        values: &[("pulse_us", 1, 1500.0), ("thrust_n", 1, 9.806_65), ("torque_nm", 1, 0.1), ("rpm", 1, 3000.0)],
        said: &["times 9.80665", "columns left out"],
    },
    Wanted {
        name: "European: semicolons, decimal comma, German names",
        text: "Zeit [s];Drehzahl [1/min];Schub [N];Strom [A];Spannung [V]\n0,0;0;0,00;0,1;11,5\n0,1;4.512,5;1,25;3,5;11,2\n",
        values: &[("rpm", 1, 4512.5), ("thrust_n", 1, 1.25), ("voltage_v", 1, 11.2)],
        said: &["decimal comma"],
    },
    Wanted {
        name: "quoted thousands",
        text: "Time (s),RPM,\"Thrust (gf)\"\n0,\"1,234\",\"1,234.5\"\n1,\"12,345\",900\n",
        values: &[("rpm", 0, 1234.0), ("rpm", 1, 12_345.0), ("thrust_n", 0, 12.106_309_425)],
        said: &["times 0.00980665"],
    },
    Wanted {
        name: "quoted decimal comma among commas",
        text: "Time (s),RPM,Thrust (N)\n\"0,0\",1000,\"0,12\"\n\"0,5\",2000,\"0,48\"\n",
        values: &[("thrust_n", 1, 0.48)],
        said: &["decimal comma"],
    },
    Wanted {
        name: "words for no value",
        text: "t_s,rpm,thrust_n,current_a\n0,1000,NaN,-\n1,inf,0.4,1\n2,2000,n/a,#DIV/0!\n3,3000,0.9,\n",
        values: &[("thrust_n", 0, f64::NAN), ("rpm", 1, f64::NAN), ("current_a", 1, 1.0)],
        said: &["words or signs for no value"],
    },
    Wanted {
        name: "time of day over midnight",
        text: "Time,RPM,Thrust (N)\n23:59:59.500,1000,0.1\n23:59:59.900,2000,0.4\n00:00:00.300,2000,0.4\n",
        values: &[("t_s", 2, 0.8)],
        said: &["time of day (a step back by half a day is midnight)"],
    },
    Wanted {
        name: "date and time with a third colon",
        text: "Timestamp,Amps,Batt. Volts,RPM,Duty\n2019-11-05 17:14:08:947,0.1,15.7,0,0\n2019-11-05 17:14:08:997,5,15.6,9000,50\n",
        values: &[("t_s", 1, 0.05), ("pulse_us", 1, 1500.0), ("current_a", 1, 5.0)],
        said: &["date and time of day", "duty in per cent"],
    },
    Wanted {
        name: "milliseconds since 1970",
        text: "timestamp,rpm,thrust_n\n1572974048947,1000,0.1\n1572974049447,2000,0.4\n",
        values: &[("t_s", 1, 0.5)],
        said: &["ms since 1970 by its size"],
    },
    Wanted {
        name: "KISS telemetry: hundreds of electrical turns, milliseconds",
        text: "Time (ms),Temperature (\u{b0}C),Voltage (V),Current (A),Consumption (mAh),eRPM (x100)\n0,25,16.2,0,0,0\n20,26,16.0,5.2,1,700\n",
        values: &[("t_s", 1, 0.02), ("rpm", 1, 10_000.0), ("charge_esc_mah", 1, 1.0), ("temp_c", 1, 26.0)],
        said: &["electrical turns, times 100 over 7 pole pairs", "times 0.001"],
    },
    Wanted {
        name: "BLHeli telemetry without units",
        text: "time_ms,temp,volt,current,erpm\n0,25,16.2,0,0\n20,26,16.0,5.2,70000\n",
        values: &[("voltage_v", 1, 16.0), ("current_a", 1, 5.2), ("rpm", 1, 10_000.0)],
        said: &["taken as V, by its size", "taken as A, by its size", "taken as degC"],
    },
    Wanted {
        name: "AM32: fahrenheit, centivolts",
        text: "time_s;ERPM;Voltage (cV);Current (cA);ESC temperature (\u{b0}F)\n0;0;1620;0;77\n0.02;70000;1600;520;212\n",
        values: &[("voltage_v", 1, 16.0), ("current_a", 1, 5.2), ("temp_c", 1, 100.0)],
        said: &["times 0.01"],
    },
    Wanted {
        name: "VESC Tool",
        text: "ms_today;input_voltage;temp_mos_max;temp_mos_1;temp_motor;current_motor;current_in;d_axis_current;erpm;duty_cycle;amp_hours_used;fault_code;\n\
               86399980;24.1;30.0;30.0;-98.7;0.1;0.0;0;0;0.000;0;0;\n20;24.0;30.1;30.0;-98.7;12.0;6.0;0;21000;0.500;0.001;0;\n",
        values: &[
            ("t_s", 1, 86_400.02),
            ("rpm", 1, 3000.0),
            ("current_a", 1, 6.0),
            ("pulse_us", 1, 1500.0),
            ("temp_c", 1, 30.1),
            ("current_motor", 1, 12.0),
        ],
        said: &["electrical turns, times 1 over 7 pole pairs", "columns left out"],
    },
    Wanted {
        name: "lines above the header, units below it, sep=",
        text: "sep=;\nMotor test of today;;;\n;;;\nTime;RPM;Thrust;Current\ns;rpm;kg;A\n0;1000;0.1;1\n1;2000;0.4;3\n",
        values: &[("thrust_n", 1, 3.922_66), ("current_a", 1, 3.0)],
        said: &["lines above the header", "a line of units under the header"],
    },
    Wanted {
        name: "a header in a comment (numpy)",
        text: "# t_s rpm thrust_n\n0.0 1000 0.1\n1.0 2000 0.4\n",
        values: &[("t_s", 1, 1.0), ("thrust_n", 1, 0.4)],
        said: &["the comment above the first row is its header"],
    },
    Wanted {
        name: "a column of words, fields that end early where nothing stands",
        text: "t_s,rpm,thrust_n,mode,,\n0,1000,0.1,RUN,,\n1,2000,0.4,RUN\n",
        values: &[("rpm", 1, 2000.0)],
        said: &["cells of text: column left out"],
    },
    Wanted {
        name: "a pulse without a unit",
        text: "Time (s),Throttle,RPM,Thrust (N)\n0,1000,0,0\n1,1500,4000,1\n2,0,0,0\n",
        values: &[("pulse_us", 1, 1500.0), ("pulse_us", 2, f64::NAN)],
        said: &["taken as us, by its size", "no pulse (0, or outside"],
    },
    Wanted {
        name: "names with their unit at the end",
        text: "time_ms,thrust_g,current_ma,voltage_mv,rpm\n0,0,0,16000,0\n100,500,5000,15900,9000\n",
        values: &[("thrust_n", 1, 4.903_325), ("current_a", 1, 5.0), ("voltage_v", 1, 15.9)],
        said: &["times 0.00980665", "times 0.001"],
    },
    Wanted {
        name: "two voltages",
        text: "t_s,rpm,Voltage (V),ESC voltage (V)\n0,1000,16,15.8\n1,2000,16,15.7\n",
        values: &[("voltage_v", 1, 16.0), ("esc_voltage_v", 1, 15.7)],
        said: &["column 'Voltage (V)' is taken; 'ESC voltage (V)' is kept as a further column"],
    },
    Wanted {
        name: "a head of our own",
        text: "# quadrig-log 1\n# motor = \"F40\"\n# event = \"0.5 s: gust\"\nt_s,rpm,thrust_n\n0,1000,0.1\n1,2000,0.4\n",
        values: &[("rpm", 1, 2000.0)],
        said: &[],
    },
];

#[test]
fn exports_become_logs_and_every_conversion_is_said() {
    let options = Options { pole_pairs: Some(7.0), ..Options::default() };
    for wanted in TAKEN {
        let Wanted { name, text, values, said } = wanted;
        let (log, report) = import(text.as_bytes(), &options).unwrap_or_else(|e| panic!("{name}: {e}"));
        for (column, row, value) in values {
            let found = if *column == "t_s" { Some(log.t.as_slice()) } else { log.column(column) };
            let found = found.unwrap_or_else(|| panic!("{name}: no {column} in {:?}", log.columns))[*row];
            assert!(
                (found - value).abs() < 1e-6 * value.abs().max(1e-3) || (found.is_nan() && value.is_nan()),
                "{name}: {column} {found}"
            );
        }
        let table = report.table();
        for line in said {
            assert!(table.contains(line), "{name}: lacks '{line}'\n{table}");
        }
    }
}

#[test]
fn what_is_in_doubt_is_refused_with_the_likely_reason() {
    let staircase = |head: &str, row: &dyn Fn(f64, f64) -> String| -> String {
        head.to_owned()
            + &(0..60).map(|i| row(f64::from(i), if i < 10 { 0.0 } else { 1.0 + 0.01 * f64::from(i % 7) })).collect::<String>()
    };
    let all = "t_s,rpm,thrust_n,torque_nm,current_a,voltage_v\n";
    for (text, wanted) in [
        (
            "Time,RPM,Thrust (N)\n0,1,1\n20,2,2\n40,3,3\n".to_owned(),
            "column Time: a time without a unit, rows 20 apart: milliseconds (a row each 0.02 s)?",
        ),
        ("Time (s),RPM,Thrust\n0,1000,100\n1,2000,400\n".to_owned(), "column Thrust: no unit, values up to 400: grams?"),
        ("Time (s),ESC signal,RPM\n0,0,0\n1,1500,9000\n2,200,1000\n".to_owned(), "DShot 0 to 2047?"),
        (
            "Time (s),RPM,Voltage\n0,1000,16000\n1,2000,15900\n".to_owned(),
            "column Voltage: no unit, values up to 16000: millivolts?",
        ),
        (
            "Time (s),eRPM,Voltage (V)\n0,1000,16\n1,2000,15\n".to_owned(),
            "column eRPM: electrical turns and no pole pairs; expected --pole-pairs",
        ),
        ("Time (s),RPM,Thrust (stone)\n0,1000,1\n1,2000,4\n".to_owned(), "column Thrust (stone): no known unit for thrust_n"),
        ("t_s;rpm;thrust_n\n0,5;1000;1\n0.7;2000;4\n".to_owned(), "x.csv:3: a decimal point, and on line 2 a decimal comma"),
        (
            "Time (s),RPM,Thrust (N)\n0,0,1000,1,0\n0,5,2000,4,5\n".to_owned(),
            "5 fields; expected 3 as in the header (decimal commas?",
        ),
        (
            "t_s,rpm,thrust_n,load\n0,1000,1,1\n1,2000,4,x\n2,2000,4,1\n3,2000,4,1\n4,1,1,1\n".to_owned(),
            "x.csv:3: column load: 'x'",
        ),
        ("t_s,rpm,thrust_n\n0,1000,0x1F\n".to_owned(), "x.csv:2: column thrust_n: '0x1F'"),
        ("time,rpm,thrust_n\n12:00:00,1000,1\n5,2000,4\n".to_owned(), "numbers among dates or times of day"),
        (staircase(all, &|i, u| format!("{},{},{},0,{},12\n", 20.0 * i, 5000.0 * u, 2.0 * u, 5.0 * u)), ""),
        (
            staircase(all, &|i, u| format!("{},{},{},0,{},12\n", 100.0 * i, 5000.0 * u, 2.0 * u, 5.0 * u)),
            "column t_s: rows 100 s apart, 5900 s in all: milliseconds (a row each 0.1 s)?",
        ),
        (
            staircase(all, &|i, u| format!("{},{},{},0,{},12\n", 1e-6 * i, 5000.0 * u, 2.0 * u, 5.0 * u)),
            "column t_s: rows 0.000001",
        ),
        (
            staircase(all, &|i, u| format!("{},{},{},0,{},12\n", (0.1 * i).floor(), 5000.0 * u, 2.0 * u, 5.0 * u)),
            "54 of 60 rows would be dropped (54 repeat a time stamp, 0 step back, 0 have none): a clock of whole seconds?",
        ),
        (staircase(all, &|i, u| format!("{i},{},{},0,{},12\n", 5000.0 * u, 204.0 * u, 5.0 * u)), "column thrust_n: 210"),
        (staircase(all, &|i, u| format!("{i},{},{},0,{},12\n", 5000.0 * u, 0.0204 * u, 5.0 * u)), "kilograms? columns swapped?"),
        (
            staircase(all, &|i, u| format!("{i},{},{},0,{},12000\n", 5000.0 * u, 2.0 * u, 5.0 * u)),
            "column voltage_v: 12000 V: millivolts?",
        ),
        (staircase(all, &|i, u| format!("{i},{},{},0,{},12\n", 5000.0 * u, 2.0 * u, 5000.0 * u)), "A: milliamperes?"),
        (staircase(all, &|i, u| format!("{i},{},{},0,12,{}\n", 5000.0 * u, 2.0 * u, 5.0 * u)), "under load: columns swapped?"),
        (staircase(all, &|i, u| format!("{i},{},{},{},{},12\n", 5000.0 * u, 2.0 * u, 3.0 * u, 5.0 * u)), "column torque_nm: "),
        (staircase(all, &|i, u| format!("{i},{},{},0,{},12\n", 500_000.0 * u, 2.0 * u, 5.0 * u)), "electrical turns?"),
    ] {
        match import(text.as_bytes(), &Options::default()) {
            Ok((_, report)) => {
                // twenty seconds apart may be a table of held levels: said, not refused
                assert!(wanted.is_empty(), "taken, lacks {wanted}");
                assert!(report.table().contains("in doubt: rows 20 s apart"), "{}", report.table());
            }
            Err(message) => {
                assert!(!wanted.is_empty() && message.contains(wanted), "{message} lacks {wanted}");
                assert_eq!(message.lines().count(), 1);
            }
        }
    }
}

/// The user's word stands against a doubt, and the doubt is said all the same.
#[test]
fn a_mapping_vouches_for_its_column() {
    let rows: String = (0..60).map(|i| format!("{i},{},{},2.5,12\n", 5000 + i, 204)).collect();
    let text = format!("t_s,rpm,Load,current_a,voltage_v\n{rows}");
    let (_, report) = import(text.as_bytes(), &maps(&["thrust_n=Load"])).expect("taken");
    assert!(report.table().contains("in doubt: 204.000 N for 30.0 W: grams?"), "{}", report.table());
    let (log, report) = import(text.as_bytes(), &maps(&["thrust_n=Load*0.00980665"])).expect("taken");
    assert!(!report.table().contains("in doubt") && (log.column("thrust_n").unwrap()[0] - 2.000_556_6).abs() < 1e-6);
}

#[test]
fn encodings_are_told_by_the_bytes() {
    let text = "Zeit (s);Drehzahl (1/min);Drehmoment (N\u{b7}m);Temperatur (\u{b0}C)\n0;1000;0,01;20\n1;2000;0,04;21\n";
    let utf16 = |to: &dyn Fn(u16) -> [u8; 2]| text.encode_utf16().flat_map(to).collect::<Vec<u8>>();
    let cp1252: Vec<u8> = text.chars().map(|c| u8::try_from(u32::from(c)).expect("Latin")).collect();
    let with = |mark: &[u8], bytes: Vec<u8>| [mark, &bytes].concat();
    for (name, bytes, said) in [
        ("UTF-8", text.as_bytes().to_vec(), None),
        ("UTF-8 with a mark", with(b"\xEF\xBB\xBF", text.as_bytes().to_vec()), None),
        ("UTF-16LE with a mark", with(b"\xFF\xFE", utf16(&u16::to_le_bytes)), Some("text in UTF-16LE")),
        ("UTF-16BE with a mark", with(b"\xFE\xFF", utf16(&u16::to_be_bytes)), Some("text in UTF-16BE")),
        ("UTF-16LE", utf16(&u16::to_le_bytes), Some("text in UTF-16LE")),
        ("lines of Windows", text.replace('\n', "\r\n").into_bytes(), None),
        ("lines of an old Mac", text.replace('\n', "\r").into_bytes(), None),
        ("Windows-1252", cp1252, Some("text in windows-1252")),
    ] {
        let (log, report) = import(&bytes, &Options::default()).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!((log.column("torque_nm").unwrap()[1], log.column("temp_c").unwrap()[1]), (0.04, 21.0), "{name}");
        assert_eq!(log.len(), 2, "{name}");
        assert!(said.is_none_or(|s| report.table().contains(s)), "{name}: {}", report.table());
        assert_eq!(said.is_none(), !report.table().contains("text in"), "{name}");
    }
    for (bytes, wanted) in [
        (
            &b"PK\x03\x04\x14\0\x06\0"[..],
            "x.csv:1: a zip file, such as a spreadsheet (.xlsx, .ods); expected a CSV file: open it",
        ),
        (b"\xD0\xCF\x11\xE0", "an old spreadsheet (.xls)"),
        (b"\x1F\x8B\x08", "expected the unpacked file"),
        (b"t_s,rpm,thrust_n\n0,1,\0\n", "x.csv:2: a zero byte"),
        ("t_s,rpm,\u{b5}\n0,1,2\n1,\u{e9},\u{ff}\n".as_bytes(), "x.csv:3: column rpm"),
        (b"t_s,rpm,\xC2\xB5\n0,1,2\n1,\xE9,2\n", "x.csv:3: bytes that are not UTF-8"),
        (b"", "x.csv:1: the file is empty"),
        (b"t_s,thrust_n\n", "no data rows"),
        (b"t_s,a\n0,1\n", "0 known channel(s)"),
        (b"0,1,2\n1,2,3\n", "numbers where a header should stand"),
    ] {
        let message = import(bytes, &Options::default()).expect_err(wanted);
        assert!(message.contains(wanted), "{message} lacks {wanted}");
    }
}

#[test]
fn what_the_user_knows_travels_with_the_log() {
    let text = b"# motor = \"old\"\nTime (s),Thrust A (N),Thrust B (N),RPM A,RPM B\n0,0,0,0,0\n1,1,2,3000,4000\n";
    let options = Options {
        motor: Some("F40".into()),
        propeller: Some("T7056".into()),
        pole_pairs: Some(7.0),
        side: Some(2),
        ..Options::default()
    };
    let (log, _) = import(text, &options).expect("taken");
    assert_eq!(log.meta["motor"].as_str(), Some("F40"));
    assert_eq!((log.meta["propeller"].as_str(), log.meta["pole_pairs"].as_integer()), (Some("T7056"), Some(7)));
    assert_eq!((log.column("thrust_n").unwrap()[1], log.column("rpm").unwrap()[1]), (2.0, 4000.0));
    let none = import(text, &Options { side: Some(3), ..Options::default() }).expect_err("no third side");
    assert!(none.contains("no column of side 3"), "{none}");
}
