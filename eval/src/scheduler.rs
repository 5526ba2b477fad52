//! `troupe-eval scheduler`: what three rules of the scheduler are worth. Idle workers share what
//! waits, a batch is capped by its time, and an engine that cuts batches into calls gets whole
//! calls. The scheduler itself runs with modelled workers, so every run on every machine gives the
//! same figures.
//!
//! A batch of n characters takes a + b·n. One step a batch, two workers.

use std::collections::{BTreeMap, HashMap};
use std::time::{Duration, Instant};

use troupe_batch::scheduler::{Action, Batch, Event, Finished, Limits, Ready, RequestId, Scheduler};
use troupe_batch::{Order, OwnerId};

use crate::figures::{ms, percentile};

const WORKERS: usize = 2;
const MS: Duration = Duration::from_millis(1);
/// Cost of a batch of any size.
const BATCH_MS: f64 = 1.0;
/// Cost of a character of a fast model.
const FAST_MS: f64 = 0.7;
/// Cost of a character of a slow model.
const SLOW_MS: f64 = 40.0;
/// Characters of the trial batch of a worker at its start, as in the server.
const TRIAL: usize = 16;
/// Length of a run without its warm-up, and the warm-up.
const MEASURED: Duration = Duration::from_secs(60);
const WARM_UP: Duration = Duration::from_secs(5);
/// Time from the request for a plan until it takes over.
const LOOK_AHEAD: Duration = Duration::from_millis(266);

/// Sizes of the calls that an engine cuts batches into.
const CALLS: [usize; 3] = [8, 4, 1];
/// Cost of such a call, and of each of its rows.
const CALL_MS: f64 = 0.9;
const ROW_MS: f64 = 0.65;

/// The cost of batches.
#[derive(Debug, Clone, Copy)]
enum Model {
    /// [`BATCH_MS`], and this cost a character.
    Linear(f64),
    /// The cost of calls of an engine that cuts batches.
    Calls,
}

/// A source of requests.
#[derive(Debug, Clone, Copy)]
enum Caller {
    /// Asks for this number of characters, again as soon as it has its answer.
    Calls(usize),
    /// Asks for a plan of one character after each such time.
    Lives(Duration),
    /// Asks once.
    Once(usize),
}

/// An event of the simulation.
#[derive(Debug, Clone, Copy)]
enum What {
    Ask(usize),
    Done(usize),
}

#[derive(Debug, Default)]
struct Worker {
    /// Its batch, with the time of the batch.
    running: Option<(Duration, Vec<Finished>)>,
    /// The scheduler does not know that it is idle.
    is_hidden: bool,
    /// The scheduler knows that it is idle, and has given it no batch since.
    is_idle: bool,
}

#[derive(Debug)]
struct Request {
    caller: usize,
    arrived: Duration,
    open: usize,
}

/// Figures of a run.
#[derive(Debug, Default)]
struct Figures {
    /// Times until calls were answered, ms.
    calls_ms: Vec<f64>,
    /// Times until plans were ready, ms.
    plans_ms: Vec<f64>,
    characters: usize,
    superseded: usize,
    refused: usize,
}

struct Simulation {
    scheduler: Scheduler,
    model: Model,
    /// If not set, the scheduler knows of one idle worker at a time, which takes all that fits.
    shares: bool,
    callers: Vec<Caller>,
    workers: Vec<Worker>,
    events: BTreeMap<(Duration, u64), What>,
    requests: HashMap<RequestId, Request>,
    start: Instant,
    now: Duration,
    next: u64,
    figures: Figures,
}

impl Simulation {
    fn new(limits: Limits, model: Model, shares: bool, callers: Vec<Caller>) -> Self {
        let mut simulation = Self {
            scheduler: Scheduler::new(limits),
            model,
            shares,
            workers: (0..WORKERS).map(|_| Worker::default()).collect(),
            events: BTreeMap::new(),
            requests: HashMap::new(),
            start: Instant::now(),
            now: Duration::ZERO,
            next: 0,
            figures: Figures::default(),
            callers,
        };
        let trial = Event::Tried {
            work: TRIAL as u64,
            took: simulation.batch_time(TRIAL),
        };
        simulation.step(trial);
        for worker in 0..WORKERS {
            simulation.boundary(worker, None, &[]);
        }
        let callers = simulation.callers.len();
        for caller in 0..callers {
            // Plans are spread over their time, calls over the first 10 ms.
            let time = match simulation.callers[caller] {
                Caller::Lives(period) => period,
                Caller::Calls(_) | Caller::Once(_) => MS * 10,
            };
            simulation.at(time * caller as u32 / callers as u32, What::Ask(caller));
        }
        simulation
    }

    fn run(mut self, until: Duration) -> Figures {
        while let Some(((at, _), what)) = self.events.pop_first()
            && at < until
        {
            self.now = at;
            match what {
                What::Ask(caller) => self.ask(caller),
                What::Done(worker) => self.done(worker),
            }
        }
        self.figures
    }

