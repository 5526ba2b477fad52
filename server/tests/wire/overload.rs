//! More work than the engine can do: what is refused, what keeps its place, and what is left
//! afterwards.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use futures_util::future::join_all;
use reqwest::StatusCode;
use tokio::task::JoinSet;
use tokio::time::MissedTickBehavior;
use tonic::Code;
use tonic_types::StatusExt as _;

use crate::common::calls::{ids, open, step, stepped, walk};
use crate::common::{TestServer, request};

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
        // Past the first wave, the other front refuses as well. All come at once: one that came
        // with the answer to the one before would come just when a batch has left the queue, and
        // always find a place.
        tokio::time::sleep(Duration::from_millis(700)).await;
        let body = serde_json::to_vec(&request(1)).unwrap();
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
    assert!(
        most < MAX_QUEUE * 4,
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
    let status = server.grpc().await.in_between(request(1)).await.unwrap_err();
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
