//! The fuzzer's side of `quadrig_tests::fuzzed`.
//!
//! What it is: a macro that makes a fuzz target of a way in, and watches how much memory an input takes.
//! What can go wrong: a panic, an input that takes longer than the fuzzer's time limit, or more memory than [`most`]; the fuzzer keeps the input.
//! Units: bytes.
//! Reference: The Rust Fuzz Book; `fuzz/README.md`.

pub use libfuzzer_sys;
pub use peak_alloc;
pub use quadrig_tests;

/// Bytes of memory that an input may take for each of its own.
const EACH: usize = 100;
/// Bytes that any input may take: buffers of readers, an error with its words.
const ANY: usize = 1 << 20;

/// Most memory that an input of this length may take.
#[must_use]
pub fn most(length: usize) -> usize {
    ANY + EACH * length
}

/// A fuzz target of a function of `quadrig_tests::fuzzed`.
#[macro_export]
macro_rules! fuzzed {
    ($name:ident) => {
        #[global_allocator]
        static MEMORY: $crate::peak_alloc::PeakAlloc = $crate::peak_alloc::PeakAlloc;

        $crate::libfuzzer_sys::fuzz_target!(|data: &[u8]| {
            MEMORY.reset_peak_usage();
            let before = MEMORY.current_usage();
            $crate::quadrig_tests::fuzzed::$name(data);
            let taken = MEMORY.peak_usage().saturating_sub(before);
            assert!(taken <= $crate::most(data.len()), "{taken} bytes of memory for {} of input", data.len());
        });
    };
}
