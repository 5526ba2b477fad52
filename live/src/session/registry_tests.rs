use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::Duration;

use proptest::prelude::*;
use troupe_motion::conventions::Convention;
use troupe_motion::{GlobalRoot, Vec3};

use super::super::cell::{Held, SessionParts};
use super::super::owner::Owner;
use super::super::{LivePack, TimeSource};
use super::*;
use crate::packs::LoadedPack;
use troupe_base::telemetry::Telemetry;
use troupe_batch::scheduler::Limits;
use troupe_batch::{Batcher, GeneratorFactory, PackMetrics};
use troupe_character::live::{Character, CharacterOptions, Start, World};
use troupe_character::primitives::LocomotionCommand;
use troupe_character::scene::testing::{boxed, place};
use troupe_character::scene::{Holder, Resident, Scene, SceneTable, State};
use troupe_character::style::StyleTable;
use troupe_character::style::testing::{walker_rig, walker_style};
use troupe_engine::pack::testing::pack_of;
use troupe_engine::toy::Toy;

const TTL: Duration = Duration::from_secs(10);

/// A word for the kind of error.
fn kind(error: &SessionError) -> &'static str {
    match error {
        SessionError::Expired { .. } => "SESSION_EXPIRED",
        SessionError::MadeRoom { .. } => "made room",
        SessionError::Unknown { .. } => "UNKNOWN_SESSION",
        SessionError::Exists { .. } => "SESSION_EXISTS",
        SessionError::Busy { .. } => "SESSION_BUSY",
        SessionError::TooMany { .. } => "TOO_MANY_SESSIONS",
        other => panic!("{other}"),
    }
}

/// A registry with a clock that is moved by hand.
pub(in super::super) struct Setup {
    registry: Registry,
    pack: Arc<LivePack>,
    start: Instant,
    passed_ms: Arc<AtomicU64>,
    telemetry: Telemetry,
}

impl Setup {
    pub(in super::super) async fn new(limit: usize) -> Self {
        let (pack, telemetry) = (pack_of(walker_rig()), Telemetry::new().unwrap());
        let limits = Limits {
            max_batch: 8,
            ..Limits::default()
        };
        let metrics = PackMetrics::new(&telemetry, pack.name(), "1");
        let dims = pack.rig.dims;
        let factory: GeneratorFactory = Arc::new(move |_| Ok(Box::new(Toy::new(dims, 1))));
        let batcher = Batcher::start("test", limits, Duration::ZERO, metrics.clone(), factory);
        let loaded = LoadedPack {
            styles: vec![Arc::new(StyleTable::load(&pack.rig, &pack.folder, None).unwrap())],
            skills: Arc::default(),
            batcher: batcher.await.unwrap(),
            engine: "idle",
            pack: Arc::new(pack),
            metrics,
        };
        Self {
            registry: Registry::new(limit),
            pack: Arc::new(LivePack::new(Arc::new(loaded), &telemetry)),
            start: Instant::now(),
            passed_ms: Arc::default(),
            telemetry,
        }
    }

    fn now(&self) -> Instant {
        self.start + Duration::from_millis(self.passed_ms.load(Ordering::Relaxed))
    }

    fn pass(&self, time: Duration) {
        self.passed_ms
            .fetch_add(time.as_millis() as u64, Ordering::Relaxed);
    }

    pub(in super::super) fn cell(&self, id: &str) -> Arc<SessionCell> {
        self.cell_in(id, None)
    }

    /// A session that lives in a scene.
    pub(in super::super) fn cell_in(&self, id: &str, resident: Option<Resident>) -> Arc<SessionCell> {
        let world = resident.as_ref().map(|resident| World {
            scene: resident.cell().clone(),
            definitions: Arc::default(),
            holder: Holder::new(id),
            scale: 1.0,
        });
        let style = Arc::new(walker_style());
        let options = CharacterOptions {
            seed: 0,
            look_ahead_frames: 4,
            replan_interval_frames: None,
            root_ratio: None,
            temperature: 0.0,
        };
        let command = LocomotionCommand {
            velocity: Vec3::ZERO,
            facing: None,
            style: style.clone(),
            gait: None,
            height_m: None,
        };
        let start = Start::Standing(GlobalRoot::new(Vec3::ZERO, 0.0));
        let (from, passed) = (self.start, self.passed_ms.clone());
        let time = TimeSource::new(move || from + Duration::from_millis(passed.load(Ordering::Relaxed)));
        let parts = SessionParts {
            id: Arc::from(id),
            pack: self.pack.clone(),
            convention: Convention::Native,
            seed: 0,
            ttl: TTL,
            character: Character::in_world(self.pack.rig().clone(), options, start, command, world),
            dress: None,
            style,
            priority: 0.5,
            resident,
            woken: false,
        };
        Arc::new(SessionCell::new(parts, time))
    }

