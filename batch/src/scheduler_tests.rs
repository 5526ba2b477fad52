use super::*;
use crate::order::OwnerId;

#[path = "scheduler_fair_tests.rs"]
mod fair;

const MS: Duration = Duration::from_millis(1);

fn limits(workers: usize, max_batch: usize) -> Limits {
    Limits {
        workers,
        max_batch,
        call_rows: 0,
        max_batch_time: Duration::ZERO,
        calls_batch_time: Duration::ZERO,
        shared_batch_time: Duration::ZERO,
        max_queued: 100,
        max_live: 100,
        max_wait: Duration::ZERO,
        ageing: Duration::from_secs(2),
        call_share: 0,
    }
}

/// A scheduler and its clock.
struct Setup {
    scheduler: Scheduler,
    start: Instant,
    now: Instant,
    next: u64,
    /// What each worker holds.
    held: Vec<Vec<Finished>>,
    woken: Vec<usize>,
    actions: Vec<Action>,
}

impl Setup {
    /// Workers that are idle.
    fn idle(limits: Limits) -> Self {
        let mut setup = Self::busy(limits);
        for worker in 0..limits.workers {
            assert_eq!(setup.ready(worker), []);
        }
        setup
    }

    /// Workers that have not reported yet.
    fn busy(limits: Limits) -> Self {
        let now = Instant::now();
        Self {
            scheduler: Scheduler::new(limits),
            start: now,
            now,
            next: 0,
            held: vec![Vec::new(); limits.workers],
            woken: Vec::new(),
            actions: Vec::new(),
        }
    }

    /// Characters of the least work turn out to take a millisecond each.
    fn take_a_ms_each(&mut self) {
        for _ in 0..200 {
            self.step(Event::Tried {
                work: 10,
                took: MS * 10,
            });
        }
    }

    fn pass(&mut self, ms: u32) {
        self.now += MS * ms;
    }

    fn at(&self, ms: u32) -> Instant {
        self.start + MS * ms
    }

    /// Tells an event; notes who is woken and gives the other actions.
    fn step(&mut self, event: Event<'_>) -> Vec<Action> {
        let mut actions = Vec::new();
        self.scheduler.step(self.now, event, &mut actions);
        actions.retain(|action| match action {
            Action::Wake { worker } => {
                self.woken.push(*worker);
                false
            }
            _ => true,
        });
        actions
    }

    fn arrive(&mut self, characters: usize, order: Order) -> (u64, Vec<Action>) {
        let request = self.next;
        self.next += 1;
        let arrived = Event::Arrived {
            request: RequestId(request),
            characters,
            order,
        };
        let actions = self.step(arrived);
        (request, actions)
    }

    /// A call that has a place.
    fn refuse(&self, characters: usize) -> Option<QueueRefusal> {
        self.scheduler.refuse(&Order::request(self.now), characters)
    }

    fn call(&mut self, characters: usize) -> u64 {
        let (request, actions) = self.arrive(characters, Order::request(self.now));
        assert_eq!(actions, []);
        request
    }

    /// A plan of an owner that is due so many milliseconds after the start.
    fn plan(&mut self, owner: u64, due_ms: u32) -> (u64, Vec<Action>) {
        let order = Order::live(OwnerId(owner), self.at(due_ms));
        self.arrive(1, order)
    }

    /// A worker of one step is ready again: all that it held is done. Gives the requests and
    /// characters that it takes.
    fn ready(&mut self, worker: usize) -> Vec<(u64, usize)> {
        let finished = std::mem::take(&mut self.held[worker]);
        let took = (!finished.is_empty()).then_some(MS);
        self.boundary(worker, usize::MAX, true, took, &finished)
    }

    /// A worker is lost, with all that it held.
    fn lose(&mut self, worker: usize) {
        let finished = self.held.get_mut(worker).map(std::mem::take).unwrap_or_default();
        let lost = Event::WorkerLost {
            worker,
            finished: &finished,
        };
        assert_eq!(self.step(lost), []);
    }

    /// A worker is between two steps.
    fn boundary(
        &mut self,
        worker: usize,
        room: usize,
        is_idle: bool,
        took: Option<Duration>,
        finished: &[Finished],
    ) -> Vec<(u64, usize)> {
        let actions = self.step(Event::Ready(Ready {
            worker,
            room,
            is_idle,
            took,
            finished,
        }));
        let mut taken = Vec::new();
        for action in actions {
            match action {
                Action::Start(batch) => {
                    assert_eq!(batch.worker, worker);
                    for slice in batch.slices {
                        taken.push((slice.request.0, slice.characters));
                        self.held[worker].push(Finished {
                            request: slice.request,
                            characters: slice.characters,
                        });
                    }
                }
                other => self.actions.push(other),
            }
        }
        taken
    }
}

