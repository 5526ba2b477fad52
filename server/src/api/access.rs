//! Which calls need which role, and who has it.

use std::sync::Arc;

use axum::Router;
use axum::extract::{Request, State};
use axum::middleware::{self, Next};
use axum::response::Response;
use http::{HeaderMap, Method, header};

use super::credentials::Credentials;
use super::error::ApiError;
use super::keys::{Keys, Role};
use super::reserve::GRPC_HEALTH;
use crate::clients::{Client, Clients};

/// Paths that need no key: health, and the documentation, which says the same of every server.
const OPEN: [&str; 5] = ["/", "/healthz", "/readyz", "/openapi.json", "/docs"];
/// How the names of procedures begin that write styles, scenes and definitions.
const WRITES: [&str; 5] = ["Put", "Delete", "Add", "Move", "Remove"];
/// The same over HTTP, where it is neither PUT nor DELETE.
const HTTP_WRITES: [&str; 3] = ["/add", "/move", "/remove"];

/// The role that a call needs; none where it needs no key.
fn needed(method: &Method, path: &str) -> Option<Role> {
    if OPEN.contains(&path) || path.starts_with("/docs/") || path.starts_with(GRPC_HEALTH) {
        return None;
    }
    if path == "/metrics" {
        return Some(Role::Admin);
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

/// Who may come in, and what they share.
#[derive(Clone)]
struct Access {
    credentials: Arc<Credentials>,
    clients: Arc<Clients>,
}

/// Checks the keys of all calls. From here on the client of a call is its key, not its connection.
pub(super) fn locked(router: Router, credentials: Arc<Credentials>, clients: Arc<Clients>) -> Router {
    let access = Access { credentials, clients };
    router.layer(middleware::from_fn_with_state(access, check))
}

async fn check(State(access): State<Access>, mut request: Request, next: Next) -> Response {
    match allowed(&access.credentials.keys(), &request) {
        Ok(None) => {}
        Ok(Some(name)) => {
            let connected = request.extensions().get::<Arc<Client>>().cloned();
            let connected = connected.unwrap_or_else(|| access.clients.within());
            let client = access.clients.with_key(name, &connected);
            request.extensions_mut().insert(client);
        }
        Err(error) => return error.in_kind(request.headers()),
    }
    next.run(request).await
}

/// The name of the key that allows a call; none where it needs no key.
fn allowed<'a>(keys: &'a Keys, request: &Request) -> Result<Option<&'a str>, ApiError> {
    let path = request.uri().path();
    let Some(needed) = needed(request.method(), path) else {
        return Ok(None);
    };
    let key = key(request.headers()).ok_or(ApiError::NoKey)?;
    let (name, role) = keys.find(key).ok_or(ApiError::UnknownKey)?;
    if role < needed {
        tracing::debug!(key = name, path, "a key's role does not allow a call");
        return Err(ApiError::RoleTooLow { role, needed });
    }
    Ok(Some(name))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::api::document;
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
                    "/metrics" => Some(Role::Admin),
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
