//! The closed loop: each client waits for its answer, pauses, and sends its next request.

use std::sync::Arc;
use std::time::Duration;

use tokio::task::JoinSet;
use tokio::time::{Instant, sleep, sleep_until};

use super::target::Target;
use crate::arrivals::Stages;
use crate::measure::{Call, Outcome, Recorder};
use crate::plan::Share;

/// Minimum pause of a client after a refusal or an error, so that the server is not busy with
/// refusals.
const BACK_OFF: Duration = Duration::from_millis(10);
/// Interval at which an inactive client checks whether it should be active.
const LOOK: Duration = Duration::from_millis(50);

/// The clients of a closed loop.
#[derive(Debug, Clone)]
pub struct Clients {
    /// Number of clients over the time of the load.
    pub stages: Stages,
    /// Time from an answer to the next request.
    pub think: Duration,
    /// The share of the load that this process sends.
    pub share: Share,
}

/// Runs the clients until the load ends, and returns after their last answers. Client number `i`
/// sends request `i` first, then `i + 1`, and so on.
pub async fn closed<T: Target>(target: Arc<T>, recorder: Arc<Recorder>, clients: Clients) {
    let clients = Arc::new(clients);
    let most = clients.stages.most().ceil() as u64;
    let numbers = (0..most).filter(|n| n % u64::from(clients.share.of) == u64::from(clients.share.nth));
    let mut tasks = JoinSet::new();
    for number in numbers {
        tasks.spawn(client(number, target.clone(), recorder.clone(), clients.clone()));
    }
    while tasks.join_next().await.is_some() {}
}

async fn client<T: Target>(number: u64, target: Arc<T>, recorder: Arc<Recorder>, clients: Arc<Clients>) {
    let clock = recorder.clock();
    sleep_until(clock.start()).await;
    let mut nth = 0;
    loop {
        let sent = Instant::now();
        if sent >= clock.end() {
            return;
        }
        let into = sent.saturating_duration_since(clock.start()).as_secs_f64();
        if number as f64 + 0.5 > clients.stages.level(into) {
            sleep(LOOK).await;
            continue;
        }
        recorder.sent(sent);
        let outcome = target.call(number, number + nth).await;
        nth += 1;
        let done = Instant::now();
        let right = matches!(outcome, Outcome::Right(_));
        recorder.done(&Call {
            due: sent,
            sent,
            done,
            outcome,
        });
        let wait = if right {
            clients.think
        } else {
            clients.think.max(BACK_OFF)
        };
        if !wait.is_zero() {
            sleep(wait).await;
        }
    }
}
