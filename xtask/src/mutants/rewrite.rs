//! All mutants in one text, each behind a switch.
//!
//! What it is: where a mutant changes an expression, the changed text stands beside it: `(if is(1) { (a - b) } else { (a + b) })`. The text of
//! a mutant holds no switch itself, for one mutant at most is asked for; so nests do not grow beyond their depth. A body begins with
//! `if is(2) { return 0; }`; an arm that goes gets the guard `if !is(3)`.
//!
//! What can go wrong: a mutant that no switch can express; it is said which, and why.
//!
//! Units: bytes from the start of a file.
//!
//! Reference: Untch, Offutt, Harrold: Mutation analysis using mutant schemata, 1993.

use super::listed::{Genre, Lines, Mutant};
use super::sites::{Site, Sites, weight};
use std::ops::Range;

/// How the switch is asked.
const IS: &str = "::mutant_switch::is";

/// What a mutant does to a text.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Change {
    /// What the switch stands around; empty: it is put in there.
    range: Range<usize>,
    /// What stands there, or what is put in.
    text: String,
    /// What the compiler has run is not broken: tests may miss it that the mutant itself would not escape.
    pub(super) constant: bool,
}

/// Why there is no switch for a mutant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Unfit {
    /// The compiler works it out before any switch.
    Fixed,
    /// It is no program: a `let` cannot stand beside `||`.
    NoProgram,
}

/// What mutant `id` does to the text whose sites are given.
pub(super) fn change(text: &str, sites: &Sites, id: u32, mutant: &Mutant) -> Result<Change, Unfit> {
    let span = Lines::of(text).bytes(mutant.span).ok_or(Unfit::Fixed)?;
    let constant = sites.constant(span.start);
    if mutant.genre == Genre::FnValue {
        let text = format!("if {IS}({id}) {{ return {}; }} ", mutant.replacement);
        return Ok(Change { range: span.start..span.start, text, constant });
    }
    let range = match sites.all.get(&(mutant.genre, span.start)).ok_or(Unfit::Fixed)? {
        Site::Behind(at) => return Ok(Change { range: *at..*at, text: format!(" if !{IS}({id})"), constant }),
        Site::Whole(range) => range.clone(),
        Site::Chain(chain) => {
            let own = chain.last().ok_or(Unfit::Fixed)?;
            let new = syn::parse_str(&mutant.replacement).map_or(0, |op| weight(&op));
            // an operator that binds less tight takes in what stands around it
            let taken = chain.iter().rev().take_while(|link| new < own.weight && link.weight >= new);
            let around = taken.last().unwrap_or(own);
            if around.lets {
                return Err(Unfit::NoProgram);
            }
            around.range.clone()
        }
    };
    let mut changed = text.get(range.clone()).ok_or(Unfit::Fixed)?.to_owned();
    changed.replace_range(span.start - range.start..span.end - range.start, &mutant.replacement);
    if syn::parse_str::<syn::Expr>(&changed).is_err() {
        return Err(Unfit::Fixed);
    }
    Ok(Change { range, text: changed, constant })
}

/// What a switch stands around, and all that hang on it.
type Group<'c> = (Range<usize>, Vec<(u32, &'c Change)>);

/// A text with switches, and which mutants stand where.
#[derive(Debug, Default)]
pub(super) struct Rewritten {
    pub(super) text: String,
    /// The text of each mutant.
    own: Vec<(Range<usize>, u32)>,
    /// What each switch stands around, with all that hang on it.
    around: Vec<(Range<usize>, Vec<u32>)>,
}

impl Rewritten {
    /// `text` with all the changes.
    pub(super) fn of(text: &str, changes: &[(u32, &Change)]) -> Self {
        let mut groups: Vec<Group<'_>> = Vec::new();
        let mut sorted = changes.to_vec();
        // what is put in stands before what begins there, and the outer before the inner
        sorted.sort_by_key(|(id, change)| (change.range.start, !change.range.is_empty(), usize::MAX - change.range.end, *id));
        for (id, change) in sorted {
            match groups.last_mut() {
                Some((range, members)) if *range == change.range => members.push((id, change)),
                _ => groups.push((change.range.clone(), vec![(id, change)])),
            }
        }
        let mut out = Self::default();
        let mut rest = groups.as_slice();
        out.put(text, 0..text.len(), &mut rest);
        out
    }

