//! Texts in which columns, relations and forms are told as people say them.
//!
//! What it is: what the search writes down for programs (`thrust(rpm)`, `rpm_hall`, `[over_the_row]`) in words for a page.
//! What can go wrong: a name that has no other word stays as it is.
//! Units: none.
//! Reference: `words::channel`.

use super::{channel, list};
use crate::verdict::EffectEntry;

/// Most terms of a correction without a name.
pub(crate) const MOST_TERMS: usize = 6;

const SEPARATOR: &str = ", terms ";

/// The form of a correction: so many terms of a polynomial in a variable.
pub(crate) fn form(variable: &str, terms: usize) -> String {
    format!("{variable}{SEPARATOR}{terms}")
}

/// Variable and number of terms of a form. An empty one is no correction; a variable alone has all terms.
pub(crate) fn parts(form: &str) -> (&str, usize) {
    match form.rsplit_once(SEPARATOR) {
        Some((variable, terms)) => (variable, terms.parse().unwrap_or(0)),
        None if form.is_empty() => (form, 0),
        None => (form, MOST_TERMS),
    }
}

/// A text whose columns, and relations such as thrust(rpm), are told as people say them.
#[must_use]
pub fn plain(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some(from) = rest.find(is_of_a_name) {
        out += &rest[..from];
        let name = first_name(&rest[from..]);
        let after = &rest[from + name.len()..];
        (out, rest) = match relation(name, after) {
            Some((said, after)) => (out + &said, after),
            // a word without an underscore is a word
            None if name.contains('_') => (out + &channel(name), after),
            None => (out + name, after),
        };
    }
    out + rest
}

/// A text in which the time that something takes is called what it is: a time constant, not the time in which it is over.
#[must_use]
pub fn over_time(text: &str) -> String {
    let mut parts = text.split("within ");
    let mut out = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let is_time = part.starts_with(|c: char| c.is_ascii_digit());
        out += if is_time { "with a time constant of " } else { "within " };
        out += part;
    }
    out
}

/// Channels in a row; those of one quantity share its name: "voltage and speed (beam and Hall)", "speed of rotors 1 and 2".
#[must_use]
pub fn channels(names: &[String]) -> String {
    const ROTOR: &str = "speed of rotor";
    let mut groups: Vec<(String, Vec<String>)> = Vec::new();
    for name in names {
        let said = channel(name);
        let (of, one) = match said.strip_suffix(')').and_then(|s| s.split_once(" (")) {
            Some((of, one)) => (of, Some(one)),
            None => said.strip_prefix(ROTOR).map_or((said.as_str(), None), |one| (ROTOR, Some(one.trim_start()))),
        };
        match groups.iter_mut().find(|(quantity, _)| quantity == of) {
            Some((_, members)) => members.extend(one.map(str::to_owned)),
            None => groups.push((of.to_owned(), one.map(str::to_owned).into_iter().collect())),
        }
    }
    let told = |(of, mut members): (String, Vec<String>)| {
        members.sort_unstable_by_key(|member| member.to_lowercase());
        match members.len() {
            0 => of,
            1 if of == ROTOR => format!("{of} {}", list(&members)),
            _ if of == ROTOR => format!("{of}s {}", list(&members)),
            _ => format!("{of} ({})", list(&members)),
        }
    };
    list(&groups.into_iter().map(told).collect::<Vec<_>>())
}

fn is_of_a_name(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}

fn first_name(text: &str) -> &str {
    &text[..text.find(|c| !is_of_a_name(c)).unwrap_or(text.len())]
}

/// "thrust against the speed" for `thrust` with "(rpm)" behind it, and what comes after.
fn relation<'t>(of: &str, behind: &'t str) -> Option<(String, &'t str)> {
    let inside = behind.strip_prefix('(')?;
    let over = first_name(inside);
    let after = inside[over.len()..].strip_prefix(')')?;
    let known = |name: &str| ["rpm", "pulse", "thrust", "torque", "current", "voltage"].contains(&name);
    (known(of) && known(over)).then(|| (format!("{} against the {}", channel(of), channel(over)), after))
}

