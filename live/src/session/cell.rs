//! One session: its character behind a lock, its owner, and the time of its last use.

use std::sync::atomic::{AtomicU8, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};

use tokio::sync::Notify;
use troupe_motion::conventions::Convention;
use troupe_motion::robot::HingeRate;
use troupe_motion::{Quat, Vec3};

use super::hinge_rates::ShownRates;
use super::owner::{End, Owner};
use super::recording::Recorder;
use super::resume::Return;
use super::stream::Audience;
use super::wants::Wants;
use super::words::Performer;
use super::{EventQueue, LivePack, SessionError, TimeSource};
use crate::skeleton::Dress;
use crate::wire::Measure;
use troupe_batch::{OwnerId, SubmitError};
use troupe_character::Size;
use troupe_character::live::{Character, FrameOut, Stats};
use troupe_character::scene::Resident;
use troupe_character::style::Style;

/// The id by which batchers will tell the next session from others.
static NEXT_OWNER: AtomicU64 = AtomicU64::new(0);

/// A value of `SessionCell::owner` beyond those of [`Owner`]: the session is about to expire.
const EXPIRING: u8 = 3;

/// A place within the limits of a client. Dropping it frees the place.
pub type ClientPlace = Box<dyn std::fmt::Debug + Send + Sync>;

/// The part of a session behind its lock.
#[derive(Debug)]
pub struct Live {
    /// The state machine that makes the frames.
    pub character: Character,
    /// Carries its frames over to a skeleton of the user's own.
    pub dress: Option<Dress>,
    /// The style of the newest command.
    pub style: Arc<Style>,
    /// Importance of frequent plans for this character, 0 to 1.
    pub priority: f32,
    /// Number of failed plans since the last good one, and the newest error.
    pub trouble: Option<(u32, SubmitError)>,
    /// Events of the character that no client has taken yet.
    pub events: EventQueue,
    /// The sentence that is being generated for the character.
    pub(super) performer: Option<Performer>,
    /// Writes the recording of the session.
    pub(super) recorder: Option<Recorder>,
    /// Whether a client may still join a restored session to the last frame that it saw.
    pub(super) client_return: Return,
    /// Keeps the session's place in its scene until the session ends.
    resident: Option<Resident>,
    /// The character's statistics as the metrics counted them last.
    counted: Stats,
    /// For robots.
    rates: Option<ShownRates>,
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
    /// Milliseconds from `born` to the last use.
    seen_ms: AtomicU64,
    /// An [`Owner`] or [`EXPIRING`].
    owner: AtomicU8,
    /// 0 while the session is open, then an [`End`].
    ended: AtomicU8,
    live: Mutex<Live>,
    /// The watchers of the stream that advances the session, or advanced it last.
    audience: Mutex<Weak<Audience>>,
    /// The session's place within the limits of the client that opened it, until the session ends.
    place: Mutex<Option<ClientPlace>>,
    /// Signals that a plan came or failed, or that the session ended. Only the owner waits for it.
    changed: Notify,
}

/// The checked parts of a session that is about to open.
pub struct SessionParts {
    /// 1 to 64 letters, digits, `-`, `_` or `.`; unique within the tenant.
    pub id: Arc<str>,
    /// Rig, styles and batcher of the character.
    pub pack: Arc<LivePack>,
    /// Axes and units of all messages of the session.
    pub convention: Convention,
    /// Seed of the character's plans.
    pub seed: u64,
    /// Time without use after which the session expires.
    pub ttl: Duration,
    /// The character, in its first pose.
    pub character: Character,
    /// Carries its frames over to a skeleton of the user's own.
    pub dress: Option<Dress>,
    /// The style at the start.
    pub style: Arc<Style>,
    /// The priority at the start, 0 to 1.
    pub priority: f32,
    /// The session's place in its scene. `None`: the session has no scene, nor has its character.
    pub resident: Option<Resident>,
    /// Whether the session is restored from a record.
    pub woken: bool,
}

