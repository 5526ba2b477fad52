//! What one client may do to others, with default limits: attacker and victim on connections of
//! their own.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use prost::Message as _;
use tokio::io::AsyncWriteExt as _;
use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use tokio::time::timeout;
use tokio_stream::wrappers::ReceiverStream;
use troupe_proto::v1;
use troupe_proto::v1::drive_response::Message as Say;

use crate::common::attacks::{answer, begin, create, in_the_pile, interactions, large_step, put_pile};
use crate::common::calls::{drive, ids, options};
use crate::common::{TestServer, framed, request};

/// How long `/healthz` may take while somebody attacks.
const HEALTH_LIMIT: Duration = Duration::from_millis(100);
/// How long an attack goes on.
const ATTACK: Duration = Duration::from_secs(3);

/// Somebody who drives one character and asks how the server is.
struct Victim {
    stop: Arc<AtomicBool>,
    ticks: JoinHandle<(u64, u64)>,
    health: JoinHandle<Duration>,
}

impl Victim {
    async fn start(server: &TestServer) -> Self {
        let mut client = server.sessions().await;
        create(&mut client, vec![options("victim")]).await;
        let stop = Arc::new(AtomicBool::new(false));
        let (ask, mut answers) = drive(&mut client, &["victim".to_owned()]).await;
        let stopped = stop.clone();
        let ticks = tokio::spawn(async move {
            let _ask = ask;
            let (mut seen, mut dropped) = (0, 0);
            while !stopped.load(Ordering::Relaxed) {
                let answer = answers.message().await.unwrap().unwrap();
                if let Some(Say::Frames(frames)) = answer.message {
                    seen += 1;
                    dropped = frames.dropped_ticks;
                }
            }
            (seen, dropped)
        });
        let (url, stopped) = (server.url("/healthz"), stop.clone());
        let health = tokio::spawn(async move {
            let http = reqwest::Client::new();
            let mut worst = Duration::ZERO;
            while !stopped.load(Ordering::Relaxed) {
                let asked = Instant::now();
                http.get(&url).send().await.unwrap().error_for_status().unwrap();
                worst = worst.max(asked.elapsed());
                tokio::time::sleep(Duration::from_millis(10)).await;
            }
            worst
        });
        Self { stop, ticks, health }
    }

