//! What a server tells of its requests: ids, traces, refusals.

use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;
use tokio_tungstenite::connect_async;
use tokio_tungstenite::tungstenite::client::IntoClientRequest as _;
use tonic_types::StatusExt as _;
use troupe_proto::v1;
use troupe_server::api::ErrorBody;

use crate::common::{TestServer, request};

const ID: &str = "x-request-id";

/// The id of an answer over HTTP.
fn id_of(response: &reqwest::Response) -> String {
    response.headers()[ID].to_str().unwrap().to_owned()
}

async fn get(server: &TestServer, path: &str, id: &str) -> reqwest::Response {
    let request = reqwest::Client::new().get(server.url(path)).header(ID, id);
    request.send().await.unwrap()
}

#[tokio::test]
async fn every_answer_over_http_has_an_id() {
    let server = TestServer::start().await;
    for path in ["/v1/packs", "/healthz", "/metrics", "/docs/", "/openapi.json"] {
        let (one, other) = (server.get(path).await, server.get(path).await);
        assert!(one.status().is_success(), "{path}");
        assert_ne!(id_of(&one), id_of(&other), "{path}");
        assert_eq!(id_of(&get(&server, path, "mine-1").await), "mine-1", "{path}");
    }
    let long = "a".repeat(65);
    for unfit in ["a b", "<script>", long.as_str()] {
        let id = id_of(&get(&server, "/healthz", unfit).await);
        assert!(id.len() == 36 && id != unfit, "{id}");
    }
}

#[tokio::test]
async fn errors_over_http_name_their_request() {
    let server = TestServer::start().await;
    for path in ["/v1/packs/none", "/nowhere", "/v1/sessions?page_size=x"] {
        let response = get(&server, path, "mine-2").await;
        assert!(response.status().is_client_error(), "{path}");
        assert_eq!(id_of(&response), "mine-2", "{path}");
        let body: ErrorBody = response.json().await.unwrap();
        assert_eq!(body.error.request_id.as_deref(), Some("mine-2"), "{path}");
    }
    let refused = reqwest::Client::new()
        .get(server.url("/v1/packs"))
        .header("origin", "http://evil.example")
        .send()
        .await
        .unwrap();
    let id = id_of(&refused);
    let body: ErrorBody = refused.json().await.unwrap();
    assert_eq!(body.error.request_id, Some(id));
}

#[tokio::test]
async fn answers_and_errors_over_grpc_have_an_id() {
    let server = TestServer::start().await;
    let mut client = server.grpc().await;
    let answer = client.in_between(request(1)).await.unwrap();
    assert_eq!(answer.metadata().get(ID).unwrap().len(), 36);
    let mut wrong = tonic::Request::new(v1::GetPackRequest { name: "none".into() });
    wrong.metadata_mut().insert(ID, "mine-3".parse().unwrap());
    let status = client.get_pack(wrong).await.unwrap_err();
    assert_eq!(status.metadata().get(ID).unwrap(), "mine-3");
    let details = status.get_error_details();
    assert_eq!(details.request_info().unwrap().request_id, "mine-3");
}

#[tokio::test]
async fn sockets_and_connections_beyond_the_limit_have_an_id() {
    let server = TestServer::start_with(|config| config.max_connections = 1).await;
    let url = server.url("/v1/drive").replace("http", "ws");
    let mut asked = url.into_client_request().unwrap();
    asked.headers_mut().insert(ID, "mine-4".parse().unwrap());
    let (_socket, response) = connect_async(asked).await.unwrap();
    assert_eq!(response.headers()[ID], "mine-4");

    let mut stream = TcpStream::connect(server.handle.address()).await.unwrap();
    let head = format!("GET /v1/packs HTTP/1.1\r\nhost: localhost\r\n{ID}: mine-5\r\n\r\n");
    stream.write_all(head.as_bytes()).await.unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.unwrap();
    assert!(answer.starts_with("HTTP/1.1 503"), "{answer}");
    assert!(
        answer.contains(&format!("{ID}: mine-5")) && answer.contains("\"request_id\":\"mine-5\""),
        "{answer}"
    );
}
