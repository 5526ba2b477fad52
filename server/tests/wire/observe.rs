//! What a server tells of its requests: ids, traces, refusals.

use std::sync::{Arc, Mutex};

use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;
use tokio_tungstenite::connect_async;
use tokio_tungstenite::tungstenite::client::IntoClientRequest as _;
use tonic::Code;
use tonic_types::StatusExt as _;
use troupe_edge::clients::Role;
use troupe_edge::keys;
use troupe_proto::v1;
use troupe_server::api::ErrorBody;

use crate::common::{TestServer, request};

const ID: &str = "x-request-id";

/// The id of an answer over HTTP.
fn id_of(response: &reqwest::Response) -> String {
    response.headers()[ID].to_str().unwrap().to_owned()
}

async fn get(server: &TestServer, path: &str, id: &str) -> reqwest::Response {
    let request = reqwest::Client::new().get(server.url(path)).header(ID, id);
    request.send().await.unwrap()
}

#[tokio::test]
async fn every_answer_over_http_has_an_id() {
    let server = TestServer::start().await;
    for path in ["/v1/packs", "/healthz", "/metrics", "/docs/", "/openapi.json"] {
        let (one, other) = (server.get(path).await, server.get(path).await);
        assert!(one.status().is_success(), "{path}");
        assert_ne!(id_of(&one), id_of(&other), "{path}");
        assert_eq!(id_of(&get(&server, path, "mine-1").await), "mine-1", "{path}");
    }
    let long = "a".repeat(65);
    for unfit in ["a b", "<script>", long.as_str()] {
        let id = id_of(&get(&server, "/healthz", unfit).await);
        assert!(id.len() == 36 && id != unfit, "{id}");
    }
}

#[tokio::test]
async fn errors_over_http_name_their_request() {
    let server = TestServer::start().await;
    for path in ["/v1/packs/none", "/nowhere", "/v1/sessions?page_size=x"] {
        let response = get(&server, path, "mine-2").await;
        assert!(response.status().is_client_error(), "{path}");
        assert_eq!(id_of(&response), "mine-2", "{path}");
        let body: ErrorBody = response.json().await.unwrap();
        assert_eq!(body.error.request_id.as_deref(), Some("mine-2"), "{path}");
    }
    let refused = reqwest::Client::new()
        .get(server.url("/v1/packs"))
        .header("origin", "http://evil.example")
        .send()
        .await
        .unwrap();
    let id = id_of(&refused);
    let body: ErrorBody = refused.json().await.unwrap();
    assert_eq!(body.error.request_id, Some(id));
}

#[tokio::test]
async fn answers_and_errors_over_grpc_have_an_id() {
    let server = TestServer::start().await;
    let mut client = server.grpc().await;
    let answer = client.in_between(request(1)).await.unwrap();
    assert_eq!(answer.metadata().get(ID).unwrap().len(), 36);
    let mut wrong = tonic::Request::new(v1::GetPackRequest { name: "none".into() });
    wrong.metadata_mut().insert(ID, "mine-3".parse().unwrap());
    let status = client.get_pack(wrong).await.unwrap_err();
    assert_eq!(status.metadata().get(ID).unwrap(), "mine-3");
    let details = status.get_error_details();
    assert_eq!(details.request_info().unwrap().request_id, "mine-3");
}

#[tokio::test]
async fn sockets_and_connections_beyond_the_limit_have_an_id() {
    let server = TestServer::start_with(|config| {
        config.max_connections = 1;
        config.fixed.max_connections_per_address = Some(100);
    })
    .await;
    let url = server.url("/v1/drive").replace("http", "ws");
    let mut asked = url.into_client_request().unwrap();
    asked.headers_mut().insert(ID, "mine-4".parse().unwrap());
    let (_socket, response) = connect_async(asked).await.unwrap();
    assert_eq!(response.headers()[ID], "mine-4");

    let mut stream = TcpStream::connect(server.handle.address()).await.unwrap();
    let head = format!("GET /v1/packs HTTP/1.1\r\nhost: localhost\r\n{ID}: mine-5\r\n\r\n");
    stream.write_all(head.as_bytes()).await.unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.unwrap();
    assert!(answer.starts_with("HTTP/1.1 503"), "{answer}");
    assert!(
        answer.contains(&format!("{ID}: mine-5")) && answer.contains("\"request_id\":\"mine-5\""),
        "{answer}"
    );
}

#[tokio::test]
async fn requests_that_are_turned_away_are_counted_by_reason() {
    let file = std::env::temp_dir().join(format!("troupe-refusals-{}.toml", std::process::id()));
    let drive = keys::new_key();
    std::fs::write(&file, keys::entry("a", Role::Drive, &drive)).unwrap();
    let path = file.clone();
    let server = TestServer::start_with(|config| config.keys = Some(path)).await;
    std::fs::remove_file(&file).unwrap();
    let ask = async |headers: &[(&str, &str)]| {
        let mut request = reqwest::Client::new().get(server.url("/metrics"));
        for &(name, value) in headers {
            request = request.header(name, value);
        }
        request.send().await.unwrap().status().as_u16()
    };
    let bearer = format!("Bearer {drive}");
    assert_eq!(ask(&[("origin", "http://evil.example")]).await, 403);
    assert_eq!(ask(&[("host", "evil.example")]).await, 403);
    assert_eq!(ask(&[]).await, 401);
    assert_eq!(ask(&[("authorization", "Bearer wrong")]).await, 401);
    assert_eq!(ask(&[("authorization", &bearer)]).await, 403);
    let status = server.grpc().await.in_between(request(1)).await.unwrap_err();
    assert_eq!(status.code(), Code::Unauthenticated);
    for (reason, count) in [
        ("origin", "1"),
        ("host", "1"),
        ("key_missing", "2"),
        ("key_unknown", "1"),
        ("role", "1"),
        ("headers", "0"),
    ] {
        let series = format!("troupe_refusals_total{{reason=\"{reason}\"}}");
        server.metric(&series, count).await;
    }
}

