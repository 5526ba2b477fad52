//! Protects the server from web pages of other sites.
//!
//! A browser lets every page send requests to any server that it can reach. The header `Origin`
//! names the page's site. The header `Host` names the server as the page addressed it. A page of
//! another site can give its own name the server's address (DNS rebinding), so `Host` is checked
//! too.

use std::net::IpAddr;
use std::str::FromStr;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::extract::{Request, State};
use axum::middleware::{self, Next};
use axum::response::Response;
use http::uri::Authority;
use http::{HeaderName, HeaderValue, Method, header};
use tower_http::cors::{AllowOrigin, CorsLayer};

use super::observe::REQUEST_ID;
use super::{EdgeError, Front};

/// How long a browser may remember the result of a preflight request.
const PREFLIGHT_AGE: Duration = Duration::from_secs(600);
/// The header of a caller's trace.
const TRACE_PARENT: HeaderName = HeaderName::from_static("traceparent");
/// Most characters of a header in an error.
const MAX_ECHO: usize = 200;

/// A host name or address, with or without a port.
#[derive(Debug, Clone, PartialEq, Eq, serde::Deserialize)]
#[serde(try_from = "String")]
pub struct Host {
    /// In lower case; an IPv6 address without brackets.
    name: String,
    port: Option<u16>,
}

/// Not a host.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{0:?} is not a host; allowed: a name or an address, with or without a port")]
pub struct NotAHost(String);

impl FromStr for Host {
    type Err = NotAHost;

    fn from_str(text: &str) -> Result<Self, NotAHost> {
        let authority: Authority = text.parse().map_err(|_| NotAHost(text.to_owned()))?;
        Self::of(&authority).ok_or_else(|| NotAHost(text.to_owned()))
    }
}

impl TryFrom<String> for Host {
    type Error = NotAHost;

    fn try_from(text: String) -> Result<Self, NotAHost> {
        text.parse()
    }
}

impl Host {
    fn of(authority: &Authority) -> Option<Self> {
        let text = authority.as_str();
        let host = authority.host();
        let rest = text.strip_prefix(host)?;
        let port = match rest.strip_prefix(':') {
            Some(port) => Some(port.parse().ok()?),
            None if rest.is_empty() => None,
            None => return None,
        };
        let bare = host.strip_prefix('[').and_then(|host| host.strip_suffix(']'));
        let name = bare.unwrap_or(host).trim_end_matches('.').to_ascii_lowercase();
        (!name.is_empty()).then_some(Self { name, port })
    }

    fn address(&self) -> Option<IpAddr> {
        self.name.parse().ok()
    }

    fn is_loopback(&self) -> bool {
        match self.address() {
            Some(address) => address.to_canonical().is_loopback(),
            None => self.name == "localhost" || self.name.ends_with(".localhost"),
        }
    }

    /// Whether a request to `asked` is a request to this host. A host without a port covers every
    /// port.
    fn covers(&self, asked: &Self) -> bool {
        self.name == asked.name && (self.port.is_none() || self.port == asked.port)
    }
}

/// An origin of web pages: scheme, host and port.
#[derive(Debug, Clone, PartialEq, Eq, serde::Deserialize)]
#[serde(try_from = "String")]
pub struct Origin {
    scheme: String,
    host: Host,
}

/// Not an origin.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{0:?} is not an origin; allowed: SCHEME://HOST or SCHEME://HOST:PORT")]
pub struct NotAnOrigin(String);

impl FromStr for Origin {
    type Err = NotAnOrigin;

    fn from_str(text: &str) -> Result<Self, NotAnOrigin> {
        let parts = text.split_once("://");
        let parts = parts.and_then(|(scheme, host)| Some((scheme.to_ascii_lowercase(), host.parse().ok()?)));
        let (scheme, host): (String, Host) = parts.ok_or_else(|| NotAnOrigin(text.to_owned()))?;
        let named = scheme.starts_with(|first: char| first.is_ascii_alphabetic());
        match named {
            true => Ok(Self { scheme, host }),
            false => Err(NotAnOrigin(text.to_owned())),
        }
    }
}

impl TryFrom<String> for Origin {
    type Error = NotAnOrigin;

    fn try_from(text: String) -> Result<Self, NotAnOrigin> {
        text.parse()
    }
}

