//! Stops of a server in simulated time: a thousand schedules of requests, half requests, steps,
//! streams, faults of the disk, a signal, and perhaps a second one. All of the server runs, over
//! connections in memory, on one thread. Who does what when comes from a seed; a failure names it,
//! and `TROUPE_DRAIN_SEED=7` runs that one alone.

mod clients;
mod engine;
mod net;
mod store_tests;

use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tokio::runtime::Builder;
use tokio::task::yield_now;
use tokio::time::{Instant, sleep, sleep_until};

use super::*;
use clients::{Caller, Known, Log, World, stream};
use engine::{Gate, source};
use net::{Answer, Dial, Http, port, request};
use troupe_live::records::disk::{Fault, Shared, on};
use troupe_live::session::{Keeper, Spaces, TenantOptions};

const SEEDS: u64 = 1000;
/// The code of a close frame that says that the server goes away (RFC 6455, section 7.4.1).
const GOING_AWAY: u16 = 1001;

/// What happens when, after the start.
#[derive(Debug)]
struct Plan {
    delay: Duration,
    timeout: Duration,
    interval: Duration,
    callers: u32,
    streams: u32,
    stop: Duration,
    /// The second signal, after the first.
    again: Option<Duration>,
    /// When the disk does not work, from and to. Without an end: also after the stop.
    fault: Option<(Fault, Duration, Option<Duration>)>,
    /// When the engine does not work.
    closed: Vec<(Duration, Duration)>,
    power_fails: bool,
}

impl Plan {
    fn of(random: &mut ChaCha8Rng) -> Self {
        let ms = Duration::from_millis;
        let stop = random.random_range(1..2000);
        let (delay, timeout) = (random.random_range(0..1500), random.random_range(100..3000));
        let end = stop + delay + timeout;
        let fault = random.random_range(0..stop);
        let mut closed: Vec<_> = (0..random.random_range(0..4))
            .map(|_| {
                let from = random.random_range(0..end);
                (ms(from), ms(from + random.random_range(1..4000)))
            })
            .collect();
        closed.sort();
        Self {
            delay: ms(if random.random_bool(0.2) { 0 } else { delay }),
            timeout: ms(timeout),
            interval: ms(random.random_range(50..500)),
            callers: random.random_range(0..5),
            streams: random.random_range(0..4),
            stop: ms(stop),
            again: random
                .random_bool(0.3)
                .then(|| ms(random.random_range(0..delay + timeout))),
            fault: random.random_bool(0.3).then(|| {
                let kind = [Fault::Full, Fault::ReadOnly, Fault::Torn][random.random_range(0..3)];
                let end = random.random_range(fault..=stop);
                (kind, ms(fault), random.random_bool(0.6).then(|| ms(end)))
            }),
            closed,
            power_fails: random.random_bool(0.5),
        }
    }

    /// Latest time at which the store has what a client learned at `at`. `None`: perhaps never. All
    /// times of the plan count from `begun`.
    fn kept_by(&self, begun: Instant, at: Instant) -> Option<Instant> {
        match self.fault {
            Some((_, from, to)) if at + self.interval >= begun + from => {
                to.map(|to| at.max(begun + to) + self.interval)
            }
            _ => Some(at + self.interval),
        }
    }
}

/// How a run ended.
struct End {
    stopped: Stopped,
    begun: Instant,
    at: Instant,
    service: Arc<Service>,
    config: Config,
}

/// What all runs came to.
#[derive(Debug, Default)]
struct Sum {
    clean: u32,
    lost: u32,
    forced: u32,
    answered: usize,
    cut: usize,
    halves: usize,
    explained: usize,
    kept: usize,
    faults: u32,
    unkept: u32,
}

#[test]
fn a_thousand_stops_answer_tell_and_keep() {
    let seeds: Vec<u64> = match std::env::var("TROUPE_DRAIN_SEED") {
        Ok(seed) => vec![seed.parse().unwrap()],
        Err(_) => (0..SEEDS).collect(),
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let next = Mutex::new(seeds.iter());
    let sum = Mutex::new(Sum::default());
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some(&seed) = { next.lock().unwrap().next() } {
                    let run = std::panic::AssertUnwindSafe(|| run(seed, &sum));
                    if let Err(panic) = std::panic::catch_unwind(run) {
                        eprintln!("seed {seed}");
                        std::panic::resume_unwind(panic);
                    }
                }
            });
        }
    });
    let sum = sum.into_inner().unwrap();
    println!("{sum:?}");
    if seeds.len() as u64 == SEEDS {
        assert!(sum.clean > 300 && sum.lost > 20 && sum.forced > 100, "{sum:?}");
        assert!(
            sum.answered > 5000 && sum.halves > 500 && sum.explained > 500,
            "{sum:?}"
        );
        assert!(sum.kept > 1000 && sum.faults > 100 && sum.unkept > 30, "{sum:?}");
    }
}

