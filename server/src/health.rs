//! The health check of the command line: asks a running server if it is ready. Container images
//! then need no HTTP client.

mod tls;

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::time::Duration;

use bytes::Bytes;
use http::{StatusCode, Uri};
use http_body_util::{BodyExt as _, Empty, Limited};
use hyper_rustls::HttpsConnectorBuilder;
use hyper_util::client::legacy::Client;
use hyper_util::rt::TokioExecutor;

pub use tls::{HealthTls, HealthTlsError};

/// Path to ask if a URL names none.
pub(crate) const READY: &str = "/readyz";
/// Most bytes of an answer to read.
const MAX_BODY: usize = 64 << 10;

/// Why a server is not healthy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum HealthError {
    /// Nothing answers at this address.
    #[error("no answer")]
    Unreachable(#[from] hyper_util::client::legacy::Error),
    /// The answer came too late.
    #[error("no answer within {} ms", .0.as_millis())]
    Timeout(Duration),
    /// Certificates cannot be used.
    #[error(transparent)]
    Tls(#[from] HealthTlsError),
    /// The server answered, but not with success.
    #[error("status {status}: {body}")]
    Status {
        /// The HTTP status.
        status: StatusCode,
        /// The answer's text.
        body: String,
    },
}

/// The URL of the readiness page of a server on this machine that listens on `listen`. An
/// unspecified address (0.0.0.0 or ::) becomes the loopback address.
///
/// # Errors
/// Never for an address with a port, but the library cannot know that.
pub fn ready_url(listen: SocketAddr, tls: bool) -> Result<Uri, http::Error> {
    let ip = match listen.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => IpAddr::V4(Ipv4Addr::LOCALHOST),
        IpAddr::V6(ip) if ip.is_unspecified() => IpAddr::V6(Ipv6Addr::LOCALHOST),
        ip => ip,
    };
    let address = SocketAddr::new(ip, listen.port());
    Uri::builder()
        .scheme(if tls { "https" } else { "http" })
        .authority(address.to_string())
        .path_and_query(READY)
        .build()
}

/// Asks `url`, and expects a success within `timeout`.
///
/// # Errors
/// [`HealthError`] if there is no answer or no success.
pub async fn check(url: &Uri, tls: &HealthTls, timeout: Duration) -> Result<(), HealthError> {
    let connector = HttpsConnectorBuilder::new()
        .with_tls_config(tls.config(url.scheme_str() == Some("https"))?)
        .https_or_http()
        .enable_http1()
        .build();
    let client = Client::builder(TokioExecutor::new()).build::<_, Empty<Bytes>>(connector);
    let ask = async {
        let response = client.get(url.clone()).await?;
        let status = response.status();
        if status.is_success() {
            return Ok(());
        }
        // If the body cannot be read, the status is enough.
        let body = Limited::new(response.into_body(), MAX_BODY).collect().await;
        let body = body.map(|body| body.to_bytes()).unwrap_or_default();
        let body = String::from_utf8_lossy(&body).trim().to_owned();
        Err(HealthError::Status { status, body })
    };
    tokio::time::timeout(timeout, ask)
        .await
        .unwrap_or(Err(HealthError::Timeout(timeout)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_address_is_asked_on_the_loopback_interface() {
        for (listen, url) in [
            ("0.0.0.0:8080", "http://127.0.0.1:8080/readyz"),
            ("[::]:8080", "http://[::1]:8080/readyz"),
            ("192.0.2.7:80", "http://192.0.2.7:80/readyz"),
        ] {
            assert_eq!(
                ready_url(listen.parse().unwrap(), false).unwrap().to_string(),
                url
            );
        }
    }

    #[tokio::test]
    async fn a_server_that_says_nothing_is_given_up() {
        let silent = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let url = ready_url(silent.local_addr().unwrap(), false).unwrap();
        let timeout = Duration::from_millis(50);
        let error = check(&url, &HealthTls::default(), timeout).await.unwrap_err();
        assert_eq!(error.to_string(), "no answer within 50 ms");
    }
}
