//! The scheduler against a model that keeps everything in one list and looks through it.

use proptest::prelude::*;
use troupe_base::turns::ClientId;

use self::model::{Fate, Model, State};
use super::*;
use crate::order::OwnerId;

#[path = "scheduler_model.rs"]
mod model;

const MS: Duration = Duration::from_millis(1);

#[derive(Debug, Clone)]
enum Step {
    Arrive {
        characters: usize,
        owner: Option<u64>,
        deadline_ms: u64,
        expires_ms: Option<u64>,
        client: (u64, u64),
        work: u32,
    },
    /// The n-th request that ever arrived (modulo their number) goes away.
    Leave(usize),
    /// The n-th worker that has jobs (modulo their number) has done a step, which finishes so much
    /// of each request (modulo what it has, and one).
    Finish(usize, usize, u64),
    /// The n-th worker that is woken (modulo their number) says that it is ready.
    Answer(usize),
    /// The n-th worker that is idle or woken (modulo their number) looks for work by itself.
    Look(usize),
    /// The n-th worker is lost, unless it is the last.
    Lose(usize),
    Pass(u64),
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    let arrive = (
        1usize..12,
        prop::option::of(0u64..5),
        0u64..300,
        prop::option::weighted(0.2, 0u64..200),
        (0u64..3, 0u64..3),
        1u32..4,
    );
    let arrive = arrive.prop_map(
        |(characters, owner, deadline_ms, expires_ms, client, work)| Step::Arrive {
            characters: if owner.is_some() {
                characters % 3 + 1
            } else {
                characters
            },
            owner,
            deadline_ms,
            expires_ms,
            // The plans of a session come from one client.
            client: owner.map_or(client, |owner| (owner % 2, owner)),
            work,
        },
    );
    let finish = (any::<usize>(), any::<usize>(), 0u64..30);
    let step = prop_oneof![
        8 => arrive,
        2 => any::<usize>().prop_map(Step::Leave),
        8 => finish.prop_map(|(worker, share, ms)| Step::Finish(worker, share, ms)),
        6 => any::<usize>().prop_map(Step::Answer),
        1 => any::<usize>().prop_map(Step::Look),
        1 => any::<usize>().prop_map(Step::Lose),
        5 => (0u64..80).prop_map(Step::Pass),
    ];
    prop::collection::vec(step, 1..150)
}

fn some_limits() -> impl Strategy<Value = Limits> {
    let ms = || prop_oneof![Just(0u64), 1u64..200];
    let call_rows = prop_oneof![Just(0usize), 1usize..10];
    (
        1usize..5,
        1usize..20,
        call_rows,
        0usize..40,
        0u64..400,
        (ms(), prop_oneof![Just(0u64), 1u64..20]),
        ms(),
        0usize..6,
    )
        .prop_map(
            |(
                workers,
                max_batch,
                call_rows,
                spare,
                ageing_ms,
                (batch_ms, shared_ms),
                wait_ms,
                call_share,
            )| Limits {
                workers,
                max_batch,
                call_rows,
                max_batch_time: Duration::from_millis(batch_ms),
                calls_batch_time: Duration::from_millis(batch_ms * 3),
                shared_batch_time: Duration::from_millis(shared_ms),
                max_queued: 12 + spare,
                max_live: 3 + spare,
                max_wait: Duration::from_millis(wait_ms),
                ageing: Duration::from_millis(ageing_ms),
                call_share,
            },
        )
}

/// A scheduler and its model, side by side.
struct Pair {
    scheduler: Scheduler,
    model: Model,
    arrivals: u64,
    woken: Vec<usize>,
}

impl Pair {
    fn new(limits: Limits, slots: usize) -> Self {
        let mut pair = Self {
            scheduler: Scheduler::new(limits),
            model: Model::new(limits, slots),
            arrivals: 0,
            woken: Vec::new(),
        };
        for worker in 0..limits.workers {
            pair.boundary(worker, None, &[]);
        }
        pair
    }

