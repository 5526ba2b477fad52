//! Two servers with one Redis, of which each test has its own.

use std::thread::sleep;

use troupe_motion::Vec3;
use troupe_proto::v1;

use super::super::pack::tests::{loaded, spaces_within};
use super::super::{Keeper, SessionError};
use super::*;
use crate::records::RecordStore as _;
use crate::records::shared::testing::Redis;
use crate::skeleton::testing::person_record;
use troupe_character::scene::{Scene, State as ObjectState};

const STOOL: &str = r#"
format = 1
name = "stool"

[shape.box]
center_m = [0.0, 0.25, 0.0]
half_extents_m = [0.2, 0.25, 0.2]

[[approaches]]
name = "front"
directions_deg = [-45.0, 45.0]

[[variants]]
name = "sit"
entry = "sit"

[[sets]]
name = "sit"
hold_until_ended = true
keyframes = [{ height_m = 0.5, heading_deg = 0.0, from_ground = true }]
"#;
const YARD: &str = r#"
format = 1
name = "yard"
ground_m = 1.0

[[objects]]
id = "mine"
definition = "stool"
position_m = [0.0, 1.0, 2.0]
"#;
/// Memory of the uploads of a server.
const ROOM: usize = 1 << 20;
/// Time in which a link that has failed does not try again.
const PAUSED: Duration = Duration::from_millis(600);

/// A server of the test.
struct Server {
    spaces: Arc<Spaces>,
    keeper: Keeper,
    telemetry: Telemetry,
}

impl Server {
    async fn start(redis: &Redis, address: &str) -> Self {
        Self::of(spaces_within(ROOM, Vec::new()).await, redis, address)
    }

    fn of(spaces: Spaces, redis: &Redis, address: &str) -> Self {
        let (spaces, telemetry) = (Arc::new(spaces), Telemetry::new().unwrap());
        let records = Box::new(redis.server(address));
        let keeper = Keeper::new(&spaces, records, &telemetry).unwrap();
        Self {
            spaces,
            keeper,
            telemetry,
        }
    }

    fn round(&mut self) {
        self.keeper.round(1 << 20).unwrap();
    }

    fn common(&self) -> &Arc<Space> {
        self.spaces.common()
    }

    fn tenant(&self, name: &str) -> Arc<Space> {
        self.spaces.of(&Some(name.into())).unwrap()
    }

    /// Why an upload of callers without a tenant is left out.
    fn reason(&self, upload: &Upload) -> String {
        let known = self.spaces.uploads().unwrap().known();
        known.tenants[&None].reason(upload).unwrap_or_default().to_owned()
    }
}

fn document(text: &str) -> Option<v1::Document> {
    Some(v1::Document {
        text: text.to_owned(),
        format: v1::DocumentFormat::Toml.into(),
    })
}

fn put_scene(space: &Space, text: &str) {
    let request = v1::PutSceneRequest {
        document: document(text),
        ..v1::PutSceneRequest::default()
    };
    space.store.put(&request).unwrap();
}

fn put_object(space: &Space, pack: &str, text: &str) {
    let request = v1::PutObjectDefinitionRequest {
        document: document(text),
        ..v1::PutObjectDefinitionRequest::default()
    };
    let rig = space.packs.table().get(pack).unwrap().pack.rig.clone();
    space.store.put_object(&request, &rig).unwrap();
}

fn put_style(space: &Space, pack: &str, name: &str, speed_mps: f32) {
    let loaded = space.packs.table().get(pack).unwrap().clone();
    let style = v1::Style {
        name: name.to_owned(),
        default_speed: speed_mps,
        ..loaded.styles[0].get("sneak").unwrap().to_proto()
    };
    styles::put(&loaded, "", Some(&style), &space.store).unwrap();
}

/// As a call does once the skeleton has passed its check on a pack.
fn put_skeleton(space: &Space, name: &str, size: f32) {
    let skeletons = space.store.skeletons();
    let taken = skeletons.take_shared(name, &person_record(name, size), space.store.memory());
    taken.unwrap();
    let upload = Upload::Skeleton(name.to_owned());
    space.store.journal().change().note(upload);
}

fn put_all(space: &Space) {
    put_object(space, "toy", STOOL);
    put_scene(space, YARD);
    put_style(space, "toy", "mine", 1.0);
    put_skeleton(space, "hero", 1.0);
}

/// The names of all uploads.
fn names(space: &Space) -> Vec<String> {
    let mut names = space.store.scenes().names();
    let definitions = space.store.definitions().snapshot();
    names.extend(definitions.iter().map(|listed| listed.definition.name.clone()));
    for pack in space.packs.table().all() {
        let all = pack.styles[0].list();
        let added = all.iter().filter(|style| !style.built_in);
        names.extend(added.map(|style| format!("{}/{}", pack.pack.name(), style.name)));
    }
    let skeletons = space.store.skeletons().list_call().skeletons;
    names.extend(skeletons.into_iter().map(|skeleton| skeleton.name));
    names
}

