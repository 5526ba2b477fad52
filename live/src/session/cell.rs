//! One session: its character behind a lock, who advances it, and when it was last wanted.

use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};

use tokio::sync::Notify;
use troupe_motion::conventions::Convention;

use super::owner::{End, Owner};
use super::stream::Audience;
use super::wants::Wants;
use super::words::Performer;
use super::{EventQueue, LivePack, SessionError, TimeSource};
use troupe_batch::{OwnerId, SubmitError};
use troupe_character::live::{Character, Stats};
use troupe_character::scene::Resident;
use troupe_character::style::Style;

/// The next session's name to the batchers.
static NEXT_OWNER: AtomicU64 = AtomicU64::new(0);

/// The value of [`SessionCell::owner`] that no owner can take: the session is about to expire.
const EXPIRING: u8 = 3;

/// What is behind a session's lock.
#[derive(Debug)]
pub struct Live {
    /// The character.
    pub character: Character,
    /// The style of the newest command.
    pub style: Arc<Style>,
    /// How much it matters that the character is planned for often, 0 to 1.
    pub priority: f32,
    /// Why plans failed since the last that did not, and how many.
    pub trouble: Option<(u32, SubmitError)>,
    /// What happened to the character that nobody has taken yet.
    pub events: EventQueue,
    /// The words that are on their way.
    pub(super) performer: Option<Performer>,
    /// Its place in its scene, until it ends.
    resident: Option<Resident>,
    /// What the metrics know of the character.
    counted: Stats,
}

/// One session.
#[derive(Debug)]
pub struct SessionCell {
    id: Arc<str>,
    owner_id: OwnerId,
    pack: Arc<LivePack>,
    convention: Convention,
    seed: u64,
    /// Name of its scene.
    scene: Option<Arc<str>>,
    ttl: Duration,
    time: TimeSource,
    born: Instant,
    /// Milliseconds from `born` to the last sign of life.
    seen_ms: AtomicU64,
    owner: AtomicU8,
    ended: AtomicU8,
    /// It was there before the server started, and its client has not said yet what it saw.
    woken: AtomicBool,
    live: Mutex<Live>,
    /// Those who watch the stream that it is on, or was on last.
    audience: Mutex<Weak<Audience>>,
    /// A plan came, failed, or the session ended. One waiter at most: the owner.
    changed: Notify,
}

/// What a new session is made of.
pub struct Parts {
    /// Its id.
    pub id: Arc<str>,
    /// Its pack.
    pub pack: Arc<LivePack>,
    /// Its convention.
    pub convention: Convention,
    /// Its seed.
    pub seed: u64,
    /// Its time to live.
    pub ttl: Duration,
    /// Its character.
    pub character: Character,
    /// The style that it starts in.
    pub style: Arc<Style>,
    /// Its priority at first, 0 to 1.
    pub priority: f32,
    /// Its place in its scene, where it lives in one; then its character does too.
    pub resident: Option<Resident>,
    /// Whether it was there before the server started.
    pub woken: bool,
}

impl Live {
    /// The place in its scene; none in no scene, or where the session has ended.
    pub fn resident(&self) -> Option<&Resident> {
        self.resident.as_ref()
    }
}

impl SessionCell {
    /// A session that nobody advances yet.
    pub fn new(parts: Parts, time: TimeSource) -> Self {
        let born = time.now();
        Self {
            id: parts.id,
            owner_id: OwnerId(NEXT_OWNER.fetch_add(1, Ordering::Relaxed)),
            pack: parts.pack,
            convention: parts.convention,
            seed: parts.seed,
            scene: parts.resident.as_ref().map(|resident| resident.name().clone()),
            ttl: parts.ttl,
            time,
            born,
            seen_ms: AtomicU64::new(0),
            owner: AtomicU8::new(Owner::Free as u8),
            ended: AtomicU8::new(0),
            woken: AtomicBool::new(parts.woken),
            live: Mutex::new(Live {
                character: parts.character,
                style: parts.style,
                priority: parts.priority,
                trouble: None,
                events: EventQueue::default(),
                performer: None,
                resident: parts.resident,
                counted: Stats::default(),
            }),
            audience: Mutex::default(),
            changed: Notify::new(),
        }
    }

    /// Its id.
    pub fn id(&self) -> &Arc<str> {
        &self.id
    }

    /// Its name to the pack's batcher. Unlike its id, no later session has it again.
    pub fn owner_id(&self) -> OwnerId {
        self.owner_id
    }

    /// Its pack.
    pub fn pack(&self) -> &Arc<LivePack> {
        &self.pack
    }

    /// The convention of everything that it takes and gives.
    pub fn convention(&self) -> Convention {
        self.convention
    }

    /// Its seed.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// Name of the scene that it lives in.
    pub fn scene(&self) -> Option<&Arc<str>> {
        self.scene.as_ref()
    }

    /// Time without a sign of life after which it expires.
    pub fn ttl(&self) -> Duration {
        self.ttl
    }

    /// Whether it was there before the server started, and this is the first time that somebody
    /// asks.
    pub(super) fn take_woken(&self) -> bool {
        self.woken.swap(false, Ordering::AcqRel)
    }

    /// Its character. Never held across an await.
    pub fn live(&self) -> MutexGuard<'_, Live> {
        // A panic under the lock leaves a character that may look odd, but one that still moves.
        self.live.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Those who watch the stream that it is on, or was on last.
    pub(super) fn audience(&self) -> Option<Arc<Audience>> {
        let audience = self.audience.lock().unwrap_or_else(PoisonError::into_inner);
        audience.upgrade()
    }

    /// Its frames go to `audience` from now on.
    pub(super) fn show_to(&self, audience: Weak<Audience>) {
        *self.audience.lock().unwrap_or_else(PoisonError::into_inner) = audience;
    }

