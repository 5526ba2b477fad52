use std::path::Path as FilePath;
use std::time::Duration;

use super::super::{Executor, SessionLimits, Sessions, Spaces, TenantOptions, TimeSource};
use super::*;
use crate::packs::load_styles;
use crate::world::{Folders, Store};
use troupe_batch::scheduler::Limits;
use troupe_batch::{Batcher, GeneratorFactory, PackMetrics};
use troupe_character::style::Style;
use troupe_character::testing::toy_rig;
use troupe_engine::pack::Pack;
use troupe_engine::pack::testing::pack_of;
use troupe_engine::toy::Toy;

/// A pack with the toy's skeleton.
pub(in crate::session) async fn loaded(
    name: &str,
    version: &str,
    change: impl FnOnce(&mut Pack),
) -> LoadedPack {
    let telemetry = Telemetry::new().unwrap();
    let mut pack = pack_of(Rig {
        name: name.to_owned(),
        ..toy_rig()
    });
    pack.folder = FilePath::new(env!("CARGO_MANIFEST_DIR")).join("../server/tests/common/toy");
    pack.manifest.version = version.to_owned();
    change(&mut pack);
    let dims = pack.rig.dims;
    let metrics = PackMetrics::new(&telemetry, name, version);
    let factory: GeneratorFactory = Arc::new(move |_| Ok(Box::new(Toy::new(dims, 1))));
    let batcher = Batcher::start(name, Limits::default(), Duration::ZERO, metrics.clone(), factory);
    LoadedPack {
        styles: load_styles(&pack, None).unwrap(),
        skills: Arc::default(),
        batcher: batcher.await.unwrap(),
        engine: "toy",
        pack: Arc::new(pack),
        metrics,
    }
}

/// The data of a server whose default pack is `toy`.
async fn spaces(others: Vec<LoadedPack>) -> Spaces {
    spaces_within(1 << 20, others).await
}

/// As [`spaces`], with a memory limit of uploads.
pub(in crate::session) async fn spaces_within(max_bytes: usize, others: Vec<LoadedPack>) -> Spaces {
    let telemetry = Telemetry::new().unwrap();
    let mut packs = vec![loaded("toy", "1", |_| {}).await];
    packs.extend(others);
    let packs = LivePacks::new(PackTable::new(packs, "toy".to_owned()), &telemetry);
    let limits = SessionLimits {
        sessions: 100,
        per_request: 10,
        per_stream: 10,
        streams: 10,
        ttl_ms: 600_000,
        stall_timeout: Duration::from_secs(30),
    };
    let sessions = Sessions::new(limits, TimeSource::default(), Executor::here(), &telemetry);
    let store = Store::load(Folders::default(), max_bytes, []).unwrap();
    let options = TenantOptions {
        folder: None,
        most: 8,
    };
    Spaces::new(packs, Arc::new(store), Arc::new(sessions), options)
}

fn find(packs: &LivePacks, name: &str) -> Arc<LivePack> {
    packs.find(&troupe_character::Path::root(), name, "").unwrap()
}

fn version(pack: &LivePack) -> String {
    pack.loaded().pack.manifest.version.clone()
}

