//! The request that a task serves. Log lines, errors and answers carry its id.

use std::fmt::{self, Display, Formatter};
use std::sync::Arc;
use std::time::Instant;

use opentelemetry::KeyValue;
use uuid::Uuid;

use super::Trace;

/// Most characters of an id that a caller gives.
const MAX_ID: usize = 64;
/// Other characters than letters and digits that such an id may have.
const ID_SIGNS: &[u8] = b"-_.:/+=@";

tokio::task_local! {
    static CURRENT: RequestContext;
}

/// A request's id, from its caller or made here. Clones share the text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RequestId(Arc<str>);

impl RequestId {
    /// The caller's id if it is fit for headers and logs, otherwise a new one.
    pub fn given_or_new(given: Option<&[u8]>) -> Self {
        let fit = |id: &[u8]| {
            (1..=MAX_ID).contains(&id.len())
                && id
                    .iter()
                    .all(|sign| sign.is_ascii_alphanumeric() || ID_SIGNS.contains(sign))
        };
        let given = given.filter(|id| fit(id)).and_then(|id| str::from_utf8(id).ok());
        match given {
            Some(id) => Self(id.into()),
            None => Self(Uuid::now_v7().to_string().into()),
        }
    }

    /// At most 64 printable ASCII characters.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl Display for RequestId {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// The request that a task serves. Clones share it.
#[derive(Debug, Clone)]
pub struct RequestContext {
    /// In log lines, errors and answers.
    pub id: RequestId,
    /// None if traces are off or the request is not sampled.
    pub trace: Option<Trace>,
}

impl RequestContext {
    /// The request that this task serves; none outside of [`RequestContext::scope`].
    pub fn current() -> Option<Self> {
        CURRENT.try_with(Self::clone).ok()
    }

    /// The trace of the request that this task serves, if it has one.
    pub fn current_trace() -> Option<Trace> {
        CURRENT.try_with(|request| request.trace.clone()).ok().flatten()
    }

    /// Adds a span that began at `from` and ends now to the trace of the request that this task
    /// serves.
    pub fn part(name: &'static str, from: Instant, attributes: impl FnOnce() -> Vec<KeyValue>) {
        if let Some(trace) = Self::current_trace() {
            trace.part(name, from, Instant::now(), attributes());
        }
    }

    /// Runs `work` as part of this request: [`RequestContext::current`] gives it there.
    pub async fn scope<T>(self, work: impl Future<Output = T>) -> T {
        CURRENT.scope(self, work).await
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fit_id_is_kept_and_any_other_is_replaced() {
        let of = |given: &str| RequestId::given_or_new(Some(given.as_bytes()));
        let longest = "a".repeat(MAX_ID);
        for fit in ["a", "Root=1-67891233-abcdef012345678912345678", longest.as_str()] {
            assert_eq!(of(fit).as_str(), fit);
        }
        let too_long = "a".repeat(MAX_ID + 1);
        for unfit in ["", "a b", "a\nb", "é", "\"a\"", "{a}", too_long.as_str()] {
            let id = of(unfit);
            assert!(Uuid::parse_str(id.as_str()).is_ok(), "{unfit:?} became {id}");
        }
        assert_ne!(RequestId::given_or_new(None), RequestId::given_or_new(None));
    }

    #[tokio::test]
    async fn a_task_finds_its_request() {
        assert!(RequestContext::current().is_none());
        let id = RequestId::given_or_new(None);
        let context = RequestContext {
            id: id.clone(),
            trace: None,
        };
        let found = context.scope(async { RequestContext::current() }).await;
        assert_eq!(found.unwrap().id, id);
    }
}
