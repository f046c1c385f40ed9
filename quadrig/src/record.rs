//! `quadrig log`: records from the rig board.
//!
//! What it is: samples become rows of a rig log as they arrive; on a terminal, a live line.
//! What can go wrong: damaged frames are counted and cost themselves alone; an unplugged port is waited for, and what arrived stays; a
//! full disk is handled by [`crate::spool`]; a board that sends no calibration is refused, because raw codes alone are no log.
//! Units: as in the log.
//! Reference: specification `formats.md`, "Rig log" and "Command line".

use crate::Failure;
use crate::board::{Board, Heard};
use crate::end::Ended;
use crate::port::PortArgs;
use crate::spool::Spool;
use frame::Consensus;
use frame::calibration::{Calibration, Converted};
use frame::message::{Command, Event, Hello, Message};
use frame::rig::{ADC_NAMES, CAPTURE_NAMES, RigSample, UNEVEN_NAMES};
use frame::units::Ticks;
use indicatif::ProgressBar;
use std::fmt::Write;
use std::io::IsTerminal;
use std::path::PathBuf;
use std::sync::mpsc::TryRecvError;
use std::time::{Duration, Instant};

/// How long the board may take to say who it is.
const CALIBRATION_TIME: Duration = Duration::from_secs(3);
/// Time between two questions for it.
const ASK_AGAIN: Duration = Duration::from_millis(500);
/// Samples before the head is written: they tell the rate.
const HEAD_AFTER: usize = 3;

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    port: PortArgs,
    /// Log to write.
    #[arg(short, long)]
    output: PathBuf,
    /// Stop after so many seconds of the board's time; without it, record until the port is gone or Ctrl-D or Ctrl-C is typed.
    #[arg(long)]
    seconds: Option<f64>,
    /// How long an unplugged port is waited for, s.
    #[arg(long, default_value_t = 5.0)]
    wait: f64,
    /// Motor, for the log's head.
    #[arg(long)]
    motor: Option<String>,
    /// Propeller, for the log's head.
    #[arg(long)]
    propeller: Option<String>,
}