    /// Writes a stretch of the text with the switches that lie in it.
    fn put(&mut self, text: &str, range: Range<usize>, groups: &mut &[Group<'_>]) {
        let mut at = range.start;
        while let Some(((inner, members), others)) = groups.split_first()
            && inner.start <= range.end
            && inner.end <= range.end
        {
            *groups = others;
            self.text.push_str(text.get(at..inner.start).unwrap_or_default());
            let start = self.text.len();
            if inner.is_empty() {
                members.iter().for_each(|(id, change)| self.own(*id, &change.text));
            } else {
                self.text.push('(');
                for (id, change) in members {
                    self.own(*id, &format!("if {IS}({id}) {{ ({}\n) }} else ", change.text));
                }
                self.text.push_str("{ (");
                self.put(text, inner.clone(), groups);
                self.text.push_str("\n) })");
            }
            self.around.push((start..self.text.len(), members.iter().map(|(id, _)| *id).collect()));
            at = inner.end;
        }
        self.text.push_str(text.get(at..range.end).unwrap_or_default());
    }

    fn own(&mut self, id: u32, text: &str) {
        let start = self.text.len();
        self.text.push_str(text);
        self.own.push((start..self.text.len(), id));
    }

    /// The mutant whose text holds a place.
    pub(super) fn at(&self, place: usize) -> Option<u32> {
        self.own.iter().find(|(range, _)| range.contains(&place)).map(|(_, id)| *id)
    }

    /// The mutants of the innermost switch around a place.
    pub(super) fn around(&self, place: usize) -> &[u32] {
        let holding = self.around.iter().filter(|(range, _)| range.contains(&place));
        holding.min_by_key(|(range, _)| range.len()).map_or(&[], |(_, ids)| ids)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A mutant of what stands between `<` and `>` marks, `«` and `»`.
    fn mutant(marked: &str, genre: Genre, replacement: &str) -> (String, Mutant) {
        let text = marked.replace(['«', '»'], "");
        let spot = |mark: char| {
            let before = marked.split(mark).next().unwrap().replace('«', "");
            let line = before.lines().last().unwrap_or_default();
            (before.matches('\n').count() + 1, line.chars().count() + 1)
        };
        let mutant = Mutant {
            name: String::new(),
            file: String::new(),
            span: (spot('«'), spot('»')),
            replacement: replacement.to_owned(),
            genre,
            returns: String::new(),
        };
        (text, mutant)
    }

    fn changed(marked: &str, genre: Genre, replacements: &[&str]) -> Result<Rewritten, Unfit> {
        let mut changes = Vec::new();
        for (id, replacement) in (1..).zip(replacements) {
            let (text, mutant) = mutant(marked, genre, replacement);
            changes.push((id, change(&text, &Sites::of(&text).unwrap(), id, &mutant)?));
        }
        let text = marked.replace(['«', '»'], "");
        let changes: Vec<(u32, &Change)> = changes.iter().map(|(id, change)| (*id, change)).collect();
        let out = Rewritten::of(&text, &changes);
        syn::parse_file(&out.text).unwrap_or_else(|error| panic!("{error}: {}", out.text));
        Ok(out)
    }

    fn text(marked: &str, genre: Genre, replacements: &[&str]) -> String {
        let text = changed(marked, genre, replacements).unwrap().text;
        text.replace('\n', "").replace("::mutant_switch::", "")
    }

    #[test]
    fn an_operator_has_its_mutants_beside_it() {
        assert_eq!(
            text("fn f() { x = a «-» b + c; }", Genre::BinaryOperator, &["+", "/"]),
            "fn f() { x = (if is(1) { (a + b) } else if is(2) { (a / b) } else { (a - b) }) + c; }"
        );
    }

    #[test]
    fn an_operator_that_binds_less_takes_in_its_neighbours() {
        assert_eq!(
            text("fn f() { x = a - b «*» c; }", Genre::BinaryOperator, &["+", "/"]),
            "fn f() { x = (if is(1) { (a - b + c) } else { (a - (if is(2) { (b / c) } else { (b * c) })) }); }"
        );
        assert_eq!(
            text("fn f() { a && (b «&&» c) && d }", Genre::BinaryOperator, &["||"]),
            "fn f() { a && ((if is(1) { (b || c) } else { (b && c) })) && d }"
        );
        assert_eq!(
            text("fn f() { a == b «&» c }", Genre::BinaryOperator, &["|"]),
            "fn f() { a == (if is(1) { (b | c) } else { (b & c) }) }"
        );
    }

    #[test]
    fn bodies_arms_guards_fields_and_signs() {
        assert_eq!(
            text("fn f() -> u8 { «a()» }", Genre::FnValue, &["0", "1"]),
            "fn f() -> u8 { if is(1) { return 0; } if is(2) { return 1; } a() }"
        );
        let arms = "fn f() { match x { «A | B => 1,» C(n) if n > 1 => 2, _ => 3 } }";
        assert_eq!(text(arms, Genre::MatchArm, &[""]), "fn f() { match x { A | B if !is(1) => 1, C(n) if n > 1 => 2, _ => 3 } }");
        let guard = "fn f() { match x { C(n) if «n > 1» => 2, _ => 3 } }";
        assert_eq!(
            text(guard, Genre::MatchArmGuard, &["true", "false"]),
            "fn f() { match x { C(n) if (if is(1) { (true) } else if is(2) { (false) } else { (n > 1) }) => 2, _ => 3 } }"
        );
        let field = "fn f() { S { «a: 1,» ..b } }";
        assert_eq!(text(field, Genre::StructField, &[""]), "fn f() { (if is(1) { (S {  ..b }) } else { (S { a: 1, ..b }) }) }");
        assert_eq!(
            text("fn f() { «-»x.abs() }", Genre::UnaryOperator, &[""]),
            "fn f() { (if is(1) { (x.abs()) } else { (-x.abs()) }) }"
        );
    }

    #[test]
    fn what_the_compiler_works_out_has_no_switch() {
        for fixed in [
            "const A: u8 = 1 «+» 2;",
            "static A: [u8; 1 «+» 2] = [0; 3];",
            "fn f() { [0; 1 «+» 2]; }",
            "fn f() -> [u8; 1 «+» 2] { g() }",
            "fn f() { const { 1 «+» 2 } }",
            "enum E { A = 1 «+» 2 }",
            "struct S; impl S { const A: u8 = 1 «+» 2; }",
        ] {
            assert_eq!(changed(fixed, Genre::BinaryOperator, &["-"]).unwrap_err(), Unfit::Fixed, "{fixed}");
        }
        assert_eq!(
            changed("fn f() { if let Some(a) = b «&&» a > 1 {} }", Genre::BinaryOperator, &["||"]).unwrap_err(),
            Unfit::NoProgram
        );
        let closure = "const F: fn(u8) -> u8 = |x| x «+» 1;";
        assert_eq!(
            text(closure, Genre::BinaryOperator, &["-"]),
            "const F: fn(u8) -> u8 = |x| (if is(1) { (x - 1) } else { (x + 1) });"
        );
    }

    #[test]
    fn a_function_that_the_compiler_may_run_is_told() {
        for (source, constant) in [("const fn f() { a «+» b }", true), ("fn f() { a «+» b }", false)] {
            let (text, mutant) = mutant(source, Genre::BinaryOperator, "-");
            assert_eq!(change(&text, &Sites::of(&text).unwrap(), 1, &mutant).unwrap().constant, constant);
        }
    }

    #[test]
    fn an_error_is_traced_to_its_mutant() {
        let out = changed("fn f() { x = a «-» b; }", Genre::BinaryOperator, &["+", "/"]).unwrap();
        let place = |text: &str| out.text.find(text).unwrap();
        assert_eq!((out.at(place("a + b")), out.at(place("a / b")), out.at(place("a - b"))), (Some(1), Some(2), None));
        assert_eq!((out.around(place("a - b")), out.around(0)), ([1, 2].as_slice(), [].as_slice()));
    }

    #[test]
    fn nests_do_not_grow_beyond_their_depth() {
        let source = format!("fn f() {{ x = {}1; }}", "y + ".repeat(64));
        let sites = Sites::of(&source).unwrap();
        let mutants: Vec<Mutant> = (0..64)
            .map(|n| {
                let column = source.find("y").unwrap() + 3 + 4 * n;
                let name = String::new();
                Mutant {
                    span: ((1, column), (1, column + 1)),
                    replacement: "-".to_owned(),
                    genre: Genre::BinaryOperator,
                    returns: String::new(),
                    file: name.clone(),
                    name,
                }
            })
            .collect();
        let changes: Vec<(u32, Change)> =
            (1..).zip(&mutants).map(|(id, mutant)| (id, change(&source, &sites, id, mutant).unwrap())).collect();
        let changes: Vec<(u32, &Change)> = changes.iter().map(|(id, change)| (*id, change)).collect();
        let out = Rewritten::of(&source, &changes).text;
        assert!(out.len() < 64 * 400, "{}", out.len());
    }
}
