//! The screen on a terminal.
//!
//! What it is: [`draw`] puts a [`Screen`] into a frame of any size: state and stop key first, then channels, then news and keys, as far as there is room.
//! What can go wrong: below 40 columns or 8 rows only the state is left.
//! Units: characters.
//! Reference: specification `rig.md`, "The operator's side"; docs/view.md. Colours are the terminal's own sixteen, text is in its own
//! foreground: light and dark alike; `NO_COLOR` is honoured.

use super::channel::Channel;
use super::glyphs::Glyphs;
use super::screen::{Screen, Tone};
use frame::rig::RigState;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

/// How things look on this terminal.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ink {
    /// Characters that it shows.
    pub(crate) glyphs: Glyphs,
    /// It has colours, and they are wanted.
    pub(crate) colours: bool,
}

impl Ink {
    /// What the environment says.
    pub(crate) fn of_environment() -> Self {
        let unwanted = std::env::var_os("NO_COLOR").is_some_and(|v| !v.is_empty());
        Self { glyphs: Glyphs::of_locale(), colours: !unwanted }
    }

    fn style(self, tone: Tone) -> Style {
        let plain = Style::new();
        match tone {
            Tone::Plain => plain,
            Tone::Dim => plain.add_modifier(Modifier::DIM),
            Tone::Good if self.colours => plain.fg(Color::Green),
            Tone::Good => plain,
            Tone::Warn if self.colours => plain.fg(Color::Magenta).add_modifier(Modifier::BOLD),
            Tone::Bad if self.colours => plain.fg(Color::Red).add_modifier(Modifier::BOLD),
            Tone::Warn | Tone::Bad => plain.add_modifier(Modifier::BOLD),
        }
    }

    /// A block of colour behind text that has to be seen.
    fn banner(self, tone: Tone) -> Style {
        let on = |back: Color, fore: Color| Style::new().bg(back).fg(fore).add_modifier(Modifier::BOLD);
        match tone {
            Tone::Good if self.colours => on(Color::Green, Color::Black),
            Tone::Warn if self.colours => on(Color::Yellow, Color::Black),
            Tone::Bad if self.colours => on(Color::Red, Color::White),
            _ => Style::new().add_modifier(Modifier::REVERSED | Modifier::BOLD),
        }
    }
}

/// Word and look of a state.
fn state(state: Option<RigState>) -> (&'static str, Tone) {
    match state {
        None => ("WAITING", Tone::Plain),
        Some(RigState::Disarmed) => ("DISARMED", Tone::Plain),
        Some(RigState::ArmHoldMin | RigState::ArmCells | RigState::ArmReady) => ("ARMING", Tone::Warn),
        Some(RigState::Armed) => ("ARMED", Tone::Warn),
        Some(RigState::Running) => ("RUNNING", Tone::Bad),
        Some(RigState::CalibrateHoldMax) => ("MAXIMUM PULSES", Tone::Bad),
        Some(RigState::CalibrateHoldMin) => ("RANGE: MINIMUM", Tone::Warn),
        Some(RigState::ProgrammingEscape) => ("ESC PROGRAMMING", Tone::Bad),
        Some(RigState::Faulted) => ("STOPPED", Tone::Bad),
    }
}

/// Text cut to a width; what is cut off is marked.
fn cut(text: &str, width: usize) -> String {
    if text.chars().count() <= width {
        return text.to_owned();
    }
    let kept: String = text.chars().take(width.saturating_sub(1)).collect();
    kept + "~"
}

/// `left` at the left end of a line and `right` at its right end.
fn ends<'a>(left: Vec<Span<'a>>, right: Vec<Span<'a>>, width: usize) -> Line<'a> {
    let used: usize = left.iter().chain(&right).map(|s| s.content.chars().count()).sum();
    let mut spans = left;
    spans.push(Span::raw(" ".repeat(width.saturating_sub(used).max(1))));
    spans.extend(right);
    Line::from(spans)
}

