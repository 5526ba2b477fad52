//! Continuous batching: sequences join and leave between tokens, and no call waits for the longest
//! of them.
//!
//! A new sequence is read as a whole (prefill). Then each step gives it one more token, in one call
//! for all sequences. A sequence that ends leaves its slot of the cache to one that waits.

use std::cmp::Reverse;
use std::collections::{BTreeMap, VecDeque};

use super::arena::{Arena, Shape};
use super::network::{LanguageAnswer, LanguageCall, Networks};
use super::reply::{Reply, Rules};
use super::sampler::{Logits, Sampler, Sampling};
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
    /// Further messages that count in the choice of each token; empty if the prompt alone counts.
    pub guides: Vec<Guide>,
    /// Which tokens the reply may have.
    pub rules: Rules,
    /// How the reply's tokens are chosen.
    pub sampling: Sampling,
    /// Seed of the choices, from the task.
    pub seed: u64,
    /// Tokens that were drawn with the seed before this reply.
    pub drawn: u64,
}

/// A message beside the prompt: the model reads the reply behind it as well. The logits of a token
/// are the weighted sum over all messages. The prompt has the rest of the weight, up to 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Guide {
    /// The message's tokens, at most as many as the prompt has.
    pub tokens: Vec<u32>,
    /// Weight of its logits; below 0 the reply is guided away from the message.
    pub weight: f32,
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
    /// The row of the prompt, then those of the guides. Empty while the sequence waits.
    rows: Vec<Row>,
    is_over: bool,
}

/// A message in the cache.
#[derive(Debug, Clone, Copy)]
struct Row {
    slot: usize,
    /// Filled columns of the slot.
    filled: usize,
}

/// A message that the network has not read yet.
#[derive(Debug)]
struct Unread {
    slot: usize,
    tokens: Vec<u32>,
}

/// Tokens of a prompt's messages, in the order of a sequence's rows.
fn messages(prompt: &Prompt) -> impl Iterator<Item = &[u32]> {
    let guides = prompt.guides.iter().map(|guide| &guide.tokens[..]);
    std::iter::once(&prompt.tokens[..]).chain(guides)
}

impl Sequence {
    /// Chooses the next token from the logits of each row.
    fn choose(&mut self, sampler: &mut Sampler, rows: &[&[f32]], out: &mut dyn FnMut(JobId, Said)) {
        let Prompt {
            sampling,
            seed,
            drawn,
            guides,
            ..
        } = &self.prompt;
        let reply = &mut self.reply;
        let place = (*seed, drawn + reply.tokens().len() as u64);
        let (own, others) = rows
            .split_first()
            .map_or((&[][..], &[][..]), |(own, others)| (*own, others));
        let weights = guides.iter().map(|guide| guide.weight);
        let logits = Logits {
            own,
            guides: &others.iter().copied().zip(weights).collect::<Vec<_>>(),
        };
        let token = sampler.choose(logits, &reply.allowed(), reply.tokens(), sampling, place);
        let Some(token) = token else {
            self.is_over = true;
            return out(self.id, Said::Failed);
        };
        self.is_over = reply.push(token);
        if !self.is_over {
            out(self.id, Said::Token(token));
            // If only the end may follow, the network need not run.
            self.is_over = reply.must_end();
        }
        if self.is_over {
            out(self.id, Said::End);
        }
    }
}

/// The sequences of one worker.
#[derive(Debug)]
pub struct Sequences {
    vocabulary: Vocabulary,
    most_rows: usize,
    arena: Arena,
    /// The sequences in progress. Their rows fill the first slots of the arena.
    active: Vec<Sequence>,
    waiting: VecDeque<Sequence>,
    sampler: Sampler,
    answer: LanguageAnswer,
}

