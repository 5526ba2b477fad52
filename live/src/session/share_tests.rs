//! Two servers with one Redis: where a session is, what a client learns, and what is written.

use std::thread::sleep;

use troupe_proto::v1;

use super::super::keep::tests::{House, command, open};
use super::super::{Keeper, Space};
use super::*;
use crate::records::RecordStore;
use crate::records::shared::Terms;
use crate::records::shared::testing::{LEASE, Redis, TERMS};
use crate::world::Folders;

/// Longer than the time in which the store is not asked again.
const JUST_ASKED: Duration = Duration::from_millis(300);
const YARD: &str = "format = 1\nname = \"yard\"\n";

/// A server of the test.
struct Server {
    space: Arc<Space>,
    /// Keeps the spaces, which the sharing only looks at.
    _spaces: Arc<Spaces>,
    keeper: Keeper,
}

impl Server {
    fn start(house: &House, redis: &Redis, address: &str, scenes: &tempfile::TempDir) -> Self {
        Self::start_with(house, Box::new(redis.server(address)), scenes)
    }

    fn start_with(house: &House, records: Box<dyn RecordStore>, scenes: &tempfile::TempDir) -> Self {
        let folders = Folders {
            scenes: Some(scenes.path().to_owned()),
            ..Folders::default()
        };
        let spaces = house.spaces_in(folders, 8);
        let keeper = Keeper::new(&spaces, records, &house.telemetry).unwrap();
        Self {
            space: spaces.common().clone(),
            _spaces: spaces,
            keeper,
        }
    }

    fn round(&mut self) {
        self.keeper.round(1 << 20).unwrap();
    }

    /// The last command of a session, which comes here if no other server has it.
    async fn last_sequence(&self, id: &str) -> Result<u64, String> {
        self.space.sessions.bring(&[id.to_owned()]).await;
        let found = self.space.sessions.get(id);
        found
            .map(|session| session.last_sequence)
            .map_err(|error| error.to_string())
    }

    /// Closes sessions. The answer has how many, and place, id and error of those that were not.
    async fn close(&self, ids: &[&str]) -> Result<(u32, Vec<String>), String> {
        let sessions = &self.space.sessions;
        let ids: Vec<String> = ids.iter().map(|&id| id.to_owned()).collect();
        sessions.bring(&ids).await;
        let done = sessions.close(&v1::CloseSessionsRequest { ids });
        let done = done.map_err(|error| error.to_string())?;
        let problems = done.problems.iter();
        let problems = problems.map(|of| format!("{} {}: {}", of.slot, of.session_id, of.error));
        Ok((done.closed, problems.collect()))
    }

    /// Whether a scene may be read here.
    async fn check(&self, scene: &str) -> Result<(), String> {
        let checked = self.space.sessions.check_scene(scene, "name").await;
        checked.map_err(|error| error.to_string())
    }

    async fn open_in_yard(&self, id: &str) -> Result<(), String> {
        let request = v1::CreateSessionsRequest {
            sessions: vec![v1::SessionOptions {
                id: id.to_owned(),
                scene: "yard".to_owned(),
                ..v1::SessionOptions::default()
            }],
        };
        let Space {
            packs,
            store,
            sessions,
            ..
        } = &*self.space;
        let created = sessions.create(packs, store, request).await;
        created.map(drop).map_err(|error| error.to_string())
    }
}

fn says(result: Result<impl std::fmt::Debug, String>, wanted: &str) {
    let error = result.unwrap_err();
    assert!(error.contains(wanted), "{error}");
}

#[tokio::test]
async fn a_session_moves_when_its_server_stops_or_is_paused() {
    let Some(redis) = Redis::start() else { return };
    let (house, scenes) = (House::new().await, tempfile::tempdir().unwrap());
    let start = |address| Server::start(&house, &redis, address, &scenes);
    let (mut one, mut two) = (start("one:1"), start("two:2"));
    open(&one.space, "hero").await;
    command(&one.space, "hero", 7).await;
    one.round();
    says(
        two.last_sequence("hero").await,
        "session \"hero\" is on the server one:1, whose lease ends in ",
    );

    // A pause that is longer than the lease.
    command(&one.space, "hero", 8).await;
    sleep(LEASE + LEASE / 2);
    assert_eq!(two.last_sequence("hero").await, Ok(7), "what was written");
    command(&two.space, "hero", 9).await;
    two.round();
    one.round();
    says(one.last_sequence("hero").await, "is on the server two:2");

    // A stop gives the lease up.
    two.keeper.finish().unwrap();
    sleep(JUST_ASKED);
    assert_eq!(one.last_sequence("hero").await, Ok(9));
    one.round();
    assert_eq!(one.keeper.backlog().sessions(), 0);
    let ids = vec!["hero".to_owned()];
    one.space
        .sessions
        .close(&v1::CloseSessionsRequest { ids })
        .unwrap();
    one.round();
    let three = start("three:3");
    says(
        three.last_sequence("hero").await,
        "no session has the id \"hero\"",
    );
    open(&three.space, "hero").await;
}

#[tokio::test]
async fn calls_that_bring_a_session_at_the_same_time_all_find_it() {
    let Some(redis) = Redis::start() else { return };
    let (house, scenes) = (House::new().await, tempfile::tempdir().unwrap());
    let start = |address| Server::start(&house, &redis, address, &scenes);
    let (mut one, mut two) = (start("one:1"), start("two:2"));
    open(&one.space, "hero").await;
    for _ in 0..5 {
        one.round();
        one.keeper.finish().unwrap();
        let looks = [(); 4].map(|()| two.last_sequence("hero"));
        for found in futures_util::future::join_all(looks).await {
            assert_eq!(found, Ok(0));
        }
        std::mem::swap(&mut one, &mut two);
        sleep(JUST_ASKED);
    }
}

