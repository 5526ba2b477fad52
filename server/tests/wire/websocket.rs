//! Streams over WebSocket: the same conversation as over gRPC, as JSON text or as protobuf.

use std::time::Duration;

use futures_util::{SinkExt as _, StreamExt as _};
use prost::Message as _;
use reqwest::StatusCode;
use serde_json::json;
use tokio::net::{TcpSocket, TcpStream};
use tokio::time::timeout;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::protocol::CloseFrame;
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, client_async, connect_async};
use troupe_proto::v1;
use troupe_proto::v1::drive_request::Message as Ask;
use troupe_proto::v1::drive_response::Message as Say;
use troupe_server::api::ErrorBody;

use crate::common::calls::{ids, open, options, walk};
use crate::common::{JOINTS, TestServer, robot};

pub(super) struct Socket(WebSocketStream<MaybeTlsStream<TcpStream>>);

impl Socket {
    pub(super) async fn connect(server: &TestServer) -> Self {
        let url = server.url("/v1/drive").replace("http", "ws");
        Self(connect_async(url).await.unwrap().0)
    }

    pub(super) async fn text(&mut self, message: serde_json::Value) {
        self.0
            .send(Message::Text(message.to_string().into()))
            .await
            .unwrap();
    }

    pub(super) async fn binary(&mut self, message: Ask) {
        let bytes = v1::DriveRequest {
            message: Some(message),
        }
        .encode_to_vec();
        self.0.send(Message::Binary(bytes.into())).await.unwrap();
    }

    pub(super) async fn next(&mut self) -> Message {
        loop {
            let next = timeout(Duration::from_secs(10), self.0.next())
                .await
                .expect("in time");
            match next.expect("a message").unwrap() {
                Message::Ping(_) | Message::Pong(_) => {}
                other => return other,
            }
        }
    }

    /// The next answer as text, frames left out unless they are wanted.
    pub(super) async fn said(&mut self, frames: bool) -> Say {
        loop {
            let Message::Text(text) = self.next().await else {
                panic!("not text");
            };
            let said: v1::DriveResponse = serde_json::from_str(&text).unwrap();
            match said.message.unwrap() {
                Say::Frames(_) if !frames => {}
                other => return other,
            }
        }
    }

