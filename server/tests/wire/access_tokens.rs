//! Tokens of an identity provider: which ones let a caller in.

use std::path::PathBuf;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use base64::Engine as _;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use futures_util::StreamExt as _;
use http::StatusCode;
use ring::rand::SystemRandom;
use ring::signature::{ECDSA_P256_SHA256_FIXED_SIGNING, EcdsaKeyPair, Ed25519KeyPair, KeyPair as _};
use serde_json::{Value, json};
use tokio::time::timeout;
use tokio_tungstenite::connect_async;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::client::IntoClientRequest as _;
use troupe_edge::clients::Role;
use troupe_edge::keys;
use troupe_proto::v1;
use troupe_server::api::ErrorBody;

use crate::common::TestServer;
use crate::common::calls::Client;

fn base64(bytes: impl AsRef<[u8]>) -> String {
    URL_SAFE_NO_PAD.encode(bytes)
}

/// A provider with a key for each kind of signature.
struct Provider {
    es: EcdsaKeyPair,
    ed: Ed25519KeyPair,
    folder: tempfile::TempDir,
}

impl Provider {
    fn new() -> Self {
        let random = SystemRandom::new();
        let algorithm = &ECDSA_P256_SHA256_FIXED_SIGNING;
        let es = EcdsaKeyPair::generate_pkcs8(algorithm, &random).unwrap();
        let ed = Ed25519KeyPair::generate_pkcs8(&random).unwrap();
        let provider = Self {
            es: EcdsaKeyPair::from_pkcs8(algorithm, es.as_ref(), &random).unwrap(),
            ed: Ed25519KeyPair::from_pkcs8(ed.as_ref()).unwrap(),
            folder: tempfile::tempdir().unwrap(),
        };
        std::fs::write(provider.jwks(), provider.public().to_string()).unwrap();
        provider
    }

    fn jwks(&self) -> PathBuf {
        self.folder.path().join("jwks.json")
    }

    fn public(&self) -> Value {
        let (x, y) = self.es.public_key().as_ref()[1..].split_at(32);
        json!({ "keys": [
            { "kty": "EC", "crv": "P-256", "kid": "es", "alg": "ES256", "x": base64(x), "y": base64(y) },
            { "kty": "OKP", "crv": "Ed25519", "kid": "ed", "x": base64(self.ed.public_key()) },
        ] })
    }

    fn token(&self, algorithm: &str, claims: &Value) -> String {
        let id = if algorithm == "ES256" { "es" } else { "ed" };
        self.signed(&json!({ "alg": algorithm, "kid": id, "typ": "JWT" }), claims)
    }

    /// A token with any header. Where its algorithm is none of the provider's, it is signed by
    /// Ed25519.
    fn signed(&self, header: &Value, claims: &Value) -> String {
        let message = format!("{}.{}", base64(header.to_string()), base64(claims.to_string()));
        let signature = match header["alg"].as_str() {
            Some("ES256") => {
                let signed = self.es.sign(&SystemRandom::new(), message.as_bytes()).unwrap();
                base64(signed)
            }
            Some("none") => String::new(),
            _ => base64(self.ed.sign(message.as_bytes())),
        };
        format!("{message}.{signature}")
    }
}

/// Claims that let in, for `seconds` from now on.
fn claims(role: &str, seconds: i64) -> Value {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs() as i64;
    json!({
        "iss": "https://id.example", "aud": ["troupe", "other"], "sub": "game-1", "tenant": "a",
        "role": role, "exp": now + seconds,
    })
}

fn with(mut claims: Value, name: &str, value: Value) -> Value {
    claims[name] = value;
    claims
}

async fn get(server: &TestServer, path: &str, token: &str) -> (StatusCode, String) {
    let call = reqwest::Client::new().get(server.url(path)).bearer_auth(token);
    let response = call.send().await.unwrap();
    let status = response.status();
    let message = match status.is_success() {
        true => String::new(),
        false => response.json::<ErrorBody>().await.unwrap().error.message,
    };
    (status, message)
}

async fn start(provider: &Provider) -> TestServer {
    let jwks = provider.jwks();
    TestServer::start_with(|config| {
        config.jwks = Some(jwks);
        config.jwt_issuer = Some("https://id.example".to_owned());
        config.jwt_audience = Some("troupe".to_owned());
    })
    .await
}

