//! Whether the file of a model is whole.
//!
//! What it is: the writer ends each file with one line, and says so in its first line. A copy that was cut short is still TOML as
//! often as not, with fewer channels, fewer effects, or half of a number.
//! What can go wrong: a file that was written by hand or by an older version promises nothing, and is taken as it is.
//! Units: lines from 1.
//! Reference: specification `formats.md`, "Powerplant model".

/// First line of a file.
const PROMISE: &str = "# Without a line `# end of the model` below, this file was cut short.";
/// Its last; the command line adds a digest of all above.
const END: &str = "# end of the model";

/// The text with its promise and its end.
pub(crate) fn framed(text: &str) -> String {
    format!("{PROMISE}\n{text}{END}\n")
}

/// Where a file ends before its end, and what is said of it: line, column, words.
pub(crate) fn cut_short(text: &str) -> Option<(usize, usize, String)> {
    let promises = text.lines().take_while(|line| line.starts_with('#')).any(|line| line.trim_end() == PROMISE);
    let ends = text.lines().any(|line| line.trim() == END);
    let last = text.lines().last().filter(|_| promises && !ends)?;
    let words =
        format!("the file ends early, after '{}', without its line '{END}': copy it again whole", crate::log::short(last));
    Some((text.lines().count(), last.chars().count() + 1, words))
}

#[cfg(test)]
mod tests {
    use super::{cut_short, framed};

    /// Wherever a file is cut, it is noticed, and at its place; the line break at its very end is nothing.
    #[test]
    fn each_cut_is_noticed() {
        let whole = framed("format = \"x\"\na_n = 1.25\n");
        assert_eq!((cut_short(&whole), cut_short(whole.trim_end())), (None, None));
        let promise = whole.find('\n').expect("a line");
        for at in promise..whole.len() - 1 {
            assert!(cut_short(&whole[..at]).is_some(), "{}", &whole[..at]);
        }
        let cut = &whole[..whole.find("1.25").expect("a number") + 3];
        let (line, column, said) = cut_short(cut).expect("cut in a number");
        assert_eq!((line, column), (3, 10));
        assert!(said.contains("ends early, after 'a_n = 1.2', without its line '# end of the model'"), "{said}");
    }

    /// What promises nothing, what was edited, what another editor ended its lines with, what was added below.
    #[test]
    fn a_hand_may_write_and_edit() {
        let whole = framed("a_n = 1.25\n");
        for text in [
            "format = \"x\"\na_n = 1.2".to_owned(),
            whole.replace("1.25", "1.5"),
            whole.replace('\n', "\r\n"),
            format!("{whole}[[effect]]\n"),
            whole.lines().skip(1).collect(),
        ] {
            assert_eq!(cut_short(&text), None, "{text}");
        }
    }
}
