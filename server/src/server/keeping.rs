//! The thread that keeps sessions, from the start of the service to its end.

use std::path::PathBuf;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread::JoinHandle;
use std::time::Duration;

use super::StartError;
use crate::config::Config;
use crate::records::{Records, RecordsError};
use crate::session::Keeper;

/// Where records are to be kept.
pub(super) struct Wanted {
    folder: Option<PathBuf>,
    /// The folder was asked for; else it is the usual one.
    asked: bool,
}

impl Wanted {
    pub(super) fn of(config: &Config) -> Self {
        Self {
            folder: config.store_folder(),
            asked: config.store.is_some(),
        }
    }

    /// The records, where some are to be kept. The usual folder may be of no use, as on a disk that cannot be written: then a warning
    /// says that nothing is kept.
    pub(super) fn open(self) -> Result<Option<Records>, RecordsError> {
        let Some(folder) = self.folder else {
            return Ok(None);
        };
        match Records::open(&folder) {
            Ok(records) => Ok(Some(records)),
            Err(error) if self.asked => Err(error),
            Err(error) => {
                tracing::warn!(%error, "sessions and uploads last until the server stops");
                Ok(None)
            }
        }
    }
}

/// A thread that keeps sessions. It ends with the last round.
pub(super) struct Keeping {
    stop: mpsc::Sender<()>,
    thread: JoinHandle<()>,
}

impl Keeping {
    /// Keeps sessions every `interval`.
    pub(super) fn start(mut keeper: Keeper, interval: Duration) -> Result<Self, StartError> {
        let (stop, stopped) = mpsc::channel();
        let work = move || {
            let mut wait = interval;
            while let Err(RecvTimeoutError::Timeout) = stopped.recv_timeout(wait) {
                wait = keeper.go_on(interval);
            }
            keeper.go_on(interval);
        };
        let thread = std::thread::Builder::new().name("store".to_owned()).spawn(work);
        let thread = thread.map_err(|error| StartError::Internal(error.to_string()))?;
        Ok(Self { stop, thread })
    }

    /// A last round, and the end.
    pub(super) async fn finish(self) {
        let Self { stop, thread } = self;
        drop(stop);
        let ended = tokio::task::spawn_blocking(move || thread.join()).await;
        if !matches!(ended, Ok(Ok(()))) {
            tracing::error!("the thread that keeps sessions failed");
        }
    }
}
