//! `quadrig rig burst`: every conversion of one channel, and the spectrum of what vibrates in it.
//!
//! What it is: asks the board for a burst, puts its parts together, writes them as a log of their own and shows the strongest lines of the
//! spectrum, with their order where the rotor turns.
//! What can go wrong: a part that the line lost: the burst is asked for again, a few times.
//! Units: Hz; the channel's own.
//! Reference: specification `rig.md`, "On a real bench"; Harris 1978, "On the use of windows for harmonic analysis" (Hann).

use super::configure;
use crate::Failure;
use crate::apart::Paths;
use crate::board::{Board, Heard, refused};
use crate::replace::put;
use firmware_rig::burst::LENGTH;
use frame::Consensus;
use frame::calibration::Calibration;
use frame::message::{BurstPart, Command, Event, Message};
use frame::rig::{ADC_NAMES, RigSample};
use std::f64::consts::TAU;
use std::fmt::Write;
use std::path::PathBuf;
use std::time::Duration;

/// A board that records slowly (a simulated one: 8500 conversions a second) needs three seconds, and the line half a second.
const PATIENCE: Duration = Duration::from_secs(10);
/// Times that a burst is asked for.
const TRIES: usize = 3;
/// Lines that are shown.
const SHOWN: usize = 8;
/// Times the spectrum's median from which on a line stands out.
const STANDS_OUT: f64 = 6.0;

/// Arguments.
#[derive(clap::Args)]
pub(super) struct Args {
    /// Channel: thrust, torque, current, voltage or temperature.
    channel: String,
    /// Where every conversion goes (CSV).
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Where the spectrum goes (CSV).
    #[arg(long)]
    spectrum: Option<PathBuf>,
    /// Highest frequency of the spectrum, Hz.
    #[arg(long, default_value_t = 1000.0, value_parser = crate::number::positive(1e6, "Hz"))]
    to: f64,
}

impl Args {
    /// What it writes.
    pub(super) fn paths<'a>(&'a self, paths: Paths<'a>) -> Paths<'a> {
        paths.writes("-o", &self.output).writes("--spectrum", &self.spectrum)
    }
}

/// A whole burst.
struct Burst {
    rate_hz: f64,
    codes: Vec<u16>,
    calibration: Calibration,
    /// Rotor speed in the meantime, rev/min.
    rpm: Option<f64>,
}

/// Runs the command.
pub(super) fn run(board: &mut Board, args: &Args, quiet: bool) -> Result<(), Failure> {
    let place = super::file::ANALOGUE.iter().position(|n| *n == args.channel).ok_or_else(|| {
        format!("{:?}: no such channel; expected one that the board samples: {}", args.channel, super::file::ANALOGUE.join(", "))
    })?;
    if !configure::in_force(board)?.fitted[place] {
        return Err(
            format!("{} is not fitted on this board; expected a channel of `quadrig rig identify`", ADC_NAMES[place]).into()
        );
    }
    let burst = recorded(board, place)?;
    let scale = burst.calibration.adc[place];
    let values: Vec<f64> = burst.codes.iter().map(|c| (f64::from(*c) - f64::from(scale.zero)) * f64::from(scale.gain)).collect();
    let lines = spectrum(&values, burst.rate_hz, args.to);
    if let Some(path) = &args.output {
        let text = conversions(place, &burst, &values);
        put(path, &text)?;
    }
    if let Some(path) = &args.spectrum {
        let mut text = format!("frequency_hz,{}\n", ADC_NAMES[place]);
        for (hz, amplitude) in &lines {
            let _ = writeln!(text, "{hz:.3},{amplitude:.7}");
        }
        put(path, &text)?;
    }
    if !quiet {
        crate::say::text(&shown(place, &burst, &values, &lines));
    }
    Ok(())
}

/// Asks until a burst has come whole.
fn recorded(board: &mut Board, place: usize) -> Result<Burst, Failure> {
    let mut calibration = None;
    board.ask(
        Command::Identify,
        |_| {},
        |m| if let Message::Calibration(told) = m { calibration.replace(*told).or(Some(*told)).map(|_| ()) } else { None },
    )?;
    let calibration = calibration.ok_or("the board tells no calibration; expected a rig board: `quadrig rig identify`")?;
    for _ in 0..TRIES {
        if let Some((rate_hz, codes, rpm)) = once(board, place, &calibration)? {
            return Ok(Burst { rate_hz, codes, calibration, rpm });
        }
    }
    Err(format!(
        "parts of the burst were lost on the line, {TRIES} times; expected a sound line: `quadrig rig status` counts its damage"
    )
    .into())
}

type Whole = (f64, Vec<u16>, Option<f64>);

/// One burst; `None` when a part of it was lost.
fn once(board: &mut Board, place: usize, calibration: &Calibration) -> Result<Option<Whole>, Failure> {
    let mut codes = Vec::with_capacity(LENGTH);
    let mut speeds = Vec::new();
    board.send(Command::Burst { channel: place as u8 })?;
    let until = board.now() + PATIENCE;
    while board.now() < until {
        let Heard::Messages(messages) = board.hear() else { return Err(board.gone().into()) };
        for received in messages {
            match received.message {
                Message::Event(Event::Refused(reasons)) => {
                    return Err(refused(&reasons.words().collect::<Vec<_>>().join("; ")).into());
                }
                Message::Rig(sample) => speeds.extend(speed(calibration, &sample)),
                Message::BurstPart(part) if usize::from(part.channel) == place => {
                    if usize::from(part.at) != codes.len() {
                        return Ok(None);
                    }
                    take(&mut codes, &part);
                    if codes.len() == usize::from(part.length) {
                        let rpm = (!speeds.is_empty()).then(|| speeds.iter().sum::<f64>() / speeds.len() as f64);
                        return Ok(Some((f64::from(part.rate_hz), codes, rpm)));
                    }
                }
                _ => {}
            }
        }
        board.keep_alive()?;
    }
    Ok(None)
}

