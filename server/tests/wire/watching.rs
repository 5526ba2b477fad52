//! Streams that watch another one, over WebSocket.

use std::collections::BTreeMap;

use prost::Message as _;
use tokio_tungstenite::tungstenite::{Bytes, Message};
use troupe_proto::v1;
use troupe_proto::v1::drive_request::Message as Ask;
use troupe_proto::v1::drive_response::Message as Say;

use super::websocket::Socket;
use crate::common::TestServer;
use crate::common::calls::{ids, open, walk};

fn read(bytes: &Bytes) -> Say {
    let response = v1::DriveResponse::decode(bytes.clone()).unwrap();
    response.message.unwrap()
}

async fn bytes(socket: &mut Socket) -> Bytes {
    match socket.next().await {
        Message::Binary(bytes) => bytes,
        other => panic!("{other:?}"),
    }
}

/// The next answer that is no frames.
async fn control(socket: &mut Socket) -> Say {
    loop {
        match read(&bytes(socket).await) {
            Say::Frames(_) => {}
            other => return other,
        }
    }
}

async fn driving(server: &TestServer, ids: &[String]) -> Socket {
    let mut socket = Socket::connect(server).await;
    let encoding = v1::Encoding::Compact.into();
    let opened = v1::DriveOpen {
        encoding,
        ..v1::DriveOpen::default()
    };
    socket.binary(Ask::Open(opened)).await;
    attach(&mut socket, ids).await;
    socket
}

async fn attach(socket: &mut Socket, ids: &[String]) {
    let session_ids = ids.to_vec();
    socket.binary(Ask::Attach(v1::DriveAttach { session_ids })).await;
    let Say::Attached(attached) = control(socket).await else {
        panic!("not attached");
    };
    assert!(attached.problems.is_empty(), "{attached:?}");
}

async fn watch(server: &TestServer, id: &str) -> Socket {
    let mut socket = Socket::connect(server).await;
    socket.binary(Ask::Open(watched(id))).await;
    socket
}

fn watched(id: &str) -> v1::DriveOpen {
    v1::DriveOpen {
        watch: id.to_owned(),
        ..v1::DriveOpen::default()
    }
}

async fn attached(socket: &mut Socket) -> Vec<(String, u32)> {
    match control(socket).await {
        Say::Attached(attached) => {
            let sessions = attached.sessions.into_iter();
            sessions.map(|of| (of.session_id, of.slot)).collect()
        }
        other => panic!("{other:?}"),
    }
}

async fn refusal(socket: &mut Socket) -> v1::Problem {
    match control(socket).await {
        Say::Closing(closing) => closing.reason.unwrap(),
        other => panic!("{other:?}"),
    }
}

/// The bytes of so many ticks, by number.
async fn ticks(socket: &mut Socket, count: usize) -> BTreeMap<u64, Bytes> {
    let mut ticks = BTreeMap::new();
    while ticks.len() < count {
        let bytes = bytes(socket).await;
        if let Say::Frames(frames) = read(&bytes) {
            ticks.insert(frames.tick, bytes);
        }
    }
    ticks
}

#[tokio::test(flavor = "multi_thread")]
async fn all_who_watch_read_what_its_client_reads() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    let names = ids("w", 3);
    open(&mut client, &names).await;
    let mut own = driving(&server, &names[..2]).await;
    let mut watchers = [watch(&server, "w-0").await, watch(&server, "w-1").await];
    for watcher in &mut watchers {
        assert_eq!(attached(watcher).await, [("w-0".into(), 0), ("w-1".into(), 1)]);
    }
    // A command of one who watches counts.
    let commands = vec![walk("w-1", 1, (0.0, 1.2))];
    watchers[0]
        .binary(Ask::Command(v1::CommandRequest { commands }))
        .await;
    let seen = ticks(&mut own, 40).await;
    let mut same = 0;
    for watcher in &mut watchers {
        for (number, bytes) in ticks(watcher, 30).await {
            if let Some(own) = seen.get(&number) {
                assert_eq!(own, &bytes, "tick {number}");
                same += 1;
            }
        }
    }
    assert!(same > 20, "{same} ticks that both saw");
    let Say::Frames(last) = read(seen.values().next_back().unwrap()) else {
        panic!("no frames");
    };
    let roots = &last.blocks[0].packed_roots;
    let z = i32::from_le_bytes(roots[20..24].try_into().unwrap());
    assert!(z > 2_000, "{z} tenths of a millimetre ahead");

    // Watchers hear of sessions that come and go.
    attach(&mut own, &names[2..]).await;
    let session_ids = vec!["w-0".to_owned()];
    own.binary(Ask::Detach(v1::DriveDetach { session_ids })).await;
    for watcher in &mut watchers {
        assert_eq!(attached(watcher).await, [("w-2".into(), 2)]);
        let Say::Left(left) = control(watcher).await else {
            panic!("no session left");
        };
        assert_eq!(left.sessions[0].session_id, "w-0");
    }
    let mut late = watch(&server, "w-2").await;
    assert_eq!(attached(&mut late).await, [("w-1".into(), 1), ("w-2".into(), 2)]);

    drop(own);
    for watcher in watchers.iter_mut().chain([&mut late]) {
        assert_eq!(refusal(watcher).await.reason, "WATCHED_ENDED");
    }
    // Sessions were never in the hands of those who watched.
    let mut again = driving(&server, &names).await;
    ticks(&mut again, 2).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_watched_is_refused_with_its_field() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    let names = ids("w", 2);
    open(&mut client, &names).await;
    let _own = driving(&server, &names[..1]).await;
    // An unknown session; a session that no stream drives.
    for id in ["ghost", "w-1"] {
        let problem = refusal(&mut watch(&server, id).await).await;
        assert_eq!(
            (problem.reason.as_str(), problem.field.as_str()),
            ("INVALID_REQUEST", "open.watch"),
            "{id}: {problem:?}"
        );
    }
    let mut socket = Socket::connect(&server).await;
    let opened = v1::DriveOpen {
        rate_hz: 60,
        ..watched("w-0")
    };
    socket.binary(Ask::Open(opened)).await;
    assert_eq!(refusal(&mut socket).await.field, "open.rate_hz");

    let mut watcher = watch(&server, "w-0").await;
    attached(&mut watcher).await;
    let session_ids = vec!["w-1".to_owned()];
    watcher.binary(Ask::Attach(v1::DriveAttach { session_ids })).await;
    assert_eq!(refusal(&mut watcher).await.field, "message");
}
