//! The connection to a server. It has a thread of its own, which knows nothing of the engine, so
//! that no frame of a game waits for the network.

mod actor;
mod cast;
mod note;
mod opening;
mod orders;
mod stage;

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use thiserror::Error;
use tokio::runtime;
use tokio::sync::Notify;
use troupe_client::{ApiKey, ClientCertificate, ClientError, ConnectOptions, Rate, TlsOptions};

pub use self::actor::{Actor, Pose, Wanted};
pub use self::note::Note;
pub use self::orders::{Order, OrderError, Orders};

/// How to connect. Texts that are empty take the defaults.
#[derive(Debug, Clone, Default)]
pub struct LinkOptions {
    /// Address of the server.
    pub url: String,
    /// Key of the client.
    pub key: String,
    /// File (PEM) with the certificates of the authorities to trust. Default: those of the system.
    pub ca_file: String,
    /// File (PEM) with the client's certificate.
    pub certificate_file: String,
    /// File (PEM) with the private key of the client's certificate.
    pub key_file: String,
    /// Frames a second.
    pub rate: Rate,
}

/// Why there is no connection.
#[derive(Debug, Error)]
pub enum LinkError {
    /// The thread cannot be started.
    #[error("the thread of the connection does not start: {0}")]
    Thread(#[from] std::io::Error),
    /// One of two files is named alone.
    #[error("{given} is set, so {missing} must be set too")]
    Pair {
        /// The one that is named.
        given: &'static str,
        /// The other one.
        missing: &'static str,
    },
    /// The client's error.
    #[error(transparent)]
    Client(#[from] ClientError),
}

impl LinkOptions {
    fn connect_options(&self) -> Result<ConnectOptions, LinkError> {
        let given = |text: &str| Some(text.to_owned()).filter(|text| !text.is_empty());
        let file = |text: &str| given(text).map(PathBuf::from);
        let pair = |given, missing| Err(LinkError::Pair { given, missing });
        let client = match (file(&self.certificate_file), file(&self.key_file)) {
            (Some(certificate), Some(key)) => Some(ClientCertificate { certificate, key }),
            (None, None) => None,
            (Some(_), None) => return pair("certificate_file", "key_file"),
            (None, Some(_)) => return pair("key_file", "certificate_file"),
        };
        Ok(ConnectOptions {
            key: given(&self.key).map(ApiKey::from),
            tls: TlsOptions {
                ca: file(&self.ca_file),
                client,
            },
            ..ConnectOptions::default()
        })
    }
}

/// How far a connection is.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum Status {
    /// It is being opened.
    #[default]
    Opening,
    /// It is open.
    Open,
    /// It could not be opened, or is over.
    Failed(String),
}

/// Characters whose commands wait, or that come or go.
#[derive(Default)]
struct Wake {
    changed: Mutex<Vec<Arc<Actor>>>,
    notify: Notify,
}

impl Wake {
    fn changed(&self, actor: &Arc<Actor>) {
        let mut changed = self.changed.lock().unwrap_or_else(PoisonError::into_inner);
        if !changed.iter().any(|other| Arc::ptr_eq(other, actor)) {
            changed.push(actor.clone());
        }
        drop(changed);
        self.notify.notify_one();
    }

    fn take(&self) -> Vec<Arc<Actor>> {
        std::mem::take(&mut *self.changed.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

#[derive(Default)]
struct Shared {
    status: Mutex<Status>,
    wake: Arc<Wake>,
    stop: Notify,
}

impl Shared {
    fn status(&self) -> MutexGuard<'_, Status> {
        self.status.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A connection with one stream, on which any number of characters come and go.
pub struct Link {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Link {
    /// Begins to connect.
    ///
    /// # Errors
    /// [`LinkError::Thread`] and [`LinkError::Pair`]. What comes later is in [`Self::status`].
    pub fn open(options: &LinkOptions) -> Result<Self, LinkError> {
        let connect = options.connect_options()?;
        let (url, rate) = (options.url.clone(), options.rate);
        let runtime = runtime::Builder::new_current_thread().enable_all().build()?;
        let shared = Arc::new(Shared::default());
        let of_thread = shared.clone();
        let thread = std::thread::Builder::new()
            .name("troupe".to_owned())
            .spawn(move || {
                runtime.block_on(stage::run(&url, connect, rate, &of_thread));
            })?;
        Ok(Self {
            shared,
            thread: Some(thread),
        })
    }

    /// How far the connection is.
    pub fn status(&self) -> Status {
        self.shared.status().clone()
    }

    /// Adds a character. Its notes say how that goes.
    pub fn join(&self, wanted: Wanted) -> Arc<Actor> {
        let actor = Arc::new(Actor::new(wanted, self.shared.wake.clone()));
        // The thread sets the status before it looks at the list for the last time.
        let status = self.shared.status();
        match &*status {
            Status::Failed(message) => actor.fail(message.clone()),
            Status::Opening | Status::Open => self.shared.wake.changed(&actor),
        }
        actor
    }

    /// Ends the connection, and closes its characters on the server. The thread goes on with that
    /// for two seconds at most.
    pub fn close(mut self) -> Option<JoinHandle<()>> {
        self.thread.take()
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        self.shared.stop.notify_one();
    }
}

#[cfg(test)]
#[path = "link_tests.rs"]
mod tests;
