//! Plain words: clauses, numbers with the digits that they support, and names of channels as a lab says them.
//!
//! What it is: the vocabulary of sentence, page and terminal. Each effect says its own clause with it.
//! What can go wrong: a number that its interval does not support is left out of a clause.
//! Units: scaled to a size that one reads at a glance (0.041 ohm is 41 mohm).
//! Reference: GUM, clause 7.2.6 (digits of a result).

mod entry;
pub(crate) mod plain;

use crate::verdict::Scope;
use crate::verdict::{EffectEntry, Parameter};
pub use plain::{channels, curve, in_force, over_time, plain};

/// What a cause does, in two parts: an adverb fits between them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Clause {
    /// Subject: "the load cell". Empty where the second part is a sentence by itself.
    pub who: String,
    /// Predicate: "answers half a second late".
    pub does: String,
}

impl Clause {
    /// From both parts.
    #[must_use]
    pub fn new(who: impl Into<String>, does: impl Into<String>) -> Self {
        Self { who: who.into(), does: does.into() }
    }

    /// From a title that is a sentence already, with the largest known parameter behind it.
    #[must_use]
    pub fn titled(title: &str, found: &EffectEntry) -> Self {
        let size = found.parameters.iter().find_map(|p| Some((p, sized(p)?)));
        let size = size.map(|(p, v)| format!(" ({} {v})", p.name.replace('_', " "))).unwrap_or_default();
        Self::new("", format!("{}{size}", lower(title)))
    }

    /// In one piece, with an adverb that may be empty.
    #[must_use]
    pub fn with(&self, adverb: &str) -> String {
        let parts = [self.who.as_str(), adverb, self.does.as_str()];
        parts.into_iter().filter(|p| !p.is_empty()).collect::<Vec<_>>().join(" ")
    }

    /// As a sentence.
    #[must_use]
    pub fn sentence(&self) -> String {
        format!("{}.", upper(&self.with("")))
    }
}

/// What a scope of something that is called so means to the reader.
#[must_use]
pub fn scope(e: &EffectEntry, noun: &str) -> String {
    match e.scope {
        // it began and did not end
        Scope::Event if e.parameter("t0").is_some() && e.parameter("t1").is_none() => since_one_instant(noun),
        Scope::Rig if e.has_begun() => since_one_instant(noun),
        Scope::Rig => format!("of the {noun}: every run should show it"),
        Scope::Run => "of this run: another run has a value of its own".to_owned(),
        Scope::Event => "of one instant: it does not recur by itself".to_owned(),
    }
}

fn since_one_instant(noun: &str) -> String {
    format!("since one instant: it stays with the {noun} until something is changed")
}

/// A parameter's name in words.
#[must_use]
pub fn parameter(name: &str) -> String {
    match name {
        "t0" => "from".to_owned(),
        "t1" => "until".to_owned(),
        "onset" => "begins at".to_owned(),
        "tau" => "time constant".to_owned(),
        "tau_up" => "time constant as it speeds up".to_owned(),
        "tau_down" => "time constant as it slows down".to_owned(),
        "tau_air" => "time constant of coasting".to_owned(),
        "power_gain" => "current for each unit of power that speeds the rotor up".to_owned(),
        "viscous" => "friction that grows with speed".to_owned(),
        "constant" => "friction at any speed".to_owned(),
        "slack" => "play before it turns".to_owned(),
        "derate" => "loss of speed with heat".to_owned(),
        "speed_loss" => "loss of speed".to_owned(),
        "current_rise" => "rise of the current".to_owned(),
        "current_loss" => "loss of current".to_owned(),
        _ => match name.rsplit_once('_') {
            Some((of, axis @ ("x" | "y" | "z"))) => format!("{} ({axis})", of.replace('_', " ")),
            _ => name.replace('_', " "),
        },
    }
}