    /// Tells an event; keeps who is woken apart.
    fn step(&mut self, event: Event<'_>) -> Vec<Action> {
        let mut actions = Vec::new();
        self.scheduler.step(self.model.now, event, &mut actions);
        actions.retain(|action| match action {
            Action::Wake { worker } => {
                self.woken.push(*worker);
                false
            }
            _ => true,
        });
        actions
    }

    fn boundary(&mut self, worker: usize, took: Option<Duration>, finished: &[Finished]) {
        self.model.finish(worker, finished);
        self.model.measure(took, finished);
        let actions = self.step(Event::Ready(Ready {
            worker,
            room: self.model.room(worker),
            is_idle: self.model.workers[worker].held.is_empty(),
            took,
            finished,
        }));
        let mut expected = Vec::new();
        for cap in self.model.work_caps() {
            let mut model = self.model.clone();
            expected = model.boundary(worker, took, cap);
            if expected == actions {
                self.model = model;
                return;
            }
        }
        assert_eq!(actions, expected);
    }

    fn leave(&mut self, request: RequestId) {
        let woken = self.woken.len();
        let actions = self.step(Event::Gone { request });
        assert_eq!(self.woken.len(), woken, "a request that leaves wakes no worker");
        self.model.leave(request, &actions);
    }

    /// The n-th of the workers that one of the states fits.
    fn nth(&self, nth: usize, states: &[State]) -> Option<usize> {
        let workers = self.model.workers_in(states);
        workers.get(nth % workers.len().max(1)).copied()
    }

    fn take(&mut self, step: Step) {
        match step {
            Step::Arrive {
                characters,
                owner,
                deadline_ms,
                expires_ms,
                client: (group, own),
                work,
            } => {
                self.arrivals += 1;
                let request = RequestId(self.arrivals);
                let after = |ms| self.model.now + Duration::from_millis(ms);
                let order = match owner {
                    Some(owner) => Order::live(OwnerId(owner), after(deadline_ms)),
                    None => Order::request(after(deadline_ms)),
                };
                let order = Order {
                    expires: expires_ms.map(after),
                    client: ClientId {
                        group,
                        own,
                        // Groups have different shares, which never change.
                        share: group as u32 + 1,
                    },
                    work,
                    ..order
                };
                let refusal = self.scheduler.refuse(&order, characters);
                let part = self.scheduler.within(self.scheduler.limits.shared_batch_time);
                let actions = self.step(Event::Arrived {
                    request,
                    characters,
                    order,
                });
                if order.class == Class::Request {
                    let is_refused = matches!(actions[..], [Action::Refuse { .. }]);
                    assert_eq!(is_refused, refusal.is_some());
                    if let Some(refusal) = refusal {
                        assert_eq!(actions, [Action::Refuse { request, refusal }]);
                    }
                }
                self.model.arrive(request, characters, order, (part, &actions));
            }
            Step::Leave(nth) => self.leave(RequestId(1 + nth as u64 % self.arrivals.max(1))),
            Step::Finish(nth, share, ms) => {
                if let Some(worker) = self.nth(nth, &[State::Busy]) {
                    let held = self.model.workers[worker].held.clone();
                    let part = |held: Finished| Finished {
                        characters: share % (held.characters + 1),
                        ..held
                    };
                    let mut finished: Vec<Finished> = held.into_iter().map(part).collect();
                    finished.retain(|done| done.characters > 0);
                    self.boundary(worker, Some(Duration::from_millis(ms)), &finished);
                }
            }
            Step::Answer(nth) => {
                if let Some(worker) = self.nth(nth, &[State::Woken]) {
                    self.boundary(worker, None, &[]);
                }
            }
            Step::Look(nth) => {
                if let Some(worker) = self.nth(nth, &[State::Idle, State::Woken]) {
                    self.boundary(worker, None, &[]);
                }
            }
            Step::Lose(nth) => {
                let alive = self.model.workers_in(&[State::Busy, State::Idle, State::Woken]);
                if alive.len() > 1 {
                    self.lose(alive[nth % alive.len()]);
                }
            }
            Step::Pass(ms) => self.model.now += Duration::from_millis(ms),
        }
        let woken = std::mem::take(&mut self.woken);
        self.model.wake(&woken);
        self.model.check_owners();
        let pending = Class::ALL.map(|class| self.model.pending(class));
        assert_eq!(self.scheduler.pending_characters(), pending.iter().sum::<usize>());
        for worker in 0..self.model.workers.len() {
            let is_busy = self.model.workers[worker].state == State::Busy;
            assert_eq!(self.scheduler.is_busy(worker), is_busy);
        }
    }

