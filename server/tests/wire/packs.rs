//! Packs that are loaded, unloaded and swapped while a server runs.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use tokio::net::TcpListener;
use tokio::task::JoinSet;
use tonic::Code;
use tonic_types::StatusExt as _;
use troupe_engine::pack::Pack;
use troupe_engine::{EngineError, Stages};
use troupe_proto::v1;
use troupe_server::config::Config;
use troupe_server::server::{PackSource, Provider, Seen, StartError, serve_from};
use troupe_service::{Offer, Stock};

use crate::common::calls::{frames_of, options, step, stepped, walk};
use crate::common::{Gate, HandClock, StraightLine, TestServer, pack, request};

/// What is wrong with a pack.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Flaw {
    None,
    /// A file has another hash.
    File,
    /// It has other frames.
    Shape,
    /// Its networks do not load.
    Networks,
}

/// Toy packs by name and version.
struct Toys {
    gate: Gate,
    all: Mutex<Vec<(&'static str, &'static str, Flaw)>>,
    /// Looks so far.
    looks: AtomicUsize,
}

impl Toys {
    fn flaw(&self, name: &str, version: &str) -> Flaw {
        let all = self.all.lock().unwrap();
        let found = all.iter().find(|(other, of, _)| (*other, *of) == (name, version));
        found.map_or(Flaw::None, |(.., flaw)| *flaw)
    }
}

impl Provider for Toys {
    fn first(&self) -> Result<Vec<PackSource>, StartError> {
        ["toy", "other"]
            .into_iter()
            .map(|name| self.source(pack(name), 0))
            .collect()
    }

    fn stock(&self) -> Result<Stock, String> {
        let all = self.all.lock().unwrap();
        let offer = |(name, version, _): &(&str, &str, Flaw)| Offer {
            name: (*name).to_owned(),
            version: (*version).to_owned(),
            folder: PathBuf::from(format!("{name}-{version}")),
        };
        Ok(Stock {
            offers: all.iter().map(offer).collect(),
            unusable: vec!["junk: no version".to_owned()],
        })
    }

    fn read(&self, offer: &Offer) -> Result<Pack, StartError> {
        let mut read = pack(&offer.name);
        read.manifest.version.clone_from(&offer.version);
        match self.flaw(&offer.name, &offer.version) {
            Flaw::File => return Err(StartError::Packs("its content hash is another".to_owned())),
            Flaw::Shape => Arc::make_mut(&mut read.rig).fps = 60.0,
            Flaw::None | Flaw::Networks => {}
        }
        Ok(read)
    }

    fn source(&self, pack: Pack, _: usize) -> Result<PackSource, StartError> {
        let (gate, flaw) = (self.gate.clone(), self.flaw(pack.name(), &pack.manifest.version));
        let stages = move |pack: &Pack| match flaw {
            Flaw::Networks => Err(EngineError::Panicked("no network".to_owned())),
            _ => Ok(Box::new(StraightLine {
                dims: pack.rig.dims,
                gate: gate.clone(),
            }) as Box<dyn Stages>),
        };
        Ok(PackSource::of_stages(pack, 1, Box::new(stages), None))
    }

    fn look(&self) -> Result<BTreeMap<PathBuf, Seen>, String> {
        let seen = |offer: Offer| {
            let print = vec![(PathBuf::from("root.onnx"), 1, None)];
            let folder = offer.folder.clone();
            let offer = Some(offer);
            (folder, Seen { print, offer })
        };
        let all = self.stock()?.offers.into_iter().map(seen).collect();
        self.looks.fetch_add(1, Ordering::SeqCst);
        Ok(all)
    }
}

/// A server with `toy` (the default) and `other`, both of version 1.2.3, that can load `all`.
async fn start(all: &[(&'static str, &'static str, Flaw)]) -> TestServer {
    start_watched(all, 0).await.0
}

/// [`start`], and its packs. It looks at them every `watch_packs_s` seconds; 0: never.
async fn start_watched(
    all: &[(&'static str, &'static str, Flaw)],
    watch_packs_s: u64,
) -> (TestServer, Arc<Toys>) {
    let mut config = Config::local(Path::new("unused")).unwrap();
    config.default_pack = Some("toy".into());
    config.watch_packs_s = watch_packs_s;
    let gate = Gate::default();
    let toys = Arc::new(Toys {
        gate: gate.clone(),
        all: Mutex::new(all.to_vec()),
        looks: AtomicUsize::new(0),
    });
    let listener = TcpListener::bind(config.listen).await.unwrap();
    let mut handle = serve_from(config, listener, toys.clone()).await.unwrap();
    handle.ready().await.unwrap();
    let clock = HandClock::default();
    (TestServer { handle, gate, clock }, toys)
}

