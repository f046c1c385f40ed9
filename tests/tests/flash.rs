//! `quadrig flash` with and without probe-rs, and with and without a probe.

use quadrig_tests::probe::{Probe, flash};

/// One probe is listed.
const ONE: &str = "echo '[0]: STLink V2 (VID: 0483, PID: 3748, Serial: 1, StLink)'";

#[test]
fn without_probe_rs_one_line_says_how_to_get_it() {
    let folder = tempfile::tempdir().expect("a folder");
    flash([folder.path().to_owned()], &["rig"]).refused(&["probe-rs cannot be started", "cargo install probe-rs-tools"]);
}

#[test]
fn without_a_probe_one_line_says_what_to_connect() {
    let folder = tempfile::tempdir().expect("a folder");
    let probe = Probe::new(folder.path(), "echo 'No debug probes were found.'");
    for board in ["rig", "ahrs"] {
        probe.flash(&[board]).refused(&["no debug probe was found", "SWD"]);
    }
    assert_eq!(probe.asked(), "list\nlist\n", "nothing but the list was asked for");
}

#[test]
fn a_probe_gets_the_image_and_stays_attached() {
    let folder = tempfile::tempdir().expect("a folder");
    let probe = Probe::new(folder.path(), ONE);
    let elf = folder.path().join("image.elf");
    let elf = elf.to_str().expect("a name");
    probe.flash(&["rig", "--elf", elf]).refused(&["image.elf", "no such image"]);
    std::fs::write(elf, "a page").expect("a file");
    probe.flash(&["rig", "--elf", elf]).refused(&["image.elf: no image of a board", "expected an ELF file"]);
    std::fs::write(elf, "\u{7f}ELF, an image").expect("a file");
    let said = probe.flash(&["rig", "--elf", elf]);
    assert_eq!(said.status, Some(0), "{}", said.err);
    // `probe-rs run` flashes, starts the image and prints its defmt messages until it is interrupted
    assert_eq!(probe.asked(), format!("list\nrun --chip STM32F405RGTx {elf}\n"));
}

#[test]
fn a_probe_that_fails_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let probe = Probe::new(folder.path(), &format!("if [ \"$1\" = list ]; then {ONE}; else exit 3; fi"));
    let elf = folder.path().join("image.elf");
    std::fs::write(&elf, "\u{7f}ELF, an image").expect("a file");
    probe.flash(&["rig", "--elf", elf.to_str().expect("a name")]).refused(&["probe-rs ended with", "3"]);
}
