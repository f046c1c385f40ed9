//! Plays a plan to a board.
//!
//! What it is: a [`Player`] hears everything that the board says and gives the commands that are due: segments ahead of their playing,
//! and what the host's jobs ask for. Its owner carries both, arms the rig, and sends [`Command::RunSchedule`] once
//! [`Player::is_ready`].
//! What can go wrong: an answer that does not come is asked for again; a board that stays silent, refuses for good, or a job that
//! cannot be done ends the run ([`Player::failure`]): the owner stops the motor.
//! Units: ms of the host's own clock for what is due; the board's ticks for what is played.
//! Reference: specification `rig.md`, "The operator's side"; `frame::schedule`.

use crate::job::{Job, Otherwise, Wish, Worker};
use crate::plan::Plan;
use frame::calibration::Calibration;
use frame::message::{Command, Event, Message};
use frame::rig::{RigSample, RigState};
use frame::schedule::{BATCH, Playing, ScheduleNews, SegmentBatch, Steer};
use frame::units::Ticks;
use std::collections::VecDeque;

/// Frames that may be on their way.
const WINDOW: usize = 4;
/// Time after which an answer is not waited for any more, ms.
const ANSWER_MS: u64 = 400;
/// Unanswered questions after which the board counts as silent.
const PATIENCE: u32 = 5;
/// Refusals in a row after which the board means it: one lost frame brings one less than the window.
const STUBBORN: u32 = 4 * WINDOW as u32;
/// Time between two questions for room, ms.
const ASK_MS: u64 = 50;

/// Plays one plan once.
#[derive(Debug, Clone)]
pub struct Player {
    plan: Plan,
    calibration: Option<Calibration>,
    /// Segments that were sent; those that the board has; those that it would still take.
    sent: u32,
    there: u32,
    room: u32,
    heard: bool,
    /// When the frames were sent whose answers are to come, ms.
    waiting: VecDeque<u64>,
    silent: u32,
    refusals: u32,
    asked_ms: u64,
    /// The board plays it: what, since when.
    playing: Option<Playing>,
    over: bool,
    worker: Option<(u32, Worker)>,
    wish: Option<(u32, Steer)>,
    failure: Option<String>,
}

impl Player {
    /// A player that has sent nothing yet.
    #[must_use]
    pub fn new(plan: Plan) -> Self {
        Self {
            plan,
            calibration: None,
            sent: 0,
            there: 0,
            room: BATCH as u32,
            heard: false,
            waiting: VecDeque::new(),
            silent: 0,
            refusals: 0,
            asked_ms: 0,
            playing: None,
            over: false,
            worker: None,
            wish: None,
            failure: None,
        }
    }

