//! What one tenant has does not exist for another: sessions, streams, scenes, definitions and added
//! styles.

use std::path::Path;
use std::time::Duration;

use http::{Method, StatusCode};
use serde_json::{Value, json};
use tokio_stream::wrappers::ReceiverStream;
use tonic::Request;
use tonic::metadata::MetadataValue;
use troupe_edge::clients::Role;
use troupe_edge::keys;
use troupe_proto::v1;
use troupe_proto::v1::drive_request::Message as Ask;
use troupe_proto::v1::drive_response::Message as Say;
use troupe_server::config::Config;

use crate::common::TestServer;
use crate::common::scenes::{STOOL, YARD};
use crate::restart::Folder;

/// A server with two tenants, and somebody without one.
struct House {
    server: TestServer,
    keys: [String; 3],
}

const ALPHA: usize = 0;
const BETA: usize = 1;
const NO_TENANT: usize = 2;

impl House {
    /// With a file of keys in `folder`, which may be there already.
    async fn start(folder: &Path, set: impl FnOnce(&mut Config)) -> Self {
        std::fs::create_dir_all(folder).unwrap();
        let file = folder.join("keys.toml");
        let made = ["alpha", "beta", ""].map(|tenant| {
            let key = keys::new_key();
            let line = match tenant {
                "" => String::new(),
                tenant => keys::tenant_line(tenant).unwrap(),
            };
            (keys::entry("somebody", Role::Author, &key) + &line, key)
        });
        let text = made
            .iter()
            .enumerate()
            .map(|(index, (entry, _))| entry.replace("\"somebody\"", &format!("\"somebody-{index}\"")));
        std::fs::write(&file, text.collect::<String>()).unwrap();
        let server = TestServer::start_with(|config| {
            config.keys = Some(file);
            set(config);
        })
        .await;
        Self {
            server,
            keys: made.map(|(_, key)| key),
        }
    }

    async fn call(&self, who: usize, method: Method, path: &str, body: Value) -> (StatusCode, Value) {
        let call = reqwest::Client::new()
            .request(method, self.server.url(path))
            .bearer_auth(&self.keys[who]);
        let call = match body {
            Value::Null => call,
            body => call.json(&body),
        };
        let response = call.send().await.unwrap();
        (response.status(), response.json().await.unwrap())
    }

    async fn get(&self, who: usize, path: &str) -> (StatusCode, Value) {
        self.call(who, Method::GET, path, Value::Null).await
    }

    /// A call that must be served.
    async fn done(&self, who: usize, method: Method, path: &str, body: Value) -> Value {
        let (status, answer) = self.call(who, method, path, body).await;
        assert_eq!(status, StatusCode::OK, "{path}: {answer}");
        answer
    }

    /// The reason why a call is not served.
    async fn refused(&self, who: usize, method: Method, path: &str, body: Value) -> String {
        let (status, answer) = self.call(who, method, path, body).await;
        assert_ne!(status, StatusCode::OK, "{path}: {answer}");
        answer["error"]["reason"].as_str().unwrap().to_owned()
    }

    async fn open(&self, who: usize, session: Value) -> Value {
        let body = json!({ "sessions": [session] });
        self.done(who, Method::POST, "/v1/sessions", body).await
    }

    async fn put_yard(&self, who: usize) {
        let text = |text: &str| json!({"document": {"text": text, "format": "toml"}});
        let stool = "/v1/objects/stool";
        self.done(who, Method::PUT, stool, text(STOOL)).await;
        self.done(who, Method::PUT, "/v1/scenes/yard", text(YARD)).await;
    }

    fn request<T>(&self, who: usize, message: T) -> Request<T> {
        let mut request = Request::new(message);
        let key = MetadataValue::try_from(format!("Bearer {}", self.keys[who])).unwrap();
        request.metadata_mut().insert("authorization", key);
        request
    }
}

