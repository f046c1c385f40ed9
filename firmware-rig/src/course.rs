//! What the throttle follows while running, and how the host steers it.
//!
//! What it is: a law of time ([`Schedule`]) or the host's segments ([`esc_pwm::Track`]), and from either the pulse of this tick: throttle
//! curve, highest pulse and slew limit included.
//! What can go wrong: segments that did not come in time latch `schedule ran dry`: minimum, as for every fault.
//! Units: milliseconds since the schedule was started, nanoseconds of pulse.
//! Reference: specification `rig.md`, "ESC pulse and arming" (schedules).

use crate::elapsed::Elapsed;
use crate::rig::Rig;
use esc_pwm::{ArmingEvent, Played, Schedule, pulse_for};
use frame::message::Event;
use frame::rig::{Fault, FaultSet, Refusals, RigState};
use frame::schedule::{Playing, ScheduleNews, SegmentBatch, Steer};
use frame::units::{PulseWidth, Ticks};

/// What is followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Course {
    /// A law of time.
    Law(Schedule),
    /// The host's segments.
    Track,
}

impl Course {
    /// Minimum throttle.
    pub(crate) const MINIMUM: Self = Self::Law(Schedule::Manual(PulseWidth::MIN));
}

impl Rig {
    /// Follows a law of time.
    pub(crate) fn run(&mut self, now: Ticks, schedule: Schedule) -> Result<(), Refusals> {
        self.ask(now, ArmingEvent::Run, schedule.check())?;
        self.track.stop();
        self.follow(now, Course::Law(schedule));
        Ok(())
    }

    /// Follows the host's segments.
    pub(crate) fn run_track(&mut self, now: Ticks) -> Result<(), Refusals> {
        self.ask(now, ArmingEvent::Run, self.track.check())?;
        self.track.start();
        self.follow(now, Course::Track);
        Ok(())
    }

    fn follow(&mut self, now: Ticks, course: Course) {
        self.course = course;
        self.started = Elapsed::since(now);
        self.began = now;
    }

    /// Takes segments and tells how the schedule stands.
    pub(crate) fn take_segments(&mut self, batch: &SegmentBatch) {
        let taken = match batch.segments() {
            Some(segments) => self.track.take(batch.first, segments, batch.last),
            None => Err(Refusals(Refusals::OUT_OF_RANGE)),
        };
        let refused = taken.err().unwrap_or_default();
        self.tell_schedule(refused);
    }

    /// Does to the segment that is being played what the host asks, and tells how the schedule stands.
    pub(crate) fn steer(&mut self, now: Ticks, segment: u32, how: Steer) {
        let ms = self.started.ms(now, self.config.ticks_per_ms());
        let _ = self.track.at(ms); // the segment of this instant, where one has just ended
        let refused = self.track.steer(segment, how, ms).err().unwrap_or_default();
        self.tell_schedule(refused);
    }

    fn tell_schedule(&mut self, refused: Refusals) {
        let per_ms = u64::from(self.config.ticks_per_ms());
        let at = |(segment, ms): (u32, u64)| Playing { segment, since: Ticks(self.began.0 + ms * per_ms) };
        let playing = self.track.playing().map(at);
        let (next, room) = (self.track.next(), self.track.room());
        self.tell(Event::Schedule(ScheduleNews { playing, next, room, refused }));
    }

    /// Follows the schedule and gives the pulse of this tick.
    pub(crate) fn drive(&mut self, now: Ticks, tick_ms: u32) -> PulseWidth {
        if self.state == RigState::Running {
            let ms = self.started.ms(now, self.config.ticks_per_ms());
            let played = match &self.course {
                Course::Law(schedule) => schedule.pulse_at(ms).map_or(Played::Over, Played::Pulse),
                Course::Track => self.track.at(ms),
            };
            match played {
                Played::Pulse(target) => {
                    let target = self.config.curve.apply(target).min(self.config.highest);
                    self.setting = self.config.slew.toward(self.setting, target, tick_ms);
                }
                Played::Over => {
                    self.tell(Event::ScheduleDone { at: now });
                    self.apply(now, ArmingEvent::Finished, Refusals::default());
                }
                Played::Dry => {
                    self.latch(now, FaultSet::NONE.with(Fault::StreamDry));
                    self.apply(now, ArmingEvent::Trip, Refusals::default());
                }
            }
        }
        let pulse = pulse_for(self.state, self.setting);
        if pulse.is_live() {
            self.last_live = Some(now);
            self.live_since.get_or_insert(now);
        } else {
            self.live_since = None;
        }
        pulse
    }
}
