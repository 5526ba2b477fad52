//! The public interface: gRPC, HTTP and WebSocket on one port, with one validation and one mapping
//! of errors.
//!
//! Only [`ApiError`] decides how an error looks to a caller. gRPC and HTTP pass requests to
//! [`Service`] with the same time limit and metrics.

mod answers;
mod early;
mod error;
mod front;
mod grpc;
mod http;
mod metrics;
mod mmcp;
mod openapi;
mod opening;
mod ours;
mod roles;
mod shape;
#[cfg(feature = "testing")]
pub mod testing;
mod track;
mod ws;

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use tonic_health::server::HealthReporter;

use front::FRONT;
use troupe_edge::clients::Clients;
use troupe_edge::credentials::Credentials;
use troupe_edge::guard::{self, Guard};
use troupe_edge::port::Routes;
use troupe_edge::{access, head, observe, reserve, traffic};
use troupe_service::Service;

pub use error::{ApiError, ErrorBody, ErrorDetail};
pub use grpc::set_serving;
pub use http::document;

/// Size limit of one message on a stream, bytes.
const MAX_STREAM_MESSAGE_BYTES: usize = 2 << 20;

/// Limits that apply to all requests.
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

/// The routes of a listener for health checks: `/healthz`, `/readyz` and gRPC's health service.
/// They need no key. `guard` is that of the listener's address.
pub fn health_routes(service: &Arc<Service>, health: &HealthReporter, guard: Guard) -> Router {
    let router = grpc::health(health).merge(http::health(service));
    let router = router.fallback(http::unknown_route);
    let guarded = head::limited(guard::guarded(router, FRONT, guard), FRONT);
    observe::observed(guarded, FRONT, service.telemetry())
}

/// All routes of the server: gRPC services, HTTP, documentation. `health` reports the state that
/// [`set_serving`] sets. `guard` limits which web pages may use the routes, and `credentials` which
/// callers; without credentials every caller may. The router also has the routes for connections
/// beyond the limit.
///
/// # Errors
/// If the descriptors of the gRPC reflection service cannot be read. Tests rule this out for a
/// build.
pub fn routes(
    service: &Arc<Service>,
    health: &HealthReporter,
    clients: &Arc<Clients>,
    limits: &ApiLimits,
    guard: Guard,
    credentials: Option<Arc<Credentials>>,
    site: &Path,
) -> Result<Routes, tonic_reflection::server::Error> {
    let grpc = grpc::router(service, health, limits)?;
    let router = grpc
        .merge(http::router(service, limits, site))
        .fallback(http::unknown_route);
    let telemetry = service.telemetry();
    let router = traffic::counted(router, FRONT, clients.clone(), limits.write_timeout, telemetry);
    let router = match credentials {
        Some(credentials) => access::locked(router, FRONT, credentials, clients.clone()),
        None => router,
    };
    let guarded = head::limited(guard::guarded(router, FRONT, guard), FRONT);
    let all = observe::observed(mmcp::enveloped(guarded), FRONT, telemetry);
    Ok(Routes {
        early: Some(early::refusals(service)),
        reserve: mmcp::enveloped(reserve::reserve(all.clone(), FRONT)),
        all,
    })
}
