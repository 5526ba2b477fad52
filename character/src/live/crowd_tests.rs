//! A model of the whole loop: characters' timelines, an engine of a given speed, the load and the
//! budget.

use std::collections::HashSet;
use std::sync::Arc;
use std::time::{Duration, Instant};

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use troupe_motion::{Quat, Vec3};

use super::{Pace, dims, stretch};
use crate::live::load::{ClientLoad, PlanLoad};
use crate::live::policy::Policy;
use crate::live::testing::still_buffer;
use crate::live::timeline::{Barrier, Stop, Ticket, Timeline};
use crate::live::{Clock, LivePlan, PlanTrace, SUB_FRAMES};

/// Frames a second of all timelines.
const FPS: u64 = 30;
/// Step of the simulated time, milliseconds.
const STEP: u64 = 1;

/// An engine with two workers.
#[derive(Debug, Clone, Copy)]
struct Engine {
    /// Plans a second of 34 and of 64 frames, in large batches.
    plans: (f32, f32),
    /// Fixed time of a batch, without its plans, milliseconds.
    batch_ms: f32,
}

const WORKERS: usize = 2;
/// Plans of a batch: about 70 ms of a worker's time.
const MAX_BATCH: usize = 16;
/// What two cores do with 32-bit floats, and with bf16.
const F32: Engine = Engine {
    plans: (450.0, 300.0),
    batch_ms: 3.3,
};
const BF16: Engine = Engine {
    plans: (820.0, 600.0),
    batch_ms: 5.0,
};

impl Engine {
    fn plan_ms(&self, frames: usize) -> f32 {
        let of = |plans: f32| 1000.0 * WORKERS as f32 / plans - self.batch_ms / MAX_BATCH as f32;
        let (usual, long) = (of(self.plans.0), of(self.plans.1));
        usual + (long - usual) * (frames.div_ceil(4) as f32 - 9.0) / 7.0
    }

    /// Most characters that it can keep moving with its longest plans and a command every
    /// `commands_every_s` seconds. Each command costs a plan ahead of time.
    fn limit(&self, commands_every_s: f32) -> usize {
        let lasts_s = 54.0 / FPS as f32;
        let plans_a_second = 1.0 / commands_every_s / (1.0 - (-lasts_s / commands_every_s).exp());
        (self.plans.1 / plans_a_second) as usize
    }
}

struct Plan {
    who: usize,
    ticket: Ticket,
    frames: usize,
    due_ms: u64,
    asked_ms: u64,
}

struct Somebody {
    timeline: Timeline,
    priority: f32,
    phase: u64,
    /// Mean time between a character's commands, seconds.
    commands_every_s: f32,
    present: bool,
}

struct Crowd {
    engine: Engine,
    start: Instant,
    now_ms: u64,
    people: Vec<Somebody>,
    queue: Vec<Plan>,
    workers: [Option<(u64, f32, Vec<Plan>)>; WORKERS],
    pack: Arc<PlanLoad>,
    load: Arc<ClientLoad>,
    random: ChaCha8Rng,
    busy_ms: f32,
    pressures: Vec<f32>,
    /// Intervals between plans: time in milliseconds, priority, and length in frames.
    intervals: Vec<(u64, f32, i64)>,
}

fn somebody(seed: u64, priority: f32, commands_every_s: f32) -> Somebody {
    Somebody {
        timeline: Timeline::new(still_buffer(), 4, seed),
        priority,
        phase: seed,
        commands_every_s,
        present: true,
    }
}

impl Crowd {
    /// A crowd with one character for each of `priorities`; each has a command every
    /// `commands_every_s` seconds.
    fn new(engine: Engine, priorities: impl Iterator<Item = f32>, commands_every_s: f32) -> Self {
        let pack: Arc<PlanLoad> = Arc::default();
        Self {
            engine,
            start: Instant::now(),
            now_ms: 0,
            people: priorities
                .zip(0..)
                .map(|(p, seed)| somebody(seed, p, commands_every_s))
                .collect(),
            queue: Vec::new(),
            workers: [const { None }; WORKERS],
            load: pack.of(1),
            pack,
            random: ChaCha8Rng::seed_from_u64(1),
            busy_ms: 0.0,
            pressures: Vec::new(),
            intervals: Vec::new(),
        }
    }