#[test]
fn a_lone_request_wakes_one_worker_and_starts_at_once() {
    let mut setup = Setup::idle(limits(2, 8));
    let call = setup.call(1);
    assert_eq!(setup.woken, [0]);
    assert_eq!(setup.ready(0), [(call, 1)]);
    assert_eq!(setup.woken, [0], "one worker is enough");
}

#[test]
fn requests_that_wait_for_a_busy_worker_start_together() {
    let mut setup = Setup::idle(limits(1, 8));
    let first = setup.call(1);
    assert_eq!(setup.ready(0), [(first, 1)]);
    let waiting: Vec<u64> = (0..3).map(|_| setup.call(2)).collect();
    let taken = setup.ready(0);
    assert_eq!(taken, waiting.iter().map(|&call| (call, 2)).collect::<Vec<_>>());
    assert_eq!(setup.ready(0), []);
}

#[test]
fn a_large_request_is_split_and_shares_its_last_batch() {
    let mut setup = Setup::busy(limits(1, 4));
    let (large, small) = (setup.call(6), setup.call(1));
    assert_eq!(setup.ready(0), [(large, 4)]);
    assert_eq!(setup.ready(0), [(large, 2), (small, 1)]);
}

#[test]
fn idle_workers_share_waiting_work_evenly_and_are_woken_one_after_another() {
    let mut setup = Setup::idle(limits(3, 8));
    let call = setup.call(9);
    assert_eq!(setup.woken, [0], "one at a time");
    assert_eq!(setup.ready(0), [(call, 3)]);
    assert_eq!(setup.woken, [0, 1]);
    assert_eq!(setup.ready(1), [(call, 3)]);
    assert_eq!(setup.ready(2), [(call, 3)]);
    assert_eq!(setup.woken, [0, 1, 2]);
    // One that is busy gets no share.
    let call = setup.call(9);
    setup.held[0].clear();
    assert_eq!(setup.ready(2), [(call, 8)]);
    assert_eq!(setup.ready(1), [(call, 1)]);
}

#[test]
fn an_arrival_wakes_no_second_worker_before_the_first_has_reported() {
    let mut setup = Setup::idle(limits(2, 1));
    let (a, b) = (setup.call(1), setup.call(1));
    assert_eq!(setup.woken, [0]);
    assert_eq!(setup.ready(0), [(a, 1)]);
    assert_eq!(setup.woken, [0, 1], "what it left wakes the next");
    assert_eq!(setup.ready(1), [(b, 1)]);
}

#[test]
fn the_earliest_deadline_goes_first_and_calls_stay_behind_plans_until_they_age() {
    let mut setup = Setup::busy(limits(1, 1));
    let call = setup.call(1);
    let (late, _) = setup.plan(1, 1500);
    let (soon, _) = setup.plan(2, 300);
    setup.pass(100);
    // Due at 2,100, which is after the call's 2,000.
    let (after, _) = setup.plan(3, 2100);
    let order: Vec<u64> = (0..4).map(|_| setup.ready(0)[0].0).collect();
    assert_eq!(order, [soon, late, call, after]);
}

#[test]
fn calls_get_their_share_of_places_first() {
    let shared = |max_batch| Limits {
        call_share: 4,
        ..limits(1, max_batch)
    };
    // Of a batch.
    let mut setup = Setup::busy(shared(8));
    for owner in 0..20 {
        setup.plan(owner, 10 * owner as u32);
    }
    let call = setup.call(9);
    let of_call = |taken: &[(u64, usize)]| {
        let own = taken.iter().filter(|(request, _)| *request == call);
        own.map(|(_, characters)| *characters).sum::<usize>()
    };
    let counts: Vec<usize> = (0..3).map(|_| of_call(&setup.ready(0))).collect();
    assert_eq!(counts, [3, 2, 2], "a place is left over from before");
    // Of batches of one.
    let mut setup = Setup::busy(shared(1));
    for owner in 0..20 {
        setup.plan(owner, 10 * owner as u32);
    }
    let first = setup.call(1);
    let second = setup.call(1);
    let order: Vec<u64> = (0..5).map(|_| setup.ready(0)[0].0).collect();
    assert_eq!(order, [first, 0, 1, second, 2]);
}

#[test]
fn a_deadline_long_past_does_not_go_before_earlier_arrivals() {
    let mut setup = Setup::busy(limits(1, 1));
    let (first, _) = setup.plan(1, 0);
    setup.pass(50);
    let (second, _) = setup.plan(2, 10);
    assert_eq!(setup.ready(0), [(first, 1)]);
    assert_eq!(setup.ready(0), [(second, 1)]);
}

