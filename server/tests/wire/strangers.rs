//! What one client may do to others, with default limits: attacker and victim on connections of their own.

use std::fmt::Write as _;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use tokio_stream::wrappers::ReceiverStream;
use troupe_proto::v1;
use troupe_proto::v1::command::Intent;
use troupe_proto::v1::drive_request::Message as Ask;
use troupe_proto::v1::drive_response::Message as Say;

use crate::common::TestServer;
use crate::common::calls::{Client, ids, options, walk};
use crate::common::scenes::{STOOL, put_scene, put_stool, scenes};

/// How long `/healthz` may take while somebody attacks.
const HEALTH_LIMIT: Duration = Duration::from_millis(100);
/// How long an attack goes on.
const ATTACK: Duration = Duration::from_secs(3);

/// Somebody who drives one character and asks how the server is.
struct Victim {
    stop: Arc<AtomicBool>,
    ticks: JoinHandle<(u64, u64)>,
    health: JoinHandle<Duration>,
}

impl Victim {
    async fn start(server: &TestServer) -> Self {
        let mut client = server.sessions().await;
        create(&mut client, vec![options("victim")]).await;
        let stop = Arc::new(AtomicBool::new(false));
        let (ask, mut answers) = drive(&mut client, &["victim".to_owned()]).await;
        let stopped = stop.clone();
        let ticks = tokio::spawn(async move {
            let _ask = ask;
            let (mut seen, mut dropped) = (0, 0);
            while !stopped.load(Ordering::Relaxed) {
                let answer = answers.message().await.unwrap().unwrap();
                if let Some(Say::Frames(frames)) = answer.message {
                    seen += 1;
                    dropped = frames.dropped_ticks;
                }
            }
            (seen, dropped)
        });
        let (url, stopped) = (server.url("/healthz"), stop.clone());
        let health = tokio::spawn(async move {
            let http = reqwest::Client::new();
            let mut worst = Duration::ZERO;
            while !stopped.load(Ordering::Relaxed) {
                let asked = Instant::now();
                http.get(&url).send().await.unwrap().error_for_status().unwrap();
                worst = worst.max(asked.elapsed());
                tokio::time::sleep(Duration::from_millis(10)).await;
            }
            worst
        });
        Self { stop, ticks, health }
    }

    /// Ends, and looks at what it went through.
    async fn unharmed(self) {
        self.stop.store(true, Ordering::Relaxed);
        let (seen, dropped) = self.ticks.await.unwrap();
        let worst = self.health.await.unwrap();
        println!("victim: {seen} ticks, {dropped} dropped; /healthz at most {worst:?}");
        assert!(seen > 30, "{seen} ticks");
        assert_eq!(dropped, 0, "of {seen}");
        assert!(worst <= HEALTH_LIMIT, "/healthz took {worst:?}");
    }
}

async fn create(client: &mut Client, sessions: Vec<v1::SessionOptions>) {
    client
        .create_sessions(v1::CreateSessionsRequest { sessions })
        .await
        .unwrap();
}

type Ends = (
    mpsc::Sender<v1::DriveRequest>,
    tonic::Streaming<v1::DriveResponse>,
);

/// A stream with those sessions, which walk.
async fn drive(client: &mut Client, names: &[String]) -> Ends {
    let (ask, asked) = mpsc::channel(16);
    let answers = client
        .drive(ReceiverStream::new(asked))
        .await
        .unwrap()
        .into_inner();
    let commands = names.iter().map(|id| walk(id, 1, (0.0, 1.2))).collect();
    for message in [
        Ask::Open(v1::DriveOpen::default()),
        Ask::Attach(v1::DriveAttach {
            session_ids: names.to_vec(),
        }),
        Ask::Command(v1::CommandRequest { commands }),
    ] {
        let message = Some(message);
        ask.send(v1::DriveRequest { message }).await.unwrap();
    }
    (ask, answers)
}

/// A scene of hulls that all lie on each other, and stools among them.
fn pile(colliders: usize, stools: usize) -> String {
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
fn in_the_pile(names: &[String]) -> Vec<v1::SessionOptions> {
    let inside = |id: &String| v1::SessionOptions {
        scene: "pile".to_owned(),
        ..options(id)
    };
    names.iter().map(inside).collect()
}

async fn put_pile(server: &TestServer, colliders: usize, stools: usize) {
    let mut client = scenes(server).await;
    put_stool(&mut client, STOOL).await.unwrap();
    put_scene(&mut client, &pile(colliders, stools)).await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn crowds_in_a_scene_of_overlapping_hulls_cost_others_no_tick() {
    let server = TestServer::start().await;
    put_pile(&server, 512, 0).await;
    let mut attacker = server.sessions().await;
    let mut streams = Vec::new();
    for stream in ["a", "b"] {
        let names = ids(stream, 256);
        create(&mut attacker, in_the_pile(&names)).await;
        streams.push(drive(&mut attacker, &names).await);
    }
    let victim = Victim::start(&server).await;
    let until = Instant::now() + ATTACK;
    let attacks = streams.into_iter().map(|(ask, mut answers)| {
        tokio::spawn(async move {
            let _ask = ask;
            let mut late = 0;
            while Instant::now() < until {
                if let Some(Say::Frames(frames)) = answers.message().await.unwrap().unwrap().message {
                    late = frames.dropped_ticks;
                }
            }
            late
        })
    });
    for attack in attacks.collect::<Vec<_>>() {
        println!("an attacker's dropped ticks: {}", attack.await.unwrap());
    }
    victim.unharmed().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_step_of_many_interactions_among_many_objects_holds_up_nobody() {
    let server = TestServer::start().await;
    put_pile(&server, 256, 2048).await;
    let mut attacker = server.sessions().await;
    let names = ids("a", 512);
    create(&mut attacker, in_the_pile(&names)).await;
    let victim = Victim::start(&server).await;
    let interact = |(index, id): (usize, &String)| v1::Command {
        session_id: id.clone(),
        sequence: 1,
        intent: Some(Intent::Interact(v1::Interact {
            instance: format!("s{}", 2047 - index),
            ..v1::Interact::default()
        })),
        ..v1::Command::default()
    };
    let request = v1::StepRequest {
        commands: names.iter().enumerate().map(interact).collect(),
        session_ids: names.clone(),
        frames: 30,
        ..v1::StepRequest::default()
    };
    let asked = Instant::now();
    let answer = tokio::time::timeout(ATTACK, attacker.step(request)).await;
    println!(
        "the attacker's step: {:?}, answered: {}",
        asked.elapsed(),
        answer.is_ok()
    );
    tokio::time::sleep(Duration::from_millis(1500)).await;
    victim.unharmed().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_step_ends_at_its_deadline() {
    let limit = Duration::from_millis(400);
    let server = TestServer::start_with(|config| config.request_timeout_ms = limit.as_millis() as u64).await;
    put_pile(&server, 256, 0).await;
    let mut attacker = server.sessions().await;
    let names = ids("a", 1024);
    for some in names.chunks(64) {
        create(&mut attacker, in_the_pile(some)).await;
    }
    let request = v1::StepRequest {
        session_ids: names,
        frames: 120,
        ..v1::StepRequest::default()
    };
    let asked = Instant::now();
    let answer = attacker.step(request).await;
    let late = asked.elapsed();
    assert_eq!(answer.unwrap_err().code(), tonic::Code::DeadlineExceeded);
    assert!(late < limit + HEALTH_LIMIT, "{late:?}");
}