/// Turns messages into rows of a log.
pub(crate) struct Recorder {
    spool: Spool,
    head: Vec<(&'static str, String)>,
    calibration: Option<Calibration>,
    board: Option<Hello>,
    /// Capture channels with two marks, as the head of the log says.
    paired: Vec<usize>,
    early: Vec<RigSample>,
    started: bool,
    first: Option<Ticks>,
    offset_s: f64,
    last_s: f64,
    /// Rows so far.
    pub(crate) rows: usize,
    /// Sum of squares, worst and number of each channel's deviation from the consensus.
    deviation: [(f64, f64, u32); 4],
    live: Option<ProgressBar>,
}

impl Recorder {
    /// A recorder into `target`.
    pub(crate) fn new(target: &std::path::Path, head: Vec<(&'static str, String)>, quiet: bool) -> Result<Self, Failure> {
        let live = (!quiet && std::io::stderr().is_terminal()).then(ProgressBar::new_spinner);
        Ok(Self {
            spool: Spool::create(target)?,
            head,
            calibration: None,
            board: None,
            paired: Vec::new(),
            early: Vec::new(),
            started: false,
            first: None,
            offset_s: 0.0,
            last_s: -1.0,
            rows: 0,
            deviation: [(0.0, 0.0, 0); 4],
            live,
        })
    }

    /// Nothing worth keeping was heard: no file is left behind.
    pub(crate) fn discard(self) {
        self.spool.discard();
    }

    /// The board has told how its codes are meant.
    pub(crate) fn knows_its_board(&self) -> bool {
        self.calibration.is_some()
    }

    /// Time of the last row, s.
    pub(crate) fn seconds(&self) -> f64 {
        self.last_s
    }

    /// Takes one message.
    pub(crate) fn take(&mut self, message: &Message) {
        match message {
            Message::Calibration(calibration) => {
                self.calibration = Some(*calibration);
                self.begin();
            }
            Message::Rig(sample) if self.started => self.row(sample),
            Message::Rig(sample) => {
                self.early.push(*sample);
                self.begin();
            }
            Message::Hello(hello) if !self.started => self.board = Some(*hello),
            Message::Event(Event::Faults { faults, .. }) => {
                let words: Vec<&str> = faults.iter().map(frame::Fault::words).collect();
                self.say(&format!("latched: {}", words.join(", ")));
            }
            _ => {}
        }
    }

    fn say(&self, line: &str) {
        match &self.live {
            Some(bar) => bar.println(line),
            None => eprintln!("{line}"),
        }
    }

    /// Writes the head once the scales and the rate are known, and the rows that came before.
    fn begin(&mut self) {
        let Some(calibration) = self.calibration.filter(|_| !self.started && self.early.len() >= HEAD_AFTER) else { return };
        self.paired = paired(&calibration);
        let early = std::mem::take(&mut self.early);
        let steps: Vec<f64> = early.windows(2).map(|w| w[1].at.since(w[0].at).as_s()).collect();
        let step = steps.iter().copied().filter(|s| *s > 0.0).fold(f64::INFINITY, f64::min);
        let mut text = String::from("# quadrig-log 1\n");
        for (key, value) in &self.head {
            let _ = writeln!(text, "# {key} = {}", toml::Value::String(value.clone()));
        }
        if let Some(Hello { firmware: [major, minor, patch], config, .. }) = self.board {
            let _ = writeln!(text, "# firmware = \"rig {major}.{minor}.{patch}\"");
            let _ = writeln!(text, "# config_crc32 = \"{config:08x}\"");
        }
        if step.is_finite() {
            let _ = writeln!(text, "# sample_hz = {:?}", (1.0 / step * 100.0).round() / 100.0);
        }
        text.push_str(&columns(&self.paired));
        if let Some(warning) = self.spool.add(&text) {
            self.say(&warning);
        }
        self.started = true;
        early.iter().for_each(|sample| self.row(sample));
    }

    fn row(&mut self, sample: &RigSample) {
        let Some(calibration) = self.calibration else { return };
        let first = *self.first.get_or_insert(sample.at);
        if sample.at < first || self.offset_s + sample.at.since(first).as_s() <= self.last_s {
            // the board was reset: its clock begins anew, the log's goes on a step later
            self.first = Some(sample.at);
            self.offset_s = self.last_s + 0.1;
            self.say("the board was reset; the log goes on");
        }
        let t_s = self.offset_s + sample.at.since(self.first.unwrap_or(first)).as_s();
        let values = calibration.convert(sample);
        if let Some(warning) = self.spool.add(&cells(t_s, &values, &self.paired)) {
            self.say(&warning);
        }
        self.rows += 1;
        self.last_s = t_s;
        self.watch(sample, &values);
    }

    /// Live line and the account of disagreement.
    fn watch(&mut self, sample: &RigSample, values: &Converted) {
        let consensus = Consensus::of(&values.rpm, &sample.rpm.map(|c| c.verdict));
        if let Some(consensus) = &consensus {
            for ((square, worst, n), deviation) in self.deviation.iter_mut().zip(consensus.deviation) {
                if let Some(d) = deviation {
                    *square += d * d;
                    *worst = worst.max(d.abs());
                    *n += 1;
                }
            }
        }
        if let Some(bar) = &self.live {
            let number = |v: Option<f64>, digits: usize| v.map_or("-".to_owned(), |v| format!("{v:.digits$}"));
            let [thrust, _, current, voltage, _] = values.adc;
            bar.set_message(format!(
                "{:8.1} s  {:?}  {:.0} us  {} rev/min  {} N  {} A  {} V  {} rows",
                self.last_s,
                sample.state,
                values.pulse_us,
                number(consensus.map(|c| c.rpm), 0),
                number(thrust, 3),
                number(current, 2),
                number(voltage, 2),
                self.rows
            ));
            bar.tick();
        }
    }

    /// Ends the log; one line of summary for people.
    pub(crate) fn finish(self, board: &Board, quiet: bool) -> Result<(), Failure> {
        if let Some(bar) = &self.live {
            bar.finish_and_clear();
        }
        let stats = board.stats();
        if !quiet {
            eprintln!("{} rows; {} good frames, {} damaged, {} missing", self.rows, stats.good, stats.damaged, stats.missing);
            for (name, (square, worst, n)) in CAPTURE_NAMES.iter().zip(self.deviation).filter(|(_, (_, _, n))| *n > 0) {
                let rms = (square / f64::from(n)).sqrt();
                eprintln!("{name:>12}: {:.3} % rms from the consensus, {:.3} % at most", rms * 100.0, worst * 100.0);
            }
        }
        if self.rows == 0 {
            self.spool.discard();
            return Err("no sample arrived; nothing was recorded".into());
        }
        self.spool.finish()
    }
}

/// Capture channels with two marks, which tell how unevenly these stand.
fn paired(calibration: &Calibration) -> Vec<usize> {
    (0..CAPTURE_NAMES.len()).filter(|i| calibration.marks[*i] == 2).collect()
}

/// The line of a log that names its columns; `paired` are the capture channels with two marks.
fn columns(paired: &[usize]) -> String {
    let uneven: String = paired.iter().map(|i| format!(",{}", UNEVEN_NAMES[*i])).collect();
    format!("t_s,pulse_us,{},{},thrust_rms_n{uneven}\n", CAPTURE_NAMES.join(","), ADC_NAMES.join(","))
}

/// One row under [`columns`]: what is not known is an empty cell.
fn cells(t_s: f64, values: &Converted, paired: &[usize]) -> String {
    let mut line = format!("{t_s:.4},{:.3}", values.pulse_us);
    let uneven = paired.iter().map(|i| &values.uneven_deg[*i]);
    for value in values.rpm.iter().chain(&values.adc).chain([&values.thrust_rms_n]).chain(uneven) {
        line.push(',');
        if let Some(value) = value.filter(|v| v.is_finite()) {
            let _ = write!(line, "{value:.6}");
        }
    }
    line.push('\n');
    line
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let mut board = Board::open(&args.port)?;
    let named = [("motor", &args.motor), ("propeller", &args.propeller)];
    let head = named.into_iter().filter_map(|(key, value)| Some((key, value.clone()?))).collect();
    let mut recorder = Recorder::new(&args.output, head, quiet)?;
    let signals = Ended::watch()?;
    let begun = board.now();
    let mut asked: Option<Duration> = None;
    let end = std::io::stdin().is_terminal().then(crate::rig::lines);
    let ended = loop {
        if !recorder.knows_its_board() && asked.is_none_or(|at| board.now() > at + ASK_AGAIN) {
            let _ = board.send(Command::Identify); // a port that is gone shows in the next read
            asked = Some(board.now());
        }
        match board.hear() {
            Heard::Messages(messages) => messages.iter().for_each(|m| recorder.take(&m.message)),
            Heard::Gone => {
                let gone = Instant::now();
                let mut back = false;
                while !back && gone.elapsed().as_secs_f64() < args.wait {
                    std::thread::sleep(Duration::from_millis(50));
                    back = board.reopen();
                }
                if !back {
                    break Err(board.gone());
                }
                let _ = board.send(Command::Identify); // the board may be another one, or tared anew
            }
        }
        if !recorder.knows_its_board() && board.now() > begun + CALIBRATION_TIME {
            recorder.spool.discard();
            let cause = match board.stats().foreign {
                0 => "is it a rig board at 921600 baud?",
                _ => "its frames are of another version than this program's: flash the board with the image of the same release",
            };
            return Err(format!("{}: no calibration from the board; {cause}", board.name()).into());
        }
        let enough = args.seconds.is_some_and(|s| recorder.seconds() >= s);
        let typed_end = end.as_ref().is_some_and(|end| matches!(end.try_recv(), Err(TryRecvError::Disconnected)));
        if enough || typed_end || signals.now() {
            break Ok(());
        }
    };
    let rows = recorder.rows;
    recorder.finish(&board, quiet)?;
    ended.map_err(|e| format!("{e}; the {rows} rows that arrived are in {}", args.output.display()).into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use frame::calibration::AdcScale;
    use frame::rig::CaptureCode;
    use ident::log::Log;

    /// Every value stands under its own name, also where a channel without two marks lies between those that have them.
    #[test]
    fn what_the_board_tells_of_its_marks_stands_under_its_channels_name() {
        let marks = [2, 1, 2, 25];
        let calibration = Calibration { timer_hz: 84_000_000, marks, adc: [AdcScale { zero: 0.0, gain: 1.0 }; 5] };
        let code = |i: usize, uneven: u16| CaptureCode { edges: marks[i], span: 840_000, uneven, ..CaptureCode::default() };
        let sample = |uneven: [u16; 4]| RigSample { rpm: std::array::from_fn(|i| code(i, uneven[i])), ..RigSample::default() };
        let paired = paired(&calibration);
        let mut text = format!("# quadrig-log 1\n{}", columns(&paired));
        for (k, uneven) in [[1000, 3000, 500, 3000], [1000, 0, 0, 0], [0, 0, 2000, 0]].into_iter().enumerate() {
            text.push_str(&cells(0.1 * k as f64, &calibration.convert(&sample(uneven)), &paired));
        }
        let log = Log::parse("run.csv", text.as_bytes()).expect("a log");
        let told = |name: &str| log.column(name).map(|v| v.iter().map(|a| a.is_finite().then_some(*a)).collect::<Vec<_>>());
        assert_eq!(told("uneven_beam_deg"), Some(vec![Some(9.0), Some(9.0), None]));
        assert_eq!(told("uneven_hall_deg"), Some(vec![Some(4.5), None, Some(18.0)]));
        assert_eq!((told("uneven_opto_deg"), told("uneven_encoder_deg")), (None, None), "these have no pair of marks");
        assert_eq!(told("rpm_encoder").map(|v| v.len()), Some(3));
    }
}