#[tokio::test]
async fn tokens_of_the_provider_let_in_by_their_role() {
    let provider = Provider::new();
    let server = start(&provider).await;
    assert!(server.handle.asks_for_keys());
    for algorithm in ["ES256", "EdDSA"] {
        for (path, role, status) in [
            ("/v1/packs", "drive", 200),
            ("/metrics", "drive", 403),
            ("/metrics", "metrics", 200),
            ("/v1/packs", "metrics", 403),
        ] {
            let token = provider.token(algorithm, &claims(role, 60));
            let (found, message) = get(&server, path, &token).await;
            assert_eq!(found, status, "{algorithm} {path} {role}: {message}");
        }
        // Clocks may be half a minute apart. One audience is enough, and no key id need be named.
        let late = provider.token(algorithm, &claims("drive", -10));
        assert_eq!(get(&server, "/v1/packs", &late).await.0, StatusCode::OK);
        let plain = with(claims("drive", 60), "aud", json!("troupe"));
        let token = provider.signed(&json!({ "alg": algorithm }), &plain);
        assert_eq!(get(&server, "/v1/packs", &token).await.0, StatusCode::OK);
    }
}

type Asked = tokio::sync::mpsc::Sender<v1::DriveRequest>;

/// A stream of the token's holder. It ends once the sender is dropped.
async fn open_stream(client: &mut Client, token: &str) -> (Asked, tonic::Streaming<v1::DriveResponse>) {
    let (ask, asked) = tokio::sync::mpsc::channel(1);
    let mut call = tonic::Request::new(tokio_stream::wrappers::ReceiverStream::new(asked));
    let bearer = format!("Bearer {token}").parse().unwrap();
    call.metadata_mut().insert("authorization", bearer);
    let answers = client.drive(call).await.unwrap().into_inner();
    (ask, answers)
}

#[tokio::test]
async fn the_end_of_a_token_ends_its_streams() {
    let provider = Provider::new();
    let server = start(&provider).await;
    // Tokens are accepted for 30 s longer, because clocks may differ.
    let token = provider.token("EdDSA", &claims("drive", -27));
    let url = server.url("/v1/drive").replace("http", "ws");
    let mut request = url.into_client_request().unwrap();
    let bearer = format!("Bearer {token}").parse().unwrap();
    request.headers_mut().insert("authorization", bearer);
    let (mut socket, _) = connect_async(request).await.unwrap();
    let mut client = server.sessions().await;
    let (_ask, mut answers) = open_stream(&mut client, &token).await;
    assert!(
        timeout(Duration::from_secs(1), answers.message()).await.is_err(),
        "it goes on"
    );
    let ended = timeout(Duration::from_secs(4), answers.message()).await;
    let status = ended.expect("an end in time").unwrap_err();
    assert_eq!(status.code(), tonic::Code::Unauthenticated, "{status}");
    assert!(status.message().contains("the token has expired"), "{status}");
    let closed = async {
        loop {
            if let Message::Close(frame) = socket.next().await.unwrap().unwrap() {
                return frame.unwrap();
            }
        }
    };
    let frame = timeout(Duration::from_secs(4), closed)
        .await
        .expect("an end in time");
    assert_eq!(u16::from(frame.code), 1008);
    assert!(frame.reason.starts_with("TOKEN_EXPIRED: "), "{frame}");
}

#[tokio::test]
async fn a_provider_that_drops_its_keys_ends_streams() {
    let (provider, next) = (Provider::new(), Provider::new());
    let server = start(&provider).await;
    let token = provider.token("EdDSA", &claims("drive", 60));
    let mut client = server.sessions().await;
    let (_ask, mut answers) = open_stream(&mut client, &token).await;
    std::fs::write(provider.jwks(), next.public().to_string()).unwrap();
    let ended = timeout(Duration::from_millis(1500), answers.message()).await;
    let status = ended.expect("an end in time").unwrap_err();
    assert_eq!(status.code(), tonic::Code::Unauthenticated, "{status}");
    assert!(status.message().contains("the key was removed"), "{status}");
}

#[tokio::test]
async fn a_tenants_admin_does_not_read_the_metrics_of_all() {
    let provider = Provider::new();
    let server = start(&provider).await;
    let of_tenant = provider.token("EdDSA", &claims("admin", 60));
    let (status, message) = get(&server, "/metrics", &of_tenant).await;
    assert_eq!(status, StatusCode::FORBIDDEN, "{message}");
    assert!(message.contains("a key of the role metrics"), "{message}");
    assert_eq!(get(&server, "/v1/packs", &of_tenant).await.0, StatusCode::OK);
    let of_all = provider.token("EdDSA", &with(claims("admin", 60), "tenant", Value::Null));
    assert_eq!(get(&server, "/metrics", &of_all).await.0, StatusCode::OK);
}

