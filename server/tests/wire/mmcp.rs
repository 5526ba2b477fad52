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
    assert_eq!(
        words["supported_segments"],
        json!(["text", "motion_reference", "unconditioned"])
    );

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

/// A segment that goes by a body that slides `z` metres ahead in `count` frames, 30 a second.
fn like(model: &Value, count: usize, z: f64, frames: usize) -> Value {
    let joints = model["canonical_skeleton"]["joints"].as_array().unwrap();
    let names: Vec<&Value> = joints.iter().map(|joint| &joint["name"]).collect();
    let roots = (0..count).map(|frame| json!([0.0, 0.9, z * frame as f64 / (count - 1) as f64]));
    json!({
        "type": "motion_reference",
        "duration_frames": frames,
        "joint_names": names,
        "rotations": vec![vec![[0, 0, 0, 1]; names.len()]; count],
        "root_positions": roots.collect::<Vec<_>>(),
        "fps": 30,
    })
}

#[tokio::test]
async fn a_motion_in_the_place_of_words_is_put_into_words() {
    let server = words_server().await;
    let capabilities = capabilities(&server).await;
    let (toy, words) = (model(&capabilities, "toy"), model(&capabilities, "words"));
    assert_eq!(words["supports_motion_reference_mixed"], true);
    assert_eq!(words["limits"]["max_reference_frames"], 1024);
    assert_eq!(toy["supports_motion_reference_mixed"], false);
    assert!(toy["limits"].get("max_reference_frames").is_none());

    let segments = json!([
        like(words, 31, 1.5, 12),
        text("sit down", 8),
        like(words, 5, 0.5, 12),
        free(20)
    ]);
    let (status, made) = call(&server, &request(words, segments)).await;
    assert_eq!(status, 200, "{made}");
    let extension = &made["extensions"]["MMCP_motion"];
    assert_eq!(extension["samples"][0]["num_frames"], 52);
    let notes = extension["notes"].as_array().unwrap();
    let read: Vec<&str> = notes
        .iter()
        .filter(|note| note["code"] == "motion_reference")
        .map(|note| note["message"].as_str().unwrap())
        .collect();
    let of = |words: &str| format!("a motion of the request was read as {words:?}");
    assert_eq!(read, [of("walks 1.5 m"), of("walks 0.5 m")]);
    // As a prompt of these words does it.
    let segments = json!([text("walks 1.5 m", 12)]);
    let (_, said) = call(&server, &request(words, segments)).await;
    assert_eq!(said["extensions"]["MMCP_motion"]["samples"][0]["num_frames"], 12);

    // The rate is the motion's own, and joints may be left out.
    let mut slow = like(words, 11, 1.5, 12);
    slow["fps"] = json!(10);
    slow["joint_names"].as_array_mut().unwrap().truncate(1);
    for pose in slow["rotations"].as_array_mut().unwrap() {
        pose.as_array_mut().unwrap().truncate(1);
    }
    let (status, made) = call(&server, &request(words, json!([slow]))).await;
    assert_eq!(status, 200, "{made}");
}

#[tokio::test]
async fn what_is_wrong_with_a_motion_in_the_place_of_words_is_named() {
    type Change = fn(&mut Value);
    let server = words_server().await;
    let capabilities = capabilities(&server).await;
    let words = model(&capabilities, "words");
    let own = words["canonical_skeleton"].clone();
    let mut foreign = own.clone();
    foreign["joints"][1]["name"] = json!("Elsewhere");
    let cases: [(Change, &str, &str); 10] = [
        (|s| s["fps"] = json!(0), "schema_validation", "segments[0].fps"),
        (
            |s| s["rotations"] = json!([[[0, 0, 0, 1]]]),
            "schema_validation",
            "segments[0].rotations",
        ),
        (
            |s| s["rotations"][3] = json!([]),
            "schema_validation",
            "segments[0].rotations[3]",
        ),
        (
            |s| s["rotations"][3][1] = json!([0, 0, 0, 0]),
            "schema_validation",
            "segments[0].rotations[3][1]",
        ),
        (
            |s| s["root_positions"] = json!([]),
            "schema_validation",
            "segments[0].root_positions",
        ),
        (
            |s| s["root_positions"][2] = json!([0, 1e6, 0]),
            "schema_validation",
            "segments[0].root_positions[2]",
        ),
        (
            |s| s["joint_names"][1] = json!("Elsewhere"),
            "unknown_joint",
            "segments[0].joint_names[1]",
        ),
        (
            |s| s["joint_names"][1] = s["joint_names"][0].clone(),
            "schema_validation",
            "segments[0].joint_names[1]",
        ),
        (
            |s| s["duration_frames"] = json!(0),
            "schema_validation",
            "segments[0].duration_frames",
        ),
        (
            |s| s["speed"] = json!(1),
            "schema_validation",
            "segments[0].speed",
        ),
    ];
    for (change, code, field) in cases {
        let mut segment = like(words, 8, 0.5, 12);
        change(&mut segment);
        let (_, refused) = call(&server, &request(words, json!([segment]))).await;
        let error = &refused["error"];
        assert_eq!(
            (&error["code"], &error["details"]["field"]),
            (&json!(code), &json!(field)),
            "{error}"
        );
    }
    let mut rootless = like(words, 8, 0.5, 12);
    rootless["joint_names"] = json!([own["joints"][1]["name"]]);
    rootless["rotations"] = json!(vec![vec![[0, 0, 0, 1]]; 8]);
    let (_, refused) = call(&server, &request(words, json!([rootless]))).await;
    assert_eq!(refused["error"]["code"], "invalid_request", "{refused}");
    let (_, refused) = call(&server, &request(words, json!([like(words, 1025, 9.0, 12)]))).await;
    assert_eq!(refused["error"]["code"], "invalid_options", "{refused}");
    assert_eq!(refused["error"]["details"]["max_reference_frames"], 1024);
    for (skeleton, status) in [(own, 200), (foreign, 400)] {
        let mut segment = like(words, 8, 0.5, 12);
        segment["skeleton"] = skeleton;
        let (found, answer) = call(&server, &request(words, json!([segment]))).await;
        assert_eq!(found, status, "{answer}");
        if status == 400 {
            assert_eq!(answer["error"]["code"], "retargeting_unsupported");
            assert_eq!(
                answer["error"]["details"]["field"],
                "segments[0].skeleton.joints[1].name"
            );
        }
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
