//! The OpenAPI document of the HTTP interface.

use utoipa::OpenApi as _;

use super::{http, ws};

#[derive(utoipa::OpenApi)]
#[openapi(
    info(
        title = "Troupe",
        description = "Live characters and motion in-betweening, for many characters at once. Right-handed, Y up, +Z forward; \
                       metres, seconds, radians; quaternions as w, x, y, z. Sessions may have another convention. The \
                       same messages travel over gRPC as troupe.v1.Motion, troupe.v1.Sessions and troupe.v1.Scenes on the same port. A \
                       missing field takes its default (0, false or empty); unknown fields are refused.",
    ),
    paths(
        http::in_between,
        http::generate::generate,
        http::list_packs,
        http::get_pack,
        http::sessions::create,
        http::sessions::list,
        http::sessions::get,
        http::sessions::close,
        http::sessions::peek,
        http::sessions::command,
        http::sessions::step,
        ws::drive,
        http::sessions::list_styles,
        http::sessions::get_style,
        http::sessions::put_style,
        http::scenes::list,
        http::scenes::put,
        http::scenes::get,
        http::scenes::delete,
        http::scenes::add,
        http::scenes::move_objects,
        http::scenes::remove,
        http::scenes::detect,
        http::scenes::list_objects,
        http::scenes::put_object,
        http::scenes::get_object,
        http::scenes::delete_object,
        http::healthz,
        http::readyz,
        http::metrics
    ),
    components(schemas(troupe_proto::v1::DriveRequest)),
    tags(
        (name = "motion", description = "Single requests: motion between keyframes"),
        (name = "sessions", description = "Live characters"),
        (name = "styles", description = "Ways to move"),
        (name = "scenes", description = "What characters stand on and use"),
        (name = "objects", description = "What characters can do with things"),
        (name = "operations", description = "What operators need"),
    )
)]
struct Document;

/// The OpenAPI document.
pub fn document() -> utoipa::openapi::OpenApi {
    Document::openapi()
}