    fn open(&self, id: &str) -> Result<(), SessionError> {
        self.registry
            .insert(&[self.cell(id)], self.now(), |_| "id".to_owned())
    }

    fn close(&self, id: &str) -> bool {
        self.registry.close(id, self.now(), &String::new).unwrap()
    }

    fn get(&self, id: &str) -> Result<Arc<SessionCell>, &'static str> {
        let got = self.registry.get(id, self.now(), &|| "id".to_owned());
        got.map_err(|error| kind(&error))
    }

    fn take(&self, id: &str, owner: Owner) -> Result<Held, &'static str> {
        let taken = self.get(id)?.take(owner, &|| "id".to_owned());
        taken.map_err(|error| kind(&error))
    }
}

#[tokio::test]
async fn a_session_that_is_held_does_not_expire_and_its_time_begins_when_it_is_let_go() {
    let setup = Setup::new(2).await;
    setup.open("a").unwrap();
    let held = setup.take("a", Owner::Drive).unwrap();
    setup.pass(TTL * 5);
    assert_eq!(setup.registry.sweep(setup.now()), 0);
    assert_eq!(held.cell().left(setup.now()), TTL);
    assert_eq!(setup.take("a", Owner::Step).unwrap_err(), "SESSION_BUSY");
    drop(held);
    setup.pass(TTL - Duration::from_millis(1));
    assert_eq!(setup.registry.sweep(setup.now()), 0);
    setup.pass(Duration::from_millis(1));
    assert_eq!(setup.registry.sweep(setup.now()), 1);
    assert_eq!(setup.get("a").unwrap_err(), "SESSION_EXPIRED");
}

#[tokio::test]
async fn the_owner_of_a_closed_session_gets_an_error() {
    let setup = Setup::new(2).await;
    setup.open("a").unwrap();
    let held = setup.take("a", Owner::Step).unwrap();
    assert!(setup.close("a"));
    held.cell().changed().await;
    assert_eq!(held.cell().end(), Some(End::Closed));
    assert_eq!(kind(&held.cell().gone(&String::new).unwrap()), "UNKNOWN_SESSION");
    assert!(!setup.close("a"));
    assert_eq!(setup.get("a").unwrap_err(), "UNKNOWN_SESSION");
}

#[tokio::test]
async fn an_expired_session_makes_room_before_the_sweep() {
    let setup = Setup::new(2).await;
    setup.open("a").unwrap();
    setup.open("b").unwrap();
    setup.pass(TTL / 2);
    setup.get("b").unwrap().touch();
    setup.pass(TTL / 2);
    assert_eq!(kind(&setup.open("b").unwrap_err()), "TOO_MANY_SESSIONS");
    setup
        .registry
        .room_for(1, Duration::from_secs(3600), setup.now())
        .unwrap();
    assert_eq!(setup.get("a").unwrap_err(), "SESSION_EXPIRED");
    assert_eq!(kind(&setup.open("b").unwrap_err()), "SESSION_EXISTS");
    setup.pass(TTL / 2);
    // Its time is up and no sweep has come round.
    setup.open("b").unwrap();
    assert_eq!((setup.registry.len(), setup.get("b").is_ok()), (1, true));
    assert_eq!(
        kind(
            &setup
                .registry
                .room_for(2, Duration::from_secs(3600), setup.now())
                .unwrap_err()
        ),
        "TOO_MANY_SESSIONS"
    );
}

#[tokio::test]
async fn idle_sessions_with_a_long_time_to_live_make_room_if_needed() {
    let setup = Setup::new(2).await;
    setup.open("old").unwrap();
    setup.pass(TTL / 4);
    setup.open("new").unwrap();
    setup.pass(TTL / 2);
    // No session has been idle for the usual time to live.
    let usual = TTL;
    assert_eq!(
        kind(&setup.registry.room_for(1, usual, setup.now()).unwrap_err()),
        "TOO_MANY_SESSIONS"
    );
    // More room than they could make: they stay.
    let usual = TTL / 4;
    assert!(setup.registry.room_for(3, usual, setup.now()).is_err());
    assert_eq!(setup.registry.len(), 2);
    let held = setup.take("old", Owner::Step).unwrap();
    setup.registry.room_for(1, usual, setup.now()).unwrap();
    assert_eq!(setup.get("new").unwrap_err(), "made room");
    assert!(held.cell().end().is_none(), "somebody advances it");
}

