//! The real server, in this process, with a pack of the repository.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::Duration;

use serde_json::Value;
use tokio::net::TcpListener;
use tonic::Code;
use tonic::transport::{Channel, Endpoint};
use tonic_types::StatusExt as _;
use troupe_client::{Client, Pack};
use troupe_proto::v1;
use troupe_proto::v1::motion_client::MotionClient;
use troupe_server::config::Config;
use troupe_server::server::{ServerHandle, serve};

/// The generated gRPC client, without `troupe-client`.
pub type Rpc = MotionClient<Channel>;

/// A running server and ways to call it.
pub struct Server {
    address: SocketAddr,
    url: String,
    handle: Option<ServerHandle>,
}

/// The folder of the pack to test with: `models/human`, or the folder in TROUPE_TEST_PACK.
pub fn pack_folder() -> Result<PathBuf, String> {
    if let Some(folder) = std::env::var_os("TROUPE_TEST_PACK") {
        return Ok(PathBuf::from(folder));
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/human");
    if folder.join("pack.toml").is_file() {
        return Ok(folder);
    }
    Err(
        "models/human has no pack.toml: train and export a pack, or set TROUPE_TEST_PACK to another folder"
            .to_owned(),
    )
}

/// The server of all tests that neither count its requests nor stop it.
pub fn shared() -> &'static Server {
    static SHARED: OnceLock<Result<Server, String>> = OnceLock::new();
    // Each test has a runtime of its own. The server needs one that outlives them all.
    let started = SHARED.get_or_init(|| {
        let (send, receive) = std::sync::mpsc::channel();
        std::thread::spawn(move || {
            let runtime = tokio::runtime::Builder::new_multi_thread()
                .worker_threads(2)
                .enable_all()
                .build();
            runtime.expect("a runtime").block_on(async move {
                send.send(Server::try_start(|_| {}).await).expect("a receiver");
                std::future::pending::<()>().await;
            });
        });
        receive.recv().map_err(|e| e.to_string())?
    });
    started
        .as_ref()
        .unwrap_or_else(|why| panic!("the server does not start: {why}"))
}

impl Server {
    /// Starts a server on a free port, after a change of the local configuration, and waits
    /// until it is ready.
    pub async fn start_with(change: impl FnOnce(&mut Config)) -> Self {
        Self::try_start(change)
            .await
            .unwrap_or_else(|why| panic!("the server does not start: {why}"))
    }

    async fn try_start(change: impl FnOnce(&mut Config)) -> Result<Self, String> {
        let mut config = Config::local(&pack_folder()?).map_err(|e| e.to_string())?;
        change(&mut config);
        let listener = TcpListener::bind(config.listen)
            .await
            .map_err(|e| e.to_string())?;
        let mut handle = serve(config, listener).await.map_err(|e| e.to_string())?;
        handle.ready().await.map_err(|e| e.to_string())?;
        let address = handle.address();
        Ok(Self {
            address,
            url: format!("http://{address}"),
            handle: Some(handle),
        })
    }

    /// Stops the server and returns whether all requests finished in time.
    pub async fn stop(mut self) -> bool {
        self.handle.take().expect("a running server").shut_down().await
    }

    pub fn address(&self) -> SocketAddr {
        self.address
    }

    pub fn url(&self) -> &str {
        &self.url
    }

    /// The URL of a path on the server.
    pub fn path(&self, path: &str) -> String {
        format!("{}{path}", self.url)
    }

    pub async fn channel(&self) -> Channel {
        let endpoint = Endpoint::from_shared(self.url.clone()).expect("an address");
        endpoint
            .timeout(Duration::from_secs(60))
            .connect()
            .await
            .expect("a connection")
    }

    /// A new connection for the generated gRPC client.
    pub async fn rpc(&self) -> Rpc {
        MotionClient::new(self.channel().await).max_decoding_message_size(64 << 20)
    }

    /// A connected client and the server's default pack.
    pub async fn client(&self) -> (Client, Pack) {
        let client = Client::connect(&self.url).await.expect("a connection");
        let pack = client.pack("").await.expect("the default pack");
        (client, pack)
    }

    /// The server's default pack.
    pub async fn pack(&self) -> Pack {
        self.client().await.1
    }

    /// Sends a request as JSON.
    pub async fn post(&self, request: &v1::InBetweenRequest) -> Result<v1::InBetweenResponse, ErrorAnswer> {
        self.post_text(serde_json::to_string(request).expect("JSON"))
            .await
    }

    /// Sends a body as JSON, even if it is none.
    pub async fn post_text(&self, body: String) -> Result<v1::InBetweenResponse, ErrorAnswer> {
        let request = reqwest::Client::new().post(self.path("/v1/inbetween")).body(body);
        let answer = request
            .header("content-type", "application/json")
            .send()
            .await
            .expect("an answer");
        let status = answer.status();
        let text = answer.text().await.expect("text");
        if status.is_success() {
            return Ok(serde_json::from_str(&text).expect("an answer as documented"));
        }
        let error: Value = serde_json::from_str(&text).expect("an error as documented");
        Err(ErrorAnswer::from_json(status.as_u16(), &error["error"]))
    }
}

/// An error over gRPC or HTTP.
#[derive(Debug)]
pub struct ErrorAnswer {
    /// The gRPC code; `None` over HTTP.
    pub grpc: Option<Code>,
    /// The HTTP status; `None` over gRPC.
    pub http: Option<u16>,
    pub message: String,
    /// The path of the field at fault in the request.
    pub field: Option<String>,
    /// The allowed values of the field.
    pub allowed: Option<String>,
}

impl ErrorAnswer {
    /// Reads the `google.rpc` details. `BadRequest` and the metadata of `ErrorInfo` must name the
    /// same field.
    pub fn from_status(status: &tonic::Status) -> Self {
        let details = status.get_error_details();
        let metadata = |key| {
            details
                .error_info()
                .and_then(|info| info.metadata.get(key))
                .cloned()
        };
        let field = metadata("field");
        if status.code() == Code::InvalidArgument
            && let Some(field) = &field
        {
            let violations = &details
                .bad_request()
                .expect("google.rpc.BadRequest")
                .field_violations;
            assert_eq!(violations.iter().map(|v| &v.field).collect::<Vec<_>>(), [field]);
        }
        Self {
            grpc: Some(status.code()),
            http: None,
            message: status.message().to_owned(),
            field,
            allowed: metadata("allowed"),
        }
    }

    fn from_json(status: u16, error: &Value) -> Self {
        let text = |key: &str| error[key].as_str().map(str::to_owned);
        Self {
            grpc: None,
            http: Some(status),
            message: text("message").expect("a message"),
            field: text("field"),
            allowed: text("allowed"),
        }
    }
}
