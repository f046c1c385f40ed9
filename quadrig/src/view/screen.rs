//! What an operator sees, as one value.
//!
//! What it is: [`Screen`], made from the board's messages and a few words of the session; it knows neither terminal nor clock.
//! What can go wrong: what has not been heard yet is shown as unknown.
//! Units: the log's; times are those of the port, from its opening.
//! Reference: specification `rig.md`, "The operator's side".

use super::channel::{CHANNELS, Channel, adc_words, capture_words, second_words};
use super::keys::Prompt;
use firmware_rig::RigConfig;
use frame::calibration::Calibration;
use frame::esc::EscVerdict;
use frame::message::{BoardId, Event, Message, SettingsNews};
use frame::rig::{CAPTURE_CHANNELS, Fault, FaultSet, RigSample, RigState};
use frame::units::Ticks;
use frame::wire::LinkStats;
use ident::close::watch::Departure;
use std::collections::VecDeque;
use std::time::Duration;

/// Lines of news that are kept.
const KEPT: usize = 100;

/// How something is meant to look.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Tone {
    /// As any text.
    #[default]
    Plain,
    /// In order.
    Good,
    /// Look here.
    Warn,
    /// Act.
    Bad,
    /// Of little weight.
    Dim,
}

/// A line of news.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Line {
    pub(crate) at: Duration,
    pub(crate) tone: Tone,
    pub(crate) text: String,
}

/// What is run.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Course {
    /// Its name.
    pub(crate) name: String,
    /// Longest time that it takes, s.
    pub(crate) longest_s: f64,
    /// Which part of it plays.
    pub(crate) part: Option<String>,
    /// When it began.
    pub(crate) begun: Option<Duration>,
    /// It came to its end.
    pub(crate) over: bool,
}

impl Course {
    /// Time left at `now`, s; `None` before it began.
    pub(crate) fn left_s(&self, now: Duration) -> Option<f64> {
        let begun = self.begun.filter(|_| !self.over)?;
        Some((self.longest_s - now.saturating_sub(begun).as_secs_f64()).max(0.0))
    }
}

/// What is recorded.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Recorded {
    /// File.
    pub(crate) file: String,
    /// Rows so far.
    pub(crate) rows: usize,
    /// Rows wait in memory: the disk takes none.
    pub(crate) waiting: bool,
}

/// A model that the run is held against.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Under {
    /// The run that the model was identified from.
    pub(crate) model: String,
    /// A departure stops the run.
    pub(crate) stops: bool,
    /// What is looked for, noise floors.
    pub(crate) floors: f64,
    /// The run has left it.
    pub(crate) departure: Option<Departure>,
}

/// Controls of a simulated run that is watched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Live {
    /// Times as fast as the clock; 0 for as fast as it goes.
    pub(crate) speed: f64,
    /// It stands still.
    pub(crate) paused: bool,
    /// Share that is done.
    pub(crate) share: f64,
}

/// Everything that is shown.
#[derive(Debug, Clone)]
pub(crate) struct Screen {
    /// Which board at which port.
    pub(crate) title: String,
    /// Time of the port.
    pub(crate) now: Duration,
    /// State of the arming machine; unknown before it was heard.
    pub(crate) state: Option<RigState>,
    /// Latched faults.
    pub(crate) faults: FaultSet,
    /// The stop loop is open.
    pub(crate) stop_open: bool,
    /// Pulse, us.
    pub(crate) pulse_us: Option<f64>,
    /// Pulse that the keys have asked for, us, as long as nothing else has changed it.
    pub(crate) wanted_us: Option<f64>,
    /// Channels.
    pub(crate) channels: [Channel; CHANNELS],
    /// What the ESC and the back-EMF meter say, in a line, where they are fitted.
    pub(crate) second: Option<(Tone, String)>,
    /// Counters of the line.
    pub(crate) link: LinkStats,
    /// When the board was heard last.
    pub(crate) heard: Option<Duration>,
    /// Why the port is gone.
    pub(crate) gone: Option<String>,
    /// What is run, or is to be.
    pub(crate) course: Option<Course>,
    /// What is recorded.
    pub(crate) recorded: Option<Recorded>,
    /// What happened, the newest last.
    pub(crate) news: VecDeque<Line>,
    /// A question to the operator.
    pub(crate) prompt: Option<Prompt>,
    /// A virtual board's bench: the ESC's supply is on, the stop loop is open.
    pub(crate) bench: Option<(bool, bool)>,
    /// A model beside the run.
    pub(crate) under: Option<Under>,
    /// A simulated run that is watched.
    pub(crate) live: Option<Live>,
    /// Every key is listed.
    pub(crate) help: bool,
    calibration: Option<Calibration>,
    last_sample: Option<Ticks>,
}

