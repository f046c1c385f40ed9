//! The board's tick with everything around the filter: what the user asks for, telemetry, calibration, counted errors.
//!
//! What it is: [`Console::tick`] takes the readings, what the line brought and what the idle loop has done; it says messages and may
//! give the idle loop a job. It holds the [`Ahrs`] and the settings in force.
//! What can go wrong: a command that is none, or that must wait for the job before it, is refused; the stream goes on in every case.
//! While the flash is erased (1 to 2 s, at the first save and then once in a thousand) the processor stands still and ticks are missed.
//! Units: as in the messages.
//! Reference: specification `ahrs.md`, "Board"; Beharie 2013 Appendix E.

use crate::calibrator::{Calibrator, News, fitted};
use crate::job::{Done, Job};
use crate::line::Heard;
use crate::{Ahrs, AhrsConfig, Inputs, Mounting, Outputs, Settings};
use frame::message::SettingsNews;
use frame::{
    Command, Event, Hello, ImuCommand, ImuContent, ImuErrors, ImuFormat, ImuReport, ImuValues, Message, Refusals, TestAccel,
    Ticks,
};

/// What a tick takes beside the readings.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Asked {
    /// What the line brought.
    pub heard: Option<Heard>,
    /// What the idle loop has done.
    pub done: Option<Done>,
    /// Command frames that were damaged so far.
    pub damaged: u32,
    /// Core cycles of the tick before.
    pub cycles: u32,
}

/// The board.
#[derive(Debug, Clone, PartialEq)]
pub struct Console {
    ahrs: Ahrs,
    test_mounting: Mounting,
    hello: Hello,
    settings: Settings,
    calibrator: Calibrator,
    errors: ImuErrors,
    before: Option<Ticks>,
    /// The idle loop is at work.
    busy: bool,
    once: bool,
}

/// Where messages go.
type Say<'a> = &'a mut dyn FnMut(ImuFormat, &Message);

impl Console {
    /// A board with the settings that were found in flash, if any.
    #[must_use]
    pub fn new(config: AhrsConfig, hello: Hello, found: Option<Settings>) -> Self {
        let settings = found.unwrap_or_default();
        let mut ahrs = Ahrs::new(config);
        ahrs.calibrate(&settings.calibration);
        Self {
            ahrs,
            test_mounting: Mounting::FLAT,
            hello,
            settings,
            calibrator: Calibrator::default(),
            errors: ImuErrors::default(),
            before: None,
            busy: false,
            once: false,
        }
    }

    /// The settings in force.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Attitude and calibration.
    #[must_use]
    pub fn ahrs(&self) -> &Ahrs {
        &self.ahrs
    }

    /// What was counted.
    #[must_use]
    pub fn errors(&self) -> &ImuErrors {
        &self.errors
    }

    /// The first words after a reset: who speaks, and what became of the stored settings.
    pub fn greet(&self, news: SettingsNews, say: Say<'_>) {
        say(self.settings.format, &Message::Hello(self.hello));
        say(self.settings.format, &Message::Event(Event::Settings(news)));
    }

    /// Tells what the board found at its start.
    pub fn announce(&self, event: Event, say: Say<'_>) {
        say(self.settings.format, &Message::Event(event));
    }

    /// Takes one instant; gives work for the idle loop.
    pub fn tick(&mut self, inputs: &Inputs, asked: &Asked, say: Say<'_>) -> Option<Job> {
        let outputs = self.ahrs.tick(inputs);
        self.count(inputs, &outputs, asked);
        if self.settings.stream || core::mem::take(&mut self.once) {
            self.stream(inputs, &outputs, say);
        }
        if let Some(news) = self.calibrator.take(&outputs, &self.settings.calibration) {
            self.tell(&news, say);
        }
        if let Some(done) = &asked.done {
            self.finished(done, say);
        }
        let job = match asked.heard? {
            Heard::Command(command) => self.obey(command, say),
            Heard::Unknown => {
                self.errors.unknown = self.errors.unknown.saturating_add(1);
                Err(Refusals(Refusals::OUT_OF_RANGE))
            }
        };
        match job {
            Ok(job) => {
                self.busy |= job.is_some();
                job
            }
            Err(reasons) => {
                say(self.settings.format, &Message::Event(Event::Refused(reasons)));
                None
            }
        }
    }

