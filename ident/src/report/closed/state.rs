//! The state of every channel: what is left over before and after, as bars in noise floors.
//!
//! What it is: one scale for all channels, logarithmic, with the floor drawn, so that unlike channels can be compared.
//! What can go wrong: a channel below its floor ends left of the floor's line.
//! Units: noise floors; the figures beside the bars carry the channel's own.
//! Reference: none.

use super::evidence::pair;
use super::lost;
use super::sentence::is_of_steps;
use crate::attribution::unexplained::LOUD;
use crate::report::svg::escape;
use crate::verdict::words::{channel, digits, scaled, upper};
use crate::verdict::{Channel, Channels, Kind, Verdict};
use std::fmt::Write;

/// Left end of the scale, noise floors.
const FROM: f64 = 0.5;
/// Per cent of the scale that the word at the floor needs for itself where the scale is narrowest.
const CLEAR: f64 = 22.0;
/// Noise floors up to which a channel counts as explained.
pub(super) const EXPLAINED: f64 = 1.5;

/// The scale that all bars share.
struct Scale {
    to: f64,
}

impl Scale {
    fn of(channels: &Channels) -> Self {
        let most = channels.values().flat_map(|c| [c.before, c.after].map(|f| f.heldout_rms / c.noise_floor_rms));
        Self { to: 1.25 * most.filter(|v| v.is_finite()).fold(8.0, f64::max) }
    }

    /// Place on the scale, per cent of its length.
    fn at(&self, floors: f64) -> f64 {
        (100.0 * (floors.max(FROM) / FROM).ln() / (self.to / FROM).ln()).clamp(0.0, 100.0)
    }

    fn ticks(&self) -> impl Iterator<Item = f64> + '_ {
        let clear = |v: &f64| *v == 1.0 || self.at(*v) - self.at(1.0) >= CLEAR;
        (0..7).map(|k| 10f64.powi(k)).take_while(|v| *v <= self.to).filter(clear)
    }
}

/// The figures of a channel in one unit: floor, before, after.
pub(super) fn figures(unit: &str, floor: f64, before: f64, after: f64) -> [String; 3] {
    let (factor, unit) = scaled(before.max(after), unit);
    [floor, before, after].map(|v| format!("{} {unit}", digits(factor * v, 0.005 * (factor * v).abs())))
}

/// Whether what remains on a channel is more than noise, and where.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Rest {
    /// It is noise.
    None,
    /// It lies where the load changes, where every rig has some: when in its row a reading lies is not known.
    AtSteps,
    /// It lies where the load is held as well.
    Anywhere,
}

impl Rest {
    /// What a verdict has on a channel.
    pub(super) fn on(v: &Verdict, name: &str) -> Self {
        match v.unexplained.iter().find(|u| u.channel == name) {
            Some(u) if is_of_steps(u) => Self::AtSteps,
            Some(_) => Self::Anywhere,
            None => Self::None,
        }
    }
}

/// What is said of a channel in a word. `rest`: where what remains lies; `named`: a name improves it; `known`: nothing has changed since the
/// declared model was made, so that what remains was there before.
pub(super) fn word([before, after]: [f64; 2], rest: Rest, named: bool, known: bool) -> &'static str {
    let left = rest != Rest::None;
    match after {
        f if !f.is_finite() => "not known",
        f if known && (left || f > EXPLAINED) => "as before",
        f if f > LOUD && rest == Rest::AtSteps => "left at steps",
        f if f > LOUD => "unexplained rest",
        f if f > EXPLAINED => "little left",
        _ if left => "a trace left",
        _ if before <= EXPLAINED && !named => "only noise",
        _ => "explained",
    }
}

/// Whether nothing has changed since the declared model was made: what remains is what it was off by then.
pub(super) fn is_as_before(v: &Verdict, news: bool) -> bool {
    news && v.verdict == Kind::None
}

/// The channels that a name improves most.
pub(super) fn named(verdict: &Verdict) -> Vec<&str> {
    let named = verdict.effects.iter().filter(|e| e.id != "unknown" && e.heldout_error_reduction > 0.0);
    named.filter_map(|e| e.channels.first()).map(String::as_str).collect()
}

/// A channel as people say it, with its column's name where that is another word.
fn spoken(name: &str) -> String {
    let said = channel(name);
    if said == name { escape(name) } else { format!("{} <code>{}</code>", escape(&upper(&said)), escape(name)) }
}

