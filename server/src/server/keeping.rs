//! Saves sessions from the start of the service to its end.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::oneshot;
use tokio::task::{JoinHandle, spawn_blocking};
use tokio::time::Instant;

use crate::config::Config;
use troupe_base::telemetry::{Seldom, Telemetry};
use troupe_live::records::shared::{SharedRecords, Terms};
use troupe_live::records::{RecordStore, Records, RecordsError};
use troupe_live::session::{Backlog, Keeper};

/// Time between two looks at a round that takes long.
const LOOK_INTERVAL: Duration = Duration::from_millis(500);

/// Opens the records. None: nothing is kept. It blocks.
pub(super) type OpenRecords =
    Box<dyn FnOnce(&Telemetry) -> Result<Option<Box<dyn RecordStore>>, RecordsError> + Send>;

/// The records that `config` asks for, of a server that listens on `address`. The default folder
/// may be unusable, for example on a read-only disk. Then a warning says that nothing is kept. A
/// damaged file is always an error. A shared store need not answer yet.
pub(super) fn records_of(config: &Config, address: SocketAddr) -> OpenRecords {
    if let Some(place) = config.shared_store() {
        let address = config.advertise.clone().unwrap_or_else(|| address.to_string());
        return Box::new(move |telemetry| {
            let shared = SharedRecords::new(&place?, address.clone(), Terms::default(), telemetry);
            tracing::info!(address, "sessions are shared with other servers");
            Ok(Some(Box::new(shared)))
        });
    }
    let (folder, asked) = (config.store_folder(), config.store.is_some());
    Box::new(move |_| open(folder, asked))
}

fn open(folder: Option<PathBuf>, asked: bool) -> Result<Option<Box<dyn RecordStore>>, RecordsError> {
    let Some(folder) = folder else {
        return Ok(None);
    };
    match Records::open(&folder) {
        Ok(records) => Ok(Some(Box::new(records))),
        Err(error) if asked || matches!(error, RecordsError::Damaged { .. }) => Err(error),
        Err(error) => {
            tracing::warn!(%error, "sessions and uploads last until the server stops");
            Ok(None)
        }
    }
}

/// The task that saves sessions. It ends after a last round.
pub(super) struct Keeping {
    stop: oneshot::Sender<()>,
    /// Gives whether the last round has kept everything.
    task: JoinHandle<bool>,
    backlog: Arc<Backlog>,
}

impl Keeping {
    /// Saves sessions every `interval`.
    pub(super) fn start(keeper: Keeper, interval: Duration) -> Self {
        let (stop, stopped) = oneshot::channel();
        let backlog = keeper.backlog().clone();
        let task = tokio::spawn(keep(keeper, interval, stopped));
        Self { stop, task, backlog }
    }

    /// Saves sessions a last time within `limit`, and ends the task. Answers whether all changes
    /// are kept. Otherwise the log has the reason.
    pub(super) async fn finish(self, limit: Duration) -> bool {
        let Self { stop, task, backlog } = self;
        // Sending fails only if the task has failed, which it has reported.
        let _ = stop.send(());
        let is_kept = matches!(tokio::time::timeout(limit, task).await, Ok(Ok(true)));
        if !is_kept {
            tracing::error!(
                sessions = backlog.sessions(),
                age = ?backlog.age(),
                reason = backlog.reason(),
                "sessions are lost: the store does not have their last changes"
            );
        }
        is_kept
    }
}

/// Saves sessions until `stopped`. Answers whether the last round has kept everything.
async fn keep(mut keeper: Keeper, interval: Duration, stopped: oneshot::Receiver<()>) -> bool {
    let stopped = async {
        // The server keeps running if its handle is dropped.
        if stopped.await.is_err() {
            std::future::pending::<()>().await;
        }
    };
    tokio::pin!(stopped);
    let mut trouble = Trouble::new(keeper.backlog());
    let mut wait = interval;
    loop {
        let is_last = tokio::select! {
            () = &mut stopped => true,
            () = tokio::time::sleep(wait) => false,
        };
        let mut round = spawn_blocking(move || {
            let done = match is_last {
                true => (Duration::ZERO, keeper.finish()),
                false => keeper.go_on(interval),
            };
            (keeper, done)
        });
        let round = loop {
            tokio::select! {
                done = &mut round => break done,
                () = tokio::time::sleep(LOOK_INTERVAL) => trouble.during_round(),
            }
        };
        let result;
        (keeper, (wait, result)) = match round {
            Ok(done) => done,
            Err(error) => {
                tracing::error!(%error, "sessions are not kept any more");
                return false;
            }
        };
        trouble.after_round(result.is_ok());
        if is_last {
            return result.is_ok();
        }
    }
}

/// Logs when changes are not kept any more, and when they are again.
struct Trouble {
    backlog: Arc<Backlog>,
    since: Option<Instant>,
    logged: Seldom,
}

impl Trouble {
    fn new(backlog: &Arc<Backlog>) -> Self {
        Self {
            backlog: backlog.clone(),
            since: None,
            logged: Seldom::default(),
        }
    }

    fn during_round(&mut self) {
        if self.backlog.check().is_err() {
            self.begin();
        }
    }

    fn after_round(&mut self, succeeded: bool) {
        if !succeeded || self.backlog.check().is_err() {
            self.begin();
        } else if let Some(since) = self.since.take() {
            tracing::info!(after = ?since.elapsed(), "changes of sessions are kept again");
        }
    }

    fn begin(&mut self) {
        let now = Instant::now();
        // At most once a minute, if writes fail now and then.
        if self.since.is_none() && self.logged.next(now.into_std()).is_some() {
            self.since = Some(now);
            tracing::error!(
                sessions = self.backlog.sessions(),
                age = ?self.backlog.age(),
                reason = self.backlog.reason(),
                "changes of sessions are not kept"
            );
        }
    }
}