#[tokio::test]
async fn sessions_of_one_tenant_do_not_exist_for_another() {
    let folder = Folder::new("tenants-sessions");
    let house = House::start(folder.path(), |_| {}).await;
    // The same id is free for each.
    for who in [ALPHA, BETA, NO_TENANT] {
        house
            .open(who, json!({"id": "hero", "position": {"x": who, "y": 0, "z": 0}}))
            .await;
    }
    house.open(ALPHA, json!({"id": "secret"})).await;
    for (who, total) in [(ALPHA, 2), (BETA, 1), (NO_TENANT, 1)] {
        let (_, list) = house.get(who, "/v1/sessions").await;
        assert_eq!(list["total"], total, "{list}");
        assert_eq!(list["sessions"].as_array().unwrap().len(), total);
        let (_, hero) = house.get(who, "/v1/sessions/hero").await;
        let x = hero["position"]["x"].as_f64().unwrap();
        assert!((x - who as f64).abs() < 0.1, "{hero}");
    }
    for who in [BETA, NO_TENANT] {
        for (method, path, body) in [
            (Method::GET, "/v1/sessions/secret", Value::Null),
            (Method::GET, "/v1/sessions/secret/peek", Value::Null),
            (
                Method::POST,
                "/v1/step",
                json!({"session_ids": ["secret"], "frames": 1}),
            ),
        ] {
            let reason = house.refused(who, method, path, body).await;
            assert_eq!(reason, "UNKNOWN_SESSION", "{path}");
        }
        let move_on = json!({"commands": [{"session_id": "secret", "sequence": 9, "cancel": {}}]});
        let done = house.done(who, Method::POST, "/v1/commands", move_on).await;
        assert_eq!(
            done["results"][0]["problem"]["reason"], "UNKNOWN_SESSION",
            "{done}"
        );
        let resume = json!({"sessions": [{"session_id": "secret"}]});
        let resumed = house.done(who, Method::POST, "/v1/sessions/resume", resume).await;
        assert_eq!(resumed["problems"][0]["problem"]["reason"], "UNKNOWN_SESSION");
        let path = "/v1/sessions/secret";
        let closed = house.done(who, Method::DELETE, path, Value::Null).await;
        assert_eq!(closed["closed"].as_u64().unwrap_or(0), 0, "{closed}");
    }
    // A step of one moves the one's own.
    let step = json!({"session_ids": ["hero"], "frames": 5});
    house.done(BETA, Method::POST, "/v1/step", step).await;
    let frame = |answer: (StatusCode, Value)| match &answer.1["frame"] {
        Value::String(frame) => frame.parse().unwrap(),
        _ => 0,
    };
    assert_eq!(frame(house.get(BETA, "/v1/sessions/hero").await), 5);
    assert_eq!(frame(house.get(ALPHA, "/v1/sessions/hero").await), 0);
    assert_eq!(house.get(ALPHA, "/v1/sessions/secret").await.0, StatusCode::OK);
}

#[tokio::test]
async fn a_stream_takes_on_the_sessions_of_its_tenant_alone() {
    let folder = Folder::new("tenants-streams");
    let house = House::start(folder.path(), |_| {}).await;
    house.open(ALPHA, json!({"id": "hero"})).await;
    let mut client = house.server.sessions().await;
    for (who, taken) in [(BETA, false), (ALPHA, true)] {
        let attach = v1::DriveAttach {
            session_ids: vec!["hero".into()],
        };
        let says = [Ask::Open(v1::DriveOpen::default()), Ask::Attach(attach)];
        let (ask, asked) = tokio::sync::mpsc::channel(4);
        for message in says {
            let message = Some(message);
            ask.send(v1::DriveRequest { message }).await.unwrap();
        }
        let request = house.request(who, ReceiverStream::new(asked));
        let mut answers = client.drive(request).await.unwrap().into_inner();
        let attached = loop {
            match answers.message().await.unwrap().unwrap().message {
                Some(Say::Attached(attached)) => break attached,
                Some(_) => {}
                None => panic!("an empty message"),
            }
        };
        assert_eq!(attached.problems.is_empty(), taken, "{attached:?}");
        if let Some(problem) = attached.problems.first() {
            assert_eq!(problem.problem.as_ref().unwrap().reason, "UNKNOWN_SESSION");
        }
    }
}

#[tokio::test]
async fn scenes_definitions_and_styles_are_a_tenants_own() {
    let folder = Folder::new("tenants-scenes");
    let house = House::start(folder.path(), |_| {}).await;
    house.put_yard(ALPHA).await;
    let (_, mut style) = house.get(ALPHA, "/v1/packs/toy/styles/sneak").await;
    style["name"] = "limp".into();
    style["built_in"] = false.into();
    let limp = "/v1/packs/toy/styles/limp";
    house.done(ALPHA, Method::PUT, limp, style).await;
    house
        .open(ALPHA, json!({"id": "a", "scene": "yard", "style": "limp"}))
        .await;

    for who in [BETA, NO_TENANT] {
        for (path, reason) in [
            ("/v1/scenes/yard", "UNKNOWN_SCENE"),
            ("/v1/objects/stool", "UNKNOWN_OBJECT_DEFINITION"),
            (limp, "UNKNOWN_STYLE"),
        ] {
            assert_eq!(house.refused(who, Method::GET, path, Value::Null).await, reason);
        }
        for (path, list) in [("/v1/scenes", "scenes"), ("/v1/objects", "definitions")] {
            let (_, answer) = house.get(who, path).await;
            assert_eq!(answer[list].as_array().map_or(0, Vec::len), 0, "{answer}");
        }
        for (session, reason) in [
            (json!({"scene": "yard"}), "UNKNOWN_SCENE"),
            (json!({"style": "limp"}), "UNKNOWN_STYLE"),
        ] {
            let body = json!({ "sessions": [session] });
            assert_eq!(
                house.refused(who, Method::POST, "/v1/sessions", body).await,
                reason
            );
        }
        let scene = "/v1/scenes/yard";
        let reason = house.refused(who, Method::DELETE, scene, Value::Null).await;
        assert_eq!(reason, "UNKNOWN_SCENE");
    }
    // One's own of the same name is another.
    house.put_yard(BETA).await;
    house
        .done(BETA, Method::DELETE, "/v1/scenes/yard", Value::Null)
        .await;
    assert_eq!(house.get(ALPHA, "/v1/scenes/yard").await.0, StatusCode::OK);
}

