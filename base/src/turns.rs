//! Fair turns on the runtime's threads: a client with many tasks gets no more of them than a client
//! with few.
//!
//! All tasks that are ready to run wait in one queue of the runtime. In each round of that queue a
//! client has a few turns. Its other tasks wait in a line of their own, so other clients wait for
//! at most a few of its tasks. The clients of one address share such a line as well.

use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::task::{Context, Poll, ready};

use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::task::futures::TaskLocalFuture;
use tokio_util::sync::PollSemaphore;

/// A line's turns in a round, for each core.
const TURNS_PER_CORE: usize = 2;

/// Plans of `Step` calls that a client, or an address, may have with the batchers at a time, for
/// each core. This is enough to keep all workers busy.
const STEP_PLANS_PER_CORE: usize = 64;

/// Identifies a client, and the group with which it shares: its address, or its own key. The
/// default is the server itself.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ClientId {
    /// Groups share with each other by their shares.
    pub group: u64,
    /// The clients of a group share evenly.
    pub own: u64,
    /// Number of groups that the group counts as; 0 as 1.
    pub share: u32,
}

impl ClientId {
    /// Number of groups that the group counts as, at least 1.
    pub fn share(&self) -> u64 {
        u64::from(self.share.max(1))
    }
}

/// A line of waiting tasks.
#[derive(Debug)]
pub struct Line {
    /// Unique in the process; not 0.
    id: u64,
    turns: Arc<Semaphore>,
    /// Permits for plans of `Step` calls.
    plans: Arc<Semaphore>,
    /// Turns of this round that were taken. They come back in the next round.
    taken: AtomicUsize,
    /// Whether a task is running that gives them back.
    returning: AtomicBool,
}

impl Line {
    /// A line whose number of turns follows from the number of cores.
    pub fn new() -> Arc<Self> {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        Self::with(cores * TURNS_PER_CORE, cores * STEP_PLANS_PER_CORE)
    }

    fn with(turns: usize, plans: usize) -> Arc<Self> {
        static NEXT: AtomicU64 = AtomicU64::new(1);
        Arc::new(Self {
            id: NEXT.fetch_add(1, Ordering::Relaxed),
            turns: Arc::new(Semaphore::new(turns)),
            plans: Arc::new(Semaphore::new(plans)),
            taken: AtomicUsize::new(0),
            returning: AtomicBool::new(false),
        })
    }

    /// Unique in the process; not 0.
    pub fn id(&self) -> u64 {
        self.id
    }

    fn taken(self: &Arc<Self>, turn: OwnedSemaphorePermit) {
        turn.forget();
        self.taken.fetch_add(1, Ordering::AcqRel);
        if !self.returning.swap(true, Ordering::AcqRel) {
            tokio::spawn(self.clone().give_back());
        }
    }

    /// Gives turns back once the tasks that were in the runtime's queue before have run.
    async fn give_back(self: Arc<Self>) {
        loop {
            tokio::task::yield_now().await;
            match self.taken.swap(0, Ordering::AcqRel) {
                0 => {
                    self.returning.store(false, Ordering::Release);
                    // A turn that was taken just now saw `returning` set and spawned no task.
                    let more = self.taken.load(Ordering::Acquire) > 0;
                    if !more || self.returning.swap(true, Ordering::AcqRel) {
                        return;
                    }
                }
                taken => self.turns.add_permits(taken),
            }
        }
    }
}

/// The turns of one client.
#[derive(Debug, Clone, Default)]
pub struct Turns {
    lines: Arc<[Arc<Line>]>,
    client: ClientId,
}

tokio::task_local! {
    static CURRENT: Turns;
}

impl Turns {
    /// The turns of a client whose tasks wait in all of `lines`: its own and those it shares.
    pub fn new<const N: usize>(client: ClientId, lines: [&Arc<Line>; N]) -> Self {
        Self {
            lines: lines.into_iter().cloned().collect(),
            client,
        }
    }

    /// The client whose turns they are.
    pub fn client(&self) -> ClientId {
        self.client
    }

    /// Runs `work` as this client's, without waiting for turns: [`Turns::current`] has them there.
    pub fn scope<F: Future>(self, work: F) -> impl Future<Output = F::Output> {
        CURRENT.scope(self, work)
    }

    /// Turns without a limit.
    pub fn endless() -> Self {
        Self::default()
    }