impl Origin {
    fn usual_port(&self) -> Option<u16> {
        match self.scheme.as_str() {
            "http" => Some(80),
            "https" => Some(443),
            _ => None,
        }
    }

    /// Whether a page of this origin came from the server at `host`. The scheme is ignored, because
    /// a proxy may have ended TLS.
    fn is_same(&self, host: &Host) -> bool {
        let usual = self.usual_port();
        usual.is_some() && self.host.name == host.name && self.host.port.or(usual) == host.port.or(usual)
    }

    fn equals(&self, other: &Self) -> bool {
        let usual = self.usual_port();
        self.scheme == other.scheme
            && self.host.name == other.host.name
            && self.host.port.or(usual) == other.host.port.or(usual)
    }
}

/// The origins and host names that a server accepts.
#[derive(Debug, Clone)]
pub struct Guard {
    /// Origins of other pages that may use the server. Its own pages always may.
    pub origins: Vec<Origin>,
    /// Host names under which the server may be addressed.
    pub hosts: Vec<Host>,
    /// Whether the server only accepts connections from this machine.
    pub local: bool,
}

impl Guard {
    /// Checks the headers `Host` and `Origin` of a request.
    ///
    /// # Errors
    /// [`EdgeError::NotAllowed`], which names the header.
    fn check(&self, request: &Request) -> Result<(), EdgeError> {
        let host = self.host(request)?;
        for value in request.headers().get_all(header::ORIGIN) {
            let origin = value.to_str().ok().and_then(|text| text.parse::<Origin>().ok());
            let same = |origin: &Origin| host.as_ref().is_some_and(|host| origin.is_same(host));
            if !origin.is_some_and(|origin| same(&origin) || self.lists(&origin)) {
                return Err(refused(
                    "Origin",
                    value,
                    "the server's own pages, and the option allowed_origins",
                ));
            }
        }
        Ok(())
    }

    fn lists(&self, origin: &Origin) -> bool {
        self.origins.iter().any(|listed| listed.equals(origin))
    }

    /// The host to which a request is addressed. HTTP/1.0 needs none, but browsers always send one.
    fn host(&self, request: &Request) -> Result<Option<Host>, EdgeError> {
        let header = request.headers().get(header::HOST);
        let (host, found) = match (request.uri().authority(), header) {
            (Some(authority), _) => (
                Host::of(authority),
                HeaderValue::from_str(authority.as_str()).ok(),
            ),
            (None, Some(value)) => {
                let host = value.to_str().ok().and_then(|text| text.parse().ok());
                (host, Some(value.clone()))
            }
            (None, None) => return Ok(None),
        };
        let allowed = match self.local {
            true => "a loopback name or address, and the option allowed_hosts",
            false => "an address, localhost, and the option allowed_hosts",
        };
        match host {
            Some(host) if self.answers_to(&host) => Ok(Some(host)),
            _ => {
                let found = found.unwrap_or_else(|| HeaderValue::from_static(""));
                Err(refused("Host", &found, allowed))
            }
        }
    }

    fn answers_to(&self, host: &Host) -> bool {
        let listed = || self.hosts.iter().any(|listed| listed.covers(host));
        match self.local {
            true => host.is_loopback() || listed(),
            // DNS rebinding needs a name, so an address is always safe.
            false => self.hosts.is_empty() || host.address().is_some() || host.is_loopback() || listed(),
        }
    }
}

fn refused(header: &'static str, found: &HeaderValue, allowed: &'static str) -> EdgeError {
    let found = String::from_utf8_lossy(found.as_bytes());
    EdgeError::NotAllowed {
        header,
        found: troupe_base::echo::cut(&found, MAX_ECHO),
        allowed,
    }
}

/// Puts `guard` in front of all routes, and answers the preflight requests of listed origins
/// (CORS).
pub fn guarded(router: Router, front: Front, guard: Guard) -> Router {
    let guard = Arc::new(guard);
    let router = match guard.origins.is_empty() {
        true => router,
        false => router.layer(cors(guard.clone())),
    };
    router.layer(middleware::from_fn_with_state((guard, front), check))
}

