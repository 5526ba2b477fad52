//! Two servers and a real redis-server, of which each test has its own.

use std::thread::sleep;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::testing::{LEASE, Redis, TERMS, free_port};
use super::*;

const HERO: &str = "studio/hero";

fn ask(server: &SharedRecords, want: Want) -> Result<Claim, RecordsError> {
    let claims = server.leases.claim(&[(Kind::Session, HERO.to_owned(), want)]);
    claims.map(|mut claims| claims.remove(0))
}

fn written(server: &mut SharedRecords, record: &str) -> Result<Tended, RecordsError> {
    let mut changes = Changes::default();
    let record = record.as_bytes().to_vec();
    changes.put_for(Duration::from_secs(5), Kind::Session, HERO, record);
    server.write(&changes)
}

fn tended(server: &mut SharedRecords) -> Result<Tended, RecordsError> {
    server.tend(&|_, _| true)
}

fn forgotten() -> Tended {
    Tended {
        forgotten: vec![(Kind::Session, HERO.to_owned())],
        ..Tended::default()
    }
}

fn owner_of(claim: &Claim) -> &str {
    match claim {
        Claim::Elsewhere { owner, ends_in } => {
            assert!(*ends_in <= LEASE && !ends_in.is_zero(), "{ends_in:?}");
            owner
        }
        other => panic!("{other:?}"),
    }
}

fn lost_to(tended: &Tended) -> &str {
    assert_eq!(tended.lost.len(), 1, "{tended:?}");
    assert_eq!(
        (tended.lost[0].kind, &*tended.lost[0].name),
        (Kind::Session, HERO)
    );
    &tended.lost[0].owner
}

#[test]
fn a_server_that_was_paused_past_its_lease_cannot_write() {
    let Some(redis) = Redis::start() else { return };
    let (mut one, mut two) = (redis.server("one:1"), redis.server("two:2"));
    assert_eq!(ask(&two, Want::Known).unwrap(), Claim::Unknown);
    assert_eq!(ask(&one, Want::New).unwrap(), Claim::Taken(None));
    assert_eq!(written(&mut one, "first").unwrap(), Tended::default());
    let token = redis.token();
    assert_eq!(owner_of(&ask(&two, Want::Known).unwrap()), "one:1");
    assert_eq!(owner_of(&ask(&two, Want::New).unwrap()), "one:1");
    // Renewals carry it over more than a lease.
    for _ in 0..6 {
        sleep(LEASE / 4);
        assert_eq!(tended(&mut one).unwrap(), Tended::default());
    }
    assert_eq!(owner_of(&ask(&two, Want::Known).unwrap()), "one:1");

    // The time of the lease is that of Redis, also while its process stands still.
    redis.signal("STOP");
    sleep(LEASE + LEASE / 2);
    redis.signal("CONT");
    assert_eq!(ask(&two, Want::New).unwrap(), Claim::Exists);
    let taken = Claim::Taken(Some(b"first".to_vec()));
    assert_eq!(ask(&two, Want::Known).unwrap(), taken);
    assert!(redis.token() > token);
    assert_eq!(lost_to(&written(&mut one, "stale").unwrap()), "two:2");
    assert_eq!(redis.field("record").as_deref(), Some("first"));
    assert!(!one.owns(Kind::Session, HERO) && two.owns(Kind::Session, HERO));
    assert_eq!(lost_to(&written(&mut one, "stale").unwrap()), "");
    assert_eq!(written(&mut two, "second").unwrap(), Tended::default());
    assert_eq!(redis.field("record").as_deref(), Some("second"));
    assert_eq!(owner_of(&ask(&one, Want::Known).unwrap()), "two:2");
}