    /// The turns of the current task, as [`Turns::take`] set them; endless outside of it.
    pub fn current() -> Self {
        CURRENT.try_with(Self::clone).unwrap_or_default()
    }

    /// Waits until a plan of a `Step` call may go to the batcher. Dropping the permits lets the
    /// next one go.
    pub async fn plan(&self) -> Vec<OwnedSemaphorePermit> {
        let mut permits = Vec::with_capacity(self.lines.len());
        for line in self.lines.iter() {
            // The lines are never closed.
            permits.extend(line.plans.clone().acquire_owned().await);
        }
        permits
    }

    /// Runs `work` in turns: it waits for a turn before each poll.
    pub fn take<F: Future>(self, work: F) -> InTurns<F> {
        let waiting = self
            .lines
            .iter()
            .map(|line| PollSemaphore::new(line.turns.clone()));
        InTurns {
            waiting: waiting.collect(),
            held: Vec::with_capacity(self.lines.len()),
            lines: self.lines.clone(),
            work: Box::pin(CURRENT.scope(self, work)),
        }
    }
}

/// See [`Turns::take`].
pub struct InTurns<F> {
    lines: Arc<[Arc<Line>]>,
    waiting: Vec<PollSemaphore>,
    held: Vec<OwnedSemaphorePermit>,
    work: Pin<Box<TaskLocalFuture<Turns, F>>>,
}

impl<F: Future> Future for InTurns<F> {
    type Output = F::Output;

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<F::Output> {
        let this = &mut *self;
        while let Some(waiting) = this.waiting.get_mut(this.held.len()) {
            match ready!(waiting.poll_acquire(context)) {
                Some(turn) => this.held.push(turn),
                // The lines are never closed.
                None => break,
            }
        }
        let polled = this.work.as_mut().poll(context);
        for (line, turn) in this.lines.iter().zip(this.held.drain(..)) {
            line.taken(turn);
        }
        polled
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    /// Writes its name into a list and yields, 20 times.
    fn writer(name: char, order: &Arc<Mutex<String>>) -> impl Future<Output = ()> + Send + use<> {
        let order = order.clone();
        async move {
            for _ in 0..20 {
                order.lock().unwrap().push(name);
                tokio::task::yield_now().await;
            }
        }
    }

    /// The names that 50 tasks of one client and one task of another write on one thread.
    async fn written(lines: [&[Arc<Line>]; 2]) -> String {
        let order = Arc::new(Mutex::new(String::new()));
        let turns = lines.map(|lines| Turns {
            lines: lines.to_vec().into(),
            client: ClientId::default(),
        });
        let names = std::iter::repeat_n(0, 50).chain([1]);
        let tasks: Vec<_> = names
            .map(|who| tokio::spawn(turns[who].clone().take(writer(['m', 'f'][who], &order))))
            .collect();
        for task in tasks {
            task.await.unwrap();
        }
        let order = order.lock().unwrap().clone();
        assert_eq!(order.len(), 51 * 20);
        order
    }

    #[tokio::test]
    async fn a_client_with_many_tasks_gets_no_more_turns_than_one_with_few() {
        let last = |order: &str| order.rfind('f').unwrap();
        let [many, few] = [(); 2].map(|()| Line::with(1, 1));
        let fair = written([&[many], &[few]]).await;
        let unfair = written([&[], &[]]).await;
        assert!(last(&fair) < 100 && last(&unfair) > 900, "{fair}\n{unfair}");
    }

    #[tokio::test]
    async fn cancelled_work_keeps_no_turn() {
        let line = Line::with(1, 1);
        let stuck = tokio::spawn(Turns::new(ClientId::default(), [&line]).take(std::future::pending::<()>()));
        tokio::task::yield_now().await;
        stuck.abort();
        assert!(stuck.await.is_err());
        assert_eq!(
            Turns::new(ClientId::default(), [&line]).take(async { 7 }).await,
            7
        );
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn no_turn_is_lost() {
        let line = Line::with(2, 2);
        let tasks: Vec<_> = (0..200)
            .map(|_| {
                tokio::spawn(Turns::new(ClientId::default(), [&line]).take(async {
                    for _ in 0..50 {
                        tokio::task::yield_now().await;
                    }
                }))
            })
            .collect();
        for task in tasks {
            task.await.unwrap();
        }
        while line.returning.load(Ordering::Acquire) {
            tokio::task::yield_now().await;
        }
        assert_eq!(line.turns.available_permits(), 2);
    }
}
