//! The connection to a server, and the calls about packs and single requests.

use std::time::Duration;

use tonic::metadata::{Ascii, MetadataValue};
use tonic::service::Interceptor;
use tonic::service::interceptor::InterceptedService;
use tonic::transport::{Channel, Endpoint};
use tonic::{Request, Status};
use troupe_proto::v1::motion_client::MotionClient;
use troupe_proto::v1::scenes_client::ScenesClient;
use troupe_proto::v1::sessions_client::SessionsClient;
use troupe_proto::v1::skeletons_client::SkeletonsClient;
use troupe_proto::v1::{GetPackRequest, InBetweenRequest, ListPacksRequest, Timing};

use crate::error::{AnswerError, ClientError, RequestError, deepest};
use crate::inbetween::{InBetween, InBetweenAnswer};
use crate::pack::Pack;
use crate::route::{Route, Way};
use crate::tls::{TlsOptions, with_tls};

/// How a [`Client`] connects.
#[derive(Debug, Clone, PartialEq)]
pub struct ConnectOptions {
    /// Time to open the connection.
    pub connect_timeout: Duration,
    /// Time for one call, from its first byte to the last of the answer.
    pub request_timeout: Duration,
    /// Largest message in either direction, bytes.
    pub max_message_bytes: usize,
    /// The API key, if the server asks for one.
    pub key: Option<ApiKey>,
    /// Certificates, for https:// addresses. These need the feature `tls`.
    pub tls: TlsOptions,
    /// What calls about sessions are routed by, where several servers share them. None: a name that
    /// no other client has.
    pub route: Option<Route>,
}

/// An API key. It does not show in debug output.
#[derive(Clone, PartialEq, Eq)]
pub struct ApiKey(String);

impl ApiKey {
    /// The key itself.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl From<String> for ApiKey {
    fn from(key: String) -> Self {
        Self(key)
    }
}

impl std::fmt::Debug for ApiKey {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("ApiKey")
    }
}

impl std::str::FromStr for ApiKey {
    type Err = std::convert::Infallible;

    fn from_str(key: &str) -> Result<Self, Self::Err> {
        Ok(Self(key.to_owned()))
    }
}

impl Default for ConnectOptions {
    /// 5 s to connect, 60 s for a call, 64 MiB for a message.
    fn default() -> Self {
        Self {
            connect_timeout: Duration::from_secs(5),
            request_timeout: Duration::from_secs(60),
            max_message_bytes: 64 << 20,
            key: None,
            tls: TlsOptions::default(),
            route: None,
        }
    }
}

/// A connection to a Troupe server. Clones share it, and may be used at the same time.
#[derive(Debug, Clone)]
pub struct Client {
    url: String,
    options: ConnectOptions,
    connection: Channel,
    /// Without a route, for calls that any server answers.
    channel: KeyedChannel,
    pub(crate) way: Way,
    pub(crate) rpc: MotionClient<KeyedChannel>,
    sessions: SessionsRpc,
    skeletons: SkeletonsRpc,
    bearer: Bearer,
}

/// The generated client of sessions.
pub(crate) type SessionsRpc = SessionsClient<KeyedChannel>;
/// The generated client of scenes.
pub(crate) type ScenesRpc = ScenesClient<KeyedChannel>;
/// The generated client of skeletons.
pub(crate) type SkeletonsRpc = SkeletonsClient<KeyedChannel>;
/// A channel whose calls carry the key, and the route if they are about sessions.
pub type KeyedChannel = InterceptedService<Channel, Bearer>;

/// Puts the key and the route on calls.
#[derive(Debug, Clone)]
pub struct Bearer {
    key: Option<MetadataValue<Ascii>>,
    way: Option<Way>,
}

impl Bearer {
    fn new(url: &str, key: Option<&ApiKey>) -> Result<Self, ClientError> {
        let value = key.map(|ApiKey(key)| format!("Bearer {key}").parse::<MetadataValue<Ascii>>());
        let mut value = value.transpose().map_err(|_| ClientError::Address {
            url: url.to_owned(),
            reason: "the key has characters that a key cannot have".to_owned(),
        })?;
        if let Some(value) = &mut value {
            value.set_sensitive(true);
        }
        Ok(Self {
            key: value,
            way: None,
        })
    }