#[test]
fn a_lease_that_is_given_up_is_free_at_once_and_a_closed_session_does_not_come_back() {
    let Some(redis) = Redis::start() else { return };
    let (mut one, mut two) = (redis.server("one:1"), redis.server("two:2"));
    ask(&one, Want::New).unwrap();
    written(&mut one, "first").unwrap();
    one.leave();
    let taken = Claim::Taken(Some(b"first".to_vec()));
    assert_eq!(ask(&two, Want::Known).unwrap(), taken);
    // It is not named as open, so it is given up.
    two.tend(&|_, _| false).unwrap();
    assert_eq!(ask(&one, Want::Known).unwrap(), taken);
    // The new owner closes it, while the one before still believes to have it.
    let stale = *one.leases.held().get(&(Kind::Session, HERO.to_owned())).unwrap();
    one.leave();
    ask(&two, Want::Known).unwrap();
    let mut changes = Changes::default();
    changes.remove(Kind::Session, HERO);
    assert_eq!(two.write(&changes).unwrap(), Tended::default());
    one.leases.held().insert((Kind::Session, HERO.to_owned()), stale);
    assert_eq!(lost_to(&written(&mut one, "stale").unwrap()), "two:2");
    assert_eq!(ask(&one, Want::Known).unwrap(), Claim::Unknown);
    assert_eq!(ask(&one, Want::New).unwrap(), Claim::Taken(None));
}

#[test]
fn a_session_that_is_opened_again_at_once_is_not_removed() {
    let Some(redis) = Redis::start() else { return };
    let mut one = redis.server("one:1");
    ask(&one, Want::New).unwrap();
    written(&mut one, "first").unwrap();
    let mut changes = Changes::default();
    changes.remove(Kind::Session, HERO);
    // A client closes it, and opens another of this name, while the keeper looks for changes.
    sleep(Duration::from_millis(2));
    assert_eq!(ask(&one, Want::New).unwrap(), Claim::Had);
    assert_eq!(one.write(&changes).unwrap(), Tended::default());
    assert!(one.owns(Kind::Session, HERO));
    assert_eq!(written(&mut one, "second").unwrap(), Tended::default());
    assert_eq!(redis.field("record").as_deref(), Some("second"));
}

#[test]
fn a_session_whose_record_is_being_removed_is_gone_for_its_own_server() {
    let Some(mut redis) = Redis::start() else { return };
    let mut one = redis.server("one:1");
    ask(&one, Want::New).unwrap();
    written(&mut one, "first").unwrap();
    redis.stop();
    let mut changes = Changes::default();
    changes.remove(Kind::Session, HERO);
    assert!(one.write(&changes).is_err());
    assert_eq!(ask(&one, Want::Known).unwrap(), Claim::Unknown);
    // Its lease is not free yet.
    assert_eq!(owner_of(&ask(&one, Want::New).unwrap()), "one:1");
}

#[test]
fn redis_that_comes_back_empty_gets_everything_again_from_the_newest_owner() {
    let Some(mut redis) = Redis::start() else { return };
    let (mut old, mut new) = (redis.server("old:1"), redis.server("new:2"));
    ask(&old, Want::New).unwrap();
    written(&mut old, "first").unwrap();
    sleep(LEASE + LEASE / 4);
    ask(&new, Want::Known).unwrap();
    written(&mut new, "second").unwrap();
    let token = redis.token();
    redis.stop();
    assert!(written(&mut new, "third").is_err());
    redis.start_again();
    sleep(Duration::from_millis(600));
    // The one that was cut off before comes first, and must give way.
    assert_eq!(tended(&mut old).unwrap(), forgotten());
    assert_eq!(tended(&mut new).unwrap(), forgotten());
    assert!(redis.token() > token);
    assert_eq!(redis.field("record"), None);
    assert_eq!(lost_to(&tended(&mut old).unwrap()), "new:2");
    assert_eq!(written(&mut new, "fourth").unwrap(), Tended::default());
    assert_eq!(redis.field("record").as_deref(), Some("fourth"));
    assert_eq!(owner_of(&ask(&old, Want::Known).unwrap()), "new:2");
}

#[test]
fn a_server_that_was_cut_off_for_too_long_takes_nothing_that_redis_does_not_know() {
    let Some(redis) = Redis::start() else { return };
    let mut one = redis.server("one:1");
    ask(&one, Want::New).unwrap();
    let key = (Kind::Session, HERO.to_owned());
    one.leases.held().get_mut(&key).unwrap().renewed -= TERMS.remember;
    redis.ask::<()>(&["FLUSHALL"]);
    assert_eq!(lost_to(&written(&mut one, "stale").unwrap()), "");
    assert_eq!(redis.token(), 0);
}

