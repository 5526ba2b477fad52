//! Web pages of other sites, and names that are not the server's.

use futures_util::StreamExt as _;
use prost::Message as _;
use reqwest::header::HeaderMap;
use reqwest::{Method, StatusCode};
use tokio_tungstenite::connect_async;
use tokio_tungstenite::tungstenite::Error;
use tokio_tungstenite::tungstenite::client::IntoClientRequest as _;
use tonic::Code;
use troupe_server::api::ErrorBody;

use std::path::PathBuf;

use crate::common::{TestServer, framed, request};
use troupe_edge::clients::Role;
use troupe_edge::keys;
use troupe_proto::v1;
use troupe_server::config::{Config, WithoutKeys};

async fn ask(server: &TestServer, method: Method, path: &str, headers: &[(&str, &str)]) -> reqwest::Response {
    let mut request = reqwest::Client::new().request(method, server.url(path));
    for &(name, value) in headers {
        request = request.header(name, value);
    }
    request.send().await.unwrap()
}

async fn assert_refused(response: reqwest::Response, field: &str) {
    assert_eq!(response.status(), StatusCode::FORBIDDEN);
    assert!(!response.headers().contains_key("access-control-allow-origin"));
    let body: ErrorBody = response.json().await.unwrap();
    let error = body.error;
    assert_eq!(
        (error.code.as_str(), error.reason.as_str(), error.field.as_deref()),
        ("PERMISSION_DENIED", "NOT_ALLOWED", Some(field))
    );
    assert!(error.message.contains(field), "{}", error.message);
}

#[tokio::test]
async fn pages_of_other_sites_are_refused() {
    let server = TestServer::start().await;
    for path in ["/v1/packs", "/metrics", "/docs/", "/nowhere"] {
        let response = ask(&server, Method::GET, path, &[("origin", "http://evil.example")]).await;
        assert_refused(response, "Origin").await;
    }
    let own = server.url("");
    let response = ask(&server, Method::GET, "/v1/packs", &[("origin", &own)]).await;
    assert_eq!(response.status(), StatusCode::OK);
    // A page may send such a request without asking first, but its browser says where the page is
    // from.
    let response = ask(
        &server,
        Method::POST,
        "/v1/sessions",
        &[("origin", "null"), ("content-type", "text/plain")],
    );
    assert_refused(response.await, "Origin").await;
}

#[tokio::test]
async fn pages_of_other_sites_get_no_stream() {
    let server = TestServer::start_with(|config| {
        config.allowed_origins = vec!["https://app.example".parse().unwrap()];
    })
    .await;
    let url = server.url("/v1/drive").replace("http", "ws");
    let from = |origin: &str| {
        let mut request = url.as_str().into_client_request().unwrap();
        request.headers_mut().insert("origin", origin.parse().unwrap());
        request
    };
    let Err(Error::Http(refused)) = connect_async(from("https://evil.example")).await else {
        panic!("not refused");
    };
    assert_eq!(refused.status(), 403);
    for origin in [server.url(""), "https://app.example".to_owned()] {
        let (mut socket, _) = connect_async(from(&origin)).await.unwrap();
        socket.close(None).await.unwrap();
        while let Some(Ok(_)) = socket.next().await {}
    }
}

#[tokio::test]
async fn names_that_are_not_the_servers_are_refused() {
    let server = TestServer::start_with(|config| {
        config.allowed_hosts = vec!["troupe.example".parse().unwrap()];
    })
    .await;
    // The page of `evil.example`, which now has the server's address.
    let rebound = [
        ("host", "evil.example:8080"),
        ("origin", "http://evil.example:8080"),
    ];
    assert_refused(ask(&server, Method::GET, "/v1/packs", &rebound).await, "Host").await;
    for host in ["localhost:9", "troupe.example:443"] {
        let response = ask(&server, Method::GET, "/v1/packs", &[("host", host)]).await;
        assert_eq!(response.status(), StatusCode::OK, "{host}");
    }
}

