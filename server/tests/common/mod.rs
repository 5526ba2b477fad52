//! A server on a free port of the loopback interface, over an engine that answers with straight
//! lines.

pub mod attacks;
pub mod calls;
pub mod robot;
pub mod scenes;

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex};
use std::time::{Duration, Instant};

use tokio::net::{TcpListener, TcpStream};
use tonic::transport::Channel;
use troupe_character::testing::toy_rig;
use troupe_engine::pack::testing::pack_of;
use troupe_engine::pack::{Pack, Stage};
use troupe_engine::{DecoderOutput, EngineError, PoseOutput, RootInput, RootOutput, Stages, TokenInput};
use troupe_live::session::TimeSource;
use troupe_motion::model::{Dims, Rig};
use troupe_proto::v1;
use troupe_proto::v1::motion_client::MotionClient;
use troupe_proto::v1::sessions_client::SessionsClient;
use troupe_server::config::Config;
use troupe_server::server::{PackSource, ServerHandle, serve_packs_at};

/// Folder of the test packs: their styles.
pub const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/toy");

/// Joints of the test pack.
pub const JOINTS: usize = 2;

/// A door that an engine waits at before each batch.
#[derive(Clone, Default)]
pub struct Gate(Arc<Door>);

#[derive(Default)]
struct Door {
    closed: Mutex<bool>,
    opened: Condvar,
    broken: AtomicBool,
    row_us: AtomicU64,
    running: AtomicU64,
}

impl Gate {
    pub fn close(&self) {
        *self.0.closed.lock().unwrap() = true;
    }

    pub fn open(&self) {
        *self.0.closed.lock().unwrap() = false;
        self.0.opened.notify_all();
    }

    /// Has every batch fail, or not any more.
    pub fn set_broken(&self, broken: bool) {
        self.0.broken.store(broken, Ordering::Relaxed);
    }

    /// Has every batch take so long for each of its rows.
    pub fn set_row_time(&self, time: Duration) {
        self.0.row_us.store(time.as_micros() as u64, Ordering::Relaxed);
    }

    /// Number of batches that run at the moment.
    pub fn running(&self) -> u64 {
        self.0.running.load(Ordering::SeqCst)
    }

    fn pass(&self, rows: usize) -> Result<(), EngineError> {
        self.0.running.fetch_add(1, Ordering::SeqCst);
        let passed = self.pass_now(rows);
        self.0.running.fetch_sub(1, Ordering::SeqCst);
        passed
    }

    fn pass_now(&self, rows: usize) -> Result<(), EngineError> {
        let mut closed = self.0.closed.lock().unwrap();
        while *closed {
            closed = self.0.opened.wait(closed).unwrap();
        }
        drop(closed);
        let row_us = self.0.row_us.load(Ordering::Relaxed);
        if row_us > 0 {
            std::thread::sleep(Duration::from_micros(row_us * rows as u64));
        }
        match self.0.broken.load(Ordering::Relaxed) {
            false => Ok(()),
            true => Err(EngineError::Run {
                stage: Stage::Root,
                reason: "set to fail".into(),
            }),
        }
    }
}

/// Time that a test moves on.
#[derive(Clone, Default)]
pub struct HandClock(Arc<AtomicU64>);

impl HandClock {
    pub fn pass(&self, time: Duration) {
        self.0.fetch_add(time.as_millis() as u64, Ordering::Relaxed);
    }

    fn source(&self) -> TimeSource {
        let (start, passed) = (Instant::now(), self.0.clone());
        TimeSource::new(move || start + Duration::from_millis(passed.load(Ordering::Relaxed)))
    }
}

/// Goes straight from the last context root to the last target root, with all joints unturned and
/// every token 1.
pub struct StraightLine {
    pub dims: Dims,
    pub gate: Gate,
}

