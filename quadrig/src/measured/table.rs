//! The tables of what corrected models are worth on other runs.
//!
//! What it is: one row a set with its figures beside their aims, the worst predictions by name, and each set's own predictions.
//! What can go wrong: nothing; a set without a second run has no row.
//! Units: errors in noise floors or in the channel's unit, as the heads say.
//! Reference: specification `closing-the-loop.md`, "Real measurements".

use super::Outcome;
use super::page::three;
use super::transfer::{Prediction, Transfer};
use std::fmt::Write;

/// Predictions that the summary names.
const WORST: usize = 12;
/// Predictions that a set's page lists.
const LISTED: usize = 40;
/// The set that outnumbers all others: more than a hundred tables of eleven rows.
const TABLES: &str = "fivein-static-tables";

/// Share in per cent, or nothing.
fn share(part: usize, all: usize) -> String {
    if all == 0 { "-".to_owned() } else { format!("{:.0} % ({part} of {all})", 100.0 * part as f64 / all as f64) }
}

/// One row: the figures of a set.
pub(crate) fn line(name: &str, t: &Transfer) -> String {
    let loud = t.loud().count();
    let factor = t.factor();
    format!(
        "| {name} | {} | {} | {loud} | {} | {} | {} | {} | {} |",
        t.rigs,
        t.predictions.len(),
        if factor.is_finite() { format!("{factor:.2}") } else { "-".to_owned() },
        share(t.loud().filter(|p| p.is_worse()).count(), loud),
        share(t.predictions.iter().filter(|p| !p.is_loud() && p.is_worse()).count(), t.predictions.len() - loud),
        share(t.loud().filter(|p| p.is_quiet_after()).count(), loud),
        share(t.names.0, t.names.1)
    )
}

/// The section of the summary page.
pub(crate) fn index(outcomes: &[Outcome]) -> String {
    let sum = |wanted: &dyn Fn(&Outcome) -> bool| {
        outcomes.iter().filter(|o| wanted(o)).fold(Transfer::default(), |sum, o| sum.and(&o.transfer))
    };
    let all = sum(&|_| true);
    if all.is_empty() {
        return String::new();
    }
    let mut out = String::from(
        "\n## On runs that took no part\n\nThe model that was corrected on one run predicts every other run of its rig, by its relations. One constant a channel (the tare) is taken off. The declared model of the same run is treated alike. \
         The factor is error before over error after: the geometric mean over the predictions whose declared error is above three noise floors. An error below the floor counts as the floor.\n\n\
         | set | rigs | predictions | above three floors | factor | worse by more than 5 % | of the others | then within three floors | names that come back |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n\
         | *aim* | | | | *3* | *0 %* | *0 %* | | *95 %* |\n",
    );
    for o in outcomes.iter().filter(|o| !o.transfer.is_empty()) {
        let _ = writeln!(out, "{}", line(o.set.folder, &o.transfer));
    }
    let _ = writeln!(out, "{}", line(&format!("**all but {TABLES}**"), &sum(&|o| o.set.folder != TABLES)));
    let _ = writeln!(out, "{}", line("**all**", &all));
    let held = |wanted: &dyn Fn(&Outcome) -> bool| {
        let tried = || outcomes.iter().filter(|o| wanted(o)).flat_map(|o| &o.tried).filter(|t| t.holds());
        share(tried().filter(|t| t.named_there).count(), tried().count())
    };
    let _ = writeln!(
        out,
        "\nA name may be of something that another run does not show: a current limit at a lower voltage, for instance. Of the causes that hold on another run \
         (table above) that run's own verdict names {}, and {} of all but {TABLES}.",
        held(&|_| true),
        held(&|o| o.set.folder != TABLES)
    );
    out.push_str(
        "\nNames: each name of a run, sought in the verdict of each other run of its rig. A correction without a name is none. \
         A rig at two supply voltages turns at another speed for the same pulse: no constant takes that off. The corrected model follows the voltage \
         that was measured, the declared one does not. \
         A prediction that runs away stays in the mean, and there it outweighs all others: the list of the worst shows it.\n",
    );
    let mut worst: Vec<(&str, &Prediction)> =
        outcomes.iter().flat_map(|o| o.transfer.loud().map(|p| (o.set.folder, p))).filter(|(_, p)| p.is_worse()).collect();
    worst.sort_by(|a, b| a.1.factor().total_cmp(&b.1.factor()));
    if !worst.is_empty() {
        let _ = writeln!(
            out,
            "\nThe worst of them, of {} that are worse:\n\n| set | corrected on | predicted | channel | floor | declared | corrected | factor |\n| --- | --- | --- | --- | --- | --- | --- | --- |",
            worst.len()
        );
        for (set, p) in worst.into_iter().take(WORST) {
            let _ = writeln!(out, "| {set} {}", row(p));
        }
    }
    out
}

