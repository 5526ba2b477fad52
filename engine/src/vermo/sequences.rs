//! Continuous batching: sequences join and leave between tokens, and no call waits for the longest
//! of them.
//!
//! A new sequence is read as a whole (prefill). Then each step gives it one more token, in one call
//! for all sequences. A sequence that ends leaves its slot of the cache to one that waits.

use std::collections::VecDeque;

use super::arena::{Arena, Shape};
use super::network::{LanguageAnswer, LanguageCall, Networks};
use super::reply::{Reply, Rules};
use super::sampler::{Sampler, Sampling};
use super::vocabulary::{PAD, Vocabulary};
use crate::EngineError;
use crate::generator::JobId;

/// Prefill reads a multiple of this number of columns. So the engine sees few shapes, and the
/// number depends on the sequence alone.
const PREFILL_UNIT: usize = 16;
/// Most sequences of one prefill.
const PREFILL_ROWS: usize = 8;
/// Fewest rows of a call. One row alone would run other kernels, which round differently.
const LEAST_ROWS: usize = 2;

/// A message that needs a reply.
#[derive(Debug, Clone)]
pub struct Prompt {
    /// The message's tokens, up to `<REPLY>`.
    pub tokens: Vec<u32>,
    /// Which tokens the reply may have.
    pub rules: Rules,
    /// How the reply's tokens are chosen.
    pub sampling: Sampling,
    /// Seed of the choices, from the task.
    pub seed: u64,
    /// Tokens that were drawn with the seed before this reply.
    pub drawn: u64,
}

/// The result of a step for a sequence.
#[derive(Debug, Clone, PartialEq)]
pub enum Said {
    /// The reply has one more token.
    Token(u32),
    /// The reply is complete.
    End,
    /// The sequence fails: its logits are not finite.
    Failed,
}

/// A sequence in progress.
#[derive(Debug)]
struct Sequence {
    id: JobId,
    prompt: Prompt,
    reply: Reply,
    /// Filled columns of the sequence's slot.
    filled: usize,
    is_over: bool,
}

/// The sequences of one worker.
#[derive(Debug)]
pub struct Sequences {
    vocabulary: Vocabulary,
    slots: usize,
    arena: Arena,
    /// The sequences in progress, in the order of their slots.
    active: Vec<Sequence>,
    waiting: VecDeque<Sequence>,
    sampler: Sampler,
    answer: LanguageAnswer,
}

impl Sequences {
    /// Writes up to `slots` sequences at a time; others wait.
    pub fn new(shape: Shape, vocabulary: Vocabulary, slots: usize) -> Self {
        Self {
            vocabulary,
            slots: slots.max(1),
            arena: Arena::new(shape),
            active: Vec::new(),
            waiting: VecDeque::new(),
            sampler: Sampler::default(),
            answer: LanguageAnswer::default(),
        }
    }

    /// Number of sequences, waiting ones included.
    pub fn len(&self) -> usize {
        self.active.len() + self.waiting.len()
    }

    /// Whether there are no sequences.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Most tokens of a reply after a prompt of `prompt` tokens, not counting the token for its
    /// end. Negative if the prompt leaves no room.
    pub fn room(&self, prompt: usize) -> usize {
        self.arena.shape().positions.saturating_sub(prompt + 1)
    }

    /// Adds a sequence. Its prompt and its longest reply must fit into a slot: see
    /// [`Sequences::room`].
    pub fn admit(&mut self, id: JobId, prompt: Prompt) {
        let reply = Reply::new(prompt.rules, &self.vocabulary);
        self.waiting.push_back(Sequence {
            id,
            prompt,
            reply,
            filled: 0,
            is_over: false,
        });
    }

    /// Removes a sequence, and frees its slot.
    pub fn cancel(&mut self, id: JobId) {
        self.waiting.retain(|sequence| sequence.id != id);
        while let Some(slot) = self.active.iter().position(|sequence| sequence.id == id) {
            self.leave(slot);
        }
    }

    /// Removes all sequences.
    pub fn clear(&mut self) {
        self.waiting.clear();
        self.active.clear();
    }

    /// Reads the prompts of new sequences, then writes one token of each sequence. Calls `out` for
    /// every token. Returns the rows of the last call.
    ///
    /// # Errors
    /// [`EngineError`] if the network fails.
    pub fn step(
        &mut self,
        networks: &mut dyn Networks,
        out: &mut dyn FnMut(JobId, Said),
    ) -> Result<usize, EngineError> {
        let joined = self.active.len();
        while self.active.len() < self.slots
            && let Some(sequence) = self.waiting.pop_front()
        {
            self.active.push(sequence);
        }
        for (columns, slots) in self.prefills(joined) {
            self.prefill(networks, columns, &slots, out)?;
        }
        self.drop_over();
        if self.active.is_empty() {
            return Ok(0);
        }
        let rows = self.decode(networks, out)?;
        self.drop_over();
        Ok(rows)
    }

