//! What the ESC hears, on TIM3 channel 1: pulses, or DShot frames.
//!
//! What it is: PWM mode 1 with preloaded compare and period, so a pulse that has begun is never cut or stretched. A frame is a train of
//! slots ([`FrameTimer`]): each update of the timer asks DMA1 stream 2 for the period and the compare value of the slot after the one that
//! begins. The stream goes round in a circle of a millisecond, as long as the control tick and from the same clock. So frames go on without
//! the program, as pulses do; the tick only changes the words in memory.
//! What can go wrong: words that change while they are sent would be a frame of two halves. They change in the long pause alone; frames begin
//! so that every look of the tick falls into it, and a tick that comes at another time waits, 0.23 ms at the most. A stream that has ended, or
//! stands still, is begun anew by the next tick. The form changes while the line is low, at minimum throttle.
//! Units: nanoseconds of pulse in; ticks of 3 MHz (pulses) and of 84 MHz (frames) in the registers.
//! Reference: RM0090 section 18.3.9 (PWM mode), 18.4.13 (compare preload), 18.4.17 and 18.4.18 (DMA burst), 10.3.3 (TIM3_UP is channel 5 of
//! DMA1 stream 2), 10.3.8 (circular mode), 10.3.17 (stream configuration).

use core::sync::atomic::{AtomicU16, Ordering, fence};
use esc_pwm::PulseTimer;
use esc_pwm::dshot::{BITS, EscOutput, Frame, FrameTimer, SLOTS, Slot, Throttle};
use frame::units::PulseWidth;
use stm32f4xx_hal::pac::{DMA1, TIM3};

const CLOCK_HZ: u32 = 84_000_000;

/// Arithmetic of the pulse timer, checked by the compiler.
const TIMER: PulseTimer = match PulseTimer::new(CLOCK_HZ, 16) {
    Ok(timer) => timer,
    Err(_) => core::panic!("84 MHz divides into 20 ms"),
};

/// Compare value of the minimum pulse.
pub(crate) const MINIMUM: u16 = TIMER.ticks(PulseWidth::MIN) as u16;
/// Compare value of the maximum pulse.
pub(crate) const MAXIMUM: u16 = TIMER.ticks(PulseWidth::MAX) as u16;

/// Arithmetic of the frames, checked by the compiler.
const fn frames(bit_hz: u32) -> FrameTimer {
    match FrameTimer::new(CLOCK_HZ, bit_hz) {
        Ok(timer) => timer,
        Err(_) => core::panic!("84 MHz divides into bits"),
    }
}
const FRAMES_300: FrameTimer = frames(300_000);
const FRAMES_600: FrameTimer = frames(600_000);

/// Words of a slot: auto-reload, a register that TIM3 does not have, compare 1 (the timer's words 11 to 13).
const PER_SLOT: usize = 3;
const FIRST_WORD: u8 = 11;
/// Words of the circle: the first is what the timer takes at the end of the long pause.
const LENGTH: usize = SLOTS * PER_SLOT;
/// Read by the DMA.
static WORDS: [AtomicU16; LENGTH] = [const { AtomicU16::new(0) }; LENGTH];
/// Ticks of the high part of a 0, for whoever has nothing but the registers.
static ZERO: AtomicU16 = AtomicU16::new(0);

/// The long pause begins so long before the tick, ticks: 20 us.
const EARLY: u32 = 20 * 84;
/// What is left of the long pause when words may still change, ticks: 24 us, for sixteen stores.
const MARGIN: u16 = 2_000;
/// Longest wait for the long pause, turns of a loop of eight cycles or more: 0.38 ms. What lies between two pauses lasts 0.23 ms.
const PATIENCE: u32 = 8_000;
/// Longest wait for a frame, turns of a loop of four cycles or more: 2.4 ms. Where it lasts too long the watchdog ends it.
const FRAME_PATIENCE: u32 = 100_000;
/// Distance that a change of form keeps from the next pulse, ticks of 3 MHz: 1 ms.
const LOW: u16 = 3_000;

