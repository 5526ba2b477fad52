use std::collections::BTreeMap;

use rand::{Rng as _, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::disk::{Fault, Shared, on};
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
            let kind = [Fault::Full, Fault::ReadOnly, Fault::Torn][seed as usize % 3];
            let fault = rng.random_bool(0.6).then(|| (rng.random_range(0..12), kind));
            disk.set_fault(fault);
            let result = records.write(&changes);
            disk.set_fault(None);
            match result {
                Ok(()) => now = then,
                Err(error) => {
                    failed += 1;
                    assert!(error.to_string().starts_with("store: the disk: "), "{error}");
                    if rng.random_bool(0.5) {
                        pulled += 1;
                        drop(records);
                        disk.pull(&mut rng);
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

/// Random damage to a file: changed bytes, lost blocks, a missing end. The records are either as
/// they were written, or the error says that they are not, and what to do.
#[test]
fn damage_is_an_error_that_says_what_to_do() {
    let disk = Shared::default();
    let mut records = on(&disk).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut now = All::new();
    for _ in 0..10 {
        let (changes, then) = change(&mut rng, &now);
        records.write(&changes).unwrap();
        now = then;
    }
    drop(records);
    let (mut damaged, mut whole) = (0, 0);
    for seed in 0..500 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let disk = disk.copy();
        disk.change(|bytes| match seed % 4 {
            0 => bytes.truncate(rng.random_range(1..bytes.len())),
            1 => {
                for _ in 0..20 {
                    let at = rng.random_range(0..bytes.len());
                    bytes[at] ^= rng.random_range(1..=255u8);
                }
            }
            2 => {
                let at = rng.random_range(0..bytes.len() / 4096) * 4096;
                bytes[at..at + 4096].fill(0);
            }
            _ => rng.fill_bytes(&mut bytes[..4096]),
        });
        let found = on(&disk).and_then(|mut records| records.all(Kind::Session));
        match found {
            Ok(found) => {
                whole += 1;
                assert_eq!(found.into_iter().collect::<All>(), now, "seed {seed}");
            }
            Err(error) => {
                damaged += 1;
                let text = error.to_string();
                assert!(
                    matches!(error, RecordsError::Damaged { .. }),
                    "seed {seed}: {text}"
                );
                assert!(text.starts_with("store: the disk is damaged ("), "{text}");
                assert!(
                    text.contains("put a copy of it in its place, or move it away"),
                    "{text}"
                );
            }
        }
    }
    println!("{damaged} of 500 were damaged, {whole} were as before");
    assert!(damaged > 100 && whole > 20);
}
