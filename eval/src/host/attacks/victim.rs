//! The victim: it uses the server while others attack it, on connections, threads and an address of
//! its own.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::{Context as _, anyhow};
use troupe_client::{Client, Drive, DriveOptions, Locomotion, Pack, SessionOptions};
use troupe_motion::Vec3;

use crate::figures::{largest, ms, percentile};
use crate::host::gap;

/// Pause between two requests for `/healthz`.
const HEALTH_EVERY: Duration = Duration::from_millis(10);
/// Pause between two calls of InBetween.
const CALL_EVERY: Duration = Duration::from_millis(100);
/// Longest wait for an answer.
const PATIENCE: Duration = Duration::from_secs(30);
/// Id of the session that it drives.
const SESSION: &str = "victim";

/// All ticks, answers and faults so far.
#[derive(Debug, Default)]
pub struct Seen {
    ticks: Vec<TickSeen>,
    health: Vec<Took>,
    calls: Vec<Took>,
    faults: Vec<(Instant, String)>,
}

#[derive(Debug, Clone, Copy)]
struct TickSeen {
    at: Instant,
    /// Ticks dropped so far.
    dropped: u64,
    underruns: u32,
}

#[derive(Debug, Clone, Copy)]
struct Took {
    asked: Instant,
    ms: f64,
}

/// What the victim saw between two moments.
#[derive(Debug, Clone, Default)]
pub struct Phase {
    pub ticks: usize,
    pub dropped: u64,
    pub underruns: u64,
    /// p99 and worst, ms. None without a request.
    pub health_ms: Option<(f64, f64)>,
    /// p99 and worst, ms. None without a call, for instance because an earlier one took all the
    /// time.
    pub call_ms: Option<(f64, f64)>,
    pub faults: Vec<String>,
}

impl Seen {
    /// What the victim saw from one moment to another.
    pub fn between(&self, from: Instant, to: Instant) -> Phase {
        let within = |at: Instant| from <= at && at < to;
        let dropped = |until: Instant| {
            let before = self.ticks.iter().take_while(|tick| tick.at < until);
            before.last().map_or(0, |tick| tick.dropped)
        };
        let ticks: Vec<_> = self.ticks.iter().filter(|tick| within(tick.at)).collect();
        let times = |all: &[Took]| {
            let some: Vec<f64> = all
                .iter()
                .filter(|one| within(one.asked))
                .map(|one| one.ms)
                .collect();
            (!some.is_empty()).then(|| (percentile(&some, 0.99), largest(&some)))
        };
        let faults = self.faults.iter().filter(|(at, _)| within(*at));
        Phase {
            ticks: ticks.len(),
            dropped: dropped(to) - dropped(from),
            underruns: ticks.iter().map(|tick| u64::from(tick.underruns)).sum(),
            health_ms: times(&self.health),
            call_ms: times(&self.calls),
            faults: faults.map(|(_, what)| what.clone()).collect(),
        }
    }
}

/// A victim at work, on a thread of its own.
pub struct Victim {
    stop: Arc<AtomicBool>,
    seen: Arc<Mutex<Seen>>,
    thread: JoinHandle<anyhow::Result<()>>,
}

impl Victim {
    /// Begins to drive a character, and to ask for `/healthz` and for in-betweens.
    pub fn start(url: &str) -> Self {
        let (stop, seen) = (Arc::new(AtomicBool::new(false)), Arc::new(Mutex::default()));
        let at_work = AtWork {
            url: url.to_owned(),
            stop: stop.clone(),
            seen: seen.clone(),
        };
        let thread = std::thread::spawn(move || {
            let mut runtime = tokio::runtime::Builder::new_multi_thread();
            let runtime = runtime.worker_threads(2).enable_all().build()?;
            runtime.block_on(at_work.run())
        });
        Self { stop, seen, thread }
    }