/// The timer is in the long pause, and stays there for long enough: the stream has gone once round.
fn is_open(timer: &TIM3, dma: &DMA1) -> bool {
    let [long, _] = FRAMES_300.pause(); // as long as of the other rate: all that the counter holds
    let left = dma.st(2).ndtr().read().ndt().bits();
    usize::from(left) == LENGTH && timer.cnt().read().cnt().bits() < long.reload() - MARGIN
}

/// Waits for the long pause and writes the high part of each bit; whether the pause came. No capture comes between look and stores.
fn put(timer: &TIM3, dma: &DMA1, highs: &[u16; BITS]) -> bool {
    (0..PATIENCE).any(|_| {
        cortex_m::interrupt::free(|_| {
            let open = is_open(timer, dma);
            if open {
                store(highs);
            }
            open
        })
    })
}

fn store(highs: &[u16; BITS]) {
    for (words, high) in WORDS.chunks_exact(PER_SLOT).zip(highs) {
        if let [_, _, compare] = words {
            compare.store(*high, Ordering::Relaxed);
        }
    }
    fence(Ordering::Release);
}

/// Frames are being sent: the timer asks for its slots.
pub(crate) fn sends_frames(timer: &TIM3) -> bool {
    timer.dier().read().ude().bit_is_set()
}

/// From the next frame on: throttle 0, as far as registers and memory alone can do it.
pub(crate) fn stop_frames(timer: &TIM3, dma: &DMA1) {
    let zeros = [ZERO.load(Ordering::Relaxed); BITS];
    if !put(timer, dma, &zeros) {
        store(&zeros); // the pause does not come: better late than never
    }
}

/// Waits until a whole frame has been sent, for some milliseconds at the most.
pub(crate) fn await_frame(dma: &DMA1) {
    dma.lifcr().write(|w| w.ctcif2().set_bit());
    let _ = (0..FRAME_PATIENCE).any(|_| dma.lisr().read().tcif2().bit_is_set());
}

/// The output.
pub(crate) struct PulseOutput {
    timer: TIM3,
    dma: DMA1,
    /// What the timer does; `None` while the line is held low.
    running: Option<EscOutput>,
}

impl PulseOutput {
    /// Starts the train with a minimum pulse, or holds the line low where frames are wanted: they begin with the first tick. The pin
    /// may be switched to the timer afterwards.
    pub(crate) fn start(timer: TIM3, dma: DMA1, output: EscOutput) -> Self {
        let mut this = Self { timer, dma, running: None };
        this.hold_low();
        if output == EscOutput::Pwm {
            this.begin_pulses(0);
        }
        this
    }

    /// Gives `pulse` from the next period or frame on. A frame asks for telemetry where `ask` says so; a pulse cannot.
    pub(crate) fn set(&mut self, pulse: PulseWidth, ask: bool) {
        match self.running {
            Some(EscOutput::Pwm) => {
                self.timer.ccr1().write(|w| w.ccr().set(TIMER.ticks(pulse) as u16));
            }
            Some(EscOutput::DShot300) => self.send(FRAMES_300, pulse, ask),
            Some(EscOutput::DShot600) => self.send(FRAMES_600, pulse, ask),
            None => {}
        }
    }

    fn send(&mut self, frames: FrameTimer, pulse: PulseWidth, telemetry: bool) {
        let word = Frame { throttle: Throttle::of(pulse), telemetry }.word();
        let highs = core::array::from_fn(|bit| frames.slot(word << bit & 0x8000 != 0).high);
        // a bus error has ended the stream, or it does not come round any more: begin anew, with zero
        if self.dma.st(2).cr().read().en().bit_is_clear() || !put(&self.timer, &self.dma, &highs) {
            self.hold_low();
        }
    }

    /// Changes to another form once the line is low for a while, unless the throttle is open (`live`); call it in each tick with the time
    /// since its beginning in us.
    pub(crate) fn select(&mut self, output: EscOutput, live: bool, since_us: u16) {
        let wait = match self.running {
            Some(running) if running == output || live => return,
            Some(EscOutput::Pwm) => {
                let counter = self.timer.cnt().read().cnt().bits();
                counter <= MAXIMUM || counter >= (TIMER.period() as u16) - LOW
            }
            Some(_) => !is_open(&self.timer, &self.dma),
            None => false,
        };
        if wait {
            return;
        }
        self.hold_low();
        match output {
            EscOutput::Pwm => self.begin_pulses(TIMER.period() as u16 - LOW),
            EscOutput::DShot300 => self.begin_frames(FRAMES_300, output, since_us),
            EscOutput::DShot600 => self.begin_frames(FRAMES_600, output, since_us),
        }
    }

