//! A thousand servers with a real store, and failures. docs/planning.md has the figures, which
//! these tests print:
//!
//! ```text
//! cargo test -p troupe-live simulation -- --nocapture
//! ```
//!
//! | part | is |
//! |---|---|
//! | `ring` | a model of the router |
//! | `cluster` | servers with the real [`SharedRecords`], and clients |
//! | `witness` | knows by itself who has each session, and finds what must not be |

mod cluster;
mod ring;
mod witness;

use std::collections::{BTreeMap, BTreeSet};
use std::panic::{AssertUnwindSafe, catch_unwind};

use cluster::{Cluster, ROUND, STEP, STEPS_OF_ROUND, Said, in_leases, terms, walks};

const PLANNING: &str = include_str!("../../../../docs/planning.md");
const SERVERS: usize = 1000;
const SESSIONS: usize = 10 * SERVERS;

/// Steps that take this many leases, and a little more.
fn steps_of(leases: u32) -> usize {
    let lease_ms = terms().lease.as_millis();
    usize::try_from(u128::from(leases) * lease_ms / STEP.as_millis()).unwrap() + 1
}

fn of_servers(owners: &[usize], servers: &[usize]) -> BTreeSet<usize> {
    let on_them = owners
        .iter()
        .enumerate()
        .filter(|(_, owner)| servers.contains(owner));
    on_them.map(|(session, _)| session).collect()
}

fn changed(before: &[usize], after: &[usize]) -> BTreeSet<usize> {
    let pairs = before.iter().zip(after).enumerate();
    pairs
        .filter(|(_, (before, after))| before != after)
        .map(|(session, _)| session)
        .collect()
}

fn tokens(cluster: &Cluster) -> Vec<u64> {
    let leases = cluster.witness.leases().values();
    leases.map(|lease| lease.token).collect()
}

/// Sessions of the busiest server, divided by the mean.
fn spread(cluster: &Cluster) -> f64 {
    let loads = cluster.loads();
    let (all, most) = (loads.iter().sum::<usize>(), loads.iter().max().unwrap());
    *most as f64 * loads.len() as f64 / all as f64
}

/// The median and the longest time that clients waited, in leases.
fn waited(cluster: &Cluster) -> (f64, f64) {
    let mut waits = cluster.waits.clone();
    waits.sort_unstable();
    (
        in_leases(waits[waits.len() / 2]),
        in_leases(*waits.last().unwrap()),
    )
}

/// Shows a row of the table in docs/planning.md, and compares it.
fn show(failure: &str, result: &str) {
    let row = format!("| {failure} | {result} |");
    println!("{row}");
    let has_row = PLANNING.lines().any(|line| line == row);
    assert!(has_row, "docs/planning.md has not this row: {row}");
}

/// As pages write it: 15,023.
fn thousands(number: usize) -> String {
    match number / 1000 {
        0 => number.to_string(),
        thousands => format!("{thousands},{:03}", number % 1000),
    }
}

#[test]
fn a_thousand_servers_keep_their_sessions() {
    let Some(mut cluster) = Cluster::start(SERVERS, SESSIONS) else {
        return;
    };
    let (owners, first) = (cluster.owners(), tokens(&cluster));
    cluster.run(steps_of(2));
    cluster.audit();
    assert_eq!((cluster.owners(), tokens(&cluster)), (owners.clone(), first));
    assert!((0..SESSIONS).all(|session| cluster.place(session, &[]) == owners[session]));
    let witness = &cluster.witness;
    assert_eq!((witness.granted, witness.refused), (SESSIONS, 0));
    assert_eq!((cluster.fenced, cluster.failed_rounds), (0, 0));
    // A lease that is renewed too seldom would have ended.
    assert!(witness.kept >= 4 * SESSIONS, "{}", witness.kept);
    let busiest = spread(&cluster);
    show(
        "none fails, for two leases",
        &format!("no session moves; the busiest server has {busiest:.1} times the mean"),
    );
}

