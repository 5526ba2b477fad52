//! The public interface: gRPC, HTTP and WebSocket on one port, one validation, one mapping of
//! errors.
//!
//! [`ApiError`] is the only place that knows how an error looks to a caller. Both fronts hand
//! requests to [`Service`], under one time limit and one set of metrics.

mod access;
mod answers;
mod credentials;
mod error;
mod grpc;
mod guard;
mod head;
mod http;
pub mod keys;
mod metrics;
mod mmcp;
mod observe;
mod openapi;
mod opening;
mod ours;
mod refusals;
mod reserve;
mod shape;
#[cfg(feature = "testing")]
pub mod testing;
mod tickets;
mod tokens;
mod track;
mod traffic;
mod verify;
mod ws;

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use axum::{Router, middleware};
use tonic_health::server::HealthReporter;

use crate::clients::Clients;
use crate::service::Service;

pub use crate::clients::Role;
pub use credentials::Credentials;
pub use error::{ApiError, ErrorBody, ErrorDetail};
pub use grpc::set_serving;
pub use guard::{Guard, Host, NotAHost, NotAnOrigin, Origin};
pub use http::document;
pub use keys::{Keys, KeysError};
pub use reserve::reserve;
pub use tokens::{TokenError, TokenRules, Tokens, TokensError};

/// Most bytes of one message on a stream.
const MAX_STREAM_MESSAGE_BYTES: usize = 2 << 20;

/// Limits of requests, whatever they ask for.
#[derive(Debug, Clone, Copy)]
pub struct ApiLimits {
    /// How long a caller waits for an answer.
    pub timeout: Duration,
    /// How long an answer waits for its reader.
    pub write_timeout: Duration,
    /// Most bytes of a request.
    pub message_bytes: usize,
    /// Most characters of an InBetween request.
    pub characters: usize,
    /// Most sessions of a request.
    pub sessions: usize,
}

/// All routes of the server: gRPC services, HTTP, documentation. `health` reports what
/// [`set_serving`] tells it, `guard` says which web pages may use them, and `credentials` who else;
/// without them, everybody.
///
/// # Errors
/// Where the descriptors of the gRPC reflection service do not read, which a build that passes its
/// tests rules out.
pub fn router(
    service: &Arc<Service>,
    health: &HealthReporter,
    clients: &Arc<Clients>,
    limits: &ApiLimits,
    guard: Guard,
    credentials: Option<Arc<Credentials>>,
    site: &Path,
) -> Result<Router, tonic_reflection::server::Error> {
    let grpc = grpc::router(service, health, limits)?;
    let traffic = traffic::Traffic::new(clients.clone(), limits.write_timeout, service.telemetry());
    let router = grpc
        .merge(http::router(service, limits, site))
        .fallback(http::unknown_route)
        .layer(middleware::from_fn_with_state(traffic, traffic::count));
    let router = match credentials {
        Some(credentials) => access::locked(router, credentials, clients.clone()),
        None => router,
    };
    Ok(observe::observed(
        mmcp::enveloped(head::limited(guard::guarded(router, guard))),
        service.telemetry(),
    ))
}
