//! The sessions of a tenant, and what the sessions of all tenants share.

use std::sync::Arc;

use tokio::sync::{Semaphore, watch};
use troupe_proto::v1;

use super::results::CommandResult;
use super::{Executor, Registry, SessionLimits, TimeSource, commands, metrics};
use troupe_base::telemetry::{Gauge, Telemetry};
use troupe_base::tenant::Tenant;
use troupe_base::turns::Turns;

/// The sessions of one tenant, and how all of them run.
#[derive(Debug)]
pub struct Sessions {
    registry: Arc<Registry>,
    common: Arc<Common>,
}

/// What the sessions of all tenants share.
#[derive(Debug)]
struct Common {
    limits: SessionLimits,
    time: TimeSource,
    streams: Gauge,
    places: Arc<Semaphore>,
    draining: watch::Sender<bool>,
    executor: Executor,
}

impl Sessions {
    /// A server's sessions: none yet, of callers without a tenant. `executor` runs their
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
            }),
        }
    }

    /// Those of another tenant. Limits, threads and the end are the same.
    pub fn of_tenant(&self, tenant: Tenant) -> Self {
        Self {
            registry: Arc::new(self.registry.of_tenant(tenant)),
            common: self.common.clone(),
        }
    }

    /// The limits.
    pub fn limits(&self) -> &SessionLimits {
        &self.common.limits
    }

    /// Open sessions of all tenants.
    pub fn open(&self) -> usize {
        self.registry.len()
    }

    /// Ends sessions of all tenants whose time is up; answers how many. To be called now and then.
    pub fn sweep(&self) -> usize {
        self.registry.sweep(self.common.time.now())
    }

    /// Places for streams, as many as there may be.
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
        // The semaphore is never closed; were it, there would be no stream either.
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

    /// Notes how many streams are open, `leaving` of which are about to go.
    pub(super) fn streams_changed(&self, leaving: usize) {
        let free = self.common.places.available_permits() + leaving;
        self.common
            .streams
            .set(self.common.limits.streams.saturating_sub(free) as f64);
    }

    pub(super) async fn apply(&self, commands: &[v1::Command]) -> Vec<CommandResult> {
        commands::apply(&self.registry, &self.common.time, commands).await
    }

    /// Runs a stream, or what else advances characters, on the threads for that, in the turns of
    /// its client.
    pub fn spawn(&self, turns: Turns, work: impl Future<Output = ()> + Send + 'static) {
        self.common.executor.spawn(turns, work);
    }
}