fn clock(s: f64) -> String {
    let s = s.max(0.0) as u64;
    if s >= 3600 { format!("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60) } else { format!("{}:{:02}", s / 60, s % 60) }
}

/// Draws the screen.
pub(crate) fn draw(frame: &mut Frame<'_>, screen: &Screen, ink: Ink) {
    let area = frame.area();
    let (width, height) = (usize::from(area.width), usize::from(area.height));
    let mut lines = vec![title(screen, ink, width), what(screen, ink, width)];
    if height >= 8 && width >= 40 {
        lines.push(pulse(screen, ink, width));
        if let Some(line) = under(screen, ink, width) {
            lines.push(line);
        }
        let keys = if screen.help { all_keys(width) } else { keys(screen, ink, width) };
        let foot = vec![link(screen, ink, width)];
        let room = height.saturating_sub(lines.len() + keys.len() + foot.len());
        lines.extend(table(screen, ink, width).into_iter().take(room));
        let left = height.saturating_sub(lines.len() + keys.len() + foot.len());
        let news = news(screen, ink, width, left);
        lines.extend(std::iter::repeat_n(Line::default(), left - news.len()));
        lines.extend(news);
        lines.extend(foot);
        lines.extend(keys);
    }
    frame.render_widget(Paragraph::new(lines), area);
    if let Some(prompt) = &screen.prompt
        && height > 2
    {
        let words = format!(" {} {}_ ", prompt.words(), prompt.typed);
        let line = Line::from(Span::styled(format!("{:<width$}", cut(&words, width)), ink.banner(Tone::Plain)));
        frame.render_widget(Paragraph::new(line), Rect { y: area.y + area.height - 1, height: 1, ..area });
    }
}

fn title(screen: &Screen, ink: Ink, width: usize) -> Line<'static> {
    let mut right = Vec::new();
    if let Some(recorded) = &screen.recorded {
        let file = cut(&recorded.file, (width / 3).max(12));
        let (words, tone) = if recorded.waiting {
            (format!("DISK FULL, {} rows kept in memory ", recorded.rows), Tone::Bad)
        } else {
            (format!("REC {file} {} rows ", recorded.rows), Tone::Good)
        };
        right.push(Span::styled(words, ink.style(tone)));
    } else if screen.live.is_none() {
        right.push(Span::styled("not recorded ", ink.style(Tone::Dim)));
    }
    right.push(Span::raw(clock(screen.now.as_secs_f64())));
    let used: usize = right.iter().map(|s| s.content.chars().count()).sum();
    let name = cut(&format!("quadrig  {}", screen.title), width.saturating_sub(used + 1));
    ends(vec![Span::styled(name, Style::new().add_modifier(Modifier::BOLD))], right, width)
}

/// The state, and what the operator is to do or to know.
fn what(screen: &Screen, ink: Ink, width: usize) -> Line<'static> {
    let (word, tone) = state(screen.state);
    let alarm = screen.alarm();
    let tone = if alarm.is_some() { Tone::Bad } else { tone };
    let words = match (&alarm, screen.state) {
        (Some(alarm), _) => alarm.clone(),
        (None, Some(state)) => {
            let message = esc_pwm::arming::message(state);
            message.split_once(": ").map_or(message, |(_, rest)| rest).to_owned()
        }
        (None, None) => "no word from the board yet".to_owned(),
    };
    let banner = format!(" {word} ");
    let stop = " SPACE stops ";
    let room = width.saturating_sub(banner.chars().count() + stop.len() + 2);
    ends(
        vec![
            Span::styled(banner, ink.banner(tone)),
            Span::styled(format!(" {}", cut(&words, room)), ink.style(if alarm.is_some() { Tone::Bad } else { Tone::Plain })),
        ],
        vec![Span::styled(stop, ink.banner(Tone::Plain))],
        width,
    )
}

fn pulse(screen: &Screen, ink: Ink, width: usize) -> Line<'static> {
    let (text, share) = match screen.pulse_us {
        Some(us) => (format!("pulse {us:7.1} us "), (us - 1000.0) / 1000.0),
        None => ("pulse       - us ".to_owned(), 0.0),
    };
    let long = (width / 5).max(8);
    let mut left = vec![Span::raw(text), Span::raw(format!("[{}] {:3.0} % ", ink.glyphs.bar(share, long), 100.0 * share))];
    let mut right = Vec::new();
    if let Some(live) = screen.live {
        let speed = match live {
            live if live.paused => "paused".to_owned(),
            live if live.speed == 0.0 => "as fast as it goes".to_owned(),
            live => format!("{} times the clock", live.speed),
        };
        right.push(Span::raw(format!("{:.0} % done, {speed}", 100.0 * live.share)));
    } else if let Some(course) = &screen.course {
        let state = match (course.left_s(screen.now), course.over) {
            (_, true) => "done".to_owned(),
            (None, _) => format!("{} to go", clock(course.longest_s)),
            (Some(left), _) => format!("{} left", clock(left)),
        };
        let part = course.part.as_deref().map_or_else(String::new, |part| format!(" {part}"));
        let used: usize = left.iter().map(|s| s.content.chars().count()).sum();
        let room = width.saturating_sub(used + state.len() + 3);
        right.push(Span::raw(cut(&format!("{}{part}", course.name), room)));
        right.push(Span::styled(format!("  {state}"), Style::new().add_modifier(Modifier::BOLD)));
    }
    ends(std::mem::take(&mut left), right, width)
}

