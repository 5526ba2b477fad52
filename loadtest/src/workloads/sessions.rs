//! Sessions of a load: opened before it, watched during it, closed after it.

use std::collections::HashSet;
use std::path::Path;
use std::time::Duration;

use tokio::task::JoinSet;
use troupe_client::{Client, ClientError, ConnectOptions, Pack, Session, SessionOptions};
use troupe_proto::v1;

use super::wander::{Walker, styles};
use crate::failure::Failure;
use crate::measure::{Clock, PlanStats, Recorder};
use crate::plan::{Live, Plan, Share};

/// A session lives for this long after the planned end of the load, if the load tester is killed.
const TTL_MARGIN: Duration = Duration::from_secs(60);
/// Maximum time to live that a server allows.
const MOST_TTL: Duration = Duration::from_secs(86_400);

/// The ids of all sessions that this process opened.
#[derive(Debug, Clone)]
pub(super) struct Opened {
    client: Client,
    ids: HashSet<String>,
}

/// A client with the plan's limits.
pub(super) async fn client(plan: &Plan) -> Result<Client, Failure> {
    let options = ConnectOptions {
        request_timeout: plan.timeout(),
        ..plan.access.options()
    };
    Ok(Client::connect_with(&plan.server, options).await?)
}

/// Time to live of a session, so that it survives the load even without a call.
fn ttl(plan: &Plan) -> Duration {
    (plan.warmup() + plan.measured() + TTL_MARGIN).min(MOST_TTL)
}

/// The priority of character number `nth`: the fraction of a multiple of the golden ratio. Such
/// priorities are spread evenly for any number of characters.
fn priority(nth: u32) -> f32 {
    (f64::from(nth) * 0.618_033_988_749_895).fract() as f32
}

/// Opens the sessions of a share's characters, each at its own place, and makes a walker for each.
pub(super) async fn open_walkers(
    plan: &Plan,
    live: &Live,
    share: Share,
) -> Result<(Opened, Pack, Vec<Walker>), Failure> {
    let client = client(plan).await?;
    let mut pack = client.pack(&live.pack).await?;
    if let Some(file) = &live.skeleton {
        pack = wearing(&client, &pack, file).await?;
    }
    let styles = styles(&client, &pack, &live.styles).await?;
    let first = share.before(live.characters);
    let numbers = first..first + share.part(live.characters);
    let mut walkers = numbers
        .clone()
        .map(|number| Walker::new(plan.seed, number, &styles, live))
        .collect::<Vec<_>>();
    let options = walkers
        .iter()
        .zip(numbers)
        .map(|(walker, number)| {
            let options = walker
                .options(plan.seed.wrapping_add(u64::from(number)))
                .ttl(ttl(plan));
            let options = match live.look_ahead {
                Some(frames) => options.look_ahead_frames(frames),
                None => options,
            };
            if live.spread_priorities {
                options.priority(priority(number))
            } else {
                options
            }
        })
        .collect::<Vec<_>>();
    let sessions = client.open_sessions(&pack, &options).await?;
    for (walker, session) in walkers.iter_mut().zip(&sessions) {
        session.id().clone_into(&mut walker.id);
    }
    Ok((Opened::new(client, &sessions), pack, walkers))
}

/// The pack whose characters wear the skeleton of a file. Processes of one load share it.
async fn wearing(client: &Client, pack: &Pack, file: &Path) -> Result<Pack, Failure> {
    let data = std::fs::read(file).map_err(|why| Failure::file(file, why))?;
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let own = client
        .put_skeleton("loadtest", (&name, data), pack, false)
        .await?;
    Ok(pack.wearing(&own).map_err(ClientError::from)?)
}

/// Opens sessions without walkers.
pub(super) async fn open_idle(plan: &Plan, pack: &str, count: u32) -> Result<Opened, Failure> {
    let client = client(plan).await?;
    let pack = client.pack(pack).await?;
    let options = (0..u64::from(count)).map(|n| SessionOptions::new().seed(plan.seed + n).ttl(ttl(plan)));
    let sessions = client.open_sessions(&pack, &options.collect::<Vec<_>>()).await?;
    Ok(Opened::new(client, &sessions))
}

impl Opened {
    fn new(client: Client, sessions: &[Session]) -> Self {
        Self {
            client,
            ids: sessions.iter().map(|s| s.id().to_owned()).collect(),
        }
    }

    /// Number of sessions that were opened.
    pub(super) fn count(&self) -> usize {
        self.ids.len()
    }

    /// The states of the sessions that are still open.
    async fn now(&self) -> Result<impl Iterator<Item = v1::Session>, Failure> {
        let open = self.client.list_sessions().await?;
        Ok(open.into_iter().filter(|s| self.ids.contains(&s.id)))
    }

    /// Reads the counts of the sessions while `tasks` run the load, and closes the sessions
    /// afterwards.
    pub(super) async fn see_through(
        self,
        mut tasks: JoinSet<()>,
        recorder: &Recorder,
    ) -> Result<(), Failure> {
        let stats = self.follow(recorder.clock()).await;
        while tasks.join_next().await.is_some() {}
        recorder.live(|live| live.plans = stats.as_ref().copied().unwrap_or_default());
        let closed = self.close().await;
        stats?;
        closed
    }

    /// Reads the counts of the sessions at both ends of the measured time, and returns the
    /// difference.
    async fn follow(&self, clock: &Clock) -> Result<PlanStats, Failure> {
        tokio::time::sleep_until(clock.measured_from()).await;
        let before = self.stats().await?;
        tokio::time::sleep_until(clock.end()).await;
        Ok(self.stats().await?.since(&before))
    }

    async fn stats(&self) -> Result<PlanStats, Failure> {
        let mut sum = PlanStats::default();
        self.now()
            .await?
            .filter_map(|s| s.stats)
            .for_each(|stats| sum.add(&stats));
        Ok(sum)
    }

    /// Records a fault if sessions are no longer open.
    pub(super) async fn check(&self, recorder: &Recorder) -> Result<(), Failure> {
        let open = self.now().await?.count();
        let lost = self.ids.len().saturating_sub(open) as u64;
        if lost > 0 {
            recorder.fault("SESSION_LOST", &format!("{lost} sessions are no longer open"));
        }
        recorder.live(|live| live.faults += lost);
        Ok(())
    }

    /// Closes all sessions.
    pub(super) async fn close(self) -> Result<(), Failure> {
        self.client.close_sessions(self.ids).await?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn priorities_are_spread_evenly_from_0_to_1() {
        for count in [10, 100, 333] {
            let all = (0..count).map(priority).collect::<Vec<_>>();
            assert!(all.iter().all(|p| (0.0..=1.0).contains(p)));
            let low = all.iter().filter(|&&p| p < 0.5).count();
            assert!(low.abs_diff(count as usize / 2) <= 2, "{low} of {count}");
        }
    }
}
