//! Crowds: characters of one pack that move together.

mod columns;
mod commands;
mod drive;
mod notes;
mod options;
mod orders;

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, TryLockError};
use std::time::Duration;

use tokio::sync::Notify;
use tokio::task::JoinHandle;
use troupe_client::{ClientError, CrowdOptions, MemberId, Session};

pub use self::columns::TroupeFrames;
pub use self::commands::{
    TROUPE_SET_FACING, TROUPE_SET_HEADING, TROUPE_SET_HEIGHT, TROUPE_SET_TEMPERATURE, TROUPE_SET_TIME,
    TroupeLocomotion, TroupePath, TroupePathPoint, TroupePerformance,
};
pub use self::notes::{TROUPE_NO_CHARACTER, TroupeNote, TroupeNoteKind};
pub use self::options::{
    TROUPE_MOST_CHARACTERS, TROUPE_NEVER, TroupeCharacter, TroupeClock, TroupeCrowdOptions, TroupeRotation,
    TroupeVec3,
};

use self::columns::{Columns, Exchange, Form, Found};
use self::drive::{Cast, Shared};
use self::notes::{Note, Notes, Taken};
use self::options::{Wanted, wanted};
use self::orders::Orders;
use crate::connection::Connection;
use crate::handles::{Kind, Open, entry, get, insert, remove};
use crate::pack::{OpenPack, TroupePack};
use crate::sized::{check, write};
use crate::status::{Failure, TroupeStatus};

/// Characters of one pack. Zero is none.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TroupeCrowd {
    /// The number of the handle.
    pub id: u64,
}

/// A crowd, and what C reads of it.
pub(crate) struct Crowd {
    connection: Arc<Connection>,
    ids: Vec<String>,
    shared: Arc<Shared>,
    /// One thread at a time.
    reader: Mutex<Reader>,
}

/// What only one thread may touch at a time.
struct Reader {
    engine: Engine,
    columns: Columns,
    taken: Taken,
}

/// What advances the characters.
enum Engine {
    Driven(JoinHandle<()>),
    Stepped(Box<Stepped>),
}

/// Characters on the caller's clock.
struct Stepped {
    crowd: troupe_client::Crowd,
    members: Vec<MemberId>,
    characters: HashMap<MemberId, u32>,
    steps: u64,
}

impl Crowd {
    async fn open(connection: Arc<Connection>, pack: &OpenPack, wanted: Wanted) -> Result<Self, ClientError> {
        let client = &connection.client;
        let sessions = client.open_sessions(&pack.pack, &wanted.sessions).await?;
        let ids: Vec<String> = sessions.iter().map(|session| session.id().to_owned()).collect();
        let form = Form {
            joints: pack.pack.skeleton().joint_count(),
            rate_hz: wanted.frames.rate.hz(),
            as_six_d: wanted.as_six_d,
            positions: wanted.frames.positions,
        };
        let columns = Columns::new(ids.len(), form);
        let shared = Arc::new(Shared {
            exchange: Exchange::new(columns.clone(), wanted.places.clone()),
            orders: Orders::new(ids.len()),
            notes: Notes::default(),
            commanded: Notify::new(),
            stop: Notify::new(),
        });
        let engine = match wanted.by_server {
            true => driven(&connection, sessions, &wanted, &shared, &columns).await,
            false => Ok(stepped(&connection, pack, sessions, &wanted)),
        };
        let engine = match engine {
            Ok(engine) => engine,
            Err(error) => {
                // The first error says most.
                let _ = client.close_sessions(ids).await;
                return Err(error);
            }
        };
        let reader = Mutex::new(Reader {
            engine,
            columns,
            taken: Taken::default(),
        });
        Ok(Self {
            connection,
            ids,
            shared,
            reader,
        })
    }