#[tokio::test]
async fn a_place_is_kept_until_its_session_ends() {
    let setup = Setup::new(2).await;
    let place = Arc::new(());
    let used = || Arc::strong_count(&place) - 1;
    for id in ["closed", "expired"] {
        setup.open(id).unwrap();
        setup.registry.hold(id, Box::new(place.clone()));
    }
    setup.registry.hold("unknown", Box::new(place.clone()));
    assert_eq!(used(), 2);
    setup.close("closed");
    assert_eq!(used(), 1);
    setup.pass(2 * TTL);
    setup.registry.sweep(setup.now());
    assert_eq!(used(), 0);
}

/// What may happen to a few sessions.
#[derive(Debug, Clone)]
enum Deed {
    Open(u8),
    Close(u8),
    Take(u8),
    Drop(u8),
    Touch(u8),
    Pass(u16),
    Sweep,
}

fn deed() -> impl Strategy<Value = Deed> {
    let id = 0..4u8;
    prop_oneof![
        id.clone().prop_map(Deed::Open),
        id.clone().prop_map(Deed::Close),
        id.clone().prop_map(Deed::Take),
        id.clone().prop_map(Deed::Drop),
        id.prop_map(Deed::Touch),
        (0..12_000u16).prop_map(Deed::Pass),
        Just(Deed::Sweep),
    ]
}

/// What a session should be: when it was last wanted, and who holds it.
#[derive(Default)]
struct Model {
    open: HashMap<String, u64>,
    held: HashMap<String, Held>,
    expired: HashSet<String>,
    ends: (u64, u64),
}

impl Model {
    fn expire(&mut self, now: u64) {
        let due = |id: &str, seen: u64| !self.held.contains_key(id) && now - seen >= TTL.as_millis() as u64;
        let due: Vec<String> = self
            .open
            .iter()
            .filter(|(id, seen)| due(id, **seen))
            .map(|(id, _)| id.clone())
            .collect();
        for id in due {
            self.open.remove(&id);
            self.expired.insert(id);
            self.ends.1 += 1;
        }
    }

