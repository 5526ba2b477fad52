//! The identity of a caller: its role, tenant and quota.

use std::sync::Arc;

use crate::error::METRICS_KEYS;
use troupe_base::tenant::Tenant;

/// The calls that a caller may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Reads metrics and nothing else.
    Metrics,
    /// Generates motion, drives sessions, and reads everything but metrics.
    Drive,
    /// As `Drive`, and writes styles, scenes and object definitions.
    Author,
    /// As `Author`, reads metrics, and loads, unloads and swaps packs.
    Admin,
}

impl Role {
    /// The role's name in files and messages, lower case.
    pub fn name(self) -> &'static str {
        match self {
            Self::Metrics => "metrics",
            Self::Drive => "drive",
            Self::Author => "author",
            Self::Admin => "admin",
        }
    }

    /// Whether the role allows a call that needs `needed`.
    pub fn may(self, needed: Self) -> bool {
        match needed {
            Self::Metrics => matches!(self, Self::Metrics | Self::Admin),
            needed => self >= needed,
        }
    }

    /// The keys that allow a call about all tenants, for messages.
    pub fn of_all(self) -> &'static str {
        match self {
            Self::Metrics => METRICS_KEYS,
            _ => "a key of the role admin without a tenant",
        }
    }

    /// The roles that allow a call which needs this one, for messages.
    pub fn and_above(self) -> &'static str {
        match self {
            Self::Metrics => "metrics or admin",
            Self::Drive => "drive, author or admin",
            Self::Author => "author or admin",
            Self::Admin => "admin",
        }
    }
}

/// A caller. If the server asks for keys, each request carries it as an extension. Without keys,
/// callers have no identity.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Identity {
    /// The key's name, or the subject of the token.
    pub name: Arc<str>,
    /// Decides which calls the caller may use.
    pub role: Role,
    /// None if the key or token names no tenant.
    pub tenant: Tenant,
}

/// Which sessions of a caller are recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Recorded {
    /// None. It may not ask for it.
    Never,
    /// Those for which it asks.
    Asked,
    /// All that can be recorded.
    Always,
}

/// Limits of one key. A missing one is as for every client.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Quota {
    /// Most open sessions that the key has opened.
    pub sessions: Option<usize>,
    /// Most open streams.
    pub streams: Option<usize>,
    /// Most bytes of requests and answers in transfer.
    pub bytes: Option<usize>,
    /// Number of clients that the key counts as in the queues of packs; missing: 1.
    pub share: Option<u32>,
    /// Which sessions of the key are recorded; missing: never.
    pub recorded: Option<Recorded>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_role_includes_lower_roles_but_metrics_is_separate() {
        use Role::{Admin, Author, Drive, Metrics};
        for (role, may) in [
            (Metrics, vec![Metrics]),
            (Drive, vec![Drive]),
            (Author, vec![Drive, Author]),
            (Admin, vec![Metrics, Drive, Author, Admin]),
        ] {
            for needed in [Metrics, Drive, Author, Admin] {
                assert_eq!(role.may(needed), may.contains(&needed), "{role:?} {needed:?}");
                let said = needed.and_above().contains(role.name());
                assert_eq!(role.may(needed), said, "{role:?} {needed:?}");
            }
        }
    }
}