    /// The reader, if no other thread has it.
    fn reader(&self) -> Result<MutexGuard<'_, Reader>, Failure> {
        match self.reader.try_lock() {
            Ok(reader) => Ok(reader),
            Err(TryLockError::Poisoned(poisoned)) => Ok(poisoned.into_inner()),
            Err(TryLockError::WouldBlock) => Err(Failure::Busy { kind: Self::KIND }),
        }
    }

    fn step(&self, frames: u32) -> Result<TroupeFrames, Failure> {
        let mut reader = self.reader()?;
        let Reader { engine, columns, .. } = &mut *reader;
        let Engine::Stepped(stepped) = engine else {
            return Err(Failure::NotSteppable);
        };
        let Stepped {
            crowd,
            members,
            characters,
            steps,
        } = &mut **stepped;
        self.shared.orders.give(|character, order| {
            if let Some(&member) = members.get(character as usize) {
                orders::to_crowd(crowd, member, order);
            }
        });
        let step = self.connection.runtime.block_on(crowd.step(frames))?;
        let character = |member: MemberId| characters.get(&member).copied().unwrap_or(TROUPE_NO_CHARACTER);
        columns.begin(frames as usize);
        columns.tick = *steps;
        *steps += 1;
        for (member, frames) in step.characters() {
            columns.put(character(member) as usize, frames);
        }
        for (member, event) in step.events() {
            self.shared.notes.push(Note::event(character(member), event));
        }
        for fault in step.faults() {
            let kind = match fault.left {
                true => TroupeNoteKind::Left,
                false => TroupeNoteKind::Refused,
            };
            self.shared
                .notes
                .push(Note::problem(kind, character(fault.member), &fault.problem));
        }
        // Columns of a step stay with the reader; the exchange only learns the places.
        self.shared.exchange.learn(columns);
        Ok(columns.view())
    }

    fn read(&self, limit: Duration) -> Result<(TroupeFrames, TroupeStatus), Failure> {
        let mut reader = self.reader()?;
        if matches!(reader.engine, Engine::Stepped(_)) {
            return Ok((reader.columns.view(), TroupeStatus::Empty));
        }
        let status = match self.shared.exchange.take(&mut reader.columns, limit) {
            Found::Newer => TroupeStatus::Ok,
            Found::Nothing => TroupeStatus::Empty,
            Found::Ended(status, message) => return Err(Failure::Ended { status, message }),
        };
        Ok((reader.columns.view(), status))
    }

    /// Ends the stream, and closes the sessions.
    fn close(&self, reader: &mut Reader) -> Result<(), Failure> {
        let runtime = &self.connection.runtime;
        if let Engine::Driven(task) = &mut reader.engine {
            self.shared.stop.notify_one();
            // A task that panicked has ended, too.
            let _ = runtime.block_on(task);
        }
        runtime.block_on(self.connection.client.close_sessions(self.ids.iter().cloned()))?;
        Ok(())
    }
}

async fn driven(
    connection: &Connection,
    sessions: Vec<Session>,
    wanted: &Wanted,
    shared: &Arc<Shared>,
    columns: &Columns,
) -> Result<Engine, ClientError> {
    let ids = sessions.iter().map(|session| session.id().to_owned()).collect();
    let mut drive = connection.client.drive(wanted.drive).await?;
    drive.attach(sessions).await?;
    let period = wanted.frames.rate.period();
    let task = drive::run(drive, Cast::new(ids), shared.clone(), columns.clone(), period);
    Ok(Engine::Driven(connection.runtime.spawn(task)))
}

fn stepped(connection: &Connection, pack: &OpenPack, sessions: Vec<Session>, wanted: &Wanted) -> Engine {
    let options = CrowdOptions {
        frames: wanted.frames,
        ..CrowdOptions::default()
    };
    let mut crowd = troupe_client::Crowd::new(&connection.client, &pack.pack, options);
    let members: Vec<MemberId> = sessions.into_iter().map(|session| crowd.adopt(session)).collect();
    let characters = members.iter().copied().zip(0..).collect();
    Engine::Stepped(Box::new(Stepped {
        crowd,
        members,
        characters,
        steps: 0,
    }))
}

/// Opens a crowd of a pack, all characters or none. On the server's clock it begins to move at
/// once.
///
/// # Safety
/// `options` is null or points to options whose `size` is set, with an array of characters as large
/// as they say, and texts that end with NUL. `out` is null or can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn troupe_crowd_open(
    pack: TroupePack,
    options: *const TroupeCrowdOptions,
    out: *mut TroupeCrowd,
) -> TroupeStatus {
    entry(|| {
        if out.is_null() {
            return Err(Failure::Null("out"));
        }
        let pack = get::<OpenPack>(pack.id)?;
        // SAFETY: the caller vouches for `options` and what it points to.
        let wanted = unsafe { wanted(options) }?;
        let connection = pack.connection.clone();
        let opened = connection
            .runtime
            .block_on(Crowd::open(connection.clone(), &pack, wanted))?;
        let id = insert(Open::Crowd(Arc::new(opened)));
        // SAFETY: `out` is not null, and the caller vouches for it.
        unsafe { out.write(TroupeCrowd { id }) };
        Ok(TroupeStatus::Ok)
    })
}

