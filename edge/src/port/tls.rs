//! TLS: the server's certificate, and the authorities of clients' certificates.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use arc_swap::ArcSwap;
use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::crypto::ring::default_provider;
use tokio_rustls::rustls::pki_types::pem::{self, PemObject as _};
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio_rustls::rustls::server::WebPkiClientVerifier;
use tokio_rustls::rustls::{self, RootCertStore, ServerConfig};

/// The port's protocols, the preferred first.
const ALPN: [&[u8]; 2] = [b"h2", b"http/1.1"];

/// Why certificates cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TlsError {
    /// A file cannot be read, or does not have a certificate or key.
    #[error("{option}: {}: {error}", path.display())]
    File {
        /// The option that names it.
        option: &'static str,
        /// The file.
        path: PathBuf,
        /// What went wrong.
        error: pem::Error,
    },
    /// A certificate is invalid, or does not belong to the key.
    #[error("{option}: {}: {reason}", path.display())]
    Certificate {
        /// The option that names its file.
        option: &'static str,
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
}

/// The PEM files of a server with TLS.
#[derive(Debug, Clone)]
pub struct TlsFiles {
    /// The server's certificate, followed by those of its issuers.
    pub certificate: PathBuf,
    /// The private key of the server's certificate.
    pub key: PathBuf,
    /// Certificates of authorities that sign clients' certificates. If none, clients need no
    /// certificate.
    pub client_ca: Option<PathBuf>,
}

impl TlsFiles {
    /// The paths of all files.
    pub fn paths(&self) -> Vec<PathBuf> {
        let both = [&self.certificate, &self.key].into_iter();
        both.chain(&self.client_ca).cloned().collect()
    }

    fn read(&self) -> Result<Arc<ServerConfig>, TlsError> {
        let provider = Arc::new(default_provider());
        let certificate = |reason: String| TlsError::Certificate {
            option: "tls_certificate",
            path: self.certificate.clone(),
            reason,
        };
        let builder = ServerConfig::builder_with_provider(provider.clone())
            .with_safe_default_protocol_versions()
            .map_err(|error| certificate(error.to_string()))?;
        let builder = match &self.client_ca {
            None => builder.with_no_client_auth(),
            Some(path) => {
                let roots = Arc::new(roots(path)?);
                let verifier = WebPkiClientVerifier::builder_with_provider(roots, provider).build();
                builder.with_client_cert_verifier(verifier.map_err(|error| client_ca(path, &error))?)
            }
        };
        let key = PrivateKeyDer::from_pem_file(&self.key).map_err(|error| TlsError::File {
            option: "tls_key",
            path: self.key.clone(),
            error,
        })?;
        let chain = certificates("tls_certificate", &self.certificate)?;
        let mut config = builder
            .with_single_cert(chain, key)
            .map_err(|error| match error {
                rustls::Error::InconsistentKeys(_) => certificate(format!(
                    "it does not belong to the key in {} (tls_key)",
                    self.key.display()
                )),
                error => certificate(error.to_string()),
            })?;
        config.alpn_protocols = ALPN.map(<[u8]>::to_vec).to_vec();
        Ok(Arc::new(config))
    }
}

/// The certificates of a PEM file, at least one.
fn certificates(option: &'static str, path: &Path) -> Result<Vec<CertificateDer<'static>>, TlsError> {
    let file = |error| TlsError::File {
        option,
        path: path.to_owned(),
        error,
    };
    let found = CertificateDer::pem_file_iter(path).map_err(file)?;
    let found: Vec<_> = found.collect::<Result<_, _>>().map_err(file)?;
    match found.is_empty() {
        true => Err(file(pem::Error::NoItemsFound)),
        false => Ok(found),
    }
}

fn roots(path: &Path) -> Result<RootCertStore, TlsError> {
    let mut roots = RootCertStore::empty();
    for certificate in certificates("tls_client_ca", path)? {
        roots.add(certificate).map_err(|error| client_ca(path, &error))?;
    }
    Ok(roots)
}

fn client_ca(path: &Path, error: &dyn std::fmt::Display) -> TlsError {
    TlsError::Certificate {
        option: "tls_client_ca",
        path: path.to_owned(),
        reason: error.to_string(),
    }
}

/// The TLS configuration of a server. It can be replaced; new connections get the current one.
pub struct Tls {
    files: TlsFiles,
    current: ArcSwap<ServerConfig>,
}

impl Tls {
    /// Reads the configuration from `files`.
    ///
    /// # Errors
    /// [`TlsError`], which names the option and the file.
    pub fn load(files: TlsFiles) -> Result<Self, TlsError> {
        let current = ArcSwap::new(files.read()?);
        Ok(Self { files, current })
    }

    /// Reads the files again. Open connections keep their configuration.
    ///
    /// # Errors
    /// [`TlsError`]; then the old configuration stays in use.
    pub fn reload(&self) -> Result<(), TlsError> {
        self.current.store(self.files.read()?);
        Ok(())
    }

    /// Does the TLS handshakes of new connections.
    pub(super) fn acceptor(&self) -> TlsAcceptor {
        TlsAcceptor::from(self.current.load_full())
    }
}
