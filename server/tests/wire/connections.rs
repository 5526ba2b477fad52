//! Connections: how many there may be, and how long they last.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;
use tokio::time::timeout;
use tonic::Code;
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_client::HealthClient;
use tonic_types::StatusExt as _;

use crate::common::{TestServer, request};

/// One request on one connection, up to the end of the connection.
pub async fn get(address: SocketAddr, path: &str) -> String {
    let mut stream = TcpStream::connect(address).await.unwrap();
    let head = format!("GET {path} HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n");
    stream.write_all(head.as_bytes()).await.unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.unwrap();
    answer
}

/// Whether the server closes a connection, in order or with a reset.
async fn closes(stream: &mut TcpStream) -> bool {
    let end = timeout(Duration::from_secs(10), stream.read(&mut [0; 64])).await;
    end.is_ok_and(|read| matches!(read, Ok(0) | Err(_)))
}

#[tokio::test(flavor = "multi_thread")]
async fn silent_connections_are_closed() {
    let short = |config: &mut troupe_server::config::Config| {
        config.request_timeout_ms = 200;
        config.fixed.keepalive = Duration::from_millis(200);
    };
    let server = TestServer::start_with(short).await;
    for first in [
        "",
        "PRI * HT",
        "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
        "GET /healthz HTTP",
    ] {
        let mut stream = TcpStream::connect(server.handle.address()).await.unwrap();
        stream.write_all(first.as_bytes()).await.unwrap();
        let mut rest = Vec::new();
        // It ends, in order or with a reset.
        let end = timeout(Duration::from_secs(5), stream.read_to_end(&mut rest)).await;
        assert!(end.is_ok(), "a connection that only sent {first:?} stays open");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn past_the_limit_only_health_is_answered() {
    let server = TestServer::start_with(|config| {
        config.max_connections = 2;
        config.fixed.max_connections_per_address = Some(100);
    })
    .await;
    let address = server.handle.address();
    let first = TcpStream::connect(address).await.unwrap();
    let _second = TcpStream::connect(address).await.unwrap();
    server.metric("troupe_connections_active", "2").await;
    for path in ["/healthz", "/readyz", "/metrics"] {
        let answer = get(address, path).await;
        assert!(answer.starts_with("HTTP/1.1 200"), "{path}: {answer}");
    }
    // The server ends the connection by itself.
    let mut stream = TcpStream::connect(address).await.unwrap();
    stream
        .write_all(b"GET /v1/packs HTTP/1.1\r\nhost: localhost\r\n\r\n")
        .await
        .unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.unwrap();
    for part in [
        "HTTP/1.1 503",
        "connection: close",
        "retry-after: 1",
        "TOO_MANY_CONNECTIONS",
    ] {
        assert!(answer.contains(part), "{part} is not in {answer}");
    }

    let mut health = HealthClient::new(server.channel().await);
    let asked = HealthCheckRequest::default();
    health.check(asked).await.unwrap();
    let status = server.grpc().await.in_between(request(1)).await.unwrap_err();
    assert_eq!(status.code(), Code::Unavailable);
    assert!(status.get_details_retry_info().is_some());
    // Neither keeps its place, though both clients would like to.
    server.metric("troupe_connections_active", "2").await;

    drop(first);
    server.metric("troupe_connections_active", "1").await;
    let answer = get(address, "/v1/packs").await;
    assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
}

#[tokio::test(flavor = "multi_thread")]
async fn past_the_limit_a_connection_ends_after_seconds_although_it_is_busy() {
    let server = TestServer::start_with(|config| {
        config.max_connections = 1;
        config.fixed.max_connections_per_address = Some(100);
    })
    .await;
    let _first = server.tcp().await;
    server.metric("troupe_connections_active", "1").await;
    let (client, connection) = h2::client::handshake(server.tcp().await).await.unwrap();
    let connected = Instant::now();
    let closed = tokio::spawn(connection);
    let mut client = client.ready().await.unwrap();
    let mut answered = 0;
    while !closed.is_finished() && connected.elapsed() < Duration::from_secs(10) {
        let call = http::Request::get(server.url("/healthz")).body(()).unwrap();
        if let Ok((answer, _)) = client.send_request(call, true) {
            answered += u32::from(answer.await.is_ok_and(|answer| answer.status() == 200));
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
        let Ok(ready) = client.ready().await else { break };
        client = ready;
    }
    let lasted = connected.elapsed();
    assert!((4.0..7.0).contains(&lasted.as_secs_f64()), "{lasted:?}");
    assert!(answered > 10, "{answered}");
}

#[tokio::test(flavor = "multi_thread")]
async fn past_the_reserve_connections_are_closed_at_once() {
    let server = TestServer::start_with(|config| {
        config.max_connections = 1;
        config.fixed.max_connections_per_address = Some(100);
    })
    .await;
    let address = server.handle.address();
    let mut open = Vec::new();
    for _ in 0..17 {
        open.push(TcpStream::connect(address).await.unwrap());
    }
    server.metric("troupe_connections_active", "17").await;
    let mut refused = TcpStream::connect(address).await.unwrap();
    assert!(closes(&mut refused).await);
    server
        .metric(r#"troupe_connections_refused_total{reason="limit"}"#, "1")
        .await;
    // Those that sit in the reserve lose it.
    assert!(closes(&mut open[16]).await);
    server.metric("troupe_connections_active", "1").await;
}

#[tokio::test]
async fn an_address_gets_so_many_connections() {
    let server = TestServer::start_with(|config| config.max_connections = 4).await;
    let address = server.handle.address();
    let _first = TcpStream::connect(address).await.unwrap();
    let second = TcpStream::connect(address).await.unwrap();
    let mut third = TcpStream::connect(address).await.unwrap();
    assert!(closes(&mut third).await);
    server
        .metric(r#"troupe_connections_refused_total{reason="address"}"#, "1")
        .await;
    drop(second);
    server.metric("troupe_connections_active", "1").await;
    assert!(get(address, "/healthz").await.starts_with("HTTP/1.1 200"));
}

#[tokio::test(flavor = "multi_thread")]
async fn idle_connections_are_closed_and_busy_ones_are_not() {
    let server =
        TestServer::start_with(|config| config.fixed.idle_timeout = Duration::from_millis(300)).await;
    let mut client = server.grpc().await;
    client.in_between(request(1)).await.unwrap();
    server.metric("troupe_connections_active", "0").await;
    // The client notices, and connects again.
    server.gate.close();
    let mut again = client.clone();
    let call = tokio::spawn(async move { again.in_between(request(1)).await });
    tokio::time::sleep(Duration::from_millis(1500)).await;
    server.metric("troupe_connections_active", "1").await;
    server.gate.open();
    call.await.unwrap().unwrap();
    server.metric("troupe_connections_active", "0").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_socket_keeps_its_place() {
    let server =
        TestServer::start_with(|config| config.fixed.idle_timeout = Duration::from_millis(100)).await;
    let url = server.url("/v1/drive").replace("http", "ws");
    let (socket, _) = tokio_tungstenite::connect_async(url).await.unwrap();
    tokio::time::sleep(Duration::from_millis(500)).await;
    server.metric("troupe_connections_active", "1").await;
    drop(socket);
    server.metric("troupe_connections_active", "0").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn connections_that_only_idle_make_room() {
    let server = TestServer::start_with(|config| {
        config.max_connections = 4;
        config.fixed.max_connections_per_address = Some(100);
        config.fixed.spare_idle = Duration::from_millis(300);
    })
    .await;
    let address = server.handle.address();
    let mut idle = Vec::new();
    for _ in 0..4 {
        idle.push(TcpStream::connect(address).await.unwrap());
    }
    server.metric("troupe_connections_active", "4").await;
    tokio::time::sleep(Duration::from_millis(400)).await;
    let answer = get(address, "/v1/packs").await;
    assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
    assert!(closes(&mut idle[0]).await, "the oldest makes room");
    server.metric("troupe_connections_made_room_total", "1").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_connection_that_only_resets_is_closed() {
    let server = TestServer::start().await;
    let stream = server.tcp().await;
    let (client, connection) = h2::client::handshake(stream).await.unwrap();
    let closed = tokio::spawn(connection);
    let mut client = client.ready().await.unwrap();
    server.gate.close();
    let flood = async {
        loop {
            let request = http::Request::post(server.url("/v1/inbetween")).body(()).unwrap();
            let Ok((answer, _body)) = client.send_request(request, false) else {
                return;
            };
            // The server has the head before the reset.
            tokio::task::yield_now().await;
            drop(answer);
            let Ok(ready) = client.clone().ready().await else {
                return;
            };
            client = ready;
        }
    };
    timeout(Duration::from_secs(20), flood)
        .await
        .expect("the server ends it");
    let _ = timeout(Duration::from_secs(5), closed)
        .await
        .expect("it is closed");
    server.metric("troupe_connections_active", "0").await;
    server.gate.open();
    // Others, and the same client later, are served.
    assert!(
        get(server.handle.address(), "/healthz")
            .await
            .starts_with("HTTP/1.1 200")
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_second_port_answers_health_checks_alone() {
    let server = TestServer::start_with(|config| {
        config.max_connections = 1;
        config.health_listen = Some(SocketAddr::from(([127, 0, 0, 1], 0)));
        config.without_keys = troupe_server::config::WithoutKeys::OneTimeKey;
    })
    .await;
    let health = server.handle.health_address().unwrap();
    let mut taken = Vec::new();
    for _ in 0..17 {
        taken.push(server.tcp().await);
    }
    for path in ["/healthz", "/readyz"] {
        let answer = get(health, path).await;
        assert!(answer.starts_with("HTTP/1.1 200"), "{path}: {answer}");
    }
    for path in ["/metrics", "/v1/packs", "/docs"] {
        let answer = get(health, path).await;
        assert!(answer.starts_with("HTTP/1.1 404"), "{path}: {answer}");
    }
    let channel = tonic::transport::Channel::from_shared(format!("http://{health}"));
    let mut client = HealthClient::new(channel.unwrap().connect().await.unwrap());
    client.check(HealthCheckRequest::default()).await.unwrap();
    drop(client);
    assert!(server.handle.shut_down().await);
    assert!(TcpStream::connect(health).await.is_err());
}