/// A parameter of an effect of the rig's library in words, by the effect's identifier and its own name; empty where no reader asks for it.
#[must_use]
pub fn parameter_of(id: &str, name: &str) -> String {
    match (id, name) {
        // a curve is seen in its figure
        ("unknown", _) => String::new(),
        // its sizes are added, with the sign that they have
        ("stall", "thrust_loss") => "change of thrust".to_owned(),
        ("stall", "torque_rise") => "change of torque".to_owned(),
        ("stall", "current_rise") => "change of current".to_owned(),
        ("stall", "current_rise_loss") => "change of current, beside that".to_owned(),
        ("stall", "speed_loss") => "change of speed".to_owned(),
        ("battery_discharge", "follows") => "share of the voltage's fall that the speed follows".to_owned(),
        _ => parameter(name),
    }
}

/// Where the held-out error stands in an effect's evidence, with and without support.
const WORTH: [&str; 2] = ["; without it the held-out error of ", "; the held-out error of "];

/// The end of an effect's evidence: how much larger the held-out error of its first channel is without it, which is no support at one and below.
#[must_use]
pub(crate) fn worth(channel: &str, reduction: f64) -> String {
    let times = 1.0 / (1.0 - reduction).max(1e-6);
    let [helps, helps_not] = WORTH;
    if times > 1.0 {
        format!("{helps}{channel} is {times:.2} times as large")
    } else {
        format!("{helps_not}{channel} is no smaller with it")
    }
}

/// An effect's evidence without its [`worth`]: what the residual looks like.
#[must_use]
pub(crate) fn signs(evidence: &str) -> &str {
    WORTH.iter().find_map(|worth| evidence.split_once(worth)).map_or(evidence, |(signs, _)| signs)
}

/// Probability from which on a cause is told without an adverb. Where nothing else explains a channel the search still keeps a tenth for causes
/// that the library lacks, so that hardly a name stands above 0.9.
pub(crate) const SURE: f64 = 0.85;

/// How sure a probability is, as an adverb; empty where nothing needs to be said.
#[must_use]
pub fn adverb(probability: f64) -> &'static str {
    match probability {
        p if p >= SURE => "",
        p if p >= 0.6 => "probably",
        _ => "perhaps",
    }
}

/// How sure a probability is, as a word of its own: the sentence says the same.
#[must_use]
pub fn sureness(probability: f64) -> &'static str {
    match probability {
        p if p >= SURE => "sure",
        p => adverb(p),
    }
}

/// A probability: never 1.00 by rounding alone.
#[must_use]
pub fn probability(p: f64) -> String {
    match p {
        p if p >= 0.995 => "> 0.99".to_owned(),
        p if p < 0.005 => "< 0.01".to_owned(),
        p => format!("{p:.2}"),
    }
}

/// A channel as people say it.
#[must_use]
pub fn channel(name: &str) -> String {
    if let Some(one) = name.strip_suffix(" - others") {
        return format!("{} against the other sensors", channel(one));
    }
    if let Some(said) = of_flight(name) {
        return said;
    }
    let said = match name {
        "thrust_n" => "thrust",
        "thrust_rms_n" => "thrust scatter",
        "torque_nm" => "torque",
        "current_a" => "current",
        "voltage_v" => "voltage",
        "rpm" => "speed",
        "rpm_beam" => "speed (beam)",
        "rpm_opto" => "speed (optical)",
        "rpm_hall" => "speed (Hall)",
        "rpm_encoder" => "speed (encoder)",
        "rpm_esc" => "speed (ESC)",
        "temp_c" => "temperature",
        "uneven_beam_deg" => "uneven (beam)",
        "uneven_opto_deg" => "uneven (optical)",
        "uneven_hall_deg" => "uneven (Hall)",
        "uneven_encoder_deg" => "uneven (encoder)",
        "pulse_us" => "pulse",
        "t_s" => "time",
        "charge" => "charge drawn",
        "time_since_step" => "time since the last step",
        "rpm_rate" => "change of speed",
        "heat" => "heat",
        "direction" => "direction of the load",
        "vel_forward" => "speed forward through the air",
        "vel_right" => "speed to the right through the air",
        "vel_down" => "speed down through the air",
        "commands" => "the commands together",
        "speed_across" => "speed across the rotors",
        // attitude logs
        "ax" => "specific force (x)",
        "ay" => "specific force (y)",
        "az" => "specific force (z)",
        "gx" => "turn rate (x)",
        "gy" => "turn rate (y)",
        "gz" => "turn rate (z)",
        "mx" => "field (x)",
        "my" => "field (y)",
        "mz" => "field (z)",
        // what other people's rigs log beside
        "accx_g" => "acceleration (x)",
        "accy_g" => "acceleration (y)",
        "accz_g" => "acceleration (z)",
        "vibration_g" => "vibration",
        "vibration_a_g" => "vibration (A)",
        other => other,
    };
    said.to_owned()
}

