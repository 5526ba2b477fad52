//! The open networks of fixed shapes, for all workers and packs.
//!
//! A network is made for one stage, one length and one number of rows. Workers borrow one for a
//! call. A missing network opens in the background, while calls run in open ones. Its row's bits
//! are the same in every number of rows, so the choice makes no difference. If another worker has a
//! network, it is opened a second time.
//!
//! All of them together stay within a budget. A network that was not used recently closes for one
//! that is needed. Of every length, one network stays open.

mod graph;
mod opener;
mod state;

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Instant;

use super::calls::{CALL_ROWS, Calls};
use super::openvino::Compiled;
use super::{Growth, Runtime};
use crate::EngineError;
use crate::machine::available_cores;
use crate::pack::Pack;

pub(super) use graph::{Graph, PackNetworks, PackWorker, least_bytes};
use opener::{Networks, Opener};
use state::Key;

/// A pack's networks, once the first worker has opened them.
type Opened = OnceLock<Result<Arc<PackNetworks>, EngineError>>;

/// By folder, content and number of threads. A folder may get other networks while those that were
/// there still run.
type Packs = HashMap<(PathBuf, String, usize), Arc<Opened>>;

/// Open networks. Clones share one pool. The thread that opens networks ends with the last clone.
#[derive(Clone)]
pub struct NetworkPool {
    networks: Arc<Networks>,
    packs: Arc<Mutex<Packs>>,
    opener: Arc<Opener>,
}

impl NetworkPool {
    /// A pool that keeps networks within `budget_bytes`, apart from the indispensable ones.
    pub fn new(budget_bytes: u64) -> Self {
        let networks = Arc::new(Networks::new(budget_bytes));
        Self {
            opener: Arc::new(Opener::start(networks.clone())),
            packs: Arc::default(),
            networks,
        }
    }

    /// The budget in bytes.
    pub fn budget_bytes(&self) -> u64 {
        self.networks.budget_bytes
    }

    /// The graphs of a pack, with one network of every length open. The first caller reads and
    /// opens them. `look` checks them, and returns whether they accept segments of any length.
    pub(super) fn pack(
        &self,
        runtime: &Runtime,
        pack: &Pack,
        threads: usize,
        look: impl FnOnce() -> Result<bool, EngineError>,
    ) -> Result<Arc<PackNetworks>, EngineError> {
        let entry = {
            let mut packs = self.packs.lock().unwrap_or_else(PoisonError::into_inner);
            let content = pack.manifest.content_hash.clone();
            let key = (pack.folder.clone(), content, threads);
            packs.entry(key).or_default().clone()
        };
        let open = || {
            let networks = PackNetworks::read(runtime, pack, threads, look()?)?;
            self.open_least(&networks)?;
            Ok(Arc::new(networks))
        };
        entry.get_or_init(open).clone()
    }

    fn open_least(&self, networks: &PackNetworks) -> Result<(), EngineError> {
        let (least, next) = (networks.least(), AtomicUsize::new(0));
        let open_some = || {
            while let Some((graph, length)) = least.get(next.fetch_add(1, Ordering::Relaxed)) {
                self.networks.open_least(graph, *length)?;
            }
            Ok(())
        };
        std::thread::scope(|scope| {
            let threads: Vec<_> = (0..available_cores().min(least.len()))
                .map(|_| scope.spawn(open_some))
                .collect();
            let mut results = threads.into_iter().map(|thread| thread.join());
            results.try_for_each(|result| result.unwrap_or(Err(EngineError::Stopped)))
        })
    }

    /// Closes a pack's networks, which no worker runs any more.
    pub fn forget(&self, pack: &Pack) {
        let mut packs = self.packs.lock().unwrap_or_else(PoisonError::into_inner);
        let content = &pack.manifest.content_hash;
        let removed: Vec<_> = packs
            .extract_if(|(folder, found, _), _| *folder == pack.folder && *found == *content)
            .collect();
        drop(packs);
        let networks = removed.iter().filter_map(|(_, entry)| entry.get()?.as_ref().ok());
        let graphs = networks.flat_map(|networks| networks.graphs());
        // Dropped without the lock, because that takes time.
        let closed: Vec<_> = {
            let mut state = self.networks.lock();
            graphs.flat_map(|graph| state.forget(graph.id)).collect()
        };
        drop(closed);
    }

    /// Borrows a network of this length for a call with `rows` remaining rows, and memory for
    /// `room` rows.
    pub(super) fn borrow(
        &self,
        graph: &Arc<Graph>,
        length: usize,
        (rows, room): (usize, usize),
        growth: Growth,
    ) -> Result<Borrowed, EngineError> {
        let networks = &self.networks;
        let key = |rows| Key {
            graph: graph.id,
            length,
            rows,
        };
        let mut state = networks.lock();
        loop {
            let best = key(state.of_length(key(1)).calls.next(rows, room));
            if let Some(network) = state.take(best, Instant::now()) {
                return Ok(self.borrowed(best, network));
            }
            match growth {
                Growth::AtOnce if state.may_open(best, graph.workers()) => {
                    drop(state);
                    networks.open(graph, best)?;
                    state = networks.lock();
                    continue;
                }
                Growth::Background if state.miss(best, graph.workers(), Instant::now()) => {
                    self.opener.ask(best, graph);
                }
                Growth::AtOnce | Growth::Background | Growth::None => {}
            }
            let idle = CALL_ROWS.into_iter().filter(|&rows| state.is_idle(key(rows)));
            if let Some(other) = Calls::of(idle).fallback(rows, room).map(key)
                && let Some(network) = state.take(other, Instant::now())
            {
                return Ok(self.borrowed(other, network));
            }
            if state.of_length(best).open > 0 {
                state = networks.wait(state);
            } else {
                drop(state);
                networks.open_least(graph, length)?;
                state = networks.lock();
            }
        }
    }

    fn borrowed(&self, key: Key, network: Compiled) -> Borrowed {
        Borrowed {
            networks: self.networks.clone(),
            key,
            network: Some(network),
        }
    }
}

/// A network in which a worker runs a call. Dropping it gives it back.
pub(super) struct Borrowed {
    networks: Arc<Networks>,
    key: Key,
    network: Option<Compiled>,
}

impl Borrowed {
    pub(super) fn rows(&self) -> usize {
        self.key.rows
    }

    pub(super) fn network(&mut self) -> Result<&mut Compiled, EngineError> {
        self.network.as_mut().ok_or(EngineError::Stopped)
    }
}

impl Drop for Borrowed {
    fn drop(&mut self) {
        if let Some(network) = self.network.take() {
            self.networks.give_back(self.key, network);
        }
    }
}