#[test]
fn a_newer_plan_replaces_the_waiting_one_and_keeps_its_place() {
    let mut setup = Setup::busy(limits(1, 1));
    let (old, _) = setup.plan(1, 100);
    let (other, _) = setup.plan(2, 200);
    let (new, actions) = setup.plan(1, 900);
    assert_eq!(
        actions,
        [Action::Supersede {
            request: RequestId(old)
        }]
    );
    assert_eq!(setup.ready(0), [(new, 1)]);
    assert_eq!(setup.ready(0), [(other, 1)]);
}

#[test]
fn an_owner_has_one_plan_with_a_worker_and_one_that_waits() {
    let mut setup = Setup::idle(limits(2, 4));
    let (running, _) = setup.plan(1, 100);
    assert_eq!(setup.ready(0), [(running, 1)]);
    let (waiting, _) = setup.plan(1, 150);
    assert_eq!(setup.ready(1), [], "the first one is not done");
    assert_eq!(setup.scheduler.pending_characters(), 1);
    let (newer, actions) = setup.plan(1, 200);
    let replaced = RequestId(waiting);
    assert_eq!(actions, [Action::Supersede { request: replaced }]);
    assert_eq!(setup.ready(0), [(newer, 1)]);
}

#[test]
fn a_plan_that_is_dropped_between_steps_lets_the_next_one_in() {
    let mut setup = Setup::idle(limits(1, 4));
    let (running, _) = setup.plan(1, 100);
    assert_eq!(setup.boundary(0, 4, true, None, &[]), [(running, 1)]);
    let (next, _) = setup.plan(1, 200);
    assert_eq!(
        setup.step(Event::Gone {
            request: RequestId(running)
        }),
        []
    );
    let dropped = [Finished {
        request: RequestId(running),
        characters: 1,
    }];
    assert_eq!(setup.boundary(0, 4, true, None, &dropped), [(next, 1)]);
}

#[test]
fn a_worker_of_several_steps_is_topped_up_between_them_and_goes_on_without_work() {
    let mut setup = Setup::idle(limits(1, 8));
    let a = setup.call(2);
    assert_eq!(setup.boundary(0, 3, true, None, &[]), [(a, 2)]);
    let b = setup.call(2);
    assert_eq!(setup.woken, [0], "a busy worker needs no waking");
    assert_eq!(
        setup.boundary(0, 1, false, Some(MS), &[]),
        [(b, 1)],
        "as far as it has room"
    );
    assert_eq!(setup.boundary(0, 0, false, Some(MS), &[]), []);
    let done = [Finished {
        request: RequestId(a),
        characters: 2,
    }];
    assert_eq!(setup.boundary(0, 2, false, Some(MS), &done), [(b, 1)]);
    assert_eq!(setup.boundary(0, 2, false, Some(MS), &[]), [], "it still has b");
    let c = setup.call(1);
    assert_eq!(setup.woken, [0]);
    assert_eq!(setup.boundary(0, 2, false, Some(MS), &[]), [(c, 1)]);
}

#[test]
fn a_full_queue_refuses_and_a_leaver_makes_room() {
    let mut setup = Setup::busy(Limits {
        max_queued: 3,
        ..limits(1, 8)
    });
    let call = setup.call(2);
    let refusal = setup.refuse(2).unwrap();
    assert!(refusal.full && refusal.pending_characters == 2);
    assert!(refusal.retry_after() >= MS * 10);
    let (refused, actions) = setup.arrive(2, Order::request(setup.now));
    let refuse = Action::Refuse {
        request: RequestId(refused),
        refusal,
    };
    assert_eq!(actions, [refuse]);
    assert_eq!(setup.refuse(1), None, "asking changes nothing");
    let gone = setup.step(Event::Gone {
        request: RequestId(call),
    });
    let dropped = Action::Drop {
        request: RequestId(call),
        characters: 2,
    };
    assert_eq!(gone, [dropped]);
    assert_eq!(setup.refuse(3), None);
}

#[test]
fn calls_do_not_take_the_room_of_live_characters_nor_idle_workers_that_of_the_queue() {
    let mut setup = Setup::busy(Limits {
        max_queued: 2,
        max_live: 1,
        ..limits(1, 4)
    });
    setup.call(2);
    assert!(setup.refuse(1).is_some());
    assert_eq!(setup.plan(1, 100).1, []);
    assert!(matches!(setup.plan(2, 100).1[..], [Action::Refuse { .. }]));

    let mut setup = Setup::busy(Limits {
        max_queued: 2,
        ..limits(1, 4)
    });
    assert_eq!(setup.boundary(0, 4, true, None, &[]), []);
    assert_eq!(setup.refuse(6), None, "four start at once, two wait");
    assert!(setup.refuse(7).is_some());
}

