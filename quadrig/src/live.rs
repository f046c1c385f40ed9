//! The live view of a simulated run.
//!
//! What it is: the terminal view of a rig, fed with what the simulated board sends, in step with the clock times a factor; keys pause it, take single
//! steps, change the speed or end it. Without a terminal one line ten times a simulated second, and lines on the standard input. Ctrl-C and a
//! terminal that goes away end it as `q` does: what was flown until then is kept.
//! What can go wrong: a machine that cannot keep up shows a lower factor than asked; nothing else changes, the bytes are the same.
//! Units: s, rev/min, N, A.
//! Reference: specification `rig.md`, "The simulator".

use crate::Failure;
use crate::end::Ended;
use crate::view::keys::Wish as Key;
use crate::view::{Live, Screen, Terminal};
use firmware_rig::RigConfig;
use frame::message::Message;
use frame::wire::Decoder;
use hal_sim::Scenario;
use hal_sim::native::{Session, firmware_config};
use std::io::{BufRead, IsTerminal, Write};
use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError, channel};
use std::time::{Duration, Instant};

/// Simulated milliseconds between two lines, and in a single step.
const REFRESH_MS: u32 = 100;
/// Simulated milliseconds between two looks at the keys.
const LOOK_MS: u32 = 10;

/// Longest sleep between two looks at whether an end has come.
const LOOK: Duration = Duration::from_millis(50);

/// What the viewer asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Wish {
    Pause,
    Step,
    Speed(f64),
    Quit,
}

/// The wish of one input line.
fn wish(line: &str) -> Option<Wish> {
    match line.trim() {
        "p" | "" => Some(Wish::Pause),
        "s" => Some(Wish::Step),
        "q" => Some(Wish::Quit),
        number => number.parse().ok().filter(|f: &f64| f.is_finite() && *f >= 0.0).map(Wish::Speed),
    }
}

fn wishes() -> Receiver<Wish> {
    let (send, receive) = channel();
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines().map_while(Result::ok) {
            match wish(&line) {
                Some(wish) if send.send(wish).is_err() => return,
                Some(_) => {}
                None => note!("expected p, s, q or a speed, found {line:?}"),
            }
        }
    });
    receive
}

/// Shows the run in the terminal view to its end or until the viewer has had enough, which it tells. What was flown until then is kept.
pub(crate) fn view(session: &mut Session, scenario: &Scenario, speed: f64) -> Result<bool, Failure> {
    let ended = Ended::watch()?;
    let mut terminal = Terminal::take()?;
    let mut screen = Screen::new(format!("simulated rig  {}", scenario.name));
    screen.configured(&RigConfig::of(&firmware_config(scenario)));
    let mut live = Live { speed, paused: false, share: 0.0 };
    let (mut decoder, mut read) = (Decoder::default(), 0);
    let (mut from_s, mut begun) = (session.now_s(), Instant::now());
    let mut running = true;
    while running && !ended.now() {
        screen.live = Some(live);
        let mut steps = if live.paused { 0 } else { LOOK_MS };
        let Ok(keys) = terminal.keys() else { return Ok(true) }; // the terminal went away: an end like any other
        for key in keys {
            match screen.key(key) {
                Some(Key::Quit | Key::Stop) => return Ok(true),
                Some(Key::Pause) => live.paused = !live.paused,
                Some(Key::Step) => (live.paused, steps) = (true, REFRESH_MS),
                Some(Key::Speed(factor)) => (live.speed, live.paused) = (factor, false),
                _ => continue,
            }
            (from_s, begun) = (session.now_s(), Instant::now());
        }
        for _ in 0..steps {
            running &= running && session.step()?;
        }
        screen.now = Duration::from_secs_f64(session.now_s());
        for byte in session.telemetry().iter().skip(read) {
            if let Some(received) = decoder.push::<Message>(*byte) {
                screen.take(&received.message);
            }
        }
        read = session.telemetry().len();
        screen.link = decoder.stats();
        live.share = session.share();
        screen.live = Some(live);
        if terminal.show(&screen, steps == REFRESH_MS).is_err() {
            return Ok(running);
        }
        if live.paused {
            std::thread::sleep(Duration::from_millis(20));
        } else if live.speed > 0.0 {
            until_due((session.now_s() - from_s) / live.speed, begun, &ended);
        }
    }
    Ok(running)
}