    fn run(&mut self, seconds: u64) -> &mut Self {
        let end = self.now_ms + seconds * 1000;
        while self.now_ms < end {
            if self.now_ms * FPS % 1000 < STEP * FPS {
                self.tick();
            }
            self.serve();
            self.now_ms += STEP;
        }
        self
    }

    fn tick(&mut self) {
        let now = self.start + Duration::from_millis(self.now_ms);
        self.pack.read(now, WORKERS);
        self.load.read(now, WORKERS);
        self.pressures.push(self.load.pressure());
        let (dims, fps) = (dims(), FPS as f32);
        for who in 0..self.people.len() {
            let of = &mut self.people[who];
            if !of.present {
                continue;
            }
            if self.random.random::<f32>() < 1.0 / (of.commands_every_s * fps) {
                of.timeline.command_changed();
            }
            of.timeline.expect(
                self.load.expected_frames(WORKERS, fps),
                self.load.lead_frames(fps),
            );
            let pace = Pace::new(
                stretch(self.load.pressure(), of.priority),
                Some(9),
                of.phase,
                &dims,
                fps,
            );
            let policy = Policy {
                interval_frames: Some(9),
                pace,
                unfinished: false,
            };
            of.timeline.push(SUB_FRAMES);
            while let Stop::AtFrame(_) = of.timeline.run(Clock::Runs, Barrier::default()) {
                let Some(ticket) = of.timeline.settle(Clock::Runs, policy) else {
                    continue;
                };
                let due = (ticket.due - ticket.asked_at) as u64;
                if let Some(spacing) = ticket.spacing {
                    self.intervals.push((self.now_ms, of.priority, spacing));
                }
                let mut plan = Plan {
                    who,
                    ticket,
                    frames: pace.map_or(34, |pace| pace.plan_frames as usize),
                    due_ms: self.now_ms + due * 1000 / FPS,
                    asked_ms: self.now_ms,
                };
                // A newer plan replaces one that waits.
                if let Some(place) = self.queue.iter().position(|plan| plan.who == who) {
                    let old = self.queue.swap_remove(place);
                    plan.due_ms = plan.due_ms.min(old.due_ms);
                    of.timeline.fail(old.ticket.number);
                    self.load.answered();
                }
                self.load.asked();
                self.queue.push(plan);
            }
        }
    }

    fn serve(&mut self) {
        for worker in 0..WORKERS {
            if self.workers[worker]
                .as_ref()
                .is_some_and(|(end, ..)| *end <= self.now_ms)
                && let Some((_, took_ms, plans)) = self.workers[worker].take()
            {
                self.land(took_ms, plans);
            }
        }
        let idle = self.workers.iter().filter(|worker| worker.is_none()).count();
        if idle == 0 || self.queue.is_empty() {
            return;
        }
        // A character has at most one plan with the engine.
        let here = self.workers.iter().flatten().flat_map(|(_, _, plans)| plans);
        let here: HashSet<usize> = here.map(|plan| plan.who).collect();
        let (held, mut ready): (Vec<Plan>, _) =
            self.queue.drain(..).partition(|plan| here.contains(&plan.who));
        // The last in the list goes first.
        ready.sort_by_key(|plan| std::cmp::Reverse((plan.due_ms, plan.asked_ms)));
        let share = ready.len().div_ceil(idle).min(MAX_BATCH);
        for worker in &mut self.workers {
            if worker.is_none() && !ready.is_empty() {
                let plans = ready.split_off(ready.len().saturating_sub(share));
                let took_ms = self.engine.batch_ms
                    + plans
                        .iter()
                        .map(|plan| self.engine.plan_ms(plan.frames))
                        .sum::<f32>();
                self.busy_ms += took_ms;
                *worker = Some((self.now_ms + took_ms.round() as u64, took_ms, plans));
            }
        }
        self.queue = ready;
        self.queue.extend(held);
    }