/// Reads the newest frames of a crowd on the server's clock. Waits for them at most `timeout_ms`.
///
/// `TROUPE_STATUS_OK`: they are newer than those of the last read. `TROUPE_STATUS_EMPTY`: they are
/// not, and `out` has the last ones again; before the first, no character is present. After an
/// error that ends the crowd, each read returns it. This allocates no memory.
///
/// On the caller's clock it gives the frames of the last step again, and returns
/// `TROUPE_STATUS_EMPTY`.
///
/// # Safety
/// `out` is null, or points to a `TroupeFrames` whose `size` is set.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn troupe_crowd_read(
    crowd: TroupeCrowd,
    timeout_ms: u32,
    out: *mut TroupeFrames,
) -> TroupeStatus {
    entry(|| {
        // SAFETY: the caller vouches for `out`.
        unsafe { check("out", out) }?;
        let crowd = get::<Crowd>(crowd.id)?;
        let (frames, status) = crowd.read(Duration::from_millis(timeout_ms.into()))?;
        // SAFETY: the caller vouches for `out`.
        unsafe { write("out", out, frames) }?;
        Ok(status)
    })
}

/// Advances a crowd on the caller's clock by 1 to 120 frames, and reads them. Commands go with it.
///
/// A step that fails because the connection broke may be tried again: the characters wait on the
/// server until their time to live is over, and then go on.
///
/// # Safety
/// `out` is null, or points to a `TroupeFrames` whose `size` is set.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn troupe_crowd_step(
    crowd: TroupeCrowd,
    frames: u32,
    out: *mut TroupeFrames,
) -> TroupeStatus {
    entry(|| {
        // SAFETY: the caller vouches for `out`.
        unsafe { check("out", out) }?;
        let crowd = get::<Crowd>(crowd.id)?;
        if !(1..=120).contains(&frames) {
            return Err(Failure::Range {
                field: "frames",
                got: frames.to_string(),
                allowed: "1 to 120".to_owned(),
            });
        }
        let frames = crowd.step(frames)?;
        // SAFETY: the caller vouches for `out`.
        unsafe { write("out", out, frames) }?;
        Ok(TroupeStatus::Ok)
    })
}

/// Takes the oldest note of a crowd. `TROUPE_STATUS_EMPTY`: none waits, and `out` stays as it is.
///
/// # Safety
/// `out` is null, or points to a `TroupeNote` whose `size` is set.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn troupe_crowd_note(crowd: TroupeCrowd, out: *mut TroupeNote) -> TroupeStatus {
    entry(|| {
        // SAFETY: the caller vouches for `out`.
        unsafe { check("out", out) }?;
        let crowd = get::<Crowd>(crowd.id)?;
        let mut reader = crowd.reader()?;
        let Some((note, dropped)) = crowd.shared.notes.pop() else {
            return Ok(TroupeStatus::Empty);
        };
        let note = reader.taken.keep(&note, dropped);
        // SAFETY: the caller vouches for `out`.
        unsafe { write("out", out, note) }?;
        Ok(TroupeStatus::Ok)
    })
}

/// Closes a crowd, and its characters on the server. Its frames and notes are invalid from now on.
/// If the server cannot be reached the handle is closed all the same, the error says so, and the
/// characters expire.
#[unsafe(no_mangle)]
pub extern "C" fn troupe_crowd_close(crowd: TroupeCrowd) -> TroupeStatus {
    entry(|| {
        let open = get::<Crowd>(crowd.id)?;
        let mut reader = open.reader()?;
        remove::<Crowd>(crowd.id)?;
        open.close(&mut reader)?;
        Ok(TroupeStatus::Ok)
    })
}

#[cfg(test)]
mod tests;
