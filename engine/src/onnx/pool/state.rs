//! Decides which networks of fixed shapes are open, and which close for others: the rules, without
//! the networks.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::onnx::calls::Calls;

/// A network used within this time does not close for others, unless it is open more than once.
const KEEP: Duration = Duration::from_secs(10);
/// How often a network must be missed before it is opened. A rare shape is not worth it.
const MISSES: u32 = 3;
/// Time until a network is tried again for which the budget had no room.
const AGAIN: Duration = Duration::from_secs(5);

/// What is open, and what should be. `N` is a network.
pub(super) struct State<N> {
    shapes: HashMap<Key, Shape<N>>,
    lengths: HashMap<(u64, usize), OfLength>,
    pub(super) used_bytes: u64,
    /// Number of workers that wait for a network.
    pub(super) waiting: usize,
}

/// The shape of a network.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Key {
    pub(super) graph: u64,
    pub(super) length: usize,
    pub(super) rows: usize,
}

struct Shape<N> {
    idle: Vec<N>,
    /// Number of idle networks, those at work, and those being opened.
    count: usize,
    bytes: u64,
    misses: u32,
    used: Option<Instant>,
    refused: Option<Instant>,
    queued: bool,
}

/// State of the calls of one length.
#[derive(Default)]
pub(super) struct OfLength {
    pub(super) calls: Calls,
    /// Results of the sample's rows alone, once a network for one row was open.
    pub(super) alone: Option<Arc<Vec<u64>>>,
    /// Number of networks of all sizes, those being opened included.
    pub(super) open: usize,
}

impl<N> Default for State<N> {
    fn default() -> Self {
        Self {
            shapes: HashMap::new(),
            lengths: HashMap::new(),
            used_bytes: 0,
            waiting: 0,
        }
    }
}

impl<N> Default for Shape<N> {
    fn default() -> Self {
        Self {
            idle: Vec::new(),
            count: 0,
            bytes: 0,
            misses: 0,
            used: None,
            refused: None,
            queued: false,
        }
    }
}

impl<N> State<N> {
    /// State of the calls with a shape's length.
    pub(super) fn of_length(&mut self, key: Key) -> &mut OfLength {
        self.lengths.entry((key.graph, key.length)).or_default()
    }

    /// Whether such a network is open, or being opened.
    pub(super) fn exists(&self, key: Key) -> bool {
        self.shapes.get(&key).is_some_and(|shape| shape.count > 0)
    }

    /// Takes back a network. One of a forgotten pack is dropped.
    pub(super) fn put(&mut self, key: Key, network: N) {
        if let Some(shape) = self.shapes.get_mut(&key) {
            shape.idle.push(network);
        }
    }

    /// Takes a network that was opened. Answers whether it is the first of its shape.
    pub(super) fn opened(&mut self, key: Key, network: N, now: Instant) -> bool {
        let Some(shape) = self.shapes.get_mut(&key) else {
            return false;
        };
        shape.idle.push(network);
        shape.misses = 0;
        shape.used.replace(now).is_none()
    }

    /// Removes a graph, and returns its networks.
    pub(super) fn forget(&mut self, graph: u64) -> Vec<N> {
        self.lengths.retain(|(id, _), _| *id != graph);
        let shapes = self.shapes.extract_if(|key, _| key.graph == graph);
        let mut networks = Vec::new();
        for (_, shape) in shapes {
            self.used_bytes -= shape.bytes * shape.count as u64;
            networks.extend(shape.idle);
        }
        networks
    }

    /// Notes that a requested shape could not be opened. It is tried again later.
    pub(super) fn refuse(&mut self, key: Key, now: Instant) {
        if let Some(shape) = self.shapes.get_mut(&key) {
            shape.refused = Some(now);
        }
    }

    /// Reserves room for a requested network. Returns the networks that close for it. None if there
    /// is no room, or the graph was forgotten.
    pub(super) fn make_room_for(
        &mut self,
        key: Key,
        bytes: u64,
        budget: u64,
        now: Instant,
    ) -> Option<Vec<N>> {
        self.shapes.get_mut(&key)?.queued = false;
        let closed = self.make_room(key, bytes, budget, now);
        match &closed {
            Some(_) => self.reserve(key, bytes),
            None => self.refuse(key, now),
        }
        closed
    }

