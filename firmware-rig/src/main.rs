//! The flash image of the rig board. On the host this is an empty program: build the image with `cargo xtask image`.
//!
//! What it is: the RTIC application that connects the registers in `board` with `firmware_rig::Rig::tick`.
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
    use crate::board::captures::{self, Clock, Edges};
    use crate::board::converter::Converter;
    use crate::board::link::Link;
    use crate::board::pulse::PulseOutput;
    use crate::board::watchdog::{Watchdog, take_reset_cause};
    use core::sync::atomic::{AtomicU32, Ordering};
    use defmt_rtt as _;
    use firmware_rig::{Config, Inputs, Rig};
    use frame::calibration::Calibration;
    use frame::message::{Command, Event, Message};
    use stm32f4xx_hal::gpio::{Input, PB12};
    use stm32f4xx_hal::pac::{ADC1, DMA2, TIM2, TIM3, TIM4, USART1};
    use stm32f4xx_hal::prelude::*;
    use stm32f4xx_hal::rcc::{self, Enable, Reset};

    /// Milliseconds since reset, for the log's time stamps.
    static MILLIS: AtomicU32 = AtomicU32::new(0);
    defmt::timestamp!("{=u32:ms}", MILLIS.load(Ordering::Relaxed));

    #[shared]
    struct Shared {
        capture_timer: TIM2,
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
        rig: Rig,
        told: Calibration,
        reset_cause: u8,
    }

    #[init]
    fn init(cx: init::Context) -> (Shared, Local) {
        let device = cx.device;
        let reset_cause = take_reset_cause(&device.RCC);
        let mut rcc = device.RCC.freeze(rcc::Config::hse(8.MHz()).sysclk(168.MHz()));
        TIM2::enable(&mut rcc);
        TIM2::reset(&mut rcc);
        TIM3::enable(&mut rcc);
        TIM3::reset(&mut rcc);
        TIM4::enable(&mut rcc);
        TIM4::reset(&mut rcc);
        ADC1::enable(&mut rcc);
        DMA2::enable(&mut rcc);
        DMA2::reset(&mut rcc);
        USART1::enable(&mut rcc);
        USART1::reset(&mut rcc);

        let a = device.GPIOA.split(&mut rcc);
        let b = device.GPIOB.split(&mut rcc);
        let c = device.GPIOC.split(&mut rcc);
        let pulse = PulseOutput::start(device.TIM3);
        let _ = a.pa6.into_alternate::<2>();
        let _ = (a.pa0.into_alternate::<1>(), a.pa1.into_alternate::<1>());
        let _ = (a.pa2.into_alternate::<1>(), a.pa3.into_alternate::<1>());
        let _ = (a.pa9.into_alternate::<7>(), a.pa10.into_alternate::<7>().internal_pull_up(true));
        let _ = (c.pc0.into_analog(), c.pc1.into_analog(), c.pc2.into_analog(), c.pc3.into_analog(), c.pc4.into_analog());
        let stop = b.pb12.into_pull_up_input();

        captures::start(&device.TIM2);
        let dma = device.DMA2;
        let converter = Converter::start(device.ADC1, &device.ADC_COMMON, &dma);
        let mut link = Link::start(device.USART1, &dma);

        let rig = Rig::new(Config::thesis_570kv());
        let told = rig.calibration();
        let mut clock = Clock::default();
        let now = clock.now(device.TIM2.cnt().read().bits());
        link.send(now, &Message::Hello(rig.hello(reset_cause)));
        link.send(now, &Message::Calibration(told));
        defmt::info!("rig board, reset cause {=u8:#x}", reset_cause);

        let tick_timer = device.TIM4;
        tick_timer.psc().write(|w| w.psc().set(83));
        tick_timer.arr().write(|w| w.arr().set(999));
        tick_timer.egr().write(|w| w.ug().set_bit());
        tick_timer.sr().write(|w| w.uif().clear());
        tick_timer.dier().write(|w| w.uie().set_bit());
        tick_timer.cr1().write(|w| w.cen().set_bit());
        let watchdog = Watchdog::start(device.IWDG);

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
            rig,
            told,
            reset_cause,
        };
        (Shared { capture_timer: device.TIM2 }, local)
    }

    #[idle]
    fn idle(_: idle::Context) -> ! {
        loop {
            cortex_m::asm::wfi();
        }
    }

    #[task(binds = TIM2, priority = 3, shared = [capture_timer])]
    fn capture(mut cx: capture::Context) {
        cx.shared.capture_timer.lock(|timer| captures::serve(timer));
    }

    #[task(binds = TIM4, priority = 2, shared = [capture_timer], local = [
        edges, clock, converter, link, dma, pulse, stop, tick_timer, watchdog, rig, told, reset_cause
    ])]
    fn tick(mut cx: tick::Context) {
        let board = cx.local;
        board.tick_timer.sr().write(|w| w.uif().clear());
        let over_capture = captures::drain(board.edges);
        let counter = cx.shared.capture_timer.lock(|timer| timer.cnt().read().bits());
        let now = board.clock.now(counter);
        MILLIS.store(now.as_ms() as u32, Ordering::Relaxed);
        let (command, line) = board.link.receive(board.dma);
        let inputs = Inputs {
            now,
            edges: board.edges.each_ref().map(|edges| edges.as_slice()),
            over_capture,
            adc: board.converter.drain(board.dma),
            command,
            line,
            stop_input: board.stop.is_low(),
            brown_out: false,
            paused: false,
        };
        let outputs = board.rig.tick(&inputs);
        board.pulse.set(outputs.pulse);
        board.watchdog.feed();

        if let Some(sample) = outputs.sample {
            board.link.send(now, &Message::Rig(sample));
        }
        if let Some(event) = outputs.event {
            if let Event::State { from, to, .. } = event {
                defmt::info!("{} -> {}: {=str}", from, to, esc_pwm::arming::message(to));
            }
            board.link.send(now, &Message::Event(event));
        }
        let calibration = board.rig.calibration();
        let identify = command == Some(Command::Identify);
        if identify {
            board.link.send(now, &Message::Hello(board.rig.hello(*board.reset_cause)));
        }
        if identify || calibration != *board.told {
            *board.told = calibration;
            board.link.send(now, &Message::Calibration(calibration));
        }
        board.link.flush(board.dma);
    }
}
