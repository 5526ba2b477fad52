//! The metrics of clients and of their refusals.

use std::net::IpAddr;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use super::Whose;
use troupe_base::telemetry::{Counter, Gauge, Labels, Metric, Seldom, Telemetry};

const TRANSFER: Metric = Metric::new(
    "troupe_transfer_memory_bytes",
    "Memory of requests and answers in transfer",
);
const REFUSED: Metric = Metric::new(
    "troupe_client_refusals_total",
    "Requests of clients that were refused at a limit, by kind (memory, streams, sessions) and by owner \
     of the limit (client, key, address, all)",
);

const RESETS: Metric = Metric::new(
    "troupe_reset_floods_total",
    "Connections that were cut because their clients cancelled too many calls",
);

/// The metrics of all clients.
#[derive(Debug)]
pub(super) struct ClientMetrics {
    pub(super) transfer: Gauge,
    /// By owner of the limit, in the order of [`Whose::EACH`].
    pub(super) memory_refused: [Counter; 4],
    pub(super) streams_refused: [Counter; 4],
    pub(super) sessions_refused: [Counter; 4],
    reset_floods: Counter,
    refusals: Mutex<Seldom>,
}

impl ClientMetrics {
    pub(super) fn new(telemetry: &Telemetry) -> Self {
        let refused = |kind: &'static str| {
            Whose::EACH.map(|whose| {
                let labels = Labels::default().with("kind", kind).with("whose", whose.label());
                telemetry.counter(&REFUSED, &labels)
            })
        };
        Self {
            transfer: telemetry.gauge(&TRANSFER, &Labels::default()),
            memory_refused: refused("memory"),
            streams_refused: refused("streams"),
            sessions_refused: refused("sessions"),
            reset_floods: telemetry.counter(&RESETS, &Labels::default()),
            refusals: Mutex::default(),
        }
    }

    /// Counts and logs a connection from `address` that only cancels calls.
    pub(super) fn reset(&self, address: IpAddr) {
        self.reset_floods.increment(1);
        let next = self.seldom().next(Instant::now());
        if let Some(held_back) = next {
            tracing::warn!(%address, held_back, "a connection is cut: its client cancels too many calls");
        }
    }

    fn seldom(&self) -> MutexGuard<'_, Seldom> {
        self.refusals.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts and logs a refusal of a client at `address`.
    pub(super) fn refused(&self, by_whose: &[Counter; 4], whose: Whose, kind: &'static str, address: IpAddr) {
        by_whose[whose as usize].increment(1);
        let next = self.seldom().next(Instant::now());
        if let Some(held_back) = next {
            let whose = whose.label();
            tracing::warn!(kind, whose, %address, held_back, "a limit of clients is reached");
        }
    }
}