#[test]
fn only_the_sessions_of_killed_servers_move_and_none_is_lost() {
    let Some(mut cluster) = Cluster::start(SERVERS, SESSIONS) else {
        return;
    };
    let killed: Vec<usize> = (0..SERVERS / 100).map(|nth| 101 * nth).collect();
    cluster.run(2 * STEPS_OF_ROUND + 2);
    let before = cluster.owners();
    let theirs = of_servers(&before, &killed);
    let now = cluster.now();
    let walkers = theirs.iter().filter(|&&session| walks(session));
    let oldest = walkers
        .map(|&session| cluster.witness.age(session, now))
        .max()
        .unwrap();
    // What has changed since is lost, and that is no more than a round.
    assert!(oldest < ROUND + STEP, "{oldest:?}");

    cluster.kill(&killed);
    assert_eq!(cluster.waiting(), theirs.len(), "old leases still hold");
    for _ in 0..steps_of(2) {
        cluster.step();
    }
    assert_eq!(cluster.waiting(), 0);
    cluster.audit();
    let after = cluster.owners();
    assert_eq!(changed(&before, &after), theirs);
    assert!(cluster.gone.is_empty() && cluster.fenced == 0);
    assert_eq!(cluster.witness.granted, SESSIONS + theirs.len());
    assert!(
        cluster
            .waits
            .iter()
            .all(|&wait| wait < terms().lease + ROUND + STEP)
    );
    let mut heirs: BTreeMap<usize, usize> = BTreeMap::new();
    for &session in &theirs {
        *heirs.entry(after[session]).or_default() += 1;
    }
    let (median, longest) = waited(&cluster);
    let most = heirs.values().max().unwrap();
    show(
        &format!("{} servers are killed", killed.len()),
        &format!(
            "their {} sessions move, to {} servers, at most {most} to one; they are there again after {median:.1} leases \
             (median), {longest:.1} (longest); of walkers, at most the last {:.1} leases are lost",
            theirs.len(),
            heirs.len(),
            in_leases(oldest),
        ),
    );
}

#[test]
fn a_rolling_restart_in_tens_lets_no_client_wait_for_a_lease() {
    let Some(mut cluster) = Cluster::start(SERVERS, SESSIONS) else {
        return;
    };
    let first = tokens(&cluster);
    for ten in 0..SERVERS / 10 {
        let stopped: Vec<usize> = (10 * ten..10 * ten + 10).collect();
        cluster.stop(&stopped);
        assert_eq!(cluster.waiting(), 0, "the servers {stopped:?} gave all up");
        cluster.step();
        cluster.start_again(&stopped);
    }
    cluster.run(STEPS_OF_ROUND);
    cluster.audit();
    let has_moved = |(first, last): (&u64, &u64)| first < last;
    assert!(first.iter().zip(&tokens(&cluster)).all(has_moved));
    assert!(cluster.gone.is_empty());
    assert_eq!((cluster.witness.refused, cluster.fenced), (0, 0));
    assert!(cluster.waits.iter().all(|&wait| wait < STEP));
    let empty = cluster.loads().iter().filter(|&&load| load == 0).count();
    show(
        "all restart, ten at a time",
        &format!(
            "{} moves, and none waits for a lease; then the busiest server has {:.1} times the mean, and {empty} servers have \
             no session",
            thousands(cluster.witness.granted - SESSIONS),
            spread(&cluster),
        ),
    );
}

#[test]
fn nothing_that_servers_write_counts_after_others_took_over() {
    let Some(mut cluster) = Cluster::start(SERVERS, SESSIONS) else {
        return;
    };
    let cut: Vec<usize> = (0..50).map(|nth| 20 * nth + 3).collect();
    // The router still sends to half of them. Clients ask for a third of their sessions elsewhere.
    let (routed, unrouted) = cut.split_at(25);
    let (before, first) = (cluster.owners(), tokens(&cluster));
    let asked: BTreeSet<usize> = of_servers(&before, routed).into_iter().step_by(3).collect();
    let theirs: BTreeSet<usize> = of_servers(&before, &cut);
    // The router sends some clients to another server that is cut off. They have to wait.
    let stuck: BTreeSet<usize> = of_servers(&before, unrouted)
        .into_iter()
        .filter(|&session| routed.contains(&cluster.place(session, unrouted)))
        .collect();
    let taken = &(&of_servers(&before, unrouted) - &stuck) | &asked;
    let other = |session: usize| before[session] + 1;
    cluster.cut_off(&cut);
    cluster.cut_off_from_router(unrouted);
    for step in 0..steps_of(2) {
        if step % STEPS_OF_ROUND == 0 {
            for &session in &asked {
                cluster.ask(other(session), session);
            }
        }
        cluster.step();
    }
    let elsewhere = (0..SESSIONS).find(|session| !theirs.contains(session)).unwrap();
    assert!(matches!(cluster.ask(cut[0], elsewhere), Said::NoStore));
    assert!(cluster.failed_rounds >= cut.len());
    assert_eq!(cluster.fenced, 0);
    assert_eq!(changed(&before, &cluster.owners()), taken);
    assert_eq!(cluster.waiting(), stuck.len());
    // They still serve all of theirs.
    let served: usize = cut.iter().map(|&server| cluster.loads()[server]).sum();
    assert_eq!(served, theirs.len());

    cluster.bring_back(&cut);
    cluster.run(3 * STEPS_OF_ROUND);
    cluster.audit();
    assert_eq!((cluster.fenced, cluster.waiting()), (taken.len(), 0));
    let last = tokens(&cluster);
    let is_kept = |&session: &usize| (last[session] == first[session]) != taken.contains(&session);
    assert!((0..SESSIONS).all(|session| is_kept(&session)));
    show(
        &format!(
            "{} do not reach the store for two leases, and the router reaches only {} of them",
            cut.len(),
            routed.len(),
        ),
        &format!(
            "{} of their {} sessions are taken over, and all {} later writes and renewals of the old owners are refused; \
             {} clients wait for the network, because the router sends them to another server without the store",
            taken.len(),
            theirs.len(),
            cluster.fenced,
            stuck.len(),
        ),
    );
}