    /// Groups the slots from `joined` on into calls of prefill, and gives the columns of each.
    fn prefills(&self, joined: usize) -> Vec<(usize, Vec<usize>)> {
        let mut groups: Vec<(usize, Vec<usize>)> = Vec::new();
        for (slot, sequence) in self.active.iter().enumerate().skip(joined) {
            let columns = sequence.prompt.tokens.len().next_multiple_of(PREFILL_UNIT);
            let fits = |group: &&mut (usize, Vec<usize>)| group.0 == columns && group.1.len() < PREFILL_ROWS;
            match groups.iter_mut().find(fits) {
                Some((_, slots)) => slots.push(slot),
                None => groups.push((columns, vec![slot])),
            }
        }
        groups
    }

    /// Reads the prompts in these slots.
    fn prefill(
        &mut self,
        networks: &mut dyn Networks,
        columns: usize,
        slots: &[usize],
        out: &mut dyn FnMut(JobId, Said),
    ) -> Result<(), EngineError> {
        let rows = slots.len().max(LEAST_ROWS);
        let mut tokens = vec![i64::from(PAD); rows * columns];
        let mut count = vec![1; rows];
        for (row, &slot) in slots.iter().enumerate() {
            let prompt = &self.active[slot].prompt.tokens;
            for (to, &token) in tokens[row * columns..].iter_mut().zip(prompt) {
                *to = i64::from(token);
            }
            count[row] = prompt.len() as i64;
        }
        let shape = self.arena.shape();
        let call = LanguageCall {
            sequences: rows,
            columns,
            cached: 1,
            tokens: &tokens,
            count: &count,
            start: &vec![0; rows],
            cache: &vec![0.0; rows * shape.numbers(1)],
        };
        self.answer.run(networks, &call, self.vocabulary.len(), shape)?;
        for (row, &slot) in slots.iter().enumerate() {
            let length = self.active[slot].prompt.tokens.len();
            self.receive(row, slot, columns, length, out);
        }
        Ok(())
    }

    /// Writes one more token of all sequences.
    fn decode(
        &mut self,
        networks: &mut dyn Networks,
        out: &mut dyn FnMut(JobId, Said),
    ) -> Result<usize, EngineError> {
        let rows = self.active.len().max(LEAST_ROWS);
        let last = |sequence: &Sequence| sequence.reply.tokens().last().copied().unwrap_or(PAD);
        let mut tokens: Vec<i64> = self.active.iter().map(|sequence| last(sequence).into()).collect();
        let mut start: Vec<i64> = self
            .active
            .iter()
            .map(|sequence| sequence.filled as i64)
            .collect();
        tokens.resize(rows, PAD.into());
        start.resize(rows, 0);
        let shape = self.arena.shape();
        let call = LanguageCall {
            sequences: rows,
            columns: 1,
            cached: shape.positions,
            tokens: &tokens,
            count: &vec![1; rows],
            start: &start,
            cache: self.arena.first(rows),
        };
        self.answer.run(networks, &call, self.vocabulary.len(), shape)?;
        for slot in 0..self.active.len() {
            self.receive(slot, slot, 1, 1, out);
        }
        Ok(rows)
    }

    /// Stores the answer of row `row` for a slot: `count` of `columns` columns, and the next token.
    fn receive(
        &mut self,
        row: usize,
        slot: usize,
        columns: usize,
        count: usize,
        out: &mut dyn FnMut(JobId, Said),
    ) {
        let sequence = &mut self.active[slot];
        let numbers = self.arena.shape().numbers(columns);
        let given = &self.answer.columns[row * numbers..(row + 1) * numbers];
        self.arena.write(slot, sequence.filled, count, given);
        sequence.filled += count;
        let width = self.vocabulary.len();
        let logits = &self.answer.logits[row * width..(row + 1) * width];
        let Prompt {
            sampling,
            seed,
            drawn,
            ..
        } = &sequence.prompt;
        let reply = &mut sequence.reply;
        let place = (*seed, drawn + reply.tokens().len() as u64);
        let token = self
            .sampler
            .choose(logits, &reply.allowed(), reply.tokens(), sampling, place);
        let Some(token) = token else {
            sequence.is_over = true;
            return out(sequence.id, Said::Failed);
        };
        sequence.is_over = reply.push(token);
        if !sequence.is_over {
            out(sequence.id, Said::Token(token));
            // If only the end may follow, the network need not run.
            sequence.is_over = reply.must_end();
        }
        if sequence.is_over {
            out(sequence.id, Said::End);
        }
    }

    /// Frees the slots of sequences that are complete.
    fn drop_over(&mut self) {
        while let Some(slot) = self.active.iter().position(|sequence| sequence.is_over) {
            self.leave(slot);
        }
    }

    /// Frees a slot: the last slot moves into it.
    fn leave(&mut self, slot: usize) {
        let last = self.active.len() - 1;
        if slot != last {
            self.arena.copy(last, slot);
        }
        self.active.swap_remove(slot);
    }
}

impl LanguageAnswer {
    /// Sizes the answer's buffers for a call, and runs it.
    fn run(
        &mut self,
        networks: &mut dyn Networks,
        call: &LanguageCall<'_>,
        vocabulary: usize,
        shape: Shape,
    ) -> Result<(), EngineError> {
        self.logits.resize(call.sequences * vocabulary, 0.0);
        self.columns
            .resize(call.sequences * shape.numbers(call.columns), 0.0);
        networks.language(call, self)
    }
}
