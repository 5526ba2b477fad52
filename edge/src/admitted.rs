//! Callers with a valid key, token or ticket.

use std::sync::Arc;

use super::clients::{Identity, Quota};

/// A caller with a valid key, token or ticket.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Admitted {
    /// Name, role and tenant.
    pub identity: Identity,
    /// The key's limits; the usual ones for a token.
    pub quota: Quota,
    /// Limits count for this account: one for each key, and for each subject of tokens.
    pub account: Arc<str>,
}

impl Admitted {
    pub(super) fn by_key(identity: Identity, quota: Quota) -> Self {
        Self {
            account: format!("key {}", identity.name).into(),
            identity,
            quota,
        }
    }

    pub(super) fn by_token(identity: Identity) -> Self {
        let tenant = identity.tenant.as_deref().unwrap_or_default();
        Self {
            account: format!("token {tenant:?} {}", identity.name).into(),
            identity,
            quota: Quota::default(),
        }
    }
}
