//! Texts of a source file as a program prints them, with a place for each value.
//!
//! What it is: string literals, and in each the braces as three dots with the name of the value behind them: a variable, a field, or what a method is
//! asked of.
//! What can go wrong: a raw string is read like any other; a value that is no plain name stays three dots.
//! Units: bytes of the source.
//! Reference: The Rust Reference, "Tokens"; `std::fmt`.

/// What stands for a text that the source does not hold.
pub(super) const UNKNOWN: &str = "...";

/// A text of the source.
pub(super) struct Literal {
    /// Where its quote stands.
    pub(super) start: usize,
    /// As it is printed, see [`plain`].
    pub(super) text: String,
}

/// The texts of a source, values in braces as three dots with their names; comments hold none.
pub(super) fn literals(code: &str) -> Vec<Literal> {
    let bytes = code.as_bytes();
    let (mut out, mut at) = (Vec::new(), 0);
    while at < bytes.len() {
        match bytes[at] {
            b'/' if bytes.get(at + 1) == Some(&b'/') => at += code[at..].find('\n').unwrap_or(code.len() - at),
            b'\'' => at += character(bytes, at),
            b'"' => {
                let end = ending(bytes, at + 1);
                out.push(Literal { start: at, text: plain(&code[at + 1..end], &values_behind(code, end + 1)) });
                at = end + 1;
            }
            _ => at += 1,
        }
    }
    out
}

/// Length of a character in quotes, or of the quote of a lifetime.
fn character(bytes: &[u8], at: usize) -> usize {
    match (bytes.get(at + 1), bytes.get(at + 2)) {
        (Some(b'\\'), _) => 2 + bytes[at + 2..].iter().skip(1).position(|b| *b == b'\'').map_or(1, |k| k + 2),
        (Some(_), Some(b'\'')) => 3,
        _ => 1,
    }
}

/// Where a text ends.
pub(super) fn ending(bytes: &[u8], mut at: usize) -> usize {
    while at < bytes.len() && bytes[at] != b'"' {
        at += if bytes[at] == b'\\' { 2 } else { 1 };
    }
    at.min(bytes.len())
}

/// The parenthesis that closes what begins at `from`.
pub(super) fn closing(code: &str, from: usize) -> usize {
    let mut depth = 1;
    for (k, c) in code[from..].char_indices() {
        depth += match c {
            '(' => 1,
            ')' => -1,
            _ => 0,
        };
        if depth == 0 {
            return from + k;
        }
    }
    code.len()
}

/// What stands around the name of a value, behind its dots.
const NAMED: [char; 2] = ['\u{1}', '\u{2}'];
/// Names of values that say more to a reader under another one.
const READ: [(&str, &str); 7] =
    [("e", "REASON"), ("why", "REASON"), ("error", "REASON"), ("path", "FILE"), ("n", "N"), ("at", "PLACE"), ("short", "VALUE")];

/// The arguments behind a text in its macro.
fn values_behind(code: &str, from: usize) -> Vec<&str> {
    let Some(begin) = code[from..].starts_with(',').then_some(from + 1) else { return Vec::new() };
    let end = closing(code, begin);
    let is_short = end - begin < 400; // what never closes is no macro's
    if is_short { code[begin..end].split(',').map(str::trim).collect() } else { Vec::new() }
}

/// The name of a value in capitals, from what stands in the source for it: a variable, a field, or what a method is asked of.
fn name_of(value: &str) -> Option<String> {
    let call = value.trim_start_matches(['&', '*']);
    let (path, is_call) = call.split_once('(').map_or((call, false), |(path, _)| (path, true));
    let is_name = |c: char| c.is_ascii_lowercase() || c == '_' || c == '.' || c.is_ascii_digit();
    if path.is_empty() || !path.chars().all(is_name) || path.starts_with(|c: char| c.is_ascii_digit()) {
        return None;
    }
    let mut parts = path.rsplit('.').skip(usize::from(is_call && path.contains('.'))).filter(|p| *p != "self");
    let name = parts.next().filter(|p| !p.starts_with(|c: char| c.is_ascii_digit()))?;
    let read = READ.iter().find(|(said, _)| *said == name).map(|(_, read)| (*read).to_owned());
    read.or_else(|| (name.len() > 1).then(|| name.to_uppercase()))
}

/// A text as it is printed, with dots for what is filled in and the name of what that is; `values` are those of empty braces.
pub(super) fn plain(literal: &str, values: &[&str]) -> String {
    let text = literal.replace("\\\"", "\"").replace("\\n", " ").replace("\\t", " ").replace("{{", "(").replace("}}", ")");
    let (mut out, mut inside, mut values) = (String::new(), None::<String>, values.iter());
    for c in text.chars() {
        match (c, inside.as_mut()) {
            ('{', _) => inside = Some(String::new()),
            ('}', Some(held)) => {
                let named = held.split(':').next().unwrap_or_default().to_owned();
                let value = if named.is_empty() { values.next().copied().unwrap_or_default() } else { &named };
                // what ends a word is no name: an ending, or a note behind it
                let ends_word = out.ends_with(char::is_alphanumeric);
                out.push_str(UNKNOWN);
                if let Some(name) = name_of(value).filter(|_| !ends_word) {
                    out.extend([NAMED[0]].into_iter().chain(name.chars()).chain([NAMED[1]]));
                }
                inside = None;
            }
            (c, Some(held)) => held.push(c),
            (c, None) => out.push(c),
        }
    }
    out.split_whitespace().filter(|word| *word != "\\").collect::<Vec<_>>().join(" ") + if out.ends_with(' ') { " " } else { "" }
}

/// A text with dots for its values and no names.
pub(super) fn nameless(text: &str) -> String {
    let mut parts = text.split(NAMED[0]);
    let first = parts.next().unwrap_or_default().to_owned();
    first + &parts.filter_map(|part| part.split_once(NAMED[1])).map(|(_, rest)| rest).collect::<String>()
}

/// A text with the names of its values.
pub(super) fn named(text: &str) -> String {
    text.replace(&format!("{UNKNOWN}{}", NAMED[0]), "").replace(NAMED[1], "")
}

/// What stands behind the value that a text begins with.
pub(super) fn past_value(text: &str) -> Option<&str> {
    let rest = text.strip_prefix(UNKNOWN)?;
    Some(rest.strip_prefix(NAMED[0]).and_then(|named| named.split_once(NAMED[1])).map_or(rest, |(_, rest)| rest))
}

#[cfg(test)]
mod tests {
    use super::{name_of, named, nameless, past_value, plain};

    #[test]
    fn a_value_is_told_by_its_name() {
        for (value, name) in [
            ("self.rows", "ROWS"),
            ("path.display()", "FILE"),
            ("&known.join(\", \")", "KNOWN"),
            ("e", "REASON"),
            ("held", "HELD"),
        ] {
            assert_eq!(name_of(value).as_deref(), Some(name), "{value}");
        }
        for value in ["0", "x", "if far { 1 } else { 2 }", "\"text\"", "a + b", "self.0"] {
            assert_eq!(name_of(value), None, "{value}");
        }
        let text = plain("{} of {rows} rows: {0}", &["self.count"]);
        assert_eq!((named(&text).as_str(), nameless(&text).as_str()), ("COUNT of ROWS rows: ...", "... of ... rows: ..."));
        assert_eq!(past_value(&text), Some(" of ...\u{1}ROWS\u{2} rows: ..."));
    }
}