    fn on(&self, way: &Way) -> Self {
        Self {
            key: self.key.clone(),
            way: Some(way.clone()),
        }
    }
}

impl Interceptor for Bearer {
    fn call(&mut self, mut request: Request<()>) -> Result<Request<()>, Status> {
        if let Some(value) = &self.key {
            request.metadata_mut().insert("authorization", value.clone());
        }
        if let Some(way) = &self.way {
            way.mark(request.metadata_mut());
        }
        Ok(request)
    }
}

/// The answer to one in-betweening request.
#[derive(Debug, Clone)]
pub struct InBetweenAnswers {
    /// Name of the pack that answered.
    pub pack: String,
    /// Version of the pack that answered.
    pub pack_version: String,
    /// One for each character, in the order of the request.
    pub characters: Vec<InBetweenAnswer>,
    /// Times of the parts of the call on the server.
    pub timing: Timing,
}

impl Client {
    /// Connects to a server such as `http://127.0.0.1:8080`, with the default options.
    ///
    /// # Errors
    /// [`ClientError::Address`] and [`ClientError::Unreachable`].
    pub async fn connect(url: &str) -> Result<Self, ClientError> {
        Self::connect_with(url, ConnectOptions::default()).await
    }

    /// Connects to a server.
    ///
    /// # Errors
    /// [`ClientError::Address`] and [`ClientError::Unreachable`].
    pub async fn connect_with(url: &str, options: ConnectOptions) -> Result<Self, ClientError> {
        let connection = dial(url, &options, |endpoint| endpoint).await?;
        Self::on(connection, url, options)
    }

    /// A client with another route on the same connection.
    ///
    /// # Errors
    /// [`RequestError::Route`](crate::RequestError::Route) if the name cannot be sent.
    pub fn routed(&self, route: Route) -> Result<Self, ClientError> {
        let options = ConnectOptions {
            route: Some(route),
            ..self.options.clone()
        };
        Self::on(self.connection.clone(), &self.url, options)
    }

    fn on(connection: Channel, url: &str, options: ConnectOptions) -> Result<Self, ClientError> {
        let bearer = Bearer::new(url, options.key.as_ref())?;
        let way = Way::of(options.route.as_ref())?;
        let routed = InterceptedService::new(connection.clone(), bearer.on(&way));
        let channel = InterceptedService::new(connection.clone(), bearer.clone());
        let limit = options.max_message_bytes;
        Ok(Self {
            url: url.to_owned(),
            rpc: MotionClient::new(channel.clone())
                .max_decoding_message_size(limit)
                .max_encoding_message_size(limit),
            sessions: SessionsClient::new(routed)
                .max_decoding_message_size(limit)
                .max_encoding_message_size(limit),
            skeletons: SkeletonsClient::new(channel.clone())
                .max_decoding_message_size(limit)
                .max_encoding_message_size(limit),
            bearer,
            options,
            connection,
            channel,
            way,
        })
    }

