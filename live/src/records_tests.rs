use std::collections::BTreeMap;

use rand::{Rng as _, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::disk::{Shared, on};
use super::*;

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

/// Full disks and lost power in the middle of writing: afterwards there is all of a change or
/// nothing of it, and what was written before is there.
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
