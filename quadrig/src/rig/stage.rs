//! The seat's news on the terminal, and its keys at the seat.
//!
//! What it is: one screen, one terminal, and a model beside the run where one is wanted; what every session in the view shares.
//! What can go wrong: a terminal that goes away ends the session, and with it the motor.
//! Units: as shown.
//! Reference: specification `rig.md`, "The operator's side"; docs/view.md.

use super::date;
use super::overseer::{self, Overseer};
use super::seat::{News, Seat};
use crate::Failure;
use crate::calibrate::scaling::Scaling;
use crate::record::Recorder;
use crate::view::keys::{Question, Wish};
use crate::view::{Course, Screen, Terminal, Tone};
use frame::message::{Command, Message};
use virtual_board::sound;

/// The stage.
pub(crate) struct Stage {
    screen: Screen,
    terminal: Terminal,
    overseer: Option<Overseer>,
    scaling: Scaling,
    /// The limits of the board's configuration are shown.
    limited: bool,
}

impl Stage {
    /// Takes the terminal over.
    pub(crate) fn new(seat: &Seat, course: Option<Course>, overseer: Option<Overseer>) -> Result<Self, Failure> {
        let mut screen = Screen::new(seat.board.name());
        screen.course = course;
        Ok(Self { screen, terminal: Terminal::take()?, overseer, scaling: Scaling::default(), limited: false })
    }

    /// Shows a piece of news.
    pub(crate) fn take(&mut self, seat: &Seat, news: &News) {
        let screen = &mut self.screen;
        screen.now = seat.now();
        match news {
            News::Board(message) => self.heard(seat, message),
            News::Beep(beep) => {
                screen.tell(Tone::Good, format!("the ESC: {}   ({})", sound::heard(*beep), sound::meaning(*beep)));
            }
            News::Accepted(Command::Tare) => screen.tell(Tone::Good, "tared"),
            News::Accepted(Command::ConfigApply { .. }) => {
                screen.tell(Tone::Good, "the new scale is in force; tare anew before the next run")
            }
            News::Accepted(_) => {}
            News::Refused(words) => {
                screen.wanted_us = None;
                screen.tell(Tone::Warn, format!("the board refuses: {words}"));
            }
            News::Silent(command) => screen.tell(Tone::Bad, format!("no answer to \"{}\"", command.words())),
            News::Unplayed(why) => screen.tell(Tone::Bad, format!("the schedule cannot be played to its end: {why}; stopped")),
            News::Recording(words) => screen.tell(Tone::Bad, words.clone()),
            News::Gone(why) => {
                screen.gone = Some(why.clone());
                screen.tell(Tone::Bad, format!("{why}; what arrived is recorded"));
            }
            News::Back => {
                screen.gone = None;
                screen.tell(Tone::Good, "the port is back");
            }
        }
    }

    fn heard(&mut self, seat: &Seat, message: &Message) {
        let screen = &mut self.screen;
        screen.take(message);
        if self.overseer.as_mut().is_some_and(|overseer| overseer.take(message)) {
            screen.tell(Tone::Warn, "the model is held against a new run");
        }
        if let Some(config) = seat.recorder.as_ref().and_then(Recorder::config).filter(|_| !self.limited) {
            self.limited = true;
            screen.configured(config);
            self.scaling.knows(config);
        }
        if let Message::Rig(sample) = message {
            match self.scaling.take(sample, seat.now()) {
                Some(Ok(words)) => screen.tell(Tone::Good, words),
                Some(Err(words)) => screen.tell(Tone::Warn, words),
                None => {}
            }
        }
    }

    /// Does what a key asks of a calibration.
    fn scale(&mut self, seat: &mut Seat, wish: &Wish) {
        let screen = &mut self.screen;
        let told = match wish {
            Wish::Known(typed) => self.scaling.known(typed, seat.now()).map(|words| vec![words]),
            Wish::Forget => {
                self.scaling.forget();
                Ok(vec!["the values that were taken are forgotten".to_owned()])
            }
            Wish::Store => {
                self.scaling.store().into_iter().for_each(|command| seat.ask(command));
                Ok(Vec::new())
            }
            _ => self.scaling.fit(date::today()),
        };
        match told {
            Ok(lines) => {
                lines.into_iter().for_each(|line| screen.tell(Tone::Plain, line));
                if *wish == Wish::Fit {
                    screen.ask(Question::Store);
                }
            }
            Err(why) => screen.tell(Tone::Warn, why),
        }
    }

    /// Looks at the model beside the run; a departure that is to stop the motor has stopped it, and is given in words.
    pub(crate) fn look(&mut self, seat: &mut Seat) -> Option<String> {
        let overseer = self.overseer.as_mut()?;
        let mut stopped = None;
        if let Some(departure) = overseer.look() {
            let words = overseer::words(&departure);
            self.screen.tell(Tone::Bad, words.clone());
            if overseer.under.stops {
                seat.stop();
                stopped = Some(words);
            }
        }
        self.screen.under = Some(overseer.under.clone());
        for channel in &mut self.screen.channels {
            channel.floors = overseer.shown.iter().find(|s| s.channel == channel.name).map(|s| s.floors);
        }
        stopped
    }

    /// Which part of a schedule plays.
    fn part(&mut self, seat: &Seat) {
        if let (Some(course), Some(player)) = (&mut self.screen.course, &seat.player) {
            let plan = player.plan();
            course.part = player.segment().map(|segment| {
                let part = plan.part_of(segment);
                let title = plan.places().get(part).map_or("", |place| place.title.as_str());
                format!("{}/{} {title}", part + 1, plan.places().len())
            });
        }
    }

    /// Does what the keys ask of the board and the bench; gives what is left to the session.
    pub(crate) fn wishes(&mut self, seat: &mut Seat) -> Result<Vec<Wish>, Failure> {
        self.part(seat);
        let screen = &mut self.screen;
        screen.now = seat.now();
        screen.link = seat.board.stats();
        screen.bench = seat.board.is_virtual().then(|| (seat.board.is_powered(), seat.board.is_stopped()));
        screen.recorded = seat.recorder.as_ref().map(Recorder::shown);
        let mut left = Vec::new();
        for key in self.terminal.keys()? {
            let screen = &mut self.screen;
            match screen.key(key) {
                Some(wish @ (Wish::Known(_) | Wish::Fit | Wish::Forget | Wish::Store)) => self.scale(seat, &wish),
                Some(Wish::Stop) => {
                    seat.stop();
                    screen.tell(Tone::Warn, "stopped by key");
                }
                Some(Wish::Send(command)) => seat.ask(command),
                Some(Wish::Hand(hand)) => match seat.hand(&hand) {
                    Ok(()) => screen.tell(Tone::Plain, hand.words()),
                    Err(why) => screen.tell(Tone::Warn, why.to_string()),
                },
                Some(wish) => left.push(wish),
                None => {}
            }
        }
        Ok(left)
    }

    /// Draws, when it is time for a picture.
    pub(crate) fn show(&mut self) -> Result<(), Failure> {
        self.terminal.show(&self.screen, false)
    }
}
