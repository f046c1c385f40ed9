//! From which size on a cause is named, and told from each other one.
//!
//! What it is: the search is asked about the cause at one noise floor, then at half or at twice that until it begins to name it, and once more
//! between; from there on at twice the size until every other cause is left behind. Between two sizes the lead in evidence grows as the square of
//! the size, as squared distances do.
//! What can go wrong: sizes are found to a fifth (half a doubling); what is not told apart at [`FURTHEST`] times the size at which a cause
//! is named counts as never told apart.
//! Units: noise floors, nats.
//! Reference: the search's own constants, `rivals.rs` and `diagnose.rs`.

use super::ask::{Answer, Question, Rig};
use crate::attribution::evidence::Candidate;
use crate::attribution::rivals::RIVAL;
use crate::attribution::rivals::TEMPERATURE;

/// Sizes beyond the one at which a cause is named at which it is still asked about, in doublings.
const DOUBLINGS: usize = 4;
/// The same as a factor.
pub const FURTHEST: f64 = (1_u32 << DOUBLINGS) as f64;
/// Halvings of one noise floor at which the search for the smallest size ends.
const HALVINGS: usize = 6;

/// Lead in evidence, nats, below which a verdict is ambiguous: the weight of a rival is then half of the winner's and more.
pub(crate) fn needed_lead() -> f64 {
    -TEMPERATURE * RIVAL.ln()
}

/// What was asked at one size.
struct Trial {
    floors: f64,
    named: bool,
    answers: [Answer; 2],
}

impl Trial {
    /// Whether the search fits the cause with values that make sense.
    fn is_fitted(&self) -> bool {
        self.answers.iter().all(|a| a.own.is_some())
    }

    /// Lead of the cause over another one in evidence, the mean of both signs of the noise.
    fn lead(&self, other: &str) -> f64 {
        let lead = |a: &Answer| {
            let own = a.own.as_ref().map_or(f64::NEG_INFINITY, |c| c.evidence);
            let rival = a.others.iter().find(|o| o.0 == other).map_or(f64::NEG_INFINITY, |o| o.1.evidence);
            if own == f64::NEG_INFINITY { own } else { own - rival }
        };
        0.5 * (lead(&self.answers[0]) + lead(&self.answers[1]))
    }
}

/// What came of a climb.
pub(crate) struct Climbed {
    /// Size from which on the cause is named.
    pub(crate) seen: Option<f64>,
    /// Largest size that was asked about.
    pub(crate) tried: f64,
    trials: Vec<Trial>,
}

impl Climbed {
    /// Size from which on the cause is told from another one.
    pub(crate) fn apart(&self, other: &str) -> Option<f64> {
        // where a range ends the search cannot fit the cause itself: such a size says nothing of others
        let fitted = self.trials.iter().filter(|t| t.is_fitted());
        let leads: Vec<(f64, f64)> = fitted.map(|t| (t.floors, t.lead(other))).collect();
        let told = |lead: f64| lead > needed_lead();
        let first = leads.iter().rposition(|(_, lead)| !told(*lead)).map_or(0, |k| k + 1);
        let (size, lead) = *leads.get(first)?;
        let Some((below, short)) = first.checked_sub(1).map(|k| leads[k]) else { return Some(size) };
        if !short.is_finite() || !lead.is_finite() {
            return Some(size);
        }
        let share = (needed_lead() - short) / (lead - short);
        Some((below * below + share * (size * size - below * below)).sqrt())
    }

    /// Whether another cause stands beside this one at the largest size at which the search can fit this one at all.
    pub(crate) fn stays_alike(&self, other: &str) -> bool {
        let fitted = |t: &&Trial| t.is_fitted();
        let stands = |t: &Trial| t.answers.iter().any(|a| a.others.iter().any(|o| o.0 == other));
        self.trials.iter().rfind(fitted).is_some_and(|t| stands(t) && t.lead(other) <= needed_lead())
    }

    /// Whether the search could fit the cause at some size.
    pub(crate) fn is_sensible(&self) -> bool {
        self.trials.iter().any(Trial::is_fitted)
    }

    /// The cause and another one at the largest size at which both stand.
    pub(crate) fn side_by_side(&self, other: &str) -> Option<(&Candidate, &Candidate)> {
        self.trials.iter().rev().find_map(|t| {
            let answer = &t.answers[0];
            Some((answer.own.as_ref()?, answer.others.iter().find(|o| o.0 == other).map(|o| &o.1)?))
        })
    }
}

/// The questions asked about one cause so far, smallest size first.
struct Asked<'q> {
    rig: &'q Rig,
    question: &'q Question<'q>,
    /// Largest size of the cause.
    most: f64,
    trials: Vec<Trial>,
}

impl Asked<'_> {
    /// Asks at one size more: whether the cause is named there, where `naming` wants to know.
    fn at(&mut self, floors: f64, naming: bool) -> bool {
        let (context, healthy, line) = (&self.rig.context, &self.rig.best, self.question.line);
        let place = line.place(context, healthy, floors.min(self.most));
        let floors = line.size(context, healthy, place);
        let Some(answers) = self.rig.ask(self.question, place, naming) else { return false };
        let named = answers.iter().all(|a| a.named);
        let at = self.trials.partition_point(|t| t.floors < floors);
        self.trials.insert(at, Trial { floors, named, answers });
        named
    }

    /// The size from which on the cause is named.
    fn seen(&mut self) -> Option<f64> {
        let mut size = self.most.min(1.0);
        let mut seen = self.at(size, true);
        if seen {
            for _ in 0..HALVINGS {
                if !self.at(0.5 * size, true) {
                    break;
                }
                size *= 0.5;
            }
        } else {
            while !seen && size < self.most {
                size *= 2.0;
                seen = self.at(size, true);
            }
        }
        if seen {
            self.at(size.min(self.most) / std::f64::consts::SQRT_2, true);
        }
        let first = self.trials.iter().rposition(|t| !t.named).map_or(0, |k| k + 1);
        self.trials.get(first).map(|t| t.floors)
    }

    /// Asks at larger sizes until every rival is left behind.
    fn leave_behind(&mut self, from: f64, rivals: &[&str]) {
        for k in 1..=DOUBLINGS {
            let size = from * f64::from(1_u32 << k);
            let Some(last) = self.trials.last() else { return };
            if last.floors >= self.most || rivals.iter().all(|r| last.lead(r) > needed_lead()) {
                return;
            }
            if size > last.floors {
                self.at(size, false);
            }
        }
    }
}

/// Asks about a cause at one size after another.
pub(crate) fn climb(rig: &Rig, question: &Question<'_>, rivals: &[&str]) -> Climbed {
    let most = question.line.most(&rig.context, &rig.best);
    let mut asked = Asked { rig, question, most, trials: Vec::new() };
    let seen = asked.seen();
    let tried = match seen {
        Some(from) => {
            asked.leave_behind(from, rivals);
            asked.trials.last().map_or(most, |t| t.floors)
        }
        None => most,
    };
    Climbed { seen, tried, trials: asked.trials }
}
