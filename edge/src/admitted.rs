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
