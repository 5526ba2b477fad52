//! What clients do, and what they learn.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

use futures_util::{SinkExt as _, StreamExt as _};
use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;
use serde_json::json;
use tokio::time::{Instant, sleep, timeout};
use tokio_tungstenite::tungstenite::Message;
use troupe_proto::v1;
use troupe_proto::v1::drive_response::Message as Say;

use super::engine::Gate;
use super::net::{Answer, Dial, Http, request};

/// A request that was sent as a whole.
#[derive(Debug)]
pub(super) struct Asked {
    pub(super) at: Instant,
    /// None while it waits, and where the connection was cut.
    pub(super) answered: Option<Instant>,
    pub(super) torn: bool,
}

/// What a client knows of a session, and when it learned that.
#[derive(Debug, Default)]
pub(super) struct Known {
    pub(super) created: Option<Instant>,
    pub(super) commands: Vec<(u64, Instant)>,
    pub(super) frames: Vec<(u64, Instant)>,
    pub(super) close_asked: bool,
    pub(super) closed: Option<Instant>,
}

/// A stream that has a session.
#[derive(Debug, Default)]
pub(super) struct Streamed {
    pub(super) since: Option<Instant>,
    /// The client closed it itself, or reads no more.
    pub(super) leaves: Option<Instant>,
    pub(super) deaf: bool,
    pub(super) reason: Option<v1::Problem>,
    pub(super) close_code: Option<u16>,
    pub(super) ended: Option<Instant>,
}

impl Streamed {
    fn leave(&mut self, deaf: bool) {
        self.leaves = Some(Instant::now());
        self.deaf = deaf;
    }
}

#[derive(Debug, Default)]
pub(super) struct Log {
    pub(super) asked: Vec<Asked>,
    pub(super) halves: usize,
    pub(super) sessions: BTreeMap<String, Known>,
    pub(super) streams: Vec<Streamed>,
}

/// What all clients share.
#[derive(Clone)]
pub(super) struct World {
    pub(super) dial: Dial,
    pub(super) gate: Gate,
    pub(super) log: Arc<Mutex<Log>>,
}

impl World {
    pub(super) fn log(&self) -> MutexGuard<'_, Log> {
        self.log.lock().unwrap()
    }
}

/// A client that asks one thing after the other.
pub(super) struct Caller {
    world: World,
    random: ChaCha8Rng,
    id: String,
    open: bool,
    sequence: u64,
    http: Option<Http>,
}

/// What a caller asks.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Create,
    Command,
    Step,
    Close,
    List,
}

impl Caller {
    pub(super) fn new(world: World, random: ChaCha8Rng, id: String) -> Self {
        Self {
            world,
            random,
            id,
            open: false,
            sequence: 0,
            http: None,
        }
    }

    /// Goes on until the server is gone.
    pub(super) async fn run(mut self) {
        loop {
            sleep(Duration::from_millis(self.random.random_range(0..150))).await;
            if self.http.is_none() {
                let Some(stream) = self.world.dial.connect() else {
                    return;
                };
                self.http = Some(Http::new(stream));
            }
            let kind = self.choose();
            self.ask(kind).await;
        }
    }

    fn choose(&mut self) -> Kind {
        match self.random.random_range(0..10) {
            _ if !self.open => Kind::Create,
            0..4 => Kind::Command,
            4..7 => Kind::Step,
            7 => Kind::Close,
            _ => Kind::List,
        }
    }

    fn request(&mut self, kind: Kind) -> Vec<u8> {
        let id = &self.id;
        let mut command = || {
            self.sequence += 1;
            json!({ "session_id": id, "sequence": self.sequence, "locomote": { "velocity": { "z": 1.0 } } })
        };
        match kind {
            Kind::Create => request(
                "POST",
                "/v1/sessions",
                &json!({ "sessions": [{ "id": id }] }).to_string(),
            ),
            Kind::Command => request(
                "POST",
                "/v1/commands",
                &json!({ "commands": [command()] }).to_string(),
            ),
            Kind::Step => {
                let body = json!({ "session_ids": [id], "frames": 4, "commands": [command()] });
                request("POST", "/v1/step", &body.to_string())
            }
            Kind::Close => request("DELETE", &format!("/v1/sessions/{id}"), ""),
            Kind::List => request("GET", "/v1/packs", ""),
        }
    }

