//! Who may use the server: everybody, or those with a key.

use std::net::SocketAddr;
use std::sync::Arc;

use super::StartError;
use crate::api::Keys;
use crate::config::Config;

/// The keys that a server asks for.
#[derive(Debug, Default)]
pub(super) struct Access {
    /// None where it asks for none.
    pub(super) keys: Option<Arc<Keys>>,
    /// The key itself, where it was made for this run.
    pub(super) one_time: Option<String>,
}

impl Access {
    /// What `config` says for a server that listens on `address`.
    ///
    /// # Errors
    /// [`StartError::Keys`] for a file that cannot be used, [`StartError::Anonymous`] where strangers could use the server and
    /// nobody has said that they may.
    pub(super) fn new(config: &Config, address: SocketAddr) -> Result<Self, StartError> {
        if let Some(path) = &config.keys {
            return Ok(Self {
                keys: Some(Arc::new(Keys::load(path)?)),
                one_time: None,
            });
        }
        if config.allow_anonymous {
            return Ok(Self::default());
        }
        if config.one_time_key {
            let (keys, key) = Keys::one_time();
            return Ok(Self {
                keys: Some(Arc::new(keys)),
                one_time: Some(key),
            });
        }
        match address.ip().to_canonical().is_loopback() {
            true => Ok(Self::default()),
            false => Err(StartError::Anonymous(address)),
        }
    }
}
