//! Keys and what they mean.
//!
//! What it is: [`Screen::key`], one key to at most one [`Wish`], by what the rig is doing; a [`Prompt`] collects a number or a word. Space and Esc stop, always, also in the
//! midst of a prompt.
//! What can go wrong: a key that means nothing here does nothing; a number that is none is told and nothing is sent.
//! Units: us of pulse, g at a virtual bench, times the clock.
//! Reference: docs/view.md; Beharie 2013, Fig. 3.10 (beeps as operator keys).

use super::screen::{Screen, Tone};
use frame::message::{Beep, Command};
use frame::rig::RigState;
use frame::units::PulseWidth;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use virtual_board::Hand;

/// Steps of the throttle keys, us.
const FINE_US: i32 = 10;
const COARSE_US: i32 = 50;
/// Longest answer, characters.
const LONGEST: usize = 20;
/// The word that allows maximum pulses.
const MAXIMUM: &str = "MAX";

/// What the operator wants.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Wish {
    /// Minimum throttle, now.
    Stop,
    /// Stop, and leave.
    Quit,
    /// A command for the board.
    Send(Command),
    /// Run the schedule.
    Go,
    /// A known value was put on a channel; as it was typed.
    Known(String),
    /// The line through the known values.
    Fit,
    /// Forget them.
    Forget,
    /// Store the scale that was found.
    Store,
    /// A hand at a virtual board's bench.
    Hand(Hand),
    /// Pause a simulated run, or go on.
    Pause,
    /// A single step of it.
    Step,
    /// Its speed.
    Speed(f64),
}

/// What a prompt asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Question {
    /// A pulse, us.
    Pulse,
    /// A known value on a channel.
    Known,
    /// Whether the scale that was found is stored.
    Store,
    /// A mass to hang on a virtual load cell, g.
    Hang,
    /// The word that allows maximum pulses towards an ESC without power.
    Maximum,
}

/// A question and what was typed so far.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Prompt {
    /// What is asked.
    pub(crate) question: Question,
    /// What was typed.
    pub(crate) typed: String,
}

impl Prompt {
    /// The question in words.
    pub(crate) fn words(&self) -> &'static str {
        match self.question {
            Question::Pulse => "pulse in us, 1000 to 2000, then Enter:",
            Question::Known => "what is on (200g; torque=100g; 5A; 11.8V; none: begin anew), Enter:",
            Question::Store => "store this scale on the board? Type yes, Enter:",
            Question::Hang => "mass to hang on the virtual load cell in g, then Enter:",
            Question::Maximum => "MAXIMUM pulses: propeller off, ESC without power? Type MAX, Enter:",
        }
    }
}

/// A pulse from its width in us.
fn pulse(us: f64) -> Option<PulseWidth> {
    (1000.0..=2000.0).contains(&us).then(|| PulseWidth((us * 1000.0).round() as u32))
}

impl Screen {
    /// What a key means now.
    pub(crate) fn key(&mut self, key: KeyEvent) -> Option<Wish> {
        let wish = self.meant(key);
        match &wish {
            Some(Wish::Send(Command::SetPulse(pulse))) => self.wanted_us = Some(pulse.as_us()),
            Some(Wish::Stop | Wish::Go) => self.wanted_us = None,
            _ => {}
        }
        wish
    }

    fn meant(&mut self, key: KeyEvent) -> Option<Wish> {
        if key.kind == KeyEventKind::Release {
            return None;
        }
        let control = key.modifiers.contains(KeyModifiers::CONTROL);
        match key.code {
            KeyCode::Char(' ') | KeyCode::Esc => {
                self.prompt = None;
                self.help = false;
                return Some(Wish::Stop);
            }
            KeyCode::Char('c' | 'd') if control => return Some(Wish::Quit),
            _ if control => return None,
            _ => {}
        }
        if self.prompt.is_some() {
            return self.typed(key.code);
        }
        match key.code {
            KeyCode::Char('q') => Some(Wish::Quit),
            KeyCode::Char('?') => {
                self.help = !self.help;
                None
            }
            code if self.live.is_some() => self.live_key(code),
            code => self.bench_key(code).or_else(|| self.state_key(code)),
        }
    }