/// One stop: the process from its start to its end, and what its successor finds.
fn run(seed: u64, sum: &Mutex<Sum>) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let plan = Plan::of(&mut random);
    let (disk, gate, log) = (
        Shared::default(),
        Gate::default(),
        Arc::new(Mutex::new(Log::default())),
    );
    let runtime = || {
        let mut runtime = Builder::new_current_thread();
        runtime.enable_all().start_paused(true).build().unwrap()
    };
    let process = runtime();
    let end = process.block_on(live(&plan, &mut random, &disk, &gate, &log));
    assert!(gate.end(), "a step was stuck: {plan:?}");
    // All tasks end with the process.
    drop(process);
    let log = std::mem::take(&mut *log.lock().unwrap());
    let mut sum = sum.lock().unwrap();
    check_answers(&plan, &end, &log, &mut sum);
    check_streams(&plan, &end, &log, &mut sum);
    disk.set_fault(None);
    if matches!(end.stopped, Stopped::Forced | Stopped::Unkept) && plan.power_fails {
        disk.pull(&mut random);
    }
    runtime().block_on(check_kept(&plan, &end, &log, &disk, &mut sum));
}

/// Chances of their own for somebody, so that what others do does not change them.
fn fork(random: &mut ChaCha8Rng) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(random.random())
}

/// Serves, and stops as planned.
async fn live(
    plan: &Plan,
    random: &mut ChaCha8Rng,
    disk: &Shared,
    gate: &Gate,
    log: &Arc<Mutex<Log>>,
) -> End {
    let mut config = Config::local(Path::new("unused")).unwrap();
    config.default_pack = Some("toy".into());
    config.drain_delay_ms = plan.delay.as_millis() as u64;
    config.drain_timeout_ms = plan.timeout.as_millis() as u64;
    config.fixed.snapshot_interval = plan.interval;
    // Real time: the engine may be closed.
    config.fixed.last_step = Duration::from_millis(20);
    let (dial, listener) = port();
    let (records, packs) = (disk.clone(), source(gate));
    let around = Around {
        time: TimeSource::default(),
        executor: Executor::here(),
        records: Box::new(move |_| Ok(Some(Box::new(on(&records)?)))),
    };
    let address = SocketAddr::from(([127, 0, 0, 1], 8080));
    let served = serve_on(config.clone(), listener, address, around, || Ok(vec![packs]));
    let mut handle = served.await.unwrap();
    handle.ready().await.unwrap();
    let service = handle.service().clone();
    let begun = Instant::now();

    let world = World {
        dial: dial.clone(),
        gate: gate.clone(),
        log: log.clone(),
    };
    for nth in 0..plan.callers {
        let caller = Caller::new(world.clone(), fork(random), format!("c{nth}"));
        tokio::spawn(caller.run());
    }
    for nth in 0..plan.streams {
        tokio::spawn(stream(world.clone(), fork(random), format!("s{nth}")));
    }
    tokio::spawn(close_gate(gate.clone(), plan.closed.clone(), begun));
    if let Some((fault, from, to)) = plan.fault {
        let (disk, operations) = (disk.clone(), random.random_range(0..8));
        tokio::spawn(async move {
            sleep_until(begun + from).await;
            disk.set_fault(Some((operations, fault)));
            if let Some(to) = to {
                sleep_until(begun + to).await;
                disk.set_fault(None);
            }
        });
    }

    sleep_until(begun + plan.stop).await;
    assert_eq!(ready(&dial).await, Some(200));
    let again = plan.again;
    let stopping = tokio::spawn(handle.shut_down_unless(async move {
        match again {
            Some(after) => sleep(after).await,
            None => std::future::pending().await,
        }
    }));
    yield_now().await;
    let probing = tokio::spawn(probe(dial, plan.delay, begun + plan.stop));
    let stopped = stopping.await.unwrap();
    let at = Instant::now();
    if stopped == Stopped::Forced {
        assert_eq!(
            Some(at - (begun + plan.stop)),
            plan.again,
            "a second signal is heard at once"
        );
    } else {
        probing.await.unwrap();
        let bound = plan.delay + plan.timeout + FAREWELL + Duration::from_millis(2);
        assert!(at - (begun + plan.stop) <= bound, "{plan:?}: {:?}", at - begun);
    }
    End {
        stopped,
        begun,
        at,
        service,
        config,
    }
}

async fn close_gate(gate: Gate, times: Vec<(Duration, Duration)>, begun: Instant) {
    for (from, to) in times {
        sleep_until(begun + from).await;
        gate.set_closed(true);
        sleep_until(begun + to).await;
        gate.set_closed(false);
    }
}

/// The status of `/readyz` on a new connection. None: no connection.
async fn ready(dial: &Dial) -> Option<u16> {
    let mut http = Http::new(dial.connect()?);
    http.send(&request("GET", "/readyz", "")).await;
    match http.answer().await {
        Answer::Whole(status, _) => Some(status),
        _ => None,
    }
}