#[tokio::test]
async fn what_another_server_has_is_not_closed_and_that_server_is_named() {
    let Some(redis) = Redis::start() else { return };
    let (house, scenes) = (House::new().await, tempfile::tempdir().unwrap());
    let start = |address| Server::start(&house, &redis, address, &scenes);
    let (mut one, mut two) = (start("one:1"), start("two:2"));
    open(&one.space, "a").await;
    open(&two.space, "b").await;
    for server in [&mut one, &mut two] {
        server.round();
    }
    says(
        two.close(&["a"]).await,
        "session \"a\" is on the server one:1, whose lease ends in ",
    );
    // What is here is closed, and the rest is named.
    let (closed, problems) = two.close(&["gone", "b", "a"]).await.unwrap();
    assert_eq!((closed, problems.len()), (1, 1));
    assert!(
        problems[0].starts_with("2 a: session \"a\" is on the server one:1"),
        "{problems:?}"
    );
    assert_eq!(one.last_sequence("a").await, Ok(0));
    // It is gone here at once, and elsewhere as soon as its server has written that.
    assert_eq!(two.close(&["b"]).await, Ok((0, Vec::new())));
    says(one.close(&["b"]).await, "is on the server two:2");
    two.round();
    sleep(JUST_ASKED);
    assert_eq!(one.close(&["b"]).await, Ok((0, Vec::new())));
    assert_eq!(one.close(&["a", "b"]).await, Ok((1, Vec::new())));
}

#[tokio::test]
async fn a_scene_and_its_sessions_are_on_one_server() {
    let Some(redis) = Redis::start() else { return };
    let (house, scenes) = (House::new().await, tempfile::tempdir().unwrap());
    std::fs::write(scenes.path().join("yard.toml"), YARD).unwrap();
    let start = |address| Server::start(&house, &redis, address, &scenes);
    let (mut one, two) = (start("one:1"), start("two:2"));
    one.open_in_yard("a").await.unwrap();
    one.open_in_yard("b").await.unwrap();
    one.round();
    says(
        two.open_in_yard("c").await,
        "scene \"yard\" is on the server one:1",
    );
    // Who reads the scene is sent to its server.
    says(two.check("yard").await, "scene \"yard\" is on the server one:1");
    assert_eq!(one.check("yard").await, Ok(()));
    assert_eq!(two.check("meadow").await, Ok(()), "no server has it");
    // The refused session has left no lease behind, and may be elsewhere.
    open(&one.space, "c").await;
    sleep(LEASE + LEASE / 2);
    assert_eq!(two.check("yard").await, Ok(()), "a lease has ended");
    // The scene comes with its first session, and takes the others from the server before.
    assert_eq!(two.last_sequence("a").await, Ok(0));
    one.round();
    for id in ["a", "b"] {
        says(one.last_sequence(id).await, "is on the server two:2");
    }
    assert_eq!(two.last_sequence("b").await, Ok(0));
    assert_eq!(one.last_sequence("c").await, Ok(0), "it is in no scene");
}

#[tokio::test]
async fn sessions_go_on_without_their_store_and_new_ones_wait() {
    let Some(mut redis) = Redis::start() else { return };
    let (house, scenes) = (House::new().await, tempfile::tempdir().unwrap());
    let mut one = Server::start(&house, &redis, "one:1", &scenes);
    open(&one.space, "hero").await;
    one.round();
    redis.stop();
    command(&one.space, "hero", 5).await;
    assert!(one.keeper.round(1 << 20).is_err());
    let options = v1::SessionOptions::default();
    let request = v1::CreateSessionsRequest {
        sessions: vec![options],
    };
    let Space {
        packs,
        store,
        sessions,
        ..
    } = &*one.space;
    let refused = sessions
        .create(packs, store, request)
        .await
        .map_err(|error| error.to_string());
    says(
        refused,
        "the store of sessions does not answer: store: redis://127.0.0.1:",
    );
    says(
        one.last_sequence("other").await,
        "the store of sessions does not answer",
    );
    says(
        one.check("yard").await,
        "the store of sessions does not answer: store: redis://127.0.0.1:",
    );
    assert_eq!(one.last_sequence("hero").await, Ok(5));

    // It comes back with nothing in it, and this is not taken for the end of its sessions.
    redis.start_again();
    sleep(Duration::from_millis(600));
    let terms = Terms {
        fill: Duration::from_secs(1),
        ..TERMS
    };
    let three = Server::start_with(&house, Box::new(redis.server_with("three:3", terms)), &scenes);
    says(
        three.last_sequence("hero").await,
        "it has just been empty, and servers may still write their sessions",
    );
    one.round();
    sleep(JUST_ASKED);
    says(three.last_sequence("hero").await, "is on the server one:1");
    sleep(Duration::from_millis(800));
    says(
        three.last_sequence("other").await,
        "no session has the id \"other\"",
    );
    one.round();
    let two = Server::start(&house, &redis, "two:2", &scenes);
    says(two.last_sequence("hero").await, "is on the server one:1");
    one.keeper.finish().unwrap();
    sleep(JUST_ASKED);
    assert_eq!(two.last_sequence("hero").await, Ok(5));
}