impl Screen {
    /// Nothing was heard yet.
    pub(crate) fn new(title: String) -> Self {
        Self {
            title,
            now: Duration::ZERO,
            state: None,
            faults: FaultSet::NONE,
            stop_open: false,
            pulse_us: None,
            wanted_us: None,
            channels: Channel::all(),
            second: None,
            link: LinkStats::default(),
            heard: None,
            gone: None,
            course: None,
            recorded: None,
            news: VecDeque::new(),
            prompt: None,
            bench: None,
            under: None,
            live: None,
            help: false,
            calibration: None,
            last_sample: None,
        }
    }

    /// Adds a line of news; one that was said last is not said again.
    pub(crate) fn tell(&mut self, tone: Tone, text: impl Into<String>) {
        let text = text.into();
        if self.news.back().is_some_and(|last| last.text == text && last.at + Duration::from_secs(1) > self.now) {
            return;
        }
        self.news.push_back(Line { at: self.now, tone, text });
        if self.news.len() > KEPT {
            self.news.pop_front();
        }
    }

    /// The configuration in force.
    pub(crate) fn configured(&mut self, config: &RigConfig) {
        Channel::limit(&mut self.channels, config);
    }

    /// Takes a message of the board.
    pub(crate) fn take(&mut self, message: &Message) {
        self.heard = Some(self.now);
        match message {
            Message::Hello(hello) => {
                let [major, minor, patch] = hello.firmware;
                let board = if hello.board == BoardId::Rig { "rig" } else { "IMU" };
                self.tell(
                    Tone::Dim,
                    format!("{board} board, firmware {major}.{minor}.{patch}, configuration {:08x}", hello.config),
                );
            }
            Message::Calibration(calibration) => self.calibration = Some(*calibration),
            Message::Rig(sample) => self.sample(sample),
            Message::Event(event) => self.event(event),
            _ => {}
        }
    }

    fn event(&mut self, event: &Event) {
        match event {
            Event::State { to, .. } => {
                self.enter(*to);
                let tone = match to {
                    RigState::Faulted | RigState::ProgrammingEscape => Tone::Bad,
                    RigState::Running | RigState::CalibrateHoldMax => Tone::Warn,
                    RigState::Armed => Tone::Good,
                    _ => Tone::Plain,
                };
                self.tell(tone, esc_pwm::arming::message(*to));
            }
            Event::Faults { faults, .. } => {
                self.faults = *faults;
                let words: Vec<&str> = faults.iter().map(Fault::words).collect();
                self.tell(Tone::Bad, format!("latched: {}", words.join(", ")));
            }
            Event::ScheduleDone { .. } => {
                if let Some(course) = &mut self.course {
                    course.over = true;
                }
                self.tell(Tone::Good, "the schedule came to its end");
            }
            Event::StopLoop { open, .. } => {
                self.stop_open = *open;
                let (tone, words) =
                    if *open { (Tone::Bad, "the stop loop is open") } else { (Tone::Plain, "the stop loop is closed") };
                self.tell(tone, words);
            }
            Event::EscTelemetry { verdict, .. } => {
                self.tell(if *verdict == EscVerdict::Nominal { Tone::Dim } else { Tone::Warn }, verdict.words());
            }
            Event::Settings(SettingsNews::Damaged) => {
                self.tell(Tone::Warn, "the board's stored settings are damaged: factory settings are in force")
            }
            Event::Settings(SettingsNews::Saved) => self.tell(Tone::Good, "stored on the board"),
            Event::Settings(SettingsNews::Failed) => self.tell(Tone::Bad, "could not be stored on the board"),
            Event::Panicked { line, .. } => {
                self.tell(Tone::Bad, format!("the board's program panicked before its reset (line {line})"))
            }
            Event::Crashed(crash) => self.tell(
                Tone::Bad,
                format!("the board's program crashed before its reset: {} at {:#010x}", crash.cause.words(), crash.pc),
            ),
            _ => {}
        }
    }