    fn land(&mut self, took_ms: f32, plans: Vec<Plan>) {
        let work = Duration::from_secs_f32(took_ms / 1000.0) / plans.len().max(1) as u32;
        for plan in plans {
            self.load
                .measured(Duration::from_millis(self.now_ms - plan.asked_ms), work);
            self.load.answered();
            let timeline = &mut self.people[plan.who].timeline;
            let live = LivePlan {
                feet_glide: false,
                roots: vec![Vec3::ZERO; plan.frames],
                rotations: vec![Quat::IDENTITY; plan.frames],
                contacts: vec![0; plan.frames],
                trace: PlanTrace::default(),
            };
            timeline.land(plan.ticket.number, &live);
        }
    }

    fn underruns(&self) -> u64 {
        self.people.iter().map(|of| of.timeline.stats().underruns).sum()
    }

    fn late(&self) -> u64 {
        self.people.iter().map(|of| of.timeline.stats().late_plans).sum()
    }

    /// Mean interval of the characters in a range of priorities, in the last `seconds`, frames.
    fn interval(&self, priorities: std::ops::RangeInclusive<f32>, seconds: u64) -> f32 {
        let since = self.now_ms.saturating_sub(seconds * 1000);
        let these = self
            .intervals
            .iter()
            .filter(|(at, priority, _)| *at >= since && priorities.contains(priority));
        let (count, sum) = these.fold((0, 0), |(count, sum), (_, _, frames)| (count + 1, sum + frames));
        sum as f32 / count.max(1) as f32
    }

    /// Lowest and highest pressure of the last `seconds`.
    fn pressure(&self, seconds: u64) -> (f32, f32) {
        let ticks = (seconds * FPS) as usize;
        let last = &self.pressures[self.pressures.len().saturating_sub(ticks)..];
        last.iter()
            .fold((f32::MAX, 0.0), |(least, most), &p| (p.min(least), p.max(most)))
    }
}

fn mixed(count: usize) -> impl Iterator<Item = f32> {
    (0..count).map(move |nth| (nth as f32 * 0.618_034).fract())
}

/// Figures of the last seconds of a run.
#[derive(Debug)]
#[allow(dead_code)] // Some of it is for whoever reads a failure.
struct Report {
    count: usize,
    underruns: u64,
    late: u64,
    pressure: (f32, f32),
    /// Mean intervals of the thirds by priority, frames.
    intervals: [f32; 3],
    plans_a_second: f32,
    busy: f32,
}

impl Crowd {
    fn report(&mut self, seconds: u64) -> Report {
        let (underruns, late, busy) = (self.underruns(), self.late(), self.busy_ms);
        self.run(seconds);
        let since = self.now_ms - seconds * 1000;
        let plans = self.intervals.iter().filter(|(at, ..)| *at >= since).count();
        Report {
            count: self.people.len(),
            underruns: self.underruns() - underruns,
            late: self.late() - late,
            pressure: self.pressure(seconds),
            intervals: [0.0..=0.333, 0.333..=0.667, 0.667..=1.0].map(|band| self.interval(band, seconds)),
            plans_a_second: plans as f32 / seconds as f32,
            busy: (self.busy_ms - busy) / (seconds * 1000 * WORKERS as u64) as f32,
        }
    }
}

#[test]
fn small_crowds_are_planned_for_as_usual() {
    for (engine, count) in [(F32, 50), (F32, 100), (BF16, 150)] {
        let report = Crowd::new(engine, mixed(count), 2.5).report(15);
        assert_eq!((report.pressure, report.underruns), ((0.0, 0.0), 0), "{report:?}");
        assert!(
            report.intervals.iter().all(|&interval| interval < 9.5),
            "{report:?}"
        );
    }
}

