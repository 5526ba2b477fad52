//! Counts requests that the edge refuses, by reason, and logs each reason at most once a minute.

use std::net::IpAddr;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use super::EdgeError;
use troupe_base::telemetry::{Counter, Labels, Metric, Seldom, Telemetry};

const REFUSALS: Metric = Metric::new(
    "troupe_refusals_total",
    "Requests refused before they were served, by reason: a foreign Origin (origin) or Host (host), no \
     key (key_missing), an unknown key (key_unknown), too low a role (role), too large headers (headers), \
     or an invalid token or ticket (other)",
);

/// Why a request is refused, as a metric's label.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RequestRefusal {
    /// A web page of another site.
    Origin,
    /// A name that is not the server's.
    Host,
    /// No key.
    KeyMissing,
    /// A key that the server does not know.
    KeyUnknown,
    /// A key whose role does not allow the call.
    Role,
    /// Too large headers.
    Headers,
    /// An invalid token or ticket.
    Other,
}

impl RequestRefusal {
    /// In the order of the discriminants.
    const ALL: [Self; 7] = [
        Self::Origin,
        Self::Host,
        Self::KeyMissing,
        Self::KeyUnknown,
        Self::Role,
        Self::Headers,
        Self::Other,
    ];

    fn label(self) -> &'static str {
        match self {
            Self::Origin => "origin",
            Self::Host => "host",
            Self::KeyMissing => "key_missing",
            Self::KeyUnknown => "key_unknown",
            Self::Role => "role",
            Self::Headers => "headers",
            Self::Other => "other",
        }
    }

    /// The reason of an error; none for limits, which other metrics count.
    pub(super) fn of(error: &EdgeError) -> Option<Self> {
        match error {
            EdgeError::NotAllowed { header: "Origin", .. } => Some(Self::Origin),
            EdgeError::NotAllowed { .. } => Some(Self::Host),
            EdgeError::NoKey => Some(Self::KeyMissing),
            EdgeError::UnknownKey | EdgeError::KeyRemoved => Some(Self::KeyUnknown),
            EdgeError::RoleTooLow { .. } | EdgeError::OfTenant { .. } => Some(Self::Role),
            EdgeError::HeadersTooLarge { .. } => Some(Self::Headers),
            EdgeError::Token(_) | EdgeError::TokenExpired | EdgeError::UnknownTicket => Some(Self::Other),
            EdgeError::Exhausted(_)
            | EdgeError::TooManyTickets { .. }
            | EdgeError::NoTickets
            | EdgeError::NoConnection => None,
        }
    }
}

/// The counters of refused requests. Clones share them.
#[derive(Debug, Clone)]
pub(super) struct Refusals(Arc<[(Counter, Mutex<Seldom>); RequestRefusal::ALL.len()]>);

impl Refusals {
    pub(super) fn new(telemetry: &Telemetry) -> Self {
        Self(Arc::new(RequestRefusal::ALL.map(|refusal| {
            let labels = Labels::default().with("reason", refusal.label());
            (telemetry.counter(&REFUSALS, &labels), Mutex::default())
        })))
    }

    /// Counts and logs a refused request of a client at `address`.
    pub(super) fn note(&self, refusal: RequestRefusal, address: Option<IpAddr>) {
        let (counter, seldom) = &self.0[refusal as usize];
        counter.increment(1);
        let next = seldom
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .next(Instant::now());
        if let Some(held_back) = next {
            let address = address.map(tracing::field::display);
            tracing::warn!(
                reason = refusal.label(),
                address,
                held_back,
                "a request is refused"
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refusals_are_counted_by_reason() {
        let telemetry = Telemetry::new().unwrap();
        let refusals = Refusals::new(&telemetry);
        for refusal in RequestRefusal::ALL {
            refusals.note(refusal, None);
            refusals.note(refusal, Some(IpAddr::from([192, 0, 2, 1])));
        }
        let text = telemetry.render();
        for refusal in RequestRefusal::ALL {
            let line = format!("troupe_refusals_total{{reason=\"{}\"}} 2", refusal.label());
            assert!(text.contains(&line), "{line} is missing in\n{text}");
        }
    }

    #[test]
    fn limits_are_not_counted_as_refusals() {
        assert_eq!(
            RequestRefusal::of(&EdgeError::NoKey),
            Some(RequestRefusal::KeyMissing)
        );
        assert_eq!(RequestRefusal::of(&EdgeError::NoConnection), None);
        assert_eq!(RequestRefusal::of(&EdgeError::NoTickets), None);
    }
}
