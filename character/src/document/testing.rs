//! Changes texts at random, to test their readers with all kinds of nonsense.

use proptest::prelude::*;

/// Values and fragments that are wrong in most places.
const PIECES: &[&str] = &[
    "nan",
    "-inf",
    "inf",
    "0",
    "-1",
    "1e39",
    "-0.0",
    "4294967296",
    "9223372036854775807",
    "\"\"",
    "\"lift\"",
    "\"reach\"",
    "true",
    "[]",
    "{}",
    "[[]]",
    "[nan, nan, nan]",
    "[[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]",
    "1979-05-27T07:32:00Z",
    "'''",
    "\"\u{0}\"",
    "é",
    "\n[[sets]]\n",
    "\n[sets]\n",
    "[",
    "]",
    "}",
    "#",
    "=",
    ".",
    "a.b.c.d = 1\n",
];

/// The words of the text: what lies between blanks, commas, brackets and signs.
fn words(text: &str) -> Vec<(usize, usize)> {
    let mut words = Vec::new();
    let mut start = None;
    for (at, c) in text.char_indices() {
        let inside = !c.is_whitespace() && !",[]{}=".contains(c);
        match (inside, start) {
            (true, None) => start = Some(at),
            (false, Some(from)) => {
                words.push((from, at));
                start = None;
            }
            _ => {}
        }
    }
    words
}

/// One random change of a text.
#[derive(Debug, Clone)]
pub(crate) enum Change {
    /// Replaces a word by a piece.
    Replace(prop::sample::Index, prop::sample::Index),
    /// Replaces a word by another word.
    Swap(prop::sample::Index, prop::sample::Index),
    /// Deletes a line.
    Drop(prop::sample::Index),
    /// Copies a line to another place.
    Copy(prop::sample::Index, prop::sample::Index),
    /// Inserts a piece anywhere.
    Insert(prop::sample::Index, prop::sample::Index),
}

impl Change {
    fn apply(&self, text: &str) -> String {
        let words = words(text);
        let lines: Vec<&str> = text.lines().collect();
        if words.is_empty() || lines.is_empty() {
            return text.to_owned();
        }
        let put = |(from, to): (usize, usize), new: &str| format!("{}{new}{}", &text[..from], &text[to..]);
        match self {
            Self::Replace(word, piece) => {
                put(words[word.index(words.len())], PIECES[piece.index(PIECES.len())])
            }
            Self::Swap(word, other) => {
                let (from, to) = words[other.index(words.len())];
                put(words[word.index(words.len())], &text[from..to])
            }
            Self::Drop(line) => {
                let mut lines = lines;
                lines.remove(line.index(lines.len()));
                lines.join("\n")
            }
            Self::Copy(line, to) => {
                let mut lines = lines;
                let line = lines[line.index(lines.len())];
                lines.insert(to.index(lines.len()), line);
                lines.join("\n")
            }
            Self::Insert(at, piece) => {
                let places: Vec<usize> = text.char_indices().map(|(at, _)| at).collect();
                let at = places[at.index(places.len())];
                put((at, at), PIECES[piece.index(PIECES.len())])
            }
        }
    }
}

fn any_change() -> impl Strategy<Value = Change> {
    let index = any::<prop::sample::Index>;
    prop_oneof![
        4 => (index(), index()).prop_map(|(a, b)| Change::Replace(a, b)),
        3 => (index(), index()).prop_map(|(a, b)| Change::Swap(a, b)),
        1 => index().prop_map(Change::Drop),
        1 => (index(), index()).prop_map(|(a, b)| Change::Copy(a, b)),
        2 => (index(), index()).prop_map(|(a, b)| Change::Insert(a, b)),
    ]
}

/// One or more random changes.
pub(crate) fn any_changes() -> impl Strategy<Value = Vec<Change>> {
    prop::collection::vec(any_change(), 1..5)
}

/// The text after these changes.
pub(crate) fn changed(text: &str, changes: &[Change]) -> String {
    changes
        .iter()
        .fold(text.to_owned(), |text, change| change.apply(&text))
}
