//! Who may use the server: everybody, or those with a key.

use std::net::SocketAddr;
use std::sync::Arc;

use super::StartError;
use super::reload::{Source, fingerprint};
use crate::api::{Credentials, Keys};
use crate::config::Config;

/// What a server asks for.
#[derive(Default)]
pub(super) struct Access {
    /// None where it asks for nothing.
    pub(super) credentials: Option<Arc<Credentials>>,
    /// The key itself, where it was made for this run.
    pub(super) one_time: Option<String>,
    /// What is read again when its file changes.
    pub(super) sources: Vec<Source>,
}

impl Access {
    /// What `config` says for a server that listens on `address`.
    ///
    /// # Errors
    /// [`StartError::Keys`] for a file that cannot be used, [`StartError::Anonymous`] where strangers could use the server and
    /// nobody has said that they may.
    pub(super) fn new(config: &Config, address: SocketAddr) -> Result<Self, StartError> {
        let local = address.ip().to_canonical().is_loopback();
        let access = Self::of(config)?;
        let locked = access.credentials.is_some();
        if locked && !local && config.tls_certificate.is_none() {
            tracing::warn!(
                listen = %address,
                "keys travel in plain text; set tls_certificate and tls_key, or end TLS in front of the server"
            );
        }
        match locked || config.allow_anonymous || local {
            true => Ok(access),
            false => Err(StartError::Anonymous(address)),
        }
    }

    fn of(config: &Config) -> Result<Self, StartError> {
        if let Some(path) = &config.keys {
            let files = vec![path.clone()];
            let seen = fingerprint(&files);
            let credentials = Arc::new(Credentials::new(Keys::load(path)?));
            let (again, path) = (credentials.clone(), path.clone());
            let read = move || Keys::load(&path).map(|keys| again.replace_keys(keys));
            return Ok(Self {
                credentials: Some(credentials),
                one_time: None,
                sources: vec![Source::new("keys", files, seen, read)],
            });
        }
        if config.one_time_key && !config.allow_anonymous {
            let (keys, key) = Keys::one_time();
            return Ok(Self {
                credentials: Some(Arc::new(Credentials::new(keys))),
                one_time: Some(key),
                sources: Vec::new(),
            });
        }
        Ok(Self::default())
    }
}