#[test]
fn a_store_that_does_not_answer_delays_no_call_for_long_and_the_newest_write_wins() {
    let Some(redis) = Redis::start() else { return };
    let mut one = redis.server("one:1");
    ask(&one, Want::New).unwrap();
    written(&mut one, "first").unwrap();
    redis.signal("STOP");
    let begun = Instant::now();
    let error = written(&mut one, "second").unwrap_err().to_string();
    assert!(
        error.starts_with(&format!("store: redis://127.0.0.1:{}: ", redis.port)),
        "{error}"
    );
    assert!(begun.elapsed() < Duration::from_secs(4), "{:?}", begun.elapsed());
    // Nothing is tried again for a while.
    let begun = Instant::now();
    assert!(written(&mut one, "third").is_err());
    assert!(
        begun.elapsed() < Duration::from_millis(300),
        "{:?}",
        begun.elapsed()
    );
    assert!(one.owns(Kind::Session, HERO), "the session goes on");
    // Connecting has an end, too.
    sleep(Duration::from_millis(600));
    let begun = Instant::now();
    assert!(written(&mut one, "third").is_err());
    assert!(begun.elapsed() < Duration::from_secs(4), "{:?}", begun.elapsed());
    sleep(Duration::from_millis(600));
    redis.signal("CONT");
    assert_eq!(written(&mut one, "fourth").unwrap(), Tended::default());
    // Redis has the second write too, on a connection that is closed.
    sleep(Duration::from_millis(200));
    assert_eq!(redis.field("record").as_deref(), Some("fourth"));
}

#[test]
fn a_request_that_comes_late_changes_nothing() {
    let Some(redis) = Redis::start() else { return };
    let mut one = redis.server("one:1");
    ask(&one, Want::New).unwrap();
    let held = *one.leases.held().get(&(Kind::Session, HERO.to_owned())).unwrap();
    let script = |record: &'static [u8]| {
        (one.leases).script(Kind::Session, HERO, &held, Hold::Write(record), Instant::now())
    };
    let (older, newer) = (script(b"older"), script(b"newer"));
    assert_eq!(
        one.link.run(vec![newer, older]).unwrap(),
        [Answer::Kept, Answer::Kept]
    );
    assert_eq!(redis.field("record").as_deref(), Some("newer"));
}

#[test]
fn a_scene_has_no_end_and_a_session_is_worth_nothing_after_its_time_to_live() {
    let Some(redis) = Redis::start() else { return };
    let (mut one, two) = (redis.server("one:1"), redis.server("two:2"));
    let asked = [
        (Kind::Session, HERO.to_owned(), Want::New),
        (Kind::Scene, "yard".to_owned(), Want::Any),
    ];
    assert_eq!(
        one.leases.claim(&asked).unwrap(),
        [Claim::Taken(None), Claim::Taken(None)]
    );
    let mut changes = Changes::default();
    changes.put_for(Duration::from_millis(100), Kind::Session, HERO, b"hero".to_vec());
    changes.put(Kind::Scene, "yard", b"yard".to_vec());
    assert_eq!(one.write(&changes).unwrap(), Tended::default());
    assert_eq!(redis.ask::<i64>(&["PTTL", "troupe:scene:yard"]), -1);
    let left_ms: i64 = redis.ask(&["PTTL", "troupe:session:studio/hero"]);
    assert!((50_000..=61_000).contains(&left_ms), "{left_ms}");
    sleep(LEASE + Duration::from_millis(200));
    assert_eq!(ask(&two, Want::Known).unwrap(), Claim::Unknown);
    assert_eq!(ask(&two, Want::New).unwrap(), Claim::Taken(None));
    assert_eq!(redis.field("record"), None);
    let scene = [(Kind::Scene, "yard".to_owned(), Want::Any)];
    assert_eq!(
        two.leases.claim(&scene).unwrap(),
        [Claim::Taken(Some(b"yard".to_vec()))]
    );
}