#[tokio::test]
async fn sessions_of_all_tenants_go_on_with_the_version_that_takes_a_place() {
    let spaces = spaces(Vec::new()).await;
    let studio = spaces.of(&Some("studio".into())).unwrap();
    let (common, own) = (&spaces.common().packs, &studio.packs);
    let (before, of_studio) = (find(common, ""), find(own, "toy"));
    let styles = [before.styles(), of_studio.styles()];
    assert!(!Arc::ptr_eq(&styles[0], &styles[1]), "each tenant has its own");
    let workers = before.loaded().batcher.leaving();
    let style = Style {
        name: "mine".to_owned(),
        ..Style::clone(&styles[0].default_style().unwrap())
    };
    styles[0].put(style).unwrap();
    let taken = || {
        spaces
            .common()
            .store
            .memory()
            .check(usize::MAX / 2, 0)
            .unwrap_err()
            .taken
    };
    let taken_before = taken();
    assert!(taken_before > 0);

    let replaced = spaces.serve(loaded("toy", "2", |_| {}).await).unwrap();
    assert_eq!(replaced.unwrap().pack.manifest.version, "1");
    for (packs, session, styles) in [(common, &before, &styles[0]), (own, &of_studio, &styles[1])] {
        let now = find(packs, "");
        assert_eq!(
            (version(&now), version(session)),
            ("2".to_owned(), "2".to_owned())
        );
        // Whoever holds the styles sees what is uploaded later.
        assert!(Arc::ptr_eq(&session.styles(), styles) && Arc::ptr_eq(&now.styles(), styles));
        assert!(Arc::ptr_eq(&now.load, &session.load), "the load goes on");
        assert!(
            !Arc::ptr_eq(&now.metrics, &session.metrics),
            "metrics are by version"
        );
    }
    assert_eq!(taken(), taken_before, "its styles count once");
    assert!(Arc::ptr_eq(&find(common, "").metrics, &find(own, "").metrics));
    assert!(!workers.is_held(), "the version before has no holder");
    let later = spaces.of(&Some("later".into())).unwrap();
    assert_eq!(version(&find(&later.packs, "")), "2");
}

#[tokio::test]
async fn a_pack_that_is_served_no_more_stays_with_its_sessions() {
    let spaces = spaces(vec![loaded("other", "1", |_| {}).await]).await;
    let packs = &spaces.common().packs;
    let session = find(packs, "other");
    let workers = session.loaded().batcher.leaving();
    assert_eq!(spaces.end("other").unwrap().pack.name(), "other");
    assert!(spaces.end("other").is_none(), "it is gone already");
    let error = packs
        .find(&troupe_character::Path::root(), "other", "")
        .unwrap_err();
    assert_eq!(error.to_string(), "unknown pack \"other\"; loaded: toy");
    assert_eq!(version(&session), "1");
    // A pack that comes later is none of that session's.
    assert!(
        spaces
            .serve(loaded("other", "2", |_| {}).await)
            .unwrap()
            .is_none()
    );
    assert_eq!(
        (version(&session), version(&find(packs, "other"))),
        ("1".to_owned(), "2".to_owned())
    );
    assert!(workers.is_held());
    drop(session);
    assert!(!workers.is_held());
}

#[tokio::test]
async fn a_pack_of_another_shape_is_refused_under_a_name_that_was_served() {
    let spaces = spaces(vec![loaded("other", "1", |_| {}).await]).await;
    let faster = |pack: &mut Pack| Arc::make_mut(&mut pack.rig).fps = 60.0;
    for name in ["toy", "other"] {
        if name == "other" {
            spaces.end(name).unwrap();
        }
        let error = spaces.serve(loaded(name, "2", faster).await).unwrap_err();
        assert!(
            error.to_string().starts_with("it has 60 frames a second, not 30"),
            "{error}"
        );
    }
    assert_eq!(version(&find(&spaces.common().packs, "toy")), "1");
    assert!(spaces.serve(loaded("new", "1", faster).await).unwrap().is_none());
}

#[tokio::test]
async fn sessions_get_the_words_of_packs_that_come_and_let_go_of_those_that_leave() {
    let spaces = spaces(vec![loaded("other", "1", |_| {}).await]).await;
    let packs = &spaces.common().packs;
    let (stays, leaves) = (find(packs, "toy"), find(packs, "other"));
    spaces.end("other").unwrap();
    let knows = || [&stays, &leaves].map(|session| session.words().get("words").is_some());
    assert_eq!(knows(), [false, false]);
    let speaks = |pack: &mut Pack| pack.manifest.capabilities.text = true;
    let words = loaded("words", "1", speaks).await;
    let workers = words.batcher.leaving();
    spaces.serve(words).unwrap();
    assert_eq!(knows(), [true, true]);
    drop(spaces.end("words"));
    assert_eq!(knows(), [false, false]);
    assert!(!workers.is_held());
}
