//! Operators on a column over uneven time: moving average, first-order lag, delay.
//!
//! What it is: what slow and late meters do to a signal, exactly for piecewise linear signals.
//! What can go wrong: before the first row the signal is taken to have stood at its first value.
//! Units: seconds.
//! Reference: moving averages through prefix integrals; first-order hold for the lag.

use super::Shape;
use crate::channel::Context;

/// What a signal does between two rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Course {
    /// A straight line.
    Line,
    /// It holds the earlier value for this share of the interval, then the later one.
    Jump(f64),
}

impl Course {
    /// Value and integral from the earlier row at a share `u` of an interval of length 1 between `a` and `b`.
    fn at(self, a: f64, b: f64, u: f64) -> (f64, f64) {
        match self {
            Self::Line => (a + u * (b - a), u * (a + 0.5 * u * (b - a))),
            Self::Jump(phase) if u < phase => (a, u * a),
            Self::Jump(phase) => (b, phase * a + (u - phase) * b),
        }
    }
}

/// Mean over the window that ends at each row: where each window begins is worked out once for all columns.
#[derive(Debug, Clone)]
pub(crate) struct Average<'t> {
    t: &'t [f64],
    window: f64,
    /// Share of an interval for which its earlier value counts.
    early: f64,
    /// For each row the row before its window begins, and the seconds that the values there and at the next row count between that row
    /// and the window; less than none where the window begins before the log.
    begins: Vec<(u32, f64, f64)>,
}

impl<'t> Average<'t> {
    /// Over windows of this length, s.
    pub(crate) fn new(t: &'t [f64], window: f64, course: Course) -> Self {
        let mut j = 0;
        let begin = |now: &f64| {
            let start = now - window;
            if start < t[0] {
                return (0, start - t[0], 0.0);
            }
            while j + 1 < t.len() && t[j + 1] <= start {
                j += 1;
            }
            let length = (t[(j + 1).min(t.len() - 1)] - t[j]).max(1e-12);
            let share = (start - t[j]) / length;
            // what unit values at either end amount to from the row to the window
            let [from, to] = [(1.0, 0.0), (0.0, 1.0)].map(|(a, b)| course.at(a, b, share).1 * length);
            (j as u32, from, to)
        };
        let begins = if window <= 0.0 || t.len() < 2 { Vec::new() } else { t.iter().map(begin).collect() };
        Self { t, window, early: course.at(1.0, 0.0, 1.0).1, begins }
    }

    /// The mean of a signal.
    pub(crate) fn of(&self, x: &[f64]) -> Vec<f64> {
        let (t, early) = (self.t, self.early);
        if self.begins.is_empty() {
            return x.to_vec();
        }
        let mut integral = vec![0.0; t.len()];
        let mut sum = 0.0;
        for ((to, t), x) in integral.iter_mut().skip(1).zip(t.windows(2)).zip(x.windows(2)) {
            sum += (x[1] + early * (x[0] - x[1])) * (t[1] - t[0]);
            *to = sum;
        }
        let last = x.len() - 1;
        let mean = |(i, (j, from, to)): (&f64, &(u32, f64, f64))| {
            let j = *j as usize;
            (i - integral[j] - from * x[j] - to * x[(j + 1).min(last)]) / self.window
        };
        integral.iter().zip(&self.begins).map(mean).collect()
    }
}

/// exp(-h) for a series of steps that are nearly all of one or two lengths: the last two answers are kept.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Decay([(f64, f64); 2]);

impl Decay {
    pub(crate) fn new() -> Self {
        Self([(0.0, 1.0); 2])
    }

    /// exp(-h); time stamps are rounded, so steps that agree to a billionth are one.
    pub(crate) fn of(&mut self, h: f64) -> f64 {
        let near = |known: f64| (h - known).abs() <= 1e-9 * h.abs();
        if !near(self.0[0].0) {
            self.0.swap(0, 1);
            if !near(self.0[0].0) {
                self.0[0] = (h, (-h).exp());
            }
        }
        self.0[0].1
    }
}

