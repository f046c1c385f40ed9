//! The end that comes from outside.
//!
//! What it is: a flag that Ctrl-C, a closed terminal and a polite kill raise, in the place of an end in mid-sentence: whoever records or holds a motor
//! looks at it and ends in order.
//! What can go wrong: a second signal while the first is being obeyed ends the program at once, as it would without the flag.
//! Units: none.
//! Reference: signal(7); crate signal-hook.

use crate::Failure;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether it has come.
#[derive(Debug, Clone)]
pub(crate) struct Ended(Arc<AtomicBool>);

impl Ended {
    /// Watches for it from here on.
    pub(crate) fn watch() -> Result<Self, Failure> {
        let flag = Arc::new(AtomicBool::new(false));
        for signal in signals() {
            // the second one of its kind finds the flag up and ends the program
            signal_hook::flag::register_conditional_shutdown(signal, 128 + signal, Arc::clone(&flag))?;
            signal_hook::flag::register(signal, Arc::clone(&flag))?;
        }
        Ok(Self(flag))
    }

    /// It has come.
    pub(crate) fn now(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

fn signals() -> Vec<i32> {
    use signal_hook::consts::{SIGINT, SIGTERM};
    #[cfg(unix)]
    return vec![SIGINT, SIGTERM, signal_hook::consts::SIGHUP];
    #[cfg(not(unix))]
    vec![SIGINT, SIGTERM]
}
