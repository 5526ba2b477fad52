//! Many calls at once over one connection: none of them may cost the others that connection.
//!
//! The tests run on one thread, so that the server finds all of a burst in its socket before it has
//! looked at any of it.

use std::time::Duration;

use tokio::task::JoinSet;
use troupe_proto::v1::GetPackRequest;

use crate::common::{TestServer, request};

#[tokio::test]
async fn small_calls() {
    let server = TestServer::start().await;
    let mut client = server.grpc().await;
    // Until the first answer the client knows nothing of the server's limits, and keeps to its own.
    client
        .get_pack(GetPackRequest { name: "toy".into() })
        .await
        .unwrap();
    let mut calls = JoinSet::new();
    for _ in 0..2000 {
        let mut client = client.clone();
        calls.spawn(async move { client.get_pack(GetPackRequest { name: "toy".into() }).await });
    }
    while let Some(call) = calls.join_next().await {
        call.unwrap().unwrap();
    }
}

/// `count` calls while the engine stands: one is in the engine, and `expected` wait before it.
async fn waiting(server: &TestServer, count: usize, expected: &str) {
    server.gate.close();
    let client = server.grpc().await;
    let mut calls = JoinSet::new();
    for nth in 0..count {
        let mut client = client.clone();
        calls.spawn(async move { client.in_between(request(1)).await });
        if nth == 0 {
            server.metric("troupe_batch_size_count{model=\"toy\"", "1").await;
        }
    }
    for _ in 0..2 {
        server
            .metric("troupe_pending_requests{model=\"toy\"", expected)
            .await;
        // It must not be on its way to more.
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    server.gate.open();
    while let Some(call) = calls.join_next().await {
        call.unwrap().unwrap();
    }
}

#[tokio::test]
async fn hundreds_wait_at_once_on_one_connection() {
    let server = TestServer::start_with(|config| config.max_queue_ms = 0).await;
    waiting(&server, 250, "249").await;
}

#[tokio::test]
async fn no_more_calls_than_allowed_at_a_time() {
    let server = TestServer::start_with(|config| config.fixed.max_calls_per_connection = 4).await;
    waiting(&server, 12, "3").await;
}

#[tokio::test]
async fn calls_that_are_given_up_at_once() {
    let server = TestServer::start().await;
    server.gate.close();
    let client = server.grpc().await;
    let mut kept = client.clone();
    let kept = tokio::spawn(async move { kept.in_between(request(1)).await });
    server.metric("troupe_batch_size_count{model=\"toy\"", "1").await;
    for round in 0..40 {
        let mut calls = JoinSet::new();
        for _ in 0..150 {
            let mut client = client.clone();
            calls.spawn(async move { client.in_between(request(1)).await });
        }
        for _ in 0..round % 10 {
            tokio::task::yield_now().await;
        }
        calls.abort_all();
        while calls.join_next().await.is_some() {}
    }
    server.gate.open();
    kept.await.unwrap().unwrap();
}
