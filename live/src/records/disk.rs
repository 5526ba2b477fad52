//! A disk in memory for tests. Its operations can fail or hang, and it can lose power.

use std::io::{Error, ErrorKind, Result};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;
use redb::StorageBackend;

use super::{Records, RecordsError, builder};

/// What goes wrong with a disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// Writes and syncs fail, because no space is left.
    Full,
    /// Writes and syncs are refused.
    ReadOnly,
    /// A write stops in the middle. All later ones fail.
    Torn,
    /// Writes and syncs do not return until the fault ends.
    Hung,
}

/// A disk that can lose power. Each write since the last sync then survives or is lost at random.
#[derive(Debug, Default)]
pub struct Disk {
    synced: Vec<u8>,
    now: Vec<u8>,
    /// Writes since the last sync, in order: offset and bytes.
    unsynced: Vec<(u64, Vec<u8>)>,
    /// The fault, and the number of writes and syncs that still succeed. `None`: all succeed.
    fault: Option<(u32, Fault)>,
    /// Number of operations that hang at the moment.
    hanging: usize,
}

/// A handle of a disk. It lives longer than the database, so a test can open the disk again.
#[derive(Debug, Clone, Default)]
pub struct Shared(Arc<(Mutex<Disk>, Condvar)>);

impl Disk {
    fn apply(to: &mut Vec<u8>, at: u64, data: &[u8]) {
        let end = at as usize + data.len();
        if to.len() < end {
            to.resize(end, 0);
        }
        to[at as usize..end].copy_from_slice(data);
    }

    fn write(&mut self, at: u64, data: &[u8]) {
        Self::apply(&mut self.now, at, data);
        self.unsynced.push((at, data.to_vec()));
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Disk> {
        self.0.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// After `operations` more writes and syncs, all fail as `fault` says. `None` ends a fault.
    pub fn set_fault(&self, fault: Option<(u32, Fault)>) {
        self.lock().fault = fault;
        self.0.1.notify_all();
    }

    /// Whether an operation hangs at the moment.
    pub fn hangs(&self) -> bool {
        self.lock().hanging > 0
    }

    /// The disk as a process leaves it that dies now, without a fault.
    pub fn copy(&self) -> Self {
        let disk = self.lock();
        let copy = Disk {
            synced: disk.synced.clone(),
            now: disk.now.clone(),
            unsynced: disk.unsynced.clone(),
            ..Disk::default()
        };
        Self(Arc::new((Mutex::new(copy), Condvar::new())))
    }

    /// The bytes of the disk, to damage them.
    pub fn change(&self, change: impl FnOnce(&mut Vec<u8>)) {
        change(&mut self.lock().now);
    }

    /// The power fails: half of the writes since the last sync are lost. Ends a fault.
    pub fn pull(&self, rng: &mut ChaCha8Rng) {
        let mut disk = self.lock();
        let mut left = std::mem::take(&mut disk.synced);
        left.resize(left.len().max(disk.now.len()), 0);
        for (at, data) in disk.unsynced.drain(..) {
            if rng.random_bool(0.5) {
                Disk::apply(&mut left, at, &data);
            }
        }
        disk.now = left.clone();
        disk.synced = left;
        disk.fault = None;
    }

    /// The disk, for an operation that changes it. `torn` happens if the operation is the one that
    /// a torn write ends in.
    fn operate(&self, torn: impl FnOnce(&mut Disk)) -> Result<MutexGuard<'_, Disk>> {
        let mut disk = self.lock();
        let fault = match &mut disk.fault {
            None => return Ok(disk),
            Some((left @ 1.., _)) => {
                *left -= 1;
                return Ok(disk);
            }
            Some((_, fault)) => *fault,
        };
        match fault {
            Fault::Full => Err(ErrorKind::StorageFull.into()),
            Fault::ReadOnly => Err(ErrorKind::ReadOnlyFilesystem.into()),
            Fault::Torn => {
                torn(&mut disk);
                disk.fault = Some((0, Fault::ReadOnly));
                Err(Error::other("torn"))
            }
            Fault::Hung => {
                disk.hanging += 1;
                let hangs = |disk: &mut Disk| matches!(disk.fault, Some((0, Fault::Hung)));
                let woken = self.0.1.wait_while(disk, hangs);
                let mut disk = woken.unwrap_or_else(PoisonError::into_inner);
                disk.hanging -= 1;
                Ok(disk)
            }
        }
    }
}

impl StorageBackend for Shared {
    fn len(&self) -> Result<u64> {
        Ok(self.lock().now.len() as u64)
    }

    fn read(&self, offset: u64, out: &mut [u8]) -> Result<()> {
        let (disk, at) = (self.lock(), offset as usize);
        let from = disk.now.get(at..at + out.len());
        out.copy_from_slice(from.ok_or(ErrorKind::UnexpectedEof)?);
        Ok(())
    }

    fn set_len(&self, len: u64) -> Result<()> {
        self.operate(|_| ())?.now.resize(len as usize, 0);
        Ok(())
    }

    fn sync_data(&self) -> Result<()> {
        let mut disk = self.operate(|_| ())?;
        disk.synced = disk.now.clone();
        disk.unsynced.clear();
        Ok(())
    }

    fn write(&self, offset: u64, data: &[u8]) -> Result<()> {
        let half = |disk: &mut Disk| disk.write(offset, &data[..data.len() / 2]);
        self.operate(half)?.write(offset, data);
        Ok(())
    }
}

/// Opens the records on a disk.
pub fn on(disk: &Shared) -> std::result::Result<Records, RecordsError> {
    let disk = disk.clone();
    let open = move || builder().create_with_backend(disk.clone());
    Records::opened(Box::new(open), "the disk".to_owned())
}
