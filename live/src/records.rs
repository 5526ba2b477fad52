//! State that survives a restart: records by name, in one database file.
//!
//! The file is consistent at any moment, even if the process is killed or the power fails. This
//! module does not interpret the bytes of a record.

#[cfg(any(test, feature = "testing"))]
pub mod disk;

use std::fmt;
use std::path::{Path, PathBuf};

use redb::{Builder, Database, DatabaseError, ReadableDatabase as _, ReadableTable as _, TableDefinition};

/// Name of the file in the folder of the records.
const FILE: &str = "troupe.redb";
/// Page cache, bytes. It is small because records are written often and read only at the start.
const CACHE_BYTES: usize = 8 << 20;

/// A kind of records, which is one table of the database.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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
}

/// Opens the database: at the start, and again after an error.
type Open = Box<dyn Fn() -> Result<Database, DatabaseError> + Send + Sync>;

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

/// Records to write or remove, in order. `None` removes a record.
#[derive(Debug, Default)]
pub struct Changes(Vec<(Kind, String, Option<Vec<u8>>)>);

impl Changes {
    /// Adds or replaces a record.
    pub fn put(&mut self, kind: Kind, name: impl Into<String>, record: Vec<u8>) {
        self.0.push((kind, name.into(), Some(record)));
    }

    /// Removes a record.
    pub fn remove(&mut self, kind: Kind, name: impl Into<String>) {
        self.0.push((kind, name.into(), None));
    }

    /// Whether there is nothing to write.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Number of records to write or remove.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Size of all records to write, bytes.
    pub fn bytes(&self) -> usize {
        let records = self.0.iter().filter_map(|(_, _, record)| record.as_ref());
        records.map(Vec::len).sum()
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
        let open = move || Builder::new().set_cache_size(CACHE_BYTES).create(&file);
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
        records.database()?;
        Ok(records)
    }

    fn failed(&self, error: impl Into<redb::Error>) -> RecordsError {
        RecordsError::File {
            place: self.place.clone(),
            error: Box::new(error.into()),
        }
    }

    fn database(&mut self) -> Result<&Database, RecordsError> {
        let database = match self.database.take() {
            Some(database) => database,
            None => (self.open)().map_err(|error| self.failed(error))?,
        };
        Ok(self.database.insert(database))
    }

    /// All records of a kind, sorted by name.
    ///
    /// # Errors
    /// [`RecordsError::File`].
    pub fn all(&mut self, kind: Kind) -> Result<Vec<(String, Vec<u8>)>, RecordsError> {
        let database = self.database()?;
        read_all(database, kind).map_err(|error| self.failed(error))
    }

    /// Writes all changes or none. They are on the disk when this returns. After an error the next
    /// call opens the file again.
    ///
    /// # Errors
    /// [`RecordsError::File`]. The file then has the same records as before.
    pub fn write(&mut self, changes: &Changes) -> Result<(), RecordsError> {
        let database = self.database()?;
        let written = write_all(database, changes);
        written.map_err(|error| {
            self.database = None;
            self.failed(error)
        })
    }
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
        for (_, name, record) in changes.0.iter().filter(|(of, _, _)| *of == kind) {
            match record {
                Some(record) => table.insert(name.as_str(), record.as_slice())?,
                None => table.remove(name.as_str())?,
            };
        }
    }
    writing.commit()?;
    Ok(())
}

#[cfg(test)]
#[path = "records_tests.rs"]
mod tests;
