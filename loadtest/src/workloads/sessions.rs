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

/// The sessions that this process opened.
#[derive(Debug, Default)]
pub(super) struct Opened {
    /// Clients, each with the ids of its sessions. They may be on different servers.
    clients: Vec<(Client, Vec<String>)>,
    ids: HashSet<String>,
}

/// A client with the plan's limits.
pub(super) async fn client_of(plan: &Plan) -> Result<Client, Failure> {
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

/// The characters of a share, each at its own place, with the options of their sessions.
pub(super) async fn walkers(
    client: &Client,
    plan: &Plan,
    live: &Live,
    share: Share,
) -> Result<(Pack, Vec<(Walker, SessionOptions)>), Failure> {
    let mut pack = client.pack(&live.pack).await?;
    if let Some(file) = &live.skeleton {
        pack = wearing(client, &pack, file).await?;
    }
    let styles = styles(client, &pack, &live.styles).await?;
    let first = share.before(live.characters);
    let numbers = first..first + share.part(live.characters);
    let walkers = numbers
        .map(|number| {
            let walker = Walker::new(plan.seed, number, &styles, live);
            let options = walker
                .options(plan.seed.wrapping_add(u64::from(number)))
                .ttl(ttl(plan));
            let options = match live.look_ahead {
                Some(frames) => options.look_ahead_frames(frames),
                None => options,
            };
            let options = if live.spread_priorities {
                options.priority(priority(number))
            } else {
                options
            };
            (walker, options)
        })
        .collect();
    Ok((pack, walkers))
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
    let client = client_of(plan).await?;
    let pack = client.pack(pack).await?;
    let options = (0..u64::from(count)).map(|n| SessionOptions::new().seed(plan.seed + n).ttl(ttl(plan)));
    let sessions = client.open_sessions(&pack, &options.collect::<Vec<_>>()).await?;
    let mut opened = Opened::default();
    opened.note(client, &sessions);
    Ok(opened)
}

impl Opened {
    fn note(&mut self, client: Client, sessions: &[Session]) {
        let ids: Vec<String> = sessions.iter().map(|s| s.id().to_owned()).collect();
        self.ids.extend(ids.iter().cloned());
        self.clients.push((client, ids));
    }

    /// Opens the sessions of a group of characters.
    pub(super) async fn open(
        &mut self,
        client: Client,
        pack: &Pack,
        group: Vec<(Walker, SessionOptions)>,
    ) -> Result<Vec<Walker>, Failure> {
        let (mut walkers, options): (Vec<_>, Vec<_>) = group.into_iter().unzip();
        let sessions = client.open_sessions(pack, &options).await?;
        for (walker, session) in walkers.iter_mut().zip(&sessions) {
            session.id().clone_into(&mut walker.id);
        }
        self.note(client, &sessions);
        Ok(walkers)
    }

    /// Number of sessions that were opened.
    pub(super) fn count(&self) -> usize {
        self.ids.len()
    }

    /// The states of the sessions that are still open.
    async fn now(&self) -> Result<Vec<v1::Session>, Failure> {
        let (mut found, mut open) = (HashSet::new(), Vec::new());
        for (client, ids) in &self.clients {
            // One list has the sessions of all clients on that server.
            if ids.iter().all(|id| found.contains(id)) {
                continue;
            }
            for session in client.list_sessions().await? {
                if self.ids.contains(&session.id) && found.insert(session.id.clone()) {
                    open.push(session);
                }
            }
        }
        Ok(open)
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
        let open = self.now().await?;
        open.into_iter()
            .filter_map(|s| s.stats)
            .for_each(|stats| sum.add(&stats));
        Ok(sum)
    }

    /// Records a fault if sessions are no longer open.
    pub(super) async fn check(&self, recorder: &Recorder) -> Result<(), Failure> {
        let open = self.now().await?.len();
        let lost = self.ids.len().saturating_sub(open) as u64;
        if lost > 0 {
            recorder.fault("SESSION_LOST", &format!("{lost} sessions are no longer open"));
        }
        recorder.live(|live| live.faults += lost);
        Ok(())
    }

    /// Closes all sessions.
    pub(super) async fn close(self) -> Result<(), Failure> {
        // A client goes on to the servers that have the rest.
        if let Some((client, _)) = self.clients.first() {
            client.close_sessions(self.ids).await?;
        }
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