/// An equation without the mark of its form, and that form in words.
fn formula(equation: &str) -> (&str, Option<String>) {
    let marked = equation.strip_suffix(']').and_then(|e| e.rsplit_once(" ["));
    match marked {
        Some((equation, form)) => (equation, Some(plain(form).replace('_', " "))),
        None => (equation, None),
    }
}

/// What stands between two ways in which an effect may act, the second of which is a form of its own.
const EITHER: [&str; 6] = [
    "; or, as play: ",
    "; smooth: ",
    "; form whole_blade: ",
    "; a rotor between winding and air, ",
    "; lithium cells: ",
    ", or ",
];
/// What stands before what an effect does besides: in a form of its own, and against a declared model.
const BESIDES: [&str; 2] = ["; at the same power also ", "; against a declared model also "];

/// An equation without what an effect that has none of these parameters does not do besides.
fn with_besides(equation: &str, has: impl Fn(&str) -> usize) -> String {
    let mut at: Vec<(usize, &str)> = BESIDES.iter().flat_map(|mark| equation.match_indices(mark)).collect();
    at.sort_unstable();
    let mut out = equation[..at.first().map_or(equation.len(), |first| first.0)].to_owned();
    for (k, (from, mark)) in at.iter().enumerate() {
        let part = &equation[from + mark.len()..at.get(k + 1).map_or(equation.len(), |next| next.0)];
        if has(part) > 0 {
            out += mark;
            out += part;
        }
    }
    out
}

/// The equation that is in force: of an effect that may act in several ways the one whose parameters it has, without quotation marks, and its
/// form in words where the equation alone does not tell it.
#[must_use]
pub fn in_force(e: &EffectEntry) -> (String, Option<String>) {
    let (whole, form) = formula(&e.equation);
    let has = |text: &str| e.parameters.iter().filter(|p| is_told_in(&p.name, text)).count();
    let whole = with_besides(whole, has);
    let whole = whole.as_str();
    let form = form.filter(|f| !BESIDES.iter().any(|mark| mark.contains(f.as_str()) && whole.contains(mark)));
    let ways = EITHER.iter().find_map(|between| Some((between, whole.split_once(between)?)));
    // ways that share a part, such as that of the heat, are told together
    let apart = |second: &str| second.contains('=') && second.starts_with(|c: char| c.is_ascii_alphabetic());
    let (told, form) = match ways.filter(|(between, (_, second))| **between != ", or " || apart(second)) {
        Some((between, (first, second))) => {
            let marked = form.as_ref().is_some_and(|f| between.replace('_', " ").contains(f.as_str()));
            (if marked || has(second) > has(first) { second } else { first }, form.filter(|_| !marked))
        }
        None => (whole, form),
    };
    (told.replace('`', ""), form)
}

/// Whether a parameter stands in an equation as a word of its own.
fn is_told_in(name: &str, equation: &str) -> bool {
    equation.split(|c| !is_of_a_name(c)).any(|word| word == name)
}

