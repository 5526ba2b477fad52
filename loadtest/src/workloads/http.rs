//! Requests to `InBetween` as JSON, and POST requests with prepared bytes to any HTTP server.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use bytes::Bytes;
use http::{HeaderMap, HeaderName, HeaderValue, Request, StatusCode, Uri, header};
use http_body_util::{BodyExt as _, Full, Limited};
use hyper_rustls::HttpsConnector;
use hyper_util::client::legacy::Client;
use hyper_util::client::legacy::connect::HttpConnector;
use hyper_util::rt::{TokioExecutor, TokioTimer};
use tokio::net::TcpStream;

use super::answer::{Form, check, read, wrong};
use super::connect::MOST_ANSWER_BYTES;
use super::requests::{Item, RequestSet};
use crate::failure::Failure;
use crate::loops::Target;
use crate::measure::{Answer, Outcome};
use crate::plan::Plan;

/// Maximum wait for a connection.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// Sends POST requests over HTTP/1.1. Each request in flight has a connection. Connections are
/// reused.
#[derive(Debug)]
pub struct Http {
    client: Client<HttpsConnector<HttpConnector>, Full<Bytes>>,
    uri: Uri,
    headers: HeaderMap,
    /// `None`: only the length of an answer's body is checked.
    form: Option<Form>,
    set: RequestSet,
    timeout: Duration,
    answers: AtomicU64,
}

impl Http {
    pub(super) fn json(plan: &Plan, set: RequestSet) -> Result<Self, Failure> {
        let address = format!("{}/v1/inbetween", plan.server.trim_end_matches('/'));
        let mut headers = HeaderMap::new();
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("application/json"));
        // The key is only for Troupe. Plain requests may go to other servers.
        if let Some(bearer) = plan.access.bearer()? {
            headers.insert(header::AUTHORIZATION, bearer);
        }
        Self::new(plan, &address, headers, Some(Form::Json), set)
    }

    pub(super) fn plain(plan: &Plan, extra: &[(String, String)], set: RequestSet) -> Result<Self, Failure> {
        let mut headers = HeaderMap::new();
        let octets = HeaderValue::from_static("application/octet-stream");
        headers.insert(header::CONTENT_TYPE, octets);
        for (name, value) in extra {
            let fault = |why: String| Failure::option("--header", format!("{name}:{value}"), why);
            let name = HeaderName::try_from(name).map_err(|e| fault(e.to_string()))?;
            let value = HeaderValue::try_from(value).map_err(|e| fault(e.to_string()))?;
            headers.insert(name, value);
        }
        Self::new(plan, &plan.server, headers, None, set)
    }

    fn new(
        plan: &Plan,
        address: &str,
        headers: HeaderMap,
        form: Option<Form>,
        set: RequestSet,
    ) -> Result<Self, Failure> {
        let uri: Uri = address
            .parse()
            .map_err(|e| Failure::Input(format!("{address:?} is not an address: {e}")))?;
        if !matches!(uri.scheme_str(), Some("http" | "https")) || uri.host().is_none() {
            return Err(Failure::option(
                "--server",
                address,
                "an address that begins with http:// or https://",
            ));
        }
        let mut connector = HttpConnector::new();
        connector.set_nodelay(true);
        connector.set_connect_timeout(Some(CONNECT_TIMEOUT));
        let client = Client::builder(TokioExecutor::new())
            .pool_timer(TokioTimer::new())
            .pool_idle_timeout(Duration::from_secs(90))
            .build(plan.access.connector(connector)?);
        Ok(Self {
            client,
            uri,
            headers,
            form,
            set,
            timeout: plan.timeout(),
            answers: AtomicU64::new(0),
        })
    }

    /// Checks that a server listens at the address, so that a wrong address fails at once.
    pub(super) async fn knock(&self) -> Result<(), Failure> {
        let host = self.uri.host().unwrap_or_default();
        let usual = if self.uri.scheme_str() == Some("https") {
            443
        } else {
            80
        };
        let port = self.uri.port_u16().unwrap_or(usual);
        let knock = TcpStream::connect((host.trim_matches(['[', ']']), port));
        let why = match tokio::time::timeout(CONNECT_TIMEOUT, knock).await {
            Ok(Ok(_)) => return Ok(()),
            Ok(Err(why)) => why.to_string(),
            Err(_) => format!("no connection within {CONNECT_TIMEOUT:?}"),
        };
        Err(Failure::Unreachable(format!(
            "no server answers at {}: {why}",
            self.uri
        )))
    }

    async fn send(&self, item: &Item) -> Result<Outcome, String> {
        let mut request = Request::post(self.uri.clone())
            .body(Full::new(item.body.clone()))
            .map_err(|e| e.to_string())?;
        request.headers_mut().clone_from(&self.headers);
        let answer = self
            .client
            .request(request)
            .await
            .map_err(|e| deepest(&e).to_owned())?;
        let status = answer.status();
        let body = Limited::new(answer.into_body(), MOST_ANSWER_BYTES)
            .collect()
            .await
            .map_err(|e| e.to_string())?
            .to_bytes();
        Ok(self.sort(status, body, item))
    }

    fn sort(&self, status: StatusCode, body: Bytes, item: &Item) -> Outcome {
        if matches!(
            status,
            StatusCode::TOO_MANY_REQUESTS | StatusCode::SERVICE_UNAVAILABLE
        ) {
            return Outcome::Refused(format!("HTTP_{}", status.as_u16()).into());
        }
        if status != StatusCode::OK {
            return Outcome::Failed {
                code: format!("HTTP_{}", status.as_u16()).into(),
                message: String::from_utf8_lossy(&body[..body.len().min(300)]).into_owned(),
            };
        }
        let Some(form) = self.form else {
            return plain(&body, item);
        };
        if self.set.is_sample(self.answers.fetch_add(1, Ordering::Relaxed))
            && let Some(request) = &item.request
        {
            if let Err(why) = check(&body, form, request) {
                return wrong("WRONG_ANSWER", why);
            }
            self.set.note_verified();
        }
        read(body, form, item.expected())
    }
}

/// The outcome of an answer of which only the length is known.
fn plain(body: &Bytes, item: &Item) -> Outcome {
    let bytes = body.len() as u64;
    if let Some(wanted) = item.answer_bytes.filter(|&wanted| wanted != bytes) {
        return wrong("WRONG_LENGTH", format!("{bytes} bytes instead of {wanted}"));
    }
    Outcome::Right(Answer {
        characters: item.characters,
        frames: item.frames.unwrap_or(0),
        bytes,
        timing: None,
    })
}

impl Target for Http {
    async fn call(&self, _caller: u64, number: u64) -> Outcome {
        let item = self.set.item(number);
        match tokio::time::timeout(self.timeout, self.send(item)).await {
            Ok(Ok(outcome)) => outcome,
            Ok(Err(why)) => wrong("UNAVAILABLE", why),
            Err(_) => wrong("TIMED_OUT", format!("no answer within {:?}", self.timeout)),
        }
    }

    fn verified(&self) -> u64 {
        self.set.verified()
    }
}

fn deepest(error: &dyn std::error::Error) -> String {
    let mut cause = error;
    while let Some(deeper) = cause.source() {
        cause = deeper;
    }
    cause.to_string()
}