impl Live {
    /// The character's frame at the cursor, as its client sees it.
    pub fn sample(&mut self, out: &mut FrameOut) {
        self.character.sample(out);
        if let Some(dress) = &mut self.dress {
            dress.put_on(&self.character, out);
        }
        match &mut self.rates {
            Some(rates) => rates.measure(self.character.time_frames(), out),
            None => out.hinge_rate = HingeRate::default(),
        }
        if let Some(recorder) = &mut self.recorder {
            recorder.shown(out);
        }
    }

    /// Leads from a pose that the client gave on a skeleton of its own, which the character has at
    /// the cursor, over to the poses that are carried over.
    pub(super) fn begin_at(&mut self, root: Vec3, rotations: &[Quat]) {
        if let Some(dress) = &mut self.dress {
            dress.begin((root, rotations), &self.character);
        }
    }

    /// The session's place in its scene. `None` without a scene, or after the session's end.
    pub fn resident(&self) -> Option<&Resident> {
        self.resident.as_ref()
    }
}

impl SessionCell {
    /// Makes a session without an owner.
    pub fn new(parts: SessionParts, time: TimeSource) -> Self {
        let born = time.now();
        let rates = ShownRates::of(&parts.pack);
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
            live: Mutex::new(Live {
                character: parts.character,
                dress: parts.dress,
                style: parts.style,
                priority: parts.priority,
                trouble: None,
                events: EventQueue::default(),
                performer: None,
                recorder: None,
                client_return: Return::of(parts.woken),
                resident: parts.resident,
                counted: Stats::default(),
                rates,
            }),
            audience: Mutex::default(),
            place: Mutex::default(),
            changed: Notify::new(),
        }
    }

    /// The id by which clients name the session; unique within the tenant.
    pub fn id(&self) -> &Arc<str> {
        &self.id
    }

    /// The id by which the pack's batcher knows the session. Unlike [`SessionCell::id`], a later
    /// session never gets it again.
    pub fn owner_id(&self) -> OwnerId {
        self.owner_id
    }

    /// Rig, styles and batcher of the character.
    pub fn pack(&self) -> &Arc<LivePack> {
        &self.pack
    }

    /// Axes and units of all messages of the session.
    pub fn convention(&self) -> Convention {
        self.convention
    }

    /// Axes, units and size of the client's values.
    pub fn measure(&self) -> Measure {
        Measure::of(self.convention, self.pack.worn().map(|worn| &**worn))
    }

    /// The size of the client's body, for errors about values of the character's.
    pub fn size(&self) -> Size {
        self.pack.worn().map_or_else(Size::default, |worn| worn.size())
    }

    /// Seed of the character's plans, as the client chose it.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// Name of its scene.
    pub fn scene(&self) -> Option<&Arc<str>> {
        self.scene.as_ref()
    }

    /// Time without use after which it expires.
    pub fn ttl(&self) -> Duration {
        self.ttl
    }

    /// Locks the session. Do not hold the lock across an await.
    pub fn live(&self) -> MutexGuard<'_, Live> {
        // After a panic under the lock the character may look odd for a moment, but still moves.
        self.live.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The watchers of the stream that advances the session, or advanced it last.
    pub(super) fn audience(&self) -> Option<Arc<Audience>> {
        let audience = self.audience.lock().unwrap_or_else(PoisonError::into_inner);
        audience.upgrade()
    }

    /// From now on, `audience` sees the session's frames.
    pub(super) fn show_to(&self, audience: Weak<Audience>) {
        *self.audience.lock().unwrap_or_else(PoisonError::into_inner) = audience;
    }

    /// Notes that the session is in use now.
    pub fn touch(&self) {
        let ms = self.time.now().saturating_duration_since(self.born).as_millis() as u64;
        self.seen_ms.fetch_max(ms, Ordering::Relaxed);
    }

    /// Time until the session expires, seen from `now`. While it has an owner, its whole time to
    /// live is left.
    pub fn left(&self, now: Instant) -> Duration {
        if self.owner() != Owner::Free {
            return self.ttl;
        }
        self.ttl.saturating_sub(self.idle(now))
    }

    /// Whether a step, a stream or no call advances the session at the moment.
    pub fn owner(&self) -> Owner {
        Owner::of(self.owner.load(Ordering::Acquire))
    }

    /// How the session ended. `None` while it is open.
    pub fn end(&self) -> Option<End> {
        match self.ended.load(Ordering::Acquire) {
            0 => None,
            1 => Some(End::Closed),
            2 => Some(End::Expired),
            3 => Some(End::MadeRoom),
            _ => Some(End::Moved),
        }
    }

    /// Ends the session if its time to live is over at `now` and it has no owner. Answers whether
    /// it ended.
    pub(super) fn expire(&self, now: Instant) -> bool {
        self.end_if_idle(self.ttl, now, End::Expired)
    }

    /// Ends the session if it has no owner and was not used for `limit`. Answers whether it ended.
    pub(super) fn end_if_idle(&self, limit: Duration, now: Instant, end: End) -> bool {
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
        // It may have been used between the look at the clock and now.
        if self.idle(now) < limit {
            self.owner.store(free, Ordering::Release);
            return false;
        }
        self.finish(end)
    }

    /// Time from the last use to `now`.
    pub(super) fn idle(&self, now: Instant) -> Duration {
        let seen = self.born + Duration::from_millis(self.seen_ms.load(Ordering::Acquire));
        now.saturating_duration_since(seen)
    }

    /// Ends the session, even if it has an owner. Answers whether it was open.
    pub(super) fn finish(&self, end: End) -> bool {
        let first = self
            .ended
            .compare_exchange(0, end as u8, Ordering::AcqRel, Ordering::Acquire)
            .is_ok();
        if first {
            self.leave_scene();
            self.let_go();
            self.place().take();
            self.changed.notify_one();
        }
        first
    }

    fn place(&self) -> MutexGuard<'_, Option<ClientPlace>> {
        self.place.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Keeps `place` until the session ends.
    pub(super) fn hold(&self, place: ClientPlace) {
        *self.place() = Some(place);
        if self.end().is_some() {
            self.place().take();
        }
    }

    /// Stops the words that are being generated, ends the recording, and takes the user's skeleton
    /// off: a plan that is under way keeps the session in memory, but not the skeleton in use.
    fn let_go(&self) {
        let mut live = self.live();
        if let Some(dress) = &mut live.dress {
            dress.take_off();
        }
        if let Some(recorder) = &live.recorder {
            recorder.session_ended(self.time.now());
        }
        let performer = live.performer.take();
        drop(live);
        drop(performer);
    }

    /// Releases the objects of the character and the session's place in its scene.
    fn leave_scene(&self) {
        if self.scene.is_some() {
            let mut live = self.live();
            live.character.leave();
            live.resident = None;
        }
    }

    /// Makes `owner` the owner of the session until the guard is dropped. `field` is the field of
    /// the request that names the session.
    ///
    /// # Errors
    /// [`SessionError::Busy`] if it has an owner, or the error of [`SessionCell::gone`].
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
                // Another thread checks whether the session expires, which takes microseconds.
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

    /// The error for requests to a session that has ended. `None` while it is open.
    pub fn gone(&self, field: &dyn Fn() -> String) -> Option<SessionError> {
        match self.end()? {
            End::Expired => Some(SessionError::Expired {
                id: self.id.to_string(),
                field: field(),
            }),
            End::MadeRoom => Some(SessionError::MadeRoom {
                id: self.id.to_string(),
                field: field(),
            }),
            End::Closed => Some(SessionError::Unknown {
                id: self.id.to_string(),
                field: field(),
            }),
            End::Moved => Some(SessionError::Moved {
                id: self.id.to_string(),
                field: field(),
            }),
        }
    }

    /// Waits until a plan came or failed, or the session ended, since the last wait. Only the owner
    /// may wait.
    pub async fn changed(&self) {
        self.changed.notified().await;
    }

    /// Wakes the owner.
    pub(super) fn wake(&self) {
        self.changed.notify_one();
    }

    /// Takes the character's requests for plans and words, and returns them. Also collects its
    /// events, updates the metrics, and stops words that it does not want any more.
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

/// Ownership of a session. Dropping it frees the session.
#[derive(Debug)]
pub struct Held(Arc<SessionCell>);

impl Held {
    /// The session that is owned.
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

#[cfg(test)]
#[path = "cell_tests.rs"]
mod tests;