    fn at(&mut self, time: Duration, what: What) {
        self.next += 1;
        self.events.insert((time, self.next), what);
    }

    fn ask(&mut self, caller: usize) {
        let now = self.start + self.now;
        let (characters, order) = match self.callers[caller] {
            Caller::Calls(characters) | Caller::Once(characters) => (characters, Order::request(now)),
            Caller::Lives(period) => {
                self.at(self.now + period, What::Ask(caller));
                (1, Order::live(OwnerId(caller as u64), now + LOOK_AHEAD))
            }
        };
        self.next += 1;
        let request = RequestId(self.next);
        let asked = Request {
            caller,
            arrived: self.now,
            open: characters,
        };
        self.requests.insert(request, asked);
        self.step(Event::Arrived {
            request,
            characters,
            order,
        });
    }

    fn done(&mut self, worker: usize) {
        let Some((took, finished)) = self.workers[worker].running.take() else {
            return;
        };
        for done in &finished {
            self.answer(*done);
        }
        self.boundary(worker, Some(took), &finished);
    }

    fn answer(&mut self, done: Finished) {
        let is_measured = self.now >= WARM_UP;
        let Some(request) = self.requests.get_mut(&done.request) else {
            return;
        };
        request.open -= done.characters;
        let (caller, took, is_over) = (request.caller, self.now - request.arrived, request.open == 0);
        let figures = &mut self.figures;
        match self.callers[caller] {
            Caller::Calls(_) if is_measured => figures.characters += done.characters,
            _ => {}
        }
        if !is_over {
            return;
        }
        self.requests.remove(&done.request);
        match self.callers[caller] {
            Caller::Once(_) => figures.calls_ms.push(ms(took)),
            Caller::Calls(_) => {
                if is_measured {
                    figures.calls_ms.push(ms(took));
                }
                self.at(self.now, What::Ask(caller));
            }
            Caller::Lives(_) if is_measured => figures.plans_ms.push(ms(took)),
            Caller::Lives(_) => {}
        }
    }

    /// A worker is between two batches.
    fn boundary(&mut self, worker: usize, took: Option<Duration>, finished: &[Finished]) {
        let is_hidden = !self.shares && self.workers.iter().any(|worker| worker.is_idle);
        self.workers[worker].is_hidden = is_hidden;
        self.workers[worker].is_idle = !is_hidden;
        self.step(Event::Ready(Ready {
            worker,
            room: if is_hidden { 0 } else { usize::MAX },
            is_idle: !is_hidden,
            took,
            finished,
        }));
    }

    fn step(&mut self, event: Event<'_>) {
        let mut actions = Vec::new();
        self.scheduler.step(self.start + self.now, event, &mut actions);
        for action in actions {
            match action {
                Action::Start(batch) => self.begin(&batch),
                Action::Wake { worker } => {
                    self.workers[worker].is_idle = false;
                    self.boundary(worker, None, &[]);
                }
                Action::Supersede { request } => {
                    self.requests.remove(&request);
                    self.figures.superseded += 1;
                }
                Action::Refuse { request, refusal } | Action::PushOut { request, refusal } => {
                    self.figures.refused += 1;
                    if let Some(Request { caller, .. }) = self.requests.remove(&request)
                        && let Caller::Calls(_) = self.callers[caller]
                    {
                        self.at(self.now + refusal.retry_after(), What::Ask(caller));
                    }
                }
                // No caller leaves, and no request expires.
                Action::Expire { .. } | Action::Drop { .. } => {}
            }
        }
        let hidden = self.workers.iter().position(|worker| worker.is_hidden);
        if let Some(hidden) = hidden
            && !self.workers.iter().any(|worker| worker.is_idle)
        {
            self.boundary(hidden, None, &[]);
        }
    }

    fn batch_time(&self, characters: usize) -> Duration {
        let model_ms = match self.model {
            Model::Linear(character_ms) => BATCH_MS + character_ms * characters as f64,
            Model::Calls => {
                let (mut left, mut sum_ms) = (characters, 0.0);
                while let Some(rows) = CALLS.into_iter().find(|&rows| rows <= left) {
                    left -= rows;
                    sum_ms += CALL_MS + ROW_MS * rows as f64;
                }
                sum_ms
            }
        };
        MS.mul_f64(model_ms)
    }

    fn begin(&mut self, batch: &Batch) {
        let finished: Vec<Finished> = batch
            .slices
            .iter()
            .map(|part| Finished {
                request: part.request,
                characters: part.characters,
            })
            .collect();
        let characters: usize = finished.iter().map(|done| done.characters).sum();
        let took = self.batch_time(characters);
        let worker = &mut self.workers[batch.worker];
        worker.is_idle = false;
        worker.running = Some((took, finished));
        self.at(self.now + took, What::Done(batch.worker));
    }
}

fn limits() -> Limits {
    Limits {
        workers: WORKERS,
        ..Limits::default()
    }
}