/// What a first-order lag does from one row to the next: shares of its state, of its input before and of its input after.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Interval {
    state: f64,
    from: f64,
    to: f64,
}

impl Interval {
    /// The input runs straight, or jumps at a known instant: what is left of the state, and the weight of the change of the input.
    pub(crate) fn change(left: f64, change: f64) -> Self {
        Self { state: left, from: 1.0 - left - change, to: change }
    }

    /// What the state was is not known: nothing of it is left, and nothing of the input is there yet.
    pub(crate) const UNKNOWN: Self = Self { state: 0.0, from: 0.0, to: 0.0 };

    /// The input jumps at once: what is left of the state's distance from the input at the jump, and of that after it.
    pub(crate) fn jump(early: f64, late: f64) -> Self {
        Self { state: early * late, from: (1.0 - early) * late, to: 1.0 - late }
    }
}

/// A lag whose intervals are worked out once for all signals.
#[derive(Debug, Clone)]
pub(crate) struct Lag {
    /// From each row to the next; none where the lag is too short to be one.
    intervals: Vec<Interval>,
    /// Share of its input at which it stands on the first row: all of it, or none where that state is known otherwise.
    first: f64,
}

impl Lag {
    /// A lag with time constant `tau`, exact for a signal of the given course.
    pub(crate) fn new(t: &[f64], tau: f64, course: Course) -> Self {
        if tau <= 1e-9 {
            return Self { intervals: Vec::new(), first: 1.0 };
        }
        let (mut whole, mut part) = (Decay::new(), Decay::new());
        let interval = |w: &[f64]| {
            let h = (w[1] - w[0]) / tau;
            let e = whole.of(h);
            let change = match course {
                Course::Line => weight_of_ramp(h, e),
                Course::Jump(phase) if phase >= 1.0 => 0.0,
                Course::Jump(phase) => 1.0 - part.of(h * (1.0 - phase)),
            };
            Interval::change(e, change)
        };
        Self { intervals: t.windows(2).map(interval).collect(), first: 1.0 }
    }

    /// What a lag of time constant `tau`, s, was made of: its inverse, for an input that stands between rows as it ends, or jumps. Where
    /// `jumps` says so of a row, its input jumped after a share `phase` of the interval before it.
    pub(crate) fn undone(t: &[f64], tau: f64, phase: f64, jumps: impl Fn(usize) -> bool) -> Self {
        let mut decays = [Decay::new(); 3];
        let [whole, before, after] = &mut decays;
        let interval = |(i, w): (usize, &[f64])| {
            let h = (w[1] - w[0]) / tau.max(1e-9);
            let (early, late) =
                if jumps(i + 1) { (before.of(h * phase), after.of(h * (1.0 - phase))) } else { (1.0, whole.of(h)) };
            // a reading that has hardly begun to follow a jump cannot tell how far it goes. Where a lag settles within a row, the instant of
            // the jump is no more known than that; and from jump to jump an error is handed on no larger than it is
            let most = match (h > SETTLED, i > 0 && jumps(i)) {
                (true, _) => 0.5,
                (_, true) => 1.0 / (2.0 - early),
                _ => MOST_LEFT,
            };
            let late = late.min(most).min(MOST_LEFT);
            let gain = 1.0 / (1.0 - late);
            Interval { state: -late * (1.0 - early) * gain, from: -late * early * gain, to: gain }
        };
        Self { intervals: t.windows(2).enumerate().map(interval).collect(), first: 1.0 }
    }

    /// A lag that does this from each row to the next.
    pub(crate) fn of_intervals(intervals: Vec<Interval>) -> Self {
        Self { intervals, first: 1.0 }
    }

    /// The same where the state of some rows is known by itself, and not from the rows before. What becomes of those states is no part of
    /// any input: see [`Self::carried`].
    pub(crate) fn starting_at(mut self, starts: &[(usize, f64)]) -> Self {
        for (row, _) in starts {
            match row.checked_sub(1) {
                None => self.first = 0.0,
                Some(before) => self.intervals[before] = Interval::UNKNOWN,
            }
        }
        self
    }

