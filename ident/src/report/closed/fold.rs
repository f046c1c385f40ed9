//! What is folded away: every channel, candidates that lost, what was set aside.
//!
//! What it is: sections that a reader opens who wants to know why.
//! What can go wrong: long lists are cut, and say so; the verdict's file has them whole.
//! Units: as stated.
//! Reference: specification `report.md`.

use super::contest::{open, rivals};
use super::page::Page;
use super::state::figures;
use crate::attribution::diagnose::Diagnosis;
use crate::effects::placed::Placed;
use crate::report::sheet::Sheet;
use crate::signal::bad::SetAside;
use crate::verdict::words::{channel, channels as spoken, probability};
use crate::verdict::{EffectEntry, Verdict};

/// Most lines of a list on a page.
const MOST: usize = 100;

/// The errors of every channel in numbers.
pub(crate) fn channels(sheet: &mut Sheet, verdict: &Verdict, held_out: &str) {
    let rows: Vec<Vec<String>> = verdict
        .channels
        .iter()
        .map(|(name, c)| {
            let [floor, before, after] = figures(&c.unit, c.noise_floor_rms, c.before.heldout_rms, c.after.heldout_rms);
            let [_, rms_before, rms_after] = figures(&c.unit, c.noise_floor_rms, c.before.rms, c.after.rms);
            let white = |p: f64| if p < 0.001 { "< 0.001".to_owned() } else { format!("{p:.3}") };
            vec![channel(name), floor, before, after, rms_before, rms_after, white(c.after.whiteness_p)]
        })
        .collect();
    let raw: Vec<Vec<String>> = verdict
        .channels
        .iter()
        .map(|(name, c)| {
            let values =
                [c.noise_floor_rms, c.before.heldout_rms, c.after.heldout_rms, c.before.rms, c.after.rms, c.after.whiteness_p];
            [name.clone(), c.unit.clone()].into_iter().chain(values.map(|v| v.to_string())).collect()
        })
        .collect();
    let head = ["channel", "noise floor", "held-out before", "held-out after", "rms before", "rms after", "whiteness after, p"];
    let raw_head = [
        "channel",
        "unit",
        "noise_floor_rms",
        "before_heldout_rms",
        "after_heldout_rms",
        "before_rms",
        "after_rms",
        "after_whiteness_p",
    ];
    let what = if verdict.runs.is_empty() {
        format!("{held_out}, each predicted by a fit that did not see it")
    } else {
        "each run whole, predicted by a fit to the others".to_owned()
    };
    sheet.say(&format!(
        "Held-out: {what}. The share that the sentence states is that of the squared held-out error above the noise floor."
    ));
    sheet.data("channels", &head, &rows, Some((&raw_head, &raw)));
}

/// How sure each name is, and what stands against it.
pub(super) fn sureness(sheet: &mut Sheet, page: &Page<'_>) {
    let v = page.verdict;
    let row = |(k, e): (usize, &EffectEntry)| {
        let against = rivals(v, page.words, k);
        let told: Vec<String> = against.iter().map(|r| format!("{} {}", r.ids.join(" + "), probability(r.probability))).collect();
        let told = if told.is_empty() { "none".to_owned() } else { told.join(", ") };
        vec![e.id.clone(), spoken(&e.channels), probability(e.probability), told, probability(open(e, &against))]
    };
    let rows: Vec<Vec<String>> = v.effects.iter().enumerate().filter(|(_, e)| e.id != "unknown").map(row).collect();
    if rows.is_empty() {
        return;
    }
    sheet.fold("How sure each name is", |sheet| {
        sheet.say("A rival's probability is that of it in the place of the name, all else as it is. What no name has is kept for causes that the library lacks, and for there being none.");
        sheet.data("probabilities", &["effect", "on", "p", "rivals", "kept open"], &rows, None);
    });
}

/// Samples and channels that took no part.
pub(crate) fn aside(sheet: &mut Sheet, verdict: &Verdict) {
    let mut lines: Vec<Vec<String>> = verdict.left_out.iter().map(|l| vec![l.to_string()]).collect();
    lines.extend(verdict.set_aside.iter().map(|a| vec![a.to_string()]));
    if lines.is_empty() {
        return;
    }
    let raw = |a: &SetAside| {
        let counts = [a.row, a.rows].map(|n| n.to_string());
        let figures = [a.t_s, a.until_s, a.value, a.expected].map(|v| v.to_string());
        std::iter::once(a.channel.clone()).chain(counts).chain(figures).collect()
    };
    let raw: Vec<Vec<String>> = verdict.set_aside.iter().map(raw).collect();
    let all = lines.len();
    lines.truncate(MOST);
    if all > MOST {
        lines.push(vec![format!("and {} more, listed in verdict.json", all - MOST)]);
    }
    sheet.fold("What took no part", |sheet| {
        let raw_head = ["channel", "row", "rows", "t_s", "until_s", "value", "expected"];
        sheet.data("set-aside", &["what, and why"], &lines, Some((&raw_head, &raw)));
    });
}

/// An effect, and its form where it has several.
fn named(placed: &Placed) -> String {
    let form = &placed.instance.form;
    if form.is_empty() { placed.effect.id().to_owned() } else { format!("{} ({form})", placed.effect.id()) }
}

/// Whether what was asked is in the result, on the same channels and in the same form.
fn fate(best: &[Placed], asked: &Placed) -> &'static str {
    if best.iter().any(|kept| kept.is_like(asked)) { "kept" } else { "lost" }
}

/// The candidates of each round, with their evidence.
pub(crate) fn candidates(sheet: &mut Sheet, diagnosis: &Diagnosis) {
    let best = &diagnosis.best.fit.placed;
    let rows: Vec<Vec<String>> = diagnosis
        .candidates
        .iter()
        .enumerate()
        .flat_map(|(round, list)| {
            list.iter().filter_map(move |c| {
                let placed = c.fit.placed.last()?;
                let on: Vec<String> = placed.instance.channels.iter().map(|c| channel(c)).collect();
                Some(vec![
                    (round + 1).to_string(),
                    named(placed),
                    format!("{:.1}", c.evidence),
                    fate(best, placed).to_owned(),
                    on.join(", "),
                ])
            })
        })
        .take(MOST)
        .collect();
    if rows.is_empty() {
        return;
    }
    sheet.fold("Candidates that were asked", |sheet| {
        sheet.say(
            "Each round asks every effect beside what was found before, in this order. Evidence in nats over the declared model.",
        );
        sheet.data("candidates", &["round", "effect", "evidence", "fate", "channels"], &rows, None);
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{Instance, by_id};

    /// The same effect on another channel, or in another form, was not kept.
    #[test]
    fn only_what_is_in_the_result_was_kept() {
        let effect = by_id("channel_filter").expect("an effect");
        let of = |channel: &str, form: &str| Placed { effect, instance: Instance::new(&[channel], form), shape: vec![0.5] };
        let best = [of("thrust_n", "")];
        let asked = [of("thrust_n", ""), of("torque_nm", ""), of("thrust_n", "rms")];
        assert_eq!(asked.each_ref().map(|p| fate(&best, p)), ["kept", "lost", "lost"]);
        assert_eq!(asked.each_ref().map(named), ["channel_filter", "channel_filter", "channel_filter (rms)"]);
    }
}
