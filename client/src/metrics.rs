//! The metrics of a server.

use http_body_util::{BodyExt as _, Limited};
use tonic::body::Body;
use tower::ServiceExt as _;

use crate::connection::Client;
use crate::error::ClientError;

/// Longest text that the client reads, bytes.
const MAX_METRICS_BYTES: usize = 16 << 20;
/// Longest part of an error page in an error, characters.
const MAX_ERROR_CHARS: usize = 300;

impl Client {
    /// The server's `/metrics` in the format of Prometheus. If the server asks for keys, it takes
    /// one of the role `metrics` or `admin`.
    ///
    /// # Errors
    /// See [`ClientError`]; [`ClientError::Refused`] if the key has another role.
    pub async fn metrics(&self) -> Result<String, ClientError> {
        let request = http::Request::get("/metrics").body(Body::empty());
        let request = request.map_err(|e| self.sort(&tonic::Status::internal(e.to_string())))?;
        let broken = |e| self.sort(&tonic::Status::from_error(e));
        let answer = self
            .channel()
            .oneshot(request)
            .await
            .map_err(|e| broken(e.into()))?;
        let status = answer.status();
        let body = Limited::new(answer.into_body(), MAX_METRICS_BYTES)
            .collect()
            .await;
        let bytes = body.map_err(broken)?.to_bytes();
        let text = String::from_utf8_lossy(&bytes);
        if status.is_success() {
            return Ok(text.into_owned());
        }
        Err(self.sort(&refusal(status, &text)))
    }
}

/// The gRPC status for a status of HTTP.
fn refusal(status: http::StatusCode, text: &str) -> tonic::Status {
    use tonic::Code;

    let code = match status.as_u16() {
        401 => Code::Unauthenticated,
        403 => Code::PermissionDenied,
        404 => Code::NotFound,
        429 => Code::ResourceExhausted,
        503 => Code::Unavailable,
        _ => Code::Internal,
    };
    // Errors of the server have their message in JSON, those of a proxy do not.
    let error = serde_json::from_str::<serde_json::Value>(text).unwrap_or_default();
    let message = error["error"]["message"].as_str().unwrap_or(text);
    let message: String = message.trim().chars().take(MAX_ERROR_CHARS).collect();
    tonic::Status::new(code, format!("/metrics: {status}: {message}"))
}

#[cfg(test)]
mod tests {
    use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};

    use super::*;

    #[test]
    fn a_refusal_keeps_its_meaning() {
        let status = refusal(http::StatusCode::FORBIDDEN, "needs the role metrics\n");
        assert_eq!(status.code(), tonic::Code::PermissionDenied);
        assert_eq!(
            status.message(),
            "/metrics: 403 Forbidden: needs the role metrics"
        );
        let ours = r#"{"error": {"code": "PERMISSION_DENIED", "message": "the role is drive"}}"#;
        let status = refusal(http::StatusCode::FORBIDDEN, ours);
        assert_eq!(status.message(), "/metrics: 403 Forbidden: the role is drive");
        assert_eq!(
            refusal(http::StatusCode::BAD_GATEWAY, "").code(),
            tonic::Code::Internal
        );
    }

    #[tokio::test]
    async fn a_server_that_breaks_off_is_unreachable() {
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        let server = tokio::spawn(async move {
            let (mut stream, _) = listener.accept().await.unwrap();
            let mut hello = [0; 24];
            stream.read_exact(&mut hello).await.unwrap();
            stream
                .write_all(b"HTTP/1.1 400 Bad Request\r\n\r\n")
                .await
                .unwrap();
        });
        let client = Client::connect(&url).await.unwrap();
        let error = client.metrics().await.unwrap_err();
        assert!(matches!(error, ClientError::Unreachable { .. }), "{error:?}");
        server.await.unwrap();
    }
}
