//! `quadrig flash rig` builds the image that the emulated boards run, to the byte.

use hal_sim::emulated::firmware;
use quadrig_tests::probe::Probe;

#[test]
fn what_is_flashed_is_what_the_emulator_runs() {
    let folder = tempfile::tempdir().expect("a folder");
    let probe = Probe::new(folder.path(), "echo '[0]: STLink V2'");
    for (board, package) in [("rig", "firmware-rig"), ("ahrs", "firmware-ahrs")] {
        let tested = std::fs::read(firmware(package).unwrap_or_else(|error| panic!("{error}"))).expect("the image");
        let said = probe.flash(&[board]);
        assert_eq!(said.status, Some(0), "{}", said.err);
        let asked = probe.asked();
        let elf =
            asked.lines().last().and_then(|line| line.strip_prefix("run --chip STM32F405RGTx ")).expect("an image to flash");
        assert_eq!(&tested[..4], b"\x7fELF");
        assert!(std::fs::read(elf).expect("the image that was built") == tested, "{elf} is not the image under test");
    }
}
