//! The part, its far ends and the run.
//!
//! What it is: one microcontroller with a crystal and a supply, the far end of its serial line, and the loop that lets a
//! [`World`] act at exact instants.
//! What can go wrong: an access that no model answers is collected in [`Accesses`] instead of ending the run: judge it.
//! Units: ns since power-up.
//! Reference: crate rigless 0.4 (register models section by section of RM0090).

use super::converter::ADC_UNITS;
use super::crystal::Quartz;
use super::flash::ProgrammableFlash;
use super::part::{PULSE_TIMER, Part};
use super::pulse::SeenFrame;
use rigless::{
    chip::{Timeline, uart},
    device::{Device, Level, RegisterFile},
    emulator::{self, AccessKind, Driver, Host, Settled, Start, Stop},
    image::Image,
    machine::{Board, Target, armv7m},
    mcu::{Mcu, Operate},
    session::Session,
    snapshot::Store,
    soc::{
        st::tim::Channel as TimerChannel,
        stm32f427::{
            Stm32f427,
            generated::tim2::Register as TimerRegister,
            peripherals::{
                gpio::{Gpio, Pin},
                tim::{General, Tim},
            },
        },
    },
    time::VirtualNanos,
};
use std::collections::VecDeque;
use std::num::{NonZeroU32, NonZeroU64};
use std::path::{Path, PathBuf};

const CORE_HZ: NonZeroU64 = NonZeroU64::new(168_000_000).unwrap();
/// The part's SysTick reference is the core clock over 8.
const SYSTICK_DIVIDER: NonZeroU32 = NonZeroU32::new(8).unwrap();
/// The crystal of most boards.
const QUARTZ: Quartz = Quartz::Good(8_000_000);
const SUPPLY_MV: u32 = 3300;
/// Reference in the same units, so that a code goes in and comes out unchanged.
const ADC_REFERENCE: u32 = 4095 * ADC_UNITS;

/// Why an image could not be run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EmulatedError {
    /// The ELF file is not there.
    #[error("no image of {package} at {path}: build it with `cargo xtask image` (or set QUADRIG_FW_DIR)")]
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
pub(super) struct FarEnd {
    heard: Vec<u8>,
    pub(super) to_say: VecDeque<u16>,
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
    pub(super) mcu: Part,
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
        let core = armv7m::Core {
            variant: armv7m::Variant::M4,
            clock_hz: CORE_HZ,
            interrupt_lines: NonZeroU32::new(lines).unwrap_or(NonZeroU32::MIN),
            priority_bits: 4,
            refclk_divider: SYSTICK_DIVIDER,
            instructions_per_second: CORE_HZ,
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
        Self::with(QUARTZ)
    }

    /// The same with another crystal.
    ///
    /// # Errors
    /// [`EmulatedError::Emulator`] when the emulator cannot build its part.
    pub fn with(quartz: Quartz) -> Result<Self, EmulatedError> {
        let mut chip = Stm32f427::new().map_err(EmulatedError::emulator)?;
        chip.set_supply(SUPPLY_MV);
        for converter in &mut chip.adc {
            converter.set_reference(ADC_REFERENCE);
        }
        chip.usart[0].attach(FarEnd::default());
        chip.usart[super::cross::ESC_PORT].attach(FarEnd::default());
        Ok(Self { mcu: Part::new(chip, quartz).map_err(EmulatedError::emulator)? })
    }

    /// Fills the settings' flash with what no program has written.
    #[must_use]
    pub fn with_damaged_settings(mut self) -> Self {
        self.mcu.flash.damage();
        self
    }

    /// The part with these bytes in its settings' sectors, as many as they are long.
    #[must_use]
    pub fn with_settings(mut self, sectors: &[u8]) -> Self {
        self.mcu.flash.fill(sectors);
        self
    }

    /// Whether the flash of this emulator can be programmed: `cargo xtask test` builds one that can.
    #[must_use]
    pub fn keeps_settings(&self) -> bool {
        ProgrammableFlash::is_there(self.mcu.bus())
    }

    fn far_end(&mut self) -> Option<&mut FarEnd> {
        self.mcu.chip.usart[0].chip_mut::<FarEnd>()
    }
}

/// A PWM output as it stands on its pin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PulseTrain {
    /// The pin is high now.
    pub high: bool,
    /// Width of the pulses, ns.
    pub width_ns: u64,
    /// Time between them, ns.
    pub period_ns: u64,
}

/// Number of a GPIO port: A is 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Port {
    /// GPIOA.
    A = 0,
    /// GPIOB.
    B = 1,
    /// GPIOC.
    C = 2,
}

/// Place of TIM4 among the part's general-purpose timers.
const TICK_TIMER: usize = 2;

/// A general-purpose timer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GeneralTimer {
    /// TIM2.
    Tim2 = 0,
    /// TIM3.
    Tim3 = 1,
}

/// What a [`World`] may do to the board at one instant.
pub struct Pins<'a> {
    pub(super) machine: &'a mut Machine,
    pub(super) at: VirtualNanos,
    reset: bool,
    fault: bool,
}

