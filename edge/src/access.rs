//! Checks the key, token or ticket of each call, and whether its role allows the call.

use std::sync::Arc;

use axum::extract::{Request, State};
use axum::middleware::{self, Next};
use axum::response::Response;
use axum::{Extension, Router};
use http::{HeaderMap, header};

use super::admitted::Admitted;
use super::clients::{Client, Clients, Identity, Role};
use super::credentials::Credentials;
use super::{EdgeError, Front, Lease, is_grpc};

/// Start of the query parameter with a ticket.
const TICKET: &str = "ticket=";

/// The key or token in a request's header `Authorization`.
fn key(headers: &HeaderMap) -> Option<&str> {
    let (scheme, key) = headers
        .get(header::AUTHORIZATION)?
        .to_str()
        .ok()?
        .split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then(|| key.trim())
}

/// The ticket of a request, if its path is `ticketed`.
fn ticket<'a>(request: &'a Request, ticketed: &str) -> Option<&'a str> {
    let uri = request.uri();
    let parameters = uri.query().filter(|_| uri.path() == ticketed)?;
    parameters
        .split('&')
        .find_map(|parameter| parameter.strip_prefix(TICKET))
}

/// State of the middleware.
#[derive(Clone)]
struct Access {
    credentials: Arc<Credentials>,
    clients: Arc<Clients>,
    front: Front,
}

impl Access {
    /// The caller of an allowed call; none if the call needs no key.
    fn allowed(&self, request: &Request) -> Result<Option<Admitted>, EdgeError> {
        let path = request.uri().path();
        let Some(needed) = (self.front.needed)(request.method(), path) else {
            return Ok(None);
        };
        let admitted = match (key(request.headers()), ticket(request, self.front.ticketed)) {
            (Some(key), _) => self.credentials.admit(key)?,
            (None, Some(ticket)) => self.credentials.redeem(ticket)?,
            (None, None) => return Err(EdgeError::NoKey),
        };
        let Identity { role, ref tenant, .. } = admitted.identity;
        let is_of_all = matches!(needed, Role::Metrics | Role::Admin);
        if is_of_all && role == Role::Admin && tenant.is_some() {
            return Err(EdgeError::OfTenant { needed });
        }
        if !role.may(needed) {
            tracing::debug!(key = %admitted.identity.name, path, "a key's role does not allow a call");
            return Err(EdgeError::RoleTooLow { role, needed });
        }
        Ok(Some(admitted))
    }
}

/// Checks the keys of all calls. Behind this middleware the client of a call is its key, not its
/// connection.
pub fn locked(router: Router, front: Front, credentials: Arc<Credentials>, clients: Arc<Clients>) -> Router {
    let access = Access {
        credentials: credentials.clone(),
        clients,
        front,
    };
    router
        .layer(Extension(credentials))
        .layer(middleware::from_fn_with_state(access, check))
}

async fn check(State(access): State<Access>, mut request: Request, next: Next) -> Response {
    match access.allowed(&request) {
        Ok(None) => {}
        Ok(Some(admitted)) => {
            let authorization = request.headers().get(header::AUTHORIZATION).cloned();
            let extensions = request.extensions_mut();
            let connected = extensions.get::<Arc<Client>>().cloned();
            let connected = connected.unwrap_or_else(|| access.clients.within());
            let lease = Lease::new(access.credentials.clone(), admitted.clone());
            extensions.insert(access.clients.with_key(
                &admitted.account,
                admitted.quota,
                authorization.as_ref(),
                &connected,
            ));
            extensions.insert(admitted.identity.clone());
            extensions.insert(admitted);
            extensions.insert(lease.clone());
            if (access.front.is_lasting)(request.uri().path()) {
                let grpc = is_grpc(request.headers());
                return lease.limit(next.run(request).await, access.front, grpc);
            }
        }
        Err(error) => return access.front.turn_away(&error, request.headers()),
    }
    next.run(request).await
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clients::{Share, Shares};
    use crate::keys::{self, Keys};
    use troupe_base::telemetry::Telemetry;

    /// Every call needs a key.
    const FRONT: Front = Front {
        needed: |_, _| Some(Role::Drive),
        is_rpc: |_| false,
        is_stream: |_| false,
        is_lasting: |_| false,
        is_health: |_| false,
        ticketed: "/v1/drive",
        answer: |error, _| panic!("{error}"),
    };

    /// Who may call, from the entries of a file of keys.
    fn credentials(entries: &str) -> Arc<Credentials> {
        let keys = Keys::read(entries).unwrap();
        Arc::new(Credentials::new(keys, Keys::default(), None))
    }

    /// Clients with the smallest shares.
    fn clients() -> Arc<Clients> {
        let share = Share {
            bytes: 1024,
            streams: 1,
            sessions: 1,
        };
        let shares = Shares {
            client: share,
            address: share,
            all: share,
        };
        Arc::new(Clients::new(shares, &Telemetry::new().unwrap()))
    }

    #[tokio::test]
    async fn a_call_carries_its_callers_identity() {
        let entry = keys::entry("game", Role::Drive, "secret") + "tenant = \"a\"\n";
        let who = |identity: Extension<Identity>| async move { format!("{:?}", identity.0) };
        let router = Router::new().route("/v1/who", axum::routing::get(who));
        let mut router = locked(router, FRONT, credentials(&entry), clients());
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

    #[tokio::test]
    async fn the_packs_of_all_tenants_are_not_a_tenants_admins() {
        let of_tenant = keys::entry("studio", Role::Admin, "studio") + "tenant = \"a\"\n";
        let entries =
            of_tenant + &keys::entry("ops", Role::Admin, "ops") + &keys::entry("game", Role::Author, "game");
        let access = Access {
            credentials: credentials(&entries),
            clients: clients(),
            front: Front {
                needed: |_, _| Some(Role::Admin),
                ..FRONT
            },
        };
        let allowed = |key: &str| {
            let request = Request::builder().header(header::AUTHORIZATION, format!("Bearer {key}"));
            let request = request.body(axum::body::Body::empty()).unwrap();
            access
                .allowed(&request)
                .map(|_| ())
                .map_err(|error| error.to_string())
        };
        assert_eq!(allowed("ops"), Ok(()));
        let refused = "the key is of a tenant, and packs are of all tenants; allowed: a key of the role admin \
                       without a tenant";
        assert_eq!(allowed("studio"), Err(refused.to_owned()));
        assert_eq!(
            allowed("game"),
            Err("the key's role is author; allowed: admin".to_owned())
        );
    }

    #[test]
    fn a_ticket_only_counts_for_a_stream() {
        let of = |uri: &str| {
            let request = Request::builder()
                .uri(uri)
                .body(axum::body::Body::empty())
                .unwrap();
            ticket(&request, FRONT.ticketed).map(str::to_owned)
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
