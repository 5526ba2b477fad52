//! What the keeper promises, with a disk that fails. Time is simulated.

use std::collections::BTreeMap;
use std::path::Path as FilePath;
use std::thread::JoinHandle;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tokio::time::advance;
use troupe_proto::v1;

use super::super::backlog::MAX_STORE_AGE;
use super::super::{Executor, LivePacks, SessionLimits, Sessions, TenantOptions, TimeSource};
use super::*;
use crate::packs::{LoadedPack, PackTable, load_styles};
use crate::records::disk::{Fault, Shared, on};
use crate::world::Folders;
use troupe_batch::scheduler::Limits;
use troupe_batch::{Batcher, GeneratorFactory, PackMetrics};
use troupe_character::testing::toy_rig;
use troupe_engine::pack::testing::pack_of;
use troupe_engine::toy::Toy;

const SEEDS: u64 = 1000;
/// Rounds of a seed. The last one is the end of a server.
const TURNS: u32 = 20;
const INTERVAL: Duration = Duration::from_millis(250);

/// Packs, which all servers of a test share.
pub(in crate::session) struct House {
    packs: LivePacks,
    pub(in crate::session) telemetry: Telemetry,
}

impl House {
    pub(in crate::session) async fn new() -> Self {
        let telemetry = Telemetry::new().unwrap();
        let mut pack = pack_of(toy_rig());
        pack.folder = FilePath::new(env!("CARGO_MANIFEST_DIR")).join("../server/tests/common/toy");
        let (name, dims) = (pack.name().to_owned(), pack.rig.dims);
        let metrics = PackMetrics::new(&telemetry, &name, "1");
        let factory: GeneratorFactory = Arc::new(move |_| Ok(Box::new(Toy::new(dims, 1))));
        let limits = Limits::default();
        let batcher = Batcher::start("test", limits, Duration::ZERO, metrics.clone(), factory);
        let loaded = LoadedPack {
            styles: load_styles(&pack, None).unwrap(),
            skills: Arc::default(),
            batcher: batcher.await.unwrap(),
            engine: "toy",
            pack: Arc::new(pack),
            metrics,
        };
        Self {
            packs: LivePacks::new(PackTable::new(vec![loaded], name), &telemetry),
            telemetry,
        }
    }

    fn spaces(&self, most_tenants: usize) -> Arc<Spaces> {
        self.spaces_in(Folders::default(), most_tenants)
    }

    /// Spaces with the scenes of `folders`.
    pub(in crate::session) fn spaces_in(&self, folders: Folders, most_tenants: usize) -> Arc<Spaces> {
        let limits = SessionLimits {
            sessions: 100,
            per_request: 10,
            per_stream: 10,
            streams: 10,
            ttl_ms: 600_000,
            stall_timeout: Duration::from_secs(30),
        };
        let sessions = Sessions::new(limits, TimeSource::default(), Executor::here(), &self.telemetry);
        let store = Store::load(folders, 1 << 20, []).unwrap();
        let options = TenantOptions {
            folder: None,
            most: most_tenants,
        };
        let packs = self.packs.clone();
        Arc::new(Spaces::new(packs, Arc::new(store), Arc::new(sessions), options))
    }

    /// A server that starts with what `disk` has.
    fn start(&self, disk: &Shared) -> (Arc<Spaces>, Keeper) {
        let spaces = self.spaces(8);
        let keeper = Keeper::new(&spaces, Box::new(on(disk).unwrap()), &self.telemetry).unwrap();
        (spaces, keeper)
    }
}

pub(in crate::session) async fn open(space: &Space, id: &str) {
    let options = v1::SessionOptions {
        id: id.to_owned(),
        ..v1::SessionOptions::default()
    };
    let request = v1::CreateSessionsRequest {
        sessions: vec![options],
    };
    let created = space.sessions.create(&space.packs, &space.store, request).await;
    created.unwrap();
}

pub(in crate::session) async fn command(space: &Space, id: &str, sequence: u64) {
    let command = v1::Command {
        session_id: id.to_owned(),
        sequence,
        intent: Some(v1::command::Intent::Locomote(v1::Locomote {
            velocity: Some(v1::Vec3::default()),
            ..v1::Locomote::default()
        })),
        ..v1::Command::default()
    };
    let results = space.sessions.apply(&[command]).await;
    assert!(results[0].outcome.is_ok(), "{results:?}");
}

fn close(space: &Space, id: &str) {
    let ids = vec![id.to_owned()];
    space.sessions.close(&v1::CloseSessionsRequest { ids }).unwrap();
}

/// What a session is like at a moment: its last command, or `None` if it is closed.
type State = Option<u64>;

/// All that happened to sessions, by id.
#[derive(Default)]
struct History(BTreeMap<String, Vec<(Instant, State)>>);

