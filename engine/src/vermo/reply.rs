//! What a reply may hold next: its own kind of code, and the marks that part or end it.

use std::ops::Range;

use super::vocabulary::{AGENT_SEP, EOS, Kind, Vocabulary};

/// What a reply may hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rules {
    /// What it is made of.
    pub kind: Kind,
    /// Agents whose parts it has.
    pub agents: usize,
    /// Fewest codes of an agent.
    pub least: usize,
    /// Most codes of an agent.
    pub most: usize,
}

/// The tokens that may come next.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Allowed {
    /// Codes.
    pub codes: Range<u32>,
    /// A mark.
    pub mark: Option<u32>,
}

impl Allowed {
    /// The ids, in rising order.
    pub fn ids(&self) -> impl Iterator<Item = u32> + use<> {
        // Marks come before all codes in a vocabulary.
        self.mark.into_iter().chain(self.codes.clone())
    }
}

/// A reply as far as it goes.
#[derive(Debug, Clone)]
pub struct Reply {
    rules: Rules,
    codes: Range<u32>,
    /// All tokens of it, marks included.
    tokens: Vec<u32>,
    /// Agents that are done.
    done: usize,
    /// Codes of the agent that is being written.
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

    /// What may come next.
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

    /// Takes the next token. Says whether the reply is whole.
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

    /// Whether nothing but the end may come next: there is no need to ask the network.
    pub fn must_end(&self) -> bool {
        let Allowed { codes, mark } = self.allowed();
        codes.is_empty() && mark == Some(EOS)
    }

    /// Its tokens, marks included.
    pub fn tokens(&self) -> &[u32] {
        &self.tokens
    }
}
