//! A session with the rig board: arming, throttle, schedules; in the terminal view, or line by line where there is no terminal.
//!
//! What it is: an [`Errand`] at a [`Seat`]: what is asked first, what is run once the rig is armed, whether the session ends with it. Both ways of holding it record
//! the same and end the same: the motor is stopped, the recording closed.
//! What can go wrong: a refused errand is told and leaves no file; whatever ends a session stops the motor first.
//! Units: us of pulse; time of the port.
//! Reference: specification `rig.md`, "The operator's side"; Beharie 2013, Fig. 3.10.

use super::overseer::{self, Overseer};
use super::seat::{News, Seat};
use super::stage::Stage;
use super::typed::{Typed, typed};
use crate::Failure;
use crate::board::refused;
use crate::end::Ended;
use crate::view::Course;
use crate::view::keys::Wish;
use frame::message::{Command, Event, Message};
use frame::rig::{Fault, FaultSet, RigState};
use schedule::Player;
use std::sync::mpsc::TryRecvError;
use virtual_board::sound;

/// What a session is for.
#[derive(Default)]
pub(crate) struct Errand {
    /// Asked at the beginning.
    pub(crate) first: Option<Command>,
    /// Started once the rig is armed.
    pub(crate) run: Option<Command>,
    /// What it is called, and how long it takes at most, s.
    pub(crate) course: Option<(String, f64)>,
    /// Who sends it, where the board does not know it.
    pub(crate) player: Option<Player>,
}

/// How a session went so far.
#[derive(Default)]
struct Going {
    /// The rig has been armed by this session.
    asked: bool,
    started: bool,
    finished: bool,
    faulted: Option<String>,
    departed: Option<String>,
    unplayed: Option<String>,
}

impl Going {
    fn take(&mut self, news: &News) {
        match news {
            News::Board(Message::Event(Event::ScheduleDone { .. })) => self.finished |= self.started,
            News::Board(Message::Event(Event::Faults { faults, .. })) => {
                self.faulted = own_faults(*faults).or(self.faulted.take())
            }
            News::Accepted(Command::ClearFaults) => self.faulted = None,
            News::Unplayed(why) => self.unplayed = Some(why.clone()),
            _ => {}
        }
    }

    /// How the session ends.
    fn verdict(&self) -> Result<(), Failure> {
        if let Some(words) = &self.departed {
            return Err(format!("{words}; the motor was stopped; expected a run that stays with its model (--stop-at)").into());
        }
        if let Some(why) = &self.unplayed {
            return Err(format!(
                "the schedule was not played to its end: {why}; expected to play it whole: what was recorded is kept"
            )
            .into());
        }
        match &self.faulted {
            Some(words) => Err(format!("the rig stopped itself: {words}; expected a run within the limits: docs/rig.md lists the faults, `quadrig rig clear` takes the latch off").into()),
            None => Ok(()),
        }
    }
}

/// Faults other than the operator's own stop, in words.
pub(crate) fn own_faults(faults: FaultSet) -> Option<String> {
    let words: Vec<&str> = faults.iter().filter(|f| *f != Fault::OperatorStop).map(Fault::words).collect();
    (!words.is_empty()).then(|| words.join(", "))
}

/// Holds a session, in the view where `view` is wanted.
pub(crate) fn hold(seat: Seat, errand: Errand, overseer: Option<Overseer>, view: bool, quiet: bool) -> Result<(), Failure> {
    let ended = Ended::watch()?;
    let (mut seat, mut errand, mut going) = (seat, errand, Going::default());
    seat.player = errand.player.take();
    let talk = if view {
        in_view(&mut seat, errand, overseer, &ended, &mut going)
    } else {
        line_by_line(&mut seat, errand, overseer, &ended, &mut going, quiet)
    };
    let refused = matches!(&talk, Err(Ending::Refused(_)));
    // whatever ended the talk: the motor is stopped before anything else is done
    let (stopped, recorder, board) = seat.leave();
    let recorded = match recorder {
        Some(recorder) if refused && !view => {
            recorder.discard();
            Ok(())
        }
        Some(recorder) => recorder.finish(&board, quiet),
        None => Ok(()),
    };
    match talk {
        Err(Ending::Refused(why) | Ending::Failed(why)) => return Err(why),
        Ok(()) => {}
    }
    going.verdict()?;
    stopped?;
    recorded
}

/// Why a talk came to a bad end.
enum Ending {
    /// The first command was refused: nothing has happened.
    Refused(Failure),
    /// Anything else.
    Failed(Failure),
}

impl From<Failure> for Ending {
    fn from(why: Failure) -> Self {
        Self::Failed(why)
    }
}