#[tokio::test]
async fn listed_origins_get_cors_headers() {
    let server = TestServer::start_with(|config| {
        config.allowed_origins = vec!["https://app.example".parse().unwrap()];
    })
    .await;
    let header = |headers: &HeaderMap, name: &str| {
        let value = headers
            .get(name)
            .unwrap_or_else(|| panic!("no {name} in {headers:?}"));
        value.to_str().unwrap().to_owned()
    };
    let preflight = |origin| {
        let headers = [
            ("origin", origin),
            ("access-control-request-method", "PUT"),
            ("access-control-request-headers", "content-type"),
        ];
        let server = &server;
        async move { ask(server, Method::OPTIONS, "/v1/scenes/yard", &headers).await }
    };
    let response = preflight("https://app.example").await;
    assert_eq!(response.status(), StatusCode::OK);
    assert_eq!(
        header(response.headers(), "access-control-allow-origin"),
        "https://app.example"
    );
    assert!(header(response.headers(), "access-control-allow-methods").contains("PUT"));
    assert!(header(response.headers(), "access-control-allow-headers").contains("content-type"));
    assert_refused(preflight("https://evil.example").await, "Origin").await;

    // Errors can be read by the page too.
    let response = ask(
        &server,
        Method::GET,
        "/v1/packs/dragon",
        &[("origin", "https://app.example")],
    )
    .await;
    assert_eq!(response.status(), StatusCode::NOT_FOUND);
    assert_eq!(
        header(response.headers(), "access-control-allow-origin"),
        "https://app.example"
    );
}

#[tokio::test]
async fn a_body_must_be_said_to_be_json() {
    let server = TestServer::start().await;
    let json = serde_json::to_vec(&request(1)).unwrap();
    let post = |form: Option<&'static str>| {
        let mut call = reqwest::Client::new()
            .post(server.url("/v1/inbetween"))
            .body(json.clone());
        if let Some(form) = form {
            call = call.header("content-type", form);
        }
        async move { call.send().await.unwrap() }
    };
    for form in [
        "application/json",
        "Application/JSON; charset=utf-8",
        "application/vnd.troupe+json",
    ] {
        assert_eq!(post(Some(form)).await.status(), StatusCode::OK, "{form}");
    }
    for form in [
        None,
        Some("text/plain"),
        Some("application/x-www-form-urlencoded"),
        Some("application/jsonp"),
    ] {
        let response = post(form).await;
        assert_eq!(response.status(), StatusCode::UNSUPPORTED_MEDIA_TYPE, "{form:?}");
        let error = response.json::<ErrorBody>().await.unwrap().error;
        assert_eq!(error.field.as_deref(), Some("Content-Type"));
        assert_eq!(error.allowed.as_deref(), Some("application/json"));
    }
    server
        .metric(
            r#"troupe_requests_total{rpc="InBetween",code="INVALID_ARGUMENT"}"#,
            "4",
        )
        .await;
}

#[tokio::test]
async fn grpc_is_asked_for_an_origin_only_if_it_has_one() {
    let server = TestServer::start().await;
    server.grpc().await.in_between(request(1)).await.unwrap();
    let body = framed(&request(1).encode_to_vec());
    let (status, text) = server.raw_grpc(body, ("origin", "http://evil.example")).await;
    assert_eq!(status, (Code::PermissionDenied as i32).to_string());
    assert!(text.contains("Origin"), "{text}");
}

/// A file of keys, one for each role.
struct KeyFile {
    path: PathBuf,
    drive: String,
    author: String,
    admin: String,
}

impl KeyFile {
    fn new(test: &str) -> Self {
        let path = std::env::temp_dir().join(format!("troupe-keys-{test}-{}.toml", std::process::id()));
        let [drive, author, admin] = [(); 3].map(|()| keys::new_key());
        let text = keys::entry("drive", Role::Drive, &drive)
            + &keys::entry("author", Role::Author, &author)
            + &keys::entry("admin", Role::Admin, &admin);
        std::fs::write(&path, text).unwrap();
        Self {
            path,
            drive,
            author,
            admin,
        }
    }
}

