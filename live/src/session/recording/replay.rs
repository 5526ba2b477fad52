//! The calls that return a recording, and that play one again.

use std::sync::Arc;

use tokio::sync::mpsc;
use troupe_proto::v1;

use super::format::{Head, Origin, Reader, RecordingError};
use super::player::Player;
use super::recorder::Recorder;
use super::tape::{MAX_RECORDING_BYTES, Tape};
use crate::session::cell::SessionCell;
use crate::session::id::MAX_ID_CHARS;
use crate::session::{LivePacks, SessionError, Sessions, options};
use crate::world::Store;
use troupe_base::turns::Turns;
use troupe_character::{FieldError, Path};

/// Maximum size of a recording that is played, bytes. Files may have been edited.
pub const MAX_REPLAY_BYTES: usize = 2 * MAX_RECORDING_BYTES;
/// Maximum number of recordings that are played at the same time.
pub const MAX_REPLAYS: usize = 4;
/// Parts of an answer that wait for their reader.
const WAITING_PARTS: usize = 2;

/// A replay in progress. Dropping it stops the replay.
#[derive(Debug)]
pub struct Replaying(mpsc::Receiver<Result<v1::ReplayResponse, SessionError>>);

impl Replaying {
    /// The next part of the answer. `None` after the last one and after an error.
    pub async fn next(&mut self) -> Option<Result<v1::ReplayResponse, SessionError>> {
        self.0.recv().await
    }
}

/// A recording that is about to be kept: the session's id, and what it writes to.
type Begun = (Arc<str>, Arc<Tape>);

impl Sessions {
    /// Begins the recordings that the options of new sessions ask for.
    ///
    /// # Errors
    /// [`FieldError`] for a session that cannot be recorded. Then none is.
    pub(in crate::session) fn record(
        &self,
        cells: &[Arc<SessionCell>],
        wanted: &[v1::SessionOptions],
    ) -> Result<Vec<Begun>, FieldError> {
        let root = Path::root();
        let mut begun = Vec::new();
        for (index, (cell, options)) in cells.iter().zip(wanted).enumerate() {
            if !options.record {
                continue;
            }
            if cell.scene().is_some() {
                let path = root.element("sessions", index);
                return Err(path.field("record").error(
                    "is true for a session in a scene, whose frames depend on what others do there",
                    "false, or a session without a scene",
                ));
            }
            let recorder = Recorder::new(cell, options);
            begun.push((cell.id().clone(), recorder.tape().clone()));
            cell.live().recorder = Some(recorder);
        }
        Ok(begun)
    }

    /// Keeps the recordings of sessions that are open now.
    pub(in crate::session) fn keep_recordings(&self, begun: Vec<Begun>) {
        let now = self.time().now();
        for (id, tape) in begun {
            self.shelf().add(self.registry().tenant(), &id, tape, now);
        }
    }

    /// `troupe.v1.Sessions/GetRecording`.
    ///
    /// # Errors
    /// [`SessionError::NotRecorded`] without a recording of a session of this id.
    pub fn recording(&self, request: &v1::GetRecordingRequest) -> Result<v1::SessionRecording, SessionError> {
        let id = &request.session_id;
        let now = self.time().now();
        let found = self.shelf().find(self.registry().tenant(), id, now);
        let tape = found.ok_or_else(|| SessionError::NotRecorded {
            id: id.chars().take(MAX_ID_CHARS).collect(),
        })?;
        let (lines, ended) = tape.read();
        Ok(v1::SessionRecording {
            session_id: id.clone(),
            lines,
            ended,
        })
    }

    /// `troupe.v1.Sessions/Replay`.
    ///
    /// # Errors
    /// [`SessionError`] for a recording that cannot be played here.
    pub fn replay(
        self: &Arc<Self>,
        packs: &LivePacks,
        store: &Store,
        request: v1::ReplayRequest,
        turns: Turns,
    ) -> Result<Replaying, SessionError> {
        let bytes = request.recording.len();
        if bytes > MAX_REPLAY_BYTES {
            let most = MAX_REPLAY_BYTES;
            return Err(RecordingError::TooLarge { bytes, most }.into());
        }
        let Ok(place) = self.replays().clone().try_acquire_owned() else {
            return Err(SessionError::TooManyReplays { limit: MAX_REPLAYS });
        };
        let (reader, head) = Reader::new(request.recording)?;
        let (cell, notes) = self.opened(packs, store, &head, request.anyway)?;
        let (sender, receiver) = mpsc::channel(WAITING_PARTS);
        let player = Player::new(cell, reader, notes, request.anyway);
        self.spawn(turns, async move {
            player.run(&sender).await;
            drop(place);
        });
        Ok(Replaying(receiver))
    }

    /// A session as at the start of a recording, which no client can find. Also what limits the
    /// comparison.
    fn opened(
        &self,
        packs: &LivePacks,
        store: &Store,
        head: &Head,
        anyway: bool,
    ) -> Result<(Arc<SessionCell>, Vec<String>), SessionError> {
        let root = Path::root();
        let recording = root.field("recording");
        let path = recording.field("session");
        if !head.session.scene.is_empty() {
            let error = path
                .field("scene")
                .error("is set", "none: recordings have no scene");
            return Err(error.into());
        }
        let parts = options::parts(&path, &head.session, packs, store, self.limits())?;
        let cell = Arc::new(SessionCell::new(parts, self.time().clone()));
        let style = cell.live().style.clone();
        let here = Origin::of(&cell, &style);
        let differences = head.made_with.differences(&here);
        if !differences.is_empty() && !anyway {
            return Err(RecordingError::Differs(differences).into());
        }
        let mut notes = differences;
        let (recorded, here) = (&head.made_with.cpu, &here.cpu);
        if recorded != here {
            notes.push(format!(
                "the CPU was {recorded:?} and is {here:?}: the same engine may round differently"
            ));
        }
        Ok((cell, notes))
    }
}