/// A channel of a flight or attitude log as people say it: a quantity and its axis, or the speed of a rotor.
fn of_flight(name: &str) -> Option<String> {
    let (quantity, of) = name.rsplit_once('_')?;
    if quantity == "rpm" && of.chars().all(|c| c.is_ascii_digit()) {
        return Some(format!("speed of rotor {of}"));
    }
    let said = match quantity {
        "acc" => "specific force",
        "ang_acc" => "angular acceleration",
        "gyro" => "turn rate",
        "mag" => "field",
        _ => return None,
    };
    ["x", "y", "z"].contains(&of).then(|| format!("{said} ({of})"))
}

/// The quantity of which a channel is an axis, or the channel itself: "specific force" of "specific force (x)".
#[must_use]
pub fn vector(name: &str) -> String {
    let said = channel(name);
    let axis = [" (x)", " (y)", " (z)"].iter().find_map(|axis| said.strip_suffix(axis));
    axis.map_or_else(|| said.clone(), str::to_owned)
}

/// That runs alone have sizes which scatter more than their errors allow.
pub(crate) const DISAGREE: &str = "the runs disagree";
/// That runs alone agree, on another size than they have together.
pub(crate) const OTHERWISE: &str = "together the runs differ from each of them";

/// A channel at the head of something: with a large letter, or as its column where it has no other word.
#[must_use]
pub fn heading(name: &str) -> String {
    let said = channel(name);
    if said == name { said } else { upper(&said) }
}

/// A channel with its unit: "speed (Hall), rev/min".
#[must_use]
pub fn axis(name: &str) -> String {
    let unit = crate::channel::unit_of(name);
    if unit.is_empty() { channel(name) } else { format!("{}, {unit}", channel(name)) }
}

/// The meter behind a channel.
#[must_use]
pub fn meter(name: &str) -> String {
    let said = match name {
        "thrust_n" | "thrust_rms_n" => "the load cell",
        "torque_nm" => "the torque cell",
        "current_a" => "the current meter",
        "voltage_v" => "the voltmeter",
        "rpm" => "the speed sensor",
        "rpm_beam" => "the light beam",
        "rpm_opto" => "the optical sensor",
        "rpm_hall" => "the Hall sensor",
        "rpm_encoder" => "the encoder",
        other => return format!("channel {other}"),
    };
    said.to_owned()
}

/// Smallest size at which a unit is used as it is; below it the finer one, a thousandth, is.
const FINER: [(&str, &str, f64); 7] = [
    ("ohm", "mohm", 0.1),
    ("V", "mV", 0.1),
    ("s", "ms", 0.1),
    ("N.m", "mN.m", 0.1),
    ("A", "mA", 0.01),
    ("N", "mN", 0.002),
    ("m", "mm", 0.1),
];

/// The factor and the unit in which a size is told.
#[must_use]
pub fn scaled(value: f64, unit: &str) -> (f64, &str) {
    match FINER.into_iter().find(|f| f.0 == unit) {
        Some((_, finer, least)) if value != 0.0 && value.abs() < least => (1000.0, finer),
        _ => (1.0, unit),
    }
}

