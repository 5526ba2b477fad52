//! The attacks. Each prepares itself, goes on for a time, and reports what it achieved.

use std::convert::Infallible;
use std::time::Duration;

use bytes::Bytes;
use http_body_util::StreamBody;
use http_body_util::combinators::UnsyncBoxBody;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;
use tokio::sync::mpsc;
use tokio::task::JoinSet;
use tokio::time::{Instant, sleep, sleep_until, timeout, timeout_at};
use tokio_stream::StreamExt as _;
use tokio_stream::wrappers::ReceiverStream;
use tonic::client::Grpc;
use tonic::codegen::Service as _;
use tonic::transport::Channel;
use tonic_prost::ProstCodec;
use troupe_proto::v1;
use troupe_proto::v1::drive_response::Message as Say;

use super::common::TestServer;
use super::common::attacks::{answer, begin, create, in_the_pile, interactions, large_step, pile, put_pile};
use super::common::calls::{Client, drive, ids, options};
use super::common::scenes::{put_scene, scenes};

/// Sessions of one call, at most.
const CHUNK: usize = 1024;
/// A piece of a large body.
const PIECE: Bytes = Bytes::from_static(&[b' '; 65_536]);
/// Size of bodies that are held open: as large as a request may be. The last piece is not sent.
const BODY_BYTES: usize = 16 << 20;

/// Two streams of 256 sessions, in a scene of 512 hulls on each other.
pub async fn hulls(server: TestServer, time: Duration) -> String {
    put_pile(&server, 512, 0).await;
    crowd(server, time, 2, 256).await
}

/// 128 streams of 4 sessions in the same scene, all of an address.
pub async fn streams(server: TestServer, time: Duration) -> String {
    put_pile(&server, 512, 0).await;
    crowd(server, time, 128, 4).await
}

async fn crowd(server: TestServer, time: Duration, streams: usize, sessions: usize) -> String {
    let mut attacker = server.sessions().await;
    let mut ends = Vec::new();
    for stream in 0..streams {
        let names = ids(&format!("s{stream}"), sessions);
        create(&mut attacker, in_the_pile(&names)).await;
        ends.push(drive(&mut attacker, &names).await);
    }
    let until = Instant::now() + time;
    let mut tasks = JoinSet::new();
    for (ask, mut answers) in ends {
        tasks.spawn(async move {
            let (_ask, mut seen, mut dropped) = (ask, 0, 0);
            while let Ok(Ok(Some(answer))) = timeout_at(until, answers.message()).await {
                if let Some(Say::Frames(frames)) = answer.message {
                    (seen, dropped) = (seen + 1, frames.dropped_ticks);
                }
            }
            (seen, dropped)
        });
    }
    let all = tasks.join_all().await;
    let (seen, dropped) = all
        .iter()
        .fold((0_u64, 0), |sum, one| (sum.0 + one.0, sum.1 + one.1));
    format!("{seen} ticks, {dropped} dropped")
}

/// Steps in which 512 sessions begin to use objects. The scene has 2,048 objects and 256 hulls.
pub async fn interact(server: TestServer, time: Duration) -> String {
    put_pile(&server, 256, 2048).await;
    let mut attacker = server.sessions().await;
    let names = ids("a", 512);
    create(&mut attacker, in_the_pile(&names)).await;
    let mut request = interactions(&names, 2048);
    let mut sequence = 0;
    steps(attacker, time, || {
        sequence += 1;
        for command in &mut request.commands {
            command.sequence = sequence;
        }
        request.clone()
    })
    .await
}

/// Steps of 1,024 sessions over 30 frames, in a scene that is full.
pub async fn long_step(server: TestServer, time: Duration) -> String {
    put_pile(&server, 1024, 0).await;
    let mut attacker = server.sessions().await;
    let names = ids("a", 1024);
    for some in names.chunks(64) {
        create(&mut attacker, in_the_pile(some)).await;
    }
    let request = v1::StepRequest {
        session_ids: names,
        frames: 30,
        ..v1::StepRequest::default()
    };
    steps(attacker, time, || request.clone()).await
}

/// Makes one step after the other.
async fn steps(mut client: Client, time: Duration, mut request: impl FnMut() -> v1::StepRequest) -> String {
    let until = Instant::now() + time;
    let (mut answered, mut refused, mut longest) = (0, Vec::new(), Duration::ZERO);
    loop {
        let asked = Instant::now();
        let Ok(answer) = timeout_at(until, client.step(request())).await else {
            longest = longest.max(asked.elapsed());
            break;
        };
        longest = longest.max(asked.elapsed());
        match answer {
            Ok(_) => answered += 1,
            Err(status) => refused.push(status.code()),
        }
    }
    format!("{answered} steps, the longest {longest:.1?}, refused: {refused:?}")
}

