//! Reads a board's configuration while it is recorded.
//!
//! What it is: asks for one part after the other, between everything else that goes over the line.
//! What can go wrong: an answer that does not come is asked for again, and given up after a while: the log then lacks the configuration, and
//! nothing else.
//! Units: bytes; ms.
//! Reference: specification `rig.md`, "Partial rigs are normal" ("logged with every run").

use firmware_rig::RigConfig;
use frame::message::{Command, ConfigPart};
use std::time::Duration;

/// How long an answer may take.
const ANSWER_TIME: Duration = Duration::from_millis(150);
/// Questions without an answer after which no more are asked.
const PATIENCE: u32 = 40;

/// What is known so far.
#[derive(Debug, Default)]
pub(super) struct Inquiry {
    form: Vec<u8>,
    asked: Option<Duration>,
    unanswered: u32,
    found: Option<RigConfig>,
    over: bool,
}

impl Inquiry {
    /// The next question, when one is due at `now`.
    pub(super) fn question(&mut self, now: Duration) -> Option<Command> {
        if self.over || self.asked.is_some_and(|at| now < at + ANSWER_TIME) {
            return None;
        }
        if self.asked.is_some() {
            self.unanswered += 1;
            self.over = self.unanswered > PATIENCE;
        }
        self.asked = Some(now);
        (!self.over).then_some(Command::ConfigRead { at: self.form.len() as u16 })
    }

    /// Takes a part that came.
    pub(super) fn take(&mut self, part: &ConfigPart) {
        if self.over || usize::from(part.at) != self.form.len() {
            return;
        }
        self.form.extend_from_slice(&part.bytes);
        self.asked = None;
        let length = usize::from(part.length);
        if self.form.len() >= length {
            self.form.truncate(length);
            self.found = RigConfig::from_form(&self.form);
            self.over = true;
        }
    }

    /// No more will be known than is.
    pub(super) fn is_over(&self) -> bool {
        self.over
    }

    /// The configuration, once it is whole.
    pub(super) fn found(&self) -> Option<&RigConfig> {
        self.found.as_ref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use firmware_rig::Config;

    #[test]
    fn parts_in_order_make_the_whole_and_silence_ends_it() {
        let config = RigConfig::of(&Config::thesis_570kv());
        let mut inquiry = Inquiry::default();
        let mut asked = 0;
        while let Some(Command::ConfigRead { at }) = inquiry.question(Duration::ZERO) {
            let part = config.part(at).expect("a part");
            inquiry.take(&config.part(0).expect("a part")); // what came twice, or late
            inquiry.take(&part);
            asked += 1;
        }
        assert!(inquiry.is_over() && inquiry.found() == Some(&config), "{asked} questions");

        let mut silent = Inquiry::default();
        let mut now = Duration::ZERO;
        for _ in 0..=PATIENCE {
            assert!(silent.question(now).is_some() && silent.question(now).is_none() && !silent.is_over());
            now += ANSWER_TIME;
        }
        assert!(silent.question(now).is_none() && silent.is_over() && silent.found().is_none());
    }
}
