//! The role that each call needs.

use http::Method;

use super::front::GRPC_HEALTH;
use super::http::ASSETS;
use troupe_edge::clients::Role;

/// Paths that need no key. Health checks, documentation and viewer hold nothing that is private to
/// a server.
const OPEN: [&str; 5] = ["/", "/healthz", "/readyz", "/openapi.json", "/docs"];
/// Prefixes of the procedures that write styles, scenes, definitions and skeletons.
const WRITES: [&str; 5] = ["Put", "Delete", "Add", "Move", "Remove"];
/// Procedures that change the packs of all tenants.
const OPERATES: [&str; 3] = ["LoadPack", "UnloadPack", "SwapPack"];
/// Endings of HTTP paths that write with a method other than PUT and DELETE.
const HTTP_WRITES: [&str; 3] = ["/add", "/move", "/remove"];

/// The role that a call needs. None: the call needs no key.
pub(super) fn needed(method: &Method, path: &str) -> Option<Role> {
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
    if *method == Method::POST && path.starts_with("/v1/packs/") {
        return Some(Role::Admin);
    }
    let writes = match path.starts_with("/troupe.v1.") {
        true => {
            let rpc = path.rsplit('/').next().unwrap_or_default();
            if OPERATES.contains(&rpc) {
                return Some(Role::Admin);
            }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::api::document;
    use troupe_proto::rpc::RPCS;

    /// The procedures that only authors may call. All others are for everybody with a key.
    const AUTHORS: [&str; 10] = [
        "AddObjects",
        "DeleteObjectDefinition",
        "DeleteScene",
        "DeleteSkeleton",
        "MoveObjects",
        "PutObjectDefinition",
        "PutScene",
        "PutSkeleton",
        "PutStyle",
        "RemoveObjects",
    ];

    #[test]
    fn authors_write_and_all_others_read_and_drive() {
        let role = |rpc: &str| match AUTHORS.contains(&rpc) {
            _ if rpc.ends_with("Pack") && rpc != "GetPack" => Some(Role::Admin),
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
        assert!(count > 28, "{count}");
        assert_eq!(needed(&Method::GET, "/v1/nowhere"), Some(Role::Drive));
        assert_eq!(needed(&Method::PATCH, "/v1/scenes/a"), Some(Role::Author));
        assert_eq!(needed(&Method::GET, "/docsx"), Some(Role::Drive));
        assert_eq!(needed(&Method::GET, "/assets/index.js"), None);
    }
}
