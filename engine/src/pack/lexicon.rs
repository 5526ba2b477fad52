//! The text that a pack understands: its text pieces, and the words of its training.

use std::collections::BTreeSet;
use std::path::Path;

use tokenizers::{NormalizedString, Normalizer as _, Tokenizer};

use super::manifest::field;
use super::vermo::{STYLES_FILE, TOKENIZER_FILE, VerMoDoc, WORDS_FILE};
use super::{PackProblem, read_text};

/// The text pieces and known words of a pack.
#[derive(Debug, Clone)]
pub struct Lexicon {
    tokenizer: Tokenizer,
    words: BTreeSet<String>,
    /// The words of each wording of a style, those of most words first.
    styles: Vec<Vec<String>>,
}

impl Lexicon {
    /// Reads the files of the pack in `folder`.
    ///
    /// # Errors
    /// [`PackProblem::Read`], [`PackProblem::Tokenizer`], or [`PackProblem::Field`] if the number
    /// of
    /// pieces differs from the manifest.
    pub(super) fn load(folder: &Path, table: &VerMoDoc) -> Result<Self, PackProblem> {
        let [pieces, words] = [TOKENIZER_FILE, WORDS_FILE].map(|file| read_text(&folder.join(file)));
        let lexicon = Self::parse(&pieces?, &words?, table.text_pieces)?;
        match table.is_guided() {
            true => Ok(lexicon.with_styles(&read_text(&folder.join(STYLES_FILE))?)),
            false => Ok(lexicon),
        }
    }

    /// Adds a list of the wordings of styles, one a line.
    pub(crate) fn with_styles(mut self, styles: &str) -> Self {
        let wording = |line: &str| -> Vec<String> {
            let normal = self.normal(line);
            normal.split_whitespace().map(str::to_owned).collect()
        };
        let mut wordings: Vec<Vec<String>> = styles.lines().map(wording).collect();
        wordings.retain(|words| !words.is_empty());
        wordings.sort_by(|a, b| b.len().cmp(&a.len()).then_with(|| a.cmp(b)));
        self.styles = wordings;
        self
    }

    /// The text, normalised, without the wordings of styles in it. None if it has none of them, or
    /// nothing else.
    pub(crate) fn unstyled(&self, text: &str) -> Option<String> {
        let normal = self.normal(text);
        let words: Vec<&str> = normal.split_whitespace().collect();
        let mut kept: Vec<&str> = Vec::new();
        let mut rest = &words[..];
        while let Some((first, after)) = rest.split_first() {
            let found = (self.styles.iter()).find(|wording| {
                rest.len() >= wording.len() && rest.iter().zip(*wording).all(|(a, b)| a == b)
            });
            rest = match found {
                Some(wording) => &rest[wording.len()..],
                None => {
                    kept.push(first);
                    after
                }
            };
        }
        if kept.len() == words.len() || kept.is_empty() {
            return None;
        }
        // "an angry person" without its style is "a person".
        for place in 1..kept.len() {
            if matches!(kept[place - 1], "a" | "an") {
                let is_open = kept[place].starts_with(['a', 'e', 'i', 'o', 'u']);
                kept[place - 1] = if is_open { "an" } else { "a" };
            }
        }
        Some(kept.join(" "))
    }

    /// A short wording of a style; none for a pack without guidance.
    pub(crate) fn style(&self) -> Option<String> {
        self.styles.last().map(|words| words.join(" "))
    }

    /// Parses a `tokenizer.json` that must have `pieces` pieces, and a list of words, one a line.
    pub(crate) fn parse(text: &str, words: &str, pieces: usize) -> Result<Self, PackProblem> {
        let mut tokenizer =
            Tokenizer::from_bytes(text).map_err(|cause| PackProblem::Tokenizer(cause.to_string()))?;
        tokenizer.with_padding(None);
        tokenizer
            .with_truncation(None)
            .map_err(|cause| PackProblem::Tokenizer(cause.to_string()))?;
        let ids: BTreeSet<u32> = tokenizer.get_vocab(true).into_values().collect();
        let last = ids.last().map_or(0, |&id| id as usize + 1);
        if ids.len() != pieces || last != pieces {
            let allowed = format!(
                "{}, the number of ids in {TOKENIZER_FILE}, which count from 0",
                ids.len()
            );
            return Err(field("vermo.text_pieces", pieces, allowed));
        }
        let mut lexicon = Self {
            tokenizer,
            words: BTreeSet::new(),
            styles: Vec::new(),
        };
        lexicon.words = words.lines().map(|word| lexicon.normal(word)).collect();
        Ok(lexicon)
    }

    /// The text after the tokenizer's own normalisation; empty if it cannot be normalised.
    fn normal(&self, text: &str) -> String {
        let mut normal = NormalizedString::from(text);
        match self
            .tokenizer
            .get_normalizer()
            .map(|normalizer| normalizer.normalize(&mut normal))
        {
            None | Some(Ok(())) => normal.get().to_owned(),
            Some(Err(_)) => String::new(),
        }
    }

    /// The pieces of a text.
    ///
    /// # Errors
    /// The tokenizer library's message, if it cannot take the text.
    pub fn pieces(&self, text: &str) -> Result<Vec<u32>, String> {
        let encoding = self.tokenizer.encode_fast(text, false);
        Ok(encoding.map_err(|cause| cause.to_string())?.get_ids().to_vec())
    }

    /// The text of pieces.
    ///
    /// # Errors
    /// The tokenizer library's message, if it cannot take the pieces.
    pub fn text(&self, pieces: &[u32]) -> Result<String, String> {
        self.tokenizer
            .decode(pieces, true)
            .map_err(|cause| cause.to_string())
    }

    /// The words in captions of the training, in alphabetical order.
    pub fn words(&self) -> impl Iterator<Item = &str> {
        self.words.iter().map(String::as_str)
    }

    /// Words of a text that occur in no caption of the training, each once, in the order of the
    /// text. Spaces and punctuation separate words; an apostrophe inside a word belongs to it.
    pub fn unknown_words(&self, text: &str) -> Vec<String> {
        let words = text.split(|c: char| !c.is_alphanumeric() && !matches!(c, '\'' | '’'));
        let words = words.map(|word| word.trim_matches(['\'', '’']));
        let mut unknown: Vec<String> = Vec::new();
        for word in words.filter(|word| !word.is_empty()) {
            let word = word.to_lowercase();
            if !self.words.contains(&self.normal(&word)) && !unknown.contains(&word) {
                unknown.push(word);
            }
        }
        unknown
    }
}
