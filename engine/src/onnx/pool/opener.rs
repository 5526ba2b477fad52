//! Opens networks: indispensable ones at once, others in the background.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Instant;

use super::graph::Graph;
use super::state::{Key, State};
use crate::EngineError;
use crate::onnx::calls::CALL_ROWS;
use crate::onnx::exit;
use crate::onnx::network::Sample;
use crate::onnx::openvino::Compiled;

/// The thread that opens networks in the background. Dropping it ends the thread and waits for it:
/// a library that compiles must not be left running while the process exits.
pub(super) struct Opener {
    closing: Arc<AtomicBool>,
    /// Holds each shape at most once. None if the thread could not start.
    wanted: Option<Sender<(Key, Arc<Graph>)>>,
    thread: Option<JoinHandle<()>>,
}

impl Opener {
    pub(super) fn start(networks: Arc<Networks>) -> Self {
        let (wanted, asked) = channel();
        let closing = Arc::new(AtomicBool::new(false));
        let until = closing.clone();
        let thread = std::thread::Builder::new()
            .name("open-networks".to_owned())
            .spawn(move || networks.open_wanted(&asked, &until))
            .inspect_err(|error| tracing::warn!(%error, "no networks open in the background"))
            .ok();
        Self {
            closing,
            wanted: thread.is_some().then_some(wanted),
            thread,
        }
    }

    /// Asks for a network.
    pub(super) fn ask(&self, key: Key, graph: &Arc<Graph>) {
        if let Some(wanted) = &self.wanted {
            // Fails only after the thread has ended.
            let _ = wanted.send((key, graph.clone()));
        }
    }
}

impl Drop for Opener {
    fn drop(&mut self) {
        self.closing.store(true, Ordering::Relaxed);
        self.wanted = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// What is open, shared by everything that uses and opens networks.
pub(super) struct Networks {
    pub(super) budget_bytes: u64,
    state: Mutex<State<Compiled>>,
    /// Signals that a network was opened, or came back.
    changed: Condvar,
}

impl Networks {
    pub(super) fn new(budget_bytes: u64) -> Self {
        Self {
            budget_bytes,
            state: Mutex::default(),
            changed: Condvar::new(),
        }
    }

    pub(super) fn lock(&self) -> MutexGuard<'_, State<Compiled>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until a network was opened or came back.
    pub(super) fn wait<'a>(
        &'a self,
        mut state: MutexGuard<'a, State<Compiled>>,
    ) -> MutexGuard<'a, State<Compiled>> {
        state.waiting += 1;
        let mut state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        state.waiting -= 1;
        state
    }

    /// Wakes the workers that wait for a network.
    fn wake(&self, state: MutexGuard<'_, State<Compiled>>) {
        let waiting = state.waiting;
        drop(state);
        if waiting > 0 {
            self.changed.notify_all();
        }
    }

    /// Takes a network back.
    pub(super) fn give_back(&self, key: Key, network: Compiled) {
        let mut state = self.lock();
        state.put(key, network);
        self.wake(state);
    }

    /// Opens the network for one row, whatever the budget. Others are compared with it.
    pub(super) fn open_least(&self, graph: &Arc<Graph>, length: usize) -> Result<(), EngineError> {
        let key = Key {
            graph: graph.id,
            length,
            rows: 1,
        };
        {
            let mut state = self.lock();
            if state.exists(key) {
                return Ok(());
            }
            state.reserve(key, graph.bytes);
        }
        self.open_reserved(graph, key)
    }

    /// Opens a network now, whatever the budget.
    pub(super) fn open(&self, graph: &Arc<Graph>, key: Key) -> Result<(), EngineError> {
        self.lock().reserve(key, graph.bytes);
        self.open_reserved(graph, key)
    }

    /// Opens a network within reserved memory.
    fn open_reserved(&self, graph: &Arc<Graph>, key: Key) -> Result<(), EngineError> {
        let opened = self.opened(graph, key);
        let mut state = self.lock();
        let result = match opened {
            Ok(Some(network)) => {
                if state.opened(key, network, Instant::now()) {
                    exit::register();
                }
                Ok(())
            }
            Ok(None) => {
                state.release(key);
                state.forbid(key);
                let (stage, Key { length, rows, .. }) = (graph.stage.name(), key);
                tracing::warn!(
                    stage,
                    length,
                    rows,
                    "rows of such a call are not what they are alone: batches are run in smaller ones, which is slower"
                );
                Ok(())
            }
            Err(error) => {
                state.release(key);
                Err(error)
            }
        };
        self.wake(state);
        result
    }

    /// A network that has run once. None if one of its rows differs in any bit from the row alone:
    /// a CPU may use other instructions for larger products, and bugs of OpenVINO also show like
    /// this.
    fn opened(&self, graph: &Arc<Graph>, key: Key) -> Result<Option<Compiled>, EngineError> {
        let started = Instant::now();
        let run = |reason: String| EngineError::Run {
            stage: graph.stage,
            reason,
        };
        let mut network = graph.compile(key)?;
        let most = CALL_ROWS[CALL_ROWS.len() - 1];
        let same = if key.rows == 1 {
            let sample = Sample::new(&graph.dims, graph.stage, key.length, most);
            let alone: Result<Vec<u64>, String> = (0..most)
                .map(|row| Ok(sample.run(&mut network, row..row + 1)?[0]))
                .collect();
            let alone = alone.map_err(run)?;
            let mut state = self.lock();
            let of_length = state.of_length(key);
            **of_length.alone.get_or_insert_with(|| Arc::new(alone.clone())) == alone
        } else {
            let alone = self.alone(graph, key.length)?;
            let sample = Sample::new(&graph.dims, graph.stage, key.length, key.rows);
            let together = sample.run(&mut network, 0..key.rows).map_err(run)?;
            alone[..key.rows] == together
        };
        let Key { length, rows, .. } = key;
        let (stage, took) = (graph.stage.name(), started.elapsed());
        tracing::debug!(stage, length, rows, ?took, same, "network opened");
        Ok(same.then_some(network))
    }

    /// The results of the sample's rows alone.
    fn alone(&self, graph: &Arc<Graph>, length: usize) -> Result<Arc<Vec<u64>>, EngineError> {
        let key = Key {
            graph: graph.id,
            length,
            rows: 1,
        };
        loop {
            let mut state = self.lock();
            if let Some(alone) = state.of_length(key).alone.clone() {
                return Ok(alone);
            }
            if state.exists(key) {
                drop(self.wait(state));
            } else {
                drop(state);
                self.open_least(graph, length)?;
            }
        }
    }

    /// Opens requested networks until no more requests can come.
    fn open_wanted(&self, asked: &Receiver<(Key, Arc<Graph>)>, closing: &AtomicBool) {
        while let Ok((key, graph)) = asked.recv() {
            if closing.load(Ordering::Relaxed) {
                return;
            }
            // Networks that close are dropped without the lock.
            let room = self
                .lock()
                .make_room_for(key, graph.bytes, self.budget_bytes, Instant::now());
            if room.is_some()
                && let Err(error) = self.open_reserved(&graph, key)
            {
                tracing::warn!(stage = graph.stage.name(), %error, "a network does not open");
                self.lock().refuse(key, Instant::now());
            }
        }
    }
}