/// The model beside the run.
fn under(screen: &Screen, ink: Ink, width: usize) -> Option<Line<'static>> {
    let under = screen.under.as_ref()?;
    let (tone, words) = match &under.departure {
        Some(d) => (
            Tone::Bad,
            format!(
                "LEFT ITS MODEL: {} from row {} ({:.1} s) on, {:+.1} noise floors, seen at {:.1} s",
                d.channel, d.row, d.t_s, d.floors, d.seen_s
            ),
        ),
        None => {
            let stops = if under.stops { "stops the run at" } else { "told at" };
            (Tone::Good, format!("on the model of {}; a departure is {stops} {} noise floors", under.model, under.floors))
        }
    };
    Some(Line::from(Span::styled(cut(&words, width), ink.style(tone))))
}

/// Widths of the columns of the table.
struct Widths {
    floors: bool,
    limits: bool,
    bar: usize,
    trend: usize,
}

impl Widths {
    fn of(screen: &Screen, width: usize) -> Self {
        let floors = screen.under.is_some();
        let fixed = 12 + 10 + 8 + 11 + if floors { 9 } else { 0 };
        let limits = width >= fixed + 16 + 23;
        let left = width.saturating_sub(fixed + if limits { 16 } else { 0 });
        let bar = (left / 3).clamp(6, 24);
        Self { floors, limits, bar, trend: left.saturating_sub(bar + 3) }
    }
}

fn table(screen: &Screen, ink: Ink, width: usize) -> Vec<Line<'static>> {
    let widths = Widths::of(screen, width);
    let mut head = format!("{:<12}{:>9} {:<8}{:<11}", "channel", "value", "unit", "verdict");
    if widths.floors {
        head += &format!("{:>8} ", "floors");
    }
    if widths.limits {
        head += &format!("{:<16}", "limits");
    }
    let used = if widths.bar < 10 { "used" } else { "of its limit" };
    let trend =
        ["trend, 1 s a column", "trend, 1 s", "trend"].into_iter().find(|words| words.len() <= widths.trend).unwrap_or("");
    head += &format!("{used:<bar$} {trend}", bar = widths.bar + 2);
    let mut lines = vec![Line::from(Span::styled(
        format!("{:<width$}", cut(&head, width)),
        Style::new().add_modifier(Modifier::UNDERLINED | Modifier::DIM),
    ))];
    lines.extend(screen.channels.iter().map(|channel| row(channel, ink, &widths)));
    if let Some((tone, words)) = &screen.second {
        lines.push(Line::from(Span::styled(cut(words, width), ink.style(*tone))));
    }
    lines
}

fn row(channel: &Channel, ink: Ink, widths: &Widths) -> Line<'static> {
    let value = channel.value.map_or_else(|| "-".to_owned(), |v| format!("{v:.*}", channel.digits));
    let faint = if channel.fitted { Style::new() } else { ink.style(Tone::Dim) };
    let (verdict, tone) = if channel.fitted { channel.verdict } else { ("not fitted", Tone::Dim) };
    let mut spans = vec![
        Span::styled(format!("{:<12}{value:>9} {:<8}", channel.name, channel.unit), faint),
        Span::styled(format!("{verdict:<11}"), ink.style(tone)),
    ];
    if widths.floors {
        let (words, tone) = match channel.floors.filter(|f| f.is_finite()) {
            Some(floors) => (
                format!("{floors:+8.1} "),
                if floors.abs() >= 8.0 {
                    Tone::Bad
                } else if floors.abs() >= 4.0 {
                    Tone::Warn
                } else {
                    Tone::Plain
                },
            ),
            None => (format!("{:>8} ", "-"), Tone::Dim),
        };
        spans.push(Span::styled(words, ink.style(tone)));
    }
    if widths.limits {
        spans.push(Span::styled(format!("{:<16}", cut(&limits(channel), 15)), ink.style(Tone::Dim)));
    }
    let share = channel.share();
    let near = match share {
        Some(share) if share >= 1.0 => Tone::Bad,
        Some(share) if share >= 0.9 => Tone::Warn,
        _ => Tone::Plain,
    };
    spans.push(match share {
        Some(share) => Span::styled(format!("[{}] ", ink.glyphs.bar(share, widths.bar)), ink.style(near)),
        None => Span::raw(" ".repeat(widths.bar + 3)), // nothing is read, or nothing limits it upwards
    });
    spans.push(Span::raw(ink.glyphs.trend(&channel.trend.last(widths.trend), channel.least_range())));
    Line::from(spans)
}

