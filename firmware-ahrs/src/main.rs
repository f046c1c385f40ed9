//! The flash image of the IMU board. On the host this is an empty program: build the image with `cargo xtask image`.
//!
//! What it is: the RTIC application: set-up, the 200 Hz sampling task, the serial interrupt, and the idle loop, which fits and
//! stores. Pins and peripherals are listed in `board/mod.rs`; everything that decides something is in the library.
//!
//! What can go wrong: a panic, a fault or a failing crystal resets the board, which tells it then; a stalled task lets the watchdog
//! reset it.
//!
//! Units: as in the library.
//!
//! Reference: specification `ahrs.md`, "Board".
#![cfg_attr(target_os = "none", no_std, no_main)]
#![deny(unsafe_code)]
#![cfg_attr(target_os = "none", deny(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing))]

#[cfg(target_os = "none")]
mod board;

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("this is a firmware image: build it with `cargo xtask image`");
}

/// The last resort: the board drives nothing that could hurt, so it only keeps the place and resets.
#[cfg(target_os = "none")]
mod last_resort {
    use frame::message::CrashCause;

    safe_start::last_resort!(nothing, nothing);

    fn nothing(_: Option<CrashCause>) {}
}

#[cfg(target_os = "none")]
#[rtic::app(device = stm32f4xx_hal::pac, peripherals = true)]
mod app {
    use super::board::{BAUD, CORE_HZ, INCOMING, OUTGOING, bus::Bus, clock::Clock};
    use core::sync::atomic::{AtomicBool, Ordering};
    use cortex_m::peripheral::DWT;
    use defmt_rtt as _;
    use firmware_ahrs::console::Asked;
    use firmware_ahrs::{Ahrs, AhrsConfig, CommandLine, Console, Done, Inputs, Job, Sampler, TICK_HZ, text};
    use frame::wire::{Encoder, MAX_WIRE};
    use frame::{Event, ImuFormat, Message};
    use heapless::spsc::{Consumer, Producer, Queue};
    use safe_start::stm32f4::{clock, crash};
    use settings_store::stm32f4::{RANGE, SettingsFlash};
    use stm32f4xx_hal::{
        ClearFlags, Listen,
        i2c::I2c,
        pac::{Interrupt, TIM4, USART1},
        prelude::*,
        rcc::Config,
        serial::{Rx, Serial, Tx, config::Config as Line},
        timer::{CounterHz, Event as TimerEvent, Flag},
        watchdog::IndependentWatchdog,
    };

    /// The sending half of the link: numbers frames and queues their bytes whole or not at all.
    pub struct Link {
        encoder: Encoder,
        bytes: Producer<'static, u8>,
        /// What went before is no whole frame (text, or one that a reset cut short): a zero ends it for the receiver.
        ragged: bool,
    }

    impl Link {
        fn send(&mut self, at: frame::Ticks, format: ImuFormat, message: &Message) {
            match format {
                ImuFormat::Binary => {
                    if core::mem::take(&mut self.ragged) {
                        self.queue(&[0]);
                    }
                    let mut out = [0; MAX_WIRE];
                    if let Ok(used) = self.encoder.encode(at, message, &mut out) {
                        self.queue(out.get(..used).unwrap_or(&[]));
                    }
                }
                ImuFormat::Text => {
                    self.ragged = true;
                    if let Some(line) = text::line(message) {
                        self.queue(line.as_bytes());
                    }
                }
            }
        }

        fn queue(&mut self, bytes: &[u8]) {
            if self.bytes.capacity() - self.bytes.len() < bytes.len() {
                return; // the receiver sees the gap in the sequence
            }
            for byte in bytes {
                let _ = self.bytes.enqueue(*byte);
            }
            rtic::pend(Interrupt::USART1);
        }
    }

    /// Work waits for the idle loop.
    static WORK: AtomicBool = AtomicBool::new(false);

    #[shared]
    struct Shared {
        job: Option<Job>,
        done: Option<Done>,
    }

    #[local]
    struct Local {
        console: Console,
        sampler: Sampler<Bus>,
        clock: Clock,
        link: Link,
        commands: Consumer<'static, u8>,
        line: CommandLine,
        cycles: u32,
        flash: SettingsFlash,
        tick: CounterHz<TIM4>,
        watchdog: IndependentWatchdog,
        tx: Tx<USART1>,
        rx: Rx<USART1>,
        outgoing: Consumer<'static, u8>,
        incoming: Producer<'static, u8>,
    }