    /// Asks the operator; there is nothing to do yet.
    pub(crate) fn ask(&mut self, question: Question) -> Option<Wish> {
        self.prompt = Some(Prompt { question, typed: String::new() });
        None
    }

    fn typed(&mut self, code: KeyCode) -> Option<Wish> {
        let prompt = self.prompt.as_mut()?;
        match code {
            KeyCode::Char(c) if prompt.typed.len() < LONGEST => prompt.typed.push(c),
            KeyCode::Backspace => drop(prompt.typed.pop()),
            KeyCode::Enter => {
                let Prompt { question, typed } = self.prompt.take()?;
                return self.answered(question, typed.trim());
            }
            _ => {}
        }
        None
    }

    fn answered(&mut self, question: Question, typed: &str) -> Option<Wish> {
        let number = typed.parse::<f64>().ok().filter(|v| v.is_finite());
        let wish = match question {
            Question::Pulse => number.and_then(pulse).map(|pulse| Wish::Send(Command::SetPulse(pulse))),
            Question::Known if typed == "none" => Some(Wish::Forget),
            Question::Known => (!typed.is_empty()).then(|| Wish::Known(typed.to_owned())),
            Question::Store => (typed == "yes").then_some(Wish::Store),
            Question::Hang => number.map(|grams| Wish::Hand(Hand::Hang(grams))),
            Question::Maximum => {
                (typed == MAXIMUM).then_some(Wish::Send(Command::CalibrateRange { confirm: Command::CALIBRATE_CONFIRM }))
            }
        };
        if wish.is_none() {
            self.tell(Tone::Warn, format!("{typed:?}: nothing was done"));
        }
        wish
    }

    /// Keys of a virtual board's bench.
    fn bench_key(&mut self, code: KeyCode) -> Option<Wish> {
        let (powered, open) = self.bench?;
        match code {
            KeyCode::Char('b') => Some(Wish::Hand(Hand::Power(!powered))),
            KeyCode::Char('k') => Some(Wish::Hand(Hand::StopLoop { open: !open })),
            KeyCode::Char('h') => self.ask(Question::Hang),
            _ => None,
        }
    }

    /// Keys that depend on what the rig is doing.
    fn state_key(&mut self, code: KeyCode) -> Option<Wish> {
        use RigState as S;
        let send = |command: Command| Some(Wish::Send(command));
        if code == KeyCode::Char('x') {
            return send(Command::ClearFaults); // also before the state was heard: the board knows whether it may
        }
        let state = self.state?;
        if let Some(beep) = beep(code, state) {
            return send(Command::Beep(beep));
        }
        match (code, state) {
            (KeyCode::Char('a'), S::Disarmed) => send(Command::Arm),
            (KeyCode::Char('t'), _) => send(Command::Tare),
            (KeyCode::Char('c'), S::Disarmed) => self.ask(Question::Maximum),
            (KeyCode::Char('m'), S::Disarmed) => self.ask(Question::Known),
            (KeyCode::Char('f'), S::Disarmed) => Some(Wish::Fit),
            (KeyCode::Char('s'), S::Disarmed) => send(Command::SaveSettings),
            (KeyCode::Char('g') | KeyCode::Enter, S::Armed) if self.course.is_some() => Some(Wish::Go),
            (KeyCode::Char('='), S::Armed | S::Running) => self.ask(Question::Pulse),
            (KeyCode::Up, S::Armed | S::Running) => self.nudge(FINE_US),
            (KeyCode::Down, S::Running) => self.nudge(-FINE_US),
            (KeyCode::PageUp, S::Armed | S::Running) => self.nudge(COARSE_US),
            (KeyCode::PageDown, S::Running) => self.nudge(-COARSE_US),
            (KeyCode::Home, S::Running) => send(Command::SetPulse(PulseWidth::MIN)),
            _ => None,
        }
    }