    pub(super) fn is_idle(&self, key: Key) -> bool {
        self.shapes.get(&key).is_some_and(|shape| !shape.idle.is_empty())
    }

    pub(super) fn take(&mut self, key: Key, now: Instant) -> Option<N> {
        let shape = self.shapes.get_mut(&key)?;
        let network = shape.idle.pop()?;
        shape.used = Some(now);
        Some(network)
    }

    pub(super) fn reserve(&mut self, key: Key, bytes: u64) {
        let shape = self.shapes.entry(key).or_default();
        shape.count += 1;
        shape.bytes = bytes;
        self.used_bytes += bytes;
        self.lengths.entry((key.graph, key.length)).or_default().open += 1;
    }

    pub(super) fn release(&mut self, key: Key) {
        if let Some(shape) = self.shapes.get_mut(&key) {
            shape.count = shape.count.saturating_sub(1);
            self.used_bytes = self.used_bytes.saturating_sub(shape.bytes);
            if let Some(of_length) = self.lengths.get_mut(&(key.graph, key.length)) {
                of_length.open = of_length.open.saturating_sub(1);
            }
        }
    }

    /// Whether another network may open: one for each of `workers`.
    pub(super) fn may_open(&self, key: Key, workers: usize) -> bool {
        self.shapes.get(&key).map_or(0, |shape| shape.count) < workers.max(1)
    }

    /// Notes that a network is missing. Answers whether to open it.
    pub(super) fn miss(&mut self, key: Key, workers: usize, now: Instant) -> bool {
        let may_open = self.may_open(key, workers);
        let shape = self.shapes.entry(key).or_default();
        shape.misses += 1;
        let refused = shape.refused.is_some_and(|refused| now - refused < AGAIN);
        if shape.queued || !may_open || refused || shape.misses < MISSES {
            return false;
        }
        shape.queued = true;
        true
    }

    /// Allows no more calls of this many rows or more, which is slower but never wrong.
    pub(super) fn forbid(&mut self, key: Key) {
        if let Some(of_length) = self.lengths.get_mut(&(key.graph, key.length)) {
            of_length.calls.forbid(key.rows);
        }
    }

    /// Removes networks until `bytes` fit into the budget. None if too few may be closed.
    fn make_room(&mut self, key: Key, bytes: u64, budget: u64, now: Instant) -> Option<Vec<N>> {
        let is_first = self.shapes.get(&key).is_none_or(|shape| shape.count == 0);
        let (mut victims, mut freed) = (Vec::new(), 0);
        // Oldest first. Of each shape as many as the rules above allow to close.
        let mut candidates: BTreeMap<(Option<Instant>, usize), Key> = BTreeMap::new();
        for (index, (&other, shape)) in self.shapes.iter().enumerate() {
            if other != key && !shape.idle.is_empty() {
                candidates.insert((shape.used, index), other);
            }
        }
        let mut left: HashMap<(u64, usize), usize> = HashMap::new();
        for other in candidates.into_values() {
            let shape = &self.shapes[&other];
            let of_length = (other.graph, other.length);
            let open = left
                .entry(of_length)
                .or_insert_with(|| self.lengths.get(&of_length).map_or(0, |of| of.open));
            let is_old = shape.used.is_none_or(|used| now - used > KEEP);
            for nth in 0..shape.idle.len() {
                let is_double = shape.count - nth > 1;
                if self.used_bytes + bytes <= budget + freed
                    || *open <= 1
                    || !(is_old || (is_first && is_double))
                {
                    break;
                }
                *open -= 1;
                freed += shape.bytes;
                victims.push(other);
            }
        }
        if self.used_bytes + bytes > budget + freed {
            return None;
        }
        let mut closed = Vec::new();
        for key in victims {
            closed.extend(self.shapes.get_mut(&key).and_then(|shape| shape.idle.pop()));
            self.release(key);
        }
        Some(closed)
    }
}

#[cfg(test)]
#[path = "state_tests.rs"]
mod tests;
