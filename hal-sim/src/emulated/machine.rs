//! The part, its far ends and the run.
//!
//! What it is: one microcontroller with a crystal and a supply, the far end of its serial line, and the loop that lets a
//! [`World`] act at exact instants.
//! What can go wrong: an access that no model answers is collected in [`Accesses`] instead of ending the run: judge it.
//! Units: ns since power-up.
//! Reference: crate rigless 0.4 (register models section by section of RM0090).

use rigless::{
    chip::{Timeline, uart},
    emulator::{self, Driver, Host, Start, Stop},
    image::Image,
    machine::{Board, Crystal, Target, armv7m},
    mcu::{Mcu, Operate},
    session::Session,
    snapshot::Store,
    soc::stm32f427::Stm32f427,
    time::VirtualNanos,
};
use std::collections::VecDeque;
use std::num::{NonZeroU32, NonZeroU64};
use std::path::{Path, PathBuf};

const CORE_HZ: u64 = 168_000_000;
const CRYSTAL_HZ: u64 = 8_000_000;
const SUPPLY_MV: u32 = 3300;

/// Why an image could not be run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EmulatedError {
    /// The ELF file is not there.
    #[error(
        "no firmware image at {path}: build it with \
         `cargo build -p {package} --release --target thumbv7em-none-eabihf --target-dir target/fw` (or set QUADRIG_FW_DIR)"
    )]
    NoImage {
        /// Where it was expected.
        path: PathBuf,
        /// Package that builds it.
        package: String,
    },
    /// The emulator refused the image or stopped with an error.
    #[error("the emulator stopped: {0}")]
    Emulator(String),
}

impl EmulatedError {
    fn emulator(error: impl std::fmt::Debug) -> Self {
        Self::Emulator(format!("{error:?}"))
    }
}

/// Path of the image of `package`: in `QUADRIG_FW_DIR`, or where the documented command builds it.
///
/// # Errors
/// [`EmulatedError::NoImage`] when there is no such file.
pub fn firmware(package: &str) -> Result<PathBuf, EmulatedError> {
    let dir = std::env::var_os("QUADRIG_FW_DIR")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/fw/thumbv7em-none-eabihf/release"), PathBuf::from);
    let path = dir.join(package);
    if path.is_file() { Ok(path) } else { Err(EmulatedError::NoImage { path, package: package.to_owned() }) }
}

/// Far end of the serial line: keeps what it hears, says what it was given.
#[derive(Debug, Default)]
struct FarEnd {
    heard: Vec<u8>,
    to_say: VecDeque<u16>,
}

impl Store for FarEnd {}

impl uart::Peer for FarEnd {
    fn receive(&mut self, word: u16, _: &mut Timeline<'_, '_>) {
        self.heard.push(word as u8);
    }

    fn transmit(&mut self, _: VirtualNanos) -> Option<u16> {
        self.to_say.pop_front()
    }
}

/// The board before it is switched on.
#[derive(Debug)]
pub struct Machine {
    pub(super) mcu: Stm32f427,
}

impl Store for Machine {}

impl Board for Machine {
    fn name(&self) -> &'static str {
        "quadrig"
    }

    fn target_names(&self) -> Vec<&'static str> {
        vec!["mcu"]
    }

    fn mcu(&mut self, target: usize) -> Option<&mut dyn Mcu> {
        (target == 0).then_some(&mut self.mcu)
    }

    fn targets(&mut self) -> Vec<Target<'_>> {
        let lines = u32::from(Operate::cpu(&self.mcu).interrupt_lines);
        let hz = NonZeroU64::new(CORE_HZ).expect("not zero");
        let core = armv7m::Core {
            variant: armv7m::Variant::M4,
            clock_hz: hz,
            interrupt_lines: NonZeroU32::new(lines).expect("the part has interrupts"),
            priority_bits: 4,
            refclk_divider: NonZeroU32::new(8).expect("not zero"),
            instructions_per_second: hz,
            boot: "flash",
        };
        let windows = rigless::cpu::armv7m::windows(Mcu::bus(&self.mcu));
        let spec = core.spec_with_parts(&windows, armv7m::Fpu::FpV4Sp, armv7m::MpuRegions::Eight);
        vec![Target::new("mcu", &mut self.mcu, spec)]
    }
}

impl Machine {
    /// A part with its 8 MHz crystal, 3.3 V and a listening far end on USART1.
    ///
    /// # Errors
    /// [`EmulatedError::Emulator`] when the emulator cannot build its part.
    pub fn new() -> Result<Self, EmulatedError> {
        let mut mcu = Stm32f427::new().map_err(EmulatedError::emulator)?;
        mcu.rcc.attach_crystals(CRYSTAL_HZ, Crystal::NONE.0);
        mcu.set_supply(SUPPLY_MV);
        mcu.usart[0].attach(FarEnd::default());
        Ok(Self { mcu })
    }

    fn far_end(&mut self) -> Option<&mut FarEnd> {
        self.mcu.usart[0].chip_mut::<FarEnd>()
    }
}

/// What a [`World`] may do to the board at one instant.
pub struct Pins<'a> {
    pub(super) machine: &'a mut Machine,
    pub(super) at: VirtualNanos,
}