    fn enter(&mut self, state: RigState) {
        if state == RigState::Running
            && let Some(course) = self.course.as_mut().filter(|course| course.begun.is_none())
        {
            course.begun = Some(self.now);
        }
        if !matches!(state, RigState::Armed | RigState::Running) {
            self.wanted_us = None;
        }
        self.state = Some(state);
    }

    fn sample(&mut self, sample: &RigSample) {
        if self.last_sample.is_some_and(|last| sample.at < last) {
            self.tell(Tone::Warn, "the board was reset");
        }
        self.last_sample = Some(sample.at);
        if self.state != Some(sample.state) {
            self.enter(sample.state);
        }
        self.faults = sample.faults;
        self.pulse_us = Some(sample.pulse.as_us());
        let values = self.calibration.map(|c| c.convert(sample));
        self.second = values.and_then(|values| second_words(sample, &values));
        let t_s = sample.at.as_s();
        let codes = sample
            .rpm
            .iter()
            .map(|code| capture_words(code.verdict))
            .chain(sample.adc.iter().map(|code| adc_words(code.verdict)));
        for (i, (channel, verdict)) in self.channels.iter_mut().zip(codes).enumerate() {
            channel.verdict = verdict;
            channel.value = values.and_then(|v| match i.checked_sub(CAPTURE_CHANNELS) {
                None => v.rpm[i],
                Some(k) => v.adc[k],
            });
            if let Some(value) = channel.value {
                channel.trend.take(t_s, value);
            }
        }
    }

    /// Seconds since the board was last heard; `None` before it ever was.
    pub(crate) fn silence_s(&self) -> Option<f64> {
        Some(self.now.saturating_sub(self.heard?).as_secs_f64())
    }

