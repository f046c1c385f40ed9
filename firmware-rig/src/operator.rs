//! What the rig does with each command of the host.
//!
//! What it is: every variant of [`Command`] in one `match`, answered by an event: accepted, or refused with all reasons.
//! What can go wrong: an impossible value is refused as `OUT_OF_RANGE`, in addition to what else speaks against it.
//! Units: as in [`frame::message`].
//! Reference: specification `rig.md`, "Acquisition".

use crate::rig::Rig;
use crate::rig_config::{OutOfRange, RigConfig};
use esc_pwm::{ArmingEvent, Chirp, Outcome, Schedule, Staircase};
use frame::message::{Command, Event, Setting};
use frame::rig::{AdcCode, AdcVerdict, Refusals, RigState};
use frame::schedule::{Segment, Shape};
use frame::units::{PulseWidth, Ticks};

impl Rig {
    /// Does what the host asks and tells the answer.
    pub(crate) fn obey(&mut self, now: Ticks, command: &Command) {
        let answer = match *command {
            // hearing it is all; the caller answers the questions
            Command::Ping | Command::Identify | Command::ConfigRead { .. } => return,
            Command::Beep(beep) => {
                self.apply(now, beep.into(), Refusals::default());
                return;
            }
            Command::Segments(batch) => {
                self.take_segments(&batch);
                return;
            }
            Command::Steer { segment, how } => {
                self.steer(now, segment, how);
                return;
            }
            Command::Arm => self.ask(now, ArmingEvent::Arm, Refusals::default()),
            Command::CalibrateRange { confirm } => {
                let missing = Refusals::default().with_if(Refusals::NOT_CONFIRMED, confirm != Command::CALIBRATE_CONFIRM);
                self.ask(now, ArmingEvent::Calibrate, missing)
            }
            Command::ScheduleStep { index, pulse, hold_ms, ramp } => {
                let shape = if ramp { Shape::Line { from: None } } else { Shape::Hold };
                self.track.append_last(index.into(), Segment { pulse, length_ms: hold_ms, shape })
            }
            Command::RunSchedule => self.run_track(now),
            Command::RunStaircase { step, hold_ms, top, down } => {
                self.run(now, Schedule::Staircase(Staircase { step, hold_ms, top, down, visits: 1 }))
            }
            Command::SetPulse(pulse) if pulse == PulseWidth::MIN && self.state == RigState::Running => {
                self.ask(now, ArmingEvent::Finished, Refusals::default())
            }
            Command::SetPulse(pulse) => self.run(now, Schedule::Manual(pulse)),
            Command::Stop => {
                self.stop(now);
                Ok(())
            }
            Command::Tare => self.tare(),
            Command::ClearFaults => self.ask(now, ArmingEvent::Clear, Refusals::default()),
            Command::RunVisits { step, hold_ms, top, down, visits } => {
                self.run(now, Schedule::Staircase(Staircase { step, hold_ms, top, down, visits }))
            }
            Command::RunRamp { from, to, length_ms } => self.run(now, Schedule::Ramp { from, to, length_ms }),
            Command::RunStep { before, after, hold_ms } => self.run(now, Schedule::Step { before, after, hold_ms }),
            Command::RunChirp { centre, amplitude, from_millihertz, to_millihertz, length_ms } => {
                self.run(now, Schedule::Chirp(Chirp { centre, amplitude, from_millihertz, to_millihertz, length_ms }))
            }
            Command::Configure(setting) => self.configure(&setting),
            Command::ConfigPart(part) => self.incoming.take(&part).map_err(|OutOfRange| Refusals(Refusals::OUT_OF_RANGE)),
            Command::ConfigApply { length, crc } => self.configure_whole(length, crc),
            Command::SaveSettings => self.at_rest().map(|()| self.store = true),
            Command::Imu(_) => Err(Refusals(Refusals::WRONG_STATE)), // meant for the other board
            Command::Burst { channel } => match self.config.fitted.get(usize::from(channel)) {
                Some(true) => {
                    self.burst = Some(channel);
                    Ok(())
                }
                _ => Err(Refusals(Refusals::OUT_OF_RANGE)),
            },
            Command::SelfTest { confirm, trial } => {
                let missing = Refusals::default().with_if(Refusals::NOT_CONFIRMED, confirm != Command::SELF_TEST_CONFIRM);
                let refusals = Refusals(missing.0 | self.at_rest().err().unwrap_or_default().0);
                if refusals.is_empty() {
                    self.trial = Some(trial);
                    Ok(())
                } else {
                    Err(refusals)
                }
            }
        };
        self.tell(match answer {
            Ok(()) => Event::Accepted,
            Err(reasons) => Event::Refused(reasons),
        });
    }

    /// Puts a command to the arming machine, with `more` beside the standing objections.
    pub(crate) fn ask(&mut self, now: Ticks, event: ArmingEvent, more: Refusals) -> Result<(), Refusals> {
        let objections = Refusals(self.objections(now).0 | more.0);
        match self.apply(now, event, objections) {
            Outcome::To(_) => Ok(()),
            Outcome::Refused(reasons) => Err(reasons),
            Outcome::Ignored => Err(Refusals(Refusals::WRONG_STATE)),
        }
    }

    /// What changes the board itself needs the rig disarmed and the rotor at rest.
    fn at_rest(&self) -> Result<(), Refusals> {
        let refusals = Refusals::default()
            .with_if(Refusals::WRONG_STATE, self.state != RigState::Disarmed)
            .with_if(Refusals::ROTOR_TURNING, self.bank.is_turning());
        if refusals.is_empty() { Ok(()) } else { Err(refusals) }
    }

    fn configure(&mut self, setting: &Setting) -> Result<(), Refusals> {
        self.at_rest()?;
        let factory = RigConfig::of(&self.factory);
        let changed = self.settings.with(setting, &factory).map_err(|_| Refusals(Refusals::OUT_OF_RANGE))?;
        self.put_in_force(changed);
        Ok(())
    }

    /// A whole configuration that came in parts.
    fn configure_whole(&mut self, length: u16, crc: u32) -> Result<(), Refusals> {
        self.at_rest()?;
        let config = self.incoming.finish(length, crc).map_err(|OutOfRange| Refusals(Refusals::OUT_OF_RANGE))?;
        self.put_in_force(config);
        Ok(())
    }

    /// Takes the means of the last whole log interval as the zeros of strain and torque.
    fn tare(&mut self) -> Result<(), Refusals> {
        let live = matches!(self.state, RigState::Running | RigState::CalibrateHoldMax);
        let [strain, torque, ..] = &self.codes;
        let unusable = |code: &AdcCode| !matches!(code.verdict, AdcVerdict::Nominal | AdcVerdict::Absent);
        let nothing = strain.count == 0 && torque.count == 0;
        let refusals = Refusals::default()
            .with_if(Refusals::WRONG_STATE, live)
            .with_if(Refusals::ROTOR_TURNING, self.bank.is_turning())
            .with_if(Refusals::OUT_OF_RANGE, nothing || unusable(strain) || unusable(torque));
        if !refusals.is_empty() {
            return Err(refusals);
        }
        for (scale, code) in self.calibration.adc.iter_mut().zip(&self.codes).take(2).filter(|(_, code)| code.count > 0) {
            scale.zero = (f64::from(code.sum) / f64::from(code.count)) as f32;
        }
        Ok(())
    }
}
