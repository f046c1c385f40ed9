//! A rig's channel calibrated live, over the line to the board.
//!
//! What it is: asks for one known value after the other, waits until the channel has settled, fits, shows, and stores on the board.
//! What can go wrong: a board that is not disarmed and at rest; a point that is saturated or does not settle is refused and asked for again.
//! Nothing is stored then, nor when the operator says no.
//! Units: counts, s; the channel's own.
//! Reference: specification `rig.md`, "Partial rigs are normal" ("Calibration with residuals"), "The operator's side".

use super::Args;
use super::channel::Channel;
use super::found::{Found, Taken};
use super::point::{Point, list, point};
use super::settle::Reading;
use super::settling::{Settling, at_rest};
use crate::Failure;
use crate::board::{Board, Heard};
use crate::replace::put;
use crate::rig::{configure, lines};
use firmware_rig::Config;
use frame::message::Message;
use frame::rig::RigSample;
use std::io::{IsTerminal, Write};
use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::Duration;
use virtual_board::Hand;

/// The conversation.
struct Talk<'b> {
    board: &'b mut Board,
    input: Receiver<String>,
    channel: Channel,
    /// The latest sample.
    latest: Option<RigSample>,
}

/// Runs the command.
pub(super) fn run(channel: Channel, points: Option<&str>, day: u16, args: &Args, quiet: bool) -> Result<(), Failure> {
    let mut board = Board::open(&args.port)?;
    let mut config = configure::in_force(&mut board)?;
    let place = channel.place();
    if !config.fitted[place] {
        return Err(format!(
            "{} is not fitted on this board; expected it in its configuration: `quadrig rig configure`",
            channel.column()
        )
        .into());
    }
    let arm_m = args.arm.unwrap_or_else(|| f64::from(config.torque.arm_m));
    let wanted = points.map(|text| list(channel, text, arm_m)).transpose()?;
    if let Some(timed) = wanted.iter().flatten().find(|p| p.window.is_some()) {
        return Err(format!("{}: a time belongs to a recording; expected values alone, or -i RECORDING", timed.said).into());
    }
    let whole = config.apply(&Config::thesis_570kv());
    let [design, now] = [whole.design(), whole.calibration()].map(|scales| f64::from(scales.adc[place].gain));
    let mut talk = Talk { board: &mut board, input: lines(), channel, latest: None };
    let taken = match wanted {
        Some(points) => talk.each(points)?,
        None => talk.as_they_come(arm_m)?,
    };
    let found = Found::of(channel, taken, Some(design), day, arm_m)?;
    if !quiet {
        say!("{}in force so far: {now:.8} {} a count", found.table(), channel.unit());
    }
    if !args.yes && !talk.agrees()? {
        return Err("nothing was stored: expected y to store; calibrate again, or with --yes".into());
    }
    config.calibrated[place] = Some(found.calibrated());
    configure::send(&mut board, &config)?;
    if let Some(output) = &args.output {
        put(output, &found.toml(&board.name()))?;
    }
    if !quiet {
        say!("in force and stored; tare anew before the next run");
    }
    Ok(())
}

impl Talk<'_> {
    /// Takes each of the points that were given.
    fn each(&mut self, points: Vec<Point>) -> Result<Vec<Taken>, Failure> {
        let mut taken = Vec::new();
        for point in points {
            loop {
                say!("{}: {} on, then press enter", self.channel.column(), point.said);
                self.line()?
                    .ok_or("the input ended before all points were taken; nothing was stored; expected a line for each point")?;
                if let Some(reading) = self.settled(&point.said)? {
                    taken.push(Taken { point, reading });
                    break;
                }
            }
        }
        Ok(taken)
    }

    /// Takes points as the operator names them, until an empty line.
    fn as_they_come(&mut self, arm_m: f64) -> Result<Vec<Taken>, Failure> {
        let mut taken = Vec::new();
        let example = ["0 g", "0 g", "0 A", "9.0 V", "20 C"][self.channel.place()];
        loop {
            say!("{}: put a known value on and type it ({example}); an empty line ends", self.channel.column());
            let Some(line) = self.line()? else { break };
            if line.trim().is_empty() {
                break;
            }
            match point(self.channel, &line, arm_m) {
                Ok(point) => taken.extend(self.settled(&point.said)?.map(|reading| Taken { point, reading })),
                Err(mistake) => note!("{mistake}"),
            }
        }
        Ok(taken)
    }

    /// Whether the operator wants it stored.
    fn agrees(&mut self) -> Result<bool, Failure> {
        say!("press enter to store it on the board; type no to leave everything as it was");
        Ok(self.line()?.is_some_and(|line| matches!(line.trim(), "" | "y" | "yes")))
    }

    /// The next line of the operator; the board is heard meanwhile, so that what is read later is not what was there before.
    fn line(&mut self) -> Result<Option<String>, Failure> {
        loop {
            match self.input.try_recv() {
                Ok(line) => match line.trim_start().strip_prefix("bench ").filter(|_| self.board.is_virtual()) {
                    Some(words) => {
                        match Hand::parse(words.trim()).map_err(Into::into).and_then(|hand| self.board.hand(&hand).map(|()| hand))
                        {
                            Ok(hand) => say!("{}", hand.words()),
                            Err(why) => note!("{why}"),
                        }
                    }
                    None => return Ok(Some(line)),
                },
                Err(TryRecvError::Disconnected) => return Ok(None),
                Err(TryRecvError::Empty) => drop(self.hear()?),
            }
        }
    }

    /// The samples that came.
    fn hear(&mut self) -> Result<Vec<RigSample>, Failure> {
        let Heard::Messages(messages) = self.board.hear() else {
            return Err(format!(
                "{}; nothing was stored; expected the port to stay: plug it in and begin again",
                self.board.gone()
            )
            .into());
        };
        let samples = messages.iter().filter_map(|m| if let Message::Rig(sample) = m.message { Some(sample) } else { None });
        let samples: Vec<RigSample> = samples.collect();
        self.latest = samples.last().copied().or(self.latest);
        Ok(samples)
    }

    /// Waits until the channel has settled; `None` when it does not, which has been told.
    fn settled(&mut self, said: &str) -> Result<Option<Reading>, Failure> {
        let mut settling = Settling::new(self.channel, self.board.now());
        let mut shown = self.board.now();
        let why = loop {
            for sample in self.hear()? {
                at_rest(&sample)?;
                settling.take(&sample);
            }
            match settling.look(self.board.now()) {
                Some(Ok(reading)) => {
                    self.clear();
                    say!("{said}: {:.3} counts, known to {:.3}", reading.counts, reading.sigma);
                    return Ok(Some(reading));
                }
                Some(Err(why)) => break why,
                None => {}
            }
            if self.board.now() > shown + Duration::from_millis(200) {
                shown = self.board.now();
                self.show(&settling);
            }
        };
        self.clear();
        note!("{}, {said}: {why}", self.channel.column());
        Ok(None)
    }

    /// What the channel reads meanwhile, on a terminal.
    fn show(&self, settling: &Settling) {
        if let Some(counts) = settling.counts().filter(|_| std::io::stderr().is_terminal()) {
            let mut out = std::io::stderr().lock();
            let _ = write!(out, "\r  settling: {counts:>9.2} counts").and_then(|()| out.flush());
        }
    }

    fn clear(&self) {
        if std::io::stderr().is_terminal() {
            let _ = write!(std::io::stderr(), "\r{:40}\r", ""); // as above: a terminal that is gone
        }
    }
}