/// Addresses of GPIOB. RM0090 section 2.3, table 1.
const PORT_B: std::ops::Range<u64> = 0x4002_0400..0x4002_0800;

pub(super) fn level(high: bool) -> Level {
    if high { Level::High } else { Level::Low }
}

impl Pins<'_> {
    /// Alternate function that a pin is switched to; `None` when it is not, or when there is no such pin.
    pub fn alternate(&mut self, port: Port, pin: u8) -> Option<u8> {
        let (_, registers) = self.machine.mcu.chip.port(port as usize);
        Gpio::function(Pin::new(pin)?, registers)
    }

    /// Drives a pin from outside.
    pub fn drive(&mut self, port: Port, pin: u8, high: bool) {
        if let Some(pin) = Pin::new(pin) {
            self.machine.mcu.chip.drive_port(self.at, port as usize, |gpio, registers, context| {
                gpio.drive(pin, Some(level(high)), registers, context);
            });
        }
    }

    /// Drives a pin from outside no more: its pull decides, or nothing.
    pub fn release(&mut self, port: Port, pin: u8) {
        if let Some(pin) = Pin::new(pin) {
            self.machine.mcu.chip.drive_port(self.at, port as usize, |gpio, registers, context| {
                gpio.drive(pin, None, registers, context);
            });
        }
    }

    /// Drives the input of a timer channel (1 to 4). The emulator does not connect pins and timers: ask [`Pins::alternate`].
    pub fn drive_timer(&mut self, timer: GeneralTimer, channel: u8, high: bool) {
        if let Some(channel) = TimerChannel::new(channel) {
            let Part { chip, pulse, .. } = &mut self.machine.mcu;
            chip.drive_timer(self.at, timer as usize, |own, registers, context| {
                let timer = if timer as usize == PULSE_TIMER { &mut pulse.inner } else { own };
                timer.drive_input(channel, level(high), registers, context);
            });
        }
    }

    /// Takes the interrupt of the control tick (TIM4) away as a stray write would, or gives it back: the control task does not come.
    pub fn hold_tick(&mut self, held: bool) {
        self.machine.mcu.chip.drive_timer(self.at, TICK_TIMER, |timer, registers, context| {
            let enabled = u64::from(!held);
            registers.set(TimerRegister::Dier, enabled); // the bus stores it, then the model looks
            Device::write(timer, TimerRegister::Dier, enabled, registers, context);
        });
    }

    /// A timer with its registers.
    fn timer(&mut self, timer: GeneralTimer) -> (&Tim<General>, &RegisterFile) {
        let Part { chip, pulse, .. } = &mut self.machine.mcu;
        let (own, registers) = chip.timer(timer as usize);
        (if timer as usize == PULSE_TIMER { &pulse.inner } else { own }, registers)
    }

    /// What TIM3 channel 1 carried and has ended since the last call, other than pulses of 1 to 2 ms.
    pub fn frames(&mut self) -> Vec<SeenFrame> {
        self.machine.mcu.pulse.frames(self.at)
    }

    /// What a timer's counter reads now.
    pub fn counter(&mut self, timer: GeneralTimer) -> u32 {
        let at = self.at;
        let (timer, registers) = self.timer(timer);
        Device::peek(timer, TimerRegister::Cnt, registers, at).unwrap_or_default() as u32
    }

    /// Output of a timer channel in PWM mode; `None` while the timer does not drive it.
    pub fn pulses(&mut self, timer: GeneralTimer, channel: u8) -> Option<PulseTrain> {
        let channel = TimerChannel::new(channel)?;
        let (timer, registers) = self.timer(timer);
        let pulse = timer.pulse(channel, registers)?;
        let high = timer.output(channel, registers)? == Level::High;
        Some(PulseTrain { high, width_ns: pulse.width.0, period_ns: pulse.period.0 })
    }

    /// Level on `channel` of ADC1 from now on, counts of 12 bits with their fraction.
    pub fn set_adc(&mut self, channel: u8, counts: f64) {
        self.machine.mcu.adc1.set_level(self.at, channel, counts);
    }

    /// Noise of every single conversion, standard deviation in counts.
    pub fn set_adc_noise(&mut self, counts: f64) {
        self.machine.mcu.adc1.set_noise(self.at, counts);
    }

    /// Lets no conversion end any more, or again.
    pub fn stop_adc(&mut self, stopped: bool) {
        self.machine.mcu.adc1.stop(self.at, stopped);
    }

    /// USART1 shows an overrun without a byte (RM0090 section 30.3.3), until the program reads its status and then its data.
    pub fn overrun_serial(&mut self) {
        self.machine.mcu.stuck.up = true;
    }

    /// The DMA misses a conversion of ADC1: none is fetched until the program recovers.
    pub fn overrun_adc(&mut self) {
        self.machine.mcu.adc1.overrun(self.at);
    }

    /// The board's own supply, mV.
    pub fn set_supply(&mut self, millivolts: u32) {
        self.machine.mcu.chip.set_supply(millivolts);
    }

    /// Lets the supply fail at the `nth` store to the settings' flash from now on: that word stays half programmed, and nothing
    /// reaches the flash afterwards until a reset.
    pub fn fail_at_store(&mut self, nth: u32) {
        let flash = &mut self.machine.mcu.flash;
        flash.fails_at = Some(flash.stores + nth);
    }

    /// The supply has failed in the midst of a store; press the reset key.
    #[must_use]
    pub fn has_failed(&self) -> bool {
        self.machine.mcu.flash.failed
    }

    /// The crystal stops oscillating, for good.
    pub fn fail_crystal(&mut self) {
        let Part { chip, clocks, .. } = &mut self.machine.mcu;
        chip.drive_clocks(self.at, |_, file, context| clocks.fail(file, context));
    }

    /// The next access of the core to GPIOB (the stop key's port) ends in a bus error: a hard fault.
    pub fn fail_access(&mut self) {
        self.fault = true;
    }

    /// Presses the reset key. Levels that were driven from outside are gone afterwards: drive them again.
    pub fn press_reset(&mut self) {
        self.reset = true;
    }

    /// What the settings' sectors hold, and how often something was stored in them.
    #[must_use]
    pub fn settings(&self) -> (&[u8], u32) {
        let flash = &self.machine.mcu.flash;
        (flash.array(), flash.stores)
    }

    /// Electrical level of a pin.
    pub fn level(&mut self, port: Port, pin: u8) -> bool {
        let (gpio, registers) = self.machine.mcu.chip.port(port as usize);
        Pin::new(pin).is_some_and(|pin| gpio.level(pin, registers) == Level::High)
    }

    /// Lets a chip hold I2C1 (SDA low for ever, no start taken), or lets it go. The pin itself is driven apart.
    pub fn hold_i2c(&mut self, held: bool) {
        self.machine.mcu.i2c1.held = held;
    }

    /// Pulls the `nth` chip of I2C1 (in the order of fitting) off the bus, or puts it back; a change waits for the end of an
    /// open transfer. `false` when there is no such chip.
    pub fn unplug(&mut self, nth: usize, unplugged: bool) -> bool {
        self.machine.mcu.i2c1.inner.silence(nth, unplugged)
    }

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
    /// Called at the instant asked for before (first a microsecond after power-up); returns the next instant to be called at.
    fn wake(&mut self, now_ns: u64, pins: &mut Pins<'_>) -> u64;

    /// Called after every register access of the firmware, if [`World::watches`]; `written` is the address of a register and what was written to it.
    fn accessed(&mut self, _written: Option<(u64, u64)>, _pins: &mut Pins<'_>) {}

    /// Whether the world wants to hear of accesses now.
    fn watches(&self) -> bool {
        false
    }

    /// Whether the run ends now, before its time.
    fn is_over(&self) -> bool {
        false
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
}

struct Clockwork<W> {
    world: W,
    end_ns: u64,
}

impl<W: World> Driver<Machine> for Clockwork<W> {
    fn on_settled(&mut self, session: &mut Session<Machine>, _: &mut dyn Host, settled: Settled) {
        if let (true, Settled::Access { access, .. }) = (self.world.watches(), settled) {
            let mut pins = Pins { machine: session.board_mut(), at: access.virtual_time, reset: false, fault: false };
            let written = (access.kind == AccessKind::Write).then_some((access.address, access.value));
            self.world.accessed(written, &mut pins);
        }
    }

    fn on_stop(&mut self, session: &mut Session<Machine>, stop: Stop, host: &mut dyn Host) -> Option<VirtualNanos> {
        let now = stop.at.0;
        if now >= self.end_ns || self.world.is_over() {
            return None;
        }
        let mut pins = Pins { machine: session.board_mut(), at: stop.at, reset: false, fault: false };
        let next = self.world.wake(now, &mut pins);
        let (reset, fault) = (pins.reset, pins.fault);
        if fault {
            session.fail_next(PORT_B.start, PORT_B.end);
        }
        if reset {
            session.reset_by_pin(stop.at, stop.instruction_count, host);
        }
        Some(VirtualNanos(next.clamp(now + 1, self.end_ns)))
    }
}

/// First instant at which the world is asked, ns.
const FIRST_STOP_NS: u64 = 1000;

/// Runs the image at `elf` on `machine` until `end_ns`; gives the board back for the models' own records.
///
/// # Errors
/// [`EmulatedError::Emulator`] when the image cannot be read or the emulator gives up.
pub fn run<W: World + 'static>(
    elf: &Path,
    machine: Machine,
    world: W,
    end_ns: u64,
) -> Result<(Outcome<W>, Machine), EmulatedError> {
    let mut images = vec![Image::read(elf, None).map_err(EmulatedError::emulator)?];
    if let Some((base, bytes)) = machine.mcu.flash.content() {
        images.push(Image::new(Path::new("settings"), bytes, Some(base)).map_err(EmulatedError::emulator)?);
    }
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
    let (now_ns, instructions) = (stop.at.0, stop.instruction_count);
    Ok((Outcome { world: finished.driver.world, telemetry, now_ns, instructions, accesses }, machine))
}