    /// Nothing runs, and the line is low.
    fn hold_low(&mut self) {
        self.timer.ccmr1_output().write(|w| w.oc1m().force_inactive());
        self.timer.ccer().write(|w| w.cc1e().set_bit());
        self.timer.dier().reset();
        self.timer.cr1().reset();
        let stream = self.dma.st(2);
        stream.cr().reset();
        let _ = (0..PATIENCE).any(|_| stream.cr().read().en().bit_is_clear());
        self.running = None;
    }

    /// Sets the period that runs now, low from its beginning to its end, and where in it the counter is.
    fn begin(&mut self, divider: u32, period: u16, counter: u16) {
        self.timer.psc().write(|w| w.psc().set((divider - 1) as u16));
        self.timer.arr().write(|w| w.arr().set(period));
        self.timer.ccr1().write(|w| w.ccr().set(0));
        self.timer.ccmr1_output().write(|w| w.oc1m().force_inactive().oc1pe().enabled());
        self.timer.cr1().write(|w| w.arpe().set_bit());
        self.timer.egr().write(|w| w.ug().set_bit());
        self.timer.ccmr1_output().write(|w| w.oc1m().pwm_mode1().oc1pe().enabled());
        self.timer.cnt().write(|w| w.cnt().set(counter));
    }

    /// Pulses, the first of them the minimum: at once where the counter begins at 0.
    fn begin_pulses(&mut self, counter: u16) {
        self.begin(TIMER.divider(), (TIMER.period() - 1) as u16, counter);
        self.timer.ccr1().write(|w| w.ccr().set(MINIMUM));
        if counter == 0 {
            self.timer.egr().write(|w| w.ug().set_bit());
        }
        self.timer.cr1().write(|w| w.arpe().set_bit().cen().set_bit());
        self.running = Some(EscOutput::Pwm);
    }

    /// Frames of throttle 0, in the long pause before the first.
    fn begin_frames(&mut self, frames: FrameTimer, output: EscOutput, since_us: u16) {
        for (words, slot) in WORDS.chunks_exact(PER_SLOT).zip(frames.slots(Frame::STOP.word())) {
            if let [reload, _, compare] = words {
                reload.store(slot.reload(), Ordering::Relaxed);
                compare.store(slot.high, Ordering::Relaxed);
            }
        }
        ZERO.store(frames.slot(false).high, Ordering::Relaxed);
        fence(Ordering::Release);
        let [long, short]: [Slot; 2] = frames.pause();
        let counter = u32::from(since_us) * 84 + EARLY;
        self.begin(1, long.reload(), counter.min(u32::from(long.reload())) as u16);
        self.timer.arr().write(|w| w.arr().set(short.reload()));
        let stream = self.dma.st(2);
        self.dma
            .lifcr()
            .write(|w| w.ctcif2().set_bit().chtif2().set_bit().cteif2().set_bit().cdmeif2().set_bit().cfeif2().set_bit());
        stream.ndtr().write(|w| w.ndt().set(LENGTH as u16));
        #[allow(unsafe_code)] // the burst register of this timer, and a static buffer of the length given above
        unsafe {
            stream.par().write(|w| w.pa().bits(self.timer.dmar().as_ptr() as u32));
            stream.m0ar().write(|w| w.m0a().bits(WORDS.as_ptr() as u32));
        }
        stream.cr().write(|w| {
            w.chsel().set(5).pl().very_high().msize().bits16().psize().bits16().minc().incremented().circ().enabled();
            w.dir().memory_to_peripheral().en().enabled()
        });
        #[allow(unsafe_code)] // three words from the twelfth on
        self.timer.dcr().write(|w| unsafe { w.dba().bits(FIRST_WORD).dbl().bits(PER_SLOT as u8 - 1) });
        self.timer.dier().write(|w| w.ude().set_bit());
        self.timer.cr1().write(|w| w.arpe().set_bit().cen().set_bit());
        self.running = Some(output);
    }
}
