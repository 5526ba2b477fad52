use std::collections::HashMap;

use proptest::prelude::*;

use super::*;

const LIMITS: Limits = Limits {
    max_batch: 8,
    max_queued: 20,
};

fn arrived(request: u64, characters: usize) -> Event {
    Event::Arrived {
        request: RequestId(request),
        characters,
    }
}

fn cut(scheduler: &mut Scheduler, now: Instant) -> Option<Cut> {
    match scheduler.step(now, Event::Settled) {
        Some(Action::Cut(cut)) => Some(cut),
        None => None,
        other => panic!("unexpected {other:?}"),
    }
}

fn shape(cut: &Cut) -> Vec<(u64, usize, usize)> {
    cut.parts
        .iter()
        .map(|part| (part.request.0, part.first, part.characters))
        .collect()
}

#[test]
fn a_lone_request_is_cut_at_once() {
    let now = Instant::now();
    let mut scheduler = Scheduler::new(LIMITS);
    scheduler.step(now, Event::EngineFree);
    assert_eq!(cut(&mut scheduler, now), None);
    scheduler.step(now, arrived(1, 1));
    let batch = cut(&mut scheduler, now).unwrap();
    assert_eq!(shape(&batch), [(1, 0, 1)]);
    assert_eq!(batch.reason, CutReason::Idle);
}

#[test]
fn what_waits_while_the_engine_is_busy_is_cut_together() {
    let start = Instant::now();
    let mut scheduler = Scheduler::new(LIMITS);
    scheduler.step(start, Event::EngineFree);
    for request in 1..=3 {
        scheduler.step(start, arrived(request, 1));
        assert_eq!(cut(&mut scheduler, start).is_some(), request == 1);
    }
    let later = start + Duration::from_millis(5);
    scheduler.step(later, Event::EngineFree);
    let batch = cut(&mut scheduler, later).unwrap();
    assert_eq!(shape(&batch), [(2, 0, 1), (3, 0, 1)]);
    assert_eq!(batch.reason, CutReason::Backlog);
    assert!(
        batch
            .parts
            .iter()
            .all(|part| part.waited == Duration::from_millis(5))
    );
}

#[test]
fn a_large_request_is_split_and_shares_its_last_batch() {
    let now = Instant::now();
    let mut scheduler = Scheduler::new(LIMITS);
    scheduler.step(now, arrived(1, 11));
    scheduler.step(now, arrived(2, 2));
    scheduler.step(now, Event::EngineFree);
    let first = cut(&mut scheduler, now).unwrap();
    assert_eq!((shape(&first), first.reason), (vec![(1, 0, 8)], CutReason::Full));
    scheduler.step(now, Event::EngineFree);
    assert_eq!(shape(&cut(&mut scheduler, now).unwrap()), [(1, 8, 3), (2, 0, 2)]);
}

#[test]
fn a_full_queue_refuses_and_a_leaver_makes_room() {
    let now = Instant::now();
    let mut scheduler = Scheduler::new(LIMITS);
    scheduler.step(now, arrived(1, 15));
    let refused = Action::Refuse {
        request: RequestId(2),
        pending_characters: 15,
    };
    assert_eq!(scheduler.step(now, arrived(2, 6)), Some(refused));
    assert_eq!(
        scheduler.step(now, arrived(3, 5)),
        Some(Action::Admit {
            request: RequestId(3)
        })
    );
    let dropped = Action::Drop {
        request: RequestId(1),
        characters: 15,
    };
    assert_eq!(
        scheduler.step(
            now,
            Event::Gone {
                request: RequestId(1)
            }
        ),
        Some(dropped)
    );
    assert_eq!(
        scheduler.step(
            now,
            Event::Gone {
                request: RequestId(1)
            }
        ),
        None
    );
    assert_eq!(
        scheduler.step(now, arrived(4, 15)),
        Some(Action::Admit {
            request: RequestId(4)
        })
    );
}

#[test]
fn what_a_free_engine_takes_does_not_count_as_waiting() {
    let now = Instant::now();
    let mut scheduler = Scheduler::new(LIMITS);
    scheduler.step(now, Event::EngineFree);
    scheduler.step(now, arrived(1, 20));
    let admitted = Action::Admit {
        request: RequestId(2),
    };
    assert_eq!(scheduler.step(now, arrived(2, 8)), Some(admitted));
    assert!(matches!(
        scheduler.step(now, arrived(3, 1)),
        Some(Action::Refuse { .. })
    ));
    cut(&mut scheduler, now).unwrap();
    assert_eq!(scheduler.pending_characters(), LIMITS.max_queued);
}

