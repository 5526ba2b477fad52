//! Calls besides in-betweening: packs, health, metrics, reflection and the OpenAPI description.

use serde_json::Value;
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_check_response::ServingStatus;
use tonic_health::pb::health_client::HealthClient;
use tonic_reflection::pb::v1::ServerReflectionRequest;
use tonic_reflection::pb::v1::server_reflection_client::ServerReflectionClient;
use tonic_reflection::pb::v1::server_reflection_request::MessageRequest;
use tonic_reflection::pb::v1::server_reflection_response::MessageResponse;

use crate::motion::{character, request};
use crate::server::shared;

async fn get(path: &str) -> (u16, String) {
    let answer = reqwest::get(shared().path(path)).await.unwrap();
    (answer.status().as_u16(), answer.text().await.unwrap())
}

async fn get_json(path: &str) -> Value {
    let (status, text) = get(path).await;
    assert_eq!(status, 200, "{path}: {text}");
    serde_json::from_str(&text).unwrap_or_else(|e| panic!("{path}: {e}: {text}"))
}

#[tokio::test]
async fn the_server_is_alive_and_ready() {
    assert_eq!(get("/healthz").await.0, 200);
    assert_eq!(get("/readyz").await.0, 200);
    assert_eq!(get("/nothing/here").await.0, 404);
}

#[tokio::test]
async fn grpc_health_says_serving() {
    let mut health = HealthClient::new(shared().channel().await);
    for service in ["", "troupe.v1.Motion"] {
        let request = HealthCheckRequest {
            service: service.to_owned(),
        };
        let answer = health.check(request).await.unwrap().into_inner();
        assert_eq!(answer.status(), ServingStatus::Serving, "`{service}`");
    }
}

#[tokio::test]
async fn reflection_lists_and_describes_the_service() {
    let mut reflection = ServerReflectionClient::new(shared().channel().await);
    let mut ask = async |message| {
        let request = ServerReflectionRequest {
            host: String::new(),
            message_request: Some(message),
        };
        let answers = reflection
            .server_reflection_info(tokio_stream::once(request))
            .await
            .unwrap();
        let answer = answers.into_inner().message().await.unwrap().expect("an answer");
        answer.message_response.expect("a message")
    };
    let MessageResponse::ListServicesResponse(list) = ask(MessageRequest::ListServices(String::new())).await
    else {
        panic!("no list")
    };
    assert!(
        list.service
            .iter()
            .any(|service| service.name == "troupe.v1.Motion"),
        "{list:?}"
    );
    let symbol = MessageRequest::FileContainingSymbol("troupe.v1.InBetweenRequest".to_owned());
    let MessageResponse::FileDescriptorResponse(files) = ask(symbol).await else {
        panic!("no descriptor")
    };
    assert!(!files.file_descriptor_proto.is_empty());
}

#[tokio::test]
async fn packs_are_the_same_over_http() {
    let pack = shared().pack().await;
    let of = pack.description();
    let list = get_json("/v1/packs").await;
    assert_eq!(list["packs"][0]["name"], of.name);
    let one = get_json(&format!("/v1/packs/{}", of.name)).await;
    assert_eq!(one["content_hash"], of.content_hash);
    assert_eq!(one["joints"].as_array().unwrap().len(), of.joints.len());
    let (status, text) = get("/v1/packs/missing").await;
    assert!(status == 404 && text.contains("missing"), "{status}: {text}");
}

#[tokio::test]
async fn the_api_description_is_complete() {
    let api = get_json("/openapi.json").await;
    assert!(
        api["openapi"].as_str().unwrap().starts_with("3."),
        "{}",
        api["openapi"]
    );
    for (path, method) in [
        ("/v1/inbetween", "post"),
        ("/v1/packs", "get"),
        ("/v1/packs/{name}", "get"),
        ("/healthz", "get"),
        ("/readyz", "get"),
        ("/metrics", "get"),
    ] {
        let responses = &api["paths"][path][method]["responses"];
        assert!(responses["200"].is_object(), "{method} {path}: {responses}");
    }
    // Every reference resolves, and the description of the request is complete.
    let mut found = 0;
    each_reference(&api, &mut |reference| {
        found += 1;
        let pointer = reference
            .strip_prefix('#')
            .expect("a reference inside the document");
        assert!(api.pointer(pointer).is_some(), "{reference} leads nowhere");
    });
    assert!(found > 5, "{found} references");
    for (schema, field) in [
        ("InBetweenRequest", "characters"),
        ("Character", "context"),
        ("Pose", "rotations"),
    ] {
        let properties = &api["components"]["schemas"][schema]["properties"];
        assert!(properties[field].is_object(), "{schema}.{field}: {properties}");
    }
}

fn each_reference(value: &Value, visit: &mut impl FnMut(&str)) {
    match value {
        Value::Object(entries) => {
            for (key, inner) in entries {
                match inner {
                    Value::String(reference) if key == "$ref" => visit(reference),
                    _ => each_reference(inner, visit),
                }
            }
        }
        Value::Array(items) => items.iter().for_each(|item| each_reference(item, visit)),
        _ => {}
    }
}

#[tokio::test]
async fn metrics_count_requests_and_batches() {
    let server = shared();
    let pack = server.pack().await;
    server.post(&request([character(&pack)])).await.unwrap();
    let (status, text) = get("/metrics").await;
    assert_eq!(status, 200);
    for name in [
        "troupe_requests_total",
        "troupe_request_duration_seconds_bucket",
        "troupe_queue_duration_seconds_bucket",
        "troupe_inference_duration_seconds_bucket",
        "troupe_batch_size_bucket",
        "troupe_frames_generated_total",
    ] {
        assert!(text.contains(&format!("\n{name}{{")), "{name} is not in:\n{text}");
    }
}
