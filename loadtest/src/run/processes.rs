//! Several processes that run one load. This program starts copies of itself as workers, and
//! exchanges lines of JSON with them over their standard input and output.
//!
//! Every worker generates the same arrivals from the same seed, and sends only its own share. So
//! the load is the same with any number of processes. Histograms are added, not averaged.

use std::process::Stdio;
use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};
use tokio::io::{AsyncBufReadExt as _, AsyncWriteExt as _, BufReader, Lines};
use tokio::process::{Child, ChildStdin, ChildStdout, Command};
use tokio::sync::mpsc;
use tokio::time::Instant;

use super::process::{clock, finish, own_use};
use super::progress::Progress;
use crate::access::Access;
use crate::failure::Failure;
use crate::measure::{Harvest, Pulse, Recorder};
use crate::plan::{Plan, Share};
use crate::workloads::prepare;

/// The argument that makes this program a worker.
pub const WORKER: &str = "worker";

/// An order to a worker.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Order {
    /// Prepare a share of the load, and answer `Ready`.
    Prepare {
        plan: Box<Plan>,
        /// Key and certificates, which the plan's JSON leaves out.
        access: Access,
        share: Share,
    },
    /// Start the load at a time, in microseconds since 1970.
    Begin { at_us: u64 },
}

/// A message of a worker.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Word {
    /// The worker is ready.
    Ready,
    /// Progress in a second.
    Pulse { second: u64, pulse: Pulse },
    /// The load has ended.
    Harvest(Box<Harvest>),
    /// The load failed.
    Failed { kind: Kind, message: String },
}

/// Kind of a [`Failure`].
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Kind {
    Input,
    Unreachable,
    Other,
}

/// Workers that are ready.
#[derive(Debug)]
pub struct Workers(Vec<Worker>);

#[derive(Debug)]
struct Worker {
    /// Killed if this is dropped before it has ended.
    child: Child,
    orders: ChildStdin,
    words: Lines<BufReader<ChildStdout>>,
}

fn broken(why: impl std::fmt::Display) -> Failure {
    Failure::Other(format!("a worker process failed: {why}"))
}

impl Worker {
    fn start() -> Result<Self, Failure> {
        let program = std::env::current_exe().map_err(broken)?;
        let mut child = Command::new(program)
            .arg(WORKER)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .kill_on_drop(true)
            .spawn()
            .map_err(broken)?;
        let orders = child
            .stdin
            .take()
            .ok_or_else(|| broken("it has no standard input"))?;
        let words = child
            .stdout
            .take()
            .ok_or_else(|| broken("it has no standard output"))?;
        Ok(Self {
            child,
            orders,
            words: BufReader::new(words).lines(),
        })
    }

    async fn tell(&mut self, order: &Order) -> Result<(), Failure> {
        let line = serde_json::to_string(order).map_err(broken)? + "\n";
        self.orders.write_all(line.as_bytes()).await.map_err(broken)
    }

    async fn hear(&mut self) -> Result<Word, Failure> {
        let line = self.words.next_line().await.map_err(broken)?;
        let line = line.ok_or_else(|| broken("it ended without a result"))?;
        match serde_json::from_str(&line).map_err(broken)? {
            Word::Failed { kind, message } => Err(match kind {
                Kind::Input => Failure::Input(message),
                Kind::Unreachable => Failure::Unreachable(message),
                Kind::Other => Failure::Other(message),
            }),
            word => Ok(word),
        }
    }

    /// Reads the worker's messages to the end.
    async fn follow(mut self, pulses: mpsc::Sender<(u64, Pulse)>) -> Result<Harvest, Failure> {
        loop {
            match self.hear().await? {
                Word::Pulse { second, pulse } => {
                    // If the channel is full, the second is only missing in the progress.
                    let _ = pulses.try_send((second, pulse));
                }
                Word::Harvest(harvest) => {
                    drop(self.orders);
                    self.child.wait().await.map_err(broken)?;
                    return Ok(*harvest);
                }
                Word::Ready | Word::Failed { .. } => {}
            }
        }
    }
}

impl Workers {
    /// Starts workers and waits until all are ready.
    ///
    /// # Errors
    /// The [`Failure`] of the first worker that cannot prepare.
    pub async fn spawn(plan: &Plan) -> Result<Self, Failure> {
        let mut workers = Vec::new();
        for nth in 0..plan.processes {
            let mut worker = Worker::start()?;
            let share = Share {
                nth,
                of: plan.processes,
            };
            let order = Order::Prepare {
                plan: Box::new(plan.clone()),
                access: plan.access.clone(),
                share,
            };
            worker.tell(&order).await?;
            workers.push(worker);
        }
        for worker in &mut workers {
            match worker.hear().await? {
                Word::Ready => {}
                other => return Err(broken(format_args!("it sent {other:?} instead of Ready"))),
            }
        }
        Ok(Self(workers))
    }

