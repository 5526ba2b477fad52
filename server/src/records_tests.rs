use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use rand::{Rng as _, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use redb::StorageBackend;

use super::*;

/// A disk that can be pulled: what was not synced may be there after that, or not, write by write.
#[derive(Debug, Default)]
struct Disk {
    synced: Vec<u8>,
    now: Vec<u8>,
    /// Since the last sync; in order.
    unsynced: Vec<(u64, Vec<u8>)>,
    /// Operations until it fails; none: never.
    fails_in: Option<u32>,
}

#[derive(Debug, Clone, Default)]
struct Shared(Arc<Mutex<Disk>>);

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

    /// The power goes.
    fn pull(&mut self, rng: &mut ChaCha8Rng) {
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
        work(&mut self.0.lock().unwrap())
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

fn on(disk: &Shared) -> Result<Records, RecordsError> {
    let disk = disk.clone();
    let open = move || Builder::new().create_with_backend(disk.clone());
    Records::opened(Box::new(open), "the disk".to_owned())
}

type All = BTreeMap<String, Vec<u8>>;

fn all(records: &mut Records) -> All {
    records.all(Kind::Session).unwrap().into_iter().collect()
}

/// A change of a few records, and what there is after it.
fn change(rng: &mut ChaCha8Rng, now: &All) -> (Changes, All) {
    let (mut changes, mut then) = (Changes::default(), now.clone());
    for _ in 0..rng.random_range(1..6) {
        let name = format!("session-{}", rng.random_range(0..12));
        if rng.random_bool(0.3) {
            then.remove(&name);
            changes.remove(Kind::Session, name);
        } else {
            let mut record = vec![0; rng.random_range(1..6000)];
            rng.fill_bytes(&mut record);
            then.insert(name.clone(), record.clone());
            changes.put(Kind::Session, name, record);
        }
    }
    (changes, then)
}

/// Full disks and lost power in the middle of writing: afterwards there is all of a change or nothing of it, and what was written
/// before is there.
#[test]
fn a_thousand_faults_lose_nothing_that_was_written() {
    let (mut failed, mut pulled, mut torn) = (0, 0, 0);
    for seed in 0..1000 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let disk = Shared::default();
        let mut records = on(&disk).unwrap();
        let mut now = All::new();
        for _ in 0..rng.random_range(1..5) {
            let (changes, then) = change(&mut rng, &now);
            let fault = rng.random_bool(0.6).then(|| rng.random_range(0..12));
            disk.0.lock().unwrap().fails_in = fault;
            let result = records.write(&changes);
            disk.0.lock().unwrap().fails_in = None;
            match result {
                Ok(()) => now = then,
                Err(error) => {
                    failed += 1;
                    assert!(error.to_string().starts_with("store: the disk: "), "{error}");
                    if rng.random_bool(0.5) {
                        pulled += 1;
                        drop(records);
                        disk.0.lock().unwrap().pull(&mut rng);
                        records = on(&disk).unwrap();
                    }
                    let there = all(&mut records);
                    assert!(there == now || there == then, "seed {seed}");
                    torn += u32::from(there == then);
                    now = there;
                }
            }
            assert_eq!(all(&mut records), now, "seed {seed}");
        }
    }
    println!(
        "{failed} writes failed, after {pulled} of them the power went; {torn} of them had come through all the same"
    );
    assert!(failed > 500 && pulled > 200);
}

#[test]
fn records_are_there_again() {
    let folder = std::env::temp_dir().join(format!("troupe-records-{}", std::process::id()));
    let mut records = Records::open(&folder).unwrap();
    assert!(records.all(Kind::Scene).unwrap().is_empty());
    let mut changes = Changes::default();
    changes.put(Kind::Session, "a", vec![1; 10]);
    changes.put(Kind::Session, "b", vec![2; 20]);
    changes.put(Kind::Scene, "a", vec![3]);
    assert_eq!(changes.bytes(), 31);
    records.write(&changes).unwrap();
    let error = Records::open(&folder).unwrap_err().to_string();
    assert!(error.starts_with("store: another server uses "), "{error}");
    let mut changes = Changes::default();
    changes.remove(Kind::Session, "a");
    records.write(&changes).unwrap();
    drop(records);
    let mut records = Records::open(&folder).unwrap();
    assert_eq!(
        records.all(Kind::Session).unwrap(),
        [("b".to_owned(), vec![2; 20])]
    );
    assert_eq!(records.all(Kind::Scene).unwrap(), [("a".to_owned(), vec![3])]);
    drop(records);
    std::fs::remove_dir_all(&folder).unwrap();
    std::fs::write(&folder, "a file").unwrap();
    let error = Records::open(&folder).unwrap_err().to_string();
    assert!(error.starts_with("store: cannot make the folder "), "{error}");
    std::fs::remove_file(&folder).unwrap();
}
