//! Record and replay: the firmware alone on recorded pins sends the same bytes.

use hal_sim::native::{PinRecord, Session};
use hal_sim::{Scenario, run};
use std::path::{Path, PathBuf};

fn scenario(text: &str) -> Scenario {
    let text = format!("schedule = {{ kind = \"up_down\", step_us = 500, hold_s = 2, top_us = 2000 }}\n{text}");
    Scenario::parse(&text, Path::new("pins.toml")).unwrap_or_else(|e| panic!("{e}"))
}

fn recorded(scenario: &Scenario) -> (PinRecord, Vec<u8>) {
    let mut session = Session::new(scenario, None);
    session.record_pins(scenario);
    while session.step().unwrap_or_else(|e| panic!("{e}")) {}
    let pins = session.pins().cloned().expect("a record");
    (pins, session.finish().unwrap_or_else(|e| panic!("{e}")).telemetry)
}

fn file(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("quadrig-{}-{name}", std::process::id()))
}

#[test]
fn the_firmware_alone_sends_the_same_bytes() {
    let s = scenario("");
    let (pins, telemetry) = recorded(&s);
    assert_eq!(telemetry, run(&s, None, &mut |_| ()).unwrap_or_else(|e| panic!("{e}")).telemetry, "recording changes nothing");
    let path = file("pins.bin");
    pins.write(&mut std::fs::File::create(&path).unwrap()).unwrap();
    let read = PinRecord::read(&path).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(read, pins);
    let again = Scenario::parse(read.scenario(), Path::new("recorded.toml")).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(again, s);
    assert_eq!(read.replay(&again, &mut |_| ()), telemetry);
    println!("{} ms of pins in {} bytes", read.len(), std::fs::metadata(&path).unwrap().len());
    std::fs::remove_file(&path).unwrap();
}

/// Other pins, other bytes: the replay reads what is in the record.
#[test]
fn another_record_gives_other_bytes() {
    let (pins, telemetry) = recorded(&scenario("seed = 2\n"));
    let (_, other) = recorded(&scenario("seed = 3\n"));
    let replayed = pins.replay(&scenario("seed = 3\n"), &mut |_| ());
    assert!(replayed == telemetry && replayed != other, "the seed is in the pins, not in the firmware");
}

#[test]
fn a_damaged_record_is_refused_in_one_line() {
    let path = file("damaged.bin");
    let (pins, _) = recorded(&scenario(""));
    let mut bytes = Vec::new();
    pins.write(&mut bytes).unwrap();
    for (cut, word) in [(&bytes[..bytes.len() - 3], "one more millisecond"), (&bytes[1..40], "quadrig pins 3")] {
        std::fs::write(&path, cut).unwrap();
        let message = PinRecord::read(&path).unwrap_err().to_string();
        assert!(message.contains(word) && message.contains("byte") && !message.contains('\n'), "{message}");
    }
    std::fs::remove_file(&path).unwrap();
    assert!(PinRecord::read(Path::new("/nowhere/pins.bin")).unwrap_err().to_string().starts_with("/nowhere/pins.bin"));
}

/// A session that is paused anywhere is the run that was not.
#[test]
fn pauses_change_nothing() {
    let s = scenario("");
    let mut session = Session::new(&s, None);
    let mut steps = 0;
    while session.step().unwrap_or_else(|e| panic!("{e}")) {
        steps += 1;
        if steps % 1000 == 0 {
            let _ = (session.truth(), session.sample(), session.share(), session.phase(), session.now_s());
        }
    }
    let record = session.finish().unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(record, run(&s, None, &mut |_| ()).unwrap_or_else(|e| panic!("{e}")));
}
