//! How the flash image starts, and what its log may not do: seen at the registers that it writes.
//!
//! Build the image first: `cargo xtask image`

use frame::message::{Command, Event, Message};
use frame::units::{PulseWidth, Ticks};
use frame::wire::{Decoder, Encoder, MAX_WIRE};
use hal_sim::emulated::{Machine, Outcome, Pins, Port, World, firmware, run};
use object::{Object, ObjectSegment, ObjectSymbol};
use std::path::Path;

const MS: u64 = 1_000_000;
/// Registers, RM0090 section 2.3 table 1 with the offsets of 7.3.1, 18.4.7, 18.4.8 and 21.4.1.
const RCC_CR: u64 = 0x4002_3800;
const IWDG_KR: u64 = 0x4000_3000;
const TIM2_CCMR: [u64; 2] = [0x4000_0018, 0x4000_001c];
const TIM1_CCMR1: u64 = 0x4001_0018;

/// Keeps what is written in the first milliseconds, and says what it was given, one command every 5 ms.
#[derive(Default)]
struct Witness {
    written: Vec<(u64, u64)>,
    to_say: Vec<Vec<u8>>,
    ms: u64,
}

impl World for Witness {
    fn wake(&mut self, _: u64, pins: &mut Pins<'_>) -> u64 {
        if self.ms == 0 {
            pins.drive(Port::B, 12, false); // the stop loop, closed
            [1427.0, 2048.0, 248.0, 2380.0, 900.0].iter().zip(10..).for_each(|(code, input)| pins.set_adc(input, *code));
        }
        if self.ms > 50
            && self.ms.is_multiple_of(5)
            && let Some(bytes) = self.to_say.pop()
        {
            pins.say(&bytes);
        }
        self.ms += 1;
        self.ms * MS
    }

    fn accessed(&mut self, written: Option<(u64, u64)>, _: &mut Pins<'_>) {
        self.written.extend(written);
    }

    fn watches(&self) -> bool {
        self.ms < 20 && self.to_say.is_empty()
    }
}

fn start(elf: &Path, to_say: Vec<Vec<u8>>, milliseconds: u64) -> Outcome<Witness> {
    let machine = Machine::new().unwrap_or_else(|e| panic!("{e}"));
    let witness = Witness { to_say, ..Witness::default() };
    run(elf, machine, witness, milliseconds * MS).unwrap_or_else(|e| panic!("{e}")).0
}

#[test]
fn the_watchdog_runs_before_the_crystal_is_waited_for() {
    let image = firmware("firmware-rig").unwrap_or_else(|e| panic!("{e}"));
    let written = start(&image, Vec::new(), 30).world.written;
    let first = |wanted: &dyn Fn(u64, u64) -> bool| written.iter().position(|(address, value)| wanted(*address, *value));
    let watchdog = first(&|address, value| address == IWDG_KR && value == 0xcccc).expect("it is started");
    let crystal = first(&|address, value| address == RCC_CR && value >> 16 & 1 != 0).expect("HSEON");
    assert!(watchdog < crystal, "write {watchdog} starts the watchdog, write {crystal} the crystal");
}

/// IC1F and its like, 0b0011: eight samples of the timer's clock; longer filters divide the clock first (RM0090 section 18.4.7).
#[test]
fn every_capture_input_has_the_digital_filter() {
    let image = firmware("firmware-rig").unwrap_or_else(|e| panic!("{e}"));
    let written = start(&image, Vec::new(), 30).world.written;
    let last = |register: u64| written.iter().rev().find(|(address, _)| *address == register).map(|(_, value)| *value);
    for register in TIM2_CCMR {
        let value = last(register).expect("the inputs are set up");
        assert_eq!((value >> 4 & 0xf, value >> 12 & 0xf), (3, 3), "{register:#x}: {value:#x}");
    }
    assert_eq!(last(TIM1_CCMR1).expect("the index input is set up") >> 4 & 0xf, 3);
}

/// The image as a probe leaves it that asked to lose nothing and was then unplugged: flags of the log's channel in the content that RAM
/// is filled with at the start. SEGGER's control block: 24 bytes, then name, buffer, size, write, read, flags.
fn with_a_probe_gone(elf: &Path) -> Vec<u8> {
    const FLAGS: u64 = 24 + 5 * 4;
    const BLOCK_IF_FULL: u32 = 2;
    let mut bytes = std::fs::read(elf).expect("the image");
    let place = {
        let file = object::File::parse(&*bytes).expect("an ELF file");
        let block = file.symbols().find(|s| s.name() == Ok("_SEGGER_RTT")).expect("a log").address();
        let segment = file.segments().find(|s| (s.address()..s.address() + s.size()).contains(&block)).expect("its memory");
        let (offset, size) = segment.file_range();
        let inside = block + FLAGS - segment.address();
        assert!(inside + 4 <= size, "initialised");
        usize::try_from(offset + inside).expect("a place")
    };
    let flags = u32::from_le_bytes(bytes[place..place + 4].try_into().expect("four bytes"));
    assert_eq!(flags, 1, "trims by itself");
    bytes[place..place + 4].copy_from_slice(&BLOCK_IF_FULL.to_le_bytes());
    bytes
}

#[test]
fn a_log_that_nobody_reads_holds_nothing_up() {
    const COMMANDS: u64 = 300;
    let image = firmware("firmware-rig").unwrap_or_else(|e| panic!("{e}"));
    let folder = tempfile::tempdir().expect("a folder");
    let patched = folder.path().join("firmware-rig");
    std::fs::write(&patched, with_a_probe_gone(&image)).expect("it is written");
    let mut encoder = Encoder::default();
    let mut said: Vec<Vec<u8>> = (0..COMMANDS)
        .map(|n| {
            let mut bytes = [0; MAX_WIRE];
            let refused = Command::SetPulse(PulseWidth::from_us(1500));
            let used = encoder.encode(Ticks::from_ms(n), &refused, &mut bytes).expect("it fits");
            bytes[..used].to_vec()
        })
        .collect();
    said.reverse();
    let outcome = start(&patched, said, 100 + 5 * COMMANDS);
    assert!(outcome.accesses.resets.is_empty(), "the log held the board up: {:?}", outcome.accesses.resets);
    let mut decoder = Decoder::default();
    let told = outcome.telemetry.iter().filter_map(|b| decoder.push::<Message>(*b)).map(|r| r.message);
    let refused = told.filter(|m| matches!(m, Message::Event(Event::Refused(_)))).count() as u64;
    // each is some ten bytes in the log, whose buffer holds a thousand
    assert_eq!(refused, COMMANDS, "every command was answered, and logged");
}
