//! The options whose cost is measured, with the key, the certificate and the collector of traces
//! that they need.

use std::path::Path;

use anyhow::Context as _;
use opentelemetry_proto::tonic::collector::trace::v1::trace_service_server::{
    TraceService, TraceServiceServer,
};
use opentelemetry_proto::tonic::collector::trace::v1::{
    ExportTraceServiceRequest, ExportTraceServiceResponse,
};
use tokio::net::TcpListener;
use tokio::runtime::Runtime;
use tokio_stream::wrappers::TcpListenerStream;
use tonic::{Request, Response, Status};

use crate::host::program::Home;

/// An option of the server.
pub struct Measured {
    pub name: &'static str,
    /// Flags of the server with it, and what its clients need.
    pub given: fn(&Setup) -> anyhow::Result<Given>,
}

/// All options. Without them the server has no keys, no TLS, no store and no collector.
pub const OPTIONS: [Measured; 5] = [
    Measured {
        name: "keys",
        given: Setup::keys,
    },
    Measured {
        name: "tls",
        given: Setup::tls,
    },
    Measured {
        name: "snapshots",
        given: Setup::snapshots,
    },
    Measured {
        name: "traces",
        given: Setup::traces,
    },
    Measured {
        name: "traces-of-all",
        given: Setup::traces_of_all,
    },
];

/// Flags of a server, and what its clients need.
#[derive(Debug, Clone, Default)]
pub struct Given {
    pub flags: Vec<String>,
    pub key: Option<String>,
    /// File of the certificate that clients trust. With it the server speaks TLS.
    pub ca: Option<String>,
}

impl Given {
    /// Address of the server for clients.
    pub fn url(&self, home: &Home) -> String {
        match self.ca {
            None => home.url(),
            Some(_) => format!("https://{}", home.address()),
        }
    }
}

/// What the options need.
pub struct Setup {
    /// A key, and the file of keys with its entry.
    key: (String, String),
    /// Files of a certificate and of its private key.
    tls: (String, String),
    /// File of a configuration without a store.
    no_store: String,
    /// Address of a collector, which lives as long as this value.
    collector: String,
    _runtime: Runtime,
}

impl Setup {
    /// Makes a key and a certificate in the home's folder, and starts a collector.
    pub fn new(home: &Home) -> anyhow::Result<Self> {
        let text = |path: &Path| path.to_str().map(str::to_owned).context("a path that is no text");
        let write = |name: &str, content: &str| {
            let path = home.folder().join(name);
            std::fs::write(&path, content)?;
            text(&path)
        };
        // The entry has the key in a comment.
        let entry = home.output(&["key", "new", "--name", "load", "--role", "admin"])?;
        let key = entry.split_whitespace().find(|word| word.starts_with("troupe_"));
        let key = key.context("there is no key in what `troupe-server key new` prints")?;
        let names = ["localhost".to_owned(), "127.0.0.1".to_owned()];
        let made = rcgen::generate_simple_self_signed(names)?;
        let runtime = Runtime::new()?;
        let listener = runtime.block_on(TcpListener::bind("127.0.0.1:0"))?;
        let collector = format!("http://{}", listener.local_addr()?);
        let serving = tonic::transport::Server::builder()
            .add_service(TraceServiceServer::new(Collector))
            .serve_with_incoming(TcpListenerStream::new(listener));
        runtime.spawn(serving);
        Ok(Self {
            key: (key.to_owned(), write("keys.toml", &entry)?),
            tls: (
                write("server.pem", &made.cert.pem())?,
                write("server.key", &made.signing_key.serialize_pem())?,
            ),
            no_store: write("no-store.toml", "store = \"\"\n")?,
            collector,
            _runtime: runtime,
        })
    }

    /// Without any of the options.
    pub fn without(&self) -> Given {
        Given {
            flags: ["--config", &self.no_store].map(str::to_owned).to_vec(),
            ..Given::default()
        }
    }

    fn with(&self, more: &[&str]) -> Given {
        let mut given = self.without();
        given.flags.extend(more.iter().map(|&flag| flag.to_owned()));
        given
    }

    fn keys(&self) -> anyhow::Result<Given> {
        Ok(Given {
            key: Some(self.key.0.clone()),
            ..self.with(&["--keys", &self.key.1])
        })
    }

    fn tls(&self) -> anyhow::Result<Given> {
        let (certificate, key) = &self.tls;
        Ok(Given {
            ca: Some(certificate.clone()),
            ..self.with(&["--tls-certificate", certificate, "--tls-key", key])
        })
    }

    /// The store that a server has by default.
    fn snapshots(&self) -> anyhow::Result<Given> {
        Ok(Given::default())
    }

    fn traces(&self) -> anyhow::Result<Given> {
        Ok(self.with(&["--otlp-endpoint", &self.collector]))
    }

    fn traces_of_all(&self) -> anyhow::Result<Given> {
        Ok(self.with(&["--otlp-endpoint", &self.collector, "--trace-sample-ratio", "1"]))
    }
}

/// A collector that forgets what it gets.
struct Collector;

#[tonic::async_trait]
impl TraceService for Collector {
    async fn export(
        &self,
        _: Request<ExportTraceServiceRequest>,
    ) -> Result<Response<ExportTraceServiceResponse>, Status> {
        Ok(Response::new(ExportTraceServiceResponse::default()))
    }
}