    /// Something is wrong that takes precedence over everything else, in words.
    pub(crate) fn alarm(&self) -> Option<String> {
        if let Some(gone) = &self.gone {
            return Some(format!("{gone}; the board stops the motor by itself within its link time-out; waiting for the port"));
        }
        if self.silence_s().is_some_and(|s| s > 1.5) && self.live.is_none() {
            return Some(format!(
                "nothing heard for {:.0} s; the board stops the motor by itself",
                self.silence_s().unwrap_or(0.0)
            ));
        }
        if !self.faults.is_empty() {
            let words: Vec<&str> = self.faults.iter().map(Fault::words).collect();
            return Some(words.join(", "));
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use frame::calibration::AdcScale;
    use frame::rig::{AdcCode, AdcVerdict, CaptureCode, CaptureVerdict};
    use frame::units::PulseWidth;

    fn calibration() -> Message {
        let adc = [AdcScale { zero: 100.0, gain: 0.5 }; 5];
        Message::Calibration(Calibration { timer_hz: 84_000_000, marks: [2, 1, 2, 25], adc, pole_pairs: [0; 2] })
    }

    fn sample(ms: u64) -> RigSample {
        let turning = CaptureCode { edges: 2, span: 84_000_000 / 50, verdict: CaptureVerdict::Nominal, uneven: 0 };
        let code = AdcCode { sum: 1200, count: 10, rms_q8: 0, verdict: AdcVerdict::Nominal };
        RigSample {
            at: Ticks::from_ms(ms),
            pulse: PulseWidth::from_us(1300),
            state: RigState::Running,
            faults: FaultSet::NONE,
            rpm: [turning, CaptureCode { verdict: CaptureVerdict::Lost, ..turning }, turning, turning],
            adc: [code, AdcCode { verdict: AdcVerdict::Open, ..code }, code, code, code],
            esc: None,
            back_emf: None,
        }
    }

    #[test]
    fn values_come_from_the_boards_own_scales_and_verdicts_stand_beside_them() {
        let mut screen = Screen::new("rig".to_owned());
        screen.take(&Message::Rig(sample(100)));
        assert_eq!(screen.channels[0].value, None, "raw codes alone are no value");
        screen.take(&calibration());
        screen.take(&Message::Rig(sample(200)));
        assert_eq!((screen.channels[0].value, screen.channels[0].verdict), (Some(3000.0), ("ok", Tone::Good)));
        assert_eq!((screen.channels[1].value, screen.channels[1].verdict), (None, ("LOST", Tone::Bad)));
        assert_eq!((screen.channels[4].value, screen.channels[4].name), (Some(10.0), "thrust_n"));
        assert_eq!((screen.channels[5].value, screen.channels[5].verdict.0), (None, "OPEN"));
        assert_eq!((screen.state, screen.pulse_us), (Some(RigState::Running), Some(1300.0)));
    }

    #[test]
    fn limits_make_the_bar() {
        let mut screen = Screen::new(String::new());
        assert_eq!(screen.channels[0].share(), None);
        let config = RigConfig::of(&firmware_rig::Config::thesis_570kv());
        screen.configured(&config);
        screen.take(&calibration());
        screen.take(&Message::Rig(sample(100)));
        let high = f64::from(config.limits.speed.high.expect("a limit").0);
        assert!((screen.channels[0].share().expect("a share") - 3000.0 / high).abs() < 1e-9);
    }

    #[test]
    fn a_course_counts_down_from_the_first_pulse_and_ends() {
        let mut screen = Screen::new(String::new());
        screen.course = Some(Course { name: "up".to_owned(), longest_s: 60.0, ..Course::default() });
        let left = |screen: &Screen| screen.course.as_ref().and_then(|c| c.left_s(screen.now));
        screen.now = Duration::from_secs(5);
        assert_eq!(left(&screen), None);
        let state = |from, to| Message::Event(Event::State { from, to, at: Ticks(0) });
        screen.take(&state(RigState::Armed, RigState::Running));
        screen.now = Duration::from_secs(15);
        assert_eq!(left(&screen), Some(50.0));
        screen.now = Duration::from_secs(100);
        assert_eq!(left(&screen), Some(0.0));
        screen.take(&Message::Event(Event::ScheduleDone { at: Ticks(0) }));
        assert_eq!(left(&screen), None);
    }

    #[test]
    fn silence_faults_and_a_lost_port_are_alarms() {
        let mut screen = Screen::new(String::new());
        assert_eq!(screen.alarm(), None, "nothing is wrong before the board could speak");
        screen.take(&Message::Rig(sample(100)));
        screen.now = Duration::from_secs(3);
        assert!(screen.alarm().is_some_and(|a| a.contains("3 s")));
        let faults = FaultSet::NONE.with(Fault::LinkLost);
        screen.take(&Message::Event(Event::Faults { faults, at: Ticks(0) }));
        assert_eq!(screen.alarm().as_deref(), Some("link lost"));
        screen.gone = Some("tty: the port is gone".to_owned());
        assert!(screen.alarm().is_some_and(|a| a.starts_with("tty: the port is gone")));
    }

    #[test]
    fn news_is_bounded_and_not_repeated() {
        let mut screen = Screen::new(String::new());
        for n in 0..500 {
            screen.tell(Tone::Plain, format!("line {n}"));
            screen.tell(Tone::Plain, format!("line {n}"));
        }
        assert_eq!((screen.news.len(), screen.news.back().map(|l| l.text.as_str())), (KEPT, Some("line 499")));
    }
}
