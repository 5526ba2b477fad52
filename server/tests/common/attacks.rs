//! What attackers send. The example `attacks` of `troupe-tests` sends the same to a server of its
//! own.

use std::fmt::Write as _;
use std::time::Duration;

use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;
use tokio::time::timeout;
use troupe_proto::v1;
use troupe_proto::v1::command::Intent;

use super::TestServer;
use super::calls::{Client, options};
use super::scenes::{STOOL, put_scene, put_stool, scenes};

/// Opens sessions in one call.
pub async fn create(client: &mut Client, sessions: Vec<v1::SessionOptions>) {
    client
        .create_sessions(v1::CreateSessionsRequest { sessions })
        .await
        .unwrap();
}

/// A scene `pile` of hulls that all lie on each other, and stools among them.
pub fn pile(colliders: usize, stools: usize) -> String {
    let mut text = "format = 1\nname = \"pile\"\n".to_owned();
    for index in 0..colliders {
        let points: Vec<String> = (0..48)
            .map(|point| {
                let (angle, side) = (f64::from(point) * 0.26, if point % 2 == 0 { -1.0 } else { 1.0 });
                let far = 40.0 + index as f64 * 0.01;
                format!("[{:.3}, {side:.1}, {:.3}]", far * angle.cos(), far * angle.sin())
            })
            .collect();
        let points = points.join(", ");
        let _ = writeln!(
            text,
            "[[colliders]]\nid = \"c{index}\"\nposition_m = [0.0, -0.9, 0.0]\nshape = {{ convex = {{ points_m = [{points}] }} }}"
        );
    }
    for index in 0..stools {
        let (x, z) = (index % 64, index / 64);
        let _ = writeln!(
            text,
            "[[objects]]\nid = \"s{index}\"\ndefinition = \"stool\"\nposition_m = [{:.2}, 0.1, {:.2}]",
            x as f64 * 0.3,
            2.0 + z as f64 * 0.3
        );
    }
    text
}

/// Sessions in the pile.
pub fn in_the_pile(names: &[String]) -> Vec<v1::SessionOptions> {
    let inside = |id: &String| v1::SessionOptions {
        scene: "pile".to_owned(),
        ..options(id)
    };
    names.iter().map(inside).collect()
}

/// Puts the pile, and what its stools are.
pub async fn put_pile(server: &TestServer, colliders: usize, stools: usize) {
    let mut client = scenes(server).await;
    put_stool(&mut client, STOOL).await.unwrap();
    put_scene(&mut client, &pile(colliders, stools)).await.unwrap();
}

/// A second's step in which each session begins to use a stool of its own, of so many.
pub fn interactions(names: &[String], stools: usize) -> v1::StepRequest {
    let interact = |(index, id): (usize, &String)| v1::Command {
        session_id: id.clone(),
        sequence: 1,
        intent: Some(Intent::Interact(v1::Interact {
            instance: format!("s{}", stools - 1 - index),
            ..v1::Interact::default()
        })),
        ..v1::Command::default()
    };
    v1::StepRequest {
        commands: names.iter().enumerate().map(interact).collect(),
        session_ids: names.to_vec(),
        frames: 30,
        ..v1::StepRequest::default()
    }
}

/// A small body whose answer is as large as can be: a step of 120 frames with all columns, as JSON.
pub fn large_step(names: &[String]) -> Vec<u8> {
    let request = serde_json::json!({
        "session_ids": names, "frames": 120, "return_positions": true, "return_six_d": true
    });
    request.to_string().into_bytes()
}

/// A connection that has sent the start of a request.
pub async fn begin(server: &TestServer, path: &str, length: usize, body: &[u8]) -> TcpStream {
    let mut stream = server.tcp().await;
    let head = format!(
        "POST {path} HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\ncontent-length: {length}\r\n\r\n"
    );
    stream.write_all(head.as_bytes()).await.unwrap();
    stream.write_all(body).await.unwrap();
    stream
}

/// The first bytes of an answer.
pub async fn answer(stream: &mut TcpStream) -> String {
    let mut bytes = vec![0; 4096];
    let read = timeout(Duration::from_secs(10), stream.read(&mut bytes)).await;
    let count = read.expect("an answer in time").unwrap();
    String::from_utf8_lossy(&bytes[..count]).into_owned()
}
