//! More work than the engine can do: what is refused, what keeps its place, and what is left
//! afterwards.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use futures_util::future::join_all;
use prost::Message as _;
use reqwest::StatusCode;
use tokio::io::AsyncWriteExt as _;
use tokio::task::JoinSet;
use tokio::time::MissedTickBehavior;
use tonic::Code;
use tonic_types::StatusExt as _;
use troupe_proto::v1;

use crate::common::attacks::answer;
use crate::common::calls::{ids, open, step, stepped, walk};
use crate::common::{TestServer, framed, request};

/// Time of a row in the engine.
const ROW: Duration = Duration::from_millis(10);
const WORKERS: usize = 2;
/// Characters that the engine can do in a second.
const CAPACITY: usize = 200;
/// Longest expected wait of a call that is admitted.
const MAX_QUEUE: Duration = Duration::from_millis(150);

/// A server of [`CAPACITY`].
async fn slow_server() -> TestServer {
    let server = TestServer::start_with(|config| {
        config.workers = WORKERS;
        config.max_batch = 4;
        config.max_queue_ms = MAX_QUEUE.as_millis() as u64;
    })
    .await;
    server.gate.set_row_time(ROW);
    server
}

/// Result of the calls of a flood, and how long each took.
#[derive(Debug, Default)]
struct Flood {
    served: Vec<Duration>,
    refused: Vec<Duration>,
    /// The refusals' hints.
    hints: Vec<Duration>,
}

/// Calls of one character each, `rate` a second whatever their outcome, until `stop` is set.
async fn flood(server: &TestServer, rate: usize, stop: Arc<AtomicBool>) -> Flood {
    let mut channels = Vec::new();
    for _ in 0..4 {
        channels.push(server.grpc().await);
    }
    let mut ticks = tokio::time::interval(Duration::from_millis(5));
    ticks.set_missed_tick_behavior(MissedTickBehavior::Burst);
    let mut calls = JoinSet::new();
    while !stop.load(Ordering::Relaxed) {
        ticks.tick().await;
        for call in 0..rate / 200 {
            let mut client = channels[call % channels.len()].clone();
            calls.spawn(async move {
                let sent = Instant::now();
                let answer = client.in_between(request(1)).await;
                (sent.elapsed(), answer)
            });
        }
    }
    let mut flood = Flood::default();
    while let Some(call) = calls.join_next().await {
        let (took, answer) = call.unwrap();
        match answer {
            Ok(_) => flood.served.push(took),
            Err(status) => {
                assert_eq!(status.code(), Code::ResourceExhausted, "{status:?}");
                let hint = status.get_details_retry_info().unwrap().retry_delay;
                flood.hints.push(hint.unwrap());
                flood.refused.push(took);
            }
        }
    }
    flood.served.sort_unstable();
    flood.refused.sort_unstable();
    flood
}

