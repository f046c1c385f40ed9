//! The rig board: STM32F405RG at 168 MHz from an 8 MHz crystal. The only place with registers.
//!
//! What it is: one module a peripheral, each a thin layer between registers and the data that [`firmware_rig::Rig::tick`]
//! takes and gives.
//! What can go wrong: a stalled tick lets the watchdog reset the board; a panic goes to minimum pulse and resets. After any
//! reset the pulse pin is low until the pulse train starts with its minimum, less than 40 ms later.
//! Units: raw registers here; ticks of TIM2 (84 MHz) are the board's time.
//! Reference: RM0090 (sections on RCC, TIM2-5, ADC, DMA, USART, IWDG), STM32F405 datasheet table 9 (alternate functions).
//!
//! | function | pin | peripheral | DMA / interrupt |
//! |---|---|---|---|
//! | ESC pulse, 50 Hz, active high, 3 MHz counter (PSC 27, ARR 59 999, CCR1 3000-6000, both preloaded) | PA6, AF2 | TIM3 CH1 | none |
//! | capture: IR beam, rising edge | PA0, AF1 | TIM2 CH1, 84 MHz, 32 bits, no filter | TIM2 interrupt |
//! | capture: reflective opto, rising edge | PA1, AF1 | TIM2 CH2 | TIM2 interrupt |
//! | capture: hall, rising edge | PA2, AF1 | TIM2 CH3 | TIM2 interrupt |
//! | capture: encoder A, every fourth rising edge (prescaler 4) | PA3, AF1 | TIM2 CH4 | TIM2 interrupt |
//! | strain | PC0 | ADC1 IN10, first of the scan | DMA2 stream 0 channel 0, circular, 16 bit |
//! | torque | PC1 | ADC1 IN11 | same |
//! | current | PC2 | ADC1 IN12 | same |
//! | supply voltage / 6 | PC3 | ADC1 IN13 | same |
//! | temperature | PC4 | ADC1 IN14, last of the scan | same |
//! | telemetry out, 921 600 baud 8N1 | PA9, AF7 | USART1 TX | DMA2 stream 7 channel 4 |
//! | commands in | PA10, AF7 | USART1 RX | DMA2 stream 2 channel 4, circular, polled |
//! | operator's stop, active low, pull-up (drive it high in an emulator) | PB12 | GPIO, polled each tick | none |
//! | control tick, 1 kHz (PSC 83, ARR 999) | - | TIM4 update | TIM4 interrupt |
//! | watchdog, 20 ms at 32 kHz LSI | - | IWDG, fed each tick | reset |
//!
//! ADC clock 21 MHz, 480 + 12 cycles a conversion: 42.7 kconv/s in all, 8.54 kconv/s a channel, reference 3.3 V.
//! Interrupt priorities: TIM2 (captures) above TIM4 (tick). Idle is WFI. defmt messages go to RTT.

pub(crate) mod captures;
pub(crate) mod converter;
pub(crate) mod link;
mod panic;
pub(crate) mod pulse;
pub(crate) mod watchdog;
