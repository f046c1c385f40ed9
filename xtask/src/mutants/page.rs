//! What a person reads of the mutants: `docs/mutants.md`, and the lines of a run.
//!
//! What it is: how many live, which of them the list accepts, and a table of it.
//! What can go wrong: nothing that the list or the results do not say wrong.
//! Units: per cent.
//! Reference: `budgets/mutants.toml`.

use super::{Accepted, Fate, Fates, Package, missed};
use crate::place::Place;
use std::fmt::Write as _;
use std::fs;

/// A mutant's file, line and column from 1, and its name without the two.
fn parts(name: &str) -> Option<(&str, usize, usize, String)> {
    let (file, rest) = name.split_once(':')?;
    let (line, rest) = rest.split_once(':')?;
    let (column, change) = rest.split_once(": ")?;
    Some((file, line.parse().ok()?, column.parse().ok()?, format!("{file}: {change}")))
}

/// How the source goes on where a mutant begins.
fn source(place: &Place, name: &str) -> Option<String> {
    let (file, line, column, _) = parts(name)?;
    let text = fs::read_to_string(place.root.join(file)).ok()?;
    Some(text.lines().nth(line.checked_sub(1)?)?.chars().skip(column.checked_sub(1)?).collect())
}

impl Accepted {
    pub(super) fn is(&self, place: &Place, name: &str) -> bool {
        let same = parts(name).is_some_and(|(_, _, _, plain)| plain == self.mutant);
        same && (self.at.is_empty() || source(place, name).is_some_and(|source| source.starts_with(&self.at)))
    }
}

/// The missed mutants that the list does not accept, a line each.
pub(super) fn left(place: &Place, fates: &Fates, accepted: &[Accepted]) -> Vec<String> {
    let open = missed(fates).filter(|name| !accepted.iter().any(|accepted| accepted.is(place, name)));
    open.map(|name| format!("missed: {name}   [{}]", source(place, name).unwrap_or_default())).collect()
}

/// The accepted mutants of a package that live no more, a line each.
pub(super) fn stale(place: &Place, package: &Package, fates: &Fates, accepted: &[Accepted]) -> Vec<String> {
    if fates.values().any(|fate| *fate == Fate::Untried) {
        return Vec::new();
    }
    let prefix = format!("{}/", package.name);
    let own = accepted.iter().filter(|accepted| accepted.mutant.starts_with(&prefix));
    let gone = own.filter(|accepted| !missed(fates).any(|name| accepted.is(place, name)));
    gone.map(|accepted| format!("accepted, but caught or gone: {} [{}]", accepted.mutant, accepted.at)).collect()
}

/// A row of the table.
#[derive(Debug, PartialEq)]
pub(super) struct Count {
    viable: usize,
    caught: usize,
    time_outs: usize,
    missed: usize,
    equivalent: usize,
    untried: usize,
}

pub(super) fn count(place: &Place, fates: &Fates, accepted: &[Accepted]) -> Count {
    let of = |asked: Fate| fates.values().filter(|fate| **fate == asked).count();
    let same = |name: &&str| accepted.iter().any(|accepted| accepted.equivalent && accepted.is(place, name));
    let equivalent = missed(fates).filter(same).count();
    let missed = of(Fate::Missed) - equivalent;
    let (caught, time_outs) = (of(Fate::Caught), of(Fate::TimeOut));
    Count { viable: caught + time_outs + missed, caught, time_outs, missed, equivalent, untried: of(Fate::Untried) }
}

impl Count {
    /// Share of what was noticed, per cent.
    fn share(&self) -> f64 {
        100.0 * (self.caught + self.time_outs) as f64 / self.viable.max(1) as f64
    }
}

pub(super) fn tell(package: &str, count: &Count) {
    let Count { viable, caught, time_outs, missed, equivalent, untried } = count;
    println!(
        "{package}: {viable} viable, {caught} caught, {time_outs} never ended, {missed} missed, {equivalent} equivalent, \
         {untried} untried: {:.1} %",
        count.share()
    );
}

pub(super) fn head(package: &str) -> String {
    format!("| `{package}` |")
}