fn take(codes: &mut Vec<u16>, part: &BurstPart) {
    let rest = usize::from(part.length) - codes.len();
    codes.extend(part.codes.iter().flatten().take(rest));
}

/// Rotor speed of a sample, where it turns.
fn speed(calibration: &Calibration, sample: &RigSample) -> Option<f64> {
    let values = calibration.convert(sample);
    Consensus::of(&values.rpm, &sample.rpm.map(|c| c.verdict)).map(|c| c.rpm).filter(|rpm| *rpm > 0.0)
}

/// Amplitude at each frequency up to `most_hz`, with a Hann window.
fn spectrum(values: &[f64], rate_hz: f64, most_hz: f64) -> Vec<(f64, f64)> {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let windowed: Vec<f64> =
        values.iter().enumerate().map(|(k, v)| (v - mean) * (1.0 - (TAU * (k as f64 + 0.5) / n).cos())).collect();
    let bins = ((most_hz / rate_hz * n) as usize).min(values.len() / 2);
    (1..=bins)
        .map(|bin| {
            let turn = TAU * bin as f64 / n;
            let (step_re, step_im) = (turn.cos(), turn.sin());
            let (mut re, mut im, mut c, mut s) = (0.0, 0.0, 1.0, 0.0);
            for v in &windowed {
                (re, im) = (re + v * c, im + v * s);
                (c, s) = (c * step_re - s * step_im, c * step_im + s * step_re);
            }
            (rate_hz * bin as f64 / n, 2.0 * re.hypot(im) / n)
        })
        .collect()
}

/// The lines that stand out, the strongest first: frequency between the bins, and amplitude.
fn peaks(lines: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut all: Vec<f64> = lines.iter().map(|l| l.1).collect();
    all.sort_unstable_by(f64::total_cmp);
    let usual = all.get(all.len() / 2).copied().unwrap_or(0.0);
    let mut found: Vec<(f64, f64)> = lines
        .windows(3)
        .filter(|w| w[1].1 > w[0].1 && w[1].1 >= w[2].1 && w[1].1 > STANDS_OUT * usual)
        .map(|w| {
            // of a Hann window, a parabola through the logarithms finds the place to a few hundredths of a bin
            let [a, b, c] = [w[0].1, w[1].1, w[2].1].map(|v| v.max(1e-30).ln());
            let off = 0.5 * (a - c) / (a - 2.0 * b + c);
            (w[1].0 + off * (w[2].0 - w[1].0), (b - 0.25 * (a - c) * off).exp())
        })
        .collect();
    found.sort_unstable_by(|a, b| b.1.total_cmp(&a.1));
    found.truncate(SHOWN);
    found
}

fn shown(place: usize, burst: &Burst, values: &[f64], lines: &[(f64, f64)]) -> String {
    let unit = ["N", "N.m", "A", "V", "degC"][place];
    let (n, rate) = (values.len() as f64, burst.rate_hz);
    let mean = values.iter().sum::<f64>() / n;
    let rms = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
    let mut out = format!(
        "{}: {n} conversions at {rate:.1} a second, {:.3} s\nmean {mean:.5} {unit}, rms about it {rms:.5} {unit}\n",
        ADC_NAMES[place],
        n / rate
    );
    match burst.rpm {
        Some(rpm) => drop(writeln!(out, "rotor {rpm:.0} rev/min, {:.2} Hz", rpm / 60.0)),
        None => out.push_str("the rotor stands, or nothing sees it turn\n"),
    }
    let peaks = peaks(lines);
    if peaks.is_empty() {
        out.push_str("no line stands out\n");
    }
    for (hz, amplitude) in peaks {
        let order = burst.rpm.map_or_else(String::new, |rpm| format!("  {:.2} times the rotor", hz * 60.0 / rpm));
        let _ = writeln!(out, "{hz:>9.2} Hz {amplitude:>10.5} {unit}{order}");
    }
    out
}

/// The log of a burst.
fn conversions(place: usize, burst: &Burst, values: &[f64]) -> String {
    let name = ADC_NAMES[place];
    let mut out = format!("# quadrig-log 1\n# burst = {name:?}\n# sample_hz = {:?}\nt_s,{name},raw_{name}_code\n", burst.rate_hz);
    for (k, (value, code)) in values.iter().zip(&burst.codes).enumerate() {
        let _ = writeln!(out, "{:.9},{value:.6},{code}", k as f64 / burst.rate_hz);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two lines and noise: each is found at its place with its amplitude, and nothing else.
    #[test]
    fn lines_are_found_where_they_are_with_their_amplitudes() {
        let rate = 61_764.7;
        let mut seed = 7u64;
        let values: Vec<f64> = (0..LENGTH)
            .map(|k| {
                seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                let noise = (seed >> 40) as f64 / f64::from(1 << 24) - 0.5;
                let t = k as f64 / rate;
                2.0 + 0.2 * (TAU * 41.9 * t).sin() + 0.05 * (TAU * 136.7 * t + 1.0).sin() + 0.02 * noise
            })
            .collect();
        let found = peaks(&spectrum(&values, rate, 1000.0));
        assert_eq!(found.len(), 2, "{found:?}");
        for ((hz, amplitude), (wanted_hz, wanted)) in found.iter().zip([(41.9, 0.2), (136.7, 0.05)]) {
            assert!((hz - wanted_hz).abs() < 0.3 && (amplitude / wanted - 1.0).abs() < 0.03, "{hz} Hz {amplitude}");
        }
    }
}