/// `POST /v1/packs/NAME/CHANGE`: status and body.
async fn post(server: &TestServer, path: &str, version: &str) -> (StatusCode, Value) {
    let body = json!({ "version": version });
    let answer = server
        .send(Method::POST, &format!("/v1/packs/{path}"), &body)
        .await;
    (answer.status(), answer.json().await.unwrap())
}

async fn versions(server: &TestServer) -> Vec<String> {
    let list = server.grpc().await.list_packs(v1::ListPacksRequest {}).await;
    let packs = list.unwrap().into_inner().packs;
    packs
        .iter()
        .map(|pack| format!("{} {}", pack.name, pack.version))
        .collect()
}

/// Waits until these are served.
async fn become_served(server: &TestServer, wanted: &[&str]) {
    for _ in 0..1500 {
        if versions(server).await == wanted {
            return;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    panic!("{:?} are served, and not {wanted:?}", versions(server).await);
}

/// Waits until no pack that is not served is in memory.
async fn all_left(server: &TestServer) {
    for _ in 0..500 {
        let text = server.get("/metrics").await.text().await.unwrap();
        if text.contains("\ntroupe_packs_leaving 0\n") {
            return;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    panic!("a pack stays in memory");
}

/// The largest step of a root over the ground, metres.
fn largest_step(roots: &[f32]) -> f32 {
    let places: Vec<&[f32]> = roots.chunks_exact(3).collect();
    let steps = places
        .windows(2)
        .map(|pair| (pair[1][0] - pair[0][0]).hypot(pair[1][2] - pair[0][2]));
    steps.fold(0.0, f32::max)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_folder_that_is_watched_decides_what_is_served() {
    let first = [("toy", "1.2.3", Flaw::None), ("other", "1.2.3", Flaw::None)];
    let (server, toys) = start_watched(&first, 1).await;
    // Folders count from the first look on.
    while toys.looks.load(Ordering::SeqCst) == 0 {
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    let changed = [
        first[0],
        ("other", "1.3.0", Flaw::None),
        ("new", "1.0.0", Flaw::None),
    ];
    *toys.all.lock().unwrap() = changed.to_vec();
    become_served(&server, &["new 1.0.0", "other 1.3.0", "toy 1.2.3"]).await;
    // What does not load leaves the old one.
    let worse = [first[0], ("other", "1.4.0", Flaw::Networks), changed[1]];
    *toys.all.lock().unwrap() = worse.to_vec();
    become_served(&server, &["other 1.3.0", "toy 1.2.3"]).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_swap_under_a_live_session_loses_no_frame_and_makes_no_jump() {
    let server = start(&[("toy", "2.0.0", Flaw::None)]).await;
    let mut client = server.sessions().await;
    let recorded = v1::SessionOptions {
        record: true,
        ..options("a")
    };
    let sessions = vec![recorded];
    client
        .create_sessions(v1::CreateSessionsRequest { sessions })
        .await
        .unwrap();
    let before = stepped(&mut client, step(&["a"], 60, vec![walk("a", 1, (0.0, 1.2))])).await;
    let swapped = server
        .grpc()
        .await
        .swap_pack(v1::SwapPackRequest {
            name: "toy".into(),
            version: String::new(),
        })
        .await
        .unwrap()
        .into_inner();
    assert_eq!(
        (
            swapped.version.as_str(),
            swapped.changed,
            swapped.replaced_version.as_deref()
        ),
        ("2.0.0", true, Some("1.2.3"))
    );
    let after = stepped(&mut client, step(&["a"], 90, Vec::new())).await;
    assert_eq!((before.frame_count, after.frame_count), (60, 90));
    assert_eq!(after.first_frames[0], before.first_frames[0] + 60);
    let (mut roots, _) = frames_of(&before, 0);
    let usual = largest_step(&roots);
    roots.extend(frames_of(&after, 0).0);
    let most = largest_step(&roots);
    assert!(most <= usual * 1.5, "{most} m after the swap, {usual} m before");
    let frames = "troupe_frames_generated_total{model=\"toy\",version=\"2.0.0\"}";
    let text = server.get("/metrics").await.text().await.unwrap();
    let line = text.lines().find(|line| line.starts_with(frames)).unwrap();
    let made: f64 = line.rsplit(' ').next().unwrap().parse().unwrap();
    assert!(
        made >= 60.0,
        "the session's plans come from the new version: {line}"
    );
    // Its frames are no longer those of the pack that the recording names.
    let session_id = "a".to_owned();
    let recording = client.get_recording(v1::GetRecordingRequest { session_id }).await;
    let recording = recording.unwrap().into_inner();
    let last = recording.lines.lines().last().unwrap();
    assert!(
        recording.ended && last.starts_with("{\"end\":{\"why\":\"swap\""),
        "{last}"
    );
    all_left(&server).await;
    assert_eq!(versions(&server).await, ["other 1.2.3", "toy 2.0.0"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn requests_under_way_end_on_the_version_that_they_began_with() {
    let server = start(&[("toy", "2.0.0", Flaw::None)]).await;
    server.gate.close();
    let mut client = server.grpc().await;
    let call = tokio::spawn(async move { client.in_between(request(1)).await });
    server.metric("troupe_batch_size_count{model=\"toy\"", "1").await;
    server.gate.open();
    // The new version makes a first run at the same gate.
    let (status, body) = post(&server, "toy/swap", "").await;
    assert_eq!(status, StatusCode::OK, "{body}");
    assert_eq!(call.await.unwrap().unwrap().into_inner().pack_version, "1.2.3");
    let next = server.grpc().await.in_between(request(1)).await.unwrap();
    assert_eq!(next.into_inner().pack_version, "2.0.0");
    all_left(&server).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_broken_pack_is_refused_with_the_reason_and_the_old_one_serves_on() {
    let server = start(&[
        ("toy", "2", Flaw::File),
        ("toy", "3", Flaw::Shape),
        ("toy", "4", Flaw::Networks),
    ])
    .await;
    for (version, says) in [
        ("2", "the pack toy 2 is refused: its content hash is another"),
        ("3", "it has 60 frames a second, not 30"),
        ("4", "no network"),
    ] {
        let (status, body) = post(&server, "toy/swap", version).await;
        assert_eq!(status, StatusCode::CONFLICT, "{body}");
        let text = body.to_string();
        assert!(text.contains(says) && text.contains("PACK_REFUSED"), "{text}");
        assert_eq!(versions(&server).await, ["other 1.2.3", "toy 1.2.3"]);
        server.grpc().await.in_between(request(1)).await.unwrap();
    }
    server
        .metric(
            "troupe_pack_changes_total{change=\"swap\",result=\"refused\"}",
            "3",
        )
        .await;
    all_left(&server).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_pack_is_unloaded_under_a_session_which_goes_on() {
    let server = start(&[("other", "1.2.3", Flaw::None)]).await;
    let mut client = server.sessions().await;
    let session = v1::SessionOptions {
        id: "a".into(),
        pack: "other".into(),
        ..v1::SessionOptions::default()
    };
    let create = |session: v1::SessionOptions| v1::CreateSessionsRequest {
        sessions: vec![session],
    };
    client.create_sessions(create(session.clone())).await.unwrap();
    for changed in [true, false] {
        let (status, body) = post(&server, "other/unload", "").await;
        assert_eq!(
            (status, &body["changed"]),
            (StatusCode::OK, &json!(changed)),
            "{body}"
        );
        assert_eq!(
            body["leaving"][0]["name"], "other",
            "the session holds it: {body}"
        );
    }
    assert_eq!(versions(&server).await, ["toy 1.2.3"]);
    let block = stepped(&mut client, step(&["a"], 90, vec![walk("a", 1, (0.0, 1.2))])).await;
    assert_eq!(block.frame_count, 90);
    let another = v1::SessionOptions {
        id: "b".into(),
        ..session
    };
    let error = client.create_sessions(create(another)).await.unwrap_err();
    assert_eq!(
        (error.code(), error.message()),
        (Code::NotFound, "unknown pack \"other\"; loaded: toy")
    );
    let closed = v1::CloseSessionsRequest {
        ids: vec!["a".into()],
    };
    client.close_sessions(closed).await.unwrap();
    all_left(&server).await;

    for changed in [true, false] {
        let (status, body) = post(&server, "other/load", "1.2.3").await;
        assert_eq!(
            (status, &body["changed"]),
            (StatusCode::OK, &json!(changed)),
            "{body}"
        );
    }
    assert_eq!(versions(&server).await, ["other 1.2.3", "toy 1.2.3"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_done_says_what_can() {
    let server = start(&[("toy", "2", Flaw::None), ("new", "1", Flaw::None)]).await;
    let unknown = v1::LoadPackRequest {
        name: "missing".into(),
        version: "7".into(),
    };
    let error = server.grpc().await.load_pack(unknown).await.unwrap_err();
    assert_eq!(error.code(), Code::NotFound);
    let info = error.get_details_error_info().unwrap();
    assert_eq!(
        (info.reason.as_str(), info.metadata["allowed"].as_str()),
        ("UNKNOWN_PACK", "new 1, other 1.2.3, toy 1.2.3, toy 2")
    );
    assert!(
        error.message().ends_with("not usable: junk: no version"),
        "{}",
        error.message()
    );
    for (path, version, status, reason) in [
        ("missing/swap", "", StatusCode::NOT_FOUND, "UNKNOWN_PACK"),
        ("missing/unload", "", StatusCode::NOT_FOUND, "UNKNOWN_PACK"),
        ("toy/swap", "9", StatusCode::NOT_FOUND, "UNKNOWN_PACK"),
        ("toy/load", "2", StatusCode::CONFLICT, "OTHER_VERSION"),
        ("other/unload", "2", StatusCode::CONFLICT, "OTHER_VERSION"),
        ("new/swap", "", StatusCode::CONFLICT, "PACK_NOT_LOADED"),
        ("toy/unload", "", StatusCode::CONFLICT, "DEFAULT_PACK"),
    ] {
        let (found, body) = post(&server, path, version).await;
        assert_eq!(found, status, "{path}: {body}");
        assert!(body.to_string().contains(reason), "{path}: {body}");
    }
    let nameless = server
        .grpc()
        .await
        .load_pack(v1::LoadPackRequest::default())
        .await
        .unwrap_err();
    assert_eq!(nameless.code(), Code::InvalidArgument);
    assert_eq!(versions(&server).await, ["other 1.2.3", "toy 1.2.3"]);

    // A swap to the version that serves changes nothing, and two at once have one effect.
    let (first, second) = tokio::join!(post(&server, "toy/swap", "2"), post(&server, "toy/swap", "2"));
    let mut changed = [first.1["changed"] == true, second.1["changed"] == true];
    changed.sort_unstable();
    assert_eq!(changed, [false, true], "{first:?} {second:?}");

    server.handle.service().announce_stop();
    let (status, body) = post(&server, "toy/swap", "2").await;
    assert_eq!(status, StatusCode::SERVICE_UNAVAILABLE, "{body}");
}

#[tokio::test(flavor = "multi_thread")]
async fn changes_that_wait_are_few() {
    let server = Arc::new(start(&[("toy", "2", Flaw::None)]).await);
    // The first run of the new version waits here, and all other changes wait for it.
    server.gate.close();
    let mut calls = JoinSet::new();
    for _ in 0..20 {
        let server = server.clone();
        calls.spawn(async move { post(&server, "toy/swap", "2").await });
    }
    for _ in 0..4 {
        let (status, body) = calls.join_next().await.unwrap().unwrap();
        assert_eq!(status, StatusCode::TOO_MANY_REQUESTS, "{body}");
        assert!(
            body.to_string()
                .contains("allowed: at most 16, one after another"),
            "{body}"
        );
    }
    server.gate.open();
    let (mut done, mut changed) = (0, 0);
    while let Some(call) = calls.join_next().await {
        let (status, body) = call.unwrap();
        assert_eq!(status, StatusCode::OK, "{body}");
        done += 1;
        changed += u32::from(body["changed"] == true);
    }
    assert_eq!((done, changed), (16, 1));
}

#[tokio::test]
async fn a_server_whose_packs_are_the_callers_cannot_change_them() {
    let server = TestServer::start().await;
    let (status, body) = post(&server, "toy/swap", "").await;
    assert_eq!(status, StatusCode::NOT_IMPLEMENTED, "{body}");
    assert!(body.to_string().contains("PACKS_ARE_FIXED"), "{body}");
}
