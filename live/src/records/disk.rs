//! A disk in memory for tests. Its operations can fail, and it can lose power.

use std::sync::{Arc, Mutex, PoisonError};

use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;
use redb::{Builder, StorageBackend};

use super::{Records, RecordsError};

/// A disk that can lose power. Each write since the last sync then survives or is lost at random.
#[derive(Debug, Default)]
pub struct Disk {
    synced: Vec<u8>,
    now: Vec<u8>,
    /// Writes since the last sync, in order: offset and bytes.
    unsynced: Vec<(u64, Vec<u8>)>,
    /// Number of operations that still succeed. `None`: no operation fails.
    pub fails_in: Option<u32>,
}

/// A handle of a disk. It lives longer than the database, so a test can open the disk again.
#[derive(Debug, Clone, Default)]
pub struct Shared(pub Arc<Mutex<Disk>>);

impl Disk {
    fn operate(&mut self) -> std::io::Result<()> {
        match &mut self.fails_in {
            Some(0) => Err(std::io::Error::from(std::io::ErrorKind::StorageFull)),
            Some(left) => {
                *left -= 1;
                Ok(())
            }
            None => Ok(()),
        }
    }

    fn apply(to: &mut Vec<u8>, at: u64, data: &[u8]) {
        let end = at as usize + data.len();
        if to.len() < end {
            to.resize(end, 0);
        }
        to[at as usize..end].copy_from_slice(data);
    }

    /// The power fails: half of the writes since the last sync are lost.
    pub fn pull(&mut self, rng: &mut ChaCha8Rng) {
        let mut left = std::mem::take(&mut self.synced);
        left.resize(left.len().max(self.now.len()), 0);
        for (at, data) in self.unsynced.drain(..) {
            if rng.random_bool(0.5) {
                Self::apply(&mut left, at, &data);
            }
        }
        self.now = left.clone();
        self.synced = left;
        self.fails_in = None;
    }
}

impl Shared {
    fn with<T>(&self, work: impl FnOnce(&mut Disk) -> std::io::Result<T>) -> Result<T, std::io::Error> {
        work(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl StorageBackend for Shared {
    fn len(&self) -> Result<u64, std::io::Error> {
        self.with(|disk| Ok(disk.now.len() as u64))
    }

    fn read(&self, offset: u64, out: &mut [u8]) -> Result<(), std::io::Error> {
        self.with(|disk| {
            let at = offset as usize;
            let from = disk.now.get(at..at + out.len());
            out.copy_from_slice(from.ok_or(std::io::ErrorKind::UnexpectedEof)?);
            Ok(())
        })
    }

    fn set_len(&self, len: u64) -> Result<(), std::io::Error> {
        self.with(|disk| {
            disk.operate()?;
            disk.now.resize(len as usize, 0);
            Ok(())
        })
    }

    fn sync_data(&self) -> Result<(), std::io::Error> {
        self.with(|disk| {
            disk.operate()?;
            disk.synced = disk.now.clone();
            disk.unsynced.clear();
            Ok(())
        })
    }

    fn write(&self, offset: u64, data: &[u8]) -> Result<(), std::io::Error> {
        self.with(|disk| {
            disk.operate()?;
            Disk::apply(&mut disk.now, offset, data);
            disk.unsynced.push((offset, data.to_vec()));
            Ok(())
        })
    }
}

/// Opens the records on a disk.
pub fn on(disk: &Shared) -> Result<Records, RecordsError> {
    let disk = disk.clone();
    let open = move || Builder::new().create_with_backend(disk.clone());
    Records::opened(Box::new(open), "the disk".to_owned())
}
