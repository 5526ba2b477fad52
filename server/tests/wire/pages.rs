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

use crate::common::{TestServer, framed, request};

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
    // A page may send such a request without asking first, but its browser says where the page is from.
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
async fn origins_that_are_listed_are_told_so() {
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
