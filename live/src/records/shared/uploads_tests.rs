//! The log of uploads in a real redis-server, of which each test has its own.

use super::super::super::RecordStore as _;
use super::super::testing::Redis;
use super::*;

fn put(field: &str, rank: u64, record: Option<&[u8]>) -> Write {
    Write {
        field: field.to_owned(),
        rank,
        record: record.map(<[u8]>::to_vec),
    }
}

fn written(log: &mut UploadLog, write: Write) -> Version {
    log.write(&[write]).unwrap()[0].unwrap()
}

fn record(log: &mut UploadLog, field: &str) -> Option<Vec<u8>> {
    log.records(&[field.to_owned()]).unwrap().remove(0)
}

fn log(redis: &Redis) -> UploadLog {
    redis.server("one:1").uploads().unwrap()
}

#[test]
fn a_change_is_listed_once_at_its_newest_version() {
    let Some(redis) = Redis::start() else { return };
    let (mut one, mut two) = (log(&redis), log(&redis));
    assert_eq!(two.since(0).unwrap(), Changes::default());
    let yard = written(&mut one, put("scene//yard", 0, Some(b"first")));
    let cup = written(&mut one, put("definition//cup", 0, Some(b"cup")));
    assert!(cup.position > yard.position);
    let all = two.since(0).unwrap();
    let fields: Vec<_> = all.list.iter().map(|change| change.field.as_str()).collect();
    assert_eq!(fields, ["scene//yard", "definition//cup"]);
    assert_eq!((all.list[0].at, all.list[0].bytes), (yard, Some(5)));
    assert_eq!((all.epoch, all.version), (yard.rank, cup.position));

    // Whoever does not know the newest rank replaces it all the same.
    let later = written(&mut two, put("scene//yard", 0, Some(b"second")));
    assert!(later.rank > cup.rank);
    let gone = written(&mut one, put("definition//cup", cup.rank, None));
    let news = one.since(cup.position).unwrap();
    let news: Vec<_> = news.list.iter().map(|change| (change.at, change.bytes)).collect();
    assert_eq!(news, [(later, Some(6)), (gone, None)]);
    assert_eq!(record(&mut one, "scene//yard").as_deref(), Some(&b"second"[..]));
    assert_eq!(record(&mut one, "definition//cup"), None);
}

#[test]
fn a_write_that_comes_late_changes_nothing() {
    let Some(redis) = Redis::start() else { return };
    let mut one = log(&redis);
    let first = written(&mut one, put("scene//yard", 0, Some(b"first")));
    let late = script(
        &put("scene//yard", first.rank, Some(b"late")),
        &first.rank.to_string(),
    );
    let newest = written(&mut one, put("scene//yard", first.rank, Some(b"newest")));
    one.link.ask(vec![late]).unwrap();
    assert_eq!(record(&mut one, "scene//yard").as_deref(), Some(&b"newest"[..]));

    // What is written again after a loss has its rank, and the highest wins.
    redis.ask::<()>(&["FLUSHALL"]);
    one.write_again(&[put("scene//yard", first.rank, Some(b"first"))])
        .unwrap();
    one.write_again(&[put("scene//yard", newest.rank, Some(b"newest"))])
        .unwrap();
    one.write_again(&[put("scene//yard", first.rank, Some(b"first"))])
        .unwrap();
    let all = one.since(0).unwrap();
    assert_eq!(
        (all.list.len(), all.list[0].at.rank, all.epoch != first.rank),
        (1, newest.rank, true)
    );
    assert_eq!(record(&mut one, "scene//yard").as_deref(), Some(&b"newest"[..]));
}

#[test]
fn the_oldest_removals_are_forgotten_and_the_floor_says_so() {
    let Some(redis) = Redis::start() else { return };
    let mut one = log(&redis);
    let stays = written(&mut one, put("scene//stays", 0, Some(b"x")));
    let removals: Vec<Write> = (0..MAX_REMOVED + 3)
        .map(|number| put(&format!("scene//{number}"), 0, None))
        .collect();
    let done = one.write(&removals).unwrap();
    let all = one.since(0).unwrap();
    assert_eq!(all.list.len(), MAX_REMOVED + 1);
    assert_eq!(
        (all.list[0].at, all.floor),
        (stays, done[2].map_or(0, |at| at.position))
    );
}