    /// The address that this client is connected to.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// The packs that the server has loaded.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn packs(&self) -> Result<Vec<Pack>, ClientError> {
        let answer = self
            .rpc
            .clone()
            .list_packs(ListPacksRequest {})
            .await
            .map_err(|s| self.sort(&s))?;
        let packs = answer.into_inner().packs;
        Ok(packs.into_iter().map(Pack::try_from).collect::<Result<_, _>>()?)
    }

    /// A pack by its name. The empty name stands for the server's default pack.
    ///
    /// # Errors
    /// See [`ClientError`]; [`ClientError::Refused`] with `NotFound` if the server has no such
    /// pack.
    pub async fn pack(&self, name: &str) -> Result<Pack, ClientError> {
        if name.is_empty() {
            return self.default_pack().await;
        }
        let request = GetPackRequest {
            name: name.to_owned(),
        };
        let answer = self
            .rpc
            .clone()
            .get_pack(request)
            .await
            .map_err(|s| self.sort(&s))?;
        Ok(Pack::try_from(answer.into_inner())?)
    }

    async fn default_pack(&self) -> Result<Pack, ClientError> {
        let packs = self.packs().await?;
        let default = packs.into_iter().find(|pack| pack.description().is_default);
        Ok(default.ok_or(AnswerError::Missing("default pack"))?)
    }

    /// Fills one gap on a pack's skeleton.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn in_between(&self, pack: &Pack, gap: &InBetween) -> Result<InBetweenAnswer, ClientError> {
        let mut answers = self.in_between_many(pack, std::slice::from_ref(gap)).await?;
        Ok(answers
            .characters
            .pop()
            .ok_or(AnswerError::Missing("characters"))?)
    }

    /// Fills many gaps, one for each character, in one request.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn in_between_many(
        &self,
        pack: &Pack,
        gaps: &[InBetween],
    ) -> Result<InBetweenAnswers, ClientError> {
        let characters = gaps
            .iter()
            .map(|gap| gap.to_message(pack))
            .collect::<Result<Vec<_>, RequestError>>()?;
        let request = InBetweenRequest {
            pack: pack.name().to_owned(),
            characters,
            skeleton: pack.worn().to_owned(),
        };
        let answer = self
            .rpc
            .clone()
            .in_between(request)
            .await
            .map_err(|s| self.sort(&s))?
            .into_inner();
        if answer.characters.len() != gaps.len() {
            return Err(AnswerError::Length {
                field: "characters",
                got: answer.characters.len(),
                expected: gaps.len(),
            }
            .into());
        }
        let characters = answer
            .characters
            .into_iter()
            .map(|result| InBetweenAnswer::from_message(result, pack))
            .collect::<Result<_, _>>()?;
        Ok(InBetweenAnswers {
            pack: answer.pack,
            pack_version: answer.pack_version,
            characters,
            timing: answer.timing.ok_or(AnswerError::Missing("timing"))?,
        })
    }

    pub(crate) fn request_timeout(&self) -> Duration {
        self.options.request_timeout
    }

    /// The connection itself, for requests that are no gRPC calls.
    pub(crate) fn channel(&self) -> KeyedChannel {
        self.channel.clone()
    }

    pub(crate) fn sessions_rpc(&self) -> SessionsRpc {
        self.sessions.clone()
    }

    pub(crate) fn skeletons_rpc(&self) -> SkeletonsRpc {
        self.skeletons.clone()
    }

    pub(crate) fn scenes_rpc(&self, way: &Way) -> ScenesRpc {
        let routed = InterceptedService::new(self.connection.clone(), self.bearer.on(way));
        let limit = self.options.max_message_bytes;
        ScenesClient::new(routed)
            .max_decoding_message_size(limit)
            .max_encoding_message_size(limit)
    }

    pub(crate) fn sort(&self, status: &Status) -> ClientError {
        ClientError::from_status(status, &self.url, self.options.request_timeout)
    }
}

/// Connects a channel for generated clients, for calls that [`Client`] does not have. `tune` may
/// change the transport. Its calls have no route.
///
/// # Errors
/// [`ClientError::Address`], [`ClientError::Certificate`] and [`ClientError::Unreachable`].
pub async fn channel(
    url: &str,
    options: &ConnectOptions,
    tune: impl FnOnce(Endpoint) -> Endpoint,
) -> Result<KeyedChannel, ClientError> {
    let bearer = Bearer::new(url, options.key.as_ref())?;
    let connection = dial(url, options, tune).await?;
    Ok(InterceptedService::new(connection, bearer))
}

async fn dial(
    url: &str,
    options: &ConnectOptions,
    tune: impl FnOnce(Endpoint) -> Endpoint,
) -> Result<Channel, ClientError> {
    let endpoint = tune(endpoint(url, options)?);
    endpoint.connect().await.map_err(|e| ClientError::Unreachable {
        url: url.to_owned(),
        reason: deepest(&e),
    })
}