    /// What is left of the states that some rows have by themselves, on every row.
    pub(crate) fn carried(&self, starts: &[(usize, f64)]) -> Vec<f64> {
        carried(self.intervals.iter().map(|i| i.state), starts)
    }

    /// What the lag makes of signals: four at a time, because each state waits for the one before it.
    pub(crate) fn of(&self, signals: &[&[f64]]) -> Vec<Vec<f64>> {
        if self.intervals.is_empty() {
            return signals.iter().map(|x| x.to_vec()).collect();
        }
        let some = |few: &[&[f64]]| -> Vec<Vec<f64>> {
            let four = [0, 1, 2, 3].map(|k| few[k.min(few.len() - 1)]);
            self.side_by_side(four).into_iter().take(few.len()).collect()
        };
        signals.chunks(4).flat_map(some).collect()
    }

    fn side_by_side(&self, signals: [&[f64]; 4]) -> [Vec<f64>; 4] {
        let mut out = signals.map(|x| vec![self.first * x[0]; self.intervals.len() + 1]);
        let [mut a, mut b, mut c, mut d] = signals.map(|x| self.first * x[0]);
        let [xa, xb, xc, xd] = signals.map(|x| x.windows(2));
        let [oa, ob, oc, od] = out.each_mut().map(|out| out[1..].iter_mut());
        let inputs = xa.zip(xb).zip(xc.zip(xd));
        let outputs = oa.zip(ob).zip(oc.zip(od));
        for ((i, ((xa, xb), (xc, xd))), ((oa, ob), (oc, od))) in self.intervals.iter().zip(inputs).zip(outputs) {
            let next = |state: f64, x: &[f64]| i.state * state + (i.from * x[0] + i.to * x[1]);
            (a, b, c, d) = (next(a, xa), next(b, xb), next(c, xc), next(d, xd));
            (*oa, *ob, *oc, *od) = (a, b, c, d);
        }
        out
    }
}

/// What is left on every row of states that some rows have by themselves, of which each interval leaves a share.
pub(super) fn carried(left: impl Iterator<Item = f64>, starts: &[(usize, f64)]) -> Vec<f64> {
    let mut starts = starts.iter().copied().peekable();
    let mut state = 0.0;
    let rows = std::iter::once(0.0).chain(left).enumerate();
    rows.map(|(row, left)| {
        state = starts.next_if(|s| s.0 == row).map_or(left * state, |s| s.1);
        state
    })
    .collect()
}

/// Time constants after which a lag has settled: a twentieth of the jump is left.
const SETTLED: f64 = 3.0;
/// A lag that leaves more than this of its state from row to row buries its input in noise.
const MOST_LEFT: f64 = 0.99;

/// Weight of the change of a lag's input over an interval of `h` time constants, `decay` = exp(-h), over which the input goes in a straight
/// line: u(s) = from + (to - from) s/h.
pub(crate) fn weight_of_ramp(h: f64, decay: f64) -> f64 {
    if h > 1e-6 { 1.0 - (1.0 - decay) / h } else { h / 2.0 }
}

/// Where a late signal is read, worked out once for all columns: for each row two rows and the share of the way between them.
#[derive(Debug, Clone)]
pub(crate) struct Late(Vec<(u32, u32, f64)>);

impl Late {
    /// As late as `delay` says at each instant, s (early when negative).
    pub(crate) fn new(t: &[f64], course: Course, delay: impl Fn(f64) -> f64) -> Self {
        let last = t.len() - 1;
        let at_row = |i: usize| (i as u32, i as u32, 0.0);
        let mut j = 0;
        let place = |now: &f64| {
            let at = now - delay(*now);
            if at <= t[0] {
                return at_row(0);
            }
            if at >= t[last] {
                return at_row(last);
            }
            if t[j] > at {
                j = 0;
            }
            while j + 1 < t.len() && t[j + 1] <= at {
                j += 1;
            }
            let share = (at - t[j]) / (t[j + 1] - t[j]);
            match course {
                Course::Line => (j as u32, j as u32 + 1, share),
                Course::Jump(phase) => at_row(if share < phase { j } else { j + 1 }),
            }
        };
        Self(t.iter().map(place).collect())
    }