    async fn ask(&mut self, kind: Kind) {
        let bytes = self.request(kind);
        let sequence = self.sequence;
        let mut http = self.http.take().expect("it is connected");
        if kind != Kind::List && self.random.random_bool(0.2) {
            // Half of it, and the rest later or never.
            self.world.log().halves += 1;
            let half = self.random.random_range(1..bytes.len());
            http.send(&bytes[..half]).await;
            sleep(Duration::from_millis(self.random.random_range(0..2500))).await;
            if self.random.random_bool(0.4) {
                return;
            }
            http.send(&bytes[half..]).await;
        } else {
            http.send(&bytes).await;
        }
        if kind == Kind::Step {
            self.world.gate.step_begins();
        }
        let asked = {
            let mut log = self.world.log();
            log.asked.push(Asked {
                at: Instant::now(),
                answered: None,
                torn: false,
            });
            let known = log.sessions.entry(self.id.clone()).or_default();
            known.close_asked |= kind == Kind::Close;
            log.asked.len() - 1
        };
        let answer = http.answer().await;
        if kind == Kind::Step {
            self.world.gate.step_ends();
        }
        match answer {
            Answer::Whole(status, body) => {
                assert_eq!(status, 200, "{kind:?}: {}", String::from_utf8_lossy(&body));
                assert!(http.rest().is_empty(), "{kind:?} was answered twice");
                self.world.log().asked[asked].answered = Some(Instant::now());
                self.learn(kind, sequence, &body);
                self.http = Some(http);
            }
            Answer::None => self.start_over(),
            Answer::Torn => {
                self.world.log().asked[asked].torn = true;
                self.start_over();
            }
        }
    }

    /// The outcome of the request is unknown: the client goes on with another session.
    fn start_over(&mut self) {
        self.id.push('x');
        self.open = false;
        self.sequence = 0;
    }

    fn learn(&mut self, kind: Kind, sequence: u64, body: &[u8]) {
        let now = Instant::now();
        let mut log = self.world.log();
        let known = log.sessions.entry(self.id.clone()).or_default();
        match kind {
            Kind::Create => {
                known.created = Some(now);
                self.open = true;
            }
            Kind::Command => known.commands.push((sequence, now)),
            Kind::Step => {
                let answer: v1::StepResponse = serde_json::from_slice(body).unwrap();
                let block = &answer.blocks[0];
                known.commands.push((sequence, now));
                known
                    .frames
                    .push((block.first_frames[0] + u64::from(block.frame_count) - 1, now));
            }
            Kind::Close => {
                known.closed = Some(now);
                drop(log);
                self.start_over();
            }
            Kind::List => {}
        }
    }
}

/// A client with a live stream of one session.
pub(super) async fn stream(world: World, mut random: ChaCha8Rng, id: String) {
    let Some(connection) = world.dial.connect() else {
        return;
    };
    let mut http = Http::new(connection);
    let create = json!({ "sessions": [{ "id": id }] }).to_string();
    http.send(&request("POST", "/v1/sessions", &create)).await;
    let Answer::Whole(200, _) = http.answer().await else {
        return;
    };
    world.log().sessions.entry(id.clone()).or_default().created = Some(Instant::now());
    let Some(connection) = world.dial.connect() else {
        return;
    };
    let handshake = tokio_tungstenite::client_async("ws://localhost/v1/drive", connection).await;
    let Ok((mut socket, _)) = handshake else { return };
    let mut say = vec![
        json!({ "open": { "rate_hz": 30 } }),
        json!({ "attach": { "session_ids": [id] } }),
    ];
    for sequence in 1..=random.random_range(0..4) {
        let command =
            json!({ "session_id": id, "sequence": sequence, "locomote": { "velocity": { "x": 0.5 } } });
        say.push(json!({ "command": { "commands": [command] } }));
    }
    for message in say {
        if socket.send(Message::text(message.to_string())).await.is_err() {
            return;
        }
    }
    let place = {
        let mut log = world.log();
        log.streams.push(Streamed::default());
        log.streams.len() - 1
    };
    // How long it reads.
    let patience = Duration::from_millis(random.random_range(0..6000));
    let (leaves, deaf) = (random.random_bool(0.2), random.random_bool(0.1));
    let until = Instant::now()
        + if leaves || deaf {
            patience
        } else {
            Duration::from_secs(3600)
        };
    loop {
        let left = until.saturating_duration_since(Instant::now());
        let message = match timeout(left, socket.next()).await {
            Ok(Some(Ok(message))) => message,
            Ok(_) => break,
            Err(_) => {
                world.log().streams[place].leave(deaf);
                if deaf {
                    sleep(Duration::from_secs(3600)).await;
                }
                let _ = socket.close(None).await;
                return;
            }
        };
        let mut log = world.log();
        let streamed = &mut log.streams[place];
        match message {
            Message::Text(text) => match serde_json::from_str::<v1::DriveResponse>(&text).unwrap().message {
                Some(Say::Attached(attached)) => {
                    assert!(attached.problems.is_empty(), "{attached:?}");
                    streamed.since = Some(Instant::now());
                }
                Some(Say::Closing(closing)) => streamed.reason = closing.reason,
                _ => assert!(streamed.reason.is_none(), "something comes after the reason"),
            },
            Message::Close(frame) => streamed.close_code = frame.map(|frame| frame.code.into()),
            _ => {}
        }
    }
    world.log().streams[place].ended = Some(Instant::now());
}