/// Starts what is to be run, once the rig is armed.
fn start(seat: &mut Seat, errand: &mut Errand, going: &mut Going) {
    if seat.state == RigState::Armed
        && seat.is_idle()
        && seat.player.as_ref().is_none_or(Player::is_ready)
        && let Some(run) = errand.run.take()
    {
        going.started = true;
        seat.ask(run);
    }
}

/// Shows what happens as lines and obeys typed ones.
fn line_by_line(
    seat: &mut Seat,
    mut errand: Errand,
    mut overseer: Option<Overseer>,
    ended: &Ended,
    going: &mut Going,
    quiet: bool,
) -> Result<(), Ending> {
    let say = |line: &str| {
        if !quiet {
            say!("{line}");
        }
    };
    let input = super::lines();
    let running = errand.run.is_some();
    if let Some(first) = errand.first {
        seat.ask(first);
    }
    loop {
        for news in seat.turn()? {
            going.take(&news);
            if let (Some(overseer), News::Board(message)) = (&mut overseer, &news) {
                overseer.take(message);
            }
            match news {
                News::Board(Message::Event(Event::State { to, .. })) => say(esc_pwm::arming::message(to)),
                News::Board(Message::Event(Event::Faults { faults, .. })) => {
                    let words: Vec<&str> = faults.iter().map(Fault::words).collect();
                    note!("latched: {}", words.join(", "));
                }
                News::Board(Message::Event(Event::StopLoop { open: true, .. })) => {
                    note!("stop loop open: let the key go, check plug and wire");
                }
                News::Beep(beep) => say(&format!("the ESC: {}   ({})", sound::heard(beep), sound::meaning(beep))),
                News::Accepted(command) => going.asked |= Some(command) == errand.first,
                News::Refused(words) if !going.asked && errand.first.is_some() => {
                    return Err(Ending::Refused(refused(&words).into()));
                }
                News::Refused(words) => note!("the board refuses: {words}"),
                News::Silent(_) if !going.asked && errand.first.is_some() => {
                    return Err(Ending::Refused(seat.board.unanswered()));
                }
                News::Silent(_) => note!("{}", seat.board.unanswered()),
                News::Recording(words) => note!("{words}"),
                News::Gone(why) => {
                    let words = format!("{why}; the board stops the motor by itself within its link time-out");
                    return Err(Ending::Failed(words.into()));
                }
                News::Board(_) | News::Back | News::Unplayed(_) => {}
            }
        }
        if let Some(departure) = overseer.as_mut().and_then(Overseer::look) {
            let words = overseer::words(&departure);
            if overseer.as_ref().is_some_and(|o| o.under.stops) {
                going.departed = Some(words);
                return Ok(());
            }
            say(&words);
        }
        if ended.now() || going.faulted.is_some() || going.unplayed.is_some() || (running && going.finished) {
            return Ok(());
        }
        start(seat, &mut errand, going);
        match input.try_recv() {
            Ok(line) => match typed(&line, seat.board.is_virtual()) {
                Ok(Typed::Command(Command::Stop) | Typed::End) => return Ok(()),
                Ok(Typed::Command(command)) => seat.ask(command),
                Ok(Typed::Hand(hand)) => match seat.hand(&hand) {
                    Ok(()) => say(&hand.words()),
                    Err(why) => note!("{why}"),
                },
                Err(mistake) => note!("{mistake}"),
            },
            // what was typed before the end is done first
            Err(TryRecvError::Disconnected) if !running && seat.is_idle() => return Ok(()),
            Err(_) => {}
        }
    }
}

/// Shows everything on the terminal and obeys keys.
fn in_view(
    seat: &mut Seat,
    mut errand: Errand,
    overseer: Option<Overseer>,
    ended: &Ended,
    going: &mut Going,
) -> Result<(), Ending> {
    let course = errand.course.take().map(|(name, longest_s)| Course { name, longest_s, ..Course::default() });
    let mut stage = Stage::new(seat, course, overseer)?;
    let running = errand.run.is_some();
    let by_itself = seat.assistant.is_some();
    if let Some(first) = errand.first {
        seat.ask(first);
    }
    loop {
        for news in seat.turn()? {
            going.take(&news);
            stage.take(seat, &news);
        }
        if let Some(departure) = stage.look(seat) {
            going.departed = Some(departure);
        }
        if by_itself {
            start(seat, &mut errand, going);
        }
        for wish in stage.wishes(seat)? {
            match wish {
                Wish::Quit => return Ok(()),
                Wish::Go => start(seat, &mut errand, going),
                _ => {}
            }
        }
        if ended.now() || (running && going.finished) {
            return Ok(());
        }
        stage.show()?;
    }
}
