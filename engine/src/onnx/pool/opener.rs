//! Opens networks: those that a pack cannot do without at once, others in the background.

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

/// The thread that opens networks in the background. Dropped, it ends the thread and waits for it:
/// a library that compiles must not be left while the process exits.
pub(super) struct Opener {
    closing: Arc<AtomicBool>,
    /// Holds each shape once at most. None where there is no thread.
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
            // The thread ends with this only.
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

/// What is open, shared by all who use and open networks.
pub(super) struct Networks {
    pub(super) budget_bytes: u64,
    state: Mutex<State<Compiled>>,
    /// A network was opened, or came back.
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

    /// Wakes those who wait for a network.
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

    /// Opens a network whose room is reserved.
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

    /// A network, run once. None where a row of it is not, bit for bit, what it is alone: a CPU may
    /// have other instructions for larger products, and OpenVINO has bugs that show so too.
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

    /// What rows of the sample give alone.
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

    /// Opens what is asked for, until nobody can ask any more.
    fn open_wanted(&self, asked: &Receiver<(Key, Arc<Graph>)>, closing: &AtomicBool) {
        while let Ok((key, graph)) = asked.recv() {
            if closing.load(Ordering::Relaxed) {
                return;
            }
            // What closes is dropped without the lock.
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
