//! Callers that are let in.

use std::sync::Arc;

use super::clients::{Identity, Quota};

/// A caller that is let in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Admitted {
    /// Who it is.
    pub identity: Identity,
    /// What it may have at a time.
    pub quota: Quota,
    /// What it takes counts for this account: that of its key, or of its token's subject.
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