/// Opens sessions that stand, as many in a call as the server allows.
async fn stand(server: &TestServer, names: &[String]) {
    let mut client = server.sessions().await;
    for some in names.chunks(CHUNK) {
        create(&mut client, some.iter().map(|id| options(id)).collect()).await;
    }
}

/// Eight clients ask for a step whose JSON has hundreds of megabytes, and read none of it.
pub async fn large_answers(server: TestServer, time: Duration) -> String {
    let mut silent = Vec::new();
    for nth in 0..8 {
        let (by, names) = (server.by(nth), ids(&format!("h{nth}"), 1024));
        stand(&by, &names).await;
        let body = large_step(&names);
        silent.push(begin(&by, "/v1/step", body.len(), &body).await);
    }
    sleep(time).await;
    let mut heads = Vec::new();
    for stream in &mut silent {
        heads.push(answer(stream).await);
    }
    let count = |start: &str| heads.iter().filter(|head| head.starts_with(start)).count();
    let (served, refused) = (count("HTTP/1.1 200"), count("HTTP/1.1 429"));
    format!("{served} answers begun, {refused} refused")
}

/// Eight clients ask for a large step over gRPC, with the smallest window, and read none of it.
pub async fn unread(server: TestServer, time: Duration) -> String {
    let mut tasks = JoinSet::new();
    for nth in 0..8 {
        let (by, names) = (server.by(nth), ids(&format!("g{nth}"), 1024));
        stand(&by, &names).await;
        tasks.spawn(async move {
            let endpoint = by.endpoint().initial_stream_window_size(65_535);
            let mut grpc = Grpc::new(endpoint.connect().await.unwrap());
            let request = v1::StepRequest {
                session_ids: names,
                frames: 120,
                return_positions: true,
                return_six_d: true,
                ..v1::StepRequest::default()
            };
            grpc.ready().await.unwrap();
            let codec = ProstCodec::<v1::StepRequest, v1::StepResponse>::default();
            let path = http::uri::PathAndQuery::from_static("/troupe.v1.Sessions/Step");
            let until = Instant::now() + time;
            // As a stream, whose messages are never taken.
            let answer = grpc.server_streaming(tonic::Request::new(request), path, codec);
            let answer = timeout_at(until, answer).await;
            sleep_until(until).await;
            match answer {
                Ok(Ok(_held)) => "begun".to_owned(),
                Ok(Err(status)) => format!("{:?}", status.code()),
                Err(_) => "none yet".to_owned(),
            }
        });
    }
    format!("answers: {:?}", tasks.join_all().await)
}

/// 100 bodies on one HTTP/2 connection that never end.
pub async fn bodies(server: TestServer, time: Duration) -> String {
    let channel = server.channel().await;
    let until = Instant::now() + time;
    let mut tasks = JoinSet::new();
    for _ in 0..100 {
        tasks.spawn(hold_open(channel.clone(), until));
    }
    let all = tasks.join_all().await;
    let refused = all.iter().filter(|status| status.is_some()).count();
    let first = all.iter().flatten().next();
    format!("{refused} of 100 refused, the first with {first:?}")
}

/// Sends a body without its end, and gives the status if an answer comes all the same.
async fn hold_open(mut channel: Channel, until: Instant) -> Option<u16> {
    let (pieces, queue) = mpsc::channel::<Bytes>(1);
    let frames = ReceiverStream::new(queue).map(|piece| Ok::<_, Infallible>(http_body::Frame::data(piece)));
    let body = UnsyncBoxBody::new(StreamBody::new(frames));
    let feed = tokio::spawn(async move {
        for _ in 0..BODY_BYTES / PIECE.len() - 1 {
            if pieces.send(PIECE).await.is_err() {
                return;
            }
        }
        sleep_until(until).await;
    });
    let request = http::Request::post("/v1/inbetween")
        .header("content-type", "application/json")
        .body(tonic::body::Body::new(body))
        .unwrap();
    std::future::poll_fn(|cx| channel.poll_ready(cx)).await.unwrap();
    let answer = timeout_at(until, channel.call(request)).await;
    feed.abort();
    let answer = answer.ok()?.ok()?;
    Some(answer.status().as_u16())
}

/// 256 full scenes, or as many as the server takes.
pub async fn many_scenes(server: TestServer, time: Duration) -> String {
    let mut client = scenes(&server).await;
    let text = pile(1024, 0);
    let (mut accepted, mut refused) = (0, None);
    while accepted < 256 && refused.is_none() {
        let text = text.replace("name = \"pile\"", &format!("name = \"pile-{accepted}\""));
        match put_scene(&mut client, &text).await {
            Ok(_) => accepted += 1,
            Err(status) => refused = Some(status.code()),
        }
    }
    sleep(time).await;
    format!("{accepted} accepted, the next: {refused:?}")
}

