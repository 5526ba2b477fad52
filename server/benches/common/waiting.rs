//! A scheduler with many characters waiting.

use std::time::{Duration, Instant};

use troupe_batch::scheduler::{Action, Event, Limits, Ready, RequestId, Scheduler};
use troupe_batch::{Order, OwnerId};

/// Most characters in one batch.
const BATCH: usize = 64;
/// One in this many requests is an InBetween call. The others are plans of sessions.
const REQUEST_EVERY: u64 = 5;

/// A scheduler of one worker with a queue of constant length.
pub struct Waiting {
    scheduler: Scheduler,
    actions: Vec<Action>,
    now: Instant,
    next: u64,
}

impl Waiting {
    /// `characters` requests of one character wait. Their deadlines are out of order.
    pub fn of(characters: usize) -> Self {
        let limits = Limits {
            workers: 1,
            max_batch: BATCH,
            max_queued: usize::MAX / 4,
            max_live: usize::MAX / 4,
            max_wait: Duration::ZERO,
            max_batch_time: Duration::ZERO,
            ..Limits::default()
        };
        let mut waiting = Self {
            scheduler: Scheduler::new(limits),
            actions: Vec::with_capacity(characters.max(BATCH)),
            now: Instant::now(),
            next: 0,
        };
        for _ in 0..characters {
            waiting.arrive();
        }
        waiting
    }

    fn arrive(&mut self) {
        let request = self.next;
        self.next += 1;
        // Deadlines within one second, in a scattered order.
        let deadline = self.now + Duration::from_millis(request * 7919 % 1000);
        let order = match request % REQUEST_EVERY {
            0 => Order::request(deadline),
            _ => Order::live(OwnerId(request), deadline),
        };
        let event = Event::Arrived {
            request: RequestId(request),
            characters: 1,
            order,
        };
        self.scheduler.step(self.now, event, &mut self.actions);
    }

    /// One turn of a busy server: the worker takes a batch, and the same number of characters
    /// arrive.
    pub fn turn(&mut self) -> usize {
        self.actions.clear();
        self.now += Duration::from_millis(10);
        let ready = Ready {
            worker: 0,
            room: BATCH,
            is_idle: true,
            took: Some(Duration::from_millis(10)),
            finished: &[],
        };
        self.scheduler
            .step(self.now, Event::Ready(ready), &mut self.actions);
        let taken = self.actions.iter().find_map(|action| match action {
            Action::Start(batch) => Some(batch.slices.iter().map(|part| part.characters).sum()),
            _ => None,
        });
        let taken: usize = taken.expect("a worker takes what waits");
        for _ in 0..taken {
            self.arrive();
        }
        taken
    }
}
