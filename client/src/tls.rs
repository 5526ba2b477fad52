//! Certificates of a connection.

use std::path::PathBuf;

use tonic::transport::Endpoint;

use crate::error::ClientError;

/// Certificates, for https:// addresses.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct TlsOptions {
    /// Certificates of the authorities to trust (PEM file). None: those that the system trusts.
    pub ca: Option<PathBuf>,
    /// Certificate for a server that asks for one.
    pub client: Option<ClientCertificate>,
}

/// A client's certificate, for servers that ask for one (mTLS).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ClientCertificate {
    /// Path of the certificate (PEM file).
    pub certificate: PathBuf,
    /// Path of its private key (PEM file).
    pub key: PathBuf,
}

#[cfg(feature = "tls")]
pub(crate) fn with_tls(endpoint: Endpoint, url: &str, options: &TlsOptions) -> Result<Endpoint, ClientError> {
    use tonic::transport::{Certificate, ClientTlsConfig, Identity};

    use crate::error::deepest;

    let read = |path: &PathBuf| {
        std::fs::read(path).map_err(|e| ClientError::Certificate {
            path: path.clone(),
            reason: e.to_string(),
        })
    };
    let mut tls = match &options.ca {
        Some(ca) => ClientTlsConfig::new().ca_certificate(Certificate::from_pem(read(ca)?)),
        None => ClientTlsConfig::new().with_native_roots(),
    };
    if let Some(ClientCertificate { certificate, key }) = &options.client {
        tls = tls.identity(Identity::from_pem(read(certificate)?, read(key)?));
    }
    endpoint.tls_config(tls).map_err(|e| ClientError::Address {
        url: url.to_owned(),
        reason: deepest(&e),
    })
}

#[cfg(not(feature = "tls"))]
pub(crate) fn with_tls(_: Endpoint, url: &str, _: &TlsOptions) -> Result<Endpoint, ClientError> {
    Err(ClientError::Address {
        url: url.to_owned(),
        reason: "https:// needs the feature `tls` of troupe-client".to_owned(),
    })
}