/// A correction without a name in words: "a smooth curve of pulse, 3 terms"; nothing of any other effect.
#[must_use]
pub fn curve(e: &EffectEntry) -> Option<String> {
    let form = e.equation.strip_suffix(']').filter(|_| e.id == "unknown").and_then(|of| of.rsplit_once(" ["))?.1;
    let (variable, terms) = parts(form);
    let plural = if terms == 1 { "" } else { "s" };
    (terms > 0).then(|| format!("a smooth curve of {}, {terms} term{plural}", channel(variable)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn relations_and_forms_are_words() {
        assert_eq!(
            plain("rpm(pulse) is off; thrust(rpm) holds, so does k(x) and rpm_hall"),
            "speed against the pulse is off; thrust against the speed holds, so does k(x) and speed (Hall)"
        );
        let (equation, form) = formula("torque_nm += inertia d(omega)/dt [over_the_row]");
        assert_eq!((equation, form.as_deref()), ("torque_nm += inertia d(omega)/dt", Some("over the row")));
        assert_eq!(formula("a[k] = 1"), ("a[k] = 1", None));
    }

    #[test]
    fn a_time_constant_is_no_bound() {
        assert_eq!(
            over_time("slows down as it heats up, within 2.0 s"),
            "slows down as it heats up, with a time constant of 2.0 s"
        );
        assert_eq!(over_time("within 0.05 s"), "with a time constant of 0.05 s");
        assert_eq!(over_time("within a row"), "within a row");
    }

    #[test]
    fn the_equation_in_force_is_told_alone() {
        let of = |equation: &str, names: &[&str]| {
            let parameter = |name: &&str| crate::verdict::Parameter {
                name: (*name).to_owned(),
                value: 1.0,
                unit: "1".to_owned(),
                ci95: [0.9, 1.1],
            };
            let parameters = names.iter().map(parameter).collect();
            in_force(&EffectEntry { equation: equation.to_owned(), parameters, ..crate::report::bare_entry("creep") })
        };
        let filter = "reading = mean of the truth over the last `window` seconds, or tau d(reading)/dt = truth - reading";
        assert_eq!(of(filter, &["window"]).0, "reading = mean of the truth over the last window seconds");
        let lag = of(&format!("{filter} [lag]"), &["tau", "phase"]);
        assert_eq!(lag, ("tau d(reading)/dt = truth - reading".to_owned(), Some("lag".to_owned())));
        let bends = "thrust_n += width * direction / 2 * f, f = (rpm / rpm_max)^2; or, as play: thrust_n += width * lags with slacks up to `slack`";
        assert_eq!(
            of(&format!("{bends} [play]"), &["slack", "width"]),
            ("thrust_n += width * lags with slacks up to slack".to_owned(), None)
        );
        assert_eq!(of(bends, &["width"]).0, "thrust_n += width * direction / 2 * f, f = (rpm / rpm_max)^2");
        let lags = "tau d(rpm)/dt = rpm_static - rpm, tau = tau_up or tau_down; a rotor between winding and air, dv/dt = -v^2/tau_air - friction";
        assert_eq!(of(lags, &["tau_up", "tau_down"]).0, "tau d(rpm)/dt = rpm_static - rpm, tau = tau_up or tau_down");
        let warms =
            "rpm *= 1 - derate heat (controller), or 1 - derate heat (rpm/top) with current_a += current_rise heat (winding)";
        assert_eq!(of(&format!("{warms} [winding]"), &["derate"]).0, warms, "its ways share a part");
        let sag = "voltage_v = V0 - resistance * current_a; against a declared model also rpm *= 1 - speed_loss * current_a";
        assert_eq!(of(sag, &["resistance"]).0, "voltage_v = V0 - resistance * current_a");
        assert_eq!(of(sag, &["resistance", "speed_loss"]).0, sag);
        let power =
            "voltage_v = V0 - resistance * current_a; at the same power also current_a *= (voltage_v / reference)^-exponent";
        let all = format!("{power}; against a declared model also rpm *= 1 - speed_loss * current_a");
        assert_eq!(of(&format!("{all} [same_power]"), &["exponent", "resistance"]), (power.to_owned(), None));
        assert_eq!(of(&all, &["resistance"]).0, "voltage_v = V0 - resistance * current_a");
        let turns = "rpm_x = rpm (1 + angle/180) or rpm (1 - angle/180), by turns";
        assert_eq!(of(turns, &["angle"]).0, turns);
    }

    #[test]
    fn channels_of_one_quantity_share_its_name() {
        let said = |names: &[&str]| channels(&names.iter().map(|n| (*n).to_owned()).collect::<Vec<_>>());
        assert_eq!(said(&["rpm_hall"]), "speed (Hall)");
        assert_eq!(said(&["voltage_v", "rpm_opto", "rpm_beam"]), "voltage and speed (beam and optical)");
        assert_eq!(said(&["rpm_3", "rpm_1", "rpm_4", "voltage_v"]), "speed of rotors 1, 3 and 4 and voltage");
        assert_eq!(said(&["acc_y", "acc_x", "rpm_2"]), "specific force (x and y) and speed of rotor 2");
        assert_eq!(said(&["t_s"]), "time");
    }
}