/// A parameter with unit, to the digits that its interval supports, two at the least; `None` where the interval is wider than half of the value.
#[must_use]
pub fn sized(p: &Parameter) -> Option<String> {
    if let Some(count) = counted(p) {
        return Some(with_unit(&count, &p.unit));
    }
    let half = 0.5 * (p.ci95[1] - p.ci95[0]).abs();
    if p.value == 0.0 || !p.value.is_finite() || !half.is_finite() || half > 0.5 * p.value.abs() {
        return None;
    }
    let (factor, unit) = scaled(p.value, &p.unit);
    // two digits at the least, so that no rounding moves it by more than a twentieth
    let second = 10f64.powf((factor * p.value).abs().log10().floor() - 1.0);
    Some(with_unit(&digits(factor * p.value, (factor * half).min(second)), unit))
}

/// A whole number that was counted, not measured: its interval has no width.
#[must_use]
pub fn counted(p: &Parameter) -> Option<String> {
    let exact = p.ci95 == [p.value; 2] && p.value.fract() == 0.0 && p.value != 0.0;
    exact.then(|| format!("{:.0}", p.value))
}

/// Units of what cannot be below zero: durations, resistances, inertias, charges, lengths, areas.
const POSITIVE: [&str; 7] = ["s", "ohm", "kg.m2", "Ah", "A.h", "m^2", "Hz"];

/// The upper bound of a quantity that cannot be below zero and of which the run shows no more: its interval begins no higher. An instant has a
/// sign, and so has a time that is early.
#[must_use]
pub fn upper_bound(p: &Parameter) -> Option<f64> {
    let instant = ["t0", "t1"].contains(&p.name.as_str());
    let open = (p.value >= 0.0 || p.unit != "s") && p.ci95[0] <= 0.0 && p.ci95[1] > 0.0;
    (open && !instant && POSITIVE.contains(&p.unit.as_str())).then_some(p.ci95[1])
}

/// An amount with unit to two significant digits.
#[must_use]
pub fn amount(value: f64, unit: &str) -> String {
    let (factor, unit) = scaled(value, unit);
    with_unit(&digits(factor * value, 0.05 * (factor * value).abs()), unit)
}

/// An error with unit to three significant digits, as the tables have it.
#[must_use]
pub fn rms(value: f64, unit: &str) -> String {
    let (factor, unit) = scaled(value, unit);
    with_unit(&digits(factor * value, 0.0), unit)
}

fn with_unit(number: &str, unit: &str) -> String {
    match unit {
        "" | "1" => number.to_owned(),
        "rpm" => format!("{number} rev/min"),
        "%" => format!("{number} %"),
        unit => format!("{number} {unit}"),
    }
}

/// A number to the first digit of its half width, three significant ones at the most.
#[must_use]
pub fn digits(value: f64, half: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return if value == 0.0 { "0".to_owned() } else { "-".to_owned() };
    }
    let size = value.abs().log10().floor();
    let known = if half > 0.0 { -half.log10().floor() } else { 2.0 - size };
    let places = known.min(2.0 - size).max(-size);
    if !(-3.0..5.0).contains(&size) {
        return format!("{value:.*e}", (places + size).clamp(0.0, 2.0) as usize);
    }
    if places < 0.0 {
        // a speed of 8437 that is known to 30: 8440
        let unit = 10f64.powf(-places);
        return format!("{:.0}", (value / unit).round() * unit);
    }
    format!("{value:.*}", places as usize)
}

/// A value and the ends of its interval, with so many digits that the three differ.
#[must_use]
pub fn with_interval(value: f64, [low, high]: [f64; 2]) -> [String; 3] {
    let half = 0.5 * (high - low).abs();
    let said = [value, low, high].map(|v| digits(v, if half > 0.0 { 0.1 * half } else { 0.0 }));
    if said[1] != said[2] || half <= 0.0 || !half.is_finite() {
        return said;
    }
    // to the second digit of the half width
    let last = half.log10().floor() - 1.0;
    let power = [value, low, high].iter().map(|v| v.abs()).fold(0.0, f64::max).log10().floor();
    if (-3.0..5.0).contains(&power) {
        return [value, low, high].map(|v| format!("{v:.*}", (-last).max(0.0) as usize));
    }
    [value, low, high].map(|v| format!("{:.*}e{power}", (power - last).max(0.0) as usize, v / 10f64.powf(power)))
}

