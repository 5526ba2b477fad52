//! Which calls need which role, and who has it.

use std::sync::Arc;

use axum::extract::{Request, State};
use axum::middleware::{self, Next};
use axum::response::Response;
use axum::{Extension, Router};
use http::{HeaderMap, Method, header};

use super::credentials::{Admitted, Credentials};
use super::error::ApiError;
use super::http::ASSETS;
use super::reserve::GRPC_HEALTH;
use crate::clients::{Client, Clients, Role};

/// Paths that need no key: health, and the documentation and the viewer, which are the same of
/// every server.
const OPEN: [&str; 5] = ["/", "/healthz", "/readyz", "/openapi.json", "/docs"];
/// The one path that a ticket opens, and the parameter that it comes in.
const STREAM: &str = "/v1/drive";
const TICKET: &str = "ticket=";
/// How the names of procedures begin that write styles, scenes and definitions.
const WRITES: [&str; 5] = ["Put", "Delete", "Add", "Move", "Remove"];
/// The same over HTTP, where it is neither PUT nor DELETE.
const HTTP_WRITES: [&str; 3] = ["/add", "/move", "/remove"];

/// The role that a call needs; none where it needs no key.
fn needed(method: &Method, path: &str) -> Option<Role> {
    if OPEN.contains(&path)
        || path.starts_with("/docs/")
        || path.starts_with(ASSETS)
        || path.starts_with(GRPC_HEALTH)
    {
        return None;
    }
    if path == "/metrics" {
        return Some(Role::Metrics);
    }
    let writes = match path.starts_with("/troupe.v1.") {
        true => {
            let rpc = path.rsplit('/').next().unwrap_or_default();
            WRITES.iter().any(|verb| rpc.starts_with(verb))
        }
        false => match *method {
            Method::GET | Method::HEAD | Method::OPTIONS => false,
            Method::POST => {
                path.starts_with("/v1/scenes/") && HTTP_WRITES.iter().any(|verb| path.ends_with(verb))
            }
            Method::DELETE => !path.starts_with("/v1/sessions/"),
            _ => true,
        },
    };
    Some(if writes { Role::Author } else { Role::Drive })
}

/// The key of a request.
fn key(headers: &HeaderMap) -> Option<&str> {
    let (scheme, key) = headers
        .get(header::AUTHORIZATION)?
        .to_str()
        .ok()?
        .split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then(|| key.trim())
}

/// The ticket of a request for a stream.
fn ticket(request: &Request) -> Option<&str> {
    let uri = request.uri();
    let parameters = uri.query().filter(|_| uri.path() == STREAM)?;
    parameters
        .split('&')
        .find_map(|parameter| parameter.strip_prefix(TICKET))
}

/// Who may come in, and what they share.
#[derive(Clone)]
struct Access {
    credentials: Arc<Credentials>,
    clients: Arc<Clients>,
}

/// Checks the keys of all calls. From here on the client of a call is its key, not its connection.
pub(super) fn locked(router: Router, credentials: Arc<Credentials>, clients: Arc<Clients>) -> Router {
    let access = Access {
        credentials: credentials.clone(),
        clients,
    };
    router
        .layer(Extension(credentials))
        .layer(middleware::from_fn_with_state(access, check))
}

async fn check(State(access): State<Access>, mut request: Request, next: Next) -> Response {
    match allowed(&access.credentials, &request) {
        Ok(None) => {}
        Ok(Some(admitted)) => {
            let extensions = request.extensions_mut();
            let connected = extensions.get::<Arc<Client>>().cloned();
            let connected = connected.unwrap_or_else(|| access.clients.within());
            extensions.insert(
                access
                    .clients
                    .with_key(&admitted.account, admitted.quota, &connected),
            );
            extensions.insert(admitted.identity.clone());
            extensions.insert(admitted);
        }
        Err(error) => return error.in_kind(request.headers()),
    }
    next.run(request).await
}