#[derive(Debug, Clone)]
enum Step {
    Arrive(usize),
    /// The n-th request that ever arrived (modulo their number) goes away.
    Leave(usize),
    FinishBatch,
    Settle,
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    let step = prop_oneof![
        4 => (1usize..24).prop_map(Step::Arrive),
        1 => (0usize..64).prop_map(Step::Leave),
        2 => Just(Step::FinishBatch),
        4 => Just(Step::Settle),
    ];
    prop::collection::vec(step, 0..200)
}

/// What a correct scheduler may do, kept in the plainest way.
#[derive(Default)]
struct Model {
    /// Size, characters served so far, and whether the request has left the queue for good.
    requests: HashMap<RequestId, (usize, usize, bool)>,
    served_order: Vec<RequestId>,
    busy: bool,
}

impl Model {
    fn pending(&self) -> usize {
        self.requests
            .values()
            .filter(|request| !request.2)
            .map(|request| request.0 - request.1)
            .sum()
    }

    fn check(&mut self, limits: Limits, action: Option<Action>, arriving: Option<(RequestId, usize)>) {
        let room = limits.max_queued + if self.busy { 0 } else { limits.max_batch };
        match action {
            None => assert!(arriving.is_none(), "an arrival must be answered"),
            Some(Action::Admit { request }) => {
                assert!(self.pending() + arriving.unwrap().1 <= room);
                self.requests.insert(request, (arriving.unwrap().1, 0, false));
            }
            Some(Action::Refuse {
                pending_characters, ..
            }) => {
                assert_eq!(pending_characters, self.pending());
                assert!(
                    pending_characters + arriving.unwrap().1 > room,
                    "refused with room left"
                );
            }
            Some(Action::Drop { request, characters }) => {
                let known = self.requests.get_mut(&request).unwrap();
                assert!(!known.2 && known.0 - known.1 == characters);
                known.2 = true;
            }
            Some(Action::Cut(cut)) => {
                assert!(!self.busy, "cut while the engine was busy");
                assert!((1..=limits.max_batch).contains(&cut.characters()));
                self.busy = true;
                for part in &cut.parts {
                    let known = self.requests.get_mut(&part.request).unwrap();
                    assert!(!known.2, "served after it left");
                    assert_eq!(
                        part.first, known.1,
                        "characters out of order, lost or served twice"
                    );
                    assert!(part.characters > 0);
                    known.1 += part.characters;
                    assert!(known.1 <= known.0);
                    known.2 = known.1 == known.0;
                    self.served_order.push(part.request);
                }
                assert!(self.pending() <= limits.max_queued, "more left than may wait");
                assert!(
                    cut.characters() == limits.max_batch || self.pending() == 0,
                    "left work behind"
                );
            }
        }
    }
}

proptest! {
    #[test]
    fn nothing_is_lost_or_served_twice(
        steps in steps(),
        max_batch in 1usize..10,
        spare in 0usize..40,
    ) {
        let limits = Limits { max_batch, max_queued: max_batch + spare };
        let now = Instant::now();
        let mut scheduler = Scheduler::new(limits);
        let mut model = Model::default();
        scheduler.step(now, Event::EngineFree);
        let mut arrivals = 0;
        for step in steps {
            let (event, arriving) = match step {
                Step::Arrive(characters) => {
                    arrivals += 1;
                    (arrived(arrivals, characters), Some((RequestId(arrivals), characters)))
                }
                Step::Leave(nth) => {
                    (Event::Gone { request: RequestId(1 + nth as u64 % arrivals.max(1)) }, None)
                }
                Step::FinishBatch => {
                    if !model.busy {
                        continue;
                    }
                    model.busy = false;
                    (Event::EngineFree, None)
                }
                Step::Settle => (Event::Settled, None),
            };
            let action = scheduler.step(now, event);
            model.check(limits, action, arriving);
            prop_assert_eq!(scheduler.pending_characters(), model.pending());
        }
        while scheduler.pending_requests() > 0 {
            if std::mem::take(&mut model.busy) {
                scheduler.step(now, Event::EngineFree);
            }
            let action = scheduler.step(now, Event::Settled);
            prop_assert!(action.is_some(), "stuck with work in the queue");
            model.check(limits, action, None);
        }
        prop_assert!(model.requests.values().all(|request| request.2), "a request was lost");
        prop_assert!(model.served_order.is_sorted(), "not first come, first served");
    }
}