pub(super) fn row(package: &str, count: &Count) -> String {
    let Count { viable, caught, time_outs, missed, equivalent, untried } = count;
    format!(
        "{} {viable} | {caught} | {time_outs} | {missed} | {:.1} % | {equivalent} | {untried} |",
        head(package),
        count.share()
    )
}

pub(super) fn page(rows: &[String], accepted: &[Accepted]) -> String {
    let mut page = String::from(
        "# Broken on purpose: do the tests notice?\n\n\
         `cargo xtask mutants` breaks the code in every small way that cargo-mutants knows: a sign, a comparison, a function's result.\n\
         Each broken program is a mutant. It is caught when a test fails, and missed when all pass.\n\
         All mutants of a package are in one program, each behind a switch; one is switched on at a time and meets the tests that reach it, the\n\
         fastest first. What no switch can express, a constant for instance, is broken and built by itself.\n\
         This page is written by that command from `budgets/mutants.toml`.\n\n\
         - *Viable*: mutants that compile and do something else than the code.\n\
         - *Never ended*: the tests hang; that is noticed, too, and counts as caught.\n\
         - *Equivalent*: the mutant does what the code does. No test can tell, so it is left out of the share.\n\
         - *Untried*: its file was not broken yet.\n\n\
         Code that touches registers is left out: the emulated boards hold it.\n\n\
         | package | viable | caught | never ended | missed | share | equivalent | untried |\n\
         | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n",
    );
    for row in rows {
        let _ = writeln!(page, "{row}");
    }
    let typed = |text: &str| format!("`{}`", text.replace('|', "\\|"));
    for (title, equivalent) in [("Missed, and why they may", false), ("Equivalent, and why", true)] {
        let mut list = accepted.iter().filter(|accepted| accepted.equivalent == equivalent).peekable();
        if list.peek().is_none() {
            continue;
        }
        let _ = write!(page, "\n## {title}\n\n| mutant | where | why |\n| --- | --- | --- |\n");
        for Accepted { mutant, at, why, .. } in list {
            let at = if at.is_empty() { String::new() } else { typed(at) };
            let _ = writeln!(page, "| {} | {at} | {why} |", typed(mutant));
        }
    }
    page
}

#[cfg(test)]
mod tests {
    use super::super::{PAGE, read};
    use super::*;

    #[test]
    fn the_page_is_current() {
        let place = Place::find();
        let (packages, accepted) = read(&place).unwrap_or_else(|failure| panic!("{failure}"));
        let there = fs::read_to_string(place.root.join(PAGE)).unwrap_or_default();
        let rows = |package: &Package| there.lines().find(|line| line.starts_with(&head(&package.name))).map(str::to_owned);
        let rows: Vec<String> = packages.iter().filter_map(rows).collect();
        assert!(there == page(&rows, &accepted), "{PAGE}: run `cargo xtask mutants --page`");
    }

    #[test]
    fn a_mutant_is_known_by_its_file_its_change_and_its_place() {
        let place = Place::find();
        let name = "xtask/src/mutants.rs:1:5: replace x with y";
        assert_eq!(parts(name), Some(("xtask/src/mutants.rs", 1, 5, "xtask/src/mutants.rs: replace x with y".to_owned())));
        let accepted = |at: &str| Accepted {
            mutant: "xtask/src/mutants.rs: replace x with y".to_owned(),
            at: at.to_owned(),
            equivalent: true,
            why: String::new(),
        };
        assert!(accepted("`cargo xtask").is(&place, name) && accepted("").is(&place, name));
        assert!(!accepted("cargo xtask").is(&place, name));
        let fates = |fate| Fates::from([(name.to_owned(), fate)]);
        assert_eq!(left(&place, &fates(Fate::Missed), &[]).len(), 1);
        assert!(left(&place, &fates(Fate::Missed), &[accepted("")]).is_empty());
        assert!(left(&place, &fates(Fate::TimeOut), &[]).is_empty());
        assert_eq!(count(&place, &fates(Fate::Missed), &[accepted("")]).viable, 0, "no test can tell it");
        assert_eq!(count(&place, &fates(Fate::Missed), &[]).share(), 0.0);
    }
}