    /// Ends, and looks at what it went through.
    async fn unharmed(self) {
        self.stop.store(true, Ordering::Relaxed);
        let (seen, dropped) = self.ticks.await.unwrap();
        let worst = self.health.await.unwrap();
        println!("victim: {seen} ticks, {dropped} dropped; /healthz at most {worst:?}");
        assert!(seen > 30, "{seen} ticks");
        assert_eq!(dropped, 0, "of {seen}");
        assert!(worst <= HEALTH_LIMIT, "/healthz took {worst:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn crowds_in_a_scene_of_overlapping_hulls_cost_others_no_tick() {
    let server = TestServer::start().await;
    put_pile(&server, 512, 0).await;
    let mut attacker = server.sessions().await;
    let mut streams = Vec::new();
    for stream in ["a", "b"] {
        let names = ids(stream, 256);
        create(&mut attacker, in_the_pile(&names)).await;
        streams.push(drive(&mut attacker, &names).await);
    }
    let victim = Victim::start(&server).await;
    let until = Instant::now() + ATTACK;
    let attacks = streams.into_iter().map(|(ask, mut answers)| {
        tokio::spawn(async move {
            let _ask = ask;
            let mut late = 0;
            while Instant::now() < until {
                if let Some(Say::Frames(frames)) = answers.message().await.unwrap().unwrap().message {
                    late = frames.dropped_ticks;
                }
            }
            late
        })
    });
    for attack in attacks.collect::<Vec<_>>() {
        println!("an attacker's dropped ticks: {}", attack.await.unwrap());
    }
    victim.unharmed().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn many_streams_of_one_client_get_no_more_turns_than_one() {
    // Room for 200 streams of one address.
    let server = TestServer::start_with(|config| config.max_streams = 2048).await;
    put_pile(&server, 512, 0).await;
    let mut attacker = server.sessions().await;
    let mut streams = Vec::new();
    for stream in 0..200 {
        let names = ids(&format!("s{stream}"), 4);
        create(&mut attacker, in_the_pile(&names)).await;
        streams.push(drive(&mut attacker, &names).await);
    }
    let victim = Victim::start(&server).await;
    tokio::time::sleep(ATTACK).await;
    victim.unharmed().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_step_of_many_interactions_among_many_objects_delays_no_one() {
    let server = TestServer::start().await;
    put_pile(&server, 256, 2048).await;
    let mut attacker = server.sessions().await;
    let names = ids("a", 512);
    create(&mut attacker, in_the_pile(&names)).await;
    let victim = Victim::start(&server).await;
    let request = interactions(&names, 2048);
    let asked = Instant::now();
    let answer = timeout(ATTACK, attacker.step(request)).await;
    println!(
        "the attacker's step: {:?}, answered: {}",
        asked.elapsed(),
        answer.is_ok()
    );
    tokio::time::sleep(Duration::from_millis(1500)).await;
    victim.unharmed().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_step_ends_at_its_deadline() {
    let limit = Duration::from_millis(400);
    let server = TestServer::start_with(|config| config.request_timeout_ms = limit.as_millis() as u64).await;
    put_pile(&server, 256, 0).await;
    let mut attacker = server.sessions().await;
    let names = ids("a", 1024);
    for some in names.chunks(64) {
        create(&mut attacker, in_the_pile(some)).await;
    }
    let request = v1::StepRequest {
        session_ids: names,
        frames: 120,
        ..v1::StepRequest::default()
    };
    let asked = Instant::now();
    let answer = attacker.step(request).await;
    let late = asked.elapsed();
    assert_eq!(answer.unwrap_err().code(), tonic::Code::DeadlineExceeded);
    assert!(late < limit + HEALTH_LIMIT, "{late:?}");
}

/// Bytes of requests and answers on their way.
fn transfer(server: &TestServer) -> f64 {
    let text = server.handle.service().telemetry().render();
    let line = text
        .lines()
        .find(|line| line.starts_with("troupe_transfer_memory_bytes"));
    line.and_then(|line| line.rsplit(' ').next()?.parse().ok())
        .unwrap_or(0.0)
}

/// Waits until as much is on its way as is wanted.
async fn until_transfer(server: &TestServer, wanted: impl Fn(f64) -> bool) {
    let waiting = async {
        while !wanted(transfer(server)) {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    };
    let waited = timeout(Duration::from_secs(20), waiting).await;
    assert!(waited.is_ok(), "{} bytes are on their way", transfer(server));
}

#[tokio::test(flavor = "multi_thread")]
async fn bodies_that_are_held_open_take_a_bounded_share_of_memory() {
    // 32 MiB for all, 4 for an address and so for a connection.
    let server = TestServer::start_with(|config| config.transfer_memory_mib = 32).await;
    let body = vec![b' '; 1_900_000];
    let path = "/v1/inbetween";
    let mut greedy = begin(&server, path, 16 << 20, &body).await;
    for _ in 0..2 {
        // The server may have refused and closed before it has read everything.
        let _ = greedy.write_all(&body).await;
    }
    let refused = answer(&mut greedy).await;
    assert!(refused.starts_with("HTTP/1.1 429 "), "{refused}");
    assert!(
        refused.contains("CLIENT_LIMIT") && refused.contains("this client"),
        "{refused}"
    );
    drop(greedy);
    until_transfer(&server, |bytes| bytes == 0.0).await;
    let held = [
        begin(&server, path, 16 << 20, &body).await,
        begin(&server, path, 16 << 20, &body).await,
    ];
    until_transfer(&server, |bytes| bytes == 3_800_000.0).await;
    let mut third = begin(&server, path, 16 << 20, &body).await;
    let refused = answer(&mut third).await;
    assert!(
        refused.starts_with("HTTP/1.1 429 ") && refused.contains("this address"),
        "{refused}"
    );
    drop((held, third));
    until_transfer(&server, |bytes| bytes == 0.0).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_unread_answer_is_dropped() {
    let server =
        TestServer::start_with(|config| config.fixed.reader_timeout = Duration::from_millis(500)).await;
    let mut client = server.sessions().await;
    let names = ids("a", 512);
    create(&mut client, names.iter().map(|id| options(id)).collect()).await;
    let body = large_step(&names);
    let silent = begin(&server, "/v1/step", body.len(), &body).await;
    until_transfer(&server, |bytes| bytes > 1e6).await;
    until_transfer(&server, |bytes| bytes == 0.0).await;
    drop(silent);
    let request = v1::StepRequest {
        session_ids: names,
        frames: 120,
        ..v1::StepRequest::default()
    };
    assert!(client.step(request).await.is_ok(), "others are served, whole");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_answer_that_is_too_large_is_refused_before_it_is_made() {
    let server = TestServer::start_with(|config| config.transfer_memory_mib = 16).await;
    let mut client = server.sessions().await;
    let names = ids("a", 512);
    create(&mut client, names.iter().map(|id| options(id)).collect()).await;
    let request = |frames| v1::StepRequest {
        session_ids: names.clone(),
        frames,
        ..v1::StepRequest::default()
    };
    let error = client.step(request(120)).await.unwrap_err();
    assert_eq!(error.code(), tonic::Code::ResourceExhausted, "{error}");
    assert!(error.message().contains("this client has no memory"), "{error}");
    assert!(client.step(request(2)).await.is_ok());
    until_transfer(&server, |bytes| bytes == 0.0).await;
}

// Other systems have only one loopback address.
#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread")]
async fn streams_of_one_connection_leave_room_for_others() {
    let server = TestServer::start_with(|config| config.max_streams = 16).await;
    let mut one = server.sessions().await;
    let mut held = Vec::new();
    for _ in 0..2 {
        held.push(drive(&mut one, &["unknown".to_owned()]).await);
    }
    let (_ask, asked) = mpsc::channel(1);
    let error = one.drive(ReceiverStream::new(asked)).await.unwrap_err();
    assert_eq!(error.code(), tonic::Code::ResourceExhausted, "{error}");
    assert!(error.message().contains("2 streams"), "{error}");
    // Another connection of the address has no more, and another address its own.
    for (from, is_open) in [([127, 0, 0, 1], false), ([127, 0, 0, 2], true)] {
        let socket = tokio::net::TcpSocket::new_v4().unwrap();
        socket.bind((from, 0).into()).unwrap();
        let stream = socket.connect(server.handle.address()).await.unwrap();
        let url = server.url("/v1/drive").replace("http", "ws");
        let opened = tokio_tungstenite::client_async(url, stream).await;
        assert_eq!(opened.is_ok(), is_open, "{from:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn one_client_without_a_key_leaves_sessions_to_others() {
    let server = TestServer::start_with(|config| config.max_sessions = 80).await;
    let open = async |count: usize| {
        let mut client = server.sessions().await;
        let sessions = vec![v1::SessionOptions::default(); count];
        client
            .create_sessions(v1::CreateSessionsRequest { sessions })
            .await
    };
    // What a connection opened counts for its address when the connection is gone.
    let opened = open(10).await.unwrap().into_inner().sessions;
    let ids = opened.into_iter().map(|session| session.id).collect();
    let error = open(1).await.unwrap_err();
    assert_eq!(error.code(), tonic::Code::ResourceExhausted, "{error}");
    assert!(
        error.message().contains("10 sessions (a share of max_sessions)"),
        "{error}"
    );
    let closing = v1::CloseSessionsRequest { ids };
    server.sessions().await.close_sessions(closing).await.unwrap();
    open(10).await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn answers_that_a_client_has_no_window_for_take_a_bounded_share_of_memory() {
    // An address gets 128 KiB.
    let server = TestServer::start_with(|config| config.transfer_memory_mib = 1).await;
    let (client, connection) = h2::client::Builder::new()
        .initial_window_size(0)
        .handshake::<_, bytes::Bytes>(server.tcp().await)
        .await
        .unwrap();
    let connection = tokio::spawn(connection);
    let body = framed(&request(8).encode_to_vec());
    let mut client = client.ready().await.unwrap();
    let (mut held, mut refused) = (Vec::new(), 0);
    for _ in 0..40 {
        let call = http::Request::post(server.url("/troupe.v1.Motion/InBetween"))
            .header("content-type", "application/grpc")
            .header("te", "trailers")
            .body(())
            .unwrap();
        let (answer, mut sending) = client.send_request(call, false).unwrap();
        sending.send_data(body.clone().into(), true).unwrap();
        let answer = answer.await.unwrap();
        match answer.headers().get("grpc-status") {
            Some(status) => {
                assert_eq!(status, "8", "{answer:?}");
                refused += 1;
            }
            None => held.push(answer),
        }
    }
    println!(
        "{} answers are held, {} bytes; {refused} were refused",
        held.len(),
        transfer(&server)
    );
    assert!(refused > 0 && !held.is_empty());
    assert!((1e4..=131_072.0).contains(&transfer(&server)));
    drop((held, client));
    connection.abort();
    until_transfer(&server, |bytes| bytes == 0.0).await;
}