impl Pins<'_> {
    /// Bytes that arrived on the serial line so far.
    #[must_use]
    pub fn heard(&mut self) -> &[u8] {
        self.machine.far_end().map_or(&[], |far| &far.heard)
    }

    /// Bytes to send to the board, one after the other from now on.
    pub fn say(&mut self, bytes: &[u8]) {
        if let Some(far) = self.machine.far_end() {
            far.to_say.extend(bytes.iter().map(|b| u16::from(*b)));
        }
    }
}

/// Whatever is outside of the microcontroller.
pub trait World: Send {
    /// Called at the instant asked for before (first at 0 + `FIRST_STOP_NS`); returns the next instant to be called at.
    fn wake(&mut self, now_ns: u64, pins: &mut Pins<'_>) -> u64;
}

/// A world without time: only the buses' own models act.
impl World for () {
    fn wake(&mut self, _: u64, _: &mut Pins<'_>) -> u64 {
        u64::MAX
    }
}

/// Accesses that a correct image does not make, as text for a test's message, and the resets of the run.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Accesses {
    /// Addresses that nothing answers.
    pub unmapped: Vec<String>,
    /// Accesses that the part refuses.
    pub refused: Vec<String>,
    /// Registers that are stored but not modelled, `INSTANCE.REGISTER`.
    pub unimplemented: Vec<String>,
    /// Interrupt or request lines that lead nowhere.
    pub unrouted: Vec<String>,
    /// Causes of resets after the first start.
    pub resets: Vec<String>,
}

impl Accesses {
    /// Nothing but registers of `allowed` was touched outside the models, and nothing reset the board.
    ///
    /// # Errors
    /// One line that names everything else.
    pub fn only(&self, allowed: &[&str]) -> Result<(), String> {
        let strange: Vec<_> = self.unimplemented.iter().filter(|name| !allowed.contains(&name.as_str())).collect();
        let rest = [&self.unmapped, &self.refused, &self.unrouted, &self.resets];
        if strange.is_empty() && rest.iter().all(|list| list.is_empty()) {
            return Ok(());
        }
        Err(format!("unimplemented {strange:?}, unmapped, refused, unrouted, resets {rest:?}"))
    }
}

/// What a run leaves behind.
#[derive(Debug)]
pub struct Outcome<W> {
    /// The world as the run left it.
    pub world: W,
    /// Everything that the board sent on the serial line.
    pub telemetry: Vec<u8>,
    /// Time of the end, ns.
    pub now_ns: u64,
    /// Instructions executed.
    pub instructions: u64,
    /// Accesses that a correct image does not make.
    pub accesses: Accesses,
    /// The board, for the models' own records.
    pub machine: Machine,
}

struct Clockwork<W> {
    world: W,
    end_ns: u64,
}

impl<W: World> Driver<Machine> for Clockwork<W> {
    fn on_stop(&mut self, session: &mut Session<Machine>, stop: Stop, _: &mut dyn Host) -> Option<VirtualNanos> {
        let now = stop.at.0;
        if now >= self.end_ns {
            return None;
        }
        let mut pins = Pins { machine: session.board_mut(), at: stop.at };
        let next = self.world.wake(now, &mut pins);
        Some(VirtualNanos(next.clamp(now + 1, self.end_ns)))
    }
}

/// First instant at which the world is asked, ns.
const FIRST_STOP_NS: u64 = 1000;

/// Runs the image at `elf` on `machine` until `end_ns`.
///
/// # Errors
/// [`EmulatedError::Emulator`] when the image cannot be read or the emulator gives up.
pub fn run<W: World + 'static>(elf: &Path, machine: Machine, world: W, end_ns: u64) -> Result<Outcome<W>, EmulatedError> {
    let images = [Image::read(elf, None).map_err(EmulatedError::emulator)?];
    let session = Session::new(Box::new(machine), 0, VirtualNanos(FIRST_STOP_NS)).map_err(EmulatedError::emulator)?;
    let finished = emulator::run(session, &Start::new(&images), Clockwork { world, end_ns }).map_err(EmulatedError::emulator)?;
    let stop = finished.stop.ok_or_else(|| EmulatedError::Emulator("the run ended before its time".to_owned()))?;
    let mut session = finished.session;
    let accesses = Accesses {
        unmapped: session.unmapped().iter().map(ToString::to_string).collect(),
        refused: session.refused().iter().map(|(at, fault)| format!("{at:#010x} {fault:?}")).collect(),
        unimplemented: session.unimplemented().values().map(|u| format!("{}.{}", u.instance, u.register)).collect(),
        unrouted: session.unrouted().iter().map(|u| format!("{u:?}")).collect(),
        resets: session.resets().iter().map(|r| format!("{r:?}")).collect(),
    };
    let telemetry = session.board_mut().far_end().map(|far| std::mem::take(&mut far.heard)).unwrap_or_default();
    let machine = std::mem::replace(session.board_mut(), Machine::new()?);
    Ok(Outcome {
        world: finished.driver.world,
        telemetry,
        now_ns: stop.at.0,
        instructions: stop.instruction_count,
        accesses,
        machine,
    })
}
