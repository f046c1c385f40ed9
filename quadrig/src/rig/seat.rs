//! The operator's seat: a conversation with the board that never waits.
//!
//! What it is: everything that the board says passes here once, into the recording, the schedule's player and the [`News`]; commands go out one at a time,
//! each answered before the next, and the link is kept alive. A stop waits for nothing.
//! What can go wrong: a port that goes away is told and opened again when it comes back; an answer that does not come is told.
//! Units: as in the messages.
//! Reference: specification `rig.md`, "Acquisition" and "The operator's side".

use super::assistant::Assistant;
use crate::Failure;
use crate::board::{ANSWER_TIME, Board, Heard};
use crate::record::Recorder;
use frame::message::{Beep, Command, Event, Message};
use frame::rig::RigState;
use schedule::Player;
use std::collections::VecDeque;
use std::time::Duration;
use virtual_board::Hand;

/// Time between two attempts to open a port that went away.
const AGAIN: Duration = Duration::from_millis(100);

/// What happened.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum News {
    /// The board said something.
    Board(Message),
    /// A virtual board's ESC beeped.
    Beep(Beep),
    /// A command was taken.
    Accepted(Command),
    /// The board refused, with every reason.
    Refused(String),
    /// No answer came.
    Silent(Command),
    /// The port is gone.
    Gone(String),
    /// It is back.
    Back,
    /// The schedule cannot be played to its end; the motor has been stopped.
    Unplayed(String),
    /// The recording has something to say.
    Recording(String),
}

/// The seat.
pub(crate) struct Seat {
    /// The board.
    pub(crate) board: Board,
    /// What is recorded.
    pub(crate) recorder: Option<Recorder>,
    /// Hands and ears at a virtual board's bench.
    pub(crate) assistant: Option<Assistant>,
    /// Who sends a schedule that the board does not know.
    pub(crate) player: Option<Player>,
    /// State as last heard.
    pub(crate) state: RigState,
    queue: VecDeque<Command>,
    waiting: Option<(Command, Duration)>,
    gone: bool,
    /// The link is kept alive: nothing else may command an armed rig.
    keeps_alive: bool,
}

impl Seat {
    /// A seat at a board; it asks who speaks, for the recording.
    pub(crate) fn new(board: Board, recorder: Option<Recorder>, assistant: Option<Assistant>) -> Result<Self, Failure> {
        let mut seat = Self {
            board,
            recorder,
            assistant,
            player: None,
            state: RigState::Disarmed,
            queue: VecDeque::new(),
            waiting: None,
            gone: false,
            keeps_alive: true,
        };
        seat.board.send(Command::Identify)?;
        Ok(seat)
    }

    /// A seat from which a board is recorded, and that keeps no rig armed.
    pub(crate) fn listening(board: Board, recorder: Recorder) -> Result<Self, Failure> {
        Ok(Self { keeps_alive: false, ..Self::new(board, Some(recorder), None)? })
    }

    /// The board has told how its codes are meant.
    pub(crate) fn knows_its_board(&self) -> bool {
        self.recorder.as_ref().is_some_and(Recorder::knows_its_board)
    }

    /// Rows recorded so far.
    pub(crate) fn rows(&self) -> usize {
        self.recorder.as_ref().map_or(0, |recorder| recorder.rows)
    }

    /// Time of the last row, s.
    pub(crate) fn seconds(&self) -> f64 {
        self.recorder.as_ref().map_or(-1.0, Recorder::seconds)
    }

    /// The port is gone.
    pub(crate) fn is_gone(&self) -> bool {
        self.gone
    }

    /// The end of a recording: the motor is not ours to stop.
    pub(crate) fn rise(self) -> (Option<Recorder>, Board) {
        (self.recorder, self.board)
    }

    /// Time of the port.
    pub(crate) fn now(&self) -> Duration {
        self.board.now()
    }

    /// A command, when those before it are answered.
    pub(crate) fn ask(&mut self, command: Command) {
        self.queue.push_back(command);
    }

    /// Whether every command has been answered.
    pub(crate) fn is_idle(&self) -> bool {
        self.queue.is_empty() && self.waiting.is_none()
    }

