//! Quotas of keys, tickets for browsers, and the key for metrics.

use std::time::Duration;

use futures_util::StreamExt as _;
use http::StatusCode;
use serde_json::{Value, json};
use tokio_tungstenite::connect_async;
use tokio_tungstenite::tungstenite::client::IntoClientRequest as _;
use tokio_tungstenite::tungstenite::{self, http as ws_http};
use tonic::Code;
use troupe_edge::clients::Role;
use troupe_edge::keys;
use troupe_proto::v1;
use troupe_server::api::ErrorBody;
use troupe_server::config::WithoutKeys;

use crate::common::calls::options;
use crate::common::{TestServer, request};

type Socket = tokio_tungstenite::WebSocketStream<tokio_tungstenite::MaybeTlsStream<tokio::net::TcpStream>>;

/// A server with a file of keys, and what it takes to ask it.
struct Keyed {
    server: TestServer,
    folder: tempfile::TempDir,
}

impl Keyed {
    /// Each key has a name, a role, and more lines of its entry.
    async fn start(entries: &[(&str, Role, &str)]) -> (Self, Vec<String>) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("keys.toml");
        let mut text = String::new();
        let made = entries.iter().map(|(name, role, more)| {
            let key = keys::new_key();
            text += &(keys::entry(name, *role, &key) + more);
            key
        });
        let made = made.collect();
        std::fs::write(&path, text).unwrap();
        let server = TestServer::start_with(|config| config.keys = Some(path)).await;
        (Self { server, folder }, made)
    }

    async fn post(&self, path: &str, key: &str, body: Option<Value>) -> (StatusCode, Value) {
        let call = reqwest::Client::new()
            .post(self.server.url(path))
            .bearer_auth(key);
        let call = match body {
            Some(body) => call.json(&body),
            None => call,
        };
        let response = call.send().await.unwrap();
        (response.status(), response.json().await.unwrap())
    }

    async fn create(&self, key: &str, ids: &[&str]) -> (StatusCode, Value) {
        let sessions: Vec<_> = ids.iter().map(|id| json!({ "id": id })).collect();
        self.post("/v1/sessions", key, Some(json!({ "sessions": sessions })))
            .await
    }

    /// Begins a stream; an error is the server's answer.
    async fn stream(&self, query: &str, headers: &[(&'static str, &str)]) -> Result<Socket, u16> {
        let url = self.server.url("/v1/drive").replace("http", "ws") + query;
        let mut request = url.into_client_request().unwrap();
        for (name, value) in headers {
            let value = ws_http::HeaderValue::from_str(value).unwrap();
            request.headers_mut().insert(*name, value);
        }
        match connect_async(request).await {
            Ok((stream, _)) => Ok(stream),
            Err(tungstenite::Error::Http(answer)) => Err(answer.status().as_u16()),
            Err(error) => panic!("{error}"),
        }
    }

    async fn ticket(&self, key: &str) -> String {
        let (status, body) = self.post("/v1/tickets", key, None).await;
        assert_eq!(
            (status, &body["expires_in_ms"]),
            (StatusCode::OK, &json!(30_000)),
            "{body}"
        );
        format!("?ticket={}", body["ticket"].as_str().unwrap())
    }
}

#[tokio::test]
async fn a_key_opens_as_many_sessions_as_its_quota() {
    let (small, large) = (
        ("small", Role::Drive, "max_sessions = 3\n"),
        ("large", Role::Drive, ""),
    );
    let (keyed, keys) = Keyed::start(&[small, large]).await;
    let [small, large] = [keys[0].as_str(), keys[1].as_str()];
    assert_eq!(keyed.create(small, &["a", "b"]).await.0, StatusCode::OK);
    let (status, body) = keyed.create(small, &["c", "d"]).await;
    assert_eq!(status, StatusCode::TOO_MANY_REQUESTS, "{body}");
    let message = body["error"]["message"].as_str().unwrap();
    for part in ["this key", "3 sessions (max_sessions of the key)"] {
        assert!(message.contains(part), "{part} is not in {message}");
    }
    assert_eq!(body["error"]["reason"], "CLIENT_LIMIT");
    // What fails takes no room, and others have their own.
    assert_eq!(keyed.create(small, &["a"]).await.0, StatusCode::CONFLICT);
    assert_eq!(keyed.create(large, &["e", "f", "g", "h"]).await.0, StatusCode::OK);
    assert_eq!(keyed.create(small, &["c"]).await.0, StatusCode::OK);

    // The same over gRPC, and what is closed is free again.
    let mut client = keyed.server.sessions().await;
    let mut create = async |id: &str| {
        let sessions = vec![options(id)];
        let mut call = tonic::Request::new(v1::CreateSessionsRequest { sessions });
        let bearer = format!("Bearer {small}").parse().unwrap();
        call.metadata_mut().insert("authorization", bearer);
        client.create_sessions(call).await
    };
    let status = create("i").await.unwrap_err();
    assert_eq!(status.code(), Code::ResourceExhausted);
    assert!(
        status.message().contains("max_sessions of the key"),
        "{}",
        status.message()
    );
    let call = reqwest::Client::new()
        .delete(keyed.server.url("/v1/sessions/b"))
        .bearer_auth(small);
    assert_eq!(call.send().await.unwrap().status(), StatusCode::OK);
    create("i").await.unwrap();
    // Nor do those count whose time is up.
    keyed.server.clock.pass(Duration::from_secs(120));
    assert_eq!(keyed.create(small, &["j", "k", "l"]).await.0, StatusCode::OK);
    let name = r#"troupe_client_refusals_total{kind="sessions",whose="key"}"#;
    keyed.server.metric(name, "2").await;
}

#[tokio::test]
async fn a_key_records_sessions_if_its_entry_says_so() {
    let entries = [
        ("never", Role::Drive, ""),
        ("asked", Role::Drive, "record = \"asked\"\n"),
        ("always", Role::Drive, "record = \"always\"\n"),
    ];
    let (keyed, keys) = Keyed::start(&entries).await;
    let [never, asked, always] = [keys[0].as_str(), keys[1].as_str(), keys[2].as_str()];
    let open = async |key: &str, record: bool| {
        let body = json!({ "sessions": [{ "record": record }] });
        keyed.post("/v1/sessions", key, Some(body)).await
    };
    let (status, body) = open(never, true).await;
    assert_eq!(
        (status, &body["error"]["field"]),
        (StatusCode::BAD_REQUEST, &json!("sessions[0].record")),
        "{body}"
    );
    for (key, record, recorded) in [
        (never, false, false),
        (asked, false, false),
        (asked, true, true),
        (always, false, true),
    ] {
        let (status, body) = open(key, record).await;
        assert_eq!(
            (status, &body["sessions"][0]["recorded"]),
            (StatusCode::OK, &json!(recorded)),
            "{body}"
        );
    }
}

#[tokio::test]
async fn a_key_has_streams_and_memory_by_its_quota() {
    let more = "max_streams = 1\ntransfer_memory_mib = 1\n";
    let (keyed, keys) = Keyed::start(&[("small", Role::Drive, more)]).await;
    let bearer = format!("Bearer {}", keys[0]);
    let headers = [("authorization", bearer.as_str())];
    let held = keyed
        .stream("", &headers)
        .await
        .unwrap_or_else(|status| panic!("{status}"));
    assert_eq!(keyed.stream("", &headers).await.err(), Some(429));
    drop(held);
    let freed = async {
        while keyed.stream("", &headers).await.is_err() {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    };
    tokio::time::timeout(Duration::from_secs(10), freed)
        .await
        .expect("the place is free again");

    let call = reqwest::Client::new()
        .post(keyed.server.url("/v1/inbetween"))
        .bearer_auth(&keys[0])
        .header("content-type", "application/json")
        .body(vec![b' '; 2 << 20]);
    let response = call.send().await.unwrap();
    assert_eq!(response.status(), StatusCode::TOO_MANY_REQUESTS);
    let error = response.json::<ErrorBody>().await.unwrap().error;
    assert!(
        error.message.contains("(transfer_memory_mib of the key)"),
        "{}",
        error.message
    );
}

#[tokio::test]
async fn a_removed_key_ends_its_streams() {
    let (gone, stays) = (("gone", Role::Drive, ""), ("stays", Role::Drive, ""));
    let (keyed, keys) = Keyed::start(&[gone, stays]).await;
    let bearers: Vec<String> = keys.iter().map(|key| format!("Bearer {key}")).collect();
    let open = async |bearer: &str| {
        let headers = [("authorization", bearer)];
        let stream = keyed.stream("", &headers).await;
        stream.unwrap_or_else(|status| panic!("{status}"))
    };
    let (mut socket, mut other) = (open(&bearers[0]).await, open(&bearers[1]).await);
    assert_eq!(keyed.create(&keys[0], &["a"]).await.0, StatusCode::OK);
    let mut client = keyed.server.sessions().await;
    let (ask, asked) = tokio::sync::mpsc::channel(8);
    let mut call = tonic::Request::new(tokio_stream::wrappers::ReceiverStream::new(asked));
    call.metadata_mut()
        .insert("authorization", bearers[0].parse().unwrap());
    for message in [
        v1::drive_request::Message::Open(v1::DriveOpen::default()),
        v1::drive_request::Message::Attach(v1::DriveAttach {
            session_ids: vec!["a".to_owned()],
        }),
    ] {
        let message = Some(message);
        ask.send(v1::DriveRequest { message }).await.unwrap();
    }
    let mut answers = client.drive(call).await.unwrap().into_inner();
    assert!(answers.message().await.unwrap().is_some());

    std::fs::write(
        keyed.folder.path().join("keys.toml"),
        keys::entry("stays", Role::Drive, &keys[1]),
    )
    .unwrap();
    let removed = std::time::Instant::now();
    let status = async {
        loop {
            match answers.message().await {
                Ok(Some(_)) => {}
                Ok(None) => panic!("the stream ended without a status"),
                Err(status) => return status,
            }
        }
    };
    let status = tokio::time::timeout(Duration::from_secs(5), status)
        .await
        .unwrap();
    // Half a second to the next look at the file, and what a busy machine adds.
    let took = removed.elapsed();
    assert!(took < Duration::from_millis(1500), "{took:?}");
    assert_eq!(status.code(), Code::Unauthenticated, "{status}");
    assert!(status.message().contains("the key was removed"), "{status}");
    let closed = async {
        loop {
            if let tungstenite::Message::Close(frame) = socket.next().await.unwrap().unwrap() {
                return frame.unwrap();
            }
        }
    };
    let frame = tokio::time::timeout(Duration::from_secs(5), closed)
        .await
        .unwrap();
    assert_eq!(u16::from(frame.code), 1008);
    assert!(
        frame.reason.starts_with("KEY_REMOVED: the key was removed"),
        "{frame}"
    );
    // The session is free, and the other key's stream goes on.
    drop(ask);
    let quiet = tokio::time::timeout(Duration::from_millis(300), other.next()).await;
    assert!(quiet.is_err(), "{quiet:?}");
}

#[tokio::test]
async fn a_ticket_opens_one_stream() {
    let (drive, metrics) = (("drive", Role::Drive, ""), ("metrics", Role::Metrics, ""));
    let (keyed, keys) = Keyed::start(&[drive, metrics]).await;
    assert_eq!(keyed.stream("", &[]).await.err(), Some(401));
    assert_eq!(keyed.stream("?ticket=ticket_0", &[]).await.err(), Some(401));
    let ticket = keyed.ticket(&keys[0]).await;
    // A page of another site cannot use it, and does not use it up.
    let foreign = [("origin", "https://evil.example")];
    assert_eq!(keyed.stream(&ticket, &foreign).await.err(), Some(403));
    let _stream = keyed
        .stream(&ticket, &[])
        .await
        .unwrap_or_else(|status| panic!("{status}"));
    assert_eq!(keyed.stream(&ticket, &[]).await.err(), Some(401));

    // It is for streams alone, and only keys that may drive get one.
    let ticket = keyed.ticket(&keys[0]).await;
    let response = keyed.server.get(&format!("/v1/packs{ticket}")).await;
    assert_eq!(response.status(), StatusCode::UNAUTHORIZED);
    assert_eq!(
        keyed.post("/v1/tickets", &keys[1], None).await.0,
        StatusCode::FORBIDDEN
    );
    let response = reqwest::Client::new()
        .post(keyed.server.url("/v1/tickets"))
        .send()
        .await
        .unwrap();
    assert_eq!(response.status(), StatusCode::UNAUTHORIZED);
}

#[tokio::test]
async fn a_ticket_counts_for_its_key() {
    let (keyed, keys) = Keyed::start(&[("small", Role::Drive, "max_streams = 1\n")]).await;
    let (first, second) = (keyed.ticket(&keys[0]).await, keyed.ticket(&keys[0]).await);
    let _held = keyed
        .stream(&first, &[])
        .await
        .unwrap_or_else(|status| panic!("{status}"));
    assert_eq!(keyed.stream(&second, &[]).await.err(), Some(429));
}

#[tokio::test]
async fn without_keys_there_are_no_tickets() {
    let server = TestServer::start().await;
    let response = reqwest::Client::new()
        .post(server.url("/v1/tickets"))
        .send()
        .await
        .unwrap();
    assert_eq!(response.status(), StatusCode::CONFLICT);
    let error = response.json::<ErrorBody>().await.unwrap().error;
    assert_eq!(error.reason, "NO_KEYS");
}

#[tokio::test]
async fn a_server_makes_a_key_for_its_metrics() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("metrics.key");
    for _ in 0..2 {
        // The second start finds the file of the first.
        let for_server = path.clone();
        let server = TestServer::start_with(|config| {
            config.without_keys = WithoutKeys::OneTimeKey;
            config.metrics_key = Some(for_server);
        })
        .await;
        let key = std::fs::read_to_string(&path).unwrap();
        let status = async |path: &str| {
            let call = reqwest::Client::new().get(server.url(path)).bearer_auth(&key);
            call.send().await.unwrap().status()
        };
        assert_eq!(status("/metrics").await, StatusCode::OK);
        assert_eq!(status("/v1/packs").await, StatusCode::FORBIDDEN);
        let mut call = tonic::Request::new(request(1));
        let bearer = format!("Bearer {key}").parse().unwrap();
        call.metadata_mut().insert("authorization", bearer);
        let status = server.grpc().await.in_between(call).await.unwrap_err();
        assert_eq!(status.code(), Code::PermissionDenied);
        assert!(
            status.message().contains("drive, author or admin"),
            "{}",
            status.message()
        );
        server.handle.shut_down().await;
    }
}
