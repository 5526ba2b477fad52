//! The rules of a reply: codes of its own kind, and the special tokens that separate or end them.

use std::ops::Range;

use super::vocabulary::{AGENT_SEP, EOS, Kind, Vocabulary};

/// Which codes a reply has, and how many.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rules {
    /// Kind of the reply's codes.
    pub kind: Kind,
    /// Number of agents; their parts follow each other.
    pub agents: usize,
    /// Fewest codes of an agent's part.
    pub least: usize,
    /// Most codes of an agent's part.
    pub most: usize,
}

/// The tokens that may follow.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Allowed {
    /// Ids of codes.
    pub codes: Range<u32>,
    /// Id of a special token that separates or ends parts.
    pub mark: Option<u32>,
}

impl Allowed {
    /// The ids of all tokens that may follow, in rising order.
    pub fn ids(&self) -> impl Iterator<Item = u32> + use<> {
        // Special tokens precede all codes in a vocabulary.
        self.mark.into_iter().chain(self.codes.clone())
    }
}

/// A reply in progress.
#[derive(Debug, Clone)]
pub struct Reply {
    rules: Rules,
    codes: Range<u32>,
    /// All tokens of the reply so far, special ones included.
    tokens: Vec<u32>,
    /// Number of agents whose parts are complete.
    done: usize,
    /// Codes of the current agent's part.
    written: usize,
}

impl Reply {
    /// An empty reply.
    pub fn new(rules: Rules, vocabulary: &Vocabulary) -> Self {
        Self {
            codes: vocabulary.range(rules.kind),
            rules,
            tokens: Vec::new(),
            done: 0,
            written: 0,
        }
    }

    /// The tokens that may follow.
    pub fn allowed(&self) -> Allowed {
        let Rules {
            agents, least, most, ..
        } = self.rules;
        let mark = match self.done + 1 < agents {
            true => AGENT_SEP,
            false => EOS,
        };
        let is_full = self.written >= most;
        Allowed {
            codes: if is_full { 0..0 } else { self.codes.clone() },
            mark: (self.written >= least || is_full).then_some(mark),
        }
    }

    /// Appends a token. Returns whether the reply is complete.
    pub fn push(&mut self, token: u32) -> bool {
        self.tokens.push(token);
        match token {
            AGENT_SEP => {
                self.done += 1;
                self.written = 0;
            }
            EOS => self.done += 1,
            _ => self.written += 1,
        }
        token == EOS
    }

    /// Whether only the end may follow: then the network does not run.
    pub fn must_end(&self) -> bool {
        let Allowed { codes, mark } = self.allowed();
        codes.is_empty() && mark == Some(EOS)
    }

    /// All tokens of the reply so far, special ones included.
    pub fn tokens(&self) -> &[u32] {
        &self.tokens
    }
}
