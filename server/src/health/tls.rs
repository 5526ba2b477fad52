//! TLS of the health check: which certificates it trusts and shows.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use tokio_rustls::rustls::client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier};
use tokio_rustls::rustls::crypto::ring::default_provider;
use tokio_rustls::rustls::crypto::{CryptoProvider, verify_tls12_signature, verify_tls13_signature};
use tokio_rustls::rustls::pki_types::pem::{self, PemObject as _};
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer, ServerName, UnixTime};
use tokio_rustls::rustls::{
    CertificateError, ClientConfig, DigitallySignedStruct, Error, RootCertStore, SignatureScheme,
};

/// Why the health check cannot use certificates.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum HealthTlsError {
    /// A file cannot be read, or holds no certificate or key.
    #[error("{}: {error}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What went wrong.
        error: pem::Error,
    },
    /// Certificates that TLS cannot use.
    #[error("certificates: {0}")]
    Certificates(#[from] Error),
    /// An https URL, and no certificates to trust.
    #[error("--ca is missing; allowed: a file of certificates, because the URL is https")]
    NoCa,
}

/// Certificates that the health check trusts, and the one that it shows.
#[derive(Debug, Clone, Default)]
pub struct HealthTls {
    /// Authorities to trust (PEM file).
    pub ca: Option<PathBuf>,
    /// The only certificate to trust if there are no authorities: the server's own. Its name and
    /// validity period are not checked.
    pub own: Option<PathBuf>,
    /// Certificate and key to show (PEM files).
    pub client: Option<(PathBuf, PathBuf)>,
}

impl HealthTls {
    /// The configuration for the TLS client. If TLS is not `needed`, no certificates to trust are
    /// required.
    pub(super) fn config(&self, needed: bool) -> Result<ClientConfig, HealthTlsError> {
        let provider = Arc::new(default_provider());
        let builder =
            ClientConfig::builder_with_provider(provider.clone()).with_safe_default_protocol_versions()?;
        let builder = match (&self.ca, &self.own) {
            (None, None) if needed => return Err(HealthTlsError::NoCa),
            (None, Some(own)) if needed => {
                let certificate = certificates(own)?.swap_remove(0);
                let verifier = Arc::new(Pinned {
                    certificate,
                    provider,
                });
                builder.dangerous().with_custom_certificate_verifier(verifier)
            }
            (ca, _) => {
                let mut roots = RootCertStore::empty();
                for certificate in ca.as_deref().map(certificates).transpose()?.into_iter().flatten() {
                    roots.add(certificate)?;
                }
                builder.with_root_certificates(roots)
            }
        };
        Ok(match &self.client {
            None => builder.with_no_client_auth(),
            Some((certificate, key)) => {
                let file = |error| HealthTlsError::File {
                    path: key.clone(),
                    error,
                };
                let key = PrivateKeyDer::from_pem_file(key).map_err(file)?;
                builder.with_client_auth_cert(certificates(certificate)?, key)?
            }
        })
    }
}

/// The certificates in a PEM file. At least one.
fn certificates(path: &Path) -> Result<Vec<CertificateDer<'static>>, HealthTlsError> {
    let file = |error| HealthTlsError::File {
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

/// Trusts exactly one certificate, for any name.
#[derive(Debug)]
struct Pinned {
    certificate: CertificateDer<'static>,
    provider: Arc<CryptoProvider>,
}

impl ServerCertVerifier for Pinned {
    fn verify_server_cert(
        &self,
        shown: &CertificateDer<'_>,
        _: &[CertificateDer<'_>],
        _: &ServerName<'_>,
        _: &[u8],
        _: UnixTime,
    ) -> Result<ServerCertVerified, Error> {
        match *shown == self.certificate {
            true => Ok(ServerCertVerified::assertion()),
            false => Err(CertificateError::ApplicationVerificationFailure.into()),
        }
    }

    fn verify_tls12_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signature: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        let algorithms = &self.provider.signature_verification_algorithms;
        verify_tls12_signature(message, certificate, signature, algorithms)
    }

    fn verify_tls13_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signature: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        let algorithms = &self.provider.signature_verification_algorithms;
        verify_tls13_signature(message, certificate, signature, algorithms)
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        self.provider
            .signature_verification_algorithms
            .supported_schemes()
    }
}