    /// Lets the workers run the load, and adds up their records.
    ///
    /// # Errors
    /// The [`Failure`] of the first worker that fails.
    pub async fn carry_out(
        self,
        plan: &Plan,
        start: Instant,
        progress: &Progress,
    ) -> Result<Harvest, Failure> {
        let at = SystemTime::now() + start.saturating_duration_since(Instant::now());
        let at_us = at.duration_since(UNIX_EPOCH).map_err(broken)?.as_micros();
        let at_us = u64::try_from(at_us).map_err(broken)?;
        let count = self.0.len();
        let (pulses, seconds) = mpsc::channel(16 * count.max(1));
        let mut following = Vec::new();
        for mut worker in self.0 {
            worker.tell(&Order::Begin { at_us }).await?;
            following.push(tokio::spawn(worker.follow(pulses.clone())));
        }
        drop(pulses);
        show(plan, count, seconds, progress).await;
        let mut sum = Harvest::default();
        for task in following {
            sum.merge(&task.await.map_err(broken)??);
        }
        Ok(sum)
    }
}

/// Shows each second once all workers have sent it.
async fn show(plan: &Plan, count: usize, mut seconds: mpsc::Receiver<(u64, Pulse)>, progress: &Progress) {
    let mut now = (0, 0, Pulse::default());
    while let Some((second, pulse)) = seconds.recv().await {
        if second != now.0 {
            now = (second, 0, Pulse::default());
        }
        now.1 += 1;
        now.2 = sum(now.2, pulse);
        if now.1 == count {
            progress.show(plan, second, &now.2);
        }
    }
}

/// Adds the counts of two processes, and takes the higher latencies.
fn sum(one: Pulse, two: Pulse) -> Pulse {
    Pulse {
        right: one.right + two.right,
        refused: one.refused + two.refused,
        failed: one.failed + two.failed,
        dropped: one.dropped + two.dropped,
        frames: one.frames + two.frames,
        underruns: one.underruns + two.underruns,
        p50_ms: one.p50_ms.max(two.p50_ms),
        p99_ms: one.p99_ms.max(two.p99_ms),
        in_flight: one.in_flight + two.in_flight,
    }
}

/// Runs a worker process. It reads orders, runs its share of the load, and sends its records.
///
/// # Errors
/// [`Failure`] if the connection to the parent process breaks. All other failures are sent to the
/// parent.
pub async fn work() -> Result<(), Failure> {
    let mut orders = BufReader::new(tokio::io::stdin()).lines();
    let mut out = tokio::io::stdout();
    let last = match labour(&mut orders, &mut out).await {
        Ok(harvest) => Word::Harvest(Box::new(harvest)),
        Err(failure) => Word::Failed {
            kind: match failure.exit() {
                2 => Kind::Input,
                3 => Kind::Unreachable,
                _ => Kind::Other,
            },
            message: failure.to_string(),
        },
    };
    say(&mut out, &last).await
}

async fn labour(
    orders: &mut Lines<BufReader<tokio::io::Stdin>>,
    out: &mut tokio::io::Stdout,
) -> Result<Harvest, Failure> {
    let Order::Prepare {
        mut plan,
        access,
        share,
    } = hear(orders).await?
    else {
        return Err(broken("it got the order to begin before the order to prepare"));
    };
    plan.access = access;
    let prepared = prepare(&plan, share).await?;
    say(out, &Word::Ready).await?;
    let Order::Begin { at_us } = hear(orders).await? else {
        return Err(broken("it got the order to prepare twice"));
    };
    let at = UNIX_EPOCH + Duration::from_micros(at_us);
    let start = Instant::now() + at.duration_since(SystemTime::now()).unwrap_or_default();
    let recorder = Arc::new(Recorder::new(clock(&plan, start)));
    let own = tokio::spawn(own_use(recorder.clock().clone()));
    let load = prepared.carry_out(&plan, share, &recorder);
    tokio::pin!(load);
    for second in 1.. {
        let next = tokio::time::sleep_until(start + Duration::from_secs(second));
        tokio::select! {
            done = &mut load => {
                done?;
                break;
            }
            () = next => {
                let pulse = recorder.pulse(Instant::now());
                say(out, &Word::Pulse { second, pulse }).await?;
            }
            // During a load no order comes. The input only ends if the parent process has ended.
            order = hear(orders) => return Err(match order {
                Ok(order) => broken(format_args!("it got the order {order:?} during a load")),
                Err(gone) => gone,
            }),
        }
    }
    finish(&recorder, own).await
}

async fn hear(orders: &mut Lines<BufReader<tokio::io::Stdin>>) -> Result<Order, Failure> {
    let line = orders.next_line().await.map_err(broken)?;
    let line = line.ok_or_else(|| broken("it got no order"))?;
    serde_json::from_str(&line).map_err(broken)
}

async fn say(out: &mut tokio::io::Stdout, word: &Word) -> Result<(), Failure> {
    let line = serde_json::to_string(word).map_err(broken)? + "\n";
    out.write_all(line.as_bytes()).await.map_err(broken)?;
    out.flush().await.map_err(broken)
}