/// Who it is whose call is allowed; none where it needs no key.
fn allowed(credentials: &Credentials, request: &Request) -> Result<Option<Admitted>, ApiError> {
    let path = request.uri().path();
    let Some(needed) = needed(request.method(), path) else {
        return Ok(None);
    };
    let admitted = match (key(request.headers()), ticket(request)) {
        (Some(key), _) => credentials.admit(key)?,
        (None, Some(ticket)) => credentials
            .tickets()
            .redeem(ticket)
            .ok_or(ApiError::UnknownTicket)?,
        (None, None) => return Err(ApiError::NoKey),
    };
    let role = admitted.identity.role;
    if !role.may(needed) {
        tracing::debug!(key = %admitted.identity.name, path, "a key's role does not allow a call");
        return Err(ApiError::RoleTooLow { role, needed });
    }
    Ok(Some(admitted))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::api::{Keys, document};
    use crate::clients::{Identity, Share, Shares};
    use troupe_base::telemetry::Telemetry;
    use troupe_proto::rpc::RPCS;

    /// The procedures that only authors may call. All others are for everybody with a key.
    const AUTHORS: [&str; 8] = [
        "AddObjects",
        "DeleteObjectDefinition",
        "DeleteScene",
        "MoveObjects",
        "PutObjectDefinition",
        "PutScene",
        "PutStyle",
        "RemoveObjects",
    ];

    #[test]
    fn authors_write_and_all_others_read_and_drive() {
        let role = |rpc: &str| match AUTHORS.contains(&rpc) {
            true => Some(Role::Author),
            false => Some(Role::Drive),
        };
        for rpc in RPCS {
            let path = format!("/troupe.v1.Any/{}", rpc.name);
            assert_eq!(needed(&Method::POST, &path), role(rpc.name), "{path}");
        }
        for author in AUTHORS {
            assert!(RPCS.iter().any(|rpc| rpc.name == author), "there is no {author}");
        }
        let mut count = 0;
        for (path, item) in document().paths.paths {
            let methods = [
                (Method::GET, item.get),
                (Method::POST, item.post),
                (Method::PUT, item.put),
                (Method::DELETE, item.delete),
            ];
            for (method, operation) in methods {
                let Some(id) = operation.and_then(|operation| operation.operation_id) else {
                    continue;
                };
                let expected = match path.as_str() {
                    "/healthz" | "/readyz" => None,
                    "/metrics" => Some(Role::Metrics),
                    _ => role(&id),
                };
                assert_eq!(needed(&method, &path), expected, "{method} {path}");
                count += 1;
            }
        }
        assert!(count > 25, "{count}");
        assert_eq!(needed(&Method::GET, "/v1/nowhere"), Some(Role::Drive));
        assert_eq!(needed(&Method::PATCH, "/v1/scenes/a"), Some(Role::Author));
        assert_eq!(needed(&Method::GET, "/docsx"), Some(Role::Drive));
        assert_eq!(needed(&Method::GET, "/assets/index.js"), None);
    }

    #[tokio::test]
    async fn a_call_carries_who_calls() {
        let entry = super::super::keys::entry("game", Role::Drive, "secret") + "tenant = \"a\"\n";
        let credentials = Credentials::new(Keys::read(&entry).unwrap(), Keys::default(), None);
        let share = Share {
            bytes: 1024,
            streams: 1,
        };
        let shares = Shares {
            client: share,
            address: share,
            all: share,
        };
        let clients = Clients::new(shares, &Telemetry::new().unwrap());
        let who = |identity: Extension<Identity>| async move { format!("{:?}", identity.0) };
        let router = Router::new().route("/v1/who", axum::routing::get(who));
        let mut router = locked(router, Arc::new(credentials), Arc::new(clients));
        let request = Request::builder()
            .uri("/v1/who")
            .header(header::AUTHORIZATION, "Bearer secret")
            .body(axum::body::Body::empty())
            .unwrap();
        let response = tower::Service::call(&mut router, request).await.unwrap();
        let text = axum::body::to_bytes(response.into_body(), 1000).await.unwrap();
        let expected = Identity {
            name: "game".into(),
            role: Role::Drive,
            tenant: Some("a".into()),
        };
        assert_eq!(text, format!("{expected:?}"));
    }

    #[test]
    fn a_ticket_comes_with_a_stream_alone() {
        let of = |uri: &str| {
            let request = Request::builder()
                .uri(uri)
                .body(axum::body::Body::empty())
                .unwrap();
            ticket(&request).map(str::to_owned)
        };
        assert_eq!(of("/v1/drive?ticket=a").as_deref(), Some("a"));
        assert_eq!(of("/v1/drive?x=1&ticket=a&y").as_deref(), Some("a"));
        for none in ["/v1/drive", "/v1/drive?tickets=a", "/v1/packs?ticket=a"] {
            assert_eq!(of(none), None, "{none}");
        }
    }

    #[test]
    fn a_key_comes_as_a_bearer() {
        let of = |text: &str| {
            let headers = HeaderMap::from_iter([(header::AUTHORIZATION, text.parse().unwrap())]);
            key(&headers).map(str::to_owned)
        };
        assert_eq!(of("Bearer abc").as_deref(), Some("abc"));
        assert_eq!(of("bearer abc").as_deref(), Some("abc"));
        for wrong in ["abc", "Basic abc", "Bearer"] {
            assert_eq!(of(wrong), None, "{wrong}");
        }
    }
}