#[tokio::test]
async fn scenes_uploads_and_bytes_are_counted() {
    let server = TestServer::start().await;
    server.get("/metrics").await;
    server.metric("troupe_ready", "1").await;
    server.metric("troupe_scenes", "0").await;
    let yard = serde_json::json!({"name": "yard"});
    let put = server
        .send(
            reqwest::Method::PUT,
            "/v1/scenes/yard",
            &serde_json::json!({"scene": yard}),
        )
        .await;
    assert!(put.status().is_success(), "{}", put.text().await.unwrap());
    let metrics = server.get("/metrics").await.text().await.unwrap();
    assert!(metrics.contains("\ntroupe_scenes 1\n"), "{metrics}");
    assert!(
        metrics.contains("troupe_uploads_total{kind=\"scene\"} 1"),
        "{metrics}"
    );
    for line in [
        "troupe_request_body_bytes_total",
        "troupe_answer_body_bytes_total",
    ] {
        let value = metrics
            .lines()
            .find_map(|found| found.strip_prefix(line)?.trim().parse().ok());
        assert!(value.is_some_and(|value: u64| value > 10), "{line} in {metrics}");
    }
    assert!(
        metrics.contains("troupe_limit{option=\"max_queued_characters\"} 1024"),
        "{metrics}"
    );
}

/// An error about headers of more than 16 KiB.
fn assert_too_large(response: &str) {
    for part in [
        "HTTP/1.1 431",
        "HEADERS_TOO_LARGE",
        "\"field\":\"headers\"",
        "at most 16384 bytes",
        ID,
    ] {
        assert!(response.contains(part), "{part} is not in {response}");
    }
}

#[tokio::test]
async fn too_large_headers_get_an_error_that_says_so() {
    let server = TestServer::start().await;
    // One that is long, and many that are short.
    let many: String = (0..490).map(|index| format!("a{index}: b\r\n")).collect();
    for headers in [format!("a: {}\r\n", "b".repeat(17 << 10)), many] {
        let mut stream = TcpStream::connect(server.handle.address()).await.unwrap();
        let head = format!("GET /healthz HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n{headers}\r\n");
        stream.write_all(head.as_bytes()).await.unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).await.unwrap();
        assert_too_large(&answer);
    }
    // Over HTTP/2.
    let client = reqwest::Client::builder()
        .http2_prior_knowledge()
        .build()
        .unwrap();
    let long = client
        .get(server.url("/v1/packs"))
        .header("a", "b".repeat(17 << 10));
    let response = long.send().await.unwrap();
    assert_eq!(response.status().as_u16(), 431);
    let body: ErrorBody = response.json().await.unwrap();
    assert_eq!(
        (
            body.error.code.as_str(),
            body.error.reason.as_str(),
            body.error.field.as_deref()
        ),
        ("RESOURCE_EXHAUSTED", "HEADERS_TOO_LARGE", Some("headers"))
    );
    // Over gRPC.
    let mut wrong = tonic::Request::new(request(1));
    wrong
        .metadata_mut()
        .insert("a", "b".repeat(17 << 10).parse().unwrap());
    let status = server.grpc().await.in_between(wrong).await.unwrap_err();
    assert_eq!(status.code(), Code::ResourceExhausted);
    assert_eq!(
        status.get_error_details().error_info().unwrap().reason,
        "HEADERS_TOO_LARGE"
    );
    // As much as is allowed.
    let fits = client
        .get(server.url("/healthz"))
        .header("a", "b".repeat(15 << 10));
    assert!(fits.send().await.unwrap().status().is_success());
    server
        .metric(r#"troupe_refusals_total{reason="headers"}"#, "4")
        .await;
}

/// What is logged.
#[derive(Clone, Default)]
struct Log(Arc<Mutex<Vec<u8>>>);

impl std::io::Write for Log {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.lock().unwrap().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[tokio::test]
async fn log_lines_show_the_request_and_attacks_show_once_a_minute() {
    let log = Log::default();
    let writer = log.clone();
    let subscriber = tracing_subscriber::fmt()
        .with_ansi(false)
        .with_writer(move || writer.clone())
        .finish();
    // No other test of this program sets one. Tests that run beside this one log other ids.
    tracing::subscriber::set_global_default(subscriber).unwrap();
    let server = TestServer::start().await;
    for number in 0..5 {
        let request = reqwest::Client::new()
            .get(server.url("/v1/packs"))
            .header("origin", "http://evil.example")
            .header(ID, format!("evil-{number}"));
        assert_eq!(request.send().await.unwrap().status().as_u16(), 403);
    }
    let text = String::from_utf8(log.0.lock().unwrap().clone()).unwrap();
    let lines = text.lines().filter(|line| line.contains("a request is refused"));
    let lines: Vec<&str> = lines.filter(|line| line.contains("{id=evil-")).collect();
    assert_eq!(lines.len(), 1, "{text}");
    for part in [
        "WARN request{id=evil-0}",
        "reason=\"origin\"",
        "address=127.0.0.1",
        "held_back=0",
    ] {
        assert!(lines[0].contains(part), "{part} is not in {}", lines[0]);
    }
}