#[tokio::test]
async fn tenants_share_the_limits() {
    let folder = Folder::new("tenants-limits");
    let house = House::start(folder.path(), |config| {
        config.fixed.max_tenants = 1;
        config.max_sessions = 3;
    })
    .await;
    house.open(ALPHA, json!({"id": "a"})).await;
    house.open(ALPHA, json!({"id": "b"})).await;
    house.open(NO_TENANT, json!({"id": "a"})).await;
    let more = json!({"sessions": [{}]});
    let reason = house.refused(NO_TENANT, Method::POST, "/v1/sessions", more).await;
    assert_eq!(reason, "TOO_MANY_SESSIONS");
    let (status, body) = house.get(BETA, "/v1/sessions").await;
    assert_eq!(status, StatusCode::TOO_MANY_REQUESTS, "{body}");
    assert_eq!(body["error"]["reason"], "TOO_MANY_TENANTS");
    let message = body["error"]["message"].as_str().unwrap();
    assert!(message.contains("allowed: at most 1"), "{message}");
}

#[tokio::test]
async fn an_idle_tenant_makes_room_for_another() {
    let folder = Folder::new("tenants-room");
    let house = House::start(folder.path(), |config| config.fixed.max_tenants = 1).await;
    let comes = async |who: usize| {
        // The call before ends a moment after its answer.
        for _ in 0..500 {
            if house.get(who, "/v1/sessions").await.0 == StatusCode::OK {
                return true;
            }
            tokio::time::sleep(Duration::from_millis(2)).await;
        }
        false
    };
    for _ in 0..3 {
        assert!(comes(ALPHA).await && comes(BETA).await);
    }
    assert!(comes(ALPHA).await);
    house.open(ALPHA, json!({"id": "a"})).await;
    let reason = house
        .refused(BETA, Method::GET, "/v1/sessions", Value::Null)
        .await;
    assert_eq!(reason, "TOO_MANY_TENANTS");
    house
        .done(ALPHA, Method::DELETE, "/v1/sessions/a", Value::Null)
        .await;
    assert!(comes(BETA).await);
    house.put_yard(BETA).await;
    let reason = house
        .refused(ALPHA, Method::GET, "/v1/sessions", Value::Null)
        .await;
    assert_eq!(reason, "TOO_MANY_TENANTS");
}

#[tokio::test]
async fn what_tenants_have_outlives_the_server() {
    let folder = Folder::new("tenants-store");
    let start = || {
        House::start(folder.path(), |config| {
            config.store = Some(folder.path().join("store"));
            config.fixed.snapshot_interval = Duration::from_millis(20);
        })
    };
    let house = start().await;
    for (who, frames) in [(ALPHA, 7), (BETA, 9), (NO_TENANT, 11)] {
        if who != BETA {
            house.put_yard(who).await;
        }
        let scene = if who == BETA { "" } else { "yard" };
        house.open(who, json!({"id": "hero", "scene": scene})).await;
        let step = json!({"session_ids": ["hero"], "frames": frames});
        house.done(who, Method::POST, "/v1/step", step).await;
    }
    let moved = json!({"moves": [{"id": "stool-2", "position": {"x": 3, "y": 0, "z": 4}}]});
    house
        .done(ALPHA, Method::POST, "/v1/scenes/yard/move", moved)
        .await;
    assert!(house.server.handle.shut_down().await);
    assert!(
        folder
            .path()
            .join("store/tenants/alpha/scenes/yard.toml")
            .is_file()
    );

    let house = start().await;
    for (who, frames) in [(ALPHA, 7), (BETA, 9), (NO_TENANT, 11)] {
        let (_, hero) = house.get(who, "/v1/sessions/hero").await;
        assert_eq!(hero["frame"], json!(frames.to_string()), "{hero}");
    }
    for (who, x) in [(ALPHA, 3.0), (NO_TENANT, 8.0)] {
        let (_, yard) = house.get(who, "/v1/scenes/yard").await;
        let stool = yard["objects"].as_array().unwrap();
        let stool = stool.iter().find(|object| object["id"] == "stool-2").unwrap();
        assert_eq!(stool["position"]["x"], x, "{yard}");
    }
    assert_eq!(house.get(BETA, "/v1/scenes/yard").await.0, StatusCode::NOT_FOUND);
}