    /// The throttle a little up or down from where it is, or from where it was told to go and is on its way.
    fn nudge(&self, us: i32) -> Option<Wish> {
        let now = self.wanted_us.or(self.pulse_us)?.round();
        let wanted = pulse((now + f64::from(us)).clamp(1000.0, 2000.0))?;
        Some(Wish::Send(Command::SetPulse(wanted)))
    }

    /// Keys of a simulated run that is watched.
    fn live_key(&mut self, code: KeyCode) -> Option<Wish> {
        let live = self.live?;
        match code {
            KeyCode::Char('p') => Some(Wish::Pause),
            KeyCode::Char('s') | KeyCode::Right => Some(Wish::Step),
            KeyCode::Char('+') | KeyCode::Up => Some(Wish::Speed((live.speed * 2.0).clamp(0.125, 1024.0))),
            KeyCode::Char('-') | KeyCode::Down => Some(Wish::Speed((live.speed * 0.5).clamp(0.125, 1024.0))),
            KeyCode::Char('0') => Some(Wish::Speed(0.0)),
            _ => None,
        }
    }

    /// The keys that mean something now, with what they do.
    pub(crate) fn known_keys(&self) -> Vec<(&'static str, &'static str)> {
        use RigState as S;
        if self.live.is_some() {
            return vec![("p", "pause"), ("s", "step 0.1 s"), ("+ -", "speed"), ("0", "as fast as it goes"), ("q", "end")];
        }
        let mut keys: Vec<(&str, &str)> = match self.state {
            None => vec![],
            Some(S::Disarmed) => {
                vec![
                    ("a", "arm"),
                    ("t", "tare"),
                    ("m", "known value"),
                    ("f", "fit scale"),
                    ("s", "save"),
                    ("c", "throttle range"),
                    ("x", "clear"),
                ]
            }
            Some(S::ArmHoldMin) => vec![("l", "heard a long beep"), ("d", "two beeps"), ("n", "beeps without end")],
            Some(S::ArmCells) => vec![("1-9", "heard so many beeps"), ("p", "special tone"), ("n", "beeps without end")],
            Some(S::ArmReady) => vec![("r", "heard 1-2-3"), ("p", "special tone"), ("n", "beeps without end")],
            Some(S::Armed) if self.course.is_some() => {
                vec![("g", "go"), ("=", "set pulse"), ("Up PgUp", "throttle up 10, 50 us"), ("t", "tare")]
            }
            Some(S::Armed) => vec![("=", "set pulse"), ("Up PgUp", "throttle up 10, 50 us"), ("t", "tare")],
            Some(S::Running) => vec![("Up Down", "10 us"), ("PgUp PgDn", "50 us"), ("=", "set pulse"), ("Home", "minimum")],
            Some(S::CalibrateHoldMax) => vec![("d", "heard two beeps"), ("p", "special tone"), ("n", "beeps without end")],
            Some(S::CalibrateHoldMin) => vec![("r", "heard 1-2-3"), ("p", "special tone"), ("n", "beeps without end")],
            Some(S::ProgrammingEscape | S::Faulted) => vec![("x", "clear")],
        };
        if self.bench.is_some() {
            keys.extend([("b", "battery on/off"), ("k", "emergency stop"), ("h", "hang a mass")]);
        }
        keys.extend([("q", "stop and quit"), ("?", "all keys")]);
        keys
    }
}