/// The bars of a verdict's channels.
pub(super) fn state(v: &Verdict, declared: &str, per_cent: bool, known: bool) -> String {
    let left: Vec<(&str, Rest)> = v.unexplained.iter().map(|u| (u.channel.as_str(), Rest::on(v, &u.channel))).collect();
    let beside = v.unexplained.iter().filter_map(|u| {
        let one = u.channel.strip_suffix(" - others")?;
        Some(format!("{} against the other sensors: {:.1} noise floors left", upper(&channel(one)), u.over_floor))
    });
    let beside: String = beside.map(|said| format!("<p class=\"soft\">{}.</p>\n", escape(&said))).collect();
    let share = if per_cent {
        " A share in per cent is of the squared error above the noise floor: 75 % less is half the error."
    } else {
        ""
    };
    let key = format!("<p class=\"soft\">The declared model: {declared}.{share}</p>\n");
    let stays = lost::key(v);
    let stays: String = stays.iter().map(|said| format!("<p class=\"soft\">{}</p>\n", escape(said))).collect();
    let told =
        Told { left: &left, named: &named(v), stays: &lost::floors(v).into_iter().map(|f| f.0).collect::<Vec<_>>(), known };
    drawn(&lost::drawn(v), &told, pair(v)) + &beside + &stays + &key
}

/// The bars of channels of which nothing but the errors is known.
pub(crate) fn bars(channels: &Channels, names: [&str; 2]) -> String {
    drawn(channels, &Told { left: &[], named: &[], stays: &[], known: false }, names)
}

/// What is known of the channels beside their errors.
struct Told<'t> {
    /// Those on which more than noise is left, and where.
    left: &'t [(&'t str, Rest)],
    /// Those that a name improves.
    named: &'t [&'t str],
    /// Those whose scatter is a fault that has a name.
    stays: &'t [&'t str],
    /// Whether nothing has changed since the declared model was made.
    known: bool,
}

impl Told<'_> {
    /// The state of a channel in a word.
    fn word(&self, name: &str, floors: [f64; 2]) -> &'static str {
        if self.stays.contains(&name) {
            return STAYS;
        }
        let rest = self.left.iter().find(|(left, _)| *left == name).map_or(Rest::None, |(_, rest)| *rest);
        word(floors, rest, self.named.contains(&name), self.known)
    }
}

/// The state of a sensor whose scatter is a fault that has a name.
pub(super) const STAYS: &str = "fault stays";

fn drawn(channels: &Channels, told: &Told<'_>, [_, after]: [&str; 2]) -> String {
    let scale = Scale::of(channels);
    let mut out = String::from("<div class=\"state\" role=\"table\" aria-label=\"error of each channel before and after\">\n");
    out +=
        "<div class=\"head\" role=\"row\"><span role=\"columnheader\">channel</span><span class=\"axis\" role=\"columnheader\">";
    for tick in scale.ticks() {
        let name = if tick == 1.0 { "floor".to_owned() } else { format!("{tick:.0}") };
        let (at, end) = match scale.at(tick) {
            at if at > 94.0 => (at, " class=\"end\""),
            at if at < 6.0 => (at, " class=\"begin\""),
            at => (at, ""),
        };
        let _ = write!(out, "<i{end} style=\"left:{at:.1}%\">{name}</i>");
    }
    out += "</span><span role=\"columnheader\">before</span><span role=\"columnheader\">after</span><span role=\"columnheader\">factor</span><span role=\"columnheader\">state</span></div>\n";
    for (name, c) in channels {
        let floors = [c.before, c.after].map(|f| f.heldout_rms / c.noise_floor_rms);
        let [floor, before, after] = figures(&c.unit, c.noise_floor_rms, c.before.heldout_rms, c.after.heldout_rms);
        let label = format!("{}: before {:.1}, after {:.1} noise floors", channel(name), floors[0], floors[1]);
        let _ = write!(
            out,
            "<div class=\"row\" role=\"row\"><span class=\"name\" role=\"cell\">{}</span><span class=\"track\" role=\"img\" aria-label=\"{}\" title=\"{}; floor {floor}\">",
            spoken(name),
            escape(&label),
            escape(&label),
        );
        for tick in scale.ticks() {
            let _ = write!(
                out,
                "<i class=\"{}\" style=\"left:{:.1}%\"></i>",
                if tick == 1.0 { "floor" } else { "tick" },
                scale.at(tick)
            );
        }
        for (class, value) in [("before", floors[0]), ("after", floors[1])] {
            let (a, b) = (scale.at(value.min(1.0)), scale.at(value.max(1.0)));
            let _ = write!(out, "<b class=\"{class}\" style=\"left:{a:.1}%;width:{:.1}%\"></b>", (b - a).max(0.6));
        }
        let _ = writeln!(
            out,
            "</span><span class=\"num\" role=\"cell\" data-of=\"before\">{before}</span><span class=\"num\" role=\"cell\" data-of=\"after\">{after}</span><span class=\"num\" role=\"cell\" data-of=\"factor\">{}</span><span class=\"word\" role=\"cell\">{}</span></div>",
            factor(c.before.heldout_rms, c.after.heldout_rms),
            told.word(name, floors),
        );
    }
    for (name, reason) in &channels.not_predicted {
        let _ = writeln!(
            out,
            "<div class=\"row none\" role=\"row\"><span class=\"name\" role=\"cell\">{}</span><span class=\"why\" role=\"cell\">not predicted: {}</span></div>",
            spoken(name),
            escape(reason)
        );
    }
    let after = match after {
        "" => "the same: nothing was added".to_owned(),
        "corrected, after" => "corrected model, after".to_owned(),
        after => after.to_owned(),
    };
    let ends = |c: &Channel| [c.before, c.after].iter().any(|f| f.heldout_rms < FROM * c.noise_floor_rms);
    let cut = if channels.values().any(ends) { " A bar that ends at the left edge is below half a floor." } else { "" };
    let _ = writeln!(
        out,
        "</div>\n<p class=\"soft key\"><b class=\"before\"></b> hollow: declared model, before <b class=\"after\"></b> solid: {}. Logarithmic, in noise floors of each channel. Error on rows that no fit saw.{cut}</p>",
        escape(&after)
    );
    out
}