/// The section on several runs in one fit.
pub(crate) fn together(outcomes: &[Outcome]) -> String {
    let with_runs = |of: &dyn Fn(&Outcome) -> Transfer| -> Vec<(&str, Transfer)> {
        outcomes.iter().map(|o| (o.set.folder, of(o))).filter(|(_, t)| !t.is_empty()).collect()
    };
    let (blind, fitted) = (with_runs(&|o| o.together.blind.clone()), with_runs(&|o| o.together.fitted.clone()));
    if fitted.is_empty() {
        return String::new();
    }
    let head = "| set | rigs | predictions | above three floors | factor | worse by more than 5 % | of the others | then within three floors | names that come back |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n";
    let rows = |list: &[(&str, Transfer)]| {
        let mut out = String::new();
        list.iter().for_each(|(name, t)| out += &format!("{}\n", line(name, t)));
        let all = list.iter().fold(Transfer::default(), |sum, (_, t)| sum.and(t));
        out + &format!("{}\n", line("**all**", &all))
    };
    format!(
        "\n## Several runs together\n\n`quadrig close-loop RUN...` fits the runs of a rig at once. Here names and values come from all runs but one, and predict that one, which nothing had seen. Rigs with three runs or more.\n\n{head}{}\nNames: each name and channel of such a set, sought in the sets without another run.\n\nOf all rigs with two runs or more: names that were found on all runs, their values from all but the one that is predicted. This is what the verdict quotes. The names had seen the run.\n\n{head}{}",
        rows(&blind),
        rows(&fitted)
    )
}

/// The section of a set's page.
pub(crate) fn pairs(t: &Transfer) -> String {
    if t.is_empty() {
        return String::new();
    }
    let mut listed: Vec<&Prediction> = t.loud().collect();
    listed.sort_by(|a, b| a.factor().total_cmp(&b.factor()));
    let mut out = format!(
        "\n## Predicted by another run's model\n\nDeclared errors above three noise floors, the least improved first{}. One constant a channel is taken off.\n\n| corrected on | predicted | channel | floor | declared | corrected | factor |\n| --- | --- | --- | --- | --- | --- | --- |\n",
        if listed.len() > LISTED { format!(": {LISTED} of {}", listed.len()) } else { String::new() }
    );
    for p in listed.into_iter().take(LISTED) {
        let _ = writeln!(out, "{}", row(p));
    }
    out
}

fn row(p: &Prediction) -> String {
    format!(
        "| {} | {} | {} | {} | {} | {} | {:.2} |",
        p.from,
        p.on,
        p.channel,
        three(p.floor),
        three(p.before),
        three(p.after),
        p.factor()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_counts_loud_and_quiet_predictions_apart() {
        let p = |before: f64, after: f64| Prediction {
            from: "a".into(),
            on: "b".into(),
            channel: "thrust_n",
            floor: 0.01,
            before,
            after,
        };
        let t = Transfer { rigs: 1, predictions: vec![p(0.08, 0.02), p(0.08, 0.16), p(0.02, 0.04)], names: (3, 4) };
        assert_eq!(
            line("set", &t),
            "| set | 1 | 3 | 2 | 1.41 | 50 % (1 of 2) | 100 % (1 of 1) | 50 % (1 of 2) | 75 % (3 of 4) |"
        );
        assert!(pairs(&t).contains("| a | b | thrust_n | 0.0100 | 0.0800 | 0.160 | 0.50 |"), "{}", pairs(&t));
    }
}