/// The beep that a key stands for in a state.
fn beep(code: KeyCode, state: RigState) -> Option<Beep> {
    use RigState as S;
    let KeyCode::Char(c) = code else { return None };
    let listens = matches!(state, S::ArmHoldMin | S::ArmCells | S::ArmReady | S::CalibrateHoldMax | S::CalibrateHoldMin);
    match c {
        'l' if state == S::ArmHoldMin || state == S::CalibrateHoldMin => Some(Beep::Long),
        '1'..='9' if state == S::ArmCells || state == S::CalibrateHoldMin => c.to_digit(10).map(|n| Beep::Cells(n as u8)),
        'r' if state == S::ArmReady || state == S::CalibrateHoldMin => Some(Beep::Ready),
        'd' if listens => Some(Beep::Double),
        'p' if listens => Some(Beep::Programming),
        'n' if listens => Some(Beep::NoSignal),
        'f' if listens => Some(Beep::SelfTestFailed),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn press(screen: &mut Screen, code: KeyCode) -> Option<Wish> {
        screen.key(KeyEvent::new(code, KeyModifiers::NONE))
    }

    fn at(state: RigState) -> Screen {
        let mut screen = Screen::new(String::new());
        screen.state = Some(state);
        screen
    }

    fn types(screen: &mut Screen, words: &str) -> Option<Wish> {
        words.chars().for_each(|c| assert_eq!(press(screen, KeyCode::Char(c)), None));
        press(screen, KeyCode::Enter)
    }

    #[test]
    fn space_and_escape_stop_from_everywhere() {
        for state in esc_pwm::arming::STATES {
            for code in [KeyCode::Char(' '), KeyCode::Esc] {
                let mut screen = at(state);
                assert_eq!(press(&mut screen, code), Some(Wish::Stop), "{state:?}");
                screen.ask(Question::Pulse);
                assert_eq!(press(&mut screen, code), Some(Wish::Stop), "in a prompt");
                assert_eq!(screen.prompt, None);
            }
        }
        let mut unknown = Screen::new(String::new());
        assert_eq!(press(&mut unknown, KeyCode::Char(' ')), Some(Wish::Stop), "before anything was heard");
        assert_eq!(press(&mut unknown, KeyCode::Char('x')), Some(Wish::Send(Command::ClearFaults)));
        assert_eq!(unknown.key(KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL)), Some(Wish::Quit));
    }

    #[test]
    fn a_key_gives_throttle_only_where_the_rig_is_armed() {
        let live = |wish: &Option<Wish>| {
            matches!(wish, Some(Wish::Go)) || matches!(wish, Some(Wish::Send(Command::SetPulse(p))) if p.is_live())
        };
        for state in esc_pwm::arming::STATES {
            let mut screen = at(state);
            screen.pulse_us = Some(1000.0);
            screen.course = Some(super::super::screen::Course::default());
            let armed = matches!(state, RigState::Armed | RigState::Running);
            let codes = (32..127u8).map(|c| KeyCode::Char(char::from(c)));
            for code in codes.chain([KeyCode::Up, KeyCode::PageUp, KeyCode::Enter, KeyCode::Home, KeyCode::Down]) {
                screen.prompt = None;
                let wish = press(&mut screen, code);
                assert!(armed || !live(&wish), "{state:?}: {code:?} gives {wish:?}");
            }
        }
        let mut screen = at(RigState::Running);
        screen.pulse_us = Some(1004.0); // on its way to what was typed
        press(&mut screen, KeyCode::Char('='));
        types(&mut screen, "1200");
        press(&mut screen, KeyCode::Up);
        let up = press(&mut screen, KeyCode::Up);
        assert_eq!(up, Some(Wish::Send(Command::SetPulse(PulseWidth::from_us(1220)))), "from where it is told to go, each press");
        press(&mut screen, KeyCode::Char(' '));
        screen.pulse_us = Some(1000.0);
        let up = press(&mut screen, KeyCode::Up);
        assert_eq!(up, Some(Wish::Send(Command::SetPulse(PulseWidth::from_us(1010)))), "a stop forgets it");
        let mut screen = at(RigState::Running);
        screen.pulse_us = Some(1995.0);
        assert_eq!(press(&mut screen, KeyCode::PageUp), Some(Wish::Send(Command::SetPulse(PulseWidth::MAX))), "never beyond");
        (screen.pulse_us, screen.wanted_us) = (Some(1005.0), None);
        assert_eq!(press(&mut screen, KeyCode::Down), Some(Wish::Send(Command::SetPulse(PulseWidth::MIN))));
    }

    #[test]
    fn beeps_are_keys_where_the_board_waits_for_them() {
        let sent = |state, c| match press(&mut at(state), KeyCode::Char(c)) {
            Some(Wish::Send(Command::Beep(beep))) => Some(beep),
            _ => None,
        };
        assert_eq!(sent(RigState::ArmHoldMin, 'l'), Some(Beep::Long));
        assert_eq!(sent(RigState::ArmCells, '3'), Some(Beep::Cells(3)));
        assert_eq!(sent(RigState::ArmReady, 'r'), Some(Beep::Ready));
        assert_eq!(sent(RigState::CalibrateHoldMax, 'd'), Some(Beep::Double));
        assert_eq!((sent(RigState::Armed, 'r'), sent(RigState::Disarmed, 'l'), sent(RigState::Running, '3')), (None, None, None));
    }

    #[test]
    fn prompts_take_a_number_and_maximum_takes_its_word() {
        let mut screen = at(RigState::Armed);
        assert_eq!(press(&mut screen, KeyCode::Char('=')), None);
        assert_eq!(types(&mut screen, "1250.5"), Some(Wish::Send(Command::SetPulse(PulseWidth(1_250_500)))));
        press(&mut screen, KeyCode::Char('='));
        assert_eq!(types(&mut screen, "2500"), None);
        assert!(screen.news.back().is_some_and(|l| l.text.contains("2500")));
        let mut screen = at(RigState::Disarmed);
        press(&mut screen, KeyCode::Char('c'));
        assert_eq!(types(&mut screen, "yes"), None);
        press(&mut screen, KeyCode::Char('c'));
        assert!(matches!(types(&mut screen, "MAX"), Some(Wish::Send(Command::CalibrateRange { .. }))));
        press(&mut screen, KeyCode::Char('m'));
        "20x".chars().for_each(|c| drop(press(&mut screen, KeyCode::Char(c))));
        press(&mut screen, KeyCode::Backspace);
        assert_eq!(press(&mut screen, KeyCode::Enter), Some(Wish::Known("20".to_owned())));
        press(&mut screen, KeyCode::Char('m'));
        "torque".chars().for_each(|c| drop(press(&mut screen, KeyCode::Char(c))));
        assert_eq!(press(&mut screen, KeyCode::Char(' ')), Some(Wish::Stop), "space stops, also here");
        screen.ask(Question::Store);
        assert_eq!(types(&mut screen, "y"), None, "a stray key stores nothing");
        screen.ask(Question::Store);
        assert_eq!(types(&mut screen, "yes"), Some(Wish::Store));
    }

    #[test]
    fn every_key_that_is_shown_does_something() {
        for state in esc_pwm::arming::STATES {
            let mut screen = at(state);
            screen.bench = Some((false, false));
            screen.pulse_us = Some(1200.0);
            for (key, what) in screen.known_keys() {
                let code = match key {
                    "1-9" => KeyCode::Char('4'),
                    "Up Down" | "Up PgUp" | "PgUp PgDn" => KeyCode::Up,
                    "Home" => KeyCode::Home,
                    key => KeyCode::Char(key.chars().next().expect("a key")),
                };
                let mut screen = screen.clone();
                let wish = press(&mut screen, code);
                assert!(wish.is_some() || screen.prompt.is_some() || screen.help, "{state:?}: {key} ({what}) does nothing");
            }
        }
    }
}
