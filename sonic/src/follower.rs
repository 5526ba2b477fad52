//! Steps the session of one robot a little ahead of its windows, and hands its future to the clock.

use std::sync::Arc;
use std::sync::mpsc::{SyncSender, TrySendError};
use std::time::Duration;

use glam::Vec3;
use tokio::sync::watch;
use tokio::time::sleep;
use troupe_client::live::Session;
use troupe_client::{
    Act, Client, ClientError, Encoding, FrameOptions, Locomotion, Pack, Rate, SessionOptions,
};
use troupe_motion::conventions::Convention;

use crate::ahead::{resample, rows_of, start};
use crate::error::SonicError;
use crate::note::Notes;
use crate::order::Move;
use crate::row::{Row, check_robot};
use crate::sender::{Why, Word};
use crate::waiting::Waiting;

/// Ticks of a step. Each step is followed by a look at the future.
const STEP: u64 = 4;
/// A session that is further behind goes on later, without a jump ahead.
const CATCH_UP: u64 = 25;
/// Pause before the next try to reach the server.
const PAUSE: Duration = Duration::from_millis(500);
/// Sessions without steps end after this time.
const TTL: Duration = Duration::from_secs(10);

/// What steps the session of one robot.
#[derive(Debug)]
pub(crate) struct Follower {
    pub(crate) robot: usize,
    pub(crate) client: Client,
    pub(crate) pack: Pack,
    pub(crate) style: Option<String>,
    pub(crate) words: SyncSender<(usize, Word)>,
    /// Index of the next window's first frame.
    pub(crate) ticks: watch::Receiver<u64>,
    pub(crate) moves: Arc<Waiting>,
    pub(crate) notes: Notes,
    /// The error that was noted last, until a step succeeds.
    pub(crate) noted: Option<String>,
}

/// Where a session was last: position and heading.
type Place = (Vec3, f32);

impl Follower {
    /// Follows until the bridge closes. After an error the robot stands until the server is back
    /// and a new order has come.
    pub(crate) async fn run(mut self, mut session: Option<Session>) {
        let mut place = Place::default();
        loop {
            let error = match self.follow(session.take(), &mut place).await {
                Ok(()) => return,
                Err(error) => error,
            };
            self.say(Word::Halt(Why::Lost));
            let error = error.to_string();
            // Tries that fail for the same reason are not worth a note each.
            if self.noted.as_ref() != Some(&error) {
                self.note(error.clone());
                self.noted = Some(error);
            }
            sleep(PAUSE).await;
            // Orders for the session that is gone.
            drop(self.moves.take());
        }
    }

    /// Says a word to the clock. A clock that hangs misses it: newer frames follow, and without
    /// them the robot stands. Only a motion that it is to begin is worth a note then.
    fn say(&self, word: Word) {
        if let Err(TrySendError::Full((_, Word::Release))) = self.words.try_send((self.robot, word)) {
            self.note("the clock hangs, so it stands; give the order again".to_owned());
        }
    }

    fn note(&self, text: String) {
        self.notes.note(self.robot, text);
    }

    /// Opens a session at a place. It stands.
    pub(crate) async fn open(&self, place: Place) -> Result<Session, ClientError> {
        let mut options = SessionOptions::new()
            .seed(self.robot as u64)
            .at(place.0, place.1)
            .ttl(TTL);
        if let Some(style) = &self.style {
            options = options.style(style);
        }
        let mut session = self.client.session(&self.pack, &options).await?;
        session.set_frame_options(FrameOptions {
            rate: Rate::Hz50,
            encoding: Encoding::Qpos,
            positions: false,
        });
        Ok(session)
    }

    async fn follow(&mut self, session: Option<Session>, place: &mut Place) -> Result<(), SonicError> {
        let mut session = match session {
            Some(session) => session,
            None => self.open(*place).await?,
        };
        let robot = check_robot(self.pack.name(), self.pack.robot())?.clone();
        let skeleton = self.pack.skeleton().clone();
        let mut began = None;
        // The session's tick 0 is this index.
        let mut base = *self.ticks.borrow_and_update();
        let mut stepped = 0;
        loop {
            let now = *self.ticks.borrow_and_update();
            let wanted = (now + STEP).saturating_sub(base + stepped);
            if wanted < STEP {
                if self.ticks.changed().await.is_err() {
                    return Ok(());
                }
                continue;
            }
            let frames = match wanted {
                0..=CATCH_UP => wanted,
                _ => {
                    base += wanted - STEP;
                    STEP
                }
            };
            let moves = self.orders(&mut session);
            let before = session.frames().first_frame();
            let outcome = session.step(frames as u32).await.map(|_| ());
            let refused = match outcome {
                Ok(()) => None,
                // A session that refuses an order has moved on as before.
                Err(ClientError::Session(error)) if session.frames().first_frame() > before => Some(error),
                Err(error) => return Err(error.into()),
            };
            let shown = session.frames();
            let mut rows: Vec<Row> = shown
                .iter()
                .filter_map(|frame| frame.qpos.try_into().ok())
                .collect();
            let (Some(&last), Some(frame)) = (rows.last(), shown.last()) else {
                continue;
            };
            let root = frame.native_root(&skeleton, Convention::Native);
            *place = (root.position.with_y(0.0), root.heading);
            let first = base + stepped + 1;
            stepped += frames;
            let future = session.future().await?;
            let next = future.first_frame();
            let began = *began.get_or_insert(start(stepped, next));
            rows.extend(resample(began, stepped, &last, next, &rows_of(&robot, &future)));
            self.say(Word::Rows(first, rows));
            self.noted = None;
            match refused {
                Some(error) => {
                    self.note(error.to_string());
                    session.set_intent(Locomotion::stand());
                }
                None if moves => self.say(Word::Release),
                None => {}
            }
        }
    }

    /// Gives a session its orders. Whether the robot moves by the last of them.
    fn orders(&mut self, session: &mut Session) -> bool {
        let mut moves = false;
        for order in self.moves.take() {
            moves = !matches!(order, Move::Stand);
            match order {
                Move::Stand => {
                    let mut intent = session.intent().clone();
                    (intent.velocity, intent.facing) = (Vec3::ZERO, None);
                    session.set_intent(intent);
                }
                Move::Walk(velocity, facing) => {
                    session.walk(velocity);
                    match facing {
                        Some(heading) => session.face(heading),
                        None => session.face_ahead(),
                    };
                }
                Move::Path(path) => {
                    session.act(&Act::from(path));
                }
                Move::Style(name) => {
                    session.style(name);
                }
            }
        }
        moves
    }
}
