//! The last resort: what both images do when their program cannot go on.
//!
//! What it is: one path for a panic, a hard fault, the non-maskable interrupt and every interrupt that has no handler. The image's own
//! `quiet` sets its outputs by registers alone, the cause and the place are kept over the reset, the image's `settle` lets a pulse that
//! has begun end, and the core is reset. [`last_resort!`] writes the handlers.
//! What can go wrong: a fault while the processor stacks the registers (a stack that ran out of RAM) locks the core up; the watchdog
//! then resets it, and the record is missing. Memory, bus and usage faults are not enabled, so each comes as a hard fault.
//! Units: addresses.
//! Reference: ARMv7-M B1.5 (exceptions), B3.2.15 (CFSR); RM0090 section 7.2.7 (the clock security system raises the NMI for as long as
//! CSSF stands); cortex-m-rt 0.7.

use crate::record::Record;
use cortex_m_rt::ExceptionFrame;
use frame::message::{Crash, CrashCause, Event};

/// Not initialised at the start, so that it keeps its content over a reset.
#[allow(unsafe_code)] // the section
#[unsafe(link_section = ".uninit.crash")]
static RECORD: Record = Record::new();

/// What ended the program before the last reset, once.
pub fn take() -> Option<Event> {
    RECORD.take()
}

/// Keeps the place of a panic.
pub fn keep_panic(info: &core::panic::PanicInfo<'_>) {
    if let Some(place) = info.location() {
        RECORD.keep_panic(place.file(), place.line());
    }
}

/// Keeps an exception and where it came from.
pub fn keep_exception(cause: CrashCause, frame: &ExceptionFrame) {
    #[allow(unsafe_code)] // a register that only says why; nothing else runs any more
    let status = unsafe { (*cortex_m::peripheral::SCB::PTR).cfsr.read() };
    RECORD.keep_crash(&Crash { cause, pc: frame.pc(), lr: frame.lr(), status });
}

/// Which non-maskable interrupt it is: the crystal's failure, or none that is known.
#[must_use]
pub fn non_maskable() -> CrashCause {
    if super::clock::has_failed() { CrashCause::ClockFailed } else { CrashCause::NonMaskable }
}

/// Raises the non-maskable interrupt where the clock security system has failed to: its flag stands and the program still runs.
pub fn look_at_clock() {
    const NMIPENDSET: u32 = 1 << 31; // ARMv7-M B3.2.4
    if super::clock::has_failed() {
        #[allow(unsafe_code)] // the one bit asks for the exception, zeros change nothing
        unsafe {
            (*cortex_m::peripheral::SCB::PTR).icsr.write(NMIPENDSET);
        }
    }
}

/// The exception that is being served, by its number less 16.
#[must_use]
pub fn unexpected() -> CrashCause {
    #[allow(unsafe_code)] // the number of the exception is read
    let number = unsafe { (*cortex_m::peripheral::SCB::PTR).icsr.read() } & 0x1ff;
    CrashCause::Unexpected(i8::try_from(number as i32 - 16).unwrap_or(i8::MAX))
}

/// The panic handler and the exception handlers of an image. `quiet(cause)` sets the outputs by registers alone, at once (`None`: a
/// panic); `settle(cause)` may wait a few milliseconds.
#[macro_export]
macro_rules! last_resort {
    ($quiet:path, $settle:path) => {
        #[panic_handler]
        fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
            cortex_m::interrupt::disable();
            $quiet(None);
            $crate::stm32f4::crash::keep_panic(info);
            $settle(None);
            cortex_m::peripheral::SCB::sys_reset()
        }

        /// One path of all exceptions that have no way back.
        fn crash(cause: frame::message::CrashCause, frame: &cortex_m_rt::ExceptionFrame) -> ! {
            $quiet(Some(cause));
            $crate::stm32f4::crash::keep_exception(cause, frame);
            $settle(Some(cause));
            cortex_m::peripheral::SCB::sys_reset()
        }

        #[allow(unsafe_code)] // the attribute asks for it
        #[cortex_m_rt::exception]
        unsafe fn HardFault(frame: &cortex_m_rt::ExceptionFrame) -> ! {
            crash(frame::message::CrashCause::HardFault, frame)
        }

        extern "C" fn non_maskable(frame: &cortex_m_rt::ExceptionFrame) -> ! {
            crash($crate::stm32f4::crash::non_maskable(), frame)
        }

        extern "C" fn unexpected(frame: &cortex_m_rt::ExceptionFrame) -> ! {
            crash($crate::stm32f4::crash::unexpected(), frame)
        }

        /// The non-maskable interrupt: the stacked registers lie where the main stack pointer points at entry.
        #[allow(unsafe_code, non_snake_case)]
        #[unsafe(naked)]
        #[unsafe(no_mangle)]
        unsafe extern "C" fn NonMaskableInt() {
            core::arch::naked_asm!("mrs r0, MSP", "b {handler}", handler = sym non_maskable)
        }

        /// Every exception and interrupt without a handler of its own.
        #[allow(unsafe_code, non_snake_case)]
        #[unsafe(naked)]
        #[unsafe(no_mangle)]
        unsafe extern "C" fn DefaultHandler() {
            core::arch::naked_asm!("mrs r0, MSP", "b {handler}", handler = sym unexpected)
        }
    };
}
