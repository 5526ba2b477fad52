//! State that survives a restart: records by name. This module does not interpret their bytes.
//!
//! [`Records`] has them in one database file, which is consistent at any moment, even if the
//! process is killed or the power fails. [`shared`] has them in Redis, for several servers.

#[cfg(any(test, feature = "testing"))]
pub mod disk;
pub mod shared;

use std::any::Any;
use std::fmt;
use std::io::ErrorKind;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use redb::{Builder, Database, DatabaseError, ReadableDatabase as _, ReadableTable as _, TableDefinition};

use shared::{Leases, UploadLog};

/// Name of the file in the folder of the records.
const FILE: &str = "troupe.redb";
/// Page cache, bytes. It is small because records are written often and read only at the start.
const CACHE_BYTES: usize = 8 << 20;

/// A kind of records, which is one table of the database.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Kind {
    /// Sessions, named by their ids.
    Session,
    /// Objects that can move, one record per scene, named as the scene.
    Scene,
}

impl Kind {
    fn table(self) -> TableDefinition<'static, &'static str, &'static [u8]> {
        TableDefinition::new(match self {
            Self::Session => "sessions",
            Self::Scene => "scenes",
        })
    }
}

/// Why records cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordsError {
    /// Another process has opened the file.
    #[error("store: another server uses {}; allowed: a folder for each server", .0.display())]
    InUse(PathBuf),
    /// The folder cannot be created.
    #[error("store: cannot make the folder {}: {error}", folder.display())]
    Folder {
        /// As the option names it.
        folder: PathBuf,
        /// The system's reason.
        error: std::io::Error,
    },
    /// The file cannot be opened, read or written.
    #[error("store: {place}: {error}")]
    File {
        /// Path of the file.
        place: String,
        /// The database's reason.
        error: Box<redb::Error>,
    },
    /// The file is not as it was written.
    #[error(
        "store: {place} is damaged ({reason}); put a copy of it in its place, or move it away and start without \
         the sessions in it"
    )]
    Damaged {
        /// Path of the file.
        place: String,
        /// What the database found.
        reason: String,
    },
    /// The text is not the address of a shared store.
    #[error("store: {found}; allowed: {allowed}")]
    Address {
        /// The address without its password.
        found: String,
        /// Its form.
        allowed: &'static str,
    },
    /// The shared store does not answer, or not as it should.
    #[error("store: {place}: {error}")]
    Shared {
        /// Its address without the password.
        place: String,
        /// The library's reason.
        error: Box<redis::RedisError>,
    },
}

/// Where records are kept. All calls block.
pub trait RecordStore: fmt::Debug + Send {
    /// The records that a server restores when it starts, sorted by name. A shared store has none:
    /// its servers restore a session when a client asks for it.
    ///
    /// # Errors
    /// [`RecordsError`] if they cannot be read.
    fn all(&mut self, kind: Kind) -> Result<Vec<(String, Vec<u8>)>, RecordsError>;

    /// Writes changes. They are in the store when this returns, except those of
    /// [`Tended::lost`].
    ///
    /// # Errors
    /// [`RecordsError`]. Each change may have been written or not: write it again.
    fn write(&mut self, changes: &Changes) -> Result<Tended, RecordsError>;

    /// Renews the leases of everything that `open` names, and gives up the others.
    ///
    /// # Errors
    /// [`RecordsError`]. What this server has stays in its hands until another takes it.
    fn tend(&mut self, _open: &dyn Fn(Kind, &str) -> bool) -> Result<Tended, RecordsError> {
        Ok(Tended::default())
    }

    /// Gives up a lease. The record stays.
    fn give_up(&mut self, _kind: Kind, _name: &str) {}

    /// Gives up all leases, after the last write: others need not wait for their end.
    fn leave(&mut self) {}

    /// Whether this server may write the record.
    fn owns(&self, _kind: Kind, _name: &str) -> bool {
        true
    }

    /// The leases of this server, if other servers use the store, too.
    fn leases(&self) -> Option<Arc<Leases>> {
        None
    }

    /// The uploads of all servers that use the store, if others use it, too.
    fn uploads(&self) -> Option<UploadLog> {
        None
    }
}

/// What became of this server's leases.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Tended {
    /// Records that another server has taken over. This server must not go on with them.
    pub lost: Vec<Lost>,
    /// Records that the store knew nothing of, so that they must be written again.
    pub forgotten: Vec<(Kind, String)>,
}