/// A value with the half width of its 95 % interval in brackets, in units of its last digit: `0.0498(5)`. `None` without either.
#[must_use]
pub fn bracketed(value: f64, half: f64) -> Option<String> {
    if !value.is_finite() || half <= 0.0 || !half.is_finite() {
        return None;
    }
    // one digit of the interval, two where it begins with a one
    let size = half.log10().floor();
    let last = if half / 10f64.powf(size) < 1.95 { size - 1.0 } else { size };
    let power = if value == 0.0 { 0.0 } else { value.abs().log10().floor() };
    let (factor, exponent) =
        if (-3.0..5.0).contains(&power) || power < last { (0.0, String::new()) } else { (power, format!("e{power}")) };
    let (value, half, last) = (value / 10f64.powf(factor), half / 10f64.powf(factor), last - factor);
    if last >= 0.0 {
        let unit = 10f64.powf(last);
        return Some(format!("{:.0}({:.0}){exponent}", (value / unit).round() * unit, (half / unit).round() * unit));
    }
    let places = (-last) as usize;
    let digits = format!("{value:.places$}");
    // a zero has no sign
    let digits = digits.strip_prefix('-').filter(|d| d.chars().all(|c| c == '0' || c == '.')).unwrap_or(&digits);
    Some(format!("{digits}({:.0}){exponent}", half * 10f64.powf(-last)))
}

/// Figures to the second digit of a standard error, all with the power of ten of the first.
#[must_use]
pub fn to_error<const N: usize>(figures: [f64; N], se: f64) -> [String; N] {
    let known = se > 0.0 && se.is_finite();
    // the exponent as two digits print it: 0.0999 is 0.10
    let of = |v: f64, digits: usize| format!("{v:.digits$e}").rsplit('e').next().and_then(|e| e.parse::<i32>().ok()).unwrap_or(0);
    let first = figures.first().copied().unwrap_or(0.0);
    if !known || !first.is_finite() {
        return figures.map(crate::numeric::digits::number);
    }
    let last = of(se, 1) - 1;
    let power = of(if first.abs() > se { first } else { se }, 5);
    let unsigned = |text: String| match text.strip_prefix('-') {
        Some(digits) if digits.chars().all(|c| c == '0' || c == '.') => digits.to_owned(),
        _ => text,
    };
    if (-3..5).contains(&power) {
        // of a speed that is known to 30 the last figure is no news
        let round = |v: f64| if last > 0 { (v / 10f64.powi(last)).round() * 10f64.powi(last) } else { v };
        return figures.map(|v| unsigned(format!("{:.*}", usize::try_from(-last).unwrap_or(0), round(v))));
    }
    figures.map(|v| {
        unsigned(format!("{:.*}", usize::try_from(power - last).unwrap_or(0), v / 10f64.powi(power))) + &format!("e{power}")
    })
}

/// Words in a row: "a", "a and b", "a, b and c".
#[must_use]
pub fn list(words: &[String]) -> String {
    match words {
        [] => String::new(),
        [one] => one.clone(),
        [rest @ .., last] => format!("{} and {last}", rest.join(", ")),
    }
}