fn cors(guard: Arc<Guard>) -> CorsLayer {
    let listed = move |origin: &HeaderValue, _: &http::request::Parts| {
        let origin = origin.to_str().ok().and_then(|text| text.parse().ok());
        origin.is_some_and(|origin| guard.lists(&origin))
    };
    CorsLayer::new()
        .allow_origin(AllowOrigin::predicate(listed))
        .allow_methods([Method::GET, Method::POST, Method::PUT, Method::DELETE])
        .allow_headers([
            header::CONTENT_TYPE,
            header::AUTHORIZATION,
            REQUEST_ID,
            TRACE_PARENT,
        ])
        .expose_headers([header::RETRY_AFTER, REQUEST_ID])
        .allow_private_network(true)
        .max_age(PREFLIGHT_AGE)
}

async fn check(State((guard, front)): State<(Arc<Guard>, Front)>, request: Request, next: Next) -> Response {
    match guard.check(&request) {
        Ok(()) => next.run(request).await,
        Err(error) => {
            tracing::debug!(%error, "a request is refused");
            front.turn_away(&error, request.headers())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn guard(local: bool) -> Guard {
        Guard {
            origins: vec![
                "https://App.example".parse().unwrap(),
                "tauri://localhost".parse().unwrap(),
            ],
            hosts: vec!["troupe.example:8443".parse().unwrap(), "inside".parse().unwrap()],
            local,
        }
    }

    fn check(guard: &Guard, host: &str, origin: Option<&str>) -> Result<(), String> {
        let mut request = Request::builder().header("host", host);
        if let Some(origin) = origin {
            request = request.header("origin", origin);
        }
        let request = request.body(axum::body::Body::empty()).unwrap();
        guard.check(&request).map_err(|error| error.to_string())
    }

    #[test]
    fn pages_of_the_server_and_of_listed_origins_may_use_it() {
        let guard = guard(true);
        for (host, origin) in [
            ("localhost:8080", "http://localhost:8080"),
            ("LOCALHOST:8080", "http://localhost:8080"),
            ("localhost", "http://localhost:80"),
            ("localhost", "https://localhost"),
            ("[::1]:8080", "http://[::1]:8080"),
            ("localhost:8080", "https://app.example"),
            ("localhost:8080", "https://app.example:443"),
            ("localhost:8080", "tauri://localhost"),
        ] {
            assert_eq!(check(&guard, host, Some(origin)), Ok(()), "{host} {origin}");
        }
        for (host, origin) in [
            ("localhost:8080", "http://localhost:8081"),
            ("localhost:8080", "http://localhost"),
            ("localhost:8080", "http://app.example"),
            ("localhost:8080", "https://app.example:444"),
            ("localhost:8080", "https://app.example.evil"),
            ("localhost:8080", "null"),
            ("localhost:8080", ""),
            ("localhost", "ftp://localhost"),
        ] {
            let error = check(&guard, host, Some(origin)).unwrap_err();
            assert!(
                error.contains("Origin") && error.contains("allowed_origins"),
                "{error}"
            );
        }
    }

    #[test]
    fn a_local_server_answers_to_loopback_names_and_listed_hosts() {
        let local = guard(true);
        for host in [
            "localhost",
            "a.localhost:1",
            "127.8.0.1:80",
            "[::1]",
            "[::ffff:127.0.0.1]:1",
            "inside:7",
            "troupe.example:8443",
        ] {
            assert_eq!(check(&local, host, None), Ok(()), "{host}");
        }
        for host in [
            "evil.example:8080",
            "192.0.2.1",
            "troupe.example",
            "localhost.evil",
            "user@localhost",
            "localhost:x",
        ] {
            let error = check(&local, host, None).unwrap_err();
            assert!(
                error.contains("Host") && error.contains("allowed_hosts"),
                "{error}"
            );
        }
        let wide = guard(false);
        for host in ["localhost", "192.0.2.1:8080", "[2001:db8::1]:8080", "inside"] {
            assert_eq!(check(&wide, host, None), Ok(()), "{host}");
        }
        assert!(check(&wide, "evil.example", None).is_err());
        let open = Guard {
            hosts: Vec::new(),
            ..wide
        };
        assert_eq!(check(&open, "evil.example", None), Ok(()));
    }

    #[test]
    fn errors_name_the_form_of_an_origin_or_host() {
        for wrong in ["https://", "app.example", "https://app.example/", "://a", "*"] {
            let error = wrong.parse::<Origin>().unwrap_err().to_string();
            assert!(error.contains("SCHEME://HOST"), "{error}");
        }
        for wrong in ["", "http://a", "a/b", "a@b"] {
            assert!(wrong.parse::<Host>().is_err(), "{wrong}");
        }
    }
}