    /// Notes a sign of life.
    pub fn touch(&self) {
        let ms = self.time.now().saturating_duration_since(self.born).as_millis() as u64;
        self.seen_ms.fetch_max(ms, Ordering::Relaxed);
    }

    /// Time left at `now`: all of it while somebody advances the session.
    pub fn left(&self, now: Instant) -> Duration {
        if self.owner() != Owner::Free {
            return self.ttl;
        }
        self.ttl.saturating_sub(self.idle(now))
    }

    /// Who advances it.
    pub fn owner(&self) -> Owner {
        Owner::of(self.owner.load(Ordering::Acquire))
    }

    /// How it ended, where it has.
    pub fn end(&self) -> Option<End> {
        match self.ended.load(Ordering::Acquire) {
            0 => None,
            1 => Some(End::Closed),
            _ => Some(End::Expired),
        }
    }

    /// Ends it where its time is up at `now` and nobody advances it. Answers whether it did.
    pub(super) fn expire(&self, now: Instant) -> bool {
        self.expire_after(self.ttl, now)
    }

    /// Ends it where nobody advances it, and nobody has for `limit`. Answers whether it did.
    pub(super) fn expire_after(&self, limit: Duration, now: Instant) -> bool {
        let free = Owner::Free as u8;
        if self.idle(now) < limit || self.owner() != Owner::Free {
            return false;
        }
        let taken = self
            .owner
            .compare_exchange(free, EXPIRING, Ordering::AcqRel, Ordering::Acquire);
        if taken.is_err() {
            return false;
        }
        // Somebody may have wanted it between the look at the clock and now.
        if self.idle(now) < limit {
            self.owner.store(free, Ordering::Release);
            return false;
        }
        self.finish(End::Expired)
    }

    /// Time at `now` since the last sign of life.
    pub(super) fn idle(&self, now: Instant) -> Duration {
        let seen = self.born + Duration::from_millis(self.seen_ms.load(Ordering::Acquire));
        now.saturating_duration_since(seen)
    }

    /// Ends it, whoever has it. Answers whether it was open.
    pub(super) fn finish(&self, end: End) -> bool {
        let first = self
            .ended
            .compare_exchange(0, end as u8, Ordering::AcqRel, Ordering::Acquire)
            .is_ok();
        if first {
            self.leave_scene();
            drop(self.live().performer.take());
            self.changed.notify_one();
        }
        first
    }

    /// Gives up what its character has in its scene, and its place there.
    fn leave_scene(&self) {
        if self.scene.is_some() {
            let mut live = self.live();
            live.character.leave();
            live.resident = None;
        }
    }

    /// Takes the session's clock for `owner`, until the guard is dropped.
    ///
    /// # Errors
    /// [`SessionError::Busy`], or what [`SessionCell::gone`] says. `field` named the session.
    pub fn take(self: &Arc<Self>, owner: Owner, field: &dyn Fn() -> String) -> Result<Held, SessionError> {
        let (free, wanted) = (Owner::Free as u8, owner as u8);
        loop {
            let taken = self
                .owner
                .compare_exchange(free, wanted, Ordering::AcqRel, Ordering::Acquire);
            let held = taken.map(|_| Held(self.clone()));
            if let Some(error) = self.gone(field) {
                return Err(error);
            }
            match held {
                Ok(held) => {
                    self.touch();
                    return Ok(held);
                }
                // Somebody looks whether it expires; that takes a moment.
                Err(EXPIRING) => std::hint::spin_loop(),
                Err(other) => {
                    return Err(SessionError::Busy {
                        id: self.id.to_string(),
                        field: field(),
                        owner: match Owner::of(other) {
                            Owner::Drive => "a stream",
                            _ => "a step",
                        },
                    });
                }
            }
        }
    }

    /// Why the session cannot be served any more, where it has ended.
    pub fn gone(&self, field: &dyn Fn() -> String) -> Option<SessionError> {
        match self.end()? {
            End::Expired => Some(SessionError::Expired {
                id: self.id.to_string(),
                field: field(),
            }),
            End::Closed => Some(SessionError::Unknown {
                id: self.id.to_string(),
                field: field(),
            }),
        }
    }

    /// Waits until a plan came or failed, or the session ended, since the last wait. For the owner
    /// only.
    pub async fn changed(&self) {
        self.changed.notified().await;
    }

    /// Wakes the owner.
    pub(super) fn wake(&self) {
        self.changed.notify_one();
    }

    /// Takes the requests that the character has, where there are any, and what happened to it;
    /// counts what it has done meanwhile, and gives up words that it wants no more.
    pub fn settle(&self, live: &mut Live) -> Wants {
        let Live {
            character, events, ..
        } = live;
        events.collect(|fresh| character.take_events(fresh), &self.pack.metrics);
        let stats = live.character.stats();
        if stats != live.counted {
            self.pack.metrics.progressed(&live.counted, &stats);
            live.counted = stats;
        }
        let is_unwanted = |performer: &mut Performer| !live.character.performs_as(performer.number());
        drop(live.performer.take_if(is_unwanted));
        let wants = Wants {
            plan: live.character.take_request(),
            words: live.character.take_words_request(),
        };
        if let Some(request) = &wants.plan {
            self.pack.metrics.asked(request.cause);
            self.pack
                .metrics
                .paced(live.priority, request.spacing_frames, request.item.frames());
        }
        wants
    }
}

/// A session's clock, in somebody's hands. Dropping it lets go.
#[derive(Debug)]
pub struct Held(Arc<SessionCell>);

impl Held {
    /// The session.
    pub fn cell(&self) -> &Arc<SessionCell> {
        &self.0
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        self.0.touch();
        self.0.owner.store(Owner::Free as u8, Ordering::Release);
    }
}
