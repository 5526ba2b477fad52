//! The handle of a running server: its readiness, and its stop.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::{Notify, watch};
use tokio::task::JoinHandle;
use tonic_health::server::HealthReporter;
use troupe_proto::v1::{motion_server, scenes_server, sessions_server};

use super::access::Access;
use super::health_port::HealthPort;
use super::keeping::Keeping;
use super::{FAREWELL, StartError};
use crate::api;
use troupe_service::Service;

/// How a server stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stopped {
    /// All requests were answered, and all streams ended.
    Clean,
    /// Some requests or streams were cut when their time was over.
    Lost,
    /// The store could not take the last changes of sessions. Requests may be cut, too.
    Unkept,
    /// A second signal ended the wait for requests and streams.
    Forced,
}

/// A running server. Dropping the handle does not stop it.
pub struct ServerHandle {
    pub(super) address: SocketAddr,
    pub(super) service: Arc<Service>,
    pub(super) health: HealthReporter,
    pub(super) stop: watch::Sender<bool>,
    pub(super) starting: Option<JoinHandle<Result<Option<Keeping>, StartError>>>,
    pub(super) keeping: Option<Keeping>,
    pub(super) connections: JoinHandle<bool>,
    pub(super) health_port: Option<HealthPort>,
    pub(super) upkeep: JoinHandle<()>,
    /// Watches the packs.
    pub(super) watching: Option<JoinHandle<()>>,
    pub(super) reloading: JoinHandle<()>,
    pub(super) reload: Arc<Notify>,
    pub(super) reloads: bool,
    pub(super) secure: bool,
    pub(super) access: Access,
    pub(super) drain_delay: Duration,
    pub(super) drain_timeout: Duration,
    pub(super) last_step: Duration,
}

impl ServerHandle {
    /// The address that the server listens on.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The address of the second port, which only answers health checks.
    pub fn health_address(&self) -> Option<SocketAddr> {
        self.health_port.as_ref().map(|port| port.address)
    }

    /// Whether calls need a key.
    pub fn asks_for_keys(&self) -> bool {
        self.access.credentials.is_some()
    }

    /// Whether the port speaks TLS.
    pub fn speaks_tls(&self) -> bool {
        self.secure
    }

    /// Whether the server reads certificates or keys again when their files change.
    pub fn reloads(&self) -> bool {
        self.reloads
    }

    /// Reads certificates and keys again now. Errors go to the log.
    pub fn reload(&self) {
        self.reload.notify_one();
    }

    /// The key that the server made for this run. None: it made none.
    pub fn one_time_key(&self) -> Option<&str> {
        self.access.one_time.as_deref()
    }

    /// The service, with packs, metrics and readiness.
    pub fn service(&self) -> &Arc<Service> {
        &self.service
    }

    /// Waits until all packs are loaded and warm.
    ///
    /// # Errors
    /// [`StartError`] if a pack cannot be loaded. The server is then of no use.
    pub async fn ready(&mut self) -> Result<(), StartError> {
        match self.starting.as_mut() {
            Some(starting) => {
                let result = starting.await;
                self.starting = None;
                self.keeping = result.map_err(|error| StartError::Internal(error.to_string()))??;
                Ok(())
            }
            None => Ok(()),
        }
    }

    /// Reports that the server is not ready, and keeps serving for the configured delay. Then stops
    /// accepting connections, gives requests the configured time to finish, cuts the rest, and ends
    /// the workers. Returns whether everything finished.
    pub async fn shut_down(self) -> bool {
        self.shut_down_unless(std::future::pending()).await == Stopped::Clean
    }

    /// [`shut_down`](Self::shut_down), which gives up when `again` completes. Even then it waits
    /// for the running steps of the workers.
    pub async fn shut_down_unless(self, again: impl Future<Output = ()>) -> Stopped {
        let (service, last_step) = (self.service.clone(), self.last_step);
        let stopped = tokio::select! {
            biased;
            stopped = self.stop() => stopped,
            () = again => Stopped::Forced,
        };
        // The process must not unload the networks' library while a network runs.
        let deadline = std::time::Instant::now() + last_step;
        let ended = tokio::task::spawn_blocking(move || service.end_workers(deadline)).await;
        if !matches!(ended, Ok(true)) {
            tracing::warn!("a worker has not ended its last step within {last_step:?}");
        }
        stopped
    }

    async fn stop(mut self) -> Stopped {
        self.service.announce_stop();
        if let Some(starting) = self.starting.take() {
            starting.abort();
            // The start must end first: it would report that the server serves.
            if let Ok(Ok(keeping)) = starting.await {
                self.keeping = keeping;
            }
        }
        api::set_serving(&self.health, false).await;
        tokio::time::sleep(self.drain_delay).await;
        let deadline = tokio::time::Instant::now() + self.drain_timeout + FAREWELL;
        self.service.drain();
        // Ends the streams of health watchers after they have the status: open streams would delay
        // the stop.
        for service in [
            "",
            motion_server::SERVICE_NAME,
            sessions_server::SERVICE_NAME,
            scenes_server::SERVICE_NAME,
        ] {
            self.health.clear_service_status(service).await;
        }
        let _ = self.stop.send(true);
        let clean = match self.connections.await {
            Ok(clean) => clean,
            Err(error) => {
                tracing::error!(%error, "the accept loop failed");
                false
            }
        };
        if let Some(port) = self.health_port {
            // Half a health check is no loss.
            let _ = port.connections.await;
        }
        self.upkeep.abort();
        self.reloading.abort();
        if let Some(watching) = &self.watching {
            watching.abort();
        }
        // Connections that became WebSockets are not among those above.
        let streams = tokio::time::timeout_at(deadline, self.service.sessions().streams_ended());
        let ended = streams.await.is_ok();
        let is_kept = match self.keeping {
            Some(keeping) => keeping.finish(self.drain_timeout).await,
            None => true,
        };
        if let Some(traces) = self.service.telemetry().traces().cloned() {
            // The exporter reports its own errors.
            let _ = tokio::task::spawn_blocking(move || traces.shut_down()).await;
        }
        match (is_kept, clean && ended) {
            (false, _) => Stopped::Unkept,
            (true, true) => Stopped::Clean,
            (true, false) => Stopped::Lost,
        }
    }
}
