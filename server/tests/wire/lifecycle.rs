//! Start and end of a server: readiness, health, drain.

use std::time::Duration;

use reqwest::StatusCode;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;
use tokio::time::timeout;
use tonic::Code;
use tonic_health::pb::health_check_response::ServingStatus;
use tonic_health::pb::health_client::HealthClient;
use tonic_health::pb::{HealthCheckRequest, HealthCheckResponse};
use troupe_server::server::Stopped;

use crate::common::{TestServer, request};
use crate::connections::get;

async fn health(server: &TestServer, service: &str) -> HealthCheckResponse {
    let mut client = HealthClient::new(server.channel().await);
    client
        .check(HealthCheckRequest {
            service: service.into(),
        })
        .await
        .unwrap()
        .into_inner()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_loads_is_alive_but_not_ready() {
    let mut server = TestServer::start_unready(|_| {}, Duration::from_millis(300)).await;
    assert_eq!(server.get("/healthz").await.status(), StatusCode::OK);
    assert_eq!(
        server.get("/readyz").await.status(),
        StatusCode::SERVICE_UNAVAILABLE
    );
    assert_eq!(
        server.get("/v1/packs").await.status(),
        StatusCode::SERVICE_UNAVAILABLE
    );
    assert_eq!(
        health(&server, "troupe.v1.Motion").await.status(),
        ServingStatus::NotServing
    );
    let status = server.grpc().await.in_between(request(1)).await.unwrap_err();
    assert_eq!(status.code(), Code::Unavailable);

    server.handle.ready().await.unwrap();
    assert_eq!(server.get("/readyz").await.status(), StatusCode::OK);
    for service in ["", "troupe.v1.Motion"] {
        assert_eq!(health(&server, service).await.status(), ServingStatus::Serving);
    }
    server.grpc().await.in_between(request(1)).await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_drain_lets_requests_finish_and_cuts_what_stays_silent() {
    let server = TestServer::start_with(|config| config.drain_timeout_ms = 500).await;
    let address = server.handle.address();
    server.gate.close();
    let mut client = server.grpc().await;
    let call = tokio::spawn(async move { client.in_between(request(1)).await });
    server.metric("troupe_batch_size_count{model=\"toy\"", "1").await;
    // A connection that begins a request, gets `100 Continue`, and sends no more.
    let mut silent = TcpStream::connect(address).await.unwrap();
    let head = "POST /v1/inbetween HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\ncontent-length: 9\r\nexpect: 100-continue\r\n\r\n";
    silent.write_all(head.as_bytes()).await.unwrap();
    let mut answer = [0; 25];
    silent.read_exact(&mut answer).await.unwrap();
    assert_eq!(answer.as_slice(), b"HTTP/1.1 100 Continue\r\n\r\n");

    let TestServer { handle, gate, .. } = server;
    let service = handle.service().clone();
    let stopping = tokio::spawn(handle.shut_down());
    while service.ready().is_ok() {
        tokio::time::sleep(Duration::from_millis(1)).await;
    }
    gate.open();
    let answer = call.await.unwrap().unwrap().into_inner();
    assert_eq!(answer.characters.len(), 1, "a request in flight must be answered");
    assert!(stopping.await.unwrap(), "half a request is not waited for");
    assert_eq!(silent.read(&mut [0; 64]).await.unwrap_or(0), 0, "it was cut");
    assert!(TcpStream::connect(address).await.is_err(), "the port is closed");
}

#[tokio::test]
async fn a_drain_without_requests_is_clean_and_quick() {
    let server = TestServer::start().await;
    server.grpc().await.in_between(request(1)).await.unwrap();
    let clean = timeout(Duration::from_secs(5), server.handle.shut_down())
        .await
        .unwrap();
    assert!(clean);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_health_watch_hears_of_a_stop_and_does_not_hold_it_up() {
    let server = TestServer::start().await;
    let mut streams = Vec::new();
    for service in ["", "troupe.v1.Motion"] {
        let mut client = HealthClient::new(server.channel().await);
        let service = service.into();
        let mut stream = client
            .watch(HealthCheckRequest { service })
            .await
            .unwrap()
            .into_inner();
        let first = stream.message().await.unwrap().unwrap();
        assert_eq!(first.status(), ServingStatus::Serving);
        streams.push(stream);
    }
    let stopping = tokio::spawn(timeout(Duration::from_secs(2), server.handle.shut_down()));
    for mut stream in streams {
        let last = stream.message().await.unwrap().unwrap();
        assert_eq!(last.status(), ServingStatus::NotServing);
        assert!(stream.message().await.unwrap().is_none(), "the stream ends");
    }
    assert!(stopping.await.unwrap().unwrap(), "the stop is clean");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_while_packs_load_is_clean() {
    let server = TestServer::start_unready(|_| {}, Duration::from_millis(300)).await;
    let clean = timeout(Duration::from_secs(5), server.handle.shut_down()).await;
    assert!(clean.unwrap());
}

#[tokio::test]
async fn a_server_outlives_its_handle() {
    let TestServer {
        handle, gate: _gate, ..
    } = TestServer::start().await;
    let address = handle.address();
    drop(handle);
    // Each request has a connection of its own.
    for _ in 0..3 {
        let answer = timeout(Duration::from_secs(5), get(address, "/healthz"))
            .await
            .unwrap();
        assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
    }
}

#[tokio::test]
async fn the_first_bytes_may_come_one_by_one() {
    let server = TestServer::start().await;
    // The first byte could begin HTTP/2's preface.
    let head =
        "POST /v1/inbetween HTTP/1.1\r\nhost: localhost\r\ncontent-length: 0\r\nconnection: close\r\n\r\n";
    let mut stream = TcpStream::connect(server.handle.address()).await.unwrap();
    stream.set_nodelay(true).unwrap();
    for byte in head.bytes() {
        stream.write_all(&[byte]).await.unwrap();
        tokio::time::sleep(Duration::from_millis(1)).await;
    }
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.unwrap();
    assert!(answer.starts_with("HTTP/1.1 400"), "{answer}");
}

#[tokio::test]
async fn a_stop_does_not_wait_for_connections_that_never_began() {
    let server = TestServer::start().await;
    let address = server.handle.address();
    let mut silent = TcpStream::connect(address).await.unwrap();
    silent.write_all(b"PRI").await.unwrap();
    // The server accepts in order, so it has the first connection once it answers on another.
    get(address, "/healthz").await;
    let clean = timeout(Duration::from_secs(5), server.handle.shut_down()).await;
    assert!(clean.unwrap());
    assert_eq!(silent.read(&mut [0; 64]).await.unwrap_or(0), 0, "it was closed");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_stops_says_so_before_it_closes_its_port() {
    let server = TestServer::start_with(|config| config.drain_delay_ms = 1500).await;
    let (address, service) = (server.handle.address(), server.handle.service().clone());
    let mut client = server.grpc().await;
    let mut checks = HealthClient::new(server.channel().await);
    let TestServer {
        handle, gate: _gate, ..
    } = server;
    let stopping = tokio::spawn(handle.shut_down());
    while service.ready().is_ok() {
        tokio::time::sleep(Duration::from_millis(1)).await;
    }
    assert!(get(address, "/readyz").await.starts_with("HTTP/1.1 503"));
    let check = checks
        .check(HealthCheckRequest::default())
        .await
        .unwrap()
        .into_inner();
    assert_eq!(check.status(), ServingStatus::NotServing);
    // Who has not noticed yet is served as ever.
    client.in_between(request(1)).await.unwrap();
    assert!(get(address, "/v1/packs").await.starts_with("HTTP/1.1 200"));
    assert!(timeout(Duration::from_secs(5), stopping).await.unwrap().unwrap());
    assert!(TcpStream::connect(address).await.is_err(), "the port is closed");
}

#[tokio::test(flavor = "multi_thread")]
async fn half_requests_get_a_short_grace_when_the_server_stops() {
    let server = TestServer::start_with(|config| config.drain_timeout_ms = 60_000).await;
    let address = server.handle.address();
    let head = "POST /v1/inbetween HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\ncontent-length: 9\r\n";
    let body = format!("{head}\r\n{{");
    let mut open = Vec::new();
    for half in [
        "POST /v1/in",
        head,
        body.as_str(),
        "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
    ] {
        let mut stream = TcpStream::connect(address).await.unwrap();
        stream.write_all(half.as_bytes()).await.unwrap();
        open.push(stream);
    }
    server.metric("troupe_connections_active", "4").await;
    tokio::time::sleep(Duration::from_millis(200)).await;
    let begun = std::time::Instant::now();
    let clean = timeout(Duration::from_secs(10), server.handle.shut_down()).await;
    assert!(clean.unwrap(), "nothing was lost");
    assert!(begun.elapsed() < Duration::from_secs(4), "{:?}", begun.elapsed());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_request_that_does_not_finish_in_time_is_lost_and_reported() {
    let server = TestServer::start_with(|config| {
        config.drain_timeout_ms = 300;
        config.fixed.last_step = Duration::from_millis(100);
    })
    .await;
    server.gate.close();
    let mut client = server.grpc().await;
    let call = tokio::spawn(async move { client.in_between(request(1)).await });
    server.metric("troupe_batch_size_count{model=\"toy\"", "1").await;
    let TestServer { handle, gate, .. } = server;
    assert!(!handle.shut_down().await);
    assert!(call.await.unwrap().is_err());
    gate.open();
}

/// The process unloads the networks' library after a stop: no network may run then.
#[tokio::test(flavor = "multi_thread")]
async fn no_network_runs_after_a_stop() {
    for second_signal in [false, true] {
        let server = TestServer::start_with(|config| {
            config.drain_timeout_ms = 50;
            config.max_batch = 1;
        })
        .await;
        server.gate.set_row_time(Duration::from_millis(1500));
        let mut client = server.grpc().await;
        let call = tokio::spawn(async move { client.in_between(request(1)).await });
        while server.gate.running() == 0 {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
        let again = async {
            if !second_signal {
                std::future::pending::<()>().await;
            }
        };
        let stopped = server.handle.shut_down_unless(again).await;
        assert_eq!(server.gate.running(), 0, "a network still runs after {stopped:?}");
        let expected = if second_signal {
            Stopped::Forced
        } else {
            Stopped::Lost
        };
        assert_eq!(stopped, expected);
        assert!(call.await.unwrap().is_err());
    }
}