    /// What a worker has fails when it is lost.
    fn lose(&mut self, worker: usize) {
        let finished = self.model.workers[worker].held.clone();
        self.model.workers[worker].state = State::Lost;
        for part in &finished {
            self.leave(part.request);
        }
        self.model.finish(worker, &finished);
        let lost = Event::WorkerLost {
            worker,
            finished: &finished,
        };
        assert_eq!(self.step(lost), []);
    }
}

proptest! {
    #[test]
    fn it_does_what_the_model_does(limits in some_limits(), slots in 1usize..20, steps in steps()) {
        let mut pair = Pair::new(limits, slots);
        for step in steps {
            pair.take(step);
        }
        // All that was admitted is served in the end, and all that was taken is finished.
        for round in 0..10_000 {
            if pair.scheduler.pending_requests() == 0 && pair.model.workers_in(&[State::Busy]).is_empty() {
                break;
            }
            pair.take(Step::Answer(0));
            let worker = round % limits.workers;
            let held = pair.model.workers[worker].held.clone();
            if !held.is_empty() {
                pair.boundary(worker, Some(MS * 5), &held);
            }
            pair.take(Step::Pass(1));
        }
        let open = pair.model.requests.values().filter(|known| known.fate == Fate::Open);
        prop_assert_eq!(open.count(), 0, "a request was lost");
        prop_assert_eq!(pair.model.workers_in(&[State::Busy]), Vec::<usize>::new());
        prop_assert_eq!(pair.scheduler.pending_requests(), 0);
    }

    #[test]
    fn no_order_of_events_panics(
        limits in some_limits(),
        events in prop::collection::vec((0usize..7, 0usize..6, 0u64..20), 1..200),
    ) {
        let (mut scheduler, mut actions) = (Scheduler::new(limits), Vec::new());
        let mut now = Instant::now();
        for (next, (kind, worker, number)) in events.into_iter().enumerate() {
            let characters = number as usize;
            let finished = [Finished { request: RequestId(number * 7), characters }];
            let event = match kind {
                0 | 1 => Event::Arrived {
                    request: RequestId(next as u64),
                    characters: 1 + characters,
                    order: match kind {
                        0 => Order::request(now),
                        _ => Order::live(OwnerId(number % 3), now),
                    },
                },
                2 => Event::Gone { request: RequestId(number * 7) },
                3 if number == 0 => Event::WorkerLost { worker, finished: &finished },
                4 => Event::Tried { work: number, took: Duration::from_millis(number) },
                _ => Event::Ready(Ready {
                    worker,
                    room: characters,
                    is_idle: kind == 5,
                    took: (number % 3 == 0).then(|| Duration::from_millis(number)),
                    finished: &finished,
                }),
            };
            scheduler.step(now, event, &mut actions);
            for action in actions.drain(..) {
                if let Action::Start(batch) = action {
                    let size: usize = batch.slices.iter().map(|slice| slice.characters).sum();
                    prop_assert!((1..=limits.max_batch).contains(&size));
                    prop_assert!(batch.worker < limits.workers);
                }
            }
            // Clocks may jump back between threads by a little.
            now = if number % 2 == 0 { now + Duration::from_millis(number) } else { now - Duration::from_millis(1) };
        }
    }
}