/// Waits until so many seconds have gone by since `begun`, or an end has come.
fn until_due(seconds: f64, begun: Instant, ended: &Ended) {
    let due = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
    while !ended.now() && begun.elapsed() < due {
        std::thread::sleep(due.saturating_sub(begun.elapsed()).min(LOOK));
    }
}

/// Shows the run to its end or until the viewer has had enough, which it tells.
pub(crate) fn watch(session: &mut Session, mut speed: f64) -> Result<bool, Failure> {
    let (wishes, ended) = (wishes(), Ended::watch()?);
    let mut paused = false;
    let mut open = true;
    let (mut from_s, mut begun) = (session.now_s(), Instant::now());
    while !ended.now() {
        let asked = if paused && open {
            match wishes.recv_timeout(Duration::from_millis(200)) {
                Ok(wish) => Some(wish),
                Err(RecvTimeoutError::Timeout) => continue,
                Err(RecvTimeoutError::Disconnected) => None,
            }
        } else {
            match wishes.try_recv() {
                Ok(wish) => Some(wish),
                Err(TryRecvError::Disconnected) => {
                    open = false;
                    None
                }
                Err(TryRecvError::Empty) => None,
            }
        };
        match asked {
            Some(Wish::Pause) => paused = !paused,
            Some(Wish::Speed(factor)) => (speed, paused) = (factor, false),
            Some(Wish::Quit) => break,
            Some(Wish::Step) => paused = true,
            None => paused &= open, // nobody is left who could go on
        }
        if asked.is_some() {
            (from_s, begun) = (session.now_s(), Instant::now());
        }
        if paused && asked != Some(Wish::Step) {
            continue;
        }
        for _ in 0..REFRESH_MS {
            if !session.step()? {
                show(session, speed, false);
                let _ = writeln!(std::io::stdout()); // a closed view ends nothing
                return Ok(false);
            }
        }
        show(session, speed, paused);
        if speed > 0.0 && !paused {
            until_due((session.now_s() - from_s) / speed, begun, &ended);
        }
    }
    let _ = writeln!(std::io::stdout()); // likewise
    Ok(true)
}

fn show(session: &Session, speed: f64, paused: bool) {
    let (truth, now) = (session.truth(), session.now_s());
    let measured = session.sample().map_or("-".to_owned(), |s| s.state.words().to_owned());
    let mode = if paused { "paused".to_owned() } else { format!("x{speed}") };
    let line = format!(
        "{now:>8.1} s {mode:>7}  {:<26} {measured:<18} {:>6.0} us {:>6.0} rev/min {:>6.3} N {:>6.2} A {:>6.2} V {:>4.0} %",
        session.phase(),
        truth.pulse_us,
        truth.plant.rpm,
        truth.plant.thrust_n,
        truth.plant.current_a,
        truth.plant.voltage_v,
        100.0 * session.share()
    );
    let mut out = std::io::stdout().lock();
    let end = if out.is_terminal() { "\r" } else { "\n" };
    let _ = write!(out, "{line}{end}").and_then(|()| out.flush()); // a closed view ends nothing
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_wishes() {
        assert_eq!(wish("p"), Some(Wish::Pause));
        assert_eq!(wish(" s "), Some(Wish::Step));
        assert_eq!(wish("25"), Some(Wish::Speed(25.0)));
        assert_eq!((wish("-1"), wish("fast"), wish("q")), (None, None, Some(Wish::Quit)));
    }
}
