//! Tickets with which browsers open streams, because a browser cannot send a key there.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use tokio::time::Instant;

use super::EdgeError;
use super::admitted::Admitted;
use super::keys::{self, HASH_BYTES};

/// How long a ticket is valid.
pub const TICKET_LIFETIME: Duration = Duration::from_secs(30);
/// Most unused tickets of all keys together.
const MOST_TICKETS: usize = 4096;
/// Most unused tickets of one key.
const MOST_OF_KEY: usize = 256;

/// An unused ticket.
#[derive(Debug)]
struct Ticket {
    holder: Admitted,
    end: Instant,
}

/// The unused tickets of a server, by their hashes.
#[derive(Debug, Default)]
pub(super) struct Tickets(Mutex<HashMap<[u8; HASH_BYTES], Ticket>>);

impl Tickets {
    /// A ticket with which a caller can open one stream as `holder`.
    pub(super) fn issue(&self, holder: Admitted) -> Result<String, EdgeError> {
        let mut open = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let now = Instant::now();
        open.retain(|_, ticket| ticket.end > now);
        let of_key = open
            .values()
            .filter(|ticket| ticket.holder.account == holder.account);
        for (count, most, whose) in [
            (of_key.count(), MOST_OF_KEY, "this key"),
            (open.len(), MOST_TICKETS, "all clients together"),
        ] {
            if count >= most {
                return Err(EdgeError::TooManyTickets { whose, most });
            }
        }
        let ticket = keys::secret("ticket_");
        let end = now + TICKET_LIFETIME;
        open.insert(keys::hash(&ticket), Ticket { holder, end });
        Ok(ticket)
    }

    /// The holder of a ticket, which is used up then.
    pub(super) fn redeem(&self, ticket: &str) -> Option<Admitted> {
        let mut open = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let ticket = open.remove(&keys::hash(ticket))?;
        (ticket.end > Instant::now()).then_some(ticket.holder)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clients::{Identity, Quota, Role};

    fn holder(name: &str) -> Admitted {
        let identity = Identity {
            name: name.into(),
            role: Role::Drive,
            tenant: Some("t".into()),
        };
        Admitted::by_key(identity, Quota::default(), [0; HASH_BYTES])
    }

    #[tokio::test(start_paused = true)]
    async fn a_ticket_is_valid_once_and_for_a_short_time() {
        let tickets = Tickets::default();
        let ticket = tickets.issue(holder("a")).unwrap();
        assert!(tickets.redeem(&format!("{ticket}0")).is_none());
        assert_eq!(tickets.redeem(&ticket).unwrap(), holder("a"));
        assert!(tickets.redeem(&ticket).is_none());

        let late = tickets.issue(holder("a")).unwrap();
        tokio::time::advance(TICKET_LIFETIME).await;
        assert!(tickets.redeem(&late).is_none());
    }

    #[tokio::test(start_paused = true)]
    async fn unused_tickets_are_limited_by_key_and_in_all() {
        let tickets = Tickets::default();
        let all = || tickets.0.lock().unwrap().len();
        for _ in 0..MOST_OF_KEY {
            tickets.issue(holder("a")).unwrap();
        }
        let error = tickets.issue(holder("a")).unwrap_err();
        assert!(error.to_string().contains("this key"), "{error}");
        for other in 1..MOST_TICKETS / MOST_OF_KEY {
            for _ in 0..MOST_OF_KEY {
                tickets.issue(holder(&other.to_string())).unwrap();
            }
        }
        let error = tickets.issue(holder("b")).unwrap_err();
        assert!(error.to_string().contains("all clients"), "{error}");
        assert_eq!(all(), MOST_TICKETS);
        tokio::time::advance(TICKET_LIFETIME).await;
        tickets.issue(holder("b")).unwrap();
        assert_eq!(all(), 1);
    }
}