#[tokio::test]
async fn other_tokens_are_refused_and_say_why() {
    let (provider, stranger) = (Provider::new(), Provider::new());
    let server = start(&provider).await;
    let good = || claims("drive", 60);
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs();
    let ed = |claims: Value| provider.token("EdDSA", &claims);
    let header = |alg: &str| json!({ "alg": alg, "kid": "ed" });
    let good_token = ed(good());
    let (head, signature) = good_token.rsplit_once('.').unwrap();
    // HS256 by the public key: a classic, where a server takes the algorithm from the token.
    let secret = provider.ed.public_key().as_ref();
    let message = format!(
        "{}.{}",
        base64(header("HS256").to_string()),
        base64(good().to_string())
    );
    let hmac = ring::hmac::sign(
        &ring::hmac::Key::new(ring::hmac::HMAC_SHA256, secret),
        message.as_bytes(),
    );
    let too_long = "x".repeat(129);
    for (token, why) in [
        (provider.signed(&header("none"), &good()), "no JWT signed with"),
        (format!("{message}.{}", base64(hmac)), "no JWT signed with"),
        (provider.signed(&header("HS256"), &good()), "no JWT signed with"),
        (format!("{head}."), "signature"),
        (format!("{head}.{}", &signature[4..]), "signature"),
        (stranger.token("EdDSA", &good()), "signature"),
        (stranger.token("ES256", &good()), "signature"),
        (
            provider.signed(&json!({ "alg": "EdDSA", "kid": "es" }), &good()),
            "signature",
        ),
        (ed(claims("drive", -60)), "expired"),
        (ed(with(good(), "nbf", json!(now + 60))), "not valid yet"),
        (
            ed(with(good(), "iss", json!("https://evil.example"))),
            "iss is not jwt_issuer",
        ),
        (ed(with(good(), "iss", Value::Null)), "iss is not jwt_issuer"),
        (ed(with(good(), "aud", json!("other"))), "aud is not jwt_audience"),
        (ed(with(good(), "aud", Value::Null)), "aud is not jwt_audience"),
        (ed(with(good(), "exp", Value::Null)), "a claim is missing"),
        (ed(with(good(), "role", json!("boss"))), "a claim is missing"),
        (ed(with(good(), "role", Value::Null)), "a claim is missing"),
        (ed(with(good(), "sub", json!(""))), "a claim is missing"),
        (ed(with(good(), "tenant", json!(too_long))), "a claim is missing"),
        ("a.b.c".to_owned(), "no JWT"),
        ("a.b".to_owned(), "no JWT"),
        (keys::new_key(), "a key that the server does not know"),
    ] {
        let (status, message) = get(&server, "/v1/packs", &token).await;
        assert_eq!(status, StatusCode::UNAUTHORIZED, "{why}: {message}");
        assert!(message.contains(why), "{why} is not in {message}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn keys_count_beside_tokens_and_the_provider_may_change_its_own() {
    let (provider, next) = (Provider::new(), Provider::new());
    let key = keys::new_key();
    let file = provider.folder.path().join("keys.toml");
    std::fs::write(&file, keys::entry("game", Role::Drive, &key)).unwrap();
    let jwks = provider.jwks();
    // Without jwt_issuer and jwt_audience any issuer counts, and no audience.
    let server = TestServer::start_with(|config| {
        config.jwks = Some(jwks);
        config.keys = Some(file);
    })
    .await;
    let claims = with(claims("drive", 60), "aud", Value::Null);
    let (old, new) = (provider.token("ES256", &claims), next.token("ES256", &claims));
    let status = async |bearer: &str| get(&server, "/v1/packs", bearer).await.0;
    assert_eq!(status(&key).await, StatusCode::OK);
    assert_eq!(status(&old).await, StatusCode::OK);
    let for_others = provider.token("ES256", &with(claims.clone(), "aud", json!("other")));
    assert_eq!(status(&for_others).await, StatusCode::UNAUTHORIZED);

    std::fs::write(provider.jwks(), "{}").unwrap();
    server.handle.reload();
    tokio::time::sleep(Duration::from_millis(300)).await;
    assert_eq!(status(&old).await, StatusCode::OK);

    std::fs::write(provider.jwks(), next.public().to_string()).unwrap();
    let changed = async {
        while status(&new).await != StatusCode::OK {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    };
    timeout(Duration::from_secs(10), changed)
        .await
        .expect("the new keys count");
    assert_eq!(status(&old).await, StatusCode::UNAUTHORIZED);
    assert_eq!(status(&key).await, StatusCode::OK);
}