/// A record that another server has taken over.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Lost {
    /// The kind of the record.
    pub kind: Kind,
    /// As [`Changes::put`] had it.
    pub name: String,
    /// Address of the server that has it. Empty: none has.
    pub owner: String,
    /// Time until the owner's lease ends, if it is not renewed.
    pub ends_in: Duration,
}

/// Opens the database: at the start, and again after an error.
type Open = Box<dyn Fn() -> Result<Database, DatabaseError> + Send + Sync>;

/// Checks the checksums of a whole file when it is opened. Otherwise a damaged record would be
/// found late, or not at all.
fn builder() -> Builder {
    let mut builder = Builder::new();
    builder
        .set_cache_size(CACHE_BYTES)
        .set_check_integrity_on_open(true);
    builder
}

/// The records of a server.
pub struct Records {
    open: Open,
    place: String,
    /// `None` after an error, until the next call opens the file again.
    database: Option<Database>,
}

impl fmt::Debug for Records {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Records").field("place", &self.place).finish()
    }
}

/// Records to write or remove.
#[derive(Debug)]
pub struct Changes {
    /// In order.
    list: Vec<Change>,
    /// Size of all records to write.
    bytes: usize,
    /// When somebody began to look for changes.
    begun: Instant,
}

/// A record to write or remove.
#[derive(Debug)]
struct Change {
    kind: Kind,
    name: String,
    /// `None` removes the record.
    record: Option<Vec<u8>>,
    /// Time for which a shared store keeps the record after its server is gone. `None`: for ever.
    keep: Option<Duration>,
}

impl Default for Changes {
    fn default() -> Self {
        Self {
            list: Vec::new(),
            bytes: 0,
            begun: Instant::now(),
        }
    }
}

impl Changes {
    /// Adds or replaces a record.
    pub fn put(&mut self, kind: Kind, name: impl Into<String>, record: Vec<u8>) {
        self.add(kind, name.into(), Some(record), None);
    }

    /// As [`Changes::put`], for a record that is worth nothing when its server has been gone for
    /// this time.
    pub fn put_for(&mut self, keep: Duration, kind: Kind, name: impl Into<String>, record: Vec<u8>) {
        self.add(kind, name.into(), Some(record), Some(keep));
    }

    /// Removes a record.
    pub fn remove(&mut self, kind: Kind, name: impl Into<String>) {
        self.add(kind, name.into(), None, None);
    }

    fn add(&mut self, kind: Kind, name: String, record: Option<Vec<u8>>, keep: Option<Duration>) {
        self.bytes += record.as_ref().map_or(0, Vec::len);
        let change = Change {
            kind,
            name,
            record,
            keep,
        };
        self.list.push(change);
    }

    /// Whether there is nothing to write.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Kinds and names of the records to remove.
    pub fn removed(&self) -> impl Iterator<Item = (Kind, &str)> {
        let removed = self.list.iter().filter(|change| change.record.is_none());
        removed.map(|change| (change.kind, change.name.as_str()))
    }

    /// Size of all records to write, bytes.
    pub fn bytes(&self) -> usize {
        self.bytes
    }
}

impl Records {
    /// Opens the records in `folder`, and creates the folder if it is missing. This blocks.
    ///
    /// # Errors
    /// [`RecordsError`] if the folder or the file cannot be used.
    pub fn open(folder: &Path) -> Result<Self, RecordsError> {
        std::fs::create_dir_all(folder).map_err(|error| RecordsError::Folder {
            folder: folder.to_owned(),
            error,
        })?;
        let file = folder.join(FILE);
        let place = file.display().to_string();
        let open = move || builder().create(&file);
        Self::opened(Box::new(open), place).map_err(|error| match error {
            RecordsError::File { error, .. } if matches!(*error, redb::Error::DatabaseAlreadyOpen) => {
                RecordsError::InUse(folder.to_owned())
            }
            other => other,
        })
    }

    fn opened(open: Open, place: String) -> Result<Self, RecordsError> {
        let mut records = Self {
            open,
            place,
            database: None,
        };
        records.run(|_| Ok(()))?;
        Ok(records)
    }