#[test]
fn up_to_the_engines_limit_everybody_moves() {
    let mut before = 0.0;
    for (engine, count) in [(F32, 200), (F32, 300), (F32, 360), (BF16, 600), (BF16, 720)] {
        assert!(count < engine.limit(2.5), "{}", engine.limit(2.5));
        let mut crowd = Crowd::new(engine, mixed(count), 2.5);
        let start = crowd.report(15);
        let report = crowd.report(10);
        assert_eq!(
            (start.underruns, report.underruns),
            (0, 0),
            "{start:?} {report:?}"
        );
        assert!(
            report.late as f32 <= 0.002 * report.plans_a_second * 10.0,
            "{report:?}"
        );
        // The engine is never idle, and the pressure is steady.
        assert!(report.busy > 0.95, "{report:?}");
        let (least, most) = report.pressure;
        assert!(most - least < 0.12, "{report:?}");
        // More characters mean more pressure; higher priority means shorter intervals.
        if engine.plans == F32.plans {
            assert!(least > before, "{report:?}");
            before = least;
        }
        let [low, middle, high] = report.intervals;
        assert!(high <= middle + 0.5 && middle <= low + 0.5, "{report:?}");
        if most < 1.0 {
            assert!(high < 0.9 * low, "{report:?}");
        }
    }
}

#[test]
fn a_crowd_at_the_limit_of_the_engine_keeps_moving() {
    for (engine, count) in [(F32, 380), (BF16, 780)] {
        assert!(count as f32 > 0.97 * engine.limit(2.5) as f32);
        let mut crowd = Crowd::new(engine, mixed(count), 2.5);
        let report = crowd.run(15).report(10);
        assert_eq!(report.underruns, 0, "{report:?}");
    }
}

#[test]
fn four_hundred_plan_once_a_second_with_32_bit_floats() {
    let report = Crowd::new(F32, mixed(400), 20.0).run(10).report(10);
    assert_eq!(report.underruns, 0, "{report:?}");
    assert!(
        report.intervals.iter().all(|&interval| interval <= 31.0),
        "{report:?}"
    );
}

#[test]
fn equal_priorities_are_no_worse() {
    let alike = std::iter::repeat_n(0.5, 300);
    let mut crowd = Crowd::new(F32, alike, 2.5);
    let (start, report) = (crowd.report(15), crowd.report(10));
    assert_eq!(
        (start.underruns, report.underruns),
        (0, 0),
        "{start:?} {report:?}"
    );
    assert!(report.pressure.1 - report.pressure.0 < 0.12, "{report:?}");
}

#[test]
fn pressure_falls_within_seconds_when_the_crowd_leaves() {
    let mut crowd = Crowd::new(F32, mixed(400), 2.5);
    crowd.run(15);
    assert!(crowd.load.pressure() > 0.7);
    for of in &mut crowd.people[40..] {
        of.present = false;
    }
    let report = crowd.run(4).report(3);
    assert_eq!((report.pressure, report.underruns), ((0.0, 0.0), 0), "{report:?}");
    assert!(
        report.intervals.iter().all(|&interval| interval < 9.5),
        "{report:?}"
    );
}

#[test]
fn a_crowd_beyond_the_limit_slows_down_and_recovers() {
    let mut crowd = Crowd::new(F32, mixed(900), 2.5);
    let report = crowd.run(5).report(5);
    assert!(
        report.underruns > 0 && report.pressure == (2.0, 2.0),
        "{report:?}"
    );
    assert!(report.plans_a_second > 280.0, "no plan is wasted: {report:?}");
    assert!(crowd.queue.len() <= 900, "one plan each at most");
    for of in &mut crowd.people[300..] {
        of.present = false;
    }
    let report = crowd.run(4).report(5);
    assert_eq!(report.underruns, 0, "{report:?}");
}
