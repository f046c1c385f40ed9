//! Which key a refused file is refused for.
//!
//! What it is: the parser names the table when something in a table of several kinds is wrong; here each key is taken out in turn, and the
//! one without which the refusal is another one, or none, is the key to look at.
//! What can go wrong: a field that is missing has no key: the table's place stays.
//! Units: bytes of the text.
//! Reference: TOML 1.0; serde, "internally tagged enums" (which lose their places).

use serde::de::DeserializeOwned;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue, Error};

/// A key with its value, or an item of a list.
struct Piece {
    key: String,
    place: usize,
    whole: Range<usize>,
    value: Range<usize>,
    /// Whether it is a list in brackets; tables under a header are none.
    is_list: bool,
}

/// Where the line with an inline table ends that nothing closes: the parser only notices on a later line.
pub(super) fn open_brace(text: &str, error: &Error) -> Option<usize> {
    let told = error.span().filter(|_| error.message().contains("inline table"))?;
    let before = text.get(..told.start)?;
    let end = before.trim_end().len();
    let line = before.get(..end)?.rsplit('\n').next()?;
    let is_open = line.matches('{').count() > line.matches('}').count();
    (is_open && before.get(end..)?.contains('\n')).then_some(end)
}

/// Where the refusal belongs, and the key that it is about where that is known.
pub(super) fn blame<T: DeserializeOwned>(text: &str, error: &Error) -> (usize, Option<String>) {
    let start = error.span().map_or(0, |span| span.start);
    let Ok(table) = DeTable::parse(text) else { return (start, None) };
    let mut pieces = Vec::new();
    gather(table.get_ref(), &mut pieces);
    let is_value = |piece: &Piece| !text[piece.value.clone()].starts_with(['{', '[']);
    // a table or a list where a value is due: nothing within it is to blame
    let is_another_kind = error.message().starts_with("invalid type: map") || error.message().starts_with("invalid type: seq");
    let exact = |piece: &&Piece| error.span().is_some_and(|span| span == piece.value) && (is_value(piece) || is_another_kind);
    if let Some(piece) = pieces.iter().find(exact) {
        return (start, Some(piece.key.clone()));
    }
    let unknown = error.message().strip_prefix("unknown field `").and_then(|rest| rest.split_once('`'));
    // an item of a list has the list's key, and is none itself
    let is_key = |piece: &&Piece| piece.whole.start < piece.value.start;
    let named: Vec<&Piece> = pieces.iter().filter(is_key).filter(|p| unknown.is_some_and(|(key, _)| p.key == key)).collect();
    let is_guilty = |piece: &&&Piece| {
        let blanked = without(text, piece).map(|text| toml::from_str::<T>(&text));
        blanked.is_some_and(|parsed| parsed.err().is_none_or(|other| other.message() != error.message()))
    };
    // of several tables with such a key the one that can do without it, or the first where none can
    let one = if named.len() > 1 { named.iter().find(is_guilty).or(named.first()) } else { named.first() };
    if let Some(piece) = one {
        return (piece.whole.start, Some(piece.key.clone()));
    }
    let is_placed = pieces.iter().any(|piece| [piece.place, piece.whole.start].contains(&start) && is_value(piece));
    if is_placed || error.message().starts_with("missing field") {
        return (start, None);
    }
    let told = |piece: &Piece| {
        let value = text[piece.value.clone()].trim_matches('"');
        let number = value.parse::<f64>().map(|v| v.to_string());
        quotes(error.message(), value) || number.is_ok_and(|number| quotes(error.message(), &number))
    };
    let guilty: Vec<(&Piece, bool)> = pieces
        .iter()
        .filter_map(|piece| {
            let without = without(text, piece)?;
            match toml::from_str::<T>(&without) {
                Ok(_) => Some((piece, false)),
                Err(other) if other.message() != error.message() => {
                    Some((piece, other.message().contains(&format!("missing field `{}`", piece.key))))
                }
                Err(_) => None,
            }
        })
        .collect();
    // the innermost one whose value the refusal quotes, the last of several; else the list that it is placed at; else the innermost
    // one that the table can do without
    let innermost = |wanted: &dyn Fn(&(&Piece, bool)) -> bool| {
        guilty.iter().rev().filter(|found| wanted(found)).min_by_key(|(piece, _)| piece.whole.len()).map(|(piece, _)| *piece)
    };
    let list = || pieces.iter().find(|p| p.is_list && error.span().is_some_and(|s| s == p.value));
    let found = innermost(&|(piece, _)| told(piece))
        .or_else(list)
        .or_else(|| innermost(&|(_, needed)| !needed))
        .or_else(|| innermost(&|_| true));
    let unknown = error.message().starts_with("unknown field");
    found.map_or((start, None), |piece| (if unknown { piece.whole.start } else { piece.place }, Some(piece.key.clone())))
}

/// The first number that is none or without end, and its key: no quantity of these files may be either.
pub(super) fn endless(text: &str) -> Option<(usize, String)> {
    let mut pieces = Vec::new();
    gather(DeTable::parse(text).ok()?.get_ref(), &mut pieces);
    let is_endless = |piece: &&Piece| text[piece.value.clone()].parse::<f64>().is_ok_and(|v| !v.is_finite());
    pieces.iter().filter(is_endless).min_by_key(|p| p.place).map(|p| (p.place, p.key.clone()))
}

/// Whether a message holds a value as a word of its own.
fn quotes(message: &str, value: &str) -> bool {
    let of_a_word = |c: Option<char>| c.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == '.');
    message.match_indices(value).any(|(at, found)| {
        !of_a_word(message[..at].chars().next_back()) && !of_a_word(message[at + found.len()..].chars().next())
    })
}

fn gather(table: &DeTable<'_>, pieces: &mut Vec<Piece>) {
    for (key, value) in table {
        let whole = key.span().start..value.span().end;
        add(key.get_ref(), whole, value, pieces);
    }
}

fn add(key: &str, whole: Range<usize>, value: &Spanned<DeValue<'_>>, pieces: &mut Vec<Piece>) {
    let of_tables = |items: &[Spanned<DeValue<'_>>]| items.iter().any(|i| i.get_ref().is_table());
    let is_list = matches!(value.get_ref(), DeValue::Array(items) if items.is_empty() || !of_tables(items));
    pieces.push(Piece { key: key.to_owned(), place: value.span().start, whole, value: value.span(), is_list });
    match value.get_ref() {
        DeValue::Table(table) => gather(table, pieces),
        DeValue::Array(items) => items.iter().for_each(|item| add(key, item.span(), item, pieces)),
        _ => {}
    }
}

/// The text with blanks in the place of a piece, and of a comma that it needed.
fn without(text: &str, piece: &Piece) -> Option<String> {
    let Range { start, end } = piece.whole.clone();
    let after =
        text[end..].find(|c: char| !c.is_whitespace()).filter(|at| text[end + at..].starts_with(',')).map(|at| end + at + 1);
    let before = text[..start].rfind(|c: char| !c.is_whitespace()).filter(|at| text[*at..].starts_with(','));
    let ranges = [Some(start..end), after.map(|end| start..end), before.map(|start| start..end)];
    let blanked = |range: Range<usize>| {
        let blank: String = text[range.clone()].chars().map(|c| if c == '\n' { '\n' } else { ' ' }).collect();
        [&text[..range.start], &blank, &text[range.end..]].concat()
    };
    ranges.into_iter().flatten().map(blanked).find(|text| DeTable::parse(text).is_ok())
}