    fn wanted(&self, id: &str) -> Result<(), &'static str> {
        match (self.open.contains_key(id), self.expired.contains(id)) {
            (true, _) => Ok(()),
            (_, true) => Err("SESSION_EXPIRED"),
            _ => Err("UNKNOWN_SESSION"),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn sessions_live_and_end_as_the_rules_say(deeds in proptest::collection::vec(deed(), 1..60)) {
        let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
        let setup = runtime.block_on(Setup::new(3));
        let mut model = Model::default();
        for deed in deeds {
            let now = setup.passed_ms.load(Ordering::Relaxed);
            // Expired sessions without requests stay open until the sweep.
            setup.registry.sweep(setup.now());
            model.expire(now);
            match deed {
                Deed::Open(id) => {
                    let id = id.to_string();
                    let reason = setup.open(&id).map_err(|error| kind(&error));
                    let wanted = if model.open.len() == 3 {
                        Err("TOO_MANY_SESSIONS")
                    } else if model.open.contains_key(&id) {
                        Err("SESSION_EXISTS")
                    } else {
                        model.expired.remove(&id);
                        model.open.insert(id, now);
                        Ok(())
                    };
                    prop_assert_eq!(reason, wanted);
                }
                Deed::Close(id) => {
                    let id = id.to_string();
                    let was_open = model.open.remove(&id).is_some();
                    model.ends.0 += u64::from(was_open);
                    model.held.remove(&id);
                    prop_assert_eq!(setup.close(&id), was_open);
                }
                Deed::Take(id) => {
                    let id = id.to_string();
                    let wanted = model.wanted(&id).and_then(|()| match model.held.contains_key(&id) {
                        true => Err("SESSION_BUSY"),
                        false => Ok(()),
                    });
                    match setup.take(&id, Owner::Step) {
                        Ok(held) => {
                            prop_assert_eq!(wanted, Ok(()));
                            model.open.insert(id.clone(), now);
                            model.held.insert(id, held);
                        }
                        Err(reason) => prop_assert_eq!(wanted, Err(reason)),
                    }
                }
                Deed::Drop(id) => {
                    if model.held.remove(&id.to_string()).is_some() {
                        model.open.insert(id.to_string(), now);
                    }
                }
                Deed::Touch(id) => {
                    let got = setup.get(&id.to_string());
                    prop_assert_eq!(got.as_ref().map(|_| ()).map_err(|reason| *reason), model.wanted(&id.to_string()));
                    if let Ok(cell) = got {
                        cell.touch();
                        model.open.insert(id.to_string(), now);
                    }
                }
                Deed::Pass(ms) => setup.pass(Duration::from_millis(ms.into())),
                Deed::Sweep => {}
            }
            prop_assert_eq!(setup.registry.len(), model.open.len());
        }
        let text = setup.telemetry.render();
        for (reason, count) in [("closed", model.ends.0), ("expired", model.ends.1)] {
            let line = format!("reason=\"{reason}\"}} {count}\n");
            prop_assert!(text.contains(&line), "{} in {}", line, text);
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn threads_that_race_for_a_session_take_it_one_at_a_time_and_not_after_its_end() {
    let setup = Arc::new(Setup::new(1).await);
    setup.open("a").unwrap();
    let (holders, taken) = (Arc::new(AtomicUsize::new(0)), Arc::new(AtomicUsize::new(0)));
    let racers: Vec<_> = (0..4)
        .map(|_| {
            let (setup, holders, taken) = (setup.clone(), holders.clone(), taken.clone());
            std::thread::spawn(move || {
                loop {
                    match setup.take("a", Owner::Step) {
                        Ok(held) => {
                            assert_eq!(holders.fetch_add(1, Ordering::SeqCst), 0, "two hold it");
                            taken.fetch_add(1, Ordering::Relaxed);
                            holders.fetch_sub(1, Ordering::SeqCst);
                            drop(held);
                        }
                        Err("SESSION_BUSY") => {}
                        Err(reason) => return reason,
                    }
                }
            })
        })
        .collect();
    while taken.load(Ordering::Relaxed) < 1000 {
        std::thread::yield_now();
    }
    // Somebody may touch it in between, so its time has to run out more than once.
    while setup.registry.len() > 0 {
        setup.pass(TTL);
        setup.registry.sweep(setup.now());
    }
    for racer in racers {
        assert_eq!(racer.join().unwrap(), "SESSION_EXPIRED");
    }
}

fn knows(tombstones: &Tombstones, tenant: &Tenant, id: &str) -> bool {
    tombstones.end_of(tenant, id).is_some()
}

#[test]
fn tombstones_are_few_and_the_newest() {
    let mut tombstones = Tombstones::new(3);
    for index in 0..10 {
        tombstones.add((None, format!("{index}").into()), End::Expired);
    }
    assert_eq!((tombstones.by_age.len(), tombstones.by_id.len()), (3, 3));
    assert!(knows(&tombstones, &None, "9") && knows(&tombstones, &None, "7"));
    assert!(!knows(&tombstones, &None, "6") && !knows(&tombstones, &Some("a".into()), "9"));
}

#[test]
fn an_id_that_is_used_again_is_not_forgotten_early() {
    let mut tombstones = Tombstones::new(3);
    tombstones.add((None, "a".into()), End::Expired);
    tombstones.forget(&(None, "a".into()));
    assert!(!knows(&tombstones, &None, "a"));
    tombstones.add((None, "b".into()), End::Expired);
    tombstones.add((None, "a".into()), End::Expired);
    // The first "a" makes room, which must not take the second with it.
    tombstones.add((None, "c".into()), End::MadeRoom);
    assert!(
        knows(&tombstones, &None, "a") && knows(&tombstones, &None, "b") && knows(&tombstones, &None, "c")
    );
}

#[tokio::test]
async fn a_session_that_ends_leaves_its_scene_and_all_that_it_has_there() {
    let scenes = SceneTable::default();
    let yard = scenes.add("yard", Scene::default()).unwrap();
    for (id, x) in [("chair", 0.0), ("cup", 3.0), ("sign", 6.0)] {
        yard.update(|scene| scene.add(id, "thing", boxed(0.5), place(x, 0.0, 0.0)))
            .unwrap();
    }
    let setup = Setup::new(2).await;
    for (id, taken) in [("a", "chair"), ("b", "sign")] {
        let cell = setup.cell_in(id, Some(scenes.enter("yard").unwrap()));
        let by = Holder::new(id);
        yard.update(|scene| scene.reserve(taken, &by)).unwrap();
        setup
            .registry
            .insert(&[cell], setup.now(), |_| "id".to_owned())
            .unwrap();
    }
    yard.update(|scene| scene.hold("cup", &Holder::new("a"))).unwrap();
    let taken = || {
        let scene = yard.snapshot();
        let mut taken: Vec<String> = (scene.instances())
            .filter(|instance| instance.state != State::Free)
            .map(|instance| instance.id.to_string())
            .collect();
        taken.sort();
        taken
    };
    assert_eq!((taken().len(), yard.residents()), (3, 2));
    // Who advances it, or looks at it, may have it for a while yet.
    let held = setup.take("a", Owner::Step).unwrap();
    assert!(setup.close("a"));
    assert_eq!((taken(), yard.residents()), (vec!["sign".to_owned()], 1));
    assert!(held.cell().live().resident().is_none());
    assert_eq!(held.cell().scene().map(|name| &**name), Some("yard"));
    setup.pass(TTL);
    assert_eq!(setup.registry.sweep(setup.now()), 1);
    assert_eq!((taken().len(), yard.residents()), (0, 0));
    scenes.remove("yard").unwrap();
}