    /// Minimum throttle, before everything else that waits.
    pub(crate) fn stop(&mut self) {
        self.queue.clear();
        self.send(Command::Stop);
    }

    /// Lays a hand on a virtual board's bench.
    pub(crate) fn hand(&mut self, hand: &Hand) -> Result<(), Failure> {
        self.board.hand(hand)
    }

    fn send(&mut self, command: Command) {
        // a port that takes nothing more shows in the next read
        let _ = self.board.send(command);
        let unanswered = matches!(command, Command::Ping | Command::Identify | Command::Beep(_) | Command::ConfigRead { .. });
        if !unanswered {
            self.waiting = Some((command, self.now()));
        }
    }

    /// Hears what arrived, keeps the link alive, sends what is due.
    pub(crate) fn turn(&mut self) -> Result<Vec<News>, Failure> {
        let mut news = Vec::new();
        match self.board.hear() {
            Heard::Messages(messages) => messages.iter().for_each(|m| self.take(&m.message, &mut news)),
            Heard::Gone if self.gone => {}
            Heard::Gone => {
                self.gone = true;
                self.waiting = None;
                self.queue.clear();
                news.push(News::Gone(self.board.gone()));
            }
        }
        if self.gone {
            std::thread::sleep(AGAIN);
            if self.board.reopen() {
                self.gone = false;
                let _ = self.board.send(Command::Identify); // the board may be another one, or tared anew
                news.push(News::Back);
            }
            return Ok(news);
        }
        while let Some(beep) = self.board.beep() {
            news.push(News::Beep(beep));
            if self.assistant.is_some() {
                self.send(Command::Beep(beep));
            }
        }
        if let Some(assistant) = &mut self.assistant {
            assistant.help(&mut self.board, self.state)?;
        }
        self.play(&mut news);
        if let Some((command, since)) = self.waiting
            && self.now() > since + ANSWER_TIME
        {
            self.waiting = None;
            news.push(News::Silent(command));
        }
        let now = self.now();
        if let Some(question) = self.recorder.as_mut().and_then(|recorder| recorder.question(now)) {
            self.send(question);
        }
        if self.waiting.is_none()
            && let Some(command) = self.queue.pop_front()
        {
            self.send(command);
        }
        if self.keeps_alive {
            let _ = self.board.keep_alive(); // likewise
        }
        Ok(news)
    }

    /// Sends what the schedule's player has ready.
    fn play(&mut self, news: &mut Vec<News>) {
        let now_ms = self.now().as_millis() as u64;
        while let Some(command) = self.player.as_mut().and_then(|player| player.command(now_ms)) {
            let _ = self.board.send(command); // likewise
        }
        if let Some(why) = self.player.as_ref().and_then(Player::failure) {
            news.push(News::Unplayed(why.to_owned()));
            self.player = None;
            self.stop();
        }
    }

    fn take(&mut self, message: &Message, news: &mut Vec<News>) {
        if let Some(player) = &mut self.player {
            player.take(message);
        }
        if let Some(recorder) = &mut self.recorder {
            recorder.take(message);
            news.extend(recorder.notes().map(News::Recording));
        }
        news.push(News::Board(*message));
        match message {
            Message::Event(Event::State { to, .. }) => self.state = *to,
            Message::Rig(sample) => self.state = sample.state,
            Message::Event(Event::Accepted) => {
                if let Some((command, _)) = self.waiting.take() {
                    news.push(News::Accepted(command));
                }
            }
            Message::Event(Event::Refused(reasons)) => {
                self.waiting = None;
                let words: Vec<&str> = reasons.words().collect();
                news.push(News::Refused(words.join("; ")));
            }
            _ => {}
        }
    }

    /// The end: the motor is stopped before anything else is done, then the recording is closed. Gives its summary.
    pub(crate) fn leave(mut self) -> (Result<(), Failure>, Option<Recorder>, Board) {
        let recorder = &mut self.recorder;
        let stopped = if self.gone {
            Err(format!("{}; the board stops the motor by itself within its link time-out", self.board.gone()).into())
        } else {
            self.board.obey(Command::Stop, |m| {
                if let Some(recorder) = recorder {
                    recorder.take(m);
                }
            })
        };
        (stopped, self.recorder, self.board)
    }
}