#[tokio::test(flavor = "multi_thread")]
async fn a_flood_is_refused_at_once_and_gone_when_it_stops() {
    let server = slow_server().await;
    let stop = Arc::new(AtomicBool::new(false));
    let over_http = async {
        // Past the first wave, the other front refuses as well: each of these alone would wait for
        // longer than a call may.
        tokio::time::sleep(Duration::from_millis(700)).await;
        let body = serde_json::to_vec(&request(60)).unwrap();
        let mut refused = 0;
        for response in join_all((0..20).map(|_| server.post(body.clone()))).await {
            if response.status() == StatusCode::TOO_MANY_REQUESTS {
                assert!(response.headers().contains_key("retry-after"));
                refused += 1;
            }
        }
        tokio::time::sleep(Duration::from_millis(500)).await;
        stop.store(true, Ordering::Relaxed);
        refused
    };
    let (flood, refused_over_http) = tokio::join!(flood(&server, 3 * CAPACITY, stop.clone()), over_http);
    assert!(refused_over_http > 0);

    // The engine was kept busy, the rest was refused: with a hint, and long before the admitted had
    // their answers.
    let (served, refused) = (flood.served.len(), flood.refused.len());
    assert!(served >= CAPACITY / 2, "{served} served");
    assert!(refused >= served / 2, "{refused} refused, {served} served");
    assert!(
        flood
            .hints
            .iter()
            .all(|hint| (10..5000).contains(&hint.as_millis()))
    );
    let (half, most) = (flood.served[served / 2], flood.served[served * 99 / 100]);
    // Callers and server share the cores, so the callers' own turns are in it.
    assert!(
        most < MAX_QUEUE * 6,
        "admitted calls took {half:?}, at worst {most:?}"
    );
    let quick = flood.refused[refused / 2];
    assert!(quick < half / 2, "refused after {quick:?}, served after {half:?}");

    // Nothing is left of it.
    let mut client = server.grpc().await;
    let started = Instant::now();
    client.in_between(request(1)).await.unwrap();
    assert!(
        started.elapsed() < Duration::from_millis(100),
        "{:?}",
        started.elapsed()
    );
    server
        .metric("troupe_pending_characters{model=\"toy\"", "0")
        .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn sessions_keep_their_place_beside_a_flood() {
    let server = slow_server().await;
    let mut client = server.sessions().await;
    let ids = ids("walker", 10);
    open(&mut client, &ids).await;
    let stop = Arc::new(AtomicBool::new(false));
    let walking = async {
        tokio::time::sleep(Duration::from_millis(500)).await;
        let started = Instant::now();
        for round in 0..40 {
            // A new command each time, so that everybody needs a plan.
            let turn = if round % 2 == 0 { 1.0 } else { -1.0 };
            let commands = ids.iter().map(|id| walk(id, round + 1, (turn, 1.0))).collect();
            stepped(&mut client, step(&ids, 5, commands)).await;
        }
        let took = started.elapsed();
        stop.store(true, Ordering::Relaxed);
        took
    };
    let (flood, took) = tokio::join!(flood(&server, 3 * CAPACITY, stop.clone()), walking);
    // 10 plans take 50 ms of both workers. Before them, each worker ends the batch that it has: 40
    // ms at most.
    assert!(took < Duration::from_millis(40 * 200), "{took:?}");
    assert!(!flood.served.is_empty() && !flood.refused.is_empty());

    let text = server.handle.service().telemetry().render();
    let value = |name: &str| -> f64 {
        let line = text.lines().find(|line| line.starts_with(name));
        let value = line.and_then(|line| line.rsplit(' ').next()?.parse().ok());
        value.unwrap_or_else(|| panic!("no {name} in\n{text}"))
    };
    let mean = |class: &str| {
        let of = |part: &str| {
            value(&format!(
                "troupe_queue_duration_seconds_{part}{{model=\"toy\",version=\"1.2.3\",class=\"{class}\"}}"
            ))
        };
        of("sum") / of("count")
    };
    // Plans wait for a batch at most, calls for all that the limit lets in.
    let (plans, calls) = (mean("step"), mean("request"));
    assert!(
        plans < 0.06 && plans < calls / 2.0,
        "plans waited {plans} s, calls {calls} s"
    );
    assert_eq!(value("troupe_failed_plans_total{model=\"toy\""), 0.0);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_full_queue_of_calls_has_room_for_plans() {
    let server = TestServer::start_with(|config| {
        config.fixed.max_characters_per_request = 4;
        config.fixed.max_queued_characters = Some(4);
    })
    .await;
    let mut client = server.sessions().await;
    let ids = ids("walker", 20);
    open(&mut client, &ids).await;
    server.gate.close();
    let mut calls = JoinSet::new();
    for batch in 1..=2 {
        let mut client = server.grpc().await;
        calls.spawn(async move { client.in_between(request(4)).await });
        match batch {
            1 => server.metric("troupe_batch_size_count{model=\"toy\"", "1").await,
            _ => {
                server
                    .metric("troupe_pending_characters{model=\"toy\"", "4")
                    .await;
            }
        }
    }
    let status = server.grpc().await.in_between(request(4)).await.unwrap_err();
    assert_eq!(status.code(), Code::ResourceExhausted);
    let walking = tokio::spawn(async move { stepped(&mut client, step(&ids, 10, Vec::new())).await });
    server
        .metric("troupe_pending_characters{model=\"toy\"", "24")
        .await;
    server.gate.open();
    assert_eq!(walking.await.unwrap().slots.len(), 20);
    while let Some(call) = calls.join_next().await {
        call.unwrap().unwrap();
    }
}

/// A call of one character from another address than that of all other clients here.
#[cfg(target_os = "linux")]
async fn from_another_address(url: String) -> StatusCode {
    let client = reqwest::Client::builder()
        .local_address(std::net::IpAddr::from([127, 0, 0, 2]))
        .build()
        .unwrap();
    let call = client
        .post(url)
        .header("content-type", "application/json")
        .body(serde_json::to_vec(&request(1)).unwrap());
    call.send().await.unwrap().status()
}

// Other systems have only one loopback address.
#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread")]
async fn large_calls_of_one_client_do_not_keep_others_out() {
    let server = slow_server().await;
    let stop = Arc::new(AtomicBool::new(false));
    let mut attackers = JoinSet::new();
    for _ in 0..8 {
        let (mut client, stop) = (server.grpc().await, stop.clone());
        attackers.spawn(async move {
            let mut served = 0;
            while !stop.load(Ordering::Relaxed) {
                match client.in_between(request(64)).await {
                    Ok(_) => served += 1,
                    Err(_) => tokio::time::sleep(Duration::from_millis(5)).await,
                }
            }
            served
        });
    }
    tokio::time::sleep(Duration::from_millis(500)).await;
    let mut longest = Duration::ZERO;
    for _ in 0..20 {
        let sent = Instant::now();
        let status = from_another_address(server.url("/v1/inbetween")).await;
        assert_eq!(status, StatusCode::OK);
        longest = longest.max(sent.elapsed());
    }
    stop.store(true, Ordering::Relaxed);
    // Before it, both workers end the batches that they have: 40 ms.
    assert!(longest < MAX_QUEUE * 4, "{longest:?}");
    let mut served = 0;
    while let Some(of_one) = attackers.join_next().await {
        served += of_one.unwrap();
    }
    assert!(served > 1, "{served} large calls were served");
}

// Other systems have only one loopback address.
#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread")]
async fn a_call_of_the_client_with_most_leaves_a_full_queue_for_another() {
    let server = TestServer::start_with(|config| {
        config.max_batch = 1;
        config.fixed.max_queued_characters = Some(4);
    })
    .await;
    server.gate.close();
    let mut calls = Vec::new();
    for characters in [1, 4] {
        let mut client = server.grpc().await;
        calls.push(tokio::spawn(async move {
            client.in_between(request(characters)).await.map(drop)
        }));
        // The worker takes the first one in this time.
        tokio::time::sleep(Duration::from_millis(500)).await;
    }
    server
        .metric("troupe_pending_characters{model=\"toy\"", "4")
        .await;
    let other = tokio::spawn(from_another_address(server.url("/v1/inbetween")));
    let status = calls.pop().unwrap().await.unwrap().unwrap_err();
    assert_eq!(status.code(), Code::ResourceExhausted, "{status}");
    assert!(status.get_details_retry_info().is_some());
    let name = r#"troupe_rejections_total{model="toy",version="1.2.3",reason="pushed_out"}"#;
    server.metric(name, "1").await;
    server.gate.open();
    assert_eq!(other.await.unwrap(), StatusCode::OK);
    calls.pop().unwrap().await.unwrap().unwrap();
}

/// A server whose queues of these packs are full: one call is in the engine, and one waits.
async fn full_server(packs: &[&str]) -> (TestServer, Vec<tokio::task::JoinHandle<()>>) {
    let server = TestServer::start_with(|config| {
        config.max_batch = 1;
        config.fixed.max_queued_characters = Some(1);
    })
    .await;
    server.gate.close();
    let mut waiting = Vec::new();
    for pack in packs.iter().chain(packs) {
        let mut client = server.grpc().await;
        let call = v1::InBetweenRequest {
            pack: (*pack).to_owned(),
            ..request(1)
        };
        waiting.push(tokio::spawn(async move {
            client.in_between(call).await.unwrap();
        }));
        // The workers take the first ones in this time.
        tokio::time::sleep(Duration::from_millis(500)).await;
    }
    for pack in packs {
        let name = format!("troupe_pending_characters{{model=\"{pack}\"");
        server.metric(&name, "1").await;
    }
    (server, waiting)
}

/// Sends the head of a call with a body of 1,000 bytes, and the beginning of the body. Gives its
/// answer, if it comes before the rest.
async fn answer_to_beginning(server: &TestServer, path: &str, begin: &str) -> Option<String> {
    let head = format!(
        "POST {path} HTTP/1.1\r\nhost: localhost\r\nx-request-id: again\r\nauthorization: Bearer made-up\r\n\
         content-type: application/json\r\ncontent-length: 1000\r\n\r\n{begin}"
    );
    let mut stream = server.tcp().await;
    stream.write_all(head.as_bytes()).await.unwrap();
    let answer = tokio::time::timeout(Duration::from_millis(300), answer(&mut stream));
    answer.await.ok()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_call_that_is_heard_out_counts_as_no_refusal() {
    let (server, waiting) = full_server(&["other"]).await;
    let call = v1::InBetweenRequest {
        pack: "other".to_owned(),
        ..request(1)
    };
    let refused = server.post(serde_json::to_vec(&call).unwrap()).await;
    assert_eq!(refused.status(), StatusCode::TOO_MANY_REQUESTS);
    // It may be for the pack that has room.
    let begin = r#"{"characters": ["#;
    assert_eq!(answer_to_beginning(&server, "/v1/inbetween", begin).await, None);
    let name = r#"troupe_rejections_total{model="other",version="1.2.3",reason="queue_full"}"#;
    server.metric(name, "1").await;
    server.gate.open();
    for call in waiting {
        call.await.unwrap();
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_call_that_names_no_pack_is_refused_early_if_no_pack_has_room() {
    let (server, waiting) = full_server(&["toy", "other"]).await;
    let mut answers = 0;
    for _ in 0..20 {
        let refused = server.post(serde_json::to_vec(&request(1)).unwrap()).await;
        assert_eq!(refused.status(), StatusCode::TOO_MANY_REQUESTS);
        let answer = answer_to_beginning(&server, "/v1/inbetween", r#"{"characters": ["#).await;
        answers += usize::from(answer.is_some_and(|answer| answer.starts_with("HTTP/1.1 429 ")));
    }
    assert!(answers > 0);
    server.gate.open();
    for call in waiting {
        call.await.unwrap();
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_with_a_debt_is_refused_before_its_call_is_read() {
    let (server, waiting) = full_server(&["toy"]).await;
    let path = "/v1/inbetween";
    let begin = r#"{"pack": "toy", "characters": ["#;
    let heard_out = answer_to_beginning(&server, path, begin).await;
    assert_eq!(heard_out, None, "a client without a debt");
    // A whole call: its client gets a hint, and so a debt. It ends after some milliseconds.
    let call = || v1::InBetweenRequest {
        pack: "toy".to_owned(),
        ..request(1)
    };
    let owe = async || {
        let response = server.post(serde_json::to_vec(&call()).unwrap()).await;
        assert_eq!(response.status(), StatusCode::TOO_MANY_REQUESTS);
    };
    let refused = async |path: &str, begin: &str| {
        for _ in 0..20 {
            owe().await;
            if let Some(answer) = answer_to_beginning(&server, path, begin).await {
                return answer;
            }
        }
        panic!("a call to {path} is read first");
    };
    // On any connection of its address, and with any made-up key, the beginning of a call is
    // enough. Other procedures of the pack have the same queue.
    for path in [path, "/v1/generate", "/v1/describe"] {
        let again = refused(path, begin).await;
        assert!(
            again.starts_with("HTTP/1.1 429 ") && again.contains("QUEUE_FULL"),
            "{again}"
        );
        for header in ["x-request-id: again", "retry-after: "] {
            assert!(again.contains(header), "{again}");
        }
    }
    let again = refused("/generate", r#"{"model": "toy", "segments": ["#).await;
    assert!(again.contains("retry_after_ms"), "{again}");
    // A call for another pack is heard out, and one that does not say for which it is.
    for begin in [r#"{"pack": "other", "#, r#"{"characters": ["#, ""] {
        owe().await;
        assert_eq!(answer_to_beginning(&server, path, begin).await, None, "{begin}");
    }

    // Over gRPC the details are the same, and the client is served when the queue has room.
    let mut client = server.grpc().await;
    for _ in 0..3 {
        let status = client.in_between(request(1)).await.unwrap_err();
        assert_eq!(status.code(), Code::ResourceExhausted, "{status}");
        assert!(status.get_details_retry_info().is_some());
        assert_eq!(status.get_details_error_info().unwrap().reason, "QUEUE_FULL");
    }
    // Thousands of them do not end the connection.
    for _ in 0..15 {
        let calls = (0..100).map(|_| {
            let mut client = client.clone();
            async move { client.in_between(request(1)).await.unwrap_err().code() }
        });
        let codes = join_all(calls).await;
        assert!(
            codes.iter().all(|code| *code == Code::ResourceExhausted),
            "{codes:?}"
        );
    }
    server.gate.open();
    for call in waiting {
        call.await.unwrap();
    }
    client.in_between(request(1)).await.unwrap();
}

/// Time that this process's threads named `name` have run.
#[cfg(target_os = "linux")]
fn thread_time(name: &str) -> Duration {
    let mut ticks_ns = 0;
    for task in std::fs::read_dir("/proc/self/task").unwrap() {
        let folder = task.unwrap().path();
        if std::fs::read_to_string(folder.join("comm")).unwrap().trim() == name {
            let stat = std::fs::read_to_string(folder.join("schedstat")).unwrap();
            ticks_ns += stat.split(' ').next().unwrap().parse::<u64>().unwrap();
        }
    }
    Duration::from_nanos(ticks_ns)
}

/// Prints what a refusal by the first bytes costs the server's thread, HTTP library included,
/// beside a call that is read and then refused.
#[cfg(target_os = "linux")]
#[test]
#[ignore = "a measurement, for builds with optimisation"]
fn cost_of_a_refusal() {
    const CALLS: usize = 20_000;
    let serving = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .thread_name("serving")
        .enable_all()
        .build()
        .unwrap();
    let (server, _waiting) = serving
        .block_on(serving.spawn(full_server(&["toy", "other"])))
        .unwrap();
    let address = server.handle.address();
    let asking = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .unwrap();
    let cost = |path: &'static str, body: &'static [u8], status: &'static str| {
        asking.block_on(async move {
            let stream = tokio::net::TcpStream::connect(address).await.unwrap();
            let (client, connection) = h2::client::handshake(stream).await.unwrap();
            let connection = tokio::spawn(connection);
            let mut client = client.ready().await.unwrap();
            let mut begun = Duration::ZERO;
            for call in 0..CALLS / 100 {
                // The first calls have no debt yet.
                if call == 2 {
                    begun = thread_time("serving");
                }
                let mut answers = Vec::new();
                for _ in 0..100 {
                    client = client.ready().await.unwrap();
                    let head = http::Request::post(format!("http://{address}{path}"))
                        .header("content-type", "application/grpc")
                        .header("te", "trailers")
                        .body(())
                        .unwrap();
                    let (answer, mut sending) = client.send_request(head, false).unwrap();
                    sending.send_data(bytes::Bytes::from_static(body), true).unwrap();
                    answers.push(answer);
                }
                for answer in join_all(answers).await {
                    let headers = answer.unwrap().headers().clone();
                    assert_eq!(headers["grpc-status"], status, "{headers:?}");
                }
            }
            connection.abort();
            (thread_time("serving") - begun) / (CALLS as u32 - 200)
        })
    };
    let body: &[u8] = framed(&request(1).encode_to_vec()).leak();
    println!(
        "by its beginning: {:?}",
        cost("/troupe.v1.Motion/InBetween", body, "8")
    );
    println!(
        "a call that is read: {:?}",
        cost("/troupe.v1.Motion/GetPack", b"\0\0\0\0\x03\x0a\x01x", "5")
    );
    server.gate.open();
}