fn ground_m(space: &Space) -> f32 {
    space.store.scenes().get("yard").unwrap().snapshot().ground_y_m()
}

fn speed_mps(space: &Space) -> f32 {
    let toy = space.packs.table().get("toy").unwrap().clone();
    toy.styles[0].get("mine").unwrap().default_speed_mps
}

const ALL: [&str; 4] = ["yard", "stool", "toy/mine", "hero"];

#[tokio::test]
async fn uploads_come_to_another_server_and_change_and_go_there() {
    let Some(redis) = Redis::start() else { return };
    let (mut one, mut two) = (
        Server::start(&redis, "one:1").await,
        Server::start(&redis, "two:2").await,
    );
    put_all(one.common());
    one.round();
    assert!(names(two.common()).is_empty());
    two.round();
    assert_eq!(names(two.common()), ALL);
    assert_eq!((ground_m(two.common()), speed_mps(two.common())), (1.0, 1.0));
    let text = two.telemetry.render();
    assert!(
        text.contains("troupe_store_uploads_total{result=\"taken\"} 4"),
        "{text}"
    );

    // The other way.
    put_scene(two.common(), &YARD.replace("ground_m = 1.0", "ground_m = 2.0"));
    put_style(two.common(), "toy", "mine", 1.5);
    put_object(two.common(), "toy", &STOOL.replace("0.25, 0.2]", "0.5, 0.2]"));
    put_skeleton(two.common(), "hero", 1.2);
    two.round();
    one.round();
    assert_eq!((ground_m(one.common()), speed_mps(one.common())), (2.0, 1.5));
    for kind in [
        Upload::Skeleton("hero".to_owned()),
        Upload::Definition("stool".to_owned()),
    ] {
        let record = |server: &Server| {
            let uploads = server.spaces.uploads().unwrap();
            uploads.record(server.common(), &kind).unwrap().unwrap()
        };
        assert_eq!(record(&one), record(&two), "{kind:?}");
    }

    let name = || "hero".to_owned();
    let deleted = v1::DeleteSkeletonRequest { name: name() };
    one.common().store.skeletons().delete_call(&deleted).unwrap();
    one.common().store.delete_scene("yard").unwrap();
    one.common().store.delete_definition("stool").unwrap();
    one.round();
    two.round();
    assert_eq!(names(two.common()), ["toy/mine"]);
    let later = Server::start(&redis, "three:3").await;
    assert_eq!(names(later.common()), ["toy/mine"], "a server that starts");
}

#[tokio::test]
async fn a_tenant_has_its_own_uploads_as_soon_as_a_server_serves_it() {
    let Some(redis) = Redis::start() else { return };
    let (mut one, mut two) = (
        Server::start(&redis, "one:1").await,
        Server::start(&redis, "two:2").await,
    );
    put_all(&one.tenant("studio"));
    one.round();
    two.round();
    assert_eq!(names(&two.tenant("studio")), ALL, "without a round");
    for space in [
        two.common(),
        &two.tenant("other"),
        one.common(),
        &one.tenant("other"),
    ] {
        assert!(names(space).is_empty());
    }
    put_scene(&two.tenant("studio"), &YARD.replace("1.0", "2.0"));
    two.round();
    one.round();
    assert_eq!(ground_m(&one.tenant("studio")), 2.0);
    assert!(names(one.common()).is_empty());
}

#[tokio::test]
async fn a_store_that_lost_everything_gets_the_newest_uploads_again() {
    let Some(redis) = Redis::start() else { return };
    let (mut one, mut two) = (
        Server::start(&redis, "one:1").await,
        Server::start(&redis, "two:2").await,
    );
    put_all(one.common());
    one.round();
    two.round();
    put_scene(one.common(), &YARD.replace("ground_m = 1.0", "ground_m = 2.0"));
    let deleted = v1::DeleteSkeletonRequest {
        name: "hero".to_owned(),
    };
    one.common().store.skeletons().delete_call(&deleted).unwrap();
    one.round();
    redis.ask::<()>(&["FLUSHALL"]);
    // The server that lacks the newest changes comes first.
    two.round();
    one.round();
    two.round();
    let three = Server::start(&redis, "three:3").await;
    for server in [&one, &two, &three] {
        assert_eq!(names(server.common()), ["yard", "stool", "toy/mine"]);
        assert_eq!(ground_m(server.common()), 2.0);
    }
}