/// Median and 99th percentile.
fn median_and_p99(times_ms: &[f64]) -> [f64; 2] {
    [0.5, 0.99].map(|share| percentile(times_ms, share))
}

fn lone_requests() {
    println!("## A lone request: time until it is done, ms\n");
    println!("| characters | shared | one worker takes all | saved |");
    println!("|--:|--:|--:|--:|");
    for characters in [1, 2, 4, 8, 16, 32] {
        let [shared, alone] = [true, false].map(|shares| {
            let simulation = Simulation::new(
                limits(),
                Model::Linear(FAST_MS),
                shares,
                vec![Caller::Once(characters)],
            );
            simulation.run(MEASURED).calls_ms[0]
        });
        let saved = 100.0 * (1.0 - shared / alone);
        println!("| {characters} | {shared:.1} | {alone:.1} | {saved:.0} % |");
    }
}

fn closed_loops() {
    println!("\n## Callers that ask again at once: characters/s, median and p99 in ms\n");
    println!(
        "| callers | characters each | shared: characters/s | median | p99 | not: characters/s | median | p99 |"
    );
    println!("|--:|--:|--:|--:|--:|--:|--:|--:|");
    for characters in [1, 8] {
        for callers in [1, 2, 4, 8, 16, 32, 64] {
            let mut row = format!("| {callers} | {characters} |");
            for shares in [true, false] {
                let callers = vec![Caller::Calls(characters); callers];
                let figures = Simulation::new(limits(), Model::Linear(FAST_MS), shares, callers)
                    .run(WARM_UP + MEASURED);
                let rate = figures.characters as f64 / MEASURED.as_secs_f64();
                let [median, p99] = median_and_p99(&figures.calls_ms);
                row += &format!(" {rate:.0} | {median:.1} | {p99:.1} |");
            }
            println!("{row}");
        }
    }
}

fn whole_calls() {
    println!("\n## Whole calls, in batches of up to 16: characters/s, median and p99 in ms\n");
    println!("| callers | whole calls: characters/s | median | p99 | not: characters/s | median | p99 |");
    println!("|--:|--:|--:|--:|--:|--:|--:|");
    for callers in [4, 8, 12, 16, 24, 32, 48, 64] {
        let mut row = format!("| {callers} |");
        for call_rows in [CALLS[0], 0] {
            let limits = Limits {
                max_batch: 16,
                call_rows,
                ..limits()
            };
            let callers = vec![Caller::Calls(1); callers];
            let figures = Simulation::new(limits, Model::Calls, true, callers).run(WARM_UP + MEASURED);
            let rate = figures.characters as f64 / MEASURED.as_secs_f64();
            let [median, p99] = median_and_p99(&figures.calls_ms);
            row += &format!(" {rate:.0} | {median:.1} | {p99:.1} |");
        }
        println!("{row}");
    }
}

fn time_cap() {
    println!(
        "\n## Cap of a batch by time: 16 live characters with a plan each 2 s, beside callers, slow model\n"
    );
    println!("Refused callers try again after the time that the scheduler gives.\n");
    println!(
        "| callers | characters each | max_batch_time, ms | plans: median, ms | p99, ms | replaced | calls: \
         characters/s | p99, ms | refused |"
    );
    println!("|--:|--:|--:|--:|--:|--:|--:|--:|--:|");
    for (calls, characters) in [(0, 0), (1, 16), (4, 16), (16, 4), (4, 64)] {
        for max_batch_time in [Limits::default().max_batch_time, Duration::ZERO] {
            let live = std::iter::repeat_n(Caller::Lives(Duration::from_secs(2)), 16);
            let callers = live.chain(std::iter::repeat_n(Caller::Calls(characters), calls));
            let limits = Limits {
                max_batch_time,
                ..limits()
            };
            let simulation = Simulation::new(limits, Model::Linear(SLOW_MS), true, callers.collect());
            let figures = simulation.run(WARM_UP + MEASURED);
            let [median, p99] = median_and_p99(&figures.plans_ms);
            let cap = match max_batch_time {
                Duration::ZERO => "none".to_owned(),
                time => time.as_millis().to_string(),
            };
            let rate = figures.characters as f64 / MEASURED.as_secs_f64();
            let calls_p99 = percentile(&figures.calls_ms, 0.99);
            println!(
                "| {calls} | {characters} | {cap} | {median:.1} | {p99:.1} | {} | {rate:.1} | {calls_p99:.1} | {} |",
                figures.superseded, figures.refused
            );
        }
    }
}

pub(crate) fn run() {
    println!(
        "{WORKERS} workers; a batch takes {BATCH_MS} ms + {FAST_MS} ms a character; slow model: {SLOW_MS} ms a character.\nA \
         call of n rows takes {CALL_MS} ms + {ROW_MS} ms a row.\n"
    );
    lone_requests();
    closed_loops();
    whole_calls();
    time_cap();
}