impl Sequences {
    /// Writes sequences of up to `most_rows` rows at a time; others wait. A sequence has a row for
    /// its prompt and one for each guide. If it has more than `most_rows`, it is written alone.
    pub fn new(shape: Shape, vocabulary: Vocabulary, most_rows: usize) -> Self {
        Self {
            vocabulary,
            most_rows: most_rows.max(1),
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
            rows: Vec::new(),
            is_over: false,
        });
    }

    /// Removes a sequence, and frees its slot.
    pub fn cancel(&mut self, id: JobId) {
        self.waiting.retain(|sequence| sequence.id != id);
        while let Some(index) = self.active.iter().position(|sequence| sequence.id == id) {
            self.leave(index);
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
        self.join();
        self.read(joined, networks, out)?;
        self.drop_over();
        if self.active.is_empty() {
            return Ok(0);
        }
        let rows = self.decode(networks, out)?;
        self.drop_over();
        Ok(rows)
    }

    /// Rows of the sequences in progress.
    fn rows(&self) -> usize {
        self.active.iter().map(|sequence| sequence.rows.len()).sum()
    }

    /// Gives slots to waiting sequences, in their order, while there are enough.
    fn join(&mut self) {
        let mut rows = self.rows();
        while let Some(mut sequence) = self.waiting.pop_front() {
            let wanted = messages(&sequence.prompt).count();
            if rows > 0 && rows + wanted > self.most_rows {
                return self.waiting.push_front(sequence);
            }
            let slots = rows..rows + wanted;
            sequence.rows = slots.map(|slot| Row { slot, filled: 0 }).collect();
            rows += wanted;
            self.active.push(sequence);
        }
    }

    /// Reads the messages of the sequences from `joined` on, and chooses the first token of each.
    fn read(
        &mut self,
        joined: usize,
        networks: &mut dyn Networks,
        out: &mut dyn FnMut(JobId, Said),
    ) -> Result<(), EngineError> {
        let width = self.vocabulary.len();
        let mut logits: BTreeMap<usize, Vec<f32>> = BTreeMap::new();
        for (columns, messages) in self.prefills(joined) {
            self.prefill(networks, columns, &messages)?;
            let answers = self.answer.logits.chunks_exact(width).map(<[f32]>::to_vec);
            logits.extend(messages.iter().map(|message| message.slot).zip(answers));
        }
        for sequence in &mut self.active[joined..] {
            for (row, tokens) in sequence.rows.iter_mut().zip(messages(&sequence.prompt)) {
                row.filled = tokens.len();
            }
            let rows = sequence.rows.iter().filter_map(|row| logits.get(&row.slot));
            let rows: Vec<&[f32]> = rows.map(Vec::as_slice).collect();
            sequence.choose(&mut self.sampler, &rows, out);
        }
        Ok(())
    }

    /// Groups the messages of the sequences from `joined` on into calls of prefill, and gives the
    /// columns of each.
    fn prefills(&self, joined: usize) -> Vec<(usize, Vec<Unread>)> {
        let mut groups: Vec<(usize, Vec<Unread>)> = Vec::new();
        for sequence in &self.active[joined..] {
            for (row, tokens) in sequence.rows.iter().zip(messages(&sequence.prompt)) {
                let columns = tokens.len().next_multiple_of(PREFILL_UNIT);
                let message = Unread {
                    slot: row.slot,
                    tokens: tokens.to_vec(),
                };
                let fits =
                    |group: &&mut (usize, Vec<Unread>)| group.0 == columns && group.1.len() < PREFILL_ROWS;
                match groups.iter_mut().find(fits) {
                    Some((_, messages)) => messages.push(message),
                    None => groups.push((columns, vec![message])),
                }
            }
        }
        groups
    }

    /// Reads these messages into their slots.
    fn prefill(
        &mut self,
        networks: &mut dyn Networks,
        columns: usize,
        messages: &[Unread],
    ) -> Result<(), EngineError> {
        let rows = messages.len().max(LEAST_ROWS);
        let mut tokens = vec![i64::from(PAD); rows * columns];
        let mut count = vec![1; rows];
        for (row, message) in messages.iter().enumerate() {
            for (to, &token) in tokens[row * columns..].iter_mut().zip(&message.tokens) {
                *to = i64::from(token);
            }
            count[row] = message.tokens.len() as i64;
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
        let answered = self.answer.columns.chunks_exact(shape.numbers(columns));
        for (message, columns) in messages.iter().zip(answered) {
            self.arena.write(message.slot, 0, message.tokens.len(), columns);
        }
        Ok(())
    }

    /// Writes one more token of all sequences.
    fn decode(
        &mut self,
        networks: &mut dyn Networks,
        out: &mut dyn FnMut(JobId, Said),
    ) -> Result<usize, EngineError> {
        let rows = self.rows().max(LEAST_ROWS);
        let mut tokens = vec![i64::from(PAD); rows];
        let mut start = vec![0; rows];
        for sequence in &self.active {
            let last = sequence.reply.tokens().last().copied().unwrap_or(PAD);
            for row in &sequence.rows {
                tokens[row.slot] = last.into();
                start[row.slot] = row.filled as i64;
            }
        }
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
        let (width, numbers) = (self.vocabulary.len(), shape.numbers(1));
        for sequence in &mut self.active {
            let mut logits = Vec::with_capacity(sequence.rows.len());
            for row in &mut sequence.rows {
                let columns = &self.answer.columns[row.slot * numbers..(row.slot + 1) * numbers];
                self.arena.write(row.slot, row.filled, 1, columns);
                row.filled += 1;
                logits.push(&self.answer.logits[row.slot * width..(row.slot + 1) * width]);
            }
            sequence.choose(&mut self.sampler, &logits, out);
        }
        Ok(rows)
    }

    /// Frees the slots of sequences that are complete.
    fn drop_over(&mut self) {
        while let Some(index) = self.active.iter().position(|sequence| sequence.is_over) {
            self.leave(index);
        }
    }

    /// Frees the slots of a sequence: the rows of the last slots move into them.
    fn leave(&mut self, index: usize) {
        let mut used = self.rows();
        let mut freed = self.active.swap_remove(index).rows;
        // The last slot first, so that a row of this sequence never moves.
        freed.sort_unstable_by_key(|row| Reverse(row.slot));
        for Row { slot, .. } in freed {
            used -= 1;
            let mut others = self.active.iter_mut().flat_map(|sequence| &mut sequence.rows);
            if let Some(last) = others.find(|row| row.slot == used) {
                self.arena.copy(used, slot);
                last.slot = slot;
            }
        }
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
