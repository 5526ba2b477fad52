//! What lets callers in. It can be replaced while the server runs.

use arc_swap::ArcSwap;

use super::EdgeError;
use super::admitted::Admitted;
use super::keys::Keys;
use super::tickets::Tickets;
use super::tokens::{TokenError, Tokens};

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

    /// A ticket that lets its bearer in once as `holder`, within [`TICKET_LIFETIME`].
    ///
    /// # Errors
    /// [`EdgeError::TooManyTickets`].
    ///
    /// [`TICKET_LIFETIME`]: super::TICKET_LIFETIME
    pub fn ticket(&self, holder: Admitted) -> Result<String, EdgeError> {
        self.tickets.issue(holder)
    }

    pub(super) fn tickets(&self) -> &Tickets {
        &self.tickets
    }

    /// Whom a key or a token lets in.
    pub(super) fn admit(&self, bearer: &str) -> Result<Admitted, EdgeError> {
        let keys = self.keys.load();
        // Both are searched, so that the time says nothing.
        let (known, own) = (keys.find(bearer), self.own.find(bearer));
        if let Some((identity, quota)) = known.or(own) {
            return Ok(Admitted::by_key(identity.clone(), quota));
        }
        match &self.tokens {
            // A token has three parts.
            Some(tokens) if bearer.split('.').count() == 3 => {
                let identity = tokens.load().check(bearer).map_err(EdgeError::Token)?;
                Ok(Admitted::by_token(identity))
            }
            Some(_) if bearer.contains('.') => Err(EdgeError::Token(TokenError::Form)),
            _ => Err(EdgeError::UnknownKey),
        }
    }
}
