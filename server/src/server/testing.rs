//! A server on one thread, and its routes without connections, for fuzz targets.

use std::sync::Arc;

use axum::Router;
use tokio::net::TcpListener;

use super::{Around, PackSource, ServerHandle, StartError, keeping, serve_on};
use crate::api;
use crate::config::Config;
use troupe_edge::clients::Clients;
use troupe_live::session::{Executor, TimeSource};

/// [`super::serve_packs`] with characters on the calling thread.
///
/// # Errors
/// [`StartError`] if the server cannot be set up.
pub async fn serve_here(
    config: Config,
    listener: TcpListener,
    packs: impl FnOnce() -> Result<Vec<PackSource>, StartError> + Send + 'static,
) -> Result<ServerHandle, StartError> {
    let address = listener.local_addr().map_err(StartError::Listen)?;
    let around = Around {
        time: TimeSource::default(),
        executor: Executor::here(),
        records: keeping::records_of(&config, address),
    };
    serve_on(config, listener, address, around, packs).await
}

impl ServerHandle {
    /// All routes of the server, as connections get them. `config` is the server's configuration.
    ///
    /// # Errors
    /// [`StartError::Internal`] if the routes cannot be made.
    pub fn routes(&self, config: &Config) -> Result<Router, StartError> {
        let clients = Arc::new(Clients::new(config.shares(), self.service.telemetry()));
        let routes = api::routes(
            &self.service,
            &self.health,
            &clients,
            &config.api_limits(),
            config.guard(self.address),
            self.access.credentials.clone(),
            &config.docs,
        )
        .map_err(|error| StartError::Internal(error.to_string()))?;
        Ok(routes.all)
    }
}