impl Stages for StraightLine {
    fn root(&mut self, rows: usize, input: &RootInput, output: &mut RootOutput) -> Result<(), EngineError> {
        self.gate.pass(rows)?;
        let (slots, frames) = (self.dims.slots(), self.dims.max_frames());
        for row in 0..rows {
            let allowed = input.allowed_counts.row(row);
            let score = |index: usize| allowed[index] * 10.0 + input.count_noise.row(row)[index];
            let best = (0..allowed.len())
                .max_by(|&a, &b| score(a).total_cmp(&score(b)))
                .unwrap();
            let tokens = self.dims.min_tokens + best;
            output.num_tokens.fill_row(row, tokens as i64);
            let share = 1.0 / allowed.iter().sum::<f32>();
            for (probability, allowed) in output.count_probs.row_mut(row).iter_mut().zip(allowed) {
                *probability = allowed * share;
            }
            let root = |slot: usize| &input.key_global_root.row(row)[slot * 5..slot * 5 + 5];
            let given = |slot: &usize| input.has_global_root.row(row)[*slot] == 1.0;
            let from = self.dims.context_frames - 1;
            let to = (0..slots).rfind(given).unwrap_or(from);
            for frame in 0..frames {
                let t =
                    (frame as f32 - from as f32) / (tokens * self.dims.frames_per_token - 1 - from) as f32;
                for axis in 0..5 {
                    let value = root(from)[axis] + (root(to)[axis] - root(from)[axis]) * t;
                    output.global_root.row_mut(row)[frame * 5 + axis] = value;
                }
            }
        }
        Ok(())
    }

    fn pose(&mut self, rows: usize, _: &TokenInput, output: &mut PoseOutput) -> Result<(), EngineError> {
        for row in 0..rows {
            for logits in output.logits.row_mut(row).chunks_mut(self.dims.codes) {
                logits.fill(0.0);
                logits[1] = 1.0;
            }
        }
        Ok(())
    }

    fn decoder(
        &mut self,
        rows: usize,
        input: &TokenInput,
        output: &mut DecoderOutput,
    ) -> Result<(), EngineError> {
        for row in 0..rows {
            output
                .global_root
                .row_mut(row)
                .copy_from_slice(input.global_root.row(row));
            for six_d in output.rotations.row_mut(row).chunks_mut(6) {
                six_d.copy_from_slice(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
            }
            output.contacts.fill_row(row, 0.5);
        }
        Ok(())
    }
}

pub fn pack(name: &str) -> Pack {
    let rig = Rig {
        name: name.to_owned(),
        ..toy_rig()
    };
    let mut pack = pack_of(rig);
    pack.folder = FOLDER.into();
    pack
}

pub struct TestServer {
    pub handle: ServerHandle,
    pub gate: Gate,
    /// The time of expiry; it stands still until a test moves it.
    pub clock: HandClock,
}

impl TestServer {
    /// A ready server with the packs `toy` (the default) and `other`.
    pub async fn start() -> Self {
        Self::start_with(|_| {}).await
    }

    pub async fn start_with(change: impl FnOnce(&mut Config)) -> Self {
        let mut server = Self::start_unready(change, Duration::ZERO).await;
        server.handle.ready().await.unwrap();
        server
    }

    /// A server whose packs, of `config.workers` workers or one, take `load_time` to load.
    pub async fn start_unready(change: impl FnOnce(&mut Config), load_time: Duration) -> Self {
        Self::start_also(change, load_time, |_| Vec::new()).await
    }

    /// The same with more packs, which `more` makes for so many workers.
    pub async fn start_also(
        change: impl FnOnce(&mut Config),
        load_time: Duration,
        more: impl FnOnce(usize) -> Vec<PackSource> + Send + 'static,
    ) -> Self {
        let mut config = Config::local(Path::new("unused")).unwrap();
        config.default_pack = Some("toy".into());
        change(&mut config);
        let workers = config.workers.max(1);
        let gate = Gate::default();
        let for_engine = gate.clone();
        let packs = move || {
            std::thread::sleep(load_time);
            let source = |name: &str| {
                let gate = for_engine.clone();
                let stages = move |pack: &Pack| {
                    Ok(Box::new(StraightLine {
                        dims: pack.rig.dims,
                        gate: gate.clone(),
                    }) as Box<dyn Stages>)
                };
                PackSource::of_stages(pack(name), workers, Box::new(stages), None)
            };
            let mut packs = vec![source("toy"), source("other")];
            packs.extend(more(workers));
            Ok(packs)
        };
        let listener = TcpListener::bind(config.listen).await.unwrap();
        let clock = HandClock::default();
        let handle = serve_packs_at(config, listener, clock.source(), packs)
            .await
            .unwrap();
        Self { handle, gate, clock }
    }

    pub fn url(&self, path: &str) -> String {
        format!("http://{}{path}", self.handle.address())
    }