/// With a large first letter.
#[must_use]
pub fn upper(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// With a small first letter, unless the first word is a name in capitals.
#[must_use]
pub fn lower(text: &str) -> String {
    if text.chars().nth(1).is_some_and(char::is_uppercase) {
        return text.to_owned();
    }
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_lowercase().chain(letters).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameter(value: f64, half: f64, unit: &str) -> Parameter {
        Parameter { name: "x".into(), value, unit: unit.into(), ci95: [value - half, value + half] }
    }

    #[test]
    fn figures_have_the_digits_that_their_error_supports() {
        let said = to_error([568.988_17, 0.631_83, 567.704_13, 570.272_2], 0.631_83);
        assert_eq!(said, ["568.99", "0.63", "567.70", "570.27"]);
        assert_eq!(to_error([1.234_567e-5, 2.3e-7], 2.3e-7), ["1.235e-5", "0.023e-5"]);
        assert_eq!(to_error([8_437.3, 312.0], 312.0), ["8440", "310"]);
        assert_eq!(to_error([-0.001, 0.099_9], 0.099_9), ["0.00", "0.10"]);
        assert_eq!(to_error([1.5], 0.0), ["1.50000"]);
    }

    #[test]
    fn numbers_have_the_digits_that_they_support() {
        for (value, half, unit, said) in [
            (0.04113, 0.00122, "ohm", "41 mohm"),
            (0.43048, 0.038, "s", "0.43 s"),
            (8437.0, 30.0, "rpm", "8440 rev/min"),
            (0.0943, 0.0105, "ohm", "94 mohm"),
            (6.83e-5, 2e-6, "kg.m2", "6.8e-5 kg.m2"),
            (-0.25, 0.004, "N", "-0.250 N"),
            (12.0, 0.0, "rows", "12 rows"),
        ] {
            assert_eq!(sized(&parameter(value, half, unit)).as_deref(), Some(said), "{value} +- {half}");
        }
        assert_eq!(sized(&parameter(0.04, 0.03, "ohm")), None, "an interval this wide supports no number");
        assert_eq!(amount(0.0237, "N"), "0.024 N");
        assert_eq!(amount(0.35241, "A"), "0.35 A");
        assert_eq!([rms(0.35241, "A"), rms(314.7, "rpm"), rms(0.0825, "V")], ["0.352 A", "315 rev/min", "82.5 mV"]);
    }

    #[test]
    fn an_adverb_stands_between_subject_and_predicate() {
        let clause = Clause::new("the load cell", "creeps");
        assert_eq!(clause.with("probably"), "the load cell probably creeps");
        assert_eq!(clause.sentence(), "The load cell creeps.");
        assert_eq!(Clause::new("", "the body drags").with("perhaps"), "perhaps the body drags");
    }

    #[test]
    fn what_was_counted_is_a_whole_number() {
        let rows = parameter(4.0, 0.0, "rows");
        assert_eq!((counted(&rows).as_deref(), sized(&rows).as_deref()), (Some("4"), Some("4 rows")));
        assert_eq!(counted(&parameter(4.0, 0.1, "rows")), None);
    }

    #[test]
    fn what_cannot_be_below_zero_has_an_upper_bound() {
        assert!(upper_bound(&parameter(0.002, 0.0233, "s")).is_some_and(|v| (v - 0.0253).abs() < 1e-12));
        assert_eq!(upper_bound(&parameter(0.02, 0.01, "s")), None, "an interval above zero is one");
        assert_eq!(upper_bound(&parameter(0.002, 0.02, "N/s")), None, "a drift has a sign");
        assert_eq!(upper_bound(&parameter(-0.002, 0.02, "s")), None, "what is early is no bound");
        assert!(upper_bound(&parameter(-3.6e-6, 5.3e-6, "kg.m2")).is_some(), "no inertia is below zero");
        let instant = Parameter { name: "t0".into(), ..parameter(0.2, 1.0, "s") };
        assert_eq!(upper_bound(&instant), None);
    }

    #[test]
    fn channels_have_words() {
        for (name, said) in [
            ("rpm_4", "speed of rotor 4"),
            ("rpm_hall", "speed (Hall)"),
            ("ang_acc_x", "angular acceleration (x)"),
            ("acc_z", "specific force (z)"),
            ("thrust_n", "thrust"),
            ("mine_x", "mine_x"),
        ] {
            assert_eq!(channel(name), said);
        }
    }

    #[test]
    fn no_rounding_makes_certain() {
        assert_eq!(
            (probability(0.9999), probability(0.001), probability(0.88)),
            ("> 0.99".into(), "< 0.01".into(), "0.88".into())
        );
    }
}
