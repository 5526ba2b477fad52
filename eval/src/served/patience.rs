//! Requests of a measurement may fill a server's queue. They are sent again.

use std::time::Duration;

use tokio::time::sleep;
use troupe_client::ClientError;

/// Tries of a request.
const TRIES: u32 = 100;
/// Pause before the next try if the server says nothing of it.
const PAUSE: Duration = Duration::from_millis(250);

/// The answer to a request that is sent again while the server's queue is full.
///
/// # Errors
/// Any other error, or the last one.
pub(super) async fn patiently<T, F>(ask: impl Fn() -> F) -> Result<T, ClientError>
where
    F: Future<Output = Result<T, ClientError>>,
{
    for _ in 1..TRIES {
        match ask().await {
            Err(ClientError::Refused(refusal)) if refusal.reason.as_deref() == Some("QUEUE_FULL") => {
                sleep(refusal.retry_after.unwrap_or(PAUSE)).await;
            }
            answer => return answer,
        }
    }
    ask().await
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use troupe_client::RefusedCall;

    use super::*;

    /// Asks a server that refuses the first `full` requests. Answers the result and the requests.
    async fn asked(full: u32, reason: &str) -> (Result<u32, ClientError>, u32) {
        let asked = Cell::new(0);
        let ask = || async {
            asked.set(asked.get() + 1);
            if asked.get() > full {
                return Ok(7);
            }
            Err(ClientError::Refused(Box::new(RefusedCall {
                code: tonic::Code::ResourceExhausted,
                message: String::new(),
                violations: Vec::new(),
                reason: Some(reason.to_owned()),
                retry_after: Some(Duration::ZERO),
                request_id: None,
            })))
        };
        (patiently(ask).await, asked.get())
    }

    #[tokio::test]
    async fn a_request_is_sent_again_while_the_queue_is_full() {
        assert!(matches!(asked(0, "QUEUE_FULL").await, (Ok(7), 1)));
        assert!(matches!(asked(2, "QUEUE_FULL").await, (Ok(7), 3)));
        assert!(matches!(asked(TRIES, "QUEUE_FULL").await, (Err(_), TRIES)));
        assert!(matches!(asked(2, "INVALID_FIELD").await, (Err(_), 1)));
    }
}