    /// Ends, and gives all that it saw.
    ///
    /// # Errors
    /// Those of the client, if it could not begin.
    pub fn stop(self) -> anyhow::Result<Seen> {
        self.stop.store(true, Ordering::Relaxed);
        let ended = self.thread.join().map_err(|_| anyhow!("the victim panicked"))?;
        ended.context("the victim")?;
        Ok(std::mem::take(
            &mut *self.seen.lock().unwrap_or_else(PoisonError::into_inner),
        ))
    }
}

#[derive(Clone)]
struct AtWork {
    url: String,
    stop: Arc<AtomicBool>,
    seen: Arc<Mutex<Seen>>,
}

impl AtWork {
    async fn run(self) -> anyhow::Result<()> {
        let client = Client::connect(&self.url).await?;
        let pack = client.pack("").await?;
        let session = client.session(&pack, &SessionOptions::new().id(SESSION)).await?;
        let options = DriveOptions {
            every_tick: true,
            reconnect: None,
            ..DriveOptions::default()
        };
        let mut drive = client.drive(options).await?;
        drive.attach([session]).await?;
        let caller = Client::connect(&self.url).await?;
        let tasks = [
            tokio::spawn(self.clone().drive(drive)),
            tokio::spawn(self.clone().health()),
            tokio::spawn(self.clone().call(caller, pack)),
        ];
        for task in tasks {
            task.await?;
        }
        Ok(())
    }

    fn goes_on(&self) -> bool {
        !self.stop.load(Ordering::Relaxed)
    }

    fn note(&self, what: impl FnOnce(&mut Seen)) {
        what(&mut self.seen.lock().unwrap_or_else(PoisonError::into_inner));
    }

    fn fault(&self, what: String) {
        self.note(|seen| seen.faults.push((Instant::now(), what)));
    }

    /// Drives a character that walks in circles, on one stream.
    async fn drive(self, mut drive: Drive) {
        let mut heading = 0.0_f32;
        while self.goes_on() {
            heading += 0.01;
            if let Some(intent) = drive.intent_mut(SESSION) {
                // The heading changes every second.
                let turned = (heading * 3.3).floor() / 3.3;
                *intent = Locomotion::walk(Vec3::new(turned.sin(), 0.0, turned.cos()) * 1.2);
            }
            match drive.next().await {
                Ok(Some(update)) => {
                    let Some(tick) = update.tick else { continue };
                    let tick = TickSeen {
                        at: Instant::now(),
                        dropped: tick.dropped(),
                        underruns: tick.underruns(),
                    };
                    self.note(|seen| seen.ticks.push(tick));
                }
                Ok(None) => return self.fault("the stream ended".to_owned()),
                Err(error) => return self.fault(format!("the stream: {error}")),
            }
        }
    }

    /// Asks for `/healthz` on a new connection each time, as an orchestrator does.
    async fn health(self) {
        let http = reqwest::Client::builder()
            .pool_max_idle_per_host(0)
            .timeout(PATIENCE);
        let http = match http.build() {
            Ok(http) => http,
            Err(error) => return self.fault(error.to_string()),
        };
        let url = format!("{}/healthz", self.url);
        while self.goes_on() {
            let asked = Instant::now();
            let answer = http.get(&url).send().await;
            if let Err(error) = answer.and_then(reqwest::Response::error_for_status) {
                self.fault(format!("/healthz: {error}"));
            }
            let ms = ms(asked.elapsed());
            self.note(|seen| seen.health.push(Took { asked, ms }));
            tokio::time::sleep(HEALTH_EVERY).await;
        }
    }

    /// Asks for one segment of 64 frames after the other.
    async fn call(self, client: Client, pack: Pack) {
        let gap = match gap(&pack) {
            Ok(gap) => gap,
            Err(error) => return self.fault(error.to_string()),
        };
        while self.goes_on() {
            let asked = Instant::now();
            if let Err(error) = client.in_between(&pack, &gap).await {
                self.fault(format!("InBetween: {error}"));
            }
            let ms = ms(asked.elapsed());
            self.note(|seen| seen.calls.push(Took { asked, ms }));
            tokio::time::sleep(CALL_EVERY).await;
        }
    }
}
