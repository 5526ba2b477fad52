//! Callers with a valid key, token or ticket.

use std::fmt::{self, Debug, Formatter};
use std::sync::Arc;

use super::clients::{Identity, Quota};
use super::keys::HASH_BYTES;

/// A caller with a valid key, token or ticket.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Admitted {
    /// Name, role and tenant.
    pub identity: Identity,
    /// The key's limits; the usual ones for a token.
    pub quota: Quota,
    /// Limits count for this account: one for each key, and for each subject of tokens.
    pub account: Arc<str>,
    /// The credential, to check it again while a stream is open.
    pub(super) proof: Proof,
}

/// The credential of a caller.
#[derive(Clone, PartialEq, Eq)]
pub(super) enum Proof {
    /// The hash of a key.
    Key([u8; HASH_BYTES]),
    /// What an identity provider has signed.
    Token {
        /// In the form in which the caller sent it.
        text: Arc<str>,
        /// Seconds since 1970 from which on it is refused.
        end_s: u64,
    },
}

/// Logs show no credential.
impl Debug for Proof {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Key(_) => "Key",
            Self::Token { .. } => "Token",
        })
    }
}

impl Admitted {
    pub(super) fn by_key(identity: Identity, quota: Quota, hash: [u8; HASH_BYTES]) -> Self {
        Self {
            account: format!("key {}", identity.name).into(),
            identity,
            quota,
            proof: Proof::Key(hash),
        }
    }

    pub(super) fn by_token(identity: Identity, token: &str, end_s: u64) -> Self {
        let tenant = identity.tenant.as_deref().unwrap_or_default();
        Self {
            account: format!("token {tenant:?} {}", identity.name).into(),
            identity,
            quota: Quota::default(),
            proof: Proof::Token {
                text: token.into(),
                end_s,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;
    use crate::clients::Role;

    #[test]
    fn each_key_and_each_subject_of_a_tenant_has_an_account() {
        let identity = |name: &str, tenant: Option<&str>| Identity {
            name: name.into(),
            role: Role::Drive,
            tenant: tenant.map(Into::into),
        };
        let key = |name| Admitted::by_key(identity(name, None), Quota::default(), [0; HASH_BYTES]).account;
        let subject = |name, tenant| Admitted::by_token(identity(name, tenant), "a.b.c", 1).account;
        let accounts = [
            key("a"),
            key("b"),
            subject("a", None),
            subject("a", Some("t")),
            subject("b", Some("t")),
            subject("a", Some("u")),
        ];
        let different: HashSet<_> = accounts.iter().collect();
        assert_eq!(different.len(), accounts.len(), "{accounts:?}");
    }
}
