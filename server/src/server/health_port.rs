//! The second port, which only answers health checks.

use std::net::SocketAddr;
use std::sync::Arc;

use tokio::net::TcpListener;
use tokio::sync::watch;
use tokio::task::JoinHandle;
use tonic_health::server::HealthReporter;

use super::StartError;
use crate::api;
use crate::config::Config;
use troupe_base::telemetry::Telemetry;
use troupe_edge::clients::Clients;
use troupe_edge::port::{ConnectionSlots, Listen as _, Port, Routes};
use troupe_service::Service;

/// Connections of the port: several checkers, each with a few connections.
const CONNECTIONS: usize = 64;

/// The open port.
pub(super) struct HealthPort {
    pub(super) address: SocketAddr,
    /// Ends when the server stops.
    pub(super) connections: JoinHandle<bool>,
}

/// Opens the port.
///
/// # Errors
/// [`StartError::HealthListen`] if the address cannot be used.
pub(super) async fn open(
    address: SocketAddr,
    config: &Config,
    service: &Arc<Service>,
    health: &HealthReporter,
    stopping: watch::Receiver<bool>,
) -> Result<HealthPort, StartError> {
    let cannot = |error| StartError::HealthListen { address, error };
    let listener = TcpListener::bind(address).await.map_err(cannot)?;
    let address = listener.local_addr().map_err(cannot)?;
    let router = api::health_routes(service, health, config.guard(address));
    let telemetry: &Telemetry = service.telemetry();
    let slots = ConnectionSlots::new(CONNECTIONS, CONNECTIONS, config.fixed.spare_idle, telemetry);
    let connections = listener.spawn(Port {
        routes: Routes {
            all: router.clone(),
            reserve: router,
            early: None,
        },
        clients: Arc::new(Clients::new(config.shares(), telemetry)),
        tls: None,
        limits: config.connection_limits(),
        slots,
        stopping,
    });
    Ok(HealthPort { address, connections })
}