    /// The stream's reason to close, and the socket's.
    async fn closed(&mut self) -> (v1::Problem, CloseFrame) {
        let Say::Closing(closing) = self.said(false).await else {
            panic!("not closing");
        };
        let Message::Close(Some(frame)) = self.next().await else {
            panic!("no close frame");
        };
        (closing.reason.unwrap(), frame)
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn json_text_drives_a_robot_in_qpos() {
    let folder = robot::Folder::new("socket");
    let server = robot::start(&folder).await;
    let sessions = vec![v1::SessionOptions {
        pack: robot::G1.into(),
        ..options("r")
    }];
    let request = v1::CreateSessionsRequest { sessions };
    server.sessions().await.create_sessions(request).await.unwrap();
    let mut socket = Socket::connect(&server).await;
    socket.text(json!({ "open": { "encoding": "qpos" } })).await;
    socket.text(json!({ "attach": { "session_ids": ["r"] } })).await;
    assert!(matches!(socket.said(false).await, Say::Attached(of) if of.problems.is_empty()));
    let Say::Frames(frames) = socket.said(true).await else {
        panic!("no frames");
    };
    assert_eq!(frames.blocks[0].qpos.len(), robot::QPOS);
    assert!(frames.blocks[0].rotations.is_empty());
}

#[tokio::test(flavor = "multi_thread")]
async fn json_text_drives_sessions() {
    let server = TestServer::start().await;
    let names = ids("w", 2);
    open(&mut server.sessions().await, &names).await;
    let mut socket = Socket::connect(&server).await;
    socket
        .text(json!({ "open": { "rate_hz": 60, "encoding": "compact" } }))
        .await;
    socket
        .text(json!({ "attach": { "session_ids": ["w-0", "ghost", "w-1"] } }))
        .await;
    let Say::Attached(attached) = socket.said(false).await else {
        panic!("not attached");
    };
    let slots: Vec<_> = attached
        .sessions
        .iter()
        .map(|s| (s.session_id.as_str(), s.slot))
        .collect();
    assert_eq!(slots, [("w-0", 0), ("w-1", 1)]);
    assert_eq!(
        attached.problems[0].problem.as_ref().unwrap().reason,
        "UNKNOWN_SESSION"
    );
    let walk = json!({ "session_id": "w-1", "sequence": 1, "locomote": { "velocity": { "z": 1.2 } } });
    socket
        .text(json!({ "command": { "commands": [walk, walk] } }))
        .await;
    let Say::Commands(results) = socket.said(false).await else {
        panic!("no results");
    };
    assert_eq!(results.results[0].status(), v1::CommandStatus::Repeated);
    let mut last = None;
    for _ in 0..40 {
        let Say::Frames(frames) = socket.said(true).await else {
            panic!("no frames");
        };
        assert!(last.is_none_or(|last| frames.tick > last));
        last = Some(frames.tick);
        let block = &frames.blocks[0];
        assert_eq!(
            (block.slots.as_slice(), block.packed_roots.len()),
            ([0, 1].as_slice(), 24)
        );
        assert_eq!(block.packed_rotations.len(), 2 * JOINTS * 6);
    }
    socket.text(json!({ "detach": { "session_ids": ["w-0"] } })).await;
    assert!(matches!(socket.said(false).await, Say::Left(_)));

    socket.0.send(Message::Close(None)).await.unwrap();
    while let Some(Ok(_)) = timeout(Duration::from_secs(5), socket.0.next()).await.unwrap() {}
    server.metric("troupe_streams_active", "0").await;
    server
        .metric(r#"troupe_requests_total{rpc="Drive",code="OK"}"#, "1")
        .await;
    let session: v1::Session = server.get("/v1/sessions/w-1").await.json().await.unwrap();
    assert_eq!((session.clock(), session.last_sequence), (v1::Clock::Free, 1));
}

#[tokio::test(flavor = "multi_thread")]
async fn protobuf_is_answered_in_protobuf() {
    let server = TestServer::start().await;
    open(&mut server.sessions().await, &["w"]).await;
    let mut socket = Socket::connect(&server).await;
    socket.binary(Ask::Open(v1::DriveOpen::default())).await;
    let session_ids = vec!["w".to_owned()];
    socket.binary(Ask::Attach(v1::DriveAttach { session_ids })).await;
    let commands = vec![walk("w", 1, (0.0, 1.0))];
    socket.binary(Ask::Command(v1::CommandRequest { commands })).await;
    let mut names = Vec::new();
    while names.len() < 5 {
        let Message::Binary(bytes) = socket.next().await else {
            panic!("not binary");
        };
        names.push(match v1::DriveResponse::decode(bytes).unwrap().message.unwrap() {
            Say::Attached(_) => "attached",
            Say::Frames(_) => "frames",
            other => panic!("{other:?}"),
        });
    }
    assert_eq!(names, ["attached", "frames", "frames", "frames", "frames"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_makes_no_sense_closes_with_a_clear_reason() {
    let server = TestServer::start().await;
    let cases: [(Message, &str, &str); 8] = [
        (
            Message::Text("{\"massage\":{\"open\":{}}}".into()),
            "massage",
            "unknown field `massage`",
        ),
        (Message::Text("null".into()), "body", "null"),
        (
            Message::Text("{\"open\":{\"rate\":30}}".into()),
            "open.rate",
            "unknown field `rate`",
        ),
        (Message::Text("{\"open\":".into()), "body", "is truncated"),
        (Message::Text("{\"attach\":{}}".into()), "message", "is not open"),
        (
            Message::Text("{\"open\":{\"encoding\":\"f16\"}}".into()),
            "open.encoding",
            "`ENCODING_F32`, `ENCODING_COMPACT`",
        ),
        (
            Message::Text("{\"open\":{\"rate_hz\":24}}".into()),
            "open.rate_hz",
            "30, 50 or 60",
        ),
        (
            Message::Text("x".repeat(3 << 20).into()),
            "body",
            "at most 2097152 bytes",
        ),
    ];
    for (message, field, says) in cases {
        let mut socket = Socket::connect(&server).await;
        // The server may close before it has read the whole of a large message.
        let _ = socket.0.send(message).await;
        let (reason, frame) = socket.closed().await;
        assert_eq!(
            (reason.reason.as_str(), reason.field.as_str()),
            ("INVALID_REQUEST", field),
            "{reason:?}"
        );
        assert!(
            reason.message.contains(says) || reason.allowed.contains(says),
            "{reason:?}"
        );
        assert_eq!(u16::from(frame.code), 1008);
        assert!(frame.reason.starts_with("INVALID_REQUEST: "), "{frame:?}");
    }
    let mut socket = Socket::connect(&server).await;
    socket
        .0
        .send(Message::Binary(vec![0xff; 40].into()))
        .await
        .unwrap();
    let Message::Binary(bytes) = socket.next().await else {
        panic!("not in kind");
    };
    let Some(Say::Closing(closing)) = v1::DriveResponse::decode(bytes).unwrap().message else {
        panic!("not closing");
    };
    assert_eq!(closing.reason.unwrap().reason, "INVALID_REQUEST");
    server.metric("troupe_streams_active", "0").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_that_vanishes_frees_its_sessions() {
    let server = TestServer::start().await;
    open(&mut server.sessions().await, &["w"]).await;
    let mut socket = Socket::connect(&server).await;
    socket.text(json!({ "open": { "close_sessions": true } })).await;
    socket.text(json!({ "attach": { "session_ids": ["w"] } })).await;
    socket.said(true).await;
    drop(socket);
    server.metric("troupe_streams_active", "0").await;
    assert_eq!(server.handle.service().sessions().open(), 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_reader_that_reads_nothing_is_closed() {
    let server =
        TestServer::start_with(|config| config.fixed.reader_timeout = Duration::from_millis(1000)).await;
    let names = ids("w", 500);
    open(&mut server.sessions().await, &names).await;
    // Little room on the way, and much to say: the system's buffers are soon full.
    let tcp = TcpSocket::new_v4().unwrap();
    tcp.set_recv_buffer_size(4096).unwrap();
    let tcp = tcp.connect(server.handle.address()).await.unwrap();
    let url = server.url("/v1/drive").replace("http", "ws");
    let mut socket = Socket(client_async(url, MaybeTlsStream::Plain(tcp)).await.unwrap().0);
    socket
        .text(json!({ "open": { "rate_hz": 60, "return_positions": true } }))
        .await;
    socket.text(json!({ "attach": { "session_ids": names } })).await;
    server.metric("troupe_streams_active", "1").await;
    let closed = async {
        while server
            .handle
            .service()
            .telemetry()
            .render()
            .contains("troupe_streams_active 1")
        {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    };
    timeout(Duration::from_secs(30), closed)
        .await
        .expect("it is closed");
    let session: v1::Session = server.get("/v1/sessions/w-0").await.json().await.unwrap();
    assert_eq!(session.clock(), v1::Clock::Free);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_drain_ends_open_sockets() {
    let server = TestServer::start().await;
    open(&mut server.sessions().await, &["w"]).await;
    let mut socket = Socket::connect(&server).await;
    socket.text(json!({ "open": {} })).await;
    socket.text(json!({ "attach": { "session_ids": ["w"] } })).await;
    socket.said(true).await;
    let stopping = tokio::spawn(timeout(Duration::from_secs(8), server.handle.shut_down()));
    let (reason, frame) = socket.closed().await;
    assert_eq!(
        (reason.reason.as_str(), u16::from(frame.code)),
        ("DRAINING", 1001)
    );
    drop(socket);
    assert!(stopping.await.unwrap().unwrap(), "the stop is clean");
}

#[tokio::test]
async fn a_request_that_is_no_socket_gets_an_error() {
    let server = TestServer::start_with(|config| {
        config.max_streams = 1;
        config.fixed.max_streams_per_client = Some(100);
    })
    .await;
    let response = server.get("/v1/drive").await;
    assert_eq!(response.status(), StatusCode::BAD_REQUEST);
    let body: ErrorBody = response.json().await.unwrap();
    assert!(body.error.message.contains("takes a WebSocket"), "{body:?}");
    let _socket = Socket::connect(&server).await;
    let url = server.url("/v1/drive").replace("http", "ws");
    match connect_async(url).await.unwrap_err() {
        tokio_tungstenite::tungstenite::Error::Http(response) => assert_eq!(response.status(), 429),
        other => panic!("{other}"),
    }
}