    fn count(&mut self, inputs: &Inputs, outputs: &Outputs, asked: &Asked) {
        let add = |count: &mut u16, now: bool| *count = count.saturating_add(u16::from(now));
        let errors = &mut self.errors;
        errors.alive = inputs.readings.alive;
        errors.stuck = outputs.stuck;
        for (bit, count) in errors.lost.iter_mut().enumerate() {
            add(count, inputs.readings.lost >> bit & 1 != 0);
        }
        for (bit, count) in errors.saturated.iter_mut().enumerate() {
            add(count, outputs.saturated >> bit & 1 != 0);
        }
        add(&mut errors.unusable, outputs.filter.bad_input);
        errors.damaged = u16::try_from(asked.damaged).unwrap_or(u16::MAX);
        errors.tick_cycles = errors.tick_cycles.max(asked.cycles);
        if let Some(before) = self.before.replace(inputs.now) {
            let span = u32::try_from(inputs.now.since(before).0).unwrap_or(u32::MAX);
            errors.tick_span = match errors.tick_span {
                [0, 0] => [span; 2],
                [low, high] => [low.min(span), high.max(span)],
            };
        }
    }

    fn stream(&self, inputs: &Inputs, outputs: &Outputs, say: Say<'_>) {
        let format = self.settings.format;
        if let Some(sample) = outputs.sample {
            if self.settings.content != ImuContent::Calibrated {
                say(format, &Message::Imu(sample));
            }
            if self.settings.content != ImuContent::Raw {
                let of = |v: Option<dcm::Vec3>| v.map_or([f32::NAN; 3], Into::into);
                let read = &outputs.calibrated;
                let (gyro, accel, mag) = (of(read.gyro), of(read.accel), of(read.mag));
                let (at, fresh, quaternion_q30) = (sample.at, sample.fresh, sample.quaternion_q30);
                say(format, &Message::ImuValues(ImuValues { at, gyro, accel, mag, fresh, quaternion_q30 }));
            }
        }
        if let Some(words) = inputs.readings.test {
            let words = self.test_mounting.to_body(words);
            say(format, &Message::TestAccel(TestAccel { at: inputs.now, words }));
        }
    }

    /// Puts a calibration in force, if there is one, and reports.
    fn tell(&mut self, (calibration, report): &News, say: Say<'_>) {
        if let Some(calibration) = calibration {
            self.settings.calibration = *calibration;
            self.ahrs.calibrate(calibration);
        }
        say(self.settings.format, &Message::ImuReport(*report));
    }

    fn finished(&mut self, done: &Done, say: Say<'_>) {
        self.busy = false;
        if let Some(news) = fitted(done, &self.settings.calibration) {
            self.tell(&news, say);
        }
        match *done {
            Done::Saved(news) => say(self.settings.format, &Message::Event(Event::Settings(news))),
            Done::Loaded(found, news) => {
                if let Some(settings) = found {
                    self.put_in_force(settings);
                }
                say(self.settings.format, &Message::Event(Event::Settings(news)));
            }
            _ => {}
        }
    }

    fn put_in_force(&mut self, settings: Settings) {
        self.settings = settings;
        self.ahrs.calibrate(&settings.calibration);
    }

    /// Does what is asked and answers; what the answer depends on the idle loop for is answered when that is done.
    fn obey(&mut self, command: Command, say: Say<'_>) -> Result<Option<Job>, Refusals> {
        let must_wait = Refusals(Refusals::WRONG_STATE);
        let free = if self.busy { Err(must_wait) } else { Ok(()) };
        match command {
            Command::Ping => return Ok(None),
            Command::Identify => {
                self.hello.present = self.errors.alive;
                say(self.settings.format, &Message::Hello(self.hello));
                return Ok(None);
            }
            Command::Imu(asked) => match asked {
                ImuCommand::Format(format) => self.settings.format = format,
                ImuCommand::Content(content) => self.settings.content = content,
                ImuCommand::Stream(on) => self.settings.stream = on,
                ImuCommand::Once => self.once = true,
                ImuCommand::Calibrate(sensor) => {
                    free?;
                    self.calibrator.begin(sensor);
                }
                ImuCommand::Cancel => self.calibrator.cancel(),
                ImuCommand::Finish => {
                    free?;
                    match self.calibrator.finish().ok_or(must_wait)? {
                        Ok(job) => return Ok(Some(job)),
                        Err(report) => say(self.settings.format, &Message::ImuReport(report)),
                    }
                    return Ok(None);
                }
                ImuCommand::Save => return free.map(|()| Some(Job::Save(self.settings))),
                ImuCommand::Load => return free.map(|()| Some(Job::Load)),
                ImuCommand::Factory => self.put_in_force(Settings::default()),
                ImuCommand::Errors => {
                    say(self.settings.format, &Message::ImuReport(ImuReport::Errors(self.errors)));
                    return Ok(None);
                }
            },
            _ => return Err(must_wait), // of the other board
        }
        say(self.settings.format, &Message::Event(Event::Accepted));
        Ok(None)
    }
}
