//! The Motion Model Context Protocol with a model of words.

use serde_json::{Value, json};

use super::*;

async fn call(server: &ServerHandle, body: &Value) -> (u16, Value) {
    let url = format!("http://{}/generate", server.address());
    let answer = reqwest::Client::new().post(url).json(body).send().await.unwrap();
    (answer.status().as_u16(), answer.json().await.unwrap())
}

async fn model(server: &ServerHandle) -> Value {
    let url = format!("http://{}/capabilities", server.address());
    let capabilities: Value = reqwest::get(url).await.unwrap().json().await.unwrap();
    capabilities["models"][0].clone()
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

fn text(prompt: &str, frames: usize) -> Value {
    json!({"type": "text", "prompt": prompt, "duration_frames": frames})
}

/// A segment that goes by a body that slides ahead.
fn like(model: &Value, count: usize, fps: usize) -> Value {
    let joints = model["canonical_skeleton"]["joints"].as_array().unwrap();
    let names: Vec<&Value> = joints.iter().map(|joint| &joint["name"]).collect();
    let roots = (0..count).map(|frame| json!([0.0, 0.9, 0.03 * frame as f32]));
    json!({
        "type": "motion_reference",
        "duration_frames": 40,
        "joint_names": names,
        "rotations": vec![vec![[0, 0, 0, 1]; names.len()]; count],
        "root_positions": roots.collect::<Vec<_>>(),
        "fps": fps,
    })
}

fn notes<'a>(answer: &'a Value, code: &str) -> Vec<&'a str> {
    let notes = answer["extensions"]["MMCP_motion"]["notes"].as_array().unwrap();
    let of = notes.iter().filter(|note| note["code"] == code);
    of.map(|note| note["message"].as_str().unwrap()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn segments_of_words_and_of_motion_follow_each_other() {
    let (server, _) = start().await;
    let model = model(&server).await;
    assert_eq!(model["supported_segments"], json!(["text", "motion_reference"]));
    assert_eq!(model["limits"]["max_reference_frames"], 256);
    // Longer than a reply, of words that are not all known, shorter than a context.
    let segments = json!([
        text("an old robot walks", 300),
        like(&model, 40, 30),
        text("someone waves", 9),
        text("someone walks", 30),
    ]);
    let mut body = request(&model, segments);
    body["options"]["num_samples"] = json!(2);
    let (status, made) = call(&server, &body).await;
    assert_eq!(status, 200, "{made}");
    let samples = made["extensions"]["MMCP_motion"]["samples"].as_array().unwrap();
    for sample in samples {
        assert_eq!(sample["num_frames"], 379);
        let boundaries = sample["chunk_boundaries"].as_array().unwrap();
        assert_eq!(*boundaries, [300, 340, 349].map(|frame| json!(frame)));
    }
    assert_eq!(
        notes(&made, "unknown_words"),
        ["captions of the pack's training have not used: robot"]
    );
    let read = notes(&made, "motion_reference");
    assert!(
        (1..=2).contains(&read.len()),
        "each sample reads it for itself: {read:?}"
    );
    assert!(read[0].starts_with("a motion of the request was read as "));
    let (_, again) = call(&server, &body).await;
    assert_eq!(again, made, "the same seed");
}

#[tokio::test(flavor = "multi_thread")]
async fn what_the_model_cannot_read_is_named() {
    let (server, _) = start().await;
    let model = model(&server).await;
    for (segment, field, allowed) in [
        (
            text(&"zz ".repeat(60), 30),
            "segments[0].prompt",
            "at most 40 pieces",
        ),
        (
            text("走", 30),
            "segments[0].prompt",
            "letters that the pack can read",
        ),
        (like(&model, 3, 30), "segments[0].rotations", "4 to 259"),
        (like(&model, 200, 15), "segments[0].rotations", "4 to 259"),
        (like(&model, 257, 30), "segments[0].rotations", "at most 256"),
    ] {
        let (status, refused) = call(&server, &request(&model, json!([segment]))).await;
        let error = &refused["error"];
        assert_eq!(
            (status, &error["code"]),
            (400, &json!("invalid_options")),
            "{error}"
        );
        let details = &error["details"];
        assert_eq!(
            (&details["field"], &details["allowed"]),
            (&json!(field), &json!(allowed))
        );
    }
}