#[test]
fn a_password_is_used_and_a_wrong_one_is_an_error_that_does_not_show_it() {
    let Some(redis) = Redis::start_with(&["--requirepass", "p@ss"]) else {
        return;
    };
    let server = |password: &str| {
        let place = format!("redis://:{password}@127.0.0.1:{}/3", redis.port);
        SharedRecords::new(
            &place.parse().unwrap(),
            "one:1".to_owned(),
            TERMS,
            &Telemetry::new().unwrap(),
        )
    };
    let error = ask(&server("secret"), Want::New).unwrap_err().to_string();
    assert!(
        error.starts_with("store: redis://127.0.0.1:") && !error.contains("secret"),
        "{error}"
    );
    assert_eq!(ask(&server("p%40ss"), Want::New).unwrap(), Claim::Taken(None));
}

#[test]
fn a_cluster_has_the_leases_on_all_of_its_nodes() {
    let node = |_| {
        let bus = free_port().to_string();
        Redis::start_with(&["--cluster-enabled", "yes", "--cluster-port", &bus])
    };
    let Some(nodes) = (0..3).map(node).collect::<Option<Vec<Redis>>>() else {
        return;
    };
    let slots = [("0", "5460"), ("5461", "10922"), ("10923", "16383")];
    for (node, (first, last)) in nodes.iter().zip(slots) {
        node.ask::<()>(&["CLUSTER", "ADDSLOTSRANGE", first, last]);
        let (port, bus) = (
            nodes[0].port.to_string(),
            nodes[0].ask::<Vec<String>>(&["CONFIG", "GET", "cluster-port"]),
        );
        node.ask::<()>(&["CLUSTER", "MEET", "127.0.0.1", &port, &bus[1]]);
    }
    let is_up = |node: &Redis| {
        node.ask::<String>(&["CLUSTER", "INFO"])
            .contains("cluster_state:ok")
    };
    let are_up = (0..1000).any(|_| {
        sleep(Duration::from_millis(20));
        nodes.iter().all(is_up)
    });
    assert!(are_up, "the nodes do not find each other");

    let hosts: Vec<String> = nodes
        .iter()
        .map(|node| format!("127.0.0.1:{}", node.port))
        .collect();
    let place: Place = format!("redis://{}", hosts.join(",")).parse().unwrap();
    let server = |address: &str| {
        SharedRecords::new(
            &place,
            address.to_owned(),
            Terms::default(),
            &Telemetry::new().unwrap(),
        )
    };
    let (mut one, two) = (server("one:1"), server("two:2"));
    let asked = |want| -> Vec<_> {
        let names = (0..600).map(|number| format!("walker-{number}"));
        names.map(|name| (Kind::Session, name, want)).collect()
    };
    let claims = one.leases.claim(&asked(Want::New)).unwrap();
    assert!(
        claims.iter().all(|claim| *claim == Claim::Taken(None)),
        "{claims:?}"
    );
    let mut changes = Changes::default();
    for (kind, name, _) in asked(Want::Any) {
        // More than is sent at once.
        changes.put_for(Duration::from_secs(5), kind, &*name, vec![7; 10_000]);
    }
    assert_eq!(one.write(&changes).unwrap(), Tended::default());
    for node in &nodes {
        let keys: usize = node.ask(&["DBSIZE"]);
        assert!((100..300).contains(&keys), "{keys}");
    }
    let claims = two.leases.claim(&asked(Want::Known)).unwrap();
    assert!(
        claims
            .iter()
            .all(|claim| matches!(claim, Claim::Elsewhere { owner, .. } if owner == "one:1"))
    );
    one.leave();
    let claims = two.leases.claim(&asked(Want::Known)).unwrap();
    assert!(
        claims
            .iter()
            .all(|claim| *claim == Claim::Taken(Some(vec![7; 10_000])))
    );

    // The uploads are together on one node.
    let (mut log, mut other) = (one.uploads().unwrap(), two.uploads().unwrap());
    let writes: Vec<Write> = (0..600)
        .map(|number| Write {
            field: format!("scene//{number}"),
            rank: 0,
            record: Some(vec![7; 10_000]),
        })
        .collect();
    assert!(log.write(&writes).unwrap().iter().all(Option::is_some));
    let changes = other.since(0).unwrap();
    let fields: Vec<String> = changes.list.into_iter().map(|change| change.field).collect();
    let all: Vec<&String> = writes.iter().map(|write| &write.field).collect();
    assert_eq!(fields.iter().collect::<Vec<_>>(), all);
    let records = other.records(&fields).unwrap();
    assert!(records.iter().all(|record| *record == Some(vec![7; 10_000])));
}