    /// The late signal.
    pub(crate) fn of(&self, x: &[f64]) -> Vec<f64> {
        let read = |(a, b, share): &(u32, u32, f64)| {
            let (a, b) = (x[*a as usize], x[*b as usize]);
            a + share * (b - a)
        };
        self.0.iter().map(read).collect()
    }
}

/// Whether a lateness is no more than a row leaves open: a row holds what was read at any instant of its interval, half of one from its middle.
pub(crate) fn is_within_a_row(context: &Context, late_s: f64) -> bool {
    late_s <= 0.5 * context.step()
}

/// Whether the load changes within single rows: then the instant of a step is known to a row only.
pub(crate) fn abrupt(context: &Context) -> bool {
    *context.facts.abrupt.get_or_init(|| {
        let command = context.pulse.as_deref().unwrap_or(&[]);
        within_single_rows(if context.rpm.is_empty() { command } else { &context.rpm })
    })
}

/// Whether the command does.
pub(crate) fn commands_abruptly(context: &Context) -> bool {
    context.pulse.as_deref().is_some_and(within_single_rows)
}

fn within_single_rows(signal: &[f64]) -> bool {
    // of the squared change over three rows, the share that one row holds
    let (mut single, mut triple) = (0.0, 0.0);
    let large = 0.01 * signal.iter().copied().fold(0.0, f64::max);
    for w in signal.windows(4) {
        let (a, b, c) = (w[1] - w[0], w[2] - w[1], w[3] - w[2]);
        if b.abs() > large && b.abs() >= a.abs() && b.abs() >= c.abs() {
            single += b * b;
            triple += (a + b + c).powi(2);
        }
    }
    single > 0.9 * triple && single > 0.0
}

/// The courses between rows that a log asks for: straight lines, and where the load jumps, jumps.
pub(crate) fn courses(context: &Context) -> &'static [bool] {
    if abrupt(context) { &[false, true] } else { &[false] }
}

/// The shape parameter that says when within a row the load jumps.
pub(crate) fn phase() -> Shape {
    Shape { name: "phase", unit: "1", range: (0.0, 1.0), starts: vec![0.25, 0.75] }
}

/// Ending of the name of a form in which the load jumps within rows.
pub(crate) const OF_STEPS: &str = "of_steps";

