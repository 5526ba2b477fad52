//! Saves sessions from the start of the service to its end.

use std::path::PathBuf;
use std::time::Duration;

use tokio::sync::oneshot;
use tokio::task::{JoinHandle, spawn_blocking};

use crate::config::Config;
use troupe_live::records::{Records, RecordsError};
use troupe_live::session::Keeper;

/// Opens the records. None: nothing is kept. It blocks.
pub(super) type OpenRecords = Box<dyn FnOnce() -> Result<Option<Records>, RecordsError> + Send>;

/// The records that `config` asks for. The default folder may be unusable, for example on a
/// read-only disk. Then a warning says that nothing is kept.
pub(super) fn records_of(config: &Config) -> OpenRecords {
    let (folder, asked) = (config.store_folder(), config.store.is_some());
    Box::new(move || open(folder, asked))
}

fn open(folder: Option<PathBuf>, asked: bool) -> Result<Option<Records>, RecordsError> {
    let Some(folder) = folder else {
        return Ok(None);
    };
    match Records::open(&folder) {
        Ok(records) => Ok(Some(records)),
        Err(error) if asked => Err(error),
        Err(error) => {
            tracing::warn!(%error, "sessions and uploads last until the server stops");
            Ok(None)
        }
    }
}

/// The task that saves sessions. It ends after a last round.
pub(super) struct Keeping {
    stop: oneshot::Sender<()>,
    task: JoinHandle<()>,
}

impl Keeping {
    /// Saves sessions every `interval`.
    pub(super) fn start(keeper: Keeper, interval: Duration) -> Self {
        let (stop, stopped) = oneshot::channel();
        let task = tokio::spawn(keep(keeper, interval, stopped));
        Self { stop, task }
    }

    /// Saves sessions a last time, and ends the task.
    pub(super) async fn finish(self) {
        let Self { stop, task } = self;
        // Sending fails only if the task has failed, which it has reported.
        let _ = stop.send(());
        if let Err(error) = task.await {
            tracing::error!(%error, "the task that keeps sessions failed");
        }
    }
}

async fn keep(mut keeper: Keeper, interval: Duration, stopped: oneshot::Receiver<()>) {
    let stopped = async {
        // The server keeps running if its handle is dropped.
        if stopped.await.is_err() {
            std::future::pending::<()>().await;
        }
    };
    tokio::pin!(stopped);
    let (mut wait, mut last) = (interval, false);
    while !last {
        last = tokio::select! {
            () = &mut stopped => true,
            () = tokio::time::sleep(wait) => false,
        };
        let round = spawn_blocking(move || {
            let wait = keeper.go_on(interval);
            (keeper, wait)
        });
        (keeper, wait) = match round.await {
            Ok(done) => done,
            Err(error) => return tracing::error!(%error, "sessions are not kept any more"),
        };
    }
}
