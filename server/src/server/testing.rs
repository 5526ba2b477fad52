//! The routes of a running server without its connections, for fuzz targets.

use std::sync::Arc;

use axum::Router;

use super::{ServerHandle, StartError};
use crate::api;
use crate::clients::Clients;
use crate::config::Config;

impl ServerHandle {
    /// All routes, as connections have them. `config` is the server's.
    ///
    /// # Errors
    /// [`StartError::Internal`] where they cannot be made.
    pub fn routes(&self, config: &Config) -> Result<Router, StartError> {
        let clients = Arc::new(Clients::new(config.shares(), self.service.telemetry()));
        api::router(
            &self.service,
            &self.health,
            &clients,
            &config.api_limits(),
            config.guard(self.address),
            self.access.credentials.clone(),
        )
        .map_err(|error| StartError::Internal(error.to_string()))
    }
}