/// The course that a form and its shape parameters after the first stand for.
pub(crate) fn course(form: &str, phase: &[f64]) -> Course {
    match phase {
        [phase] if form.ends_with(OF_STEPS) => Course::Jump(*phase),
        _ => Course::Line,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A meter's lag of milliseconds, taken off a log of one row a step: every row jumps, and none of it may run away.
    #[test]
    fn a_lag_taken_off_rows_that_all_jump_stays_bounded() {
        let t: Vec<f64> = (0..60).map(|i| 6.0 * f64::from(i)).collect();
        let x: Vec<f64> = (0..60).map(|i| 3000.0 + 200.0 * f64::from(i)).collect();
        for phase in [0.0, 0.5, 0.999, 1.0] {
            let truth = Lag::undone(&t, 0.008, phase, |_| true).of(&[&x]).remove(0);
            let most = truth.iter().zip(&x).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(most <= 600.0, "phase {phase}: {most}");
        }
    }

    fn ramp() -> (Vec<f64>, Vec<f64>) {
        let t: Vec<f64> = (0..200).map(|i| f64::from(i) * 0.05 + if i % 3 == 0 { 0.01 } else { 0.0 }).collect();
        let x = t.iter().map(|v| 2.0 * v).collect();
        (t, x)
    }

    #[test]
    fn a_ramp_is_late_by_half_the_window_by_tau_and_by_the_delay() {
        let (t, x) = ramp();
        let i = 180;
        assert!((Average::new(&t, 0.8, Course::Line).of(&x)[i] - 2.0 * (t[i] - 0.4)).abs() < 1e-9);
        assert!((Lag::new(&t, 0.3, Course::Line).of(&[&x])[0][i] - 2.0 * (t[i] - 0.3)).abs() < 1e-6);
        assert!((Late::new(&t, Course::Line, |_| 0.27).of(&x)[i] - 2.0 * (t[i] - 0.27)).abs() < 1e-9);
        assert!((Late::new(&t, Course::Line, |_| -0.27).of(&x)[100] - 2.0 * (t[100] + 0.27)).abs() < 1e-9);
    }

    #[test]
    fn a_lead_gives_back_what_was_lagged() {
        let (t, _) = ramp();
        let x: Vec<f64> = (0..t.len()).map(|i| if i / 40 % 2 == 0 { 3.0 } else { 7.0 }).collect();
        for (phase, tau) in [(0.0, 0.2), (0.8, 0.04), (0.3, 1.0)] {
            let lagged = Lag::new(&t, tau, Course::Jump(phase)).of(&[&x]).remove(0);
            let back = Lag::undone(&t, tau, phase, |i| i % 40 == 0).of(&[&lagged]).remove(0);
            assert!(back.iter().zip(&x).all(|(a, b)| (a - b).abs() < 1e-9), "{phase} {tau}");
        }
    }

    #[test]
    fn signals_side_by_side_are_what_each_is_alone() {
        let (t, x) = ramp();
        let signals: Vec<Vec<f64>> = (0..6).map(|k| x.iter().map(|v| (v * f64::from(k)).sin()).collect()).collect();
        let all: Vec<&[f64]> = signals.iter().map(Vec::as_slice).collect();
        let lag = Lag::new(&t, 0.3, Course::Line);
        let alone: Vec<Vec<f64>> = all.iter().flat_map(|x| lag.of(&[x])).collect();
        for n in 0..=6 {
            assert_eq!(lag.of(&all[..n]), alone[..n], "{n}");
        }
    }

    #[test]
    fn kept_answers_are_those_of_the_exponential() {
        let mut decay = Decay::new();
        for h in [0.1, 0.1, 0.3, 0.1, 0.3, 0.1 + 1e-12, 2.0, 0.0, 0.1, 2.0] {
            assert!((decay.of(h) - (-h).exp()).abs() < 1e-9, "{h}");
        }
    }

    #[test]
    fn a_constant_stays() {
        let (t, _) = ramp();
        let x = vec![3.5; t.len()];
        for course in [Course::Line, Course::Jump(0.3)] {
            for y in [
                Average::new(&t, 1.3, course).of(&x),
                Lag::new(&t, 0.4, course).of(&[&x]).remove(0),
                Late::new(&t, course, |_| 0.9).of(&x),
            ] {
                assert!(y.iter().all(|v| (v - 3.5).abs() < 1e-9));
            }
        }
    }

    #[test]
    fn a_jump_within_a_row_is_averaged_over_what_follows_it() {
        let t: Vec<f64> = (0..6).map(f64::from).collect();
        let x = [0.0, 0.0, 0.0, 1.0, 1.0, 1.0];
        // the jump comes a quarter into the third interval
        let y = Average::new(&t, 2.0, Course::Jump(0.25)).of(&x);
        assert!((y[3] - 0.375).abs() < 1e-12 && (y[4] - 0.875).abs() < 1e-12 && (y[5] - 1.0).abs() < 1e-12, "{y:?}");
        let y = Lag::new(&t, 0.5, Course::Jump(0.25)).of(&[&x]).remove(0);
        assert!((y[3] - (1.0 - (-1.5_f64).exp())).abs() < 1e-12);
        let y = Late::new(&t, Course::Jump(0.25), |_| 0.5).of(&x);
        assert_eq!(y[3], 1.0);
        assert_eq!(Late::new(&t, Course::Jump(0.25), |_| 0.9).of(&x)[3], 0.0);
    }
}
