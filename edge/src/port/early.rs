//! Refuses calls of clients with a debt at the head of the request, before anything of it is read.

use std::sync::Arc;
use std::time::Instant;

use axum::response::Response;
use http::{HeaderMap, HeaderValue, Method, Request, header};

use crate::clients::{Client, Debt};
use crate::observe::REQUEST_ID;
use troupe_base::telemetry::RequestId;

/// The head of a call whose client has a debt.
#[derive(Debug, Clone, Copy)]
pub struct Head<'a> {
    /// POST for every remote procedure.
    pub method: &'a Method,
    /// Its path, without the query.
    pub path: &'a str,
    /// With the credential, and over gRPC the content type.
    pub headers: &'a HeaderMap,
}

/// Answers a call whose queue still has no room. None: the call goes on.
type Refuse = dyn Fn(&Debt, Head<'_>) -> Option<Response> + Send + Sync;

/// The refusal of calls whose clients have a debt.
#[derive(Clone)]
pub struct Early(Arc<Refuse>);

impl Early {
    /// `refuse` answers a call whose queue still has no room.
    pub fn new(refuse: impl Fn(&Debt, Head<'_>) -> Option<Response> + Send + Sync + 'static) -> Self {
        Self(Arc::new(refuse))
    }

    /// The answer to a call that is refused. Only its header has the request's id.
    pub(super) fn refused<B>(&self, request: &Request<B>, client: &Client) -> Option<Response> {
        let headers = request.headers();
        let debts = client.debts();
        if debts.is_empty() {
            return None;
        }
        let debt = debts.of(headers.get(header::AUTHORIZATION), Instant::now())?;
        let head = Head {
            method: request.method(),
            path: request.uri().path(),
            headers,
        };
        let mut response = (self.0)(&debt, head)?;
        let given = headers.get(REQUEST_ID).map(HeaderValue::as_bytes);
        if let Ok(id) = HeaderValue::from_str(RequestId::given_or_new(given).as_str()) {
            response.headers_mut().insert(REQUEST_ID, id);
        }
        Some(response)
    }
}
