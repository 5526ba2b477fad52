//! Who may use the server: everyone, or callers with a key.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;

use super::StartError;
use crate::config::{Config, WithoutKeys};
use troupe_edge::credentials::Credentials;
use troupe_edge::keys::Keys;
use troupe_edge::reload::{Source, fingerprint};
use troupe_edge::tokens::{TokenRules, Tokens};

/// Credentials that a server requires.
#[derive(Default)]
pub(super) struct Access {
    /// None: the server requires no credentials.
    pub(super) credentials: Option<Arc<Credentials>>,
    /// The key for this run, if the server made one.
    pub(super) one_time: Option<String>,
    /// Files to read again when they change.
    pub(super) sources: Vec<Source>,
}

impl Access {
    /// The credentials that `config` names for a server that listens on `address`.
    ///
    /// # Errors
    /// [`StartError::Keys`] if a file cannot be used. [`StartError::Anonymous`] if other machines
    /// could use the server without a key, and no option allows it.
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
        match locked || config.without_keys == WithoutKeys::Anyone || local {
            true => Ok(access),
            false => Err(StartError::Anonymous(address)),
        }
    }

    fn of(config: &Config) -> Result<Self, StartError> {
        let (mut sources, mut own, mut one_time) = (Vec::new(), Keys::default(), None);
        let from_files = config.keys.is_some() || config.jwks.is_some();
        if !from_files && config.without_keys != WithoutKeys::OneTimeKey {
            return Ok(Self::default());
        }
        if !from_files {
            let (keys, key) = Keys::one_time();
            (own, one_time) = (keys, Some(key));
        }
        if let Some(path) = &config.metrics_key {
            own = own.and(Keys::of_metrics(path)?);
        }
        let files = |path: &Option<PathBuf>| path.iter().cloned().collect::<Vec<_>>();
        let (key_files, token_files) = (files(&config.keys), files(&config.jwks));
        let seen = (fingerprint(&key_files), fingerprint(&token_files));
        let keys = config.keys.as_deref().map(Keys::load).transpose()?;
        let rules = TokenRules {
            issuer: config.jwt_issuer.clone(),
            audience: config.jwt_audience.clone(),
        };
        let tokens = config
            .jwks
            .as_deref()
            .map(|path| Tokens::load(path, &rules))
            .transpose()?;
        let credentials = Arc::new(Credentials::new(keys.unwrap_or_default(), own, tokens));
        if let Some(path) = config.keys.clone() {
            let again = credentials.clone();
            let read = move || Keys::load(&path).map(|keys| again.replace_keys(keys));
            sources.push(Source::new("keys", key_files, seen.0, read));
        }
        if let Some(path) = config.jwks.clone() {
            let again = credentials.clone();
            let read = move || Tokens::load(&path, &rules).map(|tokens| again.replace_tokens(tokens));
            sources.push(Source::new("keys of tokens", token_files, seen.1, read));
        }
        Ok(Self {
            credentials: Some(credentials),
            one_time,
            sources,
        })
    }
}

#[cfg(test)]
mod tests {
    use std::io;
    use std::path::Path;
    use std::sync::Mutex;

    use super::*;

    /// What was logged.
    #[derive(Clone, Default)]
    struct Log(Arc<Mutex<Vec<u8>>>);

    impl io::Write for Log {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().unwrap().extend_from_slice(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn keys_that_travel_in_plain_text_cause_one_warning() {
        let log = Log::default();
        let writer = log.clone();
        let logging = tracing_subscriber::fmt()
            .with_ansi(false)
            .with_writer(move || writer.clone());
        let _logging = tracing::subscriber::set_default(logging.finish());
        let mut config = Config::local(Path::new("unused")).unwrap();
        config.without_keys = WithoutKeys::OneTimeKey;
        let warnings = |config: &Config, ip: [u8; 4]| {
            log.0.lock().unwrap().clear();
            Access::new(config, SocketAddr::from((ip, 8080))).unwrap();
            let text = String::from_utf8(log.0.lock().unwrap().clone()).unwrap();
            text.matches("keys travel in plain text").count()
        };
        assert_eq!(warnings(&config, [0, 0, 0, 0]), 1);
        assert_eq!(warnings(&config, [127, 0, 0, 1]), 0);
        config.tls_certificate = Some("server.pem".into());
        assert_eq!(warnings(&config, [0, 0, 0, 0]), 0);
        config.tls_certificate = None;
        config.without_keys = WithoutKeys::Anyone;
        assert_eq!(warnings(&config, [0, 0, 0, 0]), 0);
    }
}
