//! What lets callers in. It can be replaced while the server runs.

use std::sync::Arc;

use arc_swap::ArcSwap;

use super::error::ApiError;
use super::keys::Keys;
use super::tickets::Tickets;
use super::tokens::{TokenError, Tokens};
use crate::clients::{Identity, Quota};

/// A caller that is let in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Admitted {
    pub(super) identity: Identity,
    pub(super) quota: Quota,
    /// What it takes counts for this account: that of its key, or of its token's subject.
    pub(super) account: Arc<str>,
}

impl Admitted {
    pub(super) fn by_key(identity: Identity, quota: Quota) -> Self {
        Self {
            account: format!("key {}", identity.name).into(),
            identity,
            quota,
        }
    }

    fn by_token(identity: Identity) -> Self {
        let tenant = identity.tenant.as_deref().unwrap_or_default();
        Self {
            account: format!("token {tenant:?} {}", identity.name).into(),
            identity,
            quota: Quota::default(),
        }
    }
}

/// What a server accepts.
#[derive(Debug, Default)]
pub struct Credentials {
    /// Those of the file.
    keys: ArcSwap<Keys>,
    /// Those that the server has made itself.
    own: Keys,
    tokens: Option<ArcSwap<Tokens>>,
    tickets: Tickets,
}

impl Credentials {
    /// Keys of a file, keys that the server has made itself, and tokens.
    pub fn new(keys: Keys, own: Keys, tokens: Option<Tokens>) -> Self {
        Self {
            keys: ArcSwap::from_pointee(keys),
            own,
            tokens: tokens.map(ArcSwap::from_pointee),
            tickets: Tickets::default(),
        }
    }

    /// Accepts these keys in the place of the file's, from the next call on.
    pub fn replace_keys(&self, keys: Keys) {
        self.keys.store(keys.into());
    }

    /// Accepts tokens by these keys and no others, from the next call on. Without effect where
    /// there were none.
    pub fn replace_tokens(&self, tokens: Tokens) {
        if let Some(known) = &self.tokens {
            known.store(tokens.into());
        }
    }

    pub(super) fn tickets(&self) -> &Tickets {
        &self.tickets
    }

    /// Whom a key or a token lets in.
    pub(super) fn admit(&self, bearer: &str) -> Result<Admitted, ApiError> {
        let keys = self.keys.load();
        // Both are searched, so that the time says nothing.
        let (known, own) = (keys.find(bearer), self.own.find(bearer));
        if let Some((identity, quota)) = known.or(own) {
            return Ok(Admitted::by_key(identity.clone(), quota));
        }
        match &self.tokens {
            // A token has three parts.
            Some(tokens) if bearer.split('.').count() == 3 => {
                let identity = tokens.load().check(bearer).map_err(ApiError::Token)?;
                Ok(Admitted::by_token(identity))
            }
            Some(_) if bearer.contains('.') => Err(ApiError::Token(TokenError::Form)),
            _ => Err(ApiError::UnknownKey),
        }
    }
}