/// Reads the address and applies the options. Small messages must not wait for large ones, so
/// Nagle's algorithm is off.
fn endpoint(url: &str, options: &ConnectOptions) -> Result<Endpoint, ClientError> {
    let fault = |reason: String| ClientError::Address {
        url: url.to_owned(),
        reason,
    };
    let endpoint = Endpoint::from_shared(url.to_owned()).map_err(|e| fault(deepest(&e)))?;
    let endpoint = match endpoint.uri().scheme_str() {
        Some("http") => endpoint,
        Some("https") => with_tls(endpoint, url, &options.tls)?,
        Some(other) => {
            return Err(fault(format!(
                "{other}:// is not supported, only http:// and https://"
            )));
        }
        None => return Err(fault("http:// is missing in front".to_owned())),
    };
    Ok(endpoint
        .tcp_nodelay(true)
        .connect_timeout(options.connect_timeout)
        .timeout(options.request_timeout)
        .http2_keep_alive_interval(Duration::from_secs(20))
        .keep_alive_while_idle(true))
}

#[cfg(test)]
mod tests {
    use super::*;

    async fn error(url: &str) -> ClientError {
        Client::connect(url).await.expect_err("no server is there")
    }

    #[test]
    fn a_key_is_put_on_calls_and_does_not_show() {
        let key = ApiKey::from("troupe_1".to_owned());
        assert_eq!(format!("{key:?}"), "ApiKey");
        let mut bearer = Bearer::new("http://a", Some(&key)).unwrap();
        let call = bearer.call(Request::new(())).unwrap();
        assert_eq!(call.metadata().len(), 1);
        assert_eq!(call.metadata().get("authorization").unwrap(), "Bearer troupe_1");
        assert!(!format!("{bearer:?}").contains("troupe_1"));
        let none = Bearer::new("http://a", None)
            .unwrap()
            .call(Request::new(()))
            .unwrap();
        assert!(none.metadata().is_empty());
        let wrong = ApiKey::from("a\nb".to_owned());
        assert!(Bearer::new("http://a", Some(&wrong)).is_err());
    }

    #[tokio::test]
    async fn without_a_server_the_error_has_address_and_cause() {
        // The port was free a moment ago, so no server listens there.
        let port = std::net::TcpListener::bind("127.0.0.1:0")
            .unwrap()
            .local_addr()
            .unwrap()
            .port();
        let url = format!("http://127.0.0.1:{port}");
        let error = error(&url).await;
        assert!(
            matches!(&error, ClientError::Unreachable { url: named, .. } if *named == url),
            "{error:?}"
        );
        assert!(error.to_string().contains("refused"), "{error}");
    }

    #[tokio::test]
    async fn an_invalid_address_has_its_own_error() {
        for (url, wanted) in [
            ("127.0.0.1:8080", "http://"),
            ("localhost", "http://"),
            ("ftp://127.0.0.1:8080", "ftp"),
            ("http://", "not a server address"),
            ("http://a b", "not a server address"),
        ] {
            let error = error(url).await;
            assert!(matches!(error, ClientError::Address { .. }), "{url}: {error:?}");
            assert!(error.to_string().contains(wanted), "{url}: {error}");
        }
    }

    #[cfg(not(feature = "tls"))]
    #[tokio::test]
    async fn without_the_feature_there_is_no_tls() {
        let error = error("https://127.0.0.1:8080").await;
        assert!(error.to_string().contains("feature `tls`"), "{error}");
    }

    #[cfg(feature = "tls")]
    #[tokio::test]
    async fn a_certificate_that_cannot_be_read_is_named() {
        let options = ConnectOptions {
            tls: TlsOptions {
                ca: Some("/nowhere/ca.pem".into()),
                ..TlsOptions::default()
            },
            ..ConnectOptions::default()
        };
        let error = Client::connect_with("https://127.0.0.1:8080", options)
            .await
            .expect_err("there is no file");
        assert!(matches!(error, ClientError::Certificate { .. }), "{error:?}");
        assert!(error.to_string().contains("/nowhere/ca.pem"), "{error}");
    }
}
