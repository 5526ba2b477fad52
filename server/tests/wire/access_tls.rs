//! TLS: who connects, who does not, and files that change while the server runs.

use std::sync::Arc;
use std::time::Duration;

use futures_util::{SinkExt as _, StreamExt as _};
use http::{StatusCode, Version};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::timeout;
use tokio_rustls::TlsConnector;
use tokio_rustls::rustls::pki_types::ServerName;
use tokio_tungstenite::client_async;
use tokio_tungstenite::tungstenite::Message;
use tonic::transport::{Certificate, ClientTlsConfig, Endpoint};
use troupe_edge::clients::Role;
use troupe_edge::keys;
use troupe_proto::v1::motion_client::MotionClient;
use troupe_server::config::Config;
use troupe_server::health::{self, HealthTls};
use troupe_server::server::serve_packs;

use super::certificates::{Authority, ask};
use crate::common::{TestServer, request};

/// Longer than it takes the server to see that a file has changed.
const SEEN: Duration = Duration::from_secs(10);

#[tokio::test(flavor = "multi_thread")]
async fn one_port_speaks_tls_over_every_protocol() {
    let authority = Authority::new("one");
    let server = TestServer::start_with(|config| authority.certify(config)).await;
    assert!(server.handle.speaks_tls());
    for (http2, version) in [(false, Version::HTTP_11), (true, Version::HTTP_2)] {
        let answer = ask(&server, authority.trusting(None), "/readyz", http2)
            .await
            .unwrap();
        assert_eq!((answer.status(), answer.version()), (StatusCode::OK, version));
    }
    let tls = ClientTlsConfig::new().ca_certificate(Certificate::from_pem(authority.pem()));
    let endpoint = Endpoint::from_shared(server.url("").replace("http", "https")).unwrap();
    let channel = endpoint.tls_config(tls).unwrap().connect().await.unwrap();
    MotionClient::new(channel).in_between(request(1)).await.unwrap();

    let address = server.handle.address();
    let stream = TcpStream::connect(address).await.unwrap();
    let name = ServerName::try_from("localhost").unwrap();
    let connector = TlsConnector::from(Arc::new(authority.trusting(None)));
    let stream = connector.connect(name, stream).await.unwrap();
    let (mut socket, _) = client_async(format!("wss://{address}/v1/drive"), stream)
        .await
        .unwrap();
    socket.send(Message::text("no JSON")).await.unwrap();
    let said = socket.next().await.unwrap().unwrap().into_text().unwrap();
    assert!(said.contains("the request cannot be read"), "{said}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_handshake_that_is_silent_or_no_tls_ends_and_is_counted() {
    let authority = Authority::new("one");
    let server = TestServer::start_with(|config| {
        authority.certify(config);
        config.request_timeout_ms = 300;
    })
    .await;
    let address = server.handle.address();
    // The first bytes of a ClientHello, HTTP without TLS, and nothing.
    for first in [&b"\x16\x03\x01\x02\x00\x01"[..], b"GET / HTTP/1.1\r\n\r\n", b""] {
        let mut stream = TcpStream::connect(address).await.unwrap();
        stream.write_all(first).await.unwrap();
        // While it waits, others are served.
        let served = ask(&server, authority.trusting(None), "/healthz", false)
            .await
            .unwrap();
        assert_eq!(served.status(), StatusCode::OK);
        let end = timeout(Duration::from_secs(5), stream.read_to_end(&mut Vec::new())).await;
        assert!(end.is_ok(), "a connection that only sent {first:?} stays open");
    }
    server.metric("troupe_tls_handshakes_failed_total", "3").await;
    server.metric("troupe_connections_active", "0").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn with_an_authority_of_clients_strangers_do_not_get_in() {
    let (ours, theirs) = (Authority::new("ours"), Authority::new("theirs"));
    let server = TestServer::start_with(|config| {
        ours.certify(config);
        config.tls_client_ca = Some(ours.write("clients.pem", ours.pem()));
    })
    .await;
    let (known, stranger) = (ours.sign(), theirs.sign());
    for http2 in [false, true] {
        let get = |identity| ask(&server, ours.trusting(identity), "/healthz", http2);
        assert_eq!(get(Some(&known)).await.unwrap().status(), StatusCode::OK);
        get(None).await.unwrap_err();
        get(Some(&stranger)).await.unwrap_err();
    }
    server.metric("troupe_tls_handshakes_failed_total", "4").await;

    let url = health::ready_url(server.handle.address(), true).unwrap();
    let mut tls = HealthTls {
        own: Some(ours.file("server.pem")),
        ..HealthTls::default()
    };
    let limit = Duration::from_secs(5);
    health::check(&url, &tls, limit).await.unwrap_err();
    tls.client = Some((
        ours.write("client.pem", &known.certificate),
        ours.write("client.key", &known.key),
    ));
    health::check(&url, &tls, limit).await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn certificates_are_read_again_when_their_files_change() {
    let (old, new) = (Authority::new("old"), Authority::new("new"));
    let server = TestServer::start_with(|config| old.certify(config)).await;
    let get = |authority: &Authority| ask(&server, authority.trusting(None), "/healthz", true);
    get(&old).await.unwrap();
    get(&new).await.unwrap_err();

    // A broken certificate changes nothing, nor does one without its key.
    old.write("server.pem", "no certificate");
    server.handle.reload();
    tokio::time::sleep(Duration::from_millis(300)).await;
    get(&old).await.unwrap();
    let identity = new.sign();
    old.write("server.pem", &identity.certificate);
    server.handle.reload();
    tokio::time::sleep(Duration::from_millis(300)).await;
    get(&old).await.unwrap();

    old.write("server.key", &identity.key);
    let changed = async {
        while get(&new).await.is_err() {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    };
    timeout(SEEN, changed)
        .await
        .expect("the new certificate is shown");
    get(&old).await.unwrap_err();

    // The health check trusts the certificate in the file, and no other.
    let url = health::ready_url(server.handle.address(), true).unwrap();
    let check = |own| {
        let tls = HealthTls {
            own: Some(own),
            ..HealthTls::default()
        };
        let url = &url;
        async move { health::check(url, &tls, Duration::from_secs(5)).await }
    };
    check(old.file("server.pem")).await.unwrap();
    let other = old.write("other.pem", &old.sign().certificate);
    check(other).await.unwrap_err();
    let error = health::check(&url, &HealthTls::default(), SEEN)
        .await
        .unwrap_err();
    assert!(error.to_string().contains("--ca is missing"), "{error}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_key_that_is_taken_off_its_file_is_refused_within_seconds() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("keys.toml");
    let (stays, goes) = (keys::new_key(), keys::new_key());
    let stays_entry = keys::entry("stays", Role::Drive, &stays);
    std::fs::write(
        &path,
        stays_entry.clone() + &keys::entry("goes", Role::Drive, &goes),
    )
    .unwrap();
    let for_server = path.clone();
    let server = TestServer::start_with(|config| config.keys = Some(for_server)).await;
    let get = async |key: &str| {
        let client = reqwest::Client::new();
        let call = client.get(server.url("/v1/packs")).bearer_auth(key);
        call.send().await.unwrap().status()
    };
    assert_eq!(
        (get(&stays).await, get(&goes).await),
        (StatusCode::OK, StatusCode::OK)
    );

    // A broken file changes nothing.
    std::fs::write(&path, "keys = []").unwrap();
    server.handle.reload();
    tokio::time::sleep(Duration::from_millis(300)).await;
    assert_eq!(get(&goes).await, StatusCode::OK);

    std::fs::write(&path, stays_entry).unwrap();
    let refused = async {
        while get(&goes).await != StatusCode::UNAUTHORIZED {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    };
    timeout(SEEN, refused).await.expect("the key is refused");
    assert_eq!(get(&stays).await, StatusCode::OK);
}

#[tokio::test]
async fn certificates_that_cannot_be_used_are_named() {
    let (one, two) = (Authority::new("one"), Authority::new("two"));
    let error = async |change: &dyn Fn(&mut Config)| {
        let mut config = Config::local(std::path::Path::new("unused")).unwrap();
        one.certify(&mut config);
        change(&mut config);
        let listener = TcpListener::bind(config.listen).await.unwrap();
        match serve_packs(config, listener, || Ok(Vec::new())).await {
            Ok(_) => panic!("it started"),
            Err(error) => error.to_string(),
        }
    };
    let key = two.write("other.key", &two.sign().key);
    let text = error(&|config| config.tls_key = Some(key.clone())).await;
    for part in [
        "tls_certificate: ",
        "server.pem",
        "does not belong",
        "other.key (tls_key)",
    ] {
        assert!(text.contains(part), "{part} is not in {text}");
    }
    let text = error(&|config| config.tls_key = Some("/nowhere/a.key".into())).await;
    assert!(text.starts_with("tls_key: /nowhere/a.key: "), "{text}");
    let empty = one.write("empty.pem", "");
    let text = error(&|config| config.tls_certificate = Some(empty.clone())).await;
    assert!(
        text.starts_with("tls_certificate: ") && text.contains("empty.pem"),
        "{text}"
    );
    let text = error(&|config| config.tls_client_ca = Some(empty.clone())).await;
    assert!(
        text.starts_with("tls_client_ca: ") && text.contains("empty.pem"),
        "{text}"
    );
}