    pub async fn grpc(&self) -> MotionClient<Channel> {
        MotionClient::new(self.channel().await).max_decoding_message_size(usize::MAX)
    }

    pub async fn sessions(&self) -> SessionsClient<Channel> {
        SessionsClient::new(self.channel().await).max_decoding_message_size(usize::MAX)
    }

    pub async fn channel(&self) -> Channel {
        Channel::from_shared(self.url(""))
            .unwrap()
            .connect()
            .await
            .unwrap()
    }

    /// A connection on which nothing was said.
    pub async fn tcp(&self) -> TcpStream {
        TcpStream::connect(self.handle.address()).await.unwrap()
    }

    pub async fn get(&self, path: &str) -> reqwest::Response {
        reqwest::get(self.url(path)).await.unwrap()
    }

    /// A call over HTTP with a JSON body.
    pub async fn send(
        &self,
        method: reqwest::Method,
        path: &str,
        body: &impl serde::Serialize,
    ) -> reqwest::Response {
        let request = reqwest::Client::new().request(method, self.url(path));
        request.json(body).send().await.unwrap()
    }

    /// `POST /v1/inbetween` with any body.
    pub async fn post(&self, body: impl Into<reqwest::Body>) -> reqwest::Response {
        reqwest::Client::new()
            .post(self.url("/v1/inbetween"))
            .header("content-type", "application/json")
            .body(body)
            .send()
            .await
            .unwrap()
    }

    /// A gRPC call of InBetween with any body and one more header; gives the status and its text,
    /// empty if they are in the trailers.
    pub async fn raw_grpc(&self, body: Vec<u8>, header: (&'static str, &'static str)) -> (String, String) {
        let client = reqwest::Client::builder()
            .http2_prior_knowledge()
            .build()
            .unwrap();
        let response = client
            .post(self.url("/troupe.v1.Motion/InBetween"))
            .header("content-type", "application/grpc")
            .header("te", "trailers")
            .header(header.0, header.1)
            .body(body)
            .send()
            .await
            .unwrap();
        let header = |name: &str| {
            response
                .headers()
                .get(name)
                .map(|value| value.to_str().unwrap().to_owned())
                .unwrap_or_default()
        };
        (header("grpc-status"), header("grpc-message"))
    }

    /// Waits until `/metrics` has a line that starts with `name` and ends with `value`.
    pub async fn metric(&self, name: &str, value: &str) {
        let mut text = String::new();
        for _ in 0..1000 {
            text = self.handle.service().telemetry().render();
            if text
                .lines()
                .any(|line| line.starts_with(name) && line.ends_with(&format!(" {value}")))
            {
                return;
            }
            tokio::time::sleep(Duration::from_millis(2)).await;
        }
        panic!("{name} never became {value}:\n{text}");
    }
}

/// A keyframe at `(x, 0.9, z)` that faces +Z, with a straight pose.
pub fn keyframe(x: f32, z: f32) -> v1::Keyframe {
    let rotations = [1.0, 0.0, 0.0, 0.0].repeat(JOINTS);
    v1::Keyframe {
        root: Some(v1::Root {
            position: Some(v1::Vec3 { x, y: 0.9, z }),
            heading: None,
        }),
        velocity: None,
        qpos: Vec::new(),
        pose: Some(v1::Pose {
            rotations,
            root_height: None,
        }),
    }
}

/// Walks along +Z and is asked to be at `(x, 3)` at the end.
pub fn character(x: f32) -> v1::Character {
    v1::Character {
        id: format!("to {x}"),
        context: (0..4)
            .map(|frame| keyframe(0.0, 0.1 * frame as f32 - 0.3))
            .collect(),
        targets: vec![keyframe(x, 3.0)],
        frame_count: Some(40),
        ..v1::Character::default()
    }
}

pub fn request(characters: usize) -> v1::InBetweenRequest {
    let characters = (0..characters)
        .map(|index| character(index as f32 * 0.1))
        .collect();
    v1::InBetweenRequest {
        pack: String::new(),
        characters,
        skeleton: String::new(),
    }
}

/// A message in gRPC framing.
pub fn framed(message: &[u8]) -> Vec<u8> {
    let length = u32::try_from(message.len()).unwrap();
    [&[0], length.to_be_bytes().as_slice(), message].concat()
}
