//! The request that a task serves. Its id is in log lines, errors and answers.

use std::fmt::{self, Display, Formatter};
use std::sync::Arc;
use std::time::Instant;

use opentelemetry::KeyValue;
use uuid::Uuid;

use super::Trace;

/// Most characters of an id that a caller gives.
const MAX_ID: usize = 64;
/// Signs of such an id beside letters and digits.
const ID_SIGNS: &[u8] = b"-_.:/+=@";

tokio::task_local! {
    static CURRENT: RequestContext;
}

/// What a request is called. Clones share it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RequestId(Arc<str>);

impl RequestId {
    /// The id that a caller gave, or a new one where it gave none, or one that is not fit for
    /// headers and logs.
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

    /// The id itself.
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
    /// Its id.
    pub id: RequestId,
    /// Its trace, where it has one.
    pub trace: Option<Trace>,
}

impl RequestContext {
    /// The request that this task serves.
    pub fn current() -> Option<Self> {
        CURRENT.try_with(Self::clone).ok()
    }

    /// The trace of the request that this task serves, where it has one.
    pub fn current_trace() -> Option<Trace> {
        CURRENT.try_with(|request| request.trace.clone()).ok().flatten()
    }

    /// Adds a part to the trace of the request that this task serves: one that began at `from` and
    /// ends now.
    pub fn part(name: &'static str, from: Instant, attributes: impl FnOnce() -> Vec<KeyValue>) {
        if let Some(trace) = Self::current_trace() {
            trace.part(name, from, Instant::now(), attributes());
        }
    }

    /// Does `work` for this request.
    pub async fn scope<T>(self, work: impl Future<Output = T>) -> T {
        CURRENT.scope(self, work).await
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_id_that_is_fit_is_kept_and_any_other_is_replaced() {
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
    async fn a_task_knows_its_request() {
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
