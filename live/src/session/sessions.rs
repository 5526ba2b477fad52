//! The sessions of a tenant, and the limits and threads that all tenants share.

use std::sync::{Arc, OnceLock};

use tokio::sync::{Semaphore, watch};
use troupe_proto::v1;

use super::cell::ClientPlace;
use super::recording::{MAX_REPLAYS, Shelf};
use super::results::CommandResult;
use super::share::Sharing;
use super::{Executor, Registry, SessionLimits, TimeSource, commands, metrics};
use troupe_base::telemetry::{Gauge, Telemetry};
use troupe_base::tenant::Tenant;
use troupe_base::turns::Turns;

/// The sessions of one tenant, with the limits and threads that all tenants share.
#[derive(Debug)]
pub struct Sessions {
    registry: Arc<Registry>,
    common: Arc<Common>,
}

/// Shared by the sessions of all tenants.
#[derive(Debug)]
struct Common {
    limits: SessionLimits,
    time: TimeSource,
    streams: Gauge,
    places: Arc<Semaphore>,
    draining: watch::Sender<bool>,
    executor: Executor,
    /// Empty unless other servers share the store.
    sharing: OnceLock<Arc<Sharing>>,
    shelf: Shelf,
    /// One permit for each recording that may be played.
    replays: Arc<Semaphore>,
}

impl Sessions {
    /// Makes the sessions of callers without a tenant. None is open yet. `executor` runs their
    /// characters.
    pub fn new(limits: SessionLimits, time: TimeSource, executor: Executor, telemetry: &Telemetry) -> Self {
        Self {
            registry: Arc::new(Registry::new(limits.sessions)),
            common: Arc::new(Common {
                limits,
                time,
                streams: metrics::streams(telemetry),
                places: Arc::new(Semaphore::new(limits.streams)),
                draining: watch::Sender::new(false),
                executor,
                sharing: OnceLock::new(),
                shelf: Shelf::default(),
                replays: Arc::new(Semaphore::new(MAX_REPLAYS)),
            }),
        }
    }

    /// The sessions of another tenant. They share limits, threads and shutdown with these.
    pub fn of_tenant(&self, tenant: Tenant) -> Self {
        Self {
            registry: Arc::new(self.registry.of_tenant(tenant)),
            common: self.common.clone(),
        }
    }

    /// Limits of the sessions and streams of all tenants together.
    pub fn limits(&self) -> &SessionLimits {
        &self.common.limits
    }

    /// Number of open sessions of all tenants.
    pub fn open(&self) -> usize {
        self.registry.len()
    }

    /// Ends expired sessions of all tenants and returns their number. Call it regularly.
    pub fn sweep(&self) -> usize {
        let now = self.common.time.now();
        if let Some(sharing) = self.sharing() {
            sharing.free_absent(now);
        }
        self.shelf().sweep(now);
        self.registry.sweep(now)
    }

    /// How sessions are shared with other servers. `None`: they are not.
    pub(super) fn sharing(&self) -> Option<&Arc<Sharing>> {
        self.common.sharing.get()
    }

    /// From now on, sessions of all tenants are shared with other servers. Only the first call
    /// counts.
    pub(super) fn set_sharing(&self, sharing: Sharing) {
        self.common.sharing.get_or_init(|| Arc::new(sharing));
    }

    /// Whether the server shuts down.
    pub(super) fn is_draining(&self) -> bool {
        *self.common.draining.borrow()
    }

    /// The recordings of all tenants.
    pub(super) fn shelf(&self) -> &Shelf {
        &self.common.shelf
    }

    /// One permit for each recording that may be played.
    pub(super) fn replays(&self) -> &Arc<Semaphore> {
        &self.common.replays
    }

    /// One permit for each stream that may be open.
    pub(super) fn places(&self) -> &Arc<Semaphore> {
        &self.common.places
    }

    /// Ends all streams, and takes no new ones.
    pub fn drain(&self) {
        self.common.draining.send_replace(true);
    }

    /// Waits until no stream is open.
    pub async fn streams_ended(&self) {
        let all = self.common.limits.streams as u32;
        // The only error is a closed semaphore, and this one is never closed.
        let _ = self.common.places.acquire_many(all).await;
    }

    pub(super) fn registry(&self) -> &Arc<Registry> {
        &self.registry
    }

    pub(super) fn time(&self) -> &TimeSource {
        &self.common.time
    }

    pub(super) fn executor(&self) -> &Executor {
        &self.common.executor
    }

    pub(super) fn draining(&self) -> watch::Receiver<bool> {
        self.common.draining.subscribe()
    }

    /// Updates the metric of open streams. `leaving` streams are about to end and do not count.
    pub(super) fn streams_changed(&self, leaving: usize) {
        let free = self.common.places.available_permits() + leaving;
        self.common
            .streams
            .set(self.common.limits.streams.saturating_sub(free) as f64);
    }

    /// Has an open session keep `place` until it ends. Without such a session the place is free at
    /// once.
    pub fn hold(&self, id: &str, place: ClientPlace) {
        self.registry.hold(id, place);
    }

    pub(super) async fn apply(&self, commands: &[v1::Command]) -> Vec<CommandResult> {
        commands::apply(&self.registry, &self.common.time, commands).await
    }

    /// Runs a stream or other work that advances characters. It runs on the threads for characters,
    /// in the turns of its client.
    pub fn spawn(&self, turns: Turns, work: impl Future<Output = ()> + Send + 'static) {
        self.common.executor.spawn(turns, work);
    }
}