/// A factor to three digits at the most.
pub(super) fn factor(before: f64, after: f64) -> String {
    if before == 0.0 || !(before / after).is_finite() {
        return "-".to_owned();
    }
    // what is one to three digits is one
    let factor = Some(before / after).filter(|f| (f - 1.0).abs() >= 5e-4).unwrap_or(1.0);
    format!("{}x", digits(factor, 0.01 * factor.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verdict::Figures;

    #[test]
    fn no_state_contradicts_what_stands_beside_it() {
        for (floors, rest, named, said) in [
            ([1.2, 0.9], Rest::None, false, "only noise"),
            ([1.2, 0.9], Rest::None, true, "explained"),
            ([40.0, 1.2], Rest::None, false, "explained"),
            ([1.2, 0.8], Rest::Anywhere, false, "a trace left"),
            ([40.0, 2.0], Rest::AtSteps, true, "little left"),
            ([40.0, 3.5], Rest::Anywhere, true, "unexplained rest"),
            ([40.0, 3.5], Rest::AtSteps, true, "left at steps"),
            ([40.0, f64::NAN], Rest::None, false, "not known"),
        ] {
            assert_eq!(word(floors, rest, named, false), said, "{floors:?} {rest:?} {named}");
        }
        // nothing is unexplained of what the model is known to be off by
        for (floors, rest, said) in [
            ([3.5, 3.5], Rest::Anywhere, "as before"),
            ([2.0, 2.0], Rest::None, "as before"),
            ([1.2, 0.9], Rest::None, "only noise"),
        ] {
            assert_eq!(word(floors, rest, false, true), said, "{floors:?} {rest:?}");
        }
    }

    #[test]
    fn bars_share_a_scale_and_end_at_the_floor() {
        let of = |rms: f64| Figures { rms, heldout_rms: rms, across_runs_rms: None, whiteness_p: 0.5 };
        let mut channels = Channels::default();
        for (name, before) in [("thrust_n", 1.0), ("current_a", 0.1)] {
            let c = Channel { unit: "N".into(), noise_floor_rms: 0.01, before: of(before), after: of(0.01) };
            channels.predicted.insert(name.into(), c);
        }
        channels.not_predicted.insert("rpm".into(), "no command was logged".into());
        let html = bars(&channels, ["declared, nothing added", ""]);
        assert!(!html.contains("corrected"), "{html}");
        assert!(!html.contains("half a floor"), "none of these is");
        let scale = Scale::of(&channels);
        assert!(scale.at(1.0) > 0.0 && scale.at(100.0) < 100.0 && scale.at(0.1) == 0.0);
        assert!((scale.at(100.0) - scale.at(10.0) - (scale.at(10.0) - scale.at(1.0))).abs() < 1e-9, "logarithmic");
        assert!(html.contains(">floor<") && html.contains("not predicted: no command was logged") && html.contains("explained"));
        assert_eq!(html.matches("<div").count(), html.matches("</div>").count());
    }
}