#[test]
fn a_queue_that_is_too_slow_refuses_calls_but_no_plans() {
    let mut setup = Setup::busy(Limits {
        max_wait: MS / 4,
        ..limits(1, 4)
    });
    // Nothing is measured: 25 µs a character of the least work.
    for _ in 0..11 {
        setup.call(1);
    }
    let refusal = setup.refuse(1).unwrap();
    assert!(!refusal.full && refusal.expected_wait > MS / 4);
    assert_eq!(setup.plan(1, 100).1, []);
    // A batch tried at 1 µs a unit says otherwise.
    for _ in 0..100 {
        setup.step(Event::Tried { work: 1000, took: MS });
    }
    assert_eq!(setup.refuse(1), None);
}

#[test]
fn expired_work_is_not_run() {
    let mut setup = Setup::busy(limits(1, 4));
    let order = Order::request(setup.now).expiring(setup.at(20));
    let (stale, _) = setup.arrive(1, order);
    let fresh = setup.call(1);
    setup.pass(20);
    assert_eq!(setup.ready(0), [(fresh, 1)]);
    let expired = Action::Expire {
        request: RequestId(stale),
        waited: MS * 20,
    };
    assert_eq!(setup.actions, [expired]);
}

#[test]
fn a_batch_is_limited_by_measured_time() {
    // Where live characters plan, batches are shorter.
    for (character_ms, beside_plans, else_taken) in [(5, 13, 40), (10, 6, 20), (40, 1, 5), (400, 1, 1)] {
        let cases = [
            (None, else_taken),
            (Some(0), beside_plans),
            (Some(4_999), beside_plans),
            (Some(5_000), else_taken),
        ];
        for (plan_ms_ago, taken) in cases {
            let mut setup = Setup::busy(Limits {
                max_batch_time: MS * 66,
                calls_batch_time: MS * 200,
                ..limits(1, 64)
            });
            for _ in 0..200 {
                setup.step(Event::Tried {
                    work: 10,
                    took: MS * character_ms * 10,
                });
            }
            if let Some(ms) = plan_ms_ago {
                let (plan, _) = setup.plan(1, 60_000);
                let request = RequestId(plan);
                setup.step(Event::Gone { request });
                setup.pass(ms);
            }
            let call = setup.call(60);
            assert_eq!(setup.ready(0), [(call, taken)], "{character_ms} {plan_ms_ago:?}");
        }
    }
}

#[test]
fn batches_have_the_right_reason() {
    let mut setup = Setup::idle(limits(1, 2));
    let reason = |setup: &mut Setup, took: Option<Duration>| {
        let finished = std::mem::take(&mut setup.held[0]);
        let actions = setup.step(Event::Ready(Ready {
            worker: 0,
            room: 2,
            is_idle: true,
            took,
            finished: &finished,
        }));
        match &actions[..] {
            [Action::Start(batch)] => batch.reason,
            other => panic!("{other:?}"),
        }
    };
    setup.call(1);
    assert_eq!(reason(&mut setup, None), BatchReason::Idle);
    setup.call(2);
    assert_eq!(reason(&mut setup, Some(MS)), BatchReason::Backlog);
    setup.call(3);
    assert_eq!(reason(&mut setup, Some(MS)), BatchReason::Full);
}

#[test]
fn a_lost_worker_takes_nothing_and_the_others_go_on() {
    let mut setup = Setup::idle(limits(2, 8));
    setup.lose(0);
    setup.lose(0);
    assert_eq!(setup.scheduler.workers(), 1);
    let call = setup.call(4);
    assert_eq!(setup.woken, [1]);
    assert_eq!(setup.ready(0), []);
    assert_eq!(setup.ready(1), [(call, 4)]);
    // A number that no worker has is no matter.
    setup.lose(9);
}

#[test]
fn the_loss_of_a_worker_lets_the_next_plan_of_an_owner_in() {
    let mut setup = Setup::idle(limits(2, 8));
    let (running, _) = setup.plan(1, 100);
    assert_eq!(setup.ready(0), [(running, 1)]);
    let (next, _) = setup.plan(1, 200);
    setup.lose(0);
    assert_eq!(setup.woken, [0, 1]);
    assert_eq!(setup.ready(1), [(next, 1)]);
}

#[test]
fn batches_larger_than_a_call_are_whole_calls() {
    let limits = Limits {
        call_rows: 8,
        ..limits(1, 16)
    };
    let whole = [3, 8, 9, 15, 16].map(|characters| limits.whole_calls(characters));
    assert_eq!(whole, [3, 8, 8, 8, 16]);
    let any = Limits {
        call_rows: 0,
        ..limits
    };
    assert_eq!(any.whole_calls(15), 15);
}