impl History {
    async fn change(&mut self, rng: &mut ChaCha8Rng, space: &Space) {
        let id = format!("s{}", rng.random_range(0..6));
        let states = self.0.entry(id.clone()).or_default();
        let last = states.last().and_then(|(_, state)| *state);
        let next = match last {
            None => {
                open(space, &id).await;
                Some(0)
            }
            Some(_) if rng.random_bool(0.15) => {
                close(space, &id);
                None
            }
            Some(sequence) => {
                command(space, &id, sequence + 1).await;
                Some(sequence + 1)
            }
        };
        states.push((Instant::now(), next));
    }

    /// Checks that a server has all changes up to `until`. Returns the number of sessions that lack
    /// later ones.
    fn check(&self, space: &Space, until: Instant, what: &str) -> usize {
        let mut behind = 0;
        for (id, states) in &self.0 {
            let found = space.sessions.get(id).ok().map(|session| session.last_sequence);
            let is_found = |(_, state): &(Instant, State)| *state == found;
            let must = states.iter().rposition(|(at, _)| *at <= until);
            let is_kept = match must {
                Some(must) => states[must..].iter().any(is_found),
                None => found.is_none() || states.iter().any(is_found),
            };
            assert!(
                is_kept,
                "{what}: {id} is {found:?} of {states:?}, kept until {until:?}"
            );
            let last = states.last().and_then(|(_, state)| *state);
            behind += usize::from(last != found);
        }
        behind
    }
}

/// Does a round on a thread with the test's clock. The error is a thread that hangs.
fn by_a_thread<T: Send + 'static>(
    round: impl FnOnce() -> T + Send + 'static,
    disk: &Shared,
) -> Result<T, JoinHandle<T>> {
    let clock = tokio::runtime::Handle::current();
    let round = std::thread::spawn(move || {
        let _clock = clock.enter();
        round()
    });
    while !round.is_finished() && !disk.hangs() {
        std::thread::sleep(Duration::from_micros(50));
    }
    match disk.hangs() {
        true => Err(round),
        false => Ok(round.join().unwrap()),
    }
}

