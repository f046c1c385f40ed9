//! The wiring guide's pin tables against the pins that the images' sources really set up.

use quadrig_tests::root;
use std::collections::{BTreeMap, BTreeSet};

/// Mode and pull of each pin.
type Pins = BTreeMap<String, (String, String)>;

fn read(path: &str) -> String {
    std::fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// Rows of the table of that name in the guide.
fn table(name: &str) -> Pins {
    let guide = read("docs/wiring.md");
    let from = guide.split_once(&format!("<!-- table: {name} -->")).unwrap_or_else(|| panic!("no table {name}")).1;
    let rows = from.split_once("<!-- end -->").expect("its end").0.lines().filter(|l| l.starts_with('|')).skip(2);
    let mut pins = Pins::new();
    for row in rows {
        let cells: Vec<&str> = row.trim_matches('|').split('|').map(str::trim).collect();
        assert_eq!(cells.len(), 8, "{row}");
        let before = pins.insert(cells[1].to_owned(), (cells[3].to_owned(), cells[4].to_owned()));
        assert!(before.is_none(), "{} twice", cells[1]);
    }
    pins
}

/// Pins that a source sets up by the HAL's `into_...` calls.
fn configured(source: &str) -> Pins {
    let text: String = source.lines().filter(|l| !l.trim_start().starts_with("//")).collect();
    let mut pins = Pins::new();
    for (at, _) in text.match_indices(".into_") {
        let name = text[..at].rsplit('.').next().unwrap_or("");
        if !(name.len() >= 3 && name.starts_with('p') && name[2..].parse::<u8>().is_ok()) {
            continue;
        }
        let call = &text[at + ".into_".len()..];
        // what belongs to this pin ends where the next expression begins
        let call = &call[..call.find([',', ';']).unwrap_or(call.len())];
        let mode = match call {
            c if c.starts_with("alternate::<") => format!("AF{}", &c["alternate::<".len()..c.find('>').expect("a number")]),
            c if c.starts_with("analog") => "analog".to_owned(),
            _ => "input".to_owned(),
        };
        let pull = match call {
            c if c.contains("pull_up(true)") || c.contains("pull_up_input") => "up",
            c if c.contains("pull_down(true)") || c.contains("pull_down_input") => "down",
            _ => "none",
        };
        pins.insert(name.to_uppercase(), (mode, pull.to_owned()));
    }
    pins
}

#[test]
fn the_rig_boards_pins_are_those_of_its_image() {
    let code = configured(&read("firmware-rig/src/main.rs"));
    assert!(code.len() > 10, "{code:?}");
    assert_eq!(table("pins"), code, "docs/wiring.md beside firmware-rig/src/main.rs");
}

#[test]
fn the_imu_boards_pins_are_those_of_its_image() {
    // the HAL takes these pins as they are and gives each its function
    let source = read("firmware-ahrs/src/main.rs");
    let ports = ["gpioa.", "gpiob.", "gpioc."];
    let taken = ports.iter().flat_map(|port| source.match_indices(port));
    let name = |at: usize| source[at..].split_once('.').expect("a dot").1.split(|c: char| !c.is_alphanumeric()).next();
    let code: BTreeSet<String> = taken.filter_map(|(at, _)| name(at).map(str::to_uppercase)).collect();
    assert_eq!(table("imu pins").into_keys().collect::<BTreeSet<_>>(), code, "docs/wiring.md beside firmware-ahrs/src/main.rs");
}

/// Pin of the package, DS8626 table 7 (LQFP64).
const LQFP64: [(&str, u8); 21] = [
    ("PC0", 8),
    ("PC1", 9),
    ("PC2", 10),
    ("PC3", 11),
    ("PA0", 14),
    ("PA1", 15),
    ("PA2", 16),
    ("PA3", 17),
    ("PA6", 22),
    ("PA7", 23),
    ("PC4", 24),
    ("PB11", 30),
    ("PB12", 33),
    ("PA8", 41),
    ("PA9", 42),
    ("PA10", 43),
    ("PA11", 44),
    ("PA13", 46),
    ("PA14", 49),
    ("PB6", 58),
    ("PB7", 59),
];

#[test]
fn every_pin_has_its_number_and_stands_in_the_boards_own_table() {
    let guide = read("docs/wiring.md");
    for (name, board) in [("pins", "firmware-rig/src/board/mod.rs"), ("imu pins", "firmware-ahrs/src/board/mod.rs")] {
        let module = read(board);
        for pin in table(name).keys() {
            let number = LQFP64.iter().find(|(p, _)| p == pin).unwrap_or_else(|| panic!("{pin}: no number known")).1;
            assert!(guide.contains(&format!("| {pin} | {number} |")), "{pin} is pin {number}");
            let cell = |l: &str| l.starts_with("//! |") && l.split('|').any(|c| c.split(',').any(|w| w.trim() == pin));
            assert!(module.lines().any(cell), "{board}: no row of {pin}");
        }
    }
    for picture in ["docs/wiring-analogue.svg", "docs/wiring-digital.svg"] {
        assert!(guide.contains(picture.trim_start_matches("docs/")), "{picture} is shown");
    }
    let analogue = read("docs/wiring-analogue.svg");
    for (pin, (mode, _)) in table("pins") {
        assert!(mode != "analog" || analogue.contains(&format!("{pin} / ADC1")), "{pin} is drawn");
    }
}
