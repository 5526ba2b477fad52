//! Key and certificates of the load tester. Reports do not contain them.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use http::HeaderValue;
use hyper_rustls::{ConfigBuilderExt as _, HttpsConnector, HttpsConnectorBuilder};
use hyper_util::client::legacy::connect::HttpConnector;
use serde::{Deserialize, Serialize};
use tokio_rustls::rustls::crypto::ring::default_provider;
use tokio_rustls::rustls::pki_types::pem::PemObject as _;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio_rustls::rustls::{ClientConfig, RootCertStore};
use troupe_client::{ClientCertificate, ConnectOptions, TlsOptions};

use crate::failure::Failure;

/// The credentials for a server.
#[derive(Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Access {
    /// API key, sent as a bearer token.
    pub key: Option<String>,
    /// PEM file of the authorities to trust. `None`: the authorities of the system.
    pub ca: Option<PathBuf>,
    /// PEM files of a client certificate and its private key.
    pub client: Option<(PathBuf, PathBuf)>,
}

impl fmt::Debug for Access {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Access")
            .field("ca", &self.ca)
            .field("client", &self.client)
            .finish_non_exhaustive()
    }
}

impl Access {
    /// The TLS options of the client library.
    pub(crate) fn options(&self) -> ConnectOptions {
        let client = self.client.clone();
        ConnectOptions {
            key: self.key.clone().map(Into::into),
            tls: TlsOptions {
                ca: self.ca.clone(),
                client: client.map(|(certificate, key)| ClientCertificate { certificate, key }),
            },
            ..ConnectOptions::default()
        }
    }

    /// The header that carries the key.
    pub(crate) fn bearer(&self) -> Result<Option<HeaderValue>, Failure> {
        let Some(key) = &self.key else { return Ok(None) };
        let mut value = HeaderValue::try_from(format!("Bearer {key}"))
            .map_err(|_| Failure::Input("--key has characters that a key cannot have".to_owned()))?;
        value.set_sensitive(true);
        Ok(Some(value))
    }

    /// Connects to `http://` and `https://` addresses, over HTTP/1.1.
    pub(crate) fn connector(
        &self,
        mut plain: HttpConnector,
    ) -> Result<HttpsConnector<HttpConnector>, Failure> {
        plain.enforce_http(false);
        let builder = HttpsConnectorBuilder::new().with_tls_config(self.tls()?);
        Ok(builder.https_or_http().enable_http1().wrap_connector(plain))
    }

    fn tls(&self) -> Result<ClientConfig, Failure> {
        let fault = |e: tokio_rustls::rustls::Error| Failure::Input(format!("certificates: {e}"));
        let builder = ClientConfig::builder_with_provider(Arc::new(default_provider()))
            .with_safe_default_protocol_versions()
            .map_err(fault)?;
        let builder = match &self.ca {
            Some(ca) => {
                let mut roots = RootCertStore::empty();
                for certificate in certificates(ca)? {
                    roots.add(certificate).map_err(|e| Failure::file(ca, e))?;
                }
                builder.with_root_certificates(roots)
            }
            // A machine without authorities may still reach plain servers.
            None => match builder.clone().with_native_roots() {
                Ok(builder) => builder,
                Err(_) => builder.with_root_certificates(RootCertStore::empty()),
            },
        };
        match &self.client {
            None => Ok(builder.with_no_client_auth()),
            Some((certificate, key)) => {
                let read = PrivateKeyDer::from_pem_file(key).map_err(|e| Failure::file(key, e))?;
                builder
                    .with_client_auth_cert(certificates(certificate)?, read)
                    .map_err(fault)
            }
        }
    }
}

fn certificates(path: &Path) -> Result<Vec<CertificateDer<'static>>, Failure> {
    let fault = |e| Failure::file(path, e);
    let found = CertificateDer::pem_file_iter(path).map_err(fault)?;
    found.collect::<Result<_, _>>().map_err(fault)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_does_not_show() {
        let access = Access {
            key: Some("troupe_1".to_owned()),
            ..Access::default()
        };
        let bearer = access.bearer().unwrap().unwrap();
        assert_eq!(bearer, "Bearer troupe_1");
        assert!(!format!("{access:?}{bearer:?}").contains("troupe_1"));
        assert!(Access::default().bearer().unwrap().is_none());
    }
}