    #[init(local = [out: Queue<u8, OUTGOING> = Queue::new(), inn: Queue<u8, INCOMING> = Queue::new()])]
    fn init(mut ctx: init::Context) -> (Shared, Local) {
        let mut watchdog = IndependentWatchdog::new(ctx.device.IWDG);
        watchdog.start(100.millis());
        let reset_cause = (ctx.device.RCC.csr().read().bits() >> 24) as u8;
        ctx.device.RCC.csr().modify(|_, w| w.rmvf().set_bit());
        ctx.core.DCB.enable_trace();
        ctx.core.DWT.enable_cycle_counter();

        let clock_news = clock::start_crystal(&ctx.device.RCC, &ctx.device.TIM11, || watchdog.feed());
        let source = match clock_news.crystal_hz {
            0 => Config::hsi(),
            hz => Config::hse(hz.Hz()),
        };
        let mut rcc = ctx.device.RCC.freeze(source.sysclk(CORE_HZ.Hz()));
        let gpioa = ctx.device.GPIOA.split(&mut rcc);
        let gpiob = ctx.device.GPIOB.split(&mut rcc);
        let mut time = Clock::new(ctx.device.TIM2, &mut rcc);

        let Some(bus) = Bus::new(I2c::new(ctx.device.I2C1, (gpiob.pb6, gpiob.pb7), 400.kHz(), &mut rcc)) else {
            cortex_m::peripheral::SCB::sys_reset() // these are the pins it takes: cannot happen
        };
        let sampler = Sampler::new(bus);
        let hello = Ahrs::hello(CORE_HZ, reset_cause, sampler.alive());
        defmt::info!("boot: {}", hello);
        let mut flash = SettingsFlash(ctx.device.FLASH);
        let (found, news) = settings_store::load(&mut flash, RANGE);
        let console = Console::new(AhrsConfig::default(), hello, found);

        let line = Line::default().baudrate(BAUD.bps());
        let serial: Serial<USART1> = match Serial::new(ctx.device.USART1, (gpioa.pa9, gpioa.pa10), line, &mut rcc) {
            Ok(serial) => serial,
            Err(_) => cortex_m::peripheral::SCB::sys_reset(), // the rate does not divide: cannot happen with the constants above
        };
        let (tx, mut rx) = serial.split();
        rx.listen();
        let (producer, outgoing) = ctx.local.out.split();
        let (incoming, commands) = ctx.local.inn.split();
        let mut link = Link { encoder: Encoder::default(), bytes: producer, ragged: true };
        let now = time.now();
        console.greet(news, &mut |format, message| link.send(now, format, message));
        console.announce(Event::Clock(clock_news), &mut |format, message| link.send(now, format, message));
        if let Some(ended) = crash::take() {
            console.announce(ended, &mut |format, message| link.send(now, format, message));
        }

        let mut tick = ctx.device.TIM4.counter_hz(&mut rcc);
        if tick.start(TICK_HZ.Hz()).is_err() {
            cortex_m::peripheral::SCB::sys_reset(); // as above
        }
        tick.listen(TimerEvent::Update);

        let (line, cycles) = (CommandLine::new(), 0);
        let local = Local {
            console,
            sampler,
            clock: time,
            link,
            commands,
            line,
            cycles,
            flash,
            tick,
            watchdog,
            tx,
            rx,
            outgoing,
            incoming,
        };
        (Shared { job: None, done: None }, local)
    }

    /// Fits and stores, while the tick goes on.
    #[idle(shared = [job, done], local = [flash])]
    fn idle(mut ctx: idle::Context) -> ! {
        loop {
            cortex_m::asm::wfi();
            if WORK.swap(false, Ordering::Acquire)
                && let Some(job) = ctx.shared.job.lock(Option::take)
            {
                let outcome = job.run(ctx.local.flash, RANGE);
                ctx.shared.done.lock(|done| *done = Some(outcome));
            }
        }
    }

    /// Reads the sensors, runs the board's tick, sends what it says, feeds the watchdog.
    #[task(binds = TIM4, priority = 1, shared = [job, done], local = [console, sampler, clock, link, commands, line, cycles, tick, watchdog])]
    fn sample(mut ctx: sample::Context) {
        let begun = DWT::cycle_count();
        let sample::LocalResources { console, sampler, clock, link, commands, line, cycles, tick, watchdog, .. } = ctx.local;
        tick.clear_flags(Flag::Update);
        crash::look_at_clock();
        let now = clock.now();
        let readings = sampler.read();
        while let Some(byte) = commands.dequeue() {
            line.take(byte);
        }
        let done = ctx.shared.done.lock(Option::take);
        let asked = Asked { heard: line.next_heard(), done, damaged: line.damaged(), cycles: *cycles };
        let job = console.tick(&Inputs { now, readings }, &asked, &mut |format, message| link.send(now, format, message));
        if job.is_some() {
            ctx.shared.job.lock(|waiting| *waiting = job);
            WORK.store(true, Ordering::Release);
        }
        watchdog.feed();
        *cycles = DWT::cycle_count().wrapping_sub(begun);
    }

    /// Moves bytes between the line and the queues.
    #[task(binds = USART1, priority = 2, local = [tx, rx, outgoing, incoming])]
    fn serial(ctx: serial::Context) {
        let serial::LocalResources { tx, rx, outgoing, incoming, .. } = ctx.local;
        // asked whether or not a byte waits: an overrun can come without one, and only reading status and then data takes it down
        // (RM0090 section 30.3.3); left up, it would raise this interrupt for ever
        if let Ok(byte) = rx.read() {
            let _ = incoming.enqueue(byte); // a full queue loses the command; its checksum will say so
        }
        if !outgoing.ready() {
            tx.unlisten();
        } else {
            if tx.is_tx_empty()
                && let Some(byte) = outgoing.dequeue()
            {
                let _ = tx.write(byte);
            }
            tx.listen();
        }
    }
}
