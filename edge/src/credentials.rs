//! The keys, tokens and tickets that a server accepts. Keys and tokens can be replaced while it
//! runs. Streams end when their credential does.

use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use arc_swap::ArcSwap;
use tokio::sync::watch;

use super::EdgeError;
use super::admitted::{Admitted, Proof};
use super::keys::{Keys, hash};
use super::tickets::Tickets;
use super::tokens::{TokenError, Tokens};

/// Most time between two looks at the clock while a token's stream is open. Clocks may be set.
const LOOK_INTERVAL: Duration = Duration::from_millis(500);

/// Tells the time, for the end of tokens.
type Clock = Arc<dyn Fn() -> SystemTime + Send + Sync>;

/// The keys, tokens and tickets that a server accepts.
pub struct Credentials {
    /// Keys of the file.
    keys: ArcSwap<Keys>,
    /// Keys that the server has made itself.
    own: Keys,
    tokens: Option<ArcSwap<Tokens>>,
    tickets: Tickets,
    clock: Clock,
    /// Changes when keys or tokens were replaced.
    replaced: watch::Sender<()>,
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
            clock: Arc::new(SystemTime::now),
            replaced: watch::Sender::new(()),
        }
    }

    /// Replaces the clock that ends the streams of tokens.
    #[cfg(test)]
    fn at(mut self, clock: impl Fn() -> SystemTime + Send + Sync + 'static) -> Self {
        self.clock = Arc::new(clock);
        self
    }

    /// Replaces the keys of the file, from the next call on. Ends the streams of removed keys.
    pub fn replace_keys(&self, keys: Keys) {
        self.keys.store(keys.into());
        self.replaced.send_replace(());
    }

    /// Replaces the provider's keys, from the next call on. Ends the streams of tokens that they
    /// did not sign. Has no effect if tokens are not accepted at all.
    pub fn replace_tokens(&self, tokens: Tokens) {
        if let Some(known) = &self.tokens {
            known.store(tokens.into());
            self.replaced.send_replace(());
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

    /// The holder of a ticket, which is used up then.
    pub(super) fn redeem(&self, ticket: &str) -> Result<Admitted, EdgeError> {
        let holder = self.tickets.redeem(ticket).ok_or(EdgeError::UnknownTicket)?;
        match self.why_ended(&holder) {
            Some(error) => Err(error),
            None => Ok(holder),
        }
    }

    /// The caller to whom a key or token belongs.
    pub(super) fn admit(&self, bearer: &str) -> Result<Admitted, EdgeError> {
        let keys = self.keys.load();
        let hash = hash(bearer);
        // Both are searched, so that the time does not reveal which one has the key.
        let (known, own) = (keys.find(&hash), self.own.find(&hash));
        if let Some((identity, quota)) = known.or(own) {
            return Ok(Admitted::by_key(identity.clone(), quota, hash));
        }
        match &self.tokens {
            // A token has three parts.
            Some(tokens) if bearer.split('.').count() == 3 => {
                let (identity, end_s) = tokens.load().check(bearer).map_err(EdgeError::Token)?;
                Ok(Admitted::by_token(identity, bearer, end_s))
            }
            Some(_) if bearer.contains('.') => Err(EdgeError::Token(TokenError::Form)),
            _ => Err(EdgeError::UnknownKey),
        }
    }

    /// Why a caller is no longer admitted; none if it is, with the same role and tenant.
    fn why_ended(&self, holder: &Admitted) -> Option<EdgeError> {
        match &holder.proof {
            Proof::Key(hash) => {
                let keys = self.keys.load();
                let found = keys.find(hash).or(self.own.find(hash));
                let same = found.is_some_and(|(identity, _)| *identity == holder.identity);
                (!same).then_some(EdgeError::KeyRemoved)
            }
            Proof::Token { text, end_s } => {
                if self.now_s() >= *end_s {
                    return Some(EdgeError::TokenExpired);
                }
                let checked = self.tokens.as_ref()?.load().check(text);
                match checked {
                    Ok((identity, _)) if identity == holder.identity => None,
                    // The two clocks may differ in a test.
                    Err(TokenError::Expired) => Some(EdgeError::TokenExpired),
                    _ => Some(EdgeError::KeyRemoved),
                }
            }
        }
    }

    fn now_s(&self) -> u64 {
        let since = (self.clock)().duration_since(UNIX_EPOCH);
        since.map_or(0, |since| since.as_secs())
    }

    /// Waits until the caller is no longer admitted, and says why.
    pub(super) async fn ended(&self, holder: &Admitted) -> EdgeError {
        let mut replaced = self.replaced.subscribe();
        loop {
            if let Some(error) = self.why_ended(holder) {
                return error;
            }
            loop {
                let Proof::Token { end_s, .. } = &holder.proof else {
                    // The sender is part of `self`.
                    let _ = replaced.changed().await;
                    break;
                };
                tokio::select! {
                    _ = replaced.changed() => break,
                    () = tokio::time::sleep(LOOK_INTERVAL) => {}
                }
                if self.now_s() >= *end_s {
                    return EdgeError::TokenExpired;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU64, Ordering};

    use tokio::time::{Instant, timeout};

    use super::*;
    use crate::clients::{Identity, Role};
    use crate::keys;

    const SHORT: Duration = Duration::from_millis(10);

    fn keys(names: &[&str]) -> Keys {
        let entries = names.iter().map(|name| keys::entry(name, Role::Drive, name));
        Keys::read(&entries.collect::<String>()).unwrap()
    }

    #[tokio::test(start_paused = true)]
    async fn a_removed_key_ends_its_callers_and_no_others() {
        let credentials = Credentials::new(keys(&["a", "b"]), Keys::default(), None);
        let (a, b) = (credentials.admit("a").unwrap(), credentials.admit("b").unwrap());
        assert!(timeout(SHORT, credentials.ended(&a)).await.is_err());
        let waiting = credentials.ended(&a);
        tokio::pin!(waiting);
        assert!(timeout(SHORT, &mut waiting).await.is_err());
        credentials.replace_keys(keys(&["b"]));
        assert!(matches!(waiting.await, EdgeError::KeyRemoved));
        assert!(timeout(SHORT, credentials.ended(&b)).await.is_err());
        // A key with another role is another key.
        let higher = Keys::read(&keys::entry("b", Role::Author, "b")).unwrap();
        credentials.replace_keys(higher);
        assert!(matches!(credentials.ended(&b).await, EdgeError::KeyRemoved));
    }

    #[tokio::test(start_paused = true)]
    async fn an_expired_token_ends_its_callers_within_a_second() {
        let now_s = Arc::new(AtomicU64::new(1000));
        let clock = now_s.clone();
        let credentials = Credentials::new(Keys::default(), Keys::default(), None)
            .at(move || UNIX_EPOCH + Duration::from_secs(clock.load(Ordering::Relaxed)));
        let identity = Identity {
            name: "game".into(),
            role: Role::Drive,
            tenant: None,
        };
        let holder = Admitted::by_token(identity, "a.b.c", 1005);
        let waiting = credentials.ended(&holder);
        tokio::pin!(waiting);
        now_s.store(1004, Ordering::Relaxed);
        assert!(timeout(Duration::from_secs(60), &mut waiting).await.is_err());
        now_s.store(1005, Ordering::Relaxed);
        let begun = Instant::now();
        assert!(matches!(waiting.await, EdgeError::TokenExpired));
        assert!(begun.elapsed() < Duration::from_secs(1), "{:?}", begun.elapsed());
    }

    #[test]
    fn logs_show_no_credential() {
        let identity = Identity {
            name: "game".into(),
            role: Role::Drive,
            tenant: None,
        };
        let shown = format!("{:?}", Admitted::by_token(identity, "secret.secret.secret", 5));
        assert!(!shown.contains("secret"), "{shown}");
    }

    #[test]
    fn a_ticket_of_a_removed_key_opens_nothing() {
        let credentials = Credentials::new(keys(&["a", "b"]), Keys::default(), None);
        let ticket = |name| credentials.ticket(credentials.admit(name).unwrap()).unwrap();
        let (a, b) = (ticket("a"), ticket("b"));
        credentials.replace_keys(keys(&["b"]));
        assert!(matches!(credentials.redeem(&a), Err(EdgeError::KeyRemoved)));
        assert!(credentials.redeem(&b).is_ok());
    }
}