#[tokio::test]
async fn uploads_wait_for_a_store_that_is_away() {
    let Some(mut redis) = Redis::start() else { return };
    let (mut one, mut two) = (
        Server::start(&redis, "one:1").await,
        Server::start(&redis, "two:2").await,
    );
    put_object(one.common(), "toy", STOOL);
    one.round();
    redis.stop();
    put_scene(one.common(), YARD);
    assert!(one.spaces.uploads().unwrap().round().is_err());
    assert_eq!(
        names(&one.tenant("new")),
        [""; 0],
        "it is served without the store"
    );
    // It comes back with nothing in it.
    redis.start_again();
    sleep(PAUSED);
    one.round();
    two.round();
    assert_eq!(names(two.common()), ["yard", "stool"]);

    // A server that starts while it is away has the uploads later.
    redis.stop();
    let mut three = Server::start(&redis, "three:3").await;
    assert!(names(three.common()).is_empty());
    redis.start_again();
    sleep(PAUSED);
    one.round();
    three.round();
    assert_eq!(names(three.common()), ["yard", "stool"]);
}

#[tokio::test]
async fn what_is_too_large_or_cannot_be_read_is_left_out_and_the_rest_comes() {
    let Some(redis) = Redis::start() else { return };
    let mut one = Server::start(&redis, "one:1").await;
    let empty_bytes = Scene::default().bytes();
    let little = spaces_within(empty_bytes, Vec::new()).await;
    let mut two = Server::of(little, &redis, "two:2");
    put_all(one.common());
    put_scene(one.common(), "format = 1\nname = \"empty\"\n");
    one.round();
    let mut log = redis.server("later:3").uploads().unwrap();
    let write = |field: &str| Write {
        field: field.to_owned(),
        rank: 0,
        record: Some(b"\x07".to_vec()),
    };
    log.write(&["scene//broken", "rug//soft", "scene"].map(write))
        .unwrap();
    two.round();
    assert_eq!(names(two.common()), ["empty"]);
    let stool = Upload::Definition("stool".to_owned());
    let reason = two.reason(&stool);
    let allowed = format!("allowed: at most {empty_bytes} in all (max_scene_memory_mib)");
    assert!(reason.contains(&allowed), "{reason}");
    let yard = two.reason(&Upload::Scene("yard".to_owned()));
    assert!(yard.contains("stool"), "its definition is missing: {yard}");
    assert_ne!(two.reason(&Upload::Scene("broken".to_owned())), "");
    assert!(
        two.telemetry
            .render()
            .contains("uploads_total{result=\"left_out\"} 5")
    );
    // It is not tried again all the time.
    two.round();
    assert!(
        two.telemetry
            .render()
            .contains("uploads_total{result=\"left_out\"} 5")
    );

    // A record has a limit of its own.
    let spaces = Arc::new(spaces_within(ROOM, Vec::new()).await);
    let log = redis.server("four:4").uploads().unwrap();
    let uploads = SharedUploads {
        max_record_bytes: 64,
        ..SharedUploads::new(log, &spaces, &Telemetry::new().unwrap())
    };
    spaces.share_uploads(uploads);
    put_style(spaces.common(), "toy", "large", 1.0);
    put_scene(spaces.common(), "format = 1\nname = \"small\"\n");
    spaces.uploads().unwrap().round().unwrap();
    one.round();
    let known = names(one.common());
    assert!(
        known.contains(&"small".to_owned()) && !known.contains(&"toy/large".to_owned()),
        "{known:?}"
    );
}

#[tokio::test]
async fn what_is_in_use_elsewhere_comes_back() {
    let Some(redis) = Redis::start() else { return };
    let (mut one, mut two) = (
        Server::start(&redis, "one:1").await,
        Server::start(&redis, "two:2").await,
    );
    put_all(one.common());
    one.round();
    two.round();
    let resident = two.common().store.scenes().enter("yard").unwrap();
    one.common().store.delete_scene("yard").unwrap();
    one.common().store.delete_definition("stool").unwrap();
    one.round();
    assert!(!names(one.common()).contains(&"yard".to_owned()));
    two.round();
    assert_eq!(names(two.common()), ALL);
    two.round();
    one.round();
    assert_eq!(names(one.common()), ALL);
    drop(resident);
    one.common().store.delete_scene("yard").unwrap();
    one.round();
    two.round();
    assert!(!names(two.common()).contains(&"yard".to_owned()));
}