impl Drop for KeyFile {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

#[tokio::test]
async fn a_key_allows_what_its_role_allows() {
    let file = KeyFile::new("roles");
    let path = file.path.clone();
    let server = TestServer::start_with(move |config| config.keys = Some(path)).await;
    let status = |method: Method, path: &'static str, key: Option<&str>| {
        let bearer = key.map(|key| format!("Bearer {key}"));
        let server = &server;
        async move {
            let headers: Vec<_> = bearer
                .iter()
                .map(|bearer| ("authorization", bearer.as_str()))
                .collect();
            ask(server, method, path, &headers).await.status().as_u16()
        }
    };
    for open in ["/healthz", "/readyz", "/docs/", "/openapi.json"] {
        assert_eq!(status(Method::GET, open, None).await, 200, "{open}");
    }
    let (drive, author, admin) = (file.drive.as_str(), file.author.as_str(), file.admin.as_str());
    let delete = "/v1/scenes/nowhere";
    for (method, path, key, expected) in [
        (Method::GET, "/v1/packs", None, 401),
        (Method::GET, "/v1/packs", Some("troupe_wrong"), 401),
        (Method::GET, "/nowhere", None, 401),
        (Method::GET, "/v1/drive", None, 401),
        (Method::GET, "/v1/packs", Some(drive), 200),
        (Method::DELETE, delete, Some(drive), 403),
        (Method::DELETE, delete, Some(author), 404),
        (Method::GET, "/metrics", Some(author), 403),
        (Method::GET, "/metrics", Some(admin), 200),
        (Method::DELETE, delete, Some(admin), 404),
    ] {
        assert_eq!(status(method, path, key).await, expected, "{path} {key:?}");
    }
    let response = ask(&server, Method::GET, "/v1/packs", &[]).await;
    assert_eq!(response.headers()["www-authenticate"], "Bearer");
    let error = response.json::<ErrorBody>().await.unwrap().error;
    assert_eq!(
        (error.code.as_str(), error.reason.as_str(), error.field.as_deref()),
        ("UNAUTHENTICATED", "KEY_MISSING", Some("Authorization"))
    );

    let mut client = server.grpc().await;
    let status = client.in_between(request(1)).await.unwrap_err();
    assert_eq!(status.code(), Code::Unauthenticated);
    let keyed = |message, key: &str| {
        let mut call = tonic::Request::new(message);
        let bearer = format!("Bearer {key}").parse().unwrap();
        call.metadata_mut().insert("authorization", bearer);
        call
    };
    client.in_between(keyed(request(1), drive)).await.unwrap();
    let mut scenes = v1::scenes_client::ScenesClient::new(server.channel().await);
    let put = |key: &str| {
        let mut call = tonic::Request::new(v1::DeleteSceneRequest::default());
        let bearer = format!("Bearer {key}").parse().unwrap();
        call.metadata_mut().insert("authorization", bearer);
        call
    };
    let status = scenes.delete_scene(put(drive)).await.unwrap_err();
    assert_eq!(status.code(), Code::PermissionDenied);
    assert!(
        status.message().contains("allowed: author or admin"),
        "{}",
        status.message()
    );
    let status = scenes.delete_scene(put(author)).await.unwrap_err();
    assert_ne!(status.code(), Code::PermissionDenied);
}

#[tokio::test]
async fn a_server_that_others_reach_needs_keys_or_an_option() {
    let start = |change: fn(&mut Config)| async move {
        let listener = tokio::net::TcpListener::bind("0.0.0.0:0").await.unwrap();
        let mut config = Config::local(std::path::Path::new("unused")).unwrap();
        change(&mut config);
        troupe_server::server::serve_packs(config, listener, || Ok(Vec::new())).await
    };
    let Err(error) = start(|_| {}).await else {
        panic!("it started");
    };
    let text = error.to_string();
    for part in [
        "listen is 0.0.0.0:",
        "keys",
        "without_keys",
        "one-time-key or anyone",
    ] {
        assert!(text.contains(part), "{part} is not in {text}");
    }
    let open = start(|config| config.without_keys = WithoutKeys::Anyone)
        .await
        .unwrap();
    assert!(!open.asks_for_keys() && open.one_time_key().is_none());
    open.shut_down().await;

    let locked = start(|config| config.without_keys = WithoutKeys::OneTimeKey)
        .await
        .unwrap();
    let port = locked.address().port();
    let url = format!("http://127.0.0.1:{port}/metrics");
    let ask = reqwest::Client::new().get(&url);
    assert_eq!(ask.send().await.unwrap().status(), StatusCode::UNAUTHORIZED);
    let key = locked.one_time_key().unwrap().to_owned();
    let ask = reqwest::Client::new()
        .get(&url)
        .header("authorization", format!("Bearer {key}"));
    assert_eq!(ask.send().await.unwrap().status(), StatusCode::OK);
    locked.shut_down().await;
}