fn limits(channel: &Channel) -> String {
    let number = |v: f64| {
        let digits = [1000.0, 10.0, 1.0].iter().filter(|from| v.abs() < **from).count();
        let text = format!("{v:.digits$}");
        if digits > 0 { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
    };
    match channel.limits {
        (None, None) => "no limit".to_owned(),
        (Some(low), None) => format!("{} up", number(low)),
        (None, Some(high)) => format!("up to {}", number(high)),
        (Some(low), Some(high)) => format!("{} to {}", number(low), number(high)),
    }
}

fn news(screen: &Screen, ink: Ink, width: usize, room: usize) -> Vec<Line<'static>> {
    let from = screen.news.len().saturating_sub(room);
    let lines = screen.news.iter().skip(from).map(|line| {
        let at = format!("{:>7.1} s  ", line.at.as_secs_f64());
        let words = cut(&line.text, width.saturating_sub(at.len()));
        Line::from(vec![Span::styled(at, ink.style(Tone::Dim)), Span::styled(words, ink.style(line.tone))])
    });
    lines.collect()
}

/// Counters of the line and the bench.
fn link(screen: &Screen, ink: Ink, width: usize) -> Line<'static> {
    let l = &screen.link;
    let lost = l.damaged + l.missing + l.foreign;
    let mut words = format!("line: {} frames good, {} damaged, {} missing", l.good, l.damaged, l.missing);
    if l.foreign > 0 {
        words += &format!(", {} of another version", l.foreign);
    }
    let right = screen.bench.map_or_else(String::new, |(powered, open)| {
        let battery = if powered { "battery on" } else { "battery off" };
        let stop = if open { "STOP PRESSED" } else { "stop released" };
        format!("bench: {battery}, {stop}")
    });
    let tone = if lost > 0 { Tone::Warn } else { Tone::Dim };
    let room = width.saturating_sub(right.chars().count() + 1);
    ends(vec![Span::styled(cut(&words, room), ink.style(tone))], vec![Span::styled(right, ink.style(Tone::Dim))], width)
}

/// The keys that mean something now, on as many lines as they need.
fn keys(screen: &Screen, ink: Ink, width: usize) -> Vec<Line<'static>> {
    let mut lines: Vec<Vec<Span<'static>>> = vec![Vec::new()];
    let mut used = 0;
    for (key, what) in screen.known_keys() {
        let long = key.chars().count() + what.chars().count() + 4;
        if used + long > width && used > 0 {
            lines.push(Vec::new());
            used = 0;
        }
        if let Some(line) = lines.last_mut() {
            line.push(Span::styled(format!(" {key} "), ink.banner(Tone::Plain)));
            line.push(Span::raw(format!("{what}  ")));
        }
        used += long + 1;
    }
    lines.into_iter().map(Line::from).collect()
}

/// Every key.
fn all_keys(width: usize) -> Vec<Line<'static>> {
    let text = [
        "SPACE, Esc   minimum throttle, now, from everywhere",
        "q, Ctrl-C    stop, end the recording, leave",
        "a            arm: minimum is held, then the ESC's battery",
        "l 1-9 r      heard: a long beep, so many short ones, 1-2-3",
        "d p n f      heard: two beeps, special tone, beeps without end, twenty beeps",
        "= Up Down    type a pulse; 10 us (PgUp, PgDn 50 us); Home: minimum",
        "g            run the schedule",
        "t m f s      tare; calibrate: a known value, the line through them; store",
        "c            throttle range of an ESC without power: MAXIMUM pulses",
        "x            clear latched faults",
        "b k h        virtual bench: battery, emergency stop, hang a mass",
        "?            back",
    ];
    text.iter().map(|line| Line::from(cut(line, width))).collect()
}
