//! The rig board: STM32F405RG at 168 MHz from a crystal of 8 or 12 MHz. The only place with registers.
//!
//! What it is: one module a peripheral, each a thin layer between registers and the data that [`firmware_rig::Rig::tick`]
//! takes and gives.
//! What can go wrong: a stalled tick lets the watchdog reset the board; a panic, a hard fault or a failing crystal goes to minimum
//! throttle in hardware, keeps its place and resets ([`panic`]). From any reset on until the pulse train starts with its minimum, less
//! than 40 ms later, the chip drives the pulse pin not at all: it floats (RM0090 section 8.3), and an external pull-down of 10 kOhm
//! holds it low. Without that resistor nothing is known of its level (`docs/wiring.md`).
//! Units: raw registers here; ticks of TIM2 (84 MHz) are the board's time.
//! Reference: RM0090 (sections on RCC, TIM2-5, ADC, DMA, USART, IWDG), STM32F405 datasheet table 9 (alternate functions).
//!
//! | function | pin | peripheral | DMA / interrupt |
//! |---|---|---|---|
//! | crystal, 8 or 12 MHz, measured against the internal oscillator before it is used ([`safe_start::crystal`]) | PH0, PH1 | HSE, TIM11 CH1 for the measurement | NMI when it fails |
//! | ESC pulse, 50 Hz, active high, 3 MHz counter (PSC 27, ARR 59 999, CCR1 3000-6000, both preloaded) | PA6, AF2 | TIM3 CH1 | none |
//! | the same as DShot, 1 kHz, active high, 84 MHz counter (PSC 0, ARR 279 or 139 for a bit, CCR1 of the bit, both preloaded; two slots of pause) | PA6, AF2 | TIM3 CH1, update | DMA1 stream 2 channel 5, circular, 16 bit, bursts of 3 from ARR on |
//! | capture: IR beam, rising edge | PA0, AF1 | TIM2 CH1, 84 MHz, 32 bits, filter of 8 samples (95 ns), pull-up | TIM2 interrupt |
//! | capture: reflective opto, rising edge, filter and pull-up as above | PA1, AF1 | TIM2 CH2 | TIM2 interrupt |
//! | capture: hall, rising edge, filter and pull-up as above | PA2, AF1 | TIM2 CH3 | TIM2 interrupt |
//! | capture: encoder A, every fourth rising edge (prescaler 4), filter and pull-up as above | PA3, AF1 | TIM2 CH4 | TIM2 interrupt |
//! | encoder B, its level at the captured edges of A gives the direction, pull-down | PA7 | GPIO, read in the TIM2 interrupt | none |
//! | encoder index N, rising edge, counted, filter and pull-up as above | PA8, AF1 | TIM1 CH1, polled each tick | none |
//! | back-EMF meter, rising edge, one an electrical turn, filter of 8 samples (48 ns), pull-up | PA11, AF1 | TIM1 CH4, 10.5 MHz (PSC 15), its count put on the scale of TIM2 | TIM1_CC interrupt, where it is fitted |
//! | strain (as the four below: 1 MOhm to ground outside, so that an open wire reads 0) | PC0 | ADC1 IN10, first of the scan | DMA2 stream 0 channel 0, circular, 16 bit |
//! | torque | PC1 | ADC1 IN11 | same |
//! | current | PC2 | ADC1 IN12 | same |
//! | supply voltage / 6 | PC3 | ADC1 IN13 | same |
//! | temperature | PC4 | ADC1 IN14, last of the scan | same |
//! | telemetry out, 2 Mbaud 8N1 | PA9, AF7 | USART1 TX | DMA2 stream 7 channel 4 |
//! | commands in | PA10, AF7 | USART1 RX | DMA2 stream 2 channel 4, circular, polled |
//! | ESC telemetry in, 115 200 baud 8N1, pull-up | PB11, AF7 | USART3 RX | USART3 interrupt, a byte each, where it is fitted |
//! | stop loop, normally closed to ground: high (pressed, broken, unplugged) is a stop, pull-up (drive it low in an emulator) | PB12 | GPIO, polled twice a tick | none |
//! | board supply below 2.9 V | - | PVD, polled each tick | none |
//! | settings | flash sectors 10 and 11 | FLASH, from the idle loop | none |
//! | control tick, 1 kHz, and a look at the stop key and the line between two ticks (PSC 83, ARR 499) | - | TIM4 update | TIM4 interrupt |
//! | watchdog, 20 ms at 32 kHz LSI | - | IWDG, fed each tick | reset |
//!
//! ADC clock 21 MHz, 56 + 12 cycles a conversion: 308.8 kconv/s in all, 61.8 kconv/s a channel; 15 + 12 cycles at log rates above
//! 25 Hz: 155.6 kconv/s a channel; reference 3.3 V.
//! Interrupt priorities: TIM2 (captures, budget 400 cycles), TIM1_CC and USART3 above TIM4 (tick, budget 84 000 cycles = half of its period); both
//! budgets stand in `budgets/rig.toml` and are held on the emulated board. Idle is WFI, stores settings and measures the stack. defmt messages go to RTT from
//! the start-up and the idle loop, never from the tick (`cargo xtask image` follows every call), and never wait for a probe.

pub(crate) mod back_emf;
pub(crate) mod captures;
pub(crate) mod converter;
pub(crate) mod esc_line;
pub(crate) mod health;
pub(crate) mod link;
pub(crate) mod panic;
pub(crate) mod pulse;
pub(crate) mod supply;
pub(crate) mod watchdog;
