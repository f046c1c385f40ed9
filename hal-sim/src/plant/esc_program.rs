//! The ESC's programming mode.
//!
//! What it is: the items of the menu sound one after the other; closing the throttle while one sounds enters it, its options then
//! sound one after the other, and opening the throttle while one sounds stores it. Power off leaves the mode at any time.
//! What can go wrong: a throttle that is closed to get out enters an item instead; nothing is stored unless it is opened again.
//! Units: s; item and option count from 0.
//! Reference: Beharie 2013 Appendix C, "Program ESC with transmitter" (Figure C.6 shows the sequence; the items are those of the
//! Hobbywing manual that the appendix reproduces, their order assumed).

use super::esc_guard::CutOff;

/// How long each item or option sounds, ns.
pub const SOUNDS_NS: u64 = 3_000_000_000;

/// What can be programmed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Item {
    /// Brake off or on.
    Brake,
    /// Lithium or nickel cells.
    Battery,
    /// Protection A reduces or cuts off.
    CutOffMode,
    /// Threshold of protection A: low, medium, high.
    CutOffThreshold,
    /// Start: normal, soft, very soft.
    StartUp,
    /// Timing: low, medium, high.
    Timing,
    /// Everything as delivered.
    Defaults,
    /// Back to the start-up dialogue.
    Exit,
}

/// The menu in the order in which it sounds, with the number of options of each item.
pub const MENU: [(Item, u8); 8] = [
    (Item::Brake, 2),
    (Item::Battery, 2),
    (Item::CutOffMode, 2),
    (Item::CutOffThreshold, 3),
    (Item::StartUp, 3),
    (Item::Timing, 3),
    (Item::Defaults, 1),
    (Item::Exit, 1),
];

/// What the ESC keeps without power.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    /// Option of each item of [`MENU`].
    pub options: [u8; MENU.len()],
}

impl Default for Settings {
    /// Brake off, lithium cells, reduce, medium threshold, normal start, low timing.
    fn default() -> Self {
        Self { options: [0, 0, 0, 1, 0, 0, 0, 0] }
    }
}

impl Settings {
    /// What protection A does.
    #[must_use]
    pub fn cutoff(&self) -> CutOff {
        if self.options[2] == 0 { CutOff::Reduce } else { CutOff::CutOff }
    }

    /// Threshold of protection A, V a lithium cell.
    #[must_use]
    pub fn cutoff_v_per_cell(&self) -> f64 {
        [2.6, 2.85, 3.15][usize::from(self.options[3]).min(2)]
    }
}

/// Where the menu stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Menu {
    since_ns: u64,
    item: usize,
    option: Option<u8>,
}

/// What a step of the menu leads to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// The menu goes on.
    Stays,
    /// The item "exit" was stored: the ESC goes back to its start-up dialogue.
    Leaves,
}

impl Menu {
    /// The menu begins to sound at `now_ns`.
    #[must_use]
    pub fn open(now_ns: u64) -> Self {
        Self { since_ns: now_ns, ..Self::default() }
    }

    /// Item that sounds and, inside it, the option that sounds.
    #[must_use]
    pub fn sounding(&self) -> (Item, Option<u8>) {
        (MENU[self.item].0, self.option)
    }

    /// One step at `now_ns` with the throttle closed, open, or neither.
    pub fn step(&mut self, settings: &mut Settings, now_ns: u64, closed: bool, open: bool) -> Outcome {
        match self.option {
            None if closed => {
                (self.option, self.since_ns) = (Some(0), now_ns);
            }
            Some(option) if open => {
                match MENU[self.item].0 {
                    Item::Defaults => *settings = Settings::default(),
                    Item::Exit => return Outcome::Leaves,
                    _ => settings.options[self.item] = option,
                }
                *self = Self { since_ns: now_ns, item: self.item, option: None };
            }
            _ if now_ns.saturating_sub(self.since_ns) >= SOUNDS_NS => {
                self.since_ns = now_ns;
                match self.option {
                    Some(option) => self.option = Some((option + 1) % MENU[self.item].1),
                    None => self.item = (self.item + 1) % MENU.len(),
                }
            }
            _ => {}
        }
        Outcome::Stays
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: u64 = 1_000_000_000;

    #[test]
    fn items_and_options_sound_by_turns_and_opening_stores() {
        let mut settings = Settings::default();
        let mut menu = Menu::open(0);
        let mut at = 0;
        let mut run = |menu: &mut Menu, settings: &mut Settings, seconds: u64, closed: bool, open: bool| {
            let end = at + seconds * S;
            let mut last = Outcome::Stays;
            while at < end && last == Outcome::Stays {
                at += S / 100;
                last = menu.step(settings, at, closed, open);
            }
            last
        };
        // throttle held open: items pass by
        run(&mut menu, &mut settings, 7, false, true);
        assert_eq!(menu.sounding(), (Item::CutOffMode, None));
        // closed: into the item, its second option after three seconds
        run(&mut menu, &mut settings, 4, true, false);
        assert_eq!(menu.sounding(), (Item::CutOffMode, Some(1)));
        assert_eq!(settings, Settings::default(), "closing alone stores nothing");
        run(&mut menu, &mut settings, 1, false, true);
        assert_eq!((settings.cutoff(), menu.sounding().1), (CutOff::CutOff, None));
        // on to the last item and out
        run(&mut menu, &mut settings, 15, false, true);
        assert_eq!(menu.sounding().0, Item::Exit);
        run(&mut menu, &mut settings, 1, true, false);
        assert_eq!(run(&mut menu, &mut settings, 1, false, true), Outcome::Leaves);
        assert_eq!(settings.cutoff_v_per_cell(), 2.85);
    }
}
