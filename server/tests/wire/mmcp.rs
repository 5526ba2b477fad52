//! The Motion Model Context Protocol: what needs no real networks.

use std::time::Duration;

use serde_json::{Value, json};

use crate::common::TestServer;
use crate::generate::words_server;

/// Status and body of a call.
async fn call(server: &TestServer, body: &Value) -> (u16, Value) {
    let answer = server.send(reqwest::Method::POST, "/generate", body).await;
    (answer.status().as_u16(), answer.json().await.unwrap())
}

async fn capabilities(server: &TestServer) -> Value {
    server.get("/capabilities").await.json().await.unwrap()
}

fn model<'a>(capabilities: &'a Value, id: &str) -> &'a Value {
    let models = capabilities["models"].as_array().unwrap();
    models.iter().find(|model| model["id"] == id).unwrap()
}

fn request(model: &Value, segments: Value) -> Value {
    json!({
        "protocol_version": "1.4",
        "model": model["id"],
        "skeleton": model["canonical_skeleton"],
        "segments": segments,
        "options": {"seed": 3},
    })
}

fn free(frames: usize) -> Value {
    json!({"type": "unconditioned", "duration_frames": frames})
}

fn text(prompt: &str, frames: usize) -> Value {
    json!({"type": "text", "prompt": prompt, "duration_frames": frames})
}

#[tokio::test]
async fn words_are_for_packs_that_know_them() {
    let server = words_server().await;
    let capabilities = capabilities(&server).await;
    let (toy, words) = (model(&capabilities, "toy"), model(&capabilities, "words"));
    assert_eq!(
        capabilities["models"][0]["id"], "toy",
        "the default pack comes first"
    );
    assert_eq!(toy["supported_segments"], json!(["unconditioned"]));
    assert_eq!(words["supported_segments"], json!(["text", "unconditioned"]));

    let (status, refused) = call(&server, &request(toy, json!([text("walk", 20)]))).await;
    assert_eq!(
        (status, &refused["error"]["code"]),
        (400, &json!("unsupported_segment"))
    );
    assert_eq!(
        refused["error"]["details"]["supported_segments"],
        json!(["unconditioned"])
    );

    let segments = json!([text("walk to the door", 20), free(30), text("sit down", 10)]);
    let (status, made) = call(&server, &request(words, segments)).await;
    assert_eq!(status, 200, "{made}");
    let sample = &made["extensions"]["MMCP_motion"]["samples"][0];
    assert_eq!(sample["num_frames"], 60);
    let boundaries: Vec<u64> = serde_json::from_value(sample["chunk_boundaries"].clone()).unwrap();
    assert!(
        boundaries.contains(&20) && boundaries.contains(&50),
        "{boundaries:?}"
    );
    assert_eq!(sample["trajectory"]["position"].as_array().unwrap().len(), 60);

    let (status, failed) = call(&server, &request(words, json!([text("fail", 5)]))).await;
    assert_eq!(
        (status, &failed["error"]["code"]),
        (500, &json!("internal_error"))
    );
    for (change, code) in [
        (text("  ", 5), "schema_validation"),
        (text(&"x".repeat(1001), 5), "invalid_options"),
        (
            json!({"type": "text", "prompt": "geh", "language": "de", "duration_frames": 5}),
            "invalid_options",
        ),
    ] {
        let (_, error) = call(&server, &request(words, json!([change]))).await;
        assert_eq!(error["error"]["code"], code, "{error}");
    }
}

#[tokio::test]
async fn samples_and_requests_of_a_batch_are_one_batch() {
    let server = words_server().await;
    let capabilities = capabilities(&server).await;
    let words = model(&capabilities, "words");
    let mut body = request(words, json!([text("go on", 8)]));
    body["options"]["num_samples"] = json!(4);
    let batch = json!({"protocol_version": "1.4", "requests": [body, body]});
    let (status, answer) = call(&server, &batch).await;
    assert_eq!(status, 200);
    for result in answer["results"].as_array().unwrap() {
        assert_eq!(result["gltf"]["animations"].as_array().unwrap().len(), 4);
    }
    // All eight jobs are one batch.
    server
        .metric("troupe_batch_size_count{model=\"words\"", "1")
        .await;
    server.metric("troupe_batch_size_sum{model=\"words\"", "8").await;
}

#[tokio::test]
async fn requests_wait_together() {
    let server = TestServer::start().await;
    let capabilities = capabilities(&server).await;
    let mut body = request(model(&capabilities, "toy"), json!([free(20)]));
    body["options"]["num_samples"] = json!(17);
    let (status, error) = call(&server, &body).await;
    assert_eq!(
        (status, &error["error"]["code"]),
        (422, &json!("schema_validation"))
    );
    assert_eq!(error["error"]["details"]["field"], "options.num_samples");
    assert_eq!(error["error"]["details"]["allowed"], "1 to 16");

    server.gate.set_broken(true);
    body["options"]["num_samples"] = json!(1);
    let (status, error) = call(&server, &body).await;
    assert_eq!((status, &error["error"]["code"]), (500, &json!("internal_error")));
    server
        .metric(
            "troupe_requests_total{rpc=\"MmcpGenerate\",code=\"INTERNAL\"",
            "1",
        )
        .await;
}

#[tokio::test]
async fn errors_of_the_edge_have_the_protocols_form() {
    let server = TestServer::start_with(|config| config.request_timeout_ms = 200).await;
    let code = async |request: reqwest::RequestBuilder| {
        let answer = request.send().await.unwrap();
        assert!(answer.headers().contains_key("x-request-id"));
        let status = answer.status().as_u16();
        let body: Value = answer.json().await.unwrap();
        assert!(body["error"]["details"].is_object(), "{body}");
        (status, body["error"]["code"].as_str().unwrap().to_owned())
    };
    let client = reqwest::Client::new();
    let post = || client.post(server.url("/generate"));
    let json = |request: reqwest::RequestBuilder| request.header("content-type", "application/json");
    let is = |status: u16, code: &str| (status, code.to_owned());
    assert_eq!(code(json(post()).body("{")).await, is(422, "schema_validation"));
    assert_eq!(code(post().body("{}")).await, is(422, "schema_validation"));
    assert_eq!(
        code(client.get(server.url("/generate"))).await,
        is(400, "invalid_request")
    );
    assert_eq!(
        code(json(post()).header("origin", "https://evil.example").body("{}")).await,
        is(403, "forbidden")
    );
    let large = " ".repeat((4 << 20) + 1);
    assert_eq!(code(json(post()).body(large)).await, is(413, "payload_too_large"));

    let capabilities = capabilities(&server).await;
    let body = request(model(&capabilities, "toy"), json!([free(20)]));
    server.gate.close();
    assert_eq!(code(post().json(&body)).await, is(504, "timeout"));
    server.gate.open();

    let starting = TestServer::start_unready(|_| {}, Duration::from_secs(5)).await;
    let answer = starting.get("/capabilities").await;
    assert_eq!(answer.status(), 503);
    let body: Value = answer.json().await.unwrap();
    assert_eq!(body["error"]["code"], "model_unavailable");
    // Other routes keep their own form.
    let other: Value = starting.get("/v1/packs").await.json().await.unwrap();
    assert_eq!(other["error"]["code"], "UNAVAILABLE");
}