    /// The plan.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    fn total(&self) -> u32 {
        self.plan.segments().len() as u32
    }

    /// The board has the whole of it, or as much as it takes: it can be run.
    #[must_use]
    pub fn is_ready(&self) -> bool {
        self.heard && self.waiting.is_empty() && (self.there == self.total() || self.room < BATCH as u32)
    }

    /// The segment that is being played.
    #[must_use]
    pub fn segment(&self) -> Option<u32> {
        self.playing.map(|playing| playing.segment)
    }

    /// The board has played it to its end, or stopped.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.over
    }

    /// Why it cannot go on: stop the motor.
    #[must_use]
    pub fn failure(&self) -> Option<&str> {
        self.failure.as_deref()
    }

    fn fail(&mut self, why: String) {
        self.failure.get_or_insert(why);
    }

    /// Hears a message of the board.
    pub fn take(&mut self, message: &Message) {
        match message {
            Message::Calibration(calibration) => self.calibration = Some(*calibration),
            Message::Rig(sample) => self.sample(sample),
            Message::Event(Event::Schedule(news)) => self.news(news),
            Message::Event(Event::State { to: RigState::Running, at, .. })
                if self.heard && self.playing.is_none() && !self.over =>
            {
                self.playing = Some(Playing { segment: 0, since: *at });
            }
            Message::Event(Event::State { from: RigState::Running, .. }) => {
                self.over |= self.playing.is_some();
                self.playing = None;
            }
            _ => {}
        }
    }

    fn news(&mut self, news: &ScheduleNews) {
        self.waiting.pop_front();
        (self.heard, self.silent) = (true, 0);
        (self.there, self.room) = (news.next, u32::from(news.room));
        if self.playing.is_some() && news.playing.is_some() {
            self.playing = news.playing;
        }
        if news.refused.is_empty() || self.sent == self.there {
            self.refusals = 0;
            return;
        }
        // a frame was lost, and those behind it left a gap: sent again from where the board stands
        self.sent = self.there;
        self.refusals += 1;
        if self.refusals >= STUBBORN {
            let why: Vec<&str> = news.refused.words().collect();
            self.fail(format!("the board refuses segment {}: {}", self.there, why.join("; ")));
        }
    }

    /// The command that is due at `now_ms` of the host's clock, if one is. Its answer comes as [`Event::Schedule`] alone.
    pub fn command(&mut self, now_ms: u64) -> Option<Command> {
        if self.over || self.failure.is_some() {
            return None;
        }
        if self.waiting.front().is_some_and(|sent| now_ms >= sent + ANSWER_MS) {
            self.waiting.clear();
            self.sent = self.there;
            self.silent += 1;
            if self.silent >= PATIENCE {
                self.fail("the board does not answer".to_owned());
                return None;
            }
        }
        if self.waiting.len() >= WINDOW {
            return None;
        }
        if let Some((segment, how)) = self.wish.take() {
            self.waiting.push_back(now_ms);
            return Some(Command::Steer { segment, how });
        }
        let left = self.total() - self.sent;
        let free = (self.there + self.room).saturating_sub(self.sent);
        if left > 0 && free >= left.min(BATCH as u32) && (self.heard || self.waiting.is_empty()) {
            let batch = SegmentBatch::of(self.sent, &self.plan.segments()[self.sent as usize..]);
            self.sent += u32::from(batch.count);
            self.waiting.push_back(now_ms);
            return Some(Command::Segments(batch));
        }
        if left > 0 && self.playing.is_some() && self.waiting.is_empty() && now_ms >= self.asked_ms + ASK_MS {
            self.asked_ms = now_ms;
            self.waiting.push_back(now_ms);
            return Some(Command::Segments(SegmentBatch::question(self.there)));
        }
        None
    }

    /// Goes on with the board's clock, and lets the job of the segment hear the sample.
    fn sample(&mut self, sample: &RigSample) {
        let Some(playing) = &mut self.playing else { return };
        while let Some(segment) = self.plan.segments().get(playing.segment as usize) {
            let end = Ticks(playing.since.0 + Ticks::from_ms(u64::from(segment.length_ms)).0);
            if sample.at < end {
                break;
            }
            *playing = Playing { segment: playing.segment + 1, since: end };
        }
        let number = playing.segment;
        if let Some((_, worker)) = self.worker.take_if(|(of, _)| *of < number)
            && let Job::Settle { channel, otherwise: Otherwise::Stop, .. } = worker.job()
            && !worker.is_done()
        {
            let name = channel.name();
            self.fail(format!("{name} did not settle in its time"));
        }
        if sample.at <= playing_since(self.playing) {
            return; // a mean over what was before this segment
        }
        let (Some(job), Some(calibration)) = (self.plan.job(number), &self.calibration) else { return };
        let segment = &self.plan.segments()[number as usize];
        let (_, worker) = self.worker.get_or_insert_with(|| (number, Worker::new(*job, segment)));
        match worker.take(calibration, sample) {
            Wish::Nothing => {}
            Wish::Do(how) => self.wish = Some((number, how)),
            Wish::Blind(channel) => self.fail(format!("{} has no value: nothing is steered blindly", channel.name())),
        }
    }
}

fn playing_since(playing: Option<Playing>) -> Ticks {
    playing.map_or(Ticks(0), |playing| playing.since)
}
