//! The flash image of the rig board. On the host this is an empty program: build the image with `cargo xtask image`.
//!
//! What it is: the RTIC application that connects the registers in `board` with `firmware_rig::RigConsole`.
//! What can go wrong: see `board`.
//! Units: ticks of the capture timer.
//! Reference: specification `rig.md`.
#![cfg_attr(target_os = "none", no_std, no_main)]
#![deny(unsafe_code)]

#[cfg(target_os = "none")]
mod board;

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("this is a firmware image: build it with `cargo xtask image`");
}

#[cfg(target_os = "none")]
#[rtic::app(device = stm32f4xx_hal::pac, peripherals = true)]
mod app {
    use crate::board::back_emf;
    use crate::board::captures::{self, Clock, Edges, EncoderB};
    use crate::board::converter::{self, Codes, Converter};
    use crate::board::esc_line;
    use crate::board::health;
    use crate::board::link::Link;
    use crate::board::pulse::PulseOutput;
    use crate::board::supply::SupplyWatch;
    use crate::board::watchdog::{Watchdog, take_reset_cause};
    use core::mem::MaybeUninit;
    use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering};
    use defmt_rtt as _;
    use esc_pwm::EscOutput;
    use firmware_rig::{Beside, Config, Conversions, Delivered, RigConfig, RigConsole, Start, burst};
    use frame::message::{Event, SettingsNews, Trial};
    use frame::units::PulseWidth;
    use safe_start::stm32f4::{clock, crash};
    use settings_store::stm32f4::{self as flash, SettingsFlash};
    use stm32f4xx_hal::gpio::{Input, PB12, Speed};
    use stm32f4xx_hal::pac::{ADC1, DMA1, DMA2, PWR, TIM1, TIM2, TIM3, TIM4, USART1, USART3};
    use stm32f4xx_hal::prelude::*;
    use stm32f4xx_hal::rcc::{self, Enable, Reset};

    /// Milliseconds since reset, for the log's time stamps.
    static MILLIS: AtomicU32 = AtomicU32::new(0);
    defmt::timestamp!("{=u32:ms}", MILLIS.load(Ordering::Relaxed));

    /// Trial of the last resort that the idle loop is to make: 0 none, 1 panic, 2 hang, 3 late tick.
    static TRIAL: AtomicU8 = AtomicU8::new(0);
    /// Core cycles of the late tick's trial: 8 ms at 168 MHz.
    const LATE_CYCLES: u32 = 8 * 168_000;
    /// An event waits to be logged.
    static LOG: AtomicBool = AtomicBool::new(false);
    /// RigConfig wait to be stored.
    static STORE: AtomicBool = AtomicBool::new(false);

    #[shared]
    struct Shared {
        capture_timer: TIM2,
        /// The encoder's index, and the back-EMF meter.
        cross_timer: TIM1,
        esc_port: USART3,
        to_store: Option<RigConfig>,
        stored: Option<SettingsNews>,
        /// The latest event, for the log: the idle loop writes it, never the tick.
        to_log: Option<Event>,
    }

    #[local]
    struct Local {
        edges: Edges,
        clock: Clock,
        converter: Converter,
        link: Link,
        dma: DMA2,
        pulse: PulseOutput,
        stop: PB12<Input>,
        tick_timer: TIM4,
        watchdog: Watchdog,
        /// In memory of its own: moved about, it would lie on the stack several times over.
        console: &'static mut RigConsole,
        encoder_b: EncoderB,
        supply: SupplyWatch,
        flash: SettingsFlash,
        index_marks: u16,
        words: esc_line::Words,
        turns: back_emf::Edges,
        sampling: u16,
        codes: Codes,
        burst: &'static mut [u16; burst::LENGTH],
    }

    #[init(local = [
        memory: MaybeUninit<RigConsole> = MaybeUninit::uninit(),
        // core-coupled, which nothing else uses: whatever stands in it after power-up is overwritten before it is read
        #[allow(unsafe_code)]
        #[unsafe(link_section = ".ccmram")]
        recorded: [u16; burst::LENGTH] = [0; burst::LENGTH]
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        let mut core = cx.core;
        core.DCB.enable_trace();
        core.DWT.enable_cycle_counter();
        let device = cx.device;
        let reset_cause = take_reset_cause(&device.RCC);
        // before anything that may wait: a crystal that does not start must not hold the board up
        let mut watchdog = Watchdog::start(device.IWDG);
        let clock_news = clock::start_crystal(&device.RCC, &device.TIM11, || watchdog.feed());
        let source = match clock_news.crystal_hz {
            0 => rcc::Config::hsi(),
            hz => rcc::Config::hse(hz.Hz()),
        };
        let mut rcc = device.RCC.freeze(source.sysclk(168.MHz()));
        watchdog.feed();
        PWR::enable(&mut rcc);
        TIM1::enable(&mut rcc);
        TIM1::reset(&mut rcc);
        TIM2::enable(&mut rcc);
        TIM2::reset(&mut rcc);
        TIM3::enable(&mut rcc);
        TIM3::reset(&mut rcc);
        TIM4::enable(&mut rcc);
        TIM4::reset(&mut rcc);
        ADC1::enable(&mut rcc);
        DMA1::enable(&mut rcc);
        DMA1::reset(&mut rcc);
        DMA2::enable(&mut rcc);
        DMA2::reset(&mut rcc);
        USART1::enable(&mut rcc);
        USART1::reset(&mut rcc);
        USART3::enable(&mut rcc);
        USART3::reset(&mut rcc);

        let a = device.GPIOA.split(&mut rcc);
        let b = device.GPIOB.split(&mut rcc);
        let c = device.GPIOC.split(&mut rcc);
        let mut flash = SettingsFlash(device.FLASH);
        let (stored, news): (Option<RigConfig>, _) = settings_store::load(&mut flash, flash::RANGE);
        let output = stored.as_ref().map_or(EscOutput::Pwm, |config| config.output);
        let pulse = PulseOutput::start(device.TIM3, device.DMA1, output);
        let _ = a.pa6.into_alternate::<2>().speed(Speed::Medium); // edges of 20 ns at the most: a bit of DShot600 lasts 1667
        // an open input reads high: no edges, and an open-collector sensor needs nothing more
        let _ = (a.pa0.into_alternate::<1>().internal_pull_up(true), a.pa1.into_alternate::<1>().internal_pull_up(true));
        let _ = (a.pa2.into_alternate::<1>().internal_pull_up(true), a.pa3.into_alternate::<1>().internal_pull_up(true));
        let encoder_b = a.pa7.into_pull_down_input();
        let _ = a.pa8.into_alternate::<1>().internal_pull_up(true);
        let _ = (a.pa9.into_alternate::<7>(), a.pa10.into_alternate::<7>().internal_pull_up(true));
        let _ = (a.pa11.into_alternate::<1>().internal_pull_up(true), b.pb11.into_alternate::<7>().internal_pull_up(true));
        let _ = (c.pc0.into_analog(), c.pc1.into_analog(), c.pc2.into_analog(), c.pc3.into_analog(), c.pc4.into_analog());
        let stop = b.pb12.into_pull_up_input(); // closed to ground while the rig may run: a broken wire reads as a stop

        let dma = device.DMA2;
        back_emf::start(&device.TIM1);
        esc_line::start(&device.USART3);
        let mut clock = Clock::default();
        let now = clock.now(device.TIM2.cnt().read().bits());
        let start = Start { reset_cause, clock: clock_news, stored, news, ended: crash::take() };
        let console = cx.local.memory.write(RigConsole::start(now, Config::thesis_570kv(), &start));
        captures::start(&device.TIM2, console.rig().fitted());
        let sampling = console.rig().config().sampling_cycles();
        let converter = Converter::start(device.ADC1, &device.ADC_COMMON, &dma, sampling);
        let link = Link::start(device.USART1, &dma);
        defmt::info!("rig board, reset cause {=u8:#x}, {}", reset_cause, clock_news);

        let tick_timer = device.TIM4;
        tick_timer.psc().write(|w| w.psc().set(83));
        tick_timer.arr().write(|w| w.arr().set(499));
        tick_timer.egr().write(|w| w.ug().set_bit());
        tick_timer.sr().write(|w| w.uif().clear());
        tick_timer.dier().write(|w| w.uie().set_bit());
        tick_timer.cr1().write(|w| w.cen().set_bit());
        watchdog.feed();

        let local = Local {
            edges: Edges::default(),
            clock,
            converter,
            link,
            dma,
            pulse,
            stop,
            tick_timer,
            watchdog,
            console,
            encoder_b,
            supply: SupplyWatch::start(device.PWR),
            flash,
            index_marks: 0,
            words: esc_line::Words::new(),
            turns: back_emf::Edges::new(),
            sampling,
            codes: Codes::new(),
            burst: cx.local.recorded,
        };
        let shared = Shared {
            capture_timer: device.TIM2,
            cross_timer: device.TIM1,
            esc_port: device.USART3,
            to_store: None,
            stored: None,
            to_log: None,
        };
        (shared, local)
    }

    /// Everything that may take its time.
    #[idle(shared = [to_store, stored, to_log], local = [flash])]
    fn idle(mut cx: idle::Context) -> ! {
        let mut second = u32::MAX;
        loop {
            cortex_m::asm::wfi();
            match TRIAL.load(Ordering::Relaxed) {
                0 => {}
                1 => panic!("the self-test asked for it"),
                3 => {
                    TRIAL.store(0, Ordering::Relaxed);
                    cortex_m::interrupt::free(|_| cortex_m::asm::delay(LATE_CYCLES));
                }
                _ => cortex_m::interrupt::free(|_| {
                    loop {
                        cortex_m::asm::nop();
                    }
                }),
            }
            let event = if LOG.swap(false, Ordering::Acquire) { cx.shared.to_log.lock(Option::take) } else { None };
            match event {
                Some(Event::State { from, to, .. }) => defmt::info!("{} -> {}: {=str}", from, to, esc_pwm::arming::message(to)),
                Some(event) => defmt::info!("{}", event),
                None => {}
            }
            let now = MILLIS.load(Ordering::Relaxed) / 1000;
            if now != second {
                second = now;
                health::measure_stack();
            }
            if STORE.swap(false, Ordering::Acquire)
                && let Some(settings) = cx.shared.to_store.lock(Option::take)
            {
                let news = settings_store::save(cx.local.flash, flash::RANGE, &settings);
                cx.shared.stored.lock(|stored| *stored = Some(news));
            }
        }
    }

    #[task(binds = TIM2, priority = 3, shared = [capture_timer], local = [encoder_b])]
    fn capture(mut cx: capture::Context) {
        let start = health::cycles();
        let encoder_b = cx.local.encoder_b;
        cx.shared.capture_timer.lock(|timer| captures::serve(timer, encoder_b));
        health::capture_took(start);
    }

    /// An electrical turn of the motor. Of one priority with the captures: neither comes between what the other reads.
    #[task(binds = TIM1_CC, priority = 3, shared = [capture_timer, cross_timer])]
    fn turn(cx: turn::Context) {
        (cx.shared.cross_timer, cx.shared.capture_timer).lock(|timer, clock| back_emf::serve(timer, clock));
    }

    /// A byte of the ESC's telemetry.
    #[task(binds = USART3, priority = 3, shared = [esc_port])]
    fn esc_byte(mut cx: esc_byte::Context) {
        cx.shared.esc_port.lock(|port| esc_line::serve(port));
    }

    #[task(binds = TIM4, priority = 2, shared = [capture_timer, cross_timer, esc_port, to_store, stored, to_log], local = [
        edges, clock, converter, link, dma, pulse, stop, tick_timer, watchdog, console, index_marks, supply, sampling, codes,
        burst, words, turns
    ])]
    fn tick(mut cx: tick::Context) {
        let start = health::cycles();
        let board = cx.local;
        board.tick_timer.sr().write(|w| w.uif().clear());
        // the tick's own time comes before the host's bytes, of which a whole frame takes 35 us to read
        let taken = if board.console.tick_is_next() {
            let (over_capture, turns_lost) = (captures::drain(board.edges), back_emf::drain(board.turns));
            let fitted = board.console.rig().fitted();
            let counter = cx.shared.capture_timer.lock(|timer| {
                captures::arm(timer, fitted);
                timer.cnt().read().bits()
            });
            Some((over_capture, turns_lost, counter))
        } else {
            None
        };
        // a stop acts here already; the rig latches it in its next tick and gives minimum from then on
        board.link.listen(board.dma, board.console);
        let half = board.console.look(board.stop.is_high());
        if half.minimum {
            board.pulse.set(PulseWidth::MIN, false);
        }
        let (Some((over_capture, turns_lost, counter)), true) = (taken, half.tick) else { return };
        crash::look_at_clock();
        esc_line::drain(board.words);
        let now = board.clock.now(counter);
        MILLIS.store(now.as_ms() as u32, Ordering::Relaxed);
        let config = board.console.rig().config();
        let (telemetry, meter) = (config.esc_telemetry.is_some(), config.back_emf > 0);
        let index = cx.shared.cross_timer.lock(|timer| {
            back_emf::arm(timer, meter);
            captures::index(timer)
        });
        *board.index_marks = board.index_marks.wrapping_add(u16::from(index));
        cx.shared.esc_port.lock(|port| esc_line::arm(port, telemetry));
        let (adc, whole) = board.converter.drain(board.dma, board.console.wanted(), board.codes);
        let delivered = Delivered {
            now,
            edges: board.edges.each_ref().map(|edges| edges.as_slice()),
            over_capture,
            adc: &adc,
            beside: Beside { esc: board.words, back_emf: board.turns, over_capture: turns_lost },
            brown_out: board.supply.is_low(),
            paused: flash::PAUSED.swap(false, Ordering::Acquire),
            stored: cx.shared.stored.lock(Option::take),
            vitals: Some(health::vitals(*board.index_marks)),
        };
        let orders = board.console.tick(&delivered, |pulse, ask| board.pulse.set(pulse, ask));
        board.watchdog.feed();
        // a tick that came too late is no time to begin a train of frames
        let on_time = board.tick_timer.sr().read().uif().bit_is_clear();
        if on_time {
            let since_us = board.tick_timer.cnt().read().cnt().bits();
            board.pulse.select(board.console.rig().config().output, board.console.rig().is_live(), since_us);
        }
        let conversions =
            Conversions { codes: whole.then_some(board.codes.as_slice()), rate_hz: converter::rate_hz(*board.sampling) };
        board.console.record(now, &conversions, board.burst.as_mut_slice());
        if let Some(trial) = orders.trial {
            let number = match trial {
                Trial::Panic => 1,
                Trial::Hang => 2,
                Trial::Late => 3,
            };
            TRIAL.store(number, Ordering::Relaxed);
        }
        if orders.store {
            let settings = board.console.rig().settings();
            cx.shared.to_store.lock(|wanted| *wanted = Some(settings));
            STORE.store(true, Ordering::Release);
        }
        if let Some(event) = orders.event {
            cx.shared.to_log.lock(|waiting| *waiting = Some(event));
            LOG.store(true, Ordering::Release);
        }
        let sampling = board.console.rig().config().sampling_cycles();
        if sampling != *board.sampling {
            *board.sampling = sampling;
            board.converter.set_sampling(sampling);
        }
        board.link.flush(board.dma, board.console);
        health::tick_took(start);
    }
}
