//! The keys, tokens and tickets that a server accepts. Keys and tokens can be replaced while it
//! runs.

use arc_swap::ArcSwap;

use super::EdgeError;
use super::admitted::Admitted;
use super::keys::Keys;
use super::tickets::Tickets;
use super::tokens::{TokenError, Tokens};

/// The keys, tokens and tickets that a server accepts.
#[derive(Debug, Default)]
pub struct Credentials {
    /// Keys of the file.
    keys: ArcSwap<Keys>,
    /// Keys that the server has made itself.
    own: Keys,
    tokens: Option<ArcSwap<Tokens>>,
    tickets: Tickets,
}

impl Credentials {
    /// `keys` are those of a file, `own` those that the server has made itself. Without `tokens`,
    /// tokens are not accepted.
    pub fn new(keys: Keys, own: Keys, tokens: Option<Tokens>) -> Self {
        Self {
            keys: ArcSwap::from_pointee(keys),
            own,
            tokens: tokens.map(ArcSwap::from_pointee),
            tickets: Tickets::default(),
        }
    }

    /// Replaces the keys of the file, from the next call on.
    pub fn replace_keys(&self, keys: Keys) {
        self.keys.store(keys.into());
    }

    /// Replaces the provider's keys, from the next call on. Has no effect if tokens are not
    /// accepted at all.
    pub fn replace_tokens(&self, tokens: Tokens) {
        if let Some(known) = &self.tokens {
            known.store(tokens.into());
        }
    }

    /// A ticket with which a caller can open one stream as `holder`, within [`TICKET_LIFETIME`].
    ///
    /// # Errors
    /// [`EdgeError::TooManyTickets`] if too many tickets are unused, of this key or in all.
    ///
    /// [`TICKET_LIFETIME`]: super::TICKET_LIFETIME
    pub fn ticket(&self, holder: Admitted) -> Result<String, EdgeError> {
        self.tickets.issue(holder)
    }

    pub(super) fn tickets(&self) -> &Tickets {
        &self.tickets
    }

    /// The caller to whom a key or token belongs.
    pub(super) fn admit(&self, bearer: &str) -> Result<Admitted, EdgeError> {
        let keys = self.keys.load();
        // Both are searched, so that the time does not reveal which one has the key.
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