/// Two servers do anything at random, leases end, and Redis loses everything. Each token is higher
/// than all before, and what Redis has is what the last write that was not refused wrote.
#[test]
fn tokens_only_rise() {
    let Some(redis) = Redis::start() else { return };
    let (mut granted, mut refused, mut emptied) = (0, 0, 0);
    let mut highest = 0;
    for seed in 0..40 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut servers = [redis.server("one:1"), redis.server("two:2")];
        let mut record: Option<String> = None;
        redis.ask::<()>(&["FLUSHALL"]);
        for step in 0..30 {
            let which = rng.random_range(0..2);
            let server = &mut servers[which];
            match rng.random_range(0..12) {
                0..4 => {
                    let want = [Want::New, Want::Known, Want::Any][rng.random_range(0..3)];
                    match ask(server, want).unwrap() {
                        Claim::Taken(found) => {
                            granted += 1;
                            assert!(redis.token() > highest, "seed {seed}, step {step}");
                            let found = found.map(|found| String::from_utf8(found).unwrap());
                            assert_eq!(found, record, "seed {seed}, step {step}");
                        }
                        Claim::Elsewhere { .. } => refused += 1,
                        _ => {}
                    }
                }
                4..9 => {
                    let text = format!("{seed}-{step}");
                    let tended = written(server, &text).unwrap();
                    match tended.lost.is_empty() {
                        true => record = Some(text),
                        false => refused += 1,
                    }
                }
                9 => {
                    let tended = tended(server).unwrap();
                    refused += tended.lost.len();
                }
                10 if redis.token() > 0 => {
                    // The lease ends, and the record still counts.
                    let key = "troupe:session:studio/hero";
                    redis.ask::<()>(&["HSET", key, "until", "0", "keep", "-1"]);
                }
                _ if rng.random_bool(0.3) => {
                    emptied += 1;
                    redis.ask::<()>(&["FLUSHALL"]);
                    record = None;
                }
                _ => {}
            }
            let token = redis.token();
            assert!(
                token == 0 || token >= highest,
                "seed {seed}, step {step}: {token} after {highest}"
            );
            highest = highest.max(token);
            assert_eq!(redis.field("record"), record, "seed {seed}, step {step}");
        }
    }
    println!("{granted} leases were granted, {refused} calls refused; Redis was emptied {emptied} times");
    assert!(
        granted > 60 && refused > 60 && emptied > 10,
        "{granted} {refused} {emptied}"
    );
}

#[test]
fn an_address_names_hosts_and_never_shows_its_password() {
    let shown = |text: &str| text.parse::<Place>().map(|place| format!("{place} {place:?}"));
    let good = [
        ("redis://localhost", "redis://localhost"),
        (
            "rediss://user:p%40ss@db.example.com:6380/2",
            "rediss://db.example.com:6380",
        ),
        ("redis://:secret@a:1,b:2,c:3", "redis://a:1,b:2,c:3"),
        ("redis://[::1]:6379", "redis://[::1]:6379"),
    ];
    for (text, wanted) in good {
        assert_eq!(shown(text).unwrap(), format!("{wanted} {wanted}"));
        assert!(Place::is_one(text));
    }
    for bad in [
        "redis://",
        "redis://:secret@",
        "redis://a,,b",
        "redis://a,b/1",
        "redis://a/one",
        "redis://a:port",
        "http://a",
    ] {
        let error = shown(bad).unwrap_err().to_string();
        assert!(
            error.starts_with("store: ") && error.contains("; allowed: redis://"),
            "{error}"
        );
        assert!(!error.contains("secret"), "{error}");
    }
}