    /// Runs `work` on the database, and opens it first if needed. The database is closed after an
    /// error. It panics on some damaged files: a panic is an error, too.
    fn run<T>(&mut self, work: impl FnOnce(&Database) -> Result<T, redb::Error>) -> Result<T, RecordsError> {
        // Nothing that a panic leaves behind is used: the database is dropped.
        let done = catch_unwind(AssertUnwindSafe(|| {
            let database = match self.database.take() {
                Some(database) => database,
                None => (self.open)()?,
            };
            let done = work(self.database.insert(database))?;
            Ok(done)
        }));
        let error = match done {
            Ok(Ok(done)) => return Ok(done),
            Ok(Err(error)) => self.failed(error),
            Err(panic) => self.damaged(panicked(&*panic)),
        };
        self.close();
        Err(error)
    }

    fn failed(&self, error: redb::Error) -> RecordsError {
        match error {
            redb::Error::Corrupted(reason) => self.damaged(reason),
            redb::Error::Io(error) if is_damage(error.kind()) => self.damaged(error.to_string()),
            error @ redb::Error::UpgradeRequired(_) => self.damaged(error.to_string()),
            error => RecordsError::File {
                place: self.place.clone(),
                error: Box::new(error),
            },
        }
    }

    fn damaged(&self, reason: String) -> RecordsError {
        RecordsError::Damaged {
            place: self.place.clone(),
            reason,
        }
    }

    fn close(&mut self) {
        let database = self.database.take();
        // The database writes while it closes, so a damaged file may make it panic here, too.
        let _ = catch_unwind(AssertUnwindSafe(|| drop(database)));
    }

    /// All records of a kind, sorted by name.
    ///
    /// # Errors
    /// [`RecordsError::File`] and [`RecordsError::Damaged`].
    pub fn all(&mut self, kind: Kind) -> Result<Vec<(String, Vec<u8>)>, RecordsError> {
        self.run(|database| read_all(database, kind))
    }

    /// Writes all changes or none. They are on the disk when this returns. After an error the next
    /// call opens the file again.
    ///
    /// # Errors
    /// [`RecordsError::File`] and [`RecordsError::Damaged`]. The file then has the same records as
    /// before, or those after the changes.
    pub fn write(&mut self, changes: &Changes) -> Result<(), RecordsError> {
        self.run(|database| write_all(database, changes))
    }
}

impl RecordStore for Records {
    fn all(&mut self, kind: Kind) -> Result<Vec<(String, Vec<u8>)>, RecordsError> {
        Self::all(self, kind)
    }

    fn write(&mut self, changes: &Changes) -> Result<Tended, RecordsError> {
        Self::write(self, changes).map(|()| Tended::default())
    }
}

impl Drop for Records {
    fn drop(&mut self) {
        self.close();
    }
}

/// Whether an error of this kind comes from the content of a file.
fn is_damage(kind: ErrorKind) -> bool {
    matches!(
        kind,
        ErrorKind::InvalidData | ErrorKind::UnexpectedEof | ErrorKind::InvalidInput
    )
}

fn panicked(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("the database gave no reason")
        .to_owned()
}

fn read_all(database: &Database, kind: Kind) -> Result<Vec<(String, Vec<u8>)>, redb::Error> {
    let reading = database.begin_read()?;
    let table = match reading.open_table(kind.table()) {
        Ok(table) => table,
        Err(redb::TableError::TableDoesNotExist(_)) => return Ok(Vec::new()),
        Err(error) => return Err(error.into()),
    };
    let mut all = Vec::new();
    for entry in table.iter()? {
        let (name, record) = entry?;
        all.push((name.value().to_owned(), record.value().to_owned()));
    }
    Ok(all)
}

fn write_all(database: &Database, changes: &Changes) -> Result<(), redb::Error> {
    let mut writing = database.begin_write()?;
    // After a kill the database opens without a scan of the whole file.
    writing.set_quick_repair(true);
    for kind in [Kind::Session, Kind::Scene] {
        let mut table = writing.open_table(kind.table())?;
        for change in changes.list.iter().filter(|change| change.kind == kind) {
            match &change.record {
                Some(record) => table.insert(change.name.as_str(), record.as_slice())?,
                None => table.remove(change.name.as_str())?,
            };
        }
    }
    writing.commit()?;
    Ok(())
}

#[cfg(test)]
#[path = "records_tests.rs"]
mod tests;