#[tokio::test]
async fn a_scene_is_replaced_under_the_sessions_of_another_server() {
    let Some(redis) = Redis::start() else { return };
    let (mut one, mut two) = (
        Server::start(&redis, "one:1").await,
        Server::start(&redis, "two:2").await,
    );
    put_all(one.common());
    one.round();
    two.round();
    let cell = two.common().store.scenes().get("yard").unwrap();
    let move_it = || {
        let at = troupe_character::scene::testing::place(5.0, 1.0, 2.0);
        cell.update(|scene| scene.move_to("mine", at)).unwrap();
    };
    move_it();
    // A style alone is no reason to put the objects back.
    put_style(one.common(), "toy", "mine", 2.0);
    one.round();
    two.round();
    let x = || cell.snapshot().instance("mine").unwrap().transform.position.x;
    assert_eq!(x(), 5.0);
    put_scene(one.common(), YARD);
    one.round();
    two.round();
    assert_eq!(x(), 0.0, "the same upload again");
}

#[tokio::test]
async fn a_pack_that_comes_gets_its_styles_and_definitions() {
    let Some(redis) = Redis::start() else { return };
    let both = vec![loaded("other", "1", |_| {}).await];
    let mut one = Server::of(spaces_within(ROOM, both).await, &redis, "one:1");
    let mut two = Server::start(&redis, "two:2").await;
    put_object(one.common(), "other", STOOL);
    put_style(one.common(), "other", "mine", 1.0);
    put_scene(one.common(), YARD);
    put_style(&one.tenant("studio"), "other", "theirs", 1.0);
    one.round();
    two.round();
    assert!(names(two.common()).is_empty() && names(&two.tenant("studio")).is_empty());
    let stool = Upload::Definition("stool".to_owned());
    assert_eq!(two.reason(&stool), "its pack \"other\" is not loaded");

    let wanted = ["yard", "stool", "other/mine"];
    for version in ["1", "2"] {
        two.spaces.serve(loaded("other", version, |_| {}).await).unwrap();
        assert_eq!(names(two.common()), wanted);
        assert_eq!(names(&two.tenant("studio")), ["other/theirs"]);
    }
    two.spaces.end("other").unwrap();
    put_style(one.common(), "other", "newer", 1.0);
    one.round();
    two.round();
    two.spaces.serve(loaded("other", "3", |_| {}).await).unwrap();
    assert_eq!(
        names(two.common()),
        ["yard", "stool", "other/mine", "other/newer"]
    );
}

#[tokio::test]
async fn removals_that_the_store_has_forgotten_are_found() {
    let Some(redis) = Redis::start() else { return };
    let (mut one, mut two) = (
        Server::start(&redis, "one:1").await,
        Server::start(&redis, "two:2").await,
    );
    put_all(one.common());
    one.round();
    two.round();
    one.common().store.delete_scene("yard").unwrap();
    one.round();
    let mut log = redis.server("later:3").uploads().unwrap();
    let gone = |number| Write {
        field: format!("scene//gone-{number}"),
        rank: 0,
        record: None,
    };
    log.write(&(0..5000).map(gone).collect::<Vec<_>>()).unwrap();
    two.round();
    assert_eq!(names(two.common()), ["stool", "toy/mine", "hero"]);
}

#[tokio::test]
async fn objects_are_changed_on_one_server_at_a_time() {
    let Some(redis) = Redis::start() else { return };
    let (mut one, mut two) = (
        Server::start(&redis, "one:1").await,
        Server::start(&redis, "two:2").await,
    );
    put_all(one.common());
    one.round();
    two.round();
    let own = |server: &Server, scene: &str| {
        let space = server.common();
        space.sessions.own_scene(scene, &space.store)
    };
    own(&one, "yard").unwrap();
    let moves = v1::MoveObjectsRequest {
        scene: "yard".to_owned(),
        moves: vec![v1::ObjectMove {
            id: "mine".to_owned(),
            position: Some(v1::Vec3 {
                x: 5.0,
                ..v1::Vec3::default()
            }),
            ..v1::ObjectMove::default()
        }],
        ..v1::MoveObjectsRequest::default()
    };
    let moved = one.common().store.move_objects(&moves).unwrap();
    assert!(moved.objects[0].error.is_none());
    let is_at = |error: &SessionError, address: &str| matches!(error, SessionError::Elsewhere { what: "scene", owner, .. } if owner == address);
    let error = own(&two, "yard").unwrap_err();
    assert!(is_at(&error, "one:1"), "{error}");
    own(&two, "no scene").unwrap();
    // No session is in the scene, so the server gives it up.
    one.round();
    own(&two, "yard").unwrap();
    let scene = two.common().store.scenes().get("yard").unwrap().snapshot();
    let mine = scene.instance("mine").unwrap();
    assert_eq!(
        (mine.transform.position, &mine.state),
        (Vec3::new(5.0, 0.0, 0.0), &ObjectState::Free)
    );
    let error = own(&one, "yard").unwrap_err();
    assert!(is_at(&error, "two:2"), "{error}");
}
