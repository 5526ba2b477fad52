//! Who calls, and what its key gives it a right to.

use std::sync::Arc;

use troupe_base::tenant::Tenant;

/// What a caller may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Read metrics, and nothing else.
    Metrics,
    /// Ask for motion, drive sessions, and read all else but metrics.
    Drive,
    /// Also write styles, scenes and object definitions.
    Author,
    /// Also read metrics.
    Admin,
}

impl Role {
    /// Its name in files and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Metrics => "metrics",
            Self::Drive => "drive",
            Self::Author => "author",
            Self::Admin => "admin",
        }
    }

    /// Whether it may do what needs the role `needed`.
    pub fn may(self, needed: Self) -> bool {
        match needed {
            Self::Metrics => matches!(self, Self::Metrics | Self::Admin),
            needed => self >= needed,
        }
    }

    /// The roles that may do what needs this one, for messages.
    pub fn and_above(self) -> &'static str {
        match self {
            Self::Metrics => "metrics or admin",
            Self::Drive => "drive, author or admin",
            Self::Author => "author or admin",
            Self::Admin => "admin",
        }
    }
}

/// Who calls. Requests carry it as an extension where the server asks for keys; without keys nobody
/// is known.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Identity {
    /// The key's name, or the subject of the token.
    pub name: Arc<str>,
    /// What it may do.
    pub role: Role,
    /// Whose it is, where that is said.
    pub tenant: Tenant,
}

/// What one key may have at a time. What is not said is as for every client.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Quota {
    /// Sessions that it opened and that are still open.
    pub sessions: Option<usize>,
    /// Streams.
    pub streams: Option<usize>,
    /// Bytes of requests and answers on their way.
    pub bytes: Option<usize>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_role_may_what_those_before_it_may_but_metrics_is_apart() {
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