#[test]
fn after_the_store_was_emptied_the_newest_owner_has_each_session() {
    let Some(mut cluster) = Cluster::start(SERVERS, SESSIONS) else {
        return;
    };
    let cut: Vec<usize> = (0..50).map(|nth| 20 * nth + 3).collect();
    let killed: Vec<usize> = (0..10).map(|nth| 100 * nth + 50).collect();
    let stale = of_servers(&cluster.owners(), &cut);
    cluster.cut_off(&cut);
    cluster.cut_off_from_router(&cut);
    cluster.run(steps_of(2));
    let (before, first) = (cluster.owners(), tokens(&cluster));
    let of_killed = of_servers(&before, &killed);
    let lost = &of_killed - &stale;

    cluster.empty_the_store();
    let emptied = cluster.now();
    // Those that were cut off come first, with sessions that others have taken over since.
    cluster.bring_back(&cut);
    for &server in &cut {
        cluster.round(server);
    }
    assert_eq!(changed(&before, &cluster.owners()), stale);
    cluster.kill(&killed);
    let is_back = |cluster: &Cluster| {
        let (owners, tokens) = (cluster.owners(), tokens(cluster));
        let is_back = |session| owners[session] == before[session] && tokens[session] > first[session];
        (0..SESSIONS).all(|session| of_killed.contains(&session) || is_back(session))
    };
    while !is_back(&cluster) {
        cluster.step();
        assert!(cluster.now() - emptied < terms().lease);
    }
    let took = cluster.now() - emptied;
    cluster.run(3 * STEPS_OF_ROUND);
    cluster.audit();
    assert_eq!(cluster.gone, lost, "only those that no server had are lost");
    // An old state is better than none.
    let owners = cluster.owners();
    assert!(
        (&of_killed & &stale)
            .iter()
            .all(|&session| cut.contains(&owners[session]))
    );
    assert!(is_back(&cluster));
    show(
        &format!(
            "the store is emptied; {} servers that were cut off come back with {} old sessions; {} are killed before they \
             write again",
            cut.len(),
            stale.len(),
            killed.len(),
        ),
        &format!(
            "{} sessions have an owner again after {:.1} leases, the newest of two; {} are lost with the killed servers",
            thousands(SESSIONS - lost.len()),
            in_leases(took),
            lost.len(),
        ),
    );
}

/// Three servers, and what the witness says to a store that is not as it should be.
#[test]
fn the_witness_finds_two_owners() {
    let Some(mut cluster) = Cluster::start(3, 30) else {
        return;
    };
    cluster.audit();
    let owner = cluster.owners()[0];
    let (other, third) = ((owner + 1) % 3, (owner + 2) % 3);
    let token = tokens(&cluster)[0].to_string();
    cluster.cut_off(&[owner]);
    cluster.run(steps_of(2));
    assert!(matches!(cluster.ask(other, 0), Said::Here));
    assert_eq!(cluster.witness.faults(), [""; 0]);
    // The old token counts again.
    cluster.tamper(0, &[("token", &token)]);
    cluster.bring_back(&[owner]);
    cluster.round(owner);
    let faults = cluster.witness.faults().join("\n");
    assert!(
        faults.contains("session 0: a write of") && faults.contains(" counts"),
        "{faults}"
    );
    assert!(catch_unwind(AssertUnwindSafe(|| cluster.audit())).is_err());
    // A lease ends too early.
    let session = (0..30)
        .find(|&session| cluster.owners()[session] == other)
        .unwrap();
    cluster.tamper(session, &[("until", "0"), ("keep", "-1")]);
    assert!(matches!(cluster.ask(third, session), Said::Here));
    let faults = cluster.witness.faults().join("\n");
    assert!(faults.contains("has not ended"), "{faults}");
}