/// All sessions that a server can have, for a day each. Another client asks for one every second.
pub async fn sessions(server: TestServer, time: Duration) -> String {
    let mut client = server.sessions().await;
    let names = ids("day", 16_384);
    let (mut opened, mut refused) = (0, None);
    for some in names.chunks(CHUNK) {
        let day = |id: &String| v1::SessionOptions {
            ttl_ms: Some(86_400_000),
            ..options(id)
        };
        let sessions = some.iter().map(day).collect();
        match client
            .create_sessions(v1::CreateSessionsRequest { sessions })
            .await
        {
            Ok(_) => opened += some.len(),
            Err(status) => refused = Some(status.code()),
        }
    }
    let (until, mut other) = (Instant::now() + time, server.by(1).sessions().await);
    let (mut found, mut tried) = (0, 0);
    while Instant::now() < until {
        tried += 1;
        let sessions = vec![options(&format!("other-{tried}"))];
        let request = v1::CreateSessionsRequest { sessions };
        found += usize::from(other.create_sessions(request).await.is_ok());
        sleep(Duration::from_secs(1)).await;
    }
    format!("{opened} opened, refused: {refused:?}; another client got {found} of {tried}")
}

/// A thousand connections that send their headers letter by letter.
pub async fn slow_headers(server: TestServer, time: Duration) -> String {
    let until = Instant::now() + time;
    let mut tasks = JoinSet::new();
    for _ in 0..1000 {
        tasks.spawn(async move {
            let mut stream = server.tcp().await;
            let head = b"GET /healthz HTTP/1.1\r\nhost: localhost\r\nx-slow: ".iter();
            for letter in head.chain(std::iter::repeat(&b'.')) {
                if Instant::now() > until {
                    return false;
                }
                if stream.write_all(&[*letter]).await.is_err() || is_closed(&mut stream).await {
                    return true;
                }
                sleep(Duration::from_millis(250)).await;
            }
            false
        });
    }
    let cut = tasks.join_all().await.into_iter().filter(|cut| *cut).count();
    format!("{cut} of 1000 cut")
}

/// Whether the server has closed the connection or answered.
async fn is_closed(stream: &mut TcpStream) -> bool {
    timeout(Duration::from_millis(1), stream.read(&mut [0; 256]))
        .await
        .is_ok()
}

/// As many connections as an address may have, and then more, as fast as they open.
pub async fn flood(server: TestServer, time: Duration) -> String {
    let mut held = Vec::new();
    for _ in 0..1024 {
        held.extend(server.try_tcp().await);
    }
    let until = Instant::now() + time;
    let mut tasks = JoinSet::new();
    for _ in 0..8 {
        tasks.spawn(async move {
            let (mut tried, mut closed) = (0_u64, 0_u64);
            while Instant::now() < until {
                tried += 1;
                let Ok(mut stream) = server.try_tcp().await else {
                    sleep(Duration::from_millis(1)).await;
                    continue;
                };
                // The server may also reset it before the first byte.
                let read = timeout(Duration::from_secs(1), stream.read(&mut [0; 16])).await;
                closed += u64::from(matches!(read, Ok(Ok(0) | Err(_))));
            }
            (tried, closed)
        });
    }
    let all = tasks.join_all().await;
    let (tried, closed) = all.iter().fold((0, 0), |sum, one| (sum.0 + one.0, sum.1 + one.1));
    format!("{} held, {closed} of {tried} more closed at once", held.len())
}

/// A thousand HTTP/2 connections without a request.
pub async fn idle(server: TestServer, time: Duration) -> String {
    let mut held = Vec::new();
    for _ in 0..1000 {
        held.extend(server.endpoint().connect().await);
    }
    sleep(time).await;
    format!("{} held", held.len())
}

/// Requests from a page of another site, each as soon as the one before is refused.
pub async fn origins(server: TestServer, time: Duration) -> String {
    let until = Instant::now() + time;
    let mut tasks = JoinSet::new();
    for _ in 0..32 {
        tasks.spawn(async move {
            let mut stream = server.tcp().await;
            let request =
                b"GET /v1/packs HTTP/1.1\r\nhost: localhost\r\norigin: https://elsewhere.example\r\n\r\n";
            let (mut refused, mut bytes) = (0_u64, vec![0; 4096]);
            while Instant::now() < until {
                stream.write_all(request).await.unwrap();
                let count = stream.read(&mut bytes).await.unwrap();
                refused += u64::from(bytes[..count].starts_with(b"HTTP/1.1 403"));
            }
            refused
        });
    }
    let refused: u64 = tasks.join_all().await.into_iter().sum();
    format!("{refused} refused")
}