/// From its signal on a server says that it is not ready. It takes connections until its delay is
/// over, and none after.
async fn probe(dial: Dial, delay: Duration, stop: Instant) {
    for part in 0..4 {
        sleep_until(stop + delay * part / 4).await;
        if delay.is_zero() {
            break;
        }
        let begun = Instant::now();
        assert_eq!(
            ready(&dial).await,
            Some(503),
            "{:?} after the signal",
            begun - stop
        );
        assert_eq!(Instant::now(), begun, "it says so at once");
    }
    sleep_until(stop + delay + Duration::from_millis(1)).await;
    assert!(dial.connect().is_none(), "the port is closed");
}

/// Who asked in time was answered, once; where somebody was not, the server says that it lost
/// something.
fn check_answers(plan: &Plan, end: &End, log: &Log, sum: &mut Sum) {
    let closes = end.begun + plan.stop + plan.delay;
    let in_time = |at: Instant| at < closes && at < end.at;
    let cut = log
        .asked
        .iter()
        .filter(|asked| asked.answered.is_none() && in_time(asked.at))
        .count();
    let torn = log.asked.iter().filter(|asked| asked.torn).count();
    let deaf = log.streams.iter().any(|stream| stream.deaf);
    match end.stopped {
        Stopped::Clean => {
            assert_eq!((cut, torn), (0, 0), "{plan:?}");
            sum.clean += 1;
        }
        Stopped::Lost => {
            let unanswered = log.asked.iter().any(|asked| asked.answered.is_none());
            assert!(unanswered || deaf, "nothing was lost: {plan:?}\n{log:?}");
            sum.lost += 1;
        }
        Stopped::Unkept => {
            let stays = plan.fault.is_some_and(|(_, _, to)| to.is_none());
            assert!(stays, "the disk worked: {plan:?}");
            sum.unkept += 1;
        }
        Stopped::Forced => sum.forced += 1,
    }
    sum.cut += cut;
    sum.halves += log.halves;
    sum.answered += log.asked.iter().filter(|asked| asked.answered.is_some()).count();
    sum.faults += u32::from(plan.fault.is_some());
}

/// Every stream that was open when the server stopped got the reason and advice.
fn check_streams(plan: &Plan, end: &End, log: &Log, sum: &mut Sum) {
    let drains = end.begun + plan.stop + plan.delay;
    if end.stopped == Stopped::Forced && end.at <= drains {
        return;
    }
    for streamed in &log.streams {
        let open = streamed.since.is_some_and(|since| since < drains);
        if !open || streamed.leaves.is_some_and(|leaves| leaves <= drains) {
            continue;
        }
        let reason = streamed.reason.as_ref();
        let reason = reason.unwrap_or_else(|| panic!("no reason: {plan:?}\n{streamed:?}"));
        assert_eq!(reason.reason, "DRAINING");
        assert!(reason.message.contains("open the stream again"), "{reason:?}");
        assert_eq!(streamed.close_code, Some(GOING_AWAY), "{streamed:?}");
        sum.explained += 1;
    }
}

/// The next server has what clients have learned: all of it after a stop. After a forced stop, or
/// one that says that it lost changes, it has what is older than a snapshot and the disk's fault.
async fn check_kept(plan: &Plan, end: &End, log: &Log, disk: &Shared, sum: &mut Sum) {
    let service = &end.service;
    let telemetry = service.telemetry();
    let space = service.space().unwrap();
    let sessions = Sessions::new(
        end.config.session_limits(),
        TimeSource::default(),
        Executor::here(),
        telemetry,
    );
    let sessions = Arc::new(sessions);
    let (packs, store) = (space.packs.clone(), space.store.clone());
    let spaces = Spaces::new(packs, store, sessions.clone(), TenantOptions::default());
    let keeper = Keeper::new(&Arc::new(spaces), Box::new(on(disk).unwrap()), telemetry);
    drop(keeper.unwrap());
    let has_lost = matches!(end.stopped, Stopped::Forced | Stopped::Unkept);
    let kept_by = |at: Instant| plan.kept_by(end.begun, at);
    let must = |at: Instant| !has_lost || kept_by(at).is_some_and(|kept| kept < end.at);
    let last = |learned: &[(u64, Instant)]| {
        let kept = learned.iter().filter(|(_, at)| must(*at));
        kept.map(|(number, _)| *number).max().unwrap_or(0)
    };
    for (id, known) in &log.sessions {
        let Known {
            created: Some(created),
            ..
        } = known
        else {
            continue;
        };
        let found = sessions.get(id);
        if known.closed.is_some_and(must) {
            assert!(found.is_err(), "{id} was closed: {plan:?}");
            continue;
        }
        if known.close_asked || !must(*created) {
            continue;
        }
        let found = found.unwrap_or_else(|error| panic!("{id} {known:?}: {error}\n{plan:?}"));
        assert!(
            found.last_sequence >= last(&known.commands),
            "{id}: {found:?}\n{known:?}"
        );
        assert!(found.frame >= last(&known.frames), "{id}: {found:?}\n{known:?}");
        sum.kept += 1;
    }
}
