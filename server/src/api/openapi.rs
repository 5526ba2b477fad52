//! The OpenAPI document of the HTTP interface.

use utoipa::OpenApi as _;

use super::http;

#[derive(utoipa::OpenApi)]
#[openapi(
    info(
        title = "Troupe",
        description = "Motion in-betweening for many characters at once. Right-handed, Y up, +Z forward; metres, seconds, \
                       radians; quaternions as w, x, y, z. The same messages travel over gRPC as troupe.v1.Motion on the \
                       same port. A missing field takes its default (0, false or empty); unknown fields are refused.",
    ),
    paths(
        http::in_between,
        http::list_packs,
        http::get_pack,
        http::healthz,
        http::readyz,
        http::metrics
    ),
    tags(
        (name = "motion", description = "What the server is for"),
        (name = "operations", description = "What operators need"),
    )
)]
struct Document;

/// The OpenAPI document.
pub fn document() -> utoipa::openapi::OpenApi {
    Document::openapi()
}