/// Faults that begin at a random write and stay. What the age says is kept is there after a
/// restart, the end says what is not, and the age rises while nothing is kept.
#[tokio::test(start_paused = true)]
async fn a_thousand_faults_that_stay_are_seen_and_lose_nothing_that_was_kept() {
    let house = House::new().await;
    let begun = std::time::Instant::now();
    let (mut lost, mut kept, mut seen) = (0, 0, BTreeMap::new());
    for seed in 0..SEEDS {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let disk = Shared::default();
        let (spaces, keeper) = house.start(&disk);
        let (space, backlog) = (spaces.common().clone(), keeper.backlog().clone());
        let mut history = History::default();
        let fault = [Fault::Full, Fault::ReadOnly, Fault::Torn, Fault::Hung][seed as usize % 4];
        // Not at all in one seed of five.
        let begins = rng.random_range(1..TURNS * 5 / 4);
        let (mut idle, mut hangs, mut end) = (Some(keeper), None, None);
        for turn in 1..=TURNS {
            for _ in 0..rng.random_range(0..4) {
                advance(Duration::from_millis(rng.random_range(1..80))).await;
                history.change(&mut rng, &space).await;
            }
            if turn == begins {
                disk.set_fault(Some((rng.random_range(0..12), fault)));
            }
            let max_bytes = rng.random_range(0..2000);
            let Some(mut keeper) = idle.take() else { continue };
            let round = move || {
                let result = match turn {
                    TURNS => keeper.finish(),
                    _ => keeper.counted(max_bytes).map(|_| ()),
                };
                (keeper, result)
            };
            let done = match fault == Fault::Hung && turn >= begins {
                true => by_a_thread(round, &disk),
                false => Ok(round()),
            };
            match done {
                Ok((keeper, result)) => (idle, end) = (Some(keeper), Some(result)),
                Err(round) => hangs = Some(round),
            }
        }
        let until = Instant::now() - backlog.age();
        let died = disk.copy();
        if rng.random_bool(0.5) {
            died.pull(&mut rng);
        }
        let what = format!("seed {seed}, {fault:?} from {begins}, {end:?}");
        let (after, next) = house.start(&died);
        let behind = history.check(after.common(), until, &what);
        drop(next);
        if let Some(round) = hangs {
            let age = backlog.age();
            advance(MAX_STORE_AGE).await;
            assert_eq!(backlog.age(), age + MAX_STORE_AGE, "{what}: the age rises");
            assert!(backlog.check().is_err() && backlog.sessions() > 0, "{what}");
            disk.set_fault(None);
            drop(round.join().unwrap());
            *seen.entry("hung").or_insert(0) += 1;
        } else {
            let is_kept = end.is_some_and(|end| end.is_ok());
            assert_eq!(is_kept, backlog.sessions() == 0, "{what}");
            assert!(behind <= backlog.sessions(), "{what}: {behind}");
            *seen.entry(if is_kept { "kept" } else { "not kept" }).or_insert(0) += 1;
        }
        // A keeper writes when it is dropped, which must not hang.
        disk.set_fault(None);
        drop(idle);
        lost += behind;
        kept += history.0.len() - behind;
    }
    println!(
        "{lost} sessions lost changes, {kept} did not; ends: {seen:?}; {:?}",
        begun.elapsed()
    );
    assert!(lost > 500 && kept > 1000, "{lost} {kept}");
    for end in ["kept", "not kept", "hung"] {
        assert!(seen.get(end).is_some_and(|count| *count > 50), "{seen:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn the_oldest_change_is_kept_first_and_a_round_has_an_end() {
    let house = House::new().await;
    let disk = Shared::default();
    let (spaces, mut keeper) = house.start(&disk);
    let (space, backlog) = (spaces.common().clone(), keeper.backlog().clone());
    for id in ["a", "b", "c"] {
        open(&space, id).await;
    }
    keeper.round(ROUND_BYTES).unwrap();
    assert_eq!((backlog.sessions(), backlog.age()), (0, Duration::ZERO));
    disk.set_fault(Some((0, Fault::Full)));
    for id in ["b", "c", "a"] {
        advance(INTERVAL).await;
        command(&space, id, 1).await;
        let (wait, result) = keeper.go_on(INTERVAL);
        assert!(wait == INTERVAL && result.is_err());
    }
    // The change of "b" may be as old as the round before it.
    assert_eq!((backlog.sessions(), backlog.age()), (3, 3 * INTERVAL));
    assert!(
        backlog.reason().starts_with("store: the disk: "),
        "{}",
        backlog.reason()
    );
    advance(MAX_STORE_AGE).await;
    let error = backlog.check().unwrap_err().to_string();
    assert!(
        error.contains("5 s behind, allowed: at most 5 s; store: the disk: "),
        "{error}"
    );

    disk.set_fault(None);
    for (id, left) in [("b", 2), ("c", 1), ("a", 0)] {
        let round = keeper.round(1).unwrap();
        assert_eq!((round.is_partial, backlog.sessions()), (left > 0, left));
        let (after, _keeper) = house.start(&disk.copy());
        let found = after.common().sessions.get(id).unwrap().last_sequence;
        assert_eq!(found, 1, "{id} comes first");
    }
    assert_eq!(backlog.age(), Duration::ZERO);
}

#[tokio::test(start_paused = true)]
async fn the_sessions_of_a_scene_are_written_together() {
    let house = House::new().await;
    let (spaces, mut keeper) = house.start(&Shared::default());
    let space = spaces.common().clone();
    let document = v1::Document {
        text: "format = 1\nname = \"yard\"\n".to_owned(),
        format: v1::DocumentFormat::Toml.into(),
    };
    let scene = v1::PutSceneRequest {
        document: Some(document),
        ..v1::PutSceneRequest::default()
    };
    space.store.put(&scene).unwrap();
    let inside = ["a", "b", "c"].map(|id| v1::SessionOptions {
        id: id.to_owned(),
        scene: "yard".to_owned(),
        ..v1::SessionOptions::default()
    });
    let request = v1::CreateSessionsRequest {
        sessions: inside.to_vec(),
    };
    let created = space.sessions.create(&space.packs, &space.store, request).await;
    created.unwrap();
    open(&space, "outside").await;
    // Each round ends after its first session, or with all of a scene.
    assert!(keeper.round(1).unwrap().is_partial);
    assert!(!keeper.round(1).unwrap().is_partial);
    assert_eq!(keeper.backlog().sessions(), 0);
}

#[tokio::test]
async fn a_tenant_without_anything_makes_room() {
    let house = House::new().await;
    let spaces = house.spaces(2);
    let tenant = |name: &str| spaces.of(&Some(name.into()));
    let known = |name: &str| spaces.known(&Some(name.into())).is_some();
    drop((tenant("a").unwrap(), tenant("b").unwrap()));
    drop(tenant("a").unwrap());
    // "b" is idle for longest.
    open(&tenant("c").unwrap(), "hero").await;
    assert!(known("a") && known("c") && !known("b"));
    // "a" has nothing, but a call of it runs.
    let call = tenant("a").unwrap();
    let error = tenant("d").unwrap_err().to_string();
    assert!(error.contains("allowed: at most 2 that have sessions"), "{error}");
    drop(call);
    drop(tenant("d").unwrap());
    let space = tenant("c").unwrap();
    assert!(
        space.sessions.get("hero").is_ok(),
        "it has a session, so it stays"
    );
    close(&space, "hero");
    drop(space);
    drop((tenant("e").unwrap(), tenant("f").unwrap()));
    assert!(!known("c"));
}
